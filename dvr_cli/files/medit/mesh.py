"""A Mesh from the sections of a MEDIT file.

References are the cell data and the point data "medit:ref". Vertices that a remesher may not move (Corners,
RequiredVertices, those of RequiredEdges and so on) are vertex cells behind all others, so that they stay.
The names of such sections are sets, too: of vertices, or of the edges and faces they name.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.medit.keywords import DISPUTED, ELEMENTS, LISTED, ORDERINGS, UNSUPPORTED
from dvr_cli.mesh.mesh import Cells, Mesh

_HELD = ("Corners", "RequiredVertices")
_NO_PAIRS = np.empty((0, 2), dtype=np.int64)


class MeditFile(Protocol):
    """A file cut into sections."""

    @property
    def sections(self) -> list[str]:
        """The keywords of its sections, in order."""

    def integers(self, name: str, columns: int) -> np.ndarray:
        """The rows of a section of whole numbers, (n, columns) int64; raises InputError."""

    def vertices(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (N, d) float64 and references (N,) int64; raises InputError."""


def make_mesh(file: MeditFile) -> Mesh:
    """The mesh; raises InputError for what is damaged, or has cells that are not supported."""
    for name in file.sections:
        if name in UNSUPPORTED:
            raise InputError(f"{UNSUPPORTED[name]} (section {name}) are not supported")
    points, references = file.vertices()
    elements = {
        name: file.integers(name, 1 + ELEMENTS[name][1]) for name in file.sections if name in ELEMENTS
    }
    for name, rows in elements.items():
        _check(rows[:, :-1], len(points), name, "vertex")
    blocks = [_cells(file, name, rows) for name, rows in elements.items()]
    tags = [rows[:, -1].copy() for rows in elements.values()]

    held = np.zeros(len(points), dtype=bool)
    point_sets, cell_sets = {}, {}
    for name in file.sections:
        if name in _HELD:
            vertices = _numbers(file, name, 1, len(points), "vertex").ravel()
            held[vertices] = True
            point_sets[name] = np.unique(vertices)
            continue
        kind, place = _subject(name, elements)
        if kind is None:
            continue
        columns = 2 if kind == "Periodic" else 1
        chosen = np.unique(_numbers(file, name, columns, len(blocks[place].vertices), "element"))
        if kind != "Ridges":
            held[blocks[place].vertices[chosen]] = True
        nothing = np.empty(0, dtype=np.int64)
        cell_sets[name] = [chosen if b == place else nothing for b in range(len(blocks))]
    if held.any():
        blocks.append(Cells("vertex", np.flatnonzero(held)[:, None]))
        tags.append(references[held])
        cell_sets = {name: [*parts, np.empty(0, dtype=np.int64)] for name, parts in cell_sets.items()}
    pairs = _NO_PAIRS
    if "PeriodicVertices" in file.sections:
        pairs = _numbers(file, "PeriodicVertices", 2, len(points), "vertex")
    return Mesh(
        points,
        blocks,
        cell_data={"medit:ref": tags},
        point_data={"medit:ref": references},
        point_sets=point_sets,
        cell_sets=cell_sets,
        periodic=pairs,
    )


def _subject(name: str, elements: dict[str, np.ndarray]) -> tuple[str | None, int]:
    """The property that a section like RequiredEdges gives elements, and their block; else None."""
    kind, of = ("Ridges", "Edges") if name == "Ridges" else (None, "")
    for word in ("Required", "Periodic"):
        if name.startswith(word):
            kind, of = word, name[len(word) :]
    linear = of if of in elements else next((e for e in (f"{of}P2", f"{of}Q2") if e in elements), None)
    if linear is None:
        return None, -1
    return kind, list(elements).index(linear)


def _cells(file: MeditFile, name: str, rows: np.ndarray) -> Cells:
    """Elements with their nodes in meshio's order, counted from 0."""
    cell_type, n_nodes = ELEMENTS[name]
    vertices = rows[:, :-1] - 1
    listed = LISTED.get(name, "")
    if listed not in file.sections:
        if name in DISPUTED and len(rows):
            raise InputError(
                f"programs order the nodes of {name} differently: supported with a section {listed} only"
            )
        return Cells(cell_type, np.ascontiguousarray(vertices))
    usual = ORDERINGS[name]
    given = [tuple(row) for row in file.integers(listed, len(usual[0])).tolist()]
    if sorted(given) != sorted(usual):
        raise InputError(f"section {listed} does not list the {n_nodes} nodes of a cell")
    return Cells(cell_type, vertices[:, [given.index(node) for node in usual]])


def _numbers(file: MeditFile, name: str, columns: int, n: int, what: str) -> np.ndarray:
    """The numbers of vertices or elements in a section, counted from 0, (k, columns)."""
    numbers = file.integers(name, columns)
    _check(numbers, n, name, what)
    return numbers - 1


def _check(numbers: np.ndarray, n: int, name: str, what: str) -> None:
    wrong = (numbers < 1) | (numbers > n)
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise InputError(
            f"row {row + 1} of section {name} names {what} {numbers[row, column]}, which does not exist"
        )
