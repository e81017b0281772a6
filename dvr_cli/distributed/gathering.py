"""A mesh that is spread over the ranks of a job, gathered on the leading one.

Each rank has cells of its own, and all vertices of these. What tells vertices of different ranks apart, or
makes them one, is their ids.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dvr_cli.distributed.job import LEAD
from dvr_cli.distributed.ranks import on_lead
from dvr_cli.errors import InputError, UsageError
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import check_coordinates, check_rows
from dvr_cli.mesh.mesh import Cells, Mesh

_TYPES = list(CELL_TYPES)


@dataclass(frozen=True, eq=False)
class Piece:
    """The piece of a mesh that one rank has.

    mesh: its cells and their vertices. vertices: (n,) the id of each vertex in the whole. cells: (c,) that of
    each cell, through all blocks; None where the cells of the whole have no ids.
    """

    mesh: Mesh
    vertices: np.ndarray
    cells: np.ndarray | None

    @property
    def count(self) -> int:
        """The number of its cells."""
        return sum(len(block.vertices) for block in self.mesh.cells)

    def __post_init__(self) -> None:
        """Raise UsageError or InputError for what would keep the pieces from being put together."""
        _check_ids(self.vertices, len(self.mesh.points), "vertex_ids")
        if self.cells is not None:
            _check_ids(self.cells, self.count, "cell_ids")
        check_coordinates(self.mesh.points)
        for block in self.mesh.cells:
            rows = block.vertices
            if block.type not in CELL_TYPES:
                raise InputError(f"cells of type {block.type!r} are not supported")
            check_rows(block)
            if len(rows) and not 0 <= rows.min() <= rows.max() < len(self.vertices):
                raise InputError(f"a cell ({block.type}) names a vertex that this rank does not have")


@dataclass(frozen=True, eq=False)
class Gathered:
    """The whole mesh on the leading rank.

    mesh: its vertices in the order of their ids, its cells in that of theirs; without ids in the order of
    their types, and among one type of their vertices. places: for each rank (n,) the vertices of its piece.
    cells: for each rank (c,) the cells of its piece.
    """

    mesh: Mesh
    places: list[np.ndarray]
    cells: list[np.ndarray]


def gathered(comm: Any, piece: Piece) -> Gathered | None:
    """The whole of which each rank has a piece, on the leading rank; None on others.

    Raises on all ranks InputError where pieces contradict each other: two places for a vertex, one id for two
    cells.
    """
    blocks = [
        (block.type, piece.vertices[block.vertices]) for block in piece.mesh.cells if len(block.vertices)
    ]
    pieces = comm.gather((piece.mesh.points, piece.vertices, blocks, piece.cells), LEAD)
    return on_lead(comm, lambda: _joined(pieces))


def _check_ids(ids: np.ndarray, n: int, name: str) -> None:
    if ids.shape != (n,) or ids.dtype.kind not in "iu":
        raise UsageError(f"{name}: {n} whole numbers are needed, not {ids.dtype} of shape {ids.shape}")
    if len(np.unique(ids)) < n:
        raise UsageError(f"{name}: an id is there twice")


def _joined(
    pieces: list[tuple[np.ndarray, np.ndarray, list[tuple[str, np.ndarray]], np.ndarray | None]],
) -> Gathered:
    points, ids, blocks, cell_ids = zip(*pieces, strict=True)
    if len({given.shape[1] for given in points}) > 1:
        raise InputError("points have 2 coordinates on some ranks and 3 on others")
    if len({given is None for given in cell_ids}) > 1:
        raise UsageError("cell_ids: needed on all ranks or on none")
    known, first, place = np.unique(np.concatenate(ids), return_index=True, return_inverse=True)
    given = np.concatenate(points)
    whole = given[first]
    other = np.flatnonzero((given != whole[place]).any(axis=1))
    if len(other):
        raise InputError(f"vertex {known[place[other[0]]]} has other coordinates on another rank")
    places = np.split(place, np.cumsum([len(part) for part in ids])[:-1])
    cells, order = _in_order(known, blocks, cell_ids)
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    counts = [sum(len(rows) for _, rows in own) for own in blocks]
    return Gathered(Mesh(whole, cells), places, np.split(number, np.cumsum(counts)[:-1]))


def _in_order(
    known: np.ndarray,
    blocks: tuple[list[tuple[str, np.ndarray]], ...],
    cell_ids: tuple[np.ndarray | None, ...],
) -> tuple[list[Cells], np.ndarray]:
    """The cells of all ranks in their order, and for each of them its number as they came.

    known: (N,) the ids of the vertices in ascending order.
    """
    parts = [(name, np.searchsorted(known, rows)) for own in blocks for name, rows in own]
    kinds = np.concatenate(
        [np.empty(0, int), *(np.full(len(rows), _TYPES.index(name)) for name, rows in parts)]
    )
    width = max((rows.shape[1] for _, rows in parts), default=0)
    rows = [np.pad(rows, ((0, 0), (0, width - rows.shape[1])), constant_values=-1) for _, rows in parts]
    vertices = np.concatenate([np.empty((0, width), dtype=np.int64), *rows])
    if cell_ids[0] is None:
        order = np.lexsort([*np.sort(vertices, axis=1).T[::-1], kinds])
    else:
        ids = np.concatenate([given for given in cell_ids if given is not None])
        order = np.argsort(ids, kind="stable")
        twice = np.flatnonzero(np.diff(ids[order]) == 0)
        if len(twice):
            raise InputError(f"cell {ids[order[twice[0]]]} is given by two ranks")
    kinds, vertices = kinds[order], vertices[order]
    cuts = np.flatnonzero(np.diff(kinds)) + 1
    runs = zip(np.split(kinds, cuts), np.split(vertices, cuts), strict=True)
    named = [(CELL_TYPES[_TYPES[kind[0]]], run) for kind, run in runs if len(kind)]
    return [Cells(kind.name, run[:, : kind.nodes]) for kind, run in named], order
