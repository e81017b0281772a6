"""A mesh that is spread over the ranks of a job, dealt out anew as shares: no rank gets more than its own.

The whole that this stands for is that of ``gathering``: its vertices and cells in the order of their ids.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dvr_cli.distributed.gathering import Piece
from dvr_cli.distributed.rows import asked, bounds, owner_of, places, sent
from dvr_cli.distributed.shares import CellRows, Kinds, Store
from dvr_cli.files.ranges import MAIN
from dvr_cli.mesh.cell_types import CELL_TYPES


@dataclass(frozen=True, eq=False)
class Dealt:
    """The share that a rank has of a mesh that was dealt out.

    store: its share. count: of the cells of the whole. index: (n,) of each vertex of its piece in the whole.
    points: (k, 3) of its range of vertices in the order of the whole, see ``rows.bounds``.
    """

    store: Store
    count: int
    index: np.ndarray
    points: np.ndarray

    def of_piece(self, index: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """(n, 3) where the vertices of the piece are, once each rank has moved those that it owns.

        index: (m,) of these in the whole, and moved: (m, 3).
        """
        comm, size = self.store.comm, self.store.size
        ranges = bounds(size, comm.size)
        first, points = ranges[comm.rank], self.points.copy()
        there, rows = sent(comm, owner_of(index, ranges), index, moved)
        points[there - first] = rows
        wanted = owner_of(self.index, ranges)
        return asked(comm, self.index, wanted, lambda some: points[some - first])[0]


def dealt(comm: Any, piece: Piece) -> Dealt | None:
    """The share of each rank of the mesh of which each has a piece, on all ranks together.

    None on all where there are other cells than tetrahedra, or pieces contradict each other.
    """
    points, blocks = piece.mesh.points, piece.mesh.cells
    nodes = CELL_TYPES[MAIN].nodes
    ids = [piece.vertices] if piece.cells is None else [piece.vertices, piece.cells]
    fits = points.dtype == np.float64 and points.shape[1] == 3 and all(block.type == MAIN for block in blocks)
    fits = fits and all(int(some.max(initial=0)) <= np.iinfo(np.int64).max for some in ids)
    given = comm.allgather((fits, piece.cells is None, piece.count))
    if not all(fit for fit, _, _ in given) or len({none for _, none, _ in given}) > 1:
        return None
    count = sum(number for _, _, number in given)
    index = places(comm, piece.vertices.astype(np.int64))
    size = _most(comm, index)
    rows = np.concatenate([np.empty((0, nodes), dtype=np.int64), *(block.vertices for block in blocks)])
    cells = index[rows.astype(np.int64)]
    ordered = np.sort(cells, axis=1)
    order = ordered.T if piece.cells is None else [piece.cells.astype(np.int64)]
    number = places(comm, *order)
    sound = _most(comm, number) == count and bool((ordered[:, 1:] != ordered[:, :-1]).all())
    own = _own_rows(comm, size, index, points)
    if not all(comm.allgather(sound and own is not None)) or own is None:
        return None
    kinds = Kinds((MAIN,), np.zeros((1, 0), dtype=np.int64), (), MAIN)
    of_kind = np.zeros(len(cells), dtype=np.uint8)
    lower = CellRows(number[:0], cells[:0, :1], of_kind[:0])
    return Dealt(Store(comm, size, kinds, own, CellRows(number, cells, of_kind), lower), count, index, own)


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
