"""Parts of a problem: what each of several ranks needs to move its own vertices as they move on one.

A rank *owns* some of the relaxed vertices, usually those of one range in Morton order, in which the problem
numbers them. Its part has the rings of these, the corners that they are in, and as *ghosts* the others of
these. It numbers its vertices in the problem's order, so rings and ties come out as they do in the whole.

    problem   0  1  2  3 | 4  5  6  7        rank 0 owns 0 to 3, and has the ghosts 4 and 6
    rank 0    0  1  2  3   4     5           (its own numbers)
    rank 1          0  1   2  3  4  5        rank 1 owns 4 to 7, and has the ghosts 2 and 3
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.mesh.corners import ShapeTable, Simplices
from dvr_cli.mesh.rings import Rings
from dvr_cli.relax.problem import Problem


@dataclass(frozen=True)
class Shared:
    """The vertices that two ranks have both of, and one of them owns, from the point of view of one rank.

    rank: the other. vertices: (k,) their numbers here, batch after batch, in ascending order in each.
    start: (B + 1,) those of batch b are start[b] .. start[b+1].
    """

    rank: int
    vertices: np.ndarray
    start: np.ndarray

    def of(self, batch: int) -> np.ndarray:
        """The numbers of those in a batch."""
        return self.vertices[self.start[batch] : self.start[batch + 1]]


@dataclass(frozen=True)
class Part:
    """The part of a rank.

    problem: its rings and corners, in its own numbering, with all batches of the whole; its ``order`` and
        ``touched_ids`` lead to the mesh. sent: what it owns and others have as ghosts; received: what others
        own and it has. Both with the ranks in ascending order.
    first: (C,) bool, of its touched corners those of which it owns the first relaxed vertex: each touched
        corner of the whole has one such rank.
    corners: (C,) the number of each among the touched corners of the whole.
    """

    problem: Problem
    sent: tuple[Shared, ...]
    received: tuple[Shared, ...]
    first: np.ndarray
    corners: np.ndarray


@dataclass(frozen=True)
class Place:
    """The place of a part in the whole problem.

    vertices: (n,) the whole's numbers of its vertices, ascending. rings: (m,) the whole's number of each of
    its rings. firsts: the whole's numbers of the touched corners that it answers for (``Part.first``).
    """

    vertices: np.ndarray
    rings: np.ndarray
    firsts: np.ndarray


def along_curve(problem: Problem, ranks: int) -> np.ndarray:
    """(m,) the rank that owns the vertex of each ring: equal ranges (but for one) in Morton order."""
    place = np.argsort(problem.rings.vertices)
    owners = np.empty(len(place), dtype=np.int64)
    for rank, rings in enumerate(np.array_split(place, ranks)):
        owners[rings] = rank
    return owners


class Partition:
    """A problem cut into parts for a number of ranks, made one at a time.

    owner: (N,) the rank that owns each vertex, -1 for those that are not relaxed.
    """

    def __init__(self, problem: Problem, ranks: int, owners: np.ndarray | None = None) -> None:
        """owners: (m,) the rank that owns the vertex of each ring; by default ``along_curve``."""
        self.problem, self.ranks = problem, ranks
        rings = problem.rings
        self.owner = np.full(len(problem.order), -1)
        self.owner[rings.vertices] = along_curve(problem, ranks) if owners is None else owners
        self._batch = np.zeros(len(problem.order), dtype=np.int64)
        self._batch[rings.vertices] = np.repeat(
            np.arange(len(problem.batch_start) - 1), np.diff(problem.batch_start)
        )
        owners = self.owner[problem.touched.vertices]
        self._first = np.where(owners < 0, ranks, owners).min(axis=1)
        self._places: dict[int, Place] = {}

    def place(self, rank: int) -> Place:
        """The place of a rank's part."""
        if rank not in self._places:
            rings, touched = self.problem.rings, self.problem.touched
            own = np.flatnonzero(self.owner[rings.vertices] == rank)
            here = np.zeros(len(self.owner), dtype=bool)
            here[rings.vertices[own]] = True
            here[touched.vertices[self._touches(rank)]] = True
            firsts = np.flatnonzero(self._first == rank)
            self._places[rank] = Place(np.flatnonzero(here), own, firsts)
        return self._places[rank]

    def part(self, rank: int) -> Part:
        """The part of a rank."""
        problem, place = self.problem, self.place(rank)
        rings = problem.rings
        number = np.full(len(problem.order), -1, dtype=np.int32)
        number[place.vertices] = np.arange(len(place.vertices), dtype=np.int32)
        corners = self._touches(rank)
        sizes = rings.sizes[place.rings]
        start = np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)])
        entries = np.repeat(rings.start[place.rings] - start[:-1], sizes) + np.arange(start[-1])
        table, shapes, touched_shapes = _used(
            problem.touched.table, rings.shapes[entries], problem.touched.shapes[corners]
        )
        held = problem.touched.held
        touched = Simplices(
            number[problem.touched.vertices[corners]],
            touched_shapes,
            table,
            held=None if held is None else held[corners],
        )
        freedom = problem.freedom
        local = replace(
            problem,
            order=problem.order[place.vertices],
            rings=Rings(number[rings.vertices[place.rings]], start, number[rings.others[entries]], shapes),
            batch_start=np.searchsorted(place.rings, problem.batch_start),
            touched=touched,
            touched_ids=problem.touched_ids[corners],
            freedom=None
            if freedom is None
            else Freedom(freedom.dimension[place.rings], freedom.axis[place.rings]),
        )
        others = [other for other in range(self.ranks) if other != rank]
        sent = (self._shared(other, rank, other, number) for other in others)
        received = (self._shared(rank, other, other, number) for other in others)
        return Part(
            problem=local,
            sent=tuple(one for one in sent if len(one.vertices)),
            received=tuple(one for one in received if len(one.vertices)),
            first=self._first[corners] == rank,
            corners=corners,
        )

    def _touches(self, rank: int) -> np.ndarray:
        """The touched corners with a vertex that a rank owns."""
        return np.flatnonzero((self.owner[self.problem.touched.vertices] == rank).any(axis=1))

    def _shared(self, ghosts_of: int, owner: int, other: int, number: np.ndarray) -> Shared:
        """The ghosts of one rank that another owns, by their ``number`` in one of them; other: the other."""
        vertices = self.place(ghosts_of).vertices
        vertices = vertices[self.owner[vertices] == owner]
        batch = self._batch[vertices]
        order = np.argsort(batch, kind="stable")
        start = np.searchsorted(batch[order], np.arange(len(self.problem.batch_start)))
        return Shared(other, number[vertices[order]], start)


def _used(table: ShapeTable, *shapes: np.ndarray) -> tuple[ShapeTable, np.ndarray, np.ndarray]:
    """The rows of a table that two arrays of shapes name, and these arrays with the rows' new numbers."""
    used = np.zeros(len(table.norm), dtype=bool)
    for some in shapes:
        used[some] = True
    number = (np.cumsum(used) - 1).astype(np.int32)
    one, other = (number[some] for some in shapes)
    return table.part(np.flatnonzero(used)), one, other
