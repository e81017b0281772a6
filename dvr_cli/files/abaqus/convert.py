"""Meshes of other formats as decks: nodes, elements, and sets for their groups; the rest is for an analyst.

meshio's writer gives some cells types that programs read as others, hence this one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import OutputError
from dvr_cli.files.abaqus.numbers import text_of
from dvr_cli.files.abaqus.types import NODE_ORDER
from dvr_cli.files.losses import counted, links_not_kept, not_kept
from dvr_cli.files.source import Source
from dvr_cli.mesh.cell_types import topological_dimension
from dvr_cli.mesh.mesh import Cells, Mesh

_SOLID = {
    "tetra": "C3D4",
    "pyramid": "C3D5",
    "wedge": "C3D6",
    "hexahedron": "C3D8",
    "tetra10": "C3D10",
    "wedge15": "C3D15",
    "hexahedron20": "C3D20",
    "hexahedron27": "C3D27",
}
_PLANE = {"triangle": "CPS3", "quad": "CPS4", "triangle6": "CPS6", "quad8": "CPS8"}
_SHELL = {"triangle": "S3", "quad": "S4", "triangle6": "STRI65", "quad8": "S8R"}
_MOST_TAGS = 1000  # of one field; with more it numbers cells rather than groups of them
_A_LINE = 8


class ConvertedSource(Source):
    """A mesh of another format, to be written as a deck."""

    format = "abaqus"

    def __init__(self, mesh: Mesh, unread: Sequence[str]) -> None:
        """Raises OutputError for cells that no element type stands for."""
        super().__init__()
        self.mesh = mesh
        self.unread = list(unread)
        dimensions = [topological_dimension(block.type) or 0 for block in mesh.cells]
        filled = [b for b, block in enumerate(mesh.cells) if len(block.vertices)]
        top = max((dimensions[b] for b in filled), default=0)
        flat = mesh.points.shape[1] == 2 or bool((np.ptp(mesh.points[:, 2:], axis=0) == 0).all())
        types = _SOLID if top == 3 else _PLANE if flat else _SHELL
        self._types = {}
        self._written = []
        for b in filled:
            kind = mesh.cells[b].type
            if dimensions[b] < top:
                continue
            if kind not in types:
                raise OutputError(f"no element type of Abaqus stands for {kind} cells")
            self._written.append(b)
            self._types[b] = types[kind]
        self._sets = _sets(mesh)
        self._lost = [*self.unread, *_losses(mesh, self._written)]
        self.notes = self._lost

    def stored(self, points: np.ndarray) -> np.ndarray:
        """``points`` as the 20 characters of a number hold them."""
        self.notes = self._lost
        return np.array([float(text_of(x)) for x in points.ravel().tolist()]).reshape(points.shape)

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write a deck of the mesh with other coordinates."""
        self.notes = self._lost
        file.write(b"*HEADING\nMesh without materials, loads and steps\n*NODE\n")
        texts = [text_of(x) for x in points.ravel().tolist()]
        width = points.shape[1]
        lines = [
            b"%d, %s\n" % (i + 1, b", ".join(texts[i * width : (i + 1) * width])) for i in range(len(points))
        ]
        file.write(b"".join(lines))
        first = np.concatenate([[0], np.cumsum([len(block.vertices) for block in self.mesh.cells])])
        for b in self._written:
            file.write(b"*ELEMENT, TYPE=%s\n" % self._types[b].encode())
            file.write(_elements(self.mesh.cells[b], int(first[b])))
        used: set[str] = set()
        for name, members in self._sets.items():
            cells = np.concatenate([first[b] + members[b] for b in self._written])
            nodes = [
                self.mesh.cells[b].vertices[part]
                for b, part in enumerate(members)
                if b not in self._written and len(part)
            ]
            label = _label(name, used)
            if len(cells):
                file.write(b"*ELSET, ELSET=%s\n" % label + _numbers(cells + 1))
            if nodes:
                vertices = np.unique(np.concatenate([part.ravel() for part in nodes]))
                file.write(b"*NSET, NSET=%s\n" % label + _numbers(vertices + 1))
        used = set()
        for name, vertices in self.mesh.point_sets.items():
            if len(vertices):
                file.write(b"*NSET, NSET=%s\n" % _label(f"N_{name}", used) + _numbers(vertices + 1))


def convert(mesh: Mesh, unread: Sequence[str]) -> ConvertedSource:
    """A Source that writes a mesh as a deck.

    Cells of the highest dimension become elements: of solids, plane stress, or shells where they are not in
    a plane z = const. Groups of these become element sets, groups of cells of lower dimension node sets.
    unread: what the file of the mesh holds beyond it. Raises OutputError for cells of other types.
    """
    return ConvertedSource(mesh, unread)


def _elements(block: Cells, first: int) -> bytes:
    order = NODE_ORDER.get(block.type)
    vertices = block.vertices if order is None else block.vertices[:, np.argsort(order)]
    ids = np.arange(first + 1, first + 1 + len(vertices))[:, None]
    rows = np.concatenate([ids, vertices.astype(np.int64) + 1], axis=1)
    line = ", ".join(["%d"] * rows.shape[1])
    if rows.shape[1] > 16:  # Abaqus reads so many numbers a line
        line = ", ".join(["%d"] * 15) + ",\n" + ", ".join(["%d"] * (rows.shape[1] - 15))
    return "".join([line % tuple(row) + "\n" for row in rows.tolist()]).encode()


def _numbers(ids: np.ndarray) -> bytes:
    texts = [str(i) for i in ids.tolist()]
    lines = [", ".join(texts[i : i + _A_LINE]) for i in range(0, len(texts), _A_LINE)]
    return (",\n".join(lines) + "\n").encode()


def _label(name: str, used: set[str]) -> bytes:
    """A name as Abaqus takes it, that no other set has."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)[:60]
    plain = plain if plain[:1].isalpha() else f"S_{plain}"
    label, n = plain, 1
    while label.upper() in used:
        n += 1
        label = f"{plain}_{n}"
    used.add(label.upper())
    return label.encode()


def _sets(mesh: Mesh) -> dict[str, list[np.ndarray]]:
    """The groups of cells by name: sets, and what has one tag in a field of whole numbers."""
    sets = dict(mesh.cell_sets)
    names = {tuple(np.asarray(pair).tolist()): name for name, pair in mesh.field_data.items()}
    dimensions = [topological_dimension(block.type) for block in mesh.cells]
    for field in _tags(mesh):
        arrays = [np.asarray(array) for array in mesh.cell_data[field]]
        for tag in np.unique(np.concatenate(arrays)).tolist():
            for dimension in sorted({d for d in dimensions if d is not None}):
                members = [
                    np.flatnonzero((array == tag) & (d == dimension))
                    for array, d in zip(arrays, dimensions, strict=True)
                ]
                if tag and any(map(len, members)):
                    name = None if field == "gmsh:geometrical" else names.get((tag, dimension))
                    sets.setdefault(name or f"{field}_{tag}_{dimension}D", members)
    return sets


def _tags(mesh: Mesh) -> list[str]:
    """The cell fields of few whole numbers."""
    fields = []
    for field, blocks in mesh.cell_data.items():
        arrays = [np.asarray(block) for block in blocks]
        whole = all(array.ndim == 1 and array.dtype.kind in "iu" for array in arrays)
        if arrays and whole and len(np.unique(np.concatenate(arrays))) <= _MOST_TAGS:
            fields.append(field)
    return fields


def _losses(mesh: Mesh, written: list[int]) -> list[str]:
    lost = []
    for b, block in enumerate(mesh.cells):
        if b not in written and len(block.vertices):
            cells = counted(len(block.vertices), f"{block.type} cell")
            lost.append(f"{cells}: kept as node sets of their groups only")
    lost += not_kept(mesh.cell_data.keys() - set(_tags(mesh)), "cell field")
    lost += not_kept(mesh.point_data, "point field") + not_kept(mesh.facet_sets, "facet set")
    return [*lost, *links_not_kept(mesh)]
