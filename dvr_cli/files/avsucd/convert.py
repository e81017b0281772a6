"""Meshes of any origin as UCD files, text: linear cells, one region as their material, and labelled data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import OutputError
from dvr_cli.files.avsucd.source import MATERIAL, NODE_ORDER, TYPES, read
from dvr_cli.files.losses import lost
from dvr_cli.files.source import Source
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.regions import region_names

_WORDS = {cell_type: word for word, cell_type in TYPES.items()}


class ConvertedUcd(Source):
    """A mesh of another format, to be written as UCD."""

    format = "avsucd"

    def __init__(self, mesh: Mesh, unread: Sequence[str]) -> None:
        """unread: what the file of the mesh holds beyond it. Raises OutputError where UCD cannot hold it."""
        super().__init__()
        self.mesh = mesh
        self.unread = list(unread)
        strange = {block.type for block in mesh.cells if len(block.vertices)} - _WORDS.keys()
        if strange:
            raise OutputError(f"UCD has no cells of type {', '.join(sorted(strange))}")
        materials = next(
            iter([name for name in (MATERIAL, *region_names(mesh)) if name in mesh.cell_data]), ""
        )
        on_nodes = {name: _columns(values) for name, values in mesh.point_data.items()}
        on_cells = {
            name: np.concatenate([_columns(block) for block in blocks])
            for name, blocks in mesh.cell_data.items()
            if name != materials and len({_columns(block).shape[1] for block in blocks}) == 1
        }
        on_nodes, on_cells = (
            {name: values for name, values in data.items() if _kept(name, values)}
            for data in (on_nodes, on_cells)
        )
        n = sum(len(block.vertices) for block in mesh.cells)
        widths = [sum(values.shape[1] for values in data.values()) for data in (on_nodes, on_cells)]
        self._head = f"{len(mesh.points)} {n} {widths[0]} {widths[1]} 0\n".encode()
        parts, done = [], 0
        for b, block in enumerate(mesh.cells):
            tags = np.asarray(mesh.cell_data[materials][b]) if materials else np.zeros(len(block.vertices))
            order = np.argsort(NODE_ORDER.get(block.type, range(block.vertices.shape[1])))
            ids = np.arange(done, done + len(tags)) + 1
            done += len(tags)
            rows = np.column_stack([ids, tags.astype(np.int64), block.vertices[:, order] + 1])
            row = f"%d %d {_WORDS.get(block.type)} {' '.join(['%d'] * len(order))}\n"
            parts.append((row * len(rows)) % tuple(rows.ravel().tolist()))
        self._tail = "".join([*parts, _data_text(on_nodes), _data_text(on_cells)]).encode()

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the mesh with the coordinates ``points`` ((N, d)), the third one 0 where there is none."""
        file.write(self._bytes(points))

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates, every bit of which is kept; finds out, too, what is lost."""
        back = read(self._bytes(points)).mesh
        self.notes = [*self.unread, *lost(self.mesh, back, points)]
        return points

    def _bytes(self, points: np.ndarray) -> bytes:
        xyz = np.pad(points, ((0, 0), (0, 3 - points.shape[1]))).tolist()
        rows = "".join([f"{i} {x!r} {y!r} {z!r}\n" for i, (x, y, z) in enumerate(xyz, 1)])
        return self._head + rows.encode() + self._tail


def convert(mesh: Mesh, unread: Sequence[str]) -> ConvertedUcd:
    """A source that writes ``mesh`` as UCD; raises OutputError where UCD cannot hold it."""
    return ConvertedUcd(mesh, unread)


def _columns(values: np.ndarray) -> np.ndarray:
    """(n, k) values of n nodes or cells."""
    values = np.asarray(values)
    return values.reshape(len(values), -1) if values.size else values.reshape(len(values), 1)


def _kept(name: str, values: np.ndarray) -> bool:
    """True if data can be in the file: numbers under a label of one line."""
    plain = name.isprintable() and name.strip() == name and "," not in name and not name.startswith("#")
    return bool(name) and plain and values.dtype.kind in "iufb" and values.shape[1] in (1, 3)


def _data_text(data: dict[str, np.ndarray]) -> str:
    if not data:
        return ""
    head = " ".join(str(values.shape[1]) for values in data.values())
    labels = "".join(f"{name}, none\n" for name in data)
    table = np.concatenate([values.astype(np.float64) for values in data.values()], axis=1)
    rows = [f"{i} {' '.join(map(repr, row))}\n" for i, row in enumerate(table.tolist(), 1)]
    return f"{len(data)} {head}\n{labels}{''.join(rows)}"
