"""Shares of a mesh that no rank has whole: each rank's vertices, those of one range along the Morton curve.

A vertex has two numbers in the whole: its *index*, the place in the file, and its *number* in Morton order,
as a problem has it on one rank. A rank owns the numbers of one range, and of cells those whose lowest number
it owns. Rows of the file come to their owners from whichever rank has read them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from dvr_cli.distributed.rows import (
    asked,
    bounds,
    index_type,
    owner_of,
    places,
    sent,
    swapped,
    swapped_rows,
)
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.morton import morton_codes
from dvr_cli.mesh.neighbours import within_rings
from dvr_cli.mesh.plane import other_axes
from dvr_cli.mesh.ranks import distinct, distinct_and_ranks


class CellRows(NamedTuple):
    """Some cells of a mesh.

    ids: (c,) in the whole. cells: (c, k) their vertices, of cells with fewer the first one again. kinds: (c,)
    which of the mesh's kinds each is of.
    """

    ids: np.ndarray
    cells: np.ndarray
    kinds: np.ndarray


class Kinds(NamedTuple):
    """The kinds of cells that a mesh has.

    types: the type of each kind, tags: (kinds, t) what cell data say of its cells, and names: (t,) of these.
    groups: names of groups with their tag and dimension, as in ``Mesh.field_data``. regions: the cell data
    that tell regions apart.
    """

    types: tuple[str, ...]
    tags: np.ndarray
    names: tuple[str, ...]
    groups: tuple[tuple[str, np.ndarray], ...] = ()
    regions: tuple[str, ...] = ()

    @property
    def dimension(self) -> int:
        """Of the cells whose vertices move, all others being of lower dimension."""
        return max(CELL_TYPES[name].dimension for name in self.types)

    @property
    def moving(self) -> list[int]:
        """The kinds of these."""
        dimension = self.dimension
        return [kind for kind, name in enumerate(self.types) if CELL_TYPES[name].dimension == dimension]

    @property
    def sizes(self) -> list[int]:
        """The number of vertices of the cells of each kind."""
        return [CELL_TYPES[name].nodes for name in self.types]

    def mesh(self, points: np.ndarray, cells: CellRows, lower: CellRows) -> Mesh:
        """The mesh of some cells, whose vertices are rows of ``points``, and of lower cells.

        Cells come in the order of their ids, in blocks of one type; then lower ones.
        """
        names = list(dict.fromkeys(self.types))
        of_kind = np.array([names.index(name) for name in self.types])
        blocks, kinds = [], []
        for rows in cells, lower:
            of_type = of_kind[rows.kinds]
            cuts = [0, *(np.flatnonzero(np.diff(of_type)) + 1).tolist(), len(of_type)]
            for lo, hi in pairwise(cuts):
                if lo < hi:
                    name = names[of_type[lo]]
                    blocks.append(Cells(name, rows.cells[lo:hi, : CELL_TYPES[name].nodes]))
                    kinds.append(rows.kinds[lo:hi])
        data = {name: [self.tags[kind, t] for kind in kinds] for t, name in enumerate(self.names)}
        return Mesh(points, blocks, cell_data=data)

    def summary(self) -> tuple[Mesh, np.ndarray]:
        """A mesh with one cell of each kind, so that it has the regions and groups of the whole.

        And (kinds,) the kind of each of its cells, those that move first.
        """
        moving = self.moving
        order = np.array([*moving, *(kind for kind in range(len(self.types)) if kind not in moving)])
        cells = np.zeros((len(order), max(CELL_TYPES[name].nodes for name in self.types)), dtype=np.int64)
        first, others = np.split(order, [len(moving)])
        rows = CellRows(first, cells[: len(first)], first), CellRows(others, cells[len(first) :], others)
        return replace(self.mesh(np.zeros((1, 3)), *rows), field_data=dict(self.groups)), order


@dataclass(frozen=True, eq=False)
class Local:
    """Some cells of a mesh and their vertices, as a mesh of its own in the order of the whole.

    index, number: (n,) of each vertex in the whole. cells: (c,) the ids of its cells, but for lower ones.
    kinds: of all its cells.
    """

    mesh: Mesh
    index: np.ndarray
    number: np.ndarray
    cells: np.ndarray
    kinds: np.ndarray


class Store:
    """The vertices and cells that a rank owns of a mesh.

    All ranks have to call its functions together.

    size: how many vertices the whole has. kinds: of its cells. bounds: (ranks + 1,) the ranges of numbers
    that ranks own. low, high: (D,) of the box of all vertices. axes: the coordinates, but for one of a
    planar mesh that all vertices have alike. index, points: (n,) and (n, D) of the vertices of the
    rank, in the order of their numbers. cells, lower: all cells with one of these, by number, in the order of
    their ids. linked: (k,) ascending, the vertices of the whole, by index, that periodic links tie to others.
    """

    def __init__(
        self, comm: Any, size: int, kinds: Kinds, points: np.ndarray, cells: CellRows, lower: CellRows
    ) -> None:
        """size: vertices of the whole. points, cells, lower: the rows that the rank has read.

        The ranks have read the ranges of ``rows.bounds`` of vertices, and any rows of cells of vertices by
        their index.
        """
        self.comm, self.size, self.kinds = comm, size, kinds
        self.bounds = bounds(size, comm.size)
        nothing = np.full(points.shape[1], np.inf)
        self.low = np.min(comm.allgather(points.min(axis=0, initial=np.inf) if len(points) else nothing), 0)
        self.high = -np.min(
            comm.allgather((-points).min(axis=0, initial=np.inf) if len(points) else nothing), 0
        )
        read_from = self.bounds[comm.rank]
        index = read_from + np.arange(len(points))
        self.axes = list(range(points.shape[1]))
        if kinds.dimension == 2 and len(self.axes) == 3:
            self.axes = list(other_axes(self.low, self.high) or self.axes)
        codes = morton_codes(points[:, self.axes], self.low[self.axes], self.high[self.axes])
        numbers = places(comm, codes, index)  # of equals by index
        own, index, points = sent(comm, owner_of(numbers, self.bounds), numbers, index, points)
        order = np.argsort(own)
        self.linked = np.empty(0, dtype=np.int64)
        self.first = int(self.bounds[comm.rank])
        self.index, self.points = index[order], points[order]
        self.cells, self.lower = self._dealt(cells, numbers), self._dealt(lower, numbers)

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

    def of_own(self, rows: np.ndarray) -> np.ndarray:
        """(n, ...) of the vertices of this rank; rows: of those of its range by index (``rows.bounds``)."""
        first = self.bounds[self.comm.rank]
        owner = owner_of(self.index, self.bounds)
        return asked(self.comm, self.index, owner, lambda wanted: rows[wanted - first])[0]

    def around(self, numbers: np.ndarray) -> CellRows:
        """The cells with one of these vertices."""
        return self._around(self.cells, numbers)

    def lower_around(self, numbers: np.ndarray) -> CellRows:
        """The lower cells with one of these vertices."""
        return self._around(self.lower, numbers)

    def within(self, steps: int) -> CellRows:
        """All cells that cells which this rank owns lead to in some steps, and maybe some more.

        A step leads to all cells with a common vertex.
        """
        found = self.cells
        edge, known = found.cells[self.owned(found.cells)], np.empty(0, dtype=np.int64)
        for step in range(steps):
            numbers = distinct(edge[~self._owns(edge)])
            numbers = numbers[~np.isin(numbers, known)]
            known = np.concatenate([known, numbers])
            more = self.around(numbers)
            # the first step leads to cells of other ranks through vertices of this one, too
            edge = more.cells if step else np.concatenate([more.cells, self.cells.cells])
            found = _each_once([found, more])
        return found

    def near(self, numbers: np.ndarray, steps: int) -> CellRows:
        """All cells that some vertices lead to in so many steps, each to all cells of the vertices known."""
        known, parts = numbers[:0], []
        for _ in range(steps):
            known = np.concatenate([known, numbers])
            parts.append(self.around(numbers))
            numbers = distinct(parts[-1].cells.ravel())
            numbers = numbers[~np.isin(numbers, known)]
        return _each_once(parts)

    def owned(self, cells: np.ndarray) -> np.ndarray:
        """(c,) bool, those of some cells, by number, that this rank owns: of their lowest vertex."""
        return self._owns(reduce(np.minimum, cells.T))  # by columns, as rows are short

    def local(self, cells: CellRows, lower: CellRows) -> Local:
        """Some cells, and lower ones, as a mesh."""
        used = np.zeros(self.count, dtype=bool)
        not_mine: list[np.ndarray] = []
        for rows in cells.cells, lower.cells:
            mine = self._owns(rows)
            used[rows[mine] - self.first] = True
            not_mine.append(rows[~mine])
        others = distinct(np.concatenate(not_mine))
        own = np.column_stack([self.index.astype(np.float64), self.points])  # an index is below 2**53
        rows, _ = self.of_others(others, own)
        rows = np.concatenate([own[used], rows])
        numbers = np.concatenate([self.first + np.flatnonzero(used), others])
        index = rows[:, 0].astype(np.int64)
        order = np.argsort(index)
        at = np.empty(len(order), dtype=np.int32)
        at[order] = np.arange(len(order))
        at_own = np.zeros(self.count, dtype=np.int32)
        at_own[used] = at[: used.sum()]

        def placed(cells: CellRows) -> CellRows:
            rows, mine = cells.cells, self._owns(cells.cells)
            vertices = np.empty(rows.shape, dtype=np.int32)
            vertices[mine] = at_own[rows[mine] - self.first]
            vertices[~mine] = at[used.sum() + np.searchsorted(others, rows[~mine])]
            return cells._replace(cells=vertices)

        mesh = self.kinds.mesh(np.ascontiguousarray(rows[order, 1:]), placed(cells), placed(lower))
        linked = np.flatnonzero(np.isin(index[order], self.linked, assume_unique=True))
        mesh.periodic = np.stack([linked, linked], axis=1)  # to what else makes no difference
        kinds = np.concatenate([cells.kinds, lower.kinds])
        return Local(mesh, index[order], numbers[order], cells.ids, kinds)

    def as_owned(self, local: Local, values: np.ndarray) -> np.ndarray:
        """The values (n, ...) that the owners of the vertices of a rank's mesh have for them."""
        return self.of_others(local.number, self.rows_of(local, values))[0]

    def rows_of(self, local: Local, values: np.ndarray) -> np.ndarray:
        """The values (n, ...) that a rank's mesh has for the vertices it owns, by number; else 0."""
        own = self._owns(local.number)
        rows = np.zeros((self.count, *values.shape[1:]), dtype=values.dtype)
        rows[local.number[own] - self.first] = values[own]
        return rows

    def within_rings(self, local: Local, rows: list[np.ndarray], near: np.ndarray, rings: int) -> np.ndarray:
        """As ``neighbours.within_rings`` in the whole, (n,) of the vertices of a rank's mesh.

        rows: of its vertices. near: (n,) bool; it counts what the owner of a vertex says, or its neighbours.
        """
        own = self._owns(local.number)
        for _ in range(rings):
            before = self.as_owned(local, near)
            near = within_rings(rows, before, 1)
            if not any(self.comm.allgather(bool((near & ~before)[own].any()))):
                break  # however many rings are asked for
        return near

    def _owns(self, numbers: np.ndarray) -> np.ndarray:
        return (numbers >= self.first) & (numbers < self.first + self.count)

    def _around(self, cells: CellRows, numbers: np.ndarray) -> CellRows:
        """Of the cells of all ranks those with one of these vertices."""
        to = self.owner(numbers)
        wanted = swapped_rows(self.comm, to, np.argsort(to, kind="stable"), (numbers,))
        # few, as a rule, for each to be looked for in
        near = self._with(cells, np.concatenate([numbers[:0], *(some for (some,) in wanted.values())]))
        found = swapped(self.comm, {rank: self._with(near, some) for rank, (some,) in wanted.items()})
        return _each_once([self._with(near, numbers[:0]), *found.values()])

    def _with(self, cells: CellRows, numbers: np.ndarray) -> CellRows:
        """Of some cells of this rank those with one of some of its vertices."""
        if not len(numbers):
            return CellRows(*(column[:0] for column in cells))
        marked = np.zeros(self.count + 2, dtype=bool)  # the first and last stand for vertices of others
        marked[numbers - self.first + 1] = True
        which = np.zeros(len(cells.ids), dtype=bool)
        for column in cells.cells.T:  # rows are short
            which |= marked.take(column - (self.first - 1), mode="clip")
        return CellRows(*(column[which] for column in cells))

    def _dealt(self, cells: CellRows, numbers: np.ndarray) -> CellRows:
        """All cells with a vertex of this rank, by number.

        cells: those that this rank has read; numbers: of the vertices that it has read.
        """
        comm, read_from = self.comm, self.bounds[self.comm.rank]
        wanted, place = distinct_and_ranks(cells.cells.ravel())
        known, _ = asked(comm, wanted, self.owner(wanted), lambda index: numbers[index - read_from])
        by_number = known[place].reshape(cells.cells.shape)
        del place
        owners = self.owner(by_number)
        rows, to = [], []
        for column in range(owners.shape[1]):
            new = np.ones(len(owners), dtype=bool)
            for before in range(column):
                new &= owners[:, before] != owners[:, column]
            rows.append(np.flatnonzero(new))
            to.append(owners[new, column])
        which = np.concatenate(rows)
        by_number = by_number.astype(index_type(self.size), copy=False)
        columns = cells.ids[which], by_number[which], cells.kinds[which]
        found = CellRows(*sent(comm, np.concatenate(to), *columns))
        order = np.argsort(found.ids)
        return CellRows(*(column[order] for column in found))


def joined(parts: list[CellRows], index: np.dtype) -> CellRows:
    """Some cells and some more, of whatever types; index: how vertices are kept."""
    if len(parts) == 1:
        return parts[0]
    width = max((part.cells.shape[1] for part in parts), default=1)
    none = CellRows(np.empty(0, np.int64), np.empty((0, width), index), np.empty(0, np.uint8))
    wide = [part._replace(cells=widened(part.cells, width)) for part in parts]
    return CellRows(*(np.concatenate(column) for column in zip(none, *wide, strict=True)))


def widened(cells: np.ndarray, width: int) -> np.ndarray:
    """Cells (c, k) with their first vertex again until they have so many."""
    missing = width - cells.shape[1]
    return np.hstack([cells, np.repeat(cells[:, :1], missing, axis=1)]) if missing else cells


def _each_once(parts: list[CellRows]) -> CellRows:
    """The cells in some parts, each cell once, in the order of their ids."""
    parts = [some for some in parts if len(some.ids)] or parts[:1]
    if len(parts) == 1:
        return parts[0]
    ids = np.concatenate([some.ids for some in parts])
    _, once = np.unique(ids, return_index=True)
    return CellRows(*(np.concatenate(column)[once] for column in zip(*parts, strict=True)))
