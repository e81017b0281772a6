"""Universal files, read and written back with other coordinates in the columns they were read from."""

from __future__ import annotations

import math
from collections import Counter
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.losses import number_not_kept
from dvr_cli.files.numbers_in_text import fitted, write_texts
from dvr_cli.files.source import Source, differing
from dvr_cli.files.tags import TagIndex, first_repeated
from dvr_cli.files.unv.contents import (
    GROUPS,
    NODES,
    Elements,
    Group,
    Nodes,
    read_elements,
    read_groups,
    read_nodes,
)
from dvr_cli.files.unv.datasets import UniversalFile
from dvr_cli.files.unv.elements import NODE_ORDER
from dvr_cli.mesh.mesh import Cells, Mesh

_READ = (*NODES, "2412", "2420", "151", "164")  # 151: who wrote it and when, 164: units


class UnvSource(Source):
    """A universal file."""

    format = "unv"

    def __init__(self, data: bytes, mesh: Mesh, nodes: Nodes) -> None:
        super().__init__()
        self.mesh = mesh
        self._data = data
        self._points = mesh.points.copy()  # as read, whatever becomes of the mesh
        self._nodes = nodes

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the file with the coordinates ``points`` ((N, 3)), rounded where columns are narrow."""
        changed = differing(points, self._points)
        ends = self._nodes.ends[changed]
        starts = self._nodes.starts[changed]
        widths = np.broadcast_to(self._nodes.widths[:, None], changed.shape)[changed]
        begins = np.where(widths > 0, ends - widths, starts)
        texts = []
        for value, width, start, end in zip(
            points[changed].tolist(), widths.tolist(), starts.tolist(), ends.tolist(), strict=True
        ):
            exponent = "D" if b"D" in self._data[start:end].upper() else "E"
            texts.append(_text(value, width, exponent).encode())
        order = np.argsort(begins)
        write_texts(file, self._data, begins[order], ends[order], (texts[i] for i in order.tolist()))

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of the output gets: rounded to the columns of dataset 15."""
        in_columns = (self._nodes.widths > 0) & (self._nodes.widths < 25)
        narrow = differing(points, self._points) & in_columns[:, None]
        if not narrow.any():
            return points
        result = points.copy()
        widths = np.broadcast_to(self._nodes.widths[:, None], narrow.shape)[narrow].tolist()
        values = points[narrow].tolist()
        result[narrow] = [float(_text(v, w, "E")) for v, w in zip(values, widths, strict=True)]
        return result


def read(data: bytes) -> UnvSource:
    """Read a universal file.

    Cells come in one block for each type; numbers of their physical properties and materials are the cell
    data "unv:property" and "unv:material", and "unv:group" numbers the combinations of groups they are in.
    Groups are cell and point sets. Nodes of springs, masses and rigid elements come as vertex cells.

    Raises InputError for what is damaged, for elements that have no cell type, and for nodes in coordinate
    systems other than the global one.
    """
    file = UniversalFile(data)
    nodes = read_nodes(file)
    repeated = first_repeated(nodes.labels)
    if repeated is not None:
        raise InputError(f"there are two nodes {repeated}")
    elements = read_elements(file)
    index = TagIndex(nodes.labels)
    blocks = [_cells(part, index) for part in elements]
    mesh = Mesh(nodes.points, blocks)
    if elements:
        mesh.cell_data = {
            "unv:property": [part.properties for part in elements],
            "unv:material": [part.materials for part in elements],
        }
    groups = read_groups(file)
    _add_groups(mesh, groups, elements, index)
    source = UnvSource(data, mesh, nodes)
    known = {*_READ, *GROUPS}
    others = [dataset.number for dataset in file.datasets if dataset.number not in known]
    source.unread = [
        line
        for number, n in Counter(others).items()
        for line in number_not_kept(n, f"dataset of kind {number}")
    ]
    return source


def _cells(part: Elements, index: TagIndex) -> Cells:
    vertices = index.find(part.nodes)
    if (vertices < 0).any():
        row, column = np.argwhere(vertices < 0)[0]
        raise InputError(f"element {part.labels[row]} has node {part.nodes[row, column]}, which is missing")
    order = NODE_ORDER.get(part.cell_type, range(vertices.shape[1]))
    return Cells(part.cell_type, vertices[:, order].astype(np.int64))


def _add_groups(mesh: Mesh, groups: list[Group], elements: list[Elements], index: TagIndex) -> None:
    combination = [np.zeros(len(part.labels), dtype=np.int64) for part in elements]
    for group in groups:
        if len(group.elements):
            members = [np.flatnonzero(np.isin(part.labels, group.elements)) for part in elements]
            before = mesh.cell_sets.get(group.name)
            if before is not None:
                members = [np.union1d(a, b) for a, b in zip(before, members, strict=True)]
            mesh.cell_sets[group.name] = members
        found = index.find(group.nodes)
        if len(found):
            old = mesh.point_sets.get(group.name, np.empty(0, np.int64))
            mesh.point_sets[group.name] = np.union1d(old, found[found >= 0])
    for members in mesh.cell_sets.values():
        within = [np.isin(np.arange(len(c)), m) for c, m in zip(combination, members, strict=True)]
        both = np.concatenate([2 * c + w for c, w in zip(combination, within, strict=True)])
        _, ranks = np.unique(both, return_inverse=True)
        combination = np.split(ranks, np.cumsum([len(c) for c in combination])[:-1])
    if mesh.cell_sets:
        mesh.cell_data["unv:group"] = combination


def _text(value: float, width: int, exponent: str) -> str:
    """The text of a coordinate: ``width`` columns, the first one blank; as long as it takes if that is 0."""
    if width == 0:
        return repr(value)
    exact = f"{value:.16E}"
    if len(exact) < width:
        return exact.replace("E", exponent).rjust(width)
    size = abs(value)
    if 1e-2 <= size < 1e7:
        decimals = width - 2 - max(1, math.floor(math.log10(size)) + 1) - (value < 0)
        text = f"{value:.{decimals}f}"
        if len(text) < width:
            return text.rjust(width)
    text = fitted(value, width - 1, exponent).decode() if math.isfinite(value) else repr(value)
    return text.rjust(width)
