"""The part of a rank made from its share alone, as ``parts.Partition`` cuts it out of a whole problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.distributed.colouring import colours, turns
from dvr_cli.distributed.parts import Part, Shared
from dvr_cli.distributed.shares import Local, Store
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.corners import Simplices
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.rings import incidence_of
from dvr_cli.relax.problem import Problem, touched_corners

_CORNERS = max(len(cell_type.corners) for cell_type in CELL_TYPES.values())


class CornerIds(NamedTuple):
    """The ids that the corners of a rank's cells have in the whole, in the order of the whole.

    cells: (n,) ids of the cells, ascending. start: (n + 1,) the corners of each.
    """

    cells: np.ndarray
    start: np.ndarray

    def of(self, corners: np.ndarray) -> np.ndarray:
        """(m,) the ids of some corners."""
        cell = np.searchsorted(self.start, corners, side="right") - 1
        return self.cells[cell] * _CORNERS + (corners - self.start[cell])

    def corners(self, ids: np.ndarray) -> np.ndarray:
        """(m,) the corners with some ids."""
        return self.start[np.searchsorted(self.cells, ids // _CORNERS)] + ids % _CORNERS


@dataclass(frozen=True, eq=False)
class Share:
    """The part of a rank, and how it lies in the rank's mesh and in the whole.

    place: (n,) the vertices of the rank's mesh in the order of the part. own, relaxed: (n,) bool, of the
    vertices of that mesh those that the rank owns, and those that move, on whatever rank.
    freedom: of the vertices of the part, None where all move anywhere.
    number: (n,) of the vertices of the part, and ids: of the corners of that mesh, in the whole.
    bounds: (ranks + 1,) the ranges of numbers that ranks own.
    """

    part: Part
    place: np.ndarray
    own: np.ndarray
    relaxed: np.ndarray
    freedom: Freedom | None
    number: np.ndarray
    ids: CornerIds
    bounds: np.ndarray

    def turn_of(self, corner: int) -> tuple[int, int]:
        """The place of a touched corner in the order that the touched corners of the whole problem have."""
        problem = self.part.problem
        lowest = self.number[problem.touched.vertices[corner].min()]
        return int(lowest), int(self.ids.of(problem.touched_ids[[corner]])[0])


def share_of(comm: Any, store: Store, local: Local, domain: Domain, freedom: Freedom) -> Share:
    """The share of this rank, on all ranks together.

    local: the cells with a vertex that the rank owns, and domain: theirs. freedom: of the vertices of that,
    right for those that the rank owns.
    """
    own = store.owner(local.number) == comm.rank
    moves = freedom.dimension > 0
    position, questions = _positions(comm, store, local, own & moves)
    place = np.argsort(local.number)
    known = _freedom_of_all(comm, store, local, own, freedom)
    known = None if known is None else Freedom(known.dimension[place], known.axis[place])
    number = np.empty(len(place), dtype=np.int32)
    number[place] = np.arange(len(place), dtype=np.int32)
    corners = domain.corners
    vertices, shapes, touched_ids = domain.backend.twin(touched_corners)(
        corners.vertices, corners.shapes, own & moves, number
    )
    touched, touched_ids = Simplices(vertices, shapes, corners.table), touched_ids.astype(np.int32)
    rings_of = np.flatnonzero((own & moves)[place])
    incidence = incidence_of(touched, rings_of, len(place), domain.backend)
    relaxed = position[place] >= 0
    owner = store.owner(local.number[place])
    sent, received = _ghosts(comm.rank, local.number[place], questions, owner, relaxed)
    turn, backend = turns(position[place]), domain.backend
    colour = colours(comm, rings_of, incidence, turn, (sent, received), touched.vertices, backend)
    batches = 1 + max(comm.allgather(int(colour.max(initial=-1))))
    sequence = np.argsort(colour[rings_of], kind="stable")
    rings = incidence.rings(touched, sequence, domain.backend)
    del incidence  # the largest of all arrays
    owners = np.where(relaxed, owner, comm.size).astype(np.int32)[touched.vertices]
    problem = Problem(
        order=local.index[place],
        rings=rings,
        batch_start=np.searchsorted(colour[rings_of][sequence], np.arange(batches + 1)),
        touched=touched,
        touched_ids=touched_ids,
        dimension=corners.dimension,
        components=domain.points.shape[1],
        freedom=None
        if known is None
        else Freedom(known.dimension[rings.vertices], known.axis[rings.vertices]),
    )
    part = Part(
        problem=problem,
        sent=_by_batch(sent, colour, batches),
        received=_by_batch(received, colour, batches),
        first=owners.min(axis=1) == comm.rank,
        corners=touched_ids,
    )
    ids = CornerIds(local.cells, corners.start)
    return Share(part, place, own, position >= 0, known, local.number[place], ids, store.bounds)


def _freedom_of_all(
    comm: Any, store: Store, local: Local, own: np.ndarray, freedom: Freedom
) -> Freedom | None:
    """The freedom of all vertices, from those who own them ((n,) bool); None if all of all ranks are free."""
    if not any(comm.allgather(bool(freedom.axis[own].any()))):
        return None
    rows = np.zeros((store.count, 1 + freedom.axis.shape[1]))
    rows[local.number[own] - store.first] = np.column_stack([freedom.dimension, freedom.axis])[own]
    known, _ = store.of_others(local.number, rows)
    return Freedom(known[:, 0].astype(np.uint8), np.ascontiguousarray(known[:, 1:]))


def _positions(
    comm: Any, store: Store, local: Local, mine: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray]]:
    """(n,) the position of each vertex among all that are relaxed, -1 for others; what ranks asked for.

    mine: (n,) bool, the relaxed vertices that the rank owns.
    """
    numbers = np.sort(local.number[mine]) - store.first
    before = sum(comm.allgather(len(numbers))[: comm.rank])
    positions = np.full(store.count, -1, dtype=np.int64)
    positions[numbers] = before + np.arange(len(numbers))
    return store.of_others(local.number, positions)


def _ghosts(
    this: int, numbers: np.ndarray, questions: list[np.ndarray], owner: np.ndarray, relaxed: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """For each rank the relaxed vertices of this one that it has, and those of its own that are here.

    numbers: (n,) of this rank's vertices, ascending, and owner: (n,) theirs. questions: the numbers of this
    one that each rank has.
    """
    sent, received = [], []
    for rank, wanted in enumerate(questions):
        there = np.searchsorted(numbers, np.sort(wanted))
        here = np.flatnonzero((owner == rank) & relaxed)
        sent.append(there[relaxed[there]] if rank != this else there[:0])
        received.append(here if rank != this else here[:0])
    return sent, received


def _by_batch(ghosts: list[np.ndarray], colour: np.ndarray, batches: int) -> tuple[Shared, ...]:
    """The vertices that ranks share, batch after batch; ghosts: for each rank, by ascending number."""
    shared = []
    for rank, vertices in enumerate(ghosts):
        order = np.argsort(colour[vertices], kind="stable")
        start = np.searchsorted(colour[vertices][order], np.arange(batches + 1))
        if len(vertices):
            shared.append(Shared(rank, vertices[order], start))
    return tuple(shared)
