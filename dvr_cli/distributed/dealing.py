"""A mesh that is spread over the ranks of a job, dealt out anew as shares: no rank gets more than its own.

The whole that this stands for is that of ``gathering``: its vertices and cells in the order of their ids.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dvr_cli.distributed.gathering import Piece
from dvr_cli.distributed.ranks import agree
from dvr_cli.distributed.rows import asked, bounds, owner_of, places, sent
from dvr_cli.distributed.shares import CellRows, Kinds, Store, widened
from dvr_cli.mesh.cell_types import CELL_TYPES, relaxed_dimension


@dataclass(frozen=True, eq=False)
class Dealt:
    """The share that a rank has of a mesh that was dealt out.

    store: its share. counts: how many cells of each type the whole has. index: (n,) of each vertex of
    its piece in the whole. points: (k, D) of its range of vertices in the order of the whole, see
    ``rows.bounds``. field: (k, ...) what was given for these vertices.
    """

    store: Store
    counts: dict[str, int]
    index: np.ndarray
    points: np.ndarray
    field: np.ndarray | None

    def of_piece(self, index: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """(n, D) where the vertices of the piece are, once each rank has moved those that it owns.

        index: (m,) of these in the whole, and moved: (m, D).
        """
        comm, size = self.store.comm, self.store.size
        ranges = bounds(size, comm.size)
        first, points = ranges[comm.rank], self.points.copy()
        there, rows = sent(comm, owner_of(index, ranges), index, moved)
        points[there - first] = rows
        wanted = owner_of(self.index, ranges)
        return asked(comm, self.index, wanted, lambda some: points[some - first])[0]


def dealt(comm: Any, piece: Piece, field: np.ndarray | None = None) -> Dealt | None:
    """The share of each rank of the mesh of which each has a piece, on all ranks together.

    field: a row for each vertex of the piece, on all ranks or on none.
    None on all where cells are not linear ones of one dimension, or pieces contradict each other.
    """
    points, blocks = piece.mesh.points, [block for block in piece.mesh.cells if len(block.vertices)]
    ids = [piece.vertices] if piece.cells is None else [piece.vertices, piece.cells]
    fits = points.dtype == np.float64
    fits = fits and all(int(some.max(initial=0)) <= np.iinfo(np.int64).max for some in ids)
    given = comm.allgather((fits, points.shape[1], piece.cells is None, {block.type for block in blocks}))
    types = sorted(set().union(*(some for *_, some in given)), key=list(CELL_TYPES).index)
    linear = all(relaxed_dimension(name) for name in types)
    alike = len({each[1:3] for each in given}) == 1 and len({relaxed_dimension(name) for name in types}) == 1
    if not (all(each[0] for each in given) and linear and alike):
        return None
    counts = {name: comm.allreduce(sum(len(b.vertices) for b in blocks if b.type == name)) for name in types}
    index = places(comm, piece.vertices.astype(np.int64))
    size = _most(comm, index)
    parts = [np.empty((0, max(CELL_TYPES[name].nodes for name in types)), dtype=np.int64)]
    kinds = [np.empty(0, dtype=np.uint8)]
    for block in blocks:
        parts.append(widened(index[block.vertices.astype(np.int64)], parts[0].shape[1]))
        kinds.append(np.full(len(block.vertices), types.index(block.type), dtype=np.uint8))
    cells, kind = np.concatenate(parts), np.concatenate(kinds)
    ordered, sound = _ordered(cells, np.array([CELL_TYPES[name].nodes for name in types])[kind])
    columns = ordered.T if piece.cells is None else [piece.cells.astype(np.int64)]
    if piece.cells is None and len(types) > 1:  # by type first
        columns = [kind * np.int64(size + 1) + 1 + columns[0], *columns[1:]]
    number = places(comm, *columns)
    sound = sound and _most(comm, number) == sum(counts.values())
    own = _own_rows(comm, size, index, points)
    if not agree(comm, sound and own is not None) or own is None:
        return None
    of_range = None if field is None else _own_rows(comm, size, index, field)
    if not agree(comm, (of_range is None) == (field is None)):
        return None
    of_types = Kinds(tuple(types), np.zeros((len(types), 0), dtype=np.int64), ())
    lower = CellRows(number[:0], cells[:0, :1], kind[:0])
    store = Store(comm, size, of_types, own, CellRows(number, cells, kind), lower)
    return Dealt(store, counts, index, own, of_range)


def _ordered(cells: np.ndarray, nodes: np.ndarray) -> tuple[np.ndarray, bool]:
    """The vertices of each cell, ascending, behind -1 where it has fewer ((n,) ``nodes``); if all differ."""
    missing = np.arange(cells.shape[1]) >= nodes[:, None]
    ordered = np.sort(np.where(missing, -1, cells), axis=1)
    return ordered, bool(((ordered[:, 1:] != ordered[:, :-1]) | (ordered[:, 1:] < 0)).all())


def _most(comm: Any, numbers: np.ndarray) -> int:
    """One more than the largest of the numbers of all ranks."""
    return 1 + max(comm.allgather(int(numbers.max(initial=-1))))


def _own_rows(comm: Any, size: int, index: np.ndarray, points: np.ndarray) -> np.ndarray | None:
    """The rows of the range of this rank, of which others may have some; None where these contradict."""
    ranges = bounds(size, comm.size)
    index, points = sent(comm, owner_of(index, ranges), index, points)
    order = np.argsort(index, kind="stable")  # of equals that of the first rank
    index, points = index[order], points[order]
    new = np.diff(index, prepend=-1) != 0
    own = points[new]
    return own if np.array_equal(own[np.cumsum(new) - 1], points) else None
