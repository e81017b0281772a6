"""Shares of a mesh that no rank has whole: each rank's vertices, those of one range along the Morton curve.

A vertex has two numbers in the whole: its *index*, the place in the file, and its *number* in Morton order,
as a problem has it on one rank. A rank owns the numbers of one range, and of cells those whose lowest number
it owns. Rows of the file come to their owners from whichever rank has read them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dvr_cli.distributed.rows import asked, bounds, owner_of, sent
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.morton import morton_codes
from dvr_cli.mesh.ranks import distinct

_SAMPLES = 256  # places on the curve that each rank names, between which ranges are cut


@dataclass(frozen=True, eq=False)
class Local:
    """Some cells of a mesh and their vertices, as a mesh of its own in the order of the whole.

    index, number: (n,) of each vertex in the whole. cells: (c,) the ids of the cells.
    """

    mesh: Mesh
    index: np.ndarray
    number: np.ndarray
    cells: np.ndarray


class Store:
    """The vertices and cells that a rank owns of a mesh of cells of one type.

    All ranks have to call its functions together.

    size: how many vertices the whole has. bounds: (ranks + 1,) the ranges of numbers that ranks own. low,
    high: (3,) of the box of all vertices. index, points: (n,) and (n, 3) of the vertices of the rank, in the
    order of their numbers. ids, cells: (c,) and (c, nodes) of all cells with one of these, by number, in the
    order of their ids.
    """

    def __init__(self, comm: Any, size: int, cell_type: str, points: np.ndarray, cells: np.ndarray) -> None:
        """size: vertices of the whole. points, cells: the rows that the rank has read, one range of each.

        The ranks have read the ranges of ``rows.bounds``, cells of vertices by their index.
        """
        self.comm, self.size, self._cell_type = comm, size, cell_type
        self.bounds = bounds(size, comm.size)
        nothing = np.full(3, np.inf)
        self.low = np.min(comm.allgather(points.min(axis=0, initial=np.inf) if len(points) else nothing), 0)
        self.high = -np.min(
            comm.allgather((-points).min(axis=0, initial=np.inf) if len(points) else nothing), 0
        )
        read_from = self.bounds[comm.rank]
        numbers = self._numbered(morton_codes(points, self.low, self.high), read_from)
        index = read_from + np.arange(len(points))
        self.number_of_read = numbers
        own, index, points = sent(comm, owner_of(numbers, self.bounds), numbers, index, points)
        order = np.argsort(own)
        self.first = int(self.bounds[comm.rank])
        self.index, self.points = index[order], points[order]
        self.ids, self.cells = self._dealt(cells, numbers)
        if size <= np.iinfo(np.int32).max:
            self.cells = self.cells.astype(np.int32)

    @property
    def count(self) -> int:
        """The number of vertices that the rank owns."""
        return len(self.index)

    def owner(self, numbers: np.ndarray) -> np.ndarray:
        """The rank that owns each number."""
        return owner_of(numbers, self.bounds)

    def of_others(self, numbers: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """The values that the owners have for some numbers, and the numbers that each rank asks for.

        values: a row for each vertex of this rank.
        """
        first = self.first
        return asked(self.comm, numbers, self.owner(numbers), lambda wanted: values[wanted - first])

    def around(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The ids, ascending, and the vertices by number of all cells with one of these vertices."""
        to = self.owner(numbers)
        order = np.argsort(to, kind="stable")
        ranks = np.arange(1, self.comm.size)
        wanted = self.comm.alltoall(np.split(numbers[order], np.searchsorted(to[order], ranks)))
        found = self.comm.alltoall([self._with(some) for some in wanted])
        return _each_once(found)

    def within(self, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """As ``around``, all cells that cells which this rank owns lead to in some steps.

        A step leads to all cells with a common vertex.
        """
        ids, cells = self.ids, self.cells
        edge, known = cells[self.owned(cells)], np.empty(0, dtype=np.int64)
        for _ in range(steps):
            numbers = distinct(edge.ravel())
            numbers = numbers[(numbers < self.first) | (numbers >= self.first + self.count)]
            numbers = numbers[~np.isin(numbers, known)]
            known = np.concatenate([known, numbers])
            more, edge = self.around(numbers)
            ids, cells = _each_once([(ids, cells), (more, edge)])
        return ids, cells

    def owned(self, cells: np.ndarray) -> np.ndarray:
        """(c,) bool, those of some cells, by number, that this rank owns: of their lowest vertex."""
        lowest = cells.min(axis=1, initial=self.size)
        return (lowest >= self.first) & (lowest < self.first + self.count)

    def local(self, ids: np.ndarray, cells: np.ndarray) -> Local:
        """Cells with these ids, ascending, and vertices by number, as a mesh."""
        place = cells - self.first
        mine = (place >= 0) & (place < self.count)
        used = np.zeros(self.count, dtype=bool)
        used[place[mine]] = True
        others = distinct(cells[~mine])
        own = np.column_stack([self.index.astype(np.float64), self.points])  # an index is below 2**53
        rows, _ = self.of_others(others, own)
        rows = np.concatenate([own[used], rows])
        numbers = np.concatenate([self.first + np.flatnonzero(used), others])
        index = rows[:, 0].astype(np.int64)
        order = np.argsort(index)
        at = np.empty(len(order), dtype=np.int32)
        at[order] = np.arange(len(order))
        vertices = np.empty(cells.shape, dtype=np.int32)
        vertices[mine] = at[(np.cumsum(used) - 1)[place[mine]]]
        vertices[~mine] = at[used.sum() + np.searchsorted(others, cells[~mine])]
        mesh = Mesh(np.ascontiguousarray(rows[order, 1:]), [Cells(self._cell_type, vertices)])
        return Local(mesh, index[order], numbers[order], ids)

    def _with(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The cells of this rank with one of some of its vertices."""
        marked = np.zeros(self.count + 1, dtype=bool)  # the last stands for vertices of others
        marked[numbers - self.first] = True
        place = self.cells - self.first
        place[(place < 0) | (place >= self.count)] = self.count
        which = marked[place].any(axis=1)
        return self.ids[which], self.cells[which]

    def _numbered(self, codes: np.ndarray, read_from: int) -> np.ndarray:
        """(n,) the number of each vertex that was read, from its place on the curve; of equals by index."""
        comm = self.comm
        index = read_from + np.arange(len(codes))
        ordered = np.sort(codes)
        places = np.arange(_SAMPLES) * len(ordered) // _SAMPLES if len(ordered) else np.empty(0, np.int64)
        samples = np.sort(np.concatenate(comm.allgather(ordered[places])))
        cuts = samples[np.arange(1, comm.size) * len(samples) // comm.size]
        part, whose = sent(comm, np.searchsorted(cuts, codes, side="right"), codes, index)
        order = np.lexsort((whose, part))
        before = sum(comm.allgather(len(part))[: comm.rank])
        whose = whose[order]
        back, numbers = sent(
            comm, owner_of(whose, self.bounds), whose, before + np.arange(len(whose), dtype=np.int64)
        )
        result = np.empty(len(codes), dtype=np.int64)
        result[back - read_from] = numbers
        return result

    def _dealt(self, cells: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The ids and vertices by number of all cells with a vertex of this rank.

        cells: those that this rank has read; numbers: of the vertices that it has read.
        """
        comm, read_from = self.comm, self.bounds[self.comm.rank]
        wanted = distinct(cells.ravel())
        known, _ = asked(comm, wanted, self.owner(wanted), lambda index: numbers[index - read_from])
        by_number = known[np.searchsorted(wanted, cells)]
        first = sum(comm.allgather(len(cells))[: comm.rank])
        ids = first + np.arange(len(cells), dtype=np.int64)
        owners = self.owner(by_number)
        rows, to = [], []
        for column in range(cells.shape[1]):
            new = (owners[:, :column] != owners[:, column : column + 1]).all(axis=1)
            rows.append(np.flatnonzero(new))
            to.append(owners[new, column])
        which = np.concatenate(rows)
        ids, by_number = sent(comm, np.concatenate(to), ids[which], by_number[which])
        order = np.argsort(ids)
        return ids[order], by_number[order]


def _each_once(parts: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """The ids, ascending, and vertices of the cells in some parts, each cell once."""
    ids = np.concatenate([some for some, _ in parts])
    _, once = np.unique(ids, return_index=True)
    return ids[once], np.concatenate([some for _, some in parts])[once]
