"""The tangled part of a mesh that no rank has whole: the leading rank gets it, and its result goes back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.distributed.job import LEAD
from dvr_cli.distributed.orientation import of_cells
from dvr_cli.distributed.rows import sent
from dvr_cli.distributed.share_targets import ShareTargets
from dvr_cli.distributed.shares import CellRows, Local, Store
from dvr_cli.mesh.domain import Domain, domain_of
from dvr_cli.mesh.ranks import distinct
from dvr_cli.mesh.region_choice import NONE
from dvr_cli.quality.mean_ratio import DEGENERATE, element_qualities
from dvr_cli.relax.phases import TANGLED
from dvr_cli.relax.stopping import StopReason
from dvr_cli.relax.untangle.causes import NEAR, held_facets, tangled_elements
from dvr_cli.relax.untangle.phase import OutOfReach, Untangling, inverted_by_held, untangle, vertices_of

_REACH = 8  # rings around tangled elements that are gathered; twice as many where they do not suffice
_PAIRS = 1 << 20  # of facets and boxes that are compared together


class _Part(NamedTuple):
    """Some cells of the whole and their vertices, on the leading rank.

    number: (n,) of the vertices in the whole, and freedom: theirs. points: (n, d) flat, and marked: (n,)
    bool, as their owners have them.
    """

    domain: Domain
    number: np.ndarray
    freedom: Freedom
    points: np.ndarray
    marked: np.ndarray


@dataclass(frozen=True, eq=False)
class Tangle:
    """A mesh with elements that may be tangled, as a rank has it; all ranks call its functions together.

    local: the cells of the rank, domain: theirs, mirrored: (c,) bool, those stored inside out. freedom: of
    the vertices, right for those that the rank owns. relaxed: (n,) bool, those that move, on whatever rank.
    targets: of the cells.
    """

    store: Store
    local: Local
    domain: Domain
    mirrored: np.ndarray
    freedom: Freedom
    relaxed: np.ndarray
    targets: ShareTargets

    def untangled(self, interrupted: Callable[[], bool]) -> Untangling:
        """The result of ``untangle`` for the whole, with the coordinates of the rank's mesh.

        interrupted: asked on the leading rank.
        """
        comm, points = self.store.comm, self.domain.points
        tangled = self._tangled(points)
        if not any(comm.allgather(bool(tangled.any()))):
            return Untangling(points, [], StopReason.NOTHING_TO_UNTANGLE)
        at, reach = vertices_of(tangled, self.domain.corners, len(points)), _REACH
        while True:
            near = self._near(at, reach)
            part = self._gathered(points, self.local.number[near & self._own], near)
            found = None if part is None else _untangled(part, self.store, interrupted)
            told = comm.bcast(found and replace(found, points=found.points[:0]), LEAD)
            if told is not None:
                moved = (part.number, found.points) if part and found else (self.local.number[:0], points[:0])
                return replace(told, points=self._spread(points, *moved))
            reach *= 2

    def left(self, points: np.ndarray) -> dict[str, int]:
        """As ``tangled_elements`` counts them in the whole; points: (n, d) of the rank's mesh, flat."""
        store, corners = self.store, self.domain.corners
        comm, mine = store.comm, store.owned(store.cells.cells)
        tangled = self._tangled(points)
        held = Freedom(self.relaxed.astype(np.uint8), self.freedom.axis)
        hopeless = tangled & inverted_by_held(points, corners, held)
        numbers = [comm.allreduce(int((some & mine).sum())) for some in (tangled, hopeless)]
        crossing = 0
        if numbers[0] > numbers[1]:
            near = self._near(vertices_of(tangled & ~hopeless, corners, len(points)), NEAR)
            facets = held_facets(self.domain, held)
            corners_of = points[facets]
            boxes = np.stack([corners_of.min(axis=1), corners_of.max(axis=1)], axis=1)
            around = near[facets].any(axis=1)
            wanted = np.concatenate(comm.allgather(boxes[around]))
            crossed = facets[_overlap(boxes, wanted)]
            named = near & self._own
            named[crossed] = True
            part = self._gathered(points, self.local.number[named], near)
            if part is not None:
                crossing = tangled_elements(part.points, part.domain, part.freedom)["crossing"]
            crossing = comm.bcast(crossing, LEAD)
        return dict(zip(TANGLED, (*numbers, crossing), strict=True))

    @property
    def _own(self) -> np.ndarray:
        return self.store.owner(self.local.number) == self.store.comm.rank

    def _tangled(self, points: np.ndarray) -> np.ndarray:
        """(c,) bool: the cells of the rank that are not positive."""
        return ~(element_qualities(points, self.domain.corners) > DEGENERATE)

    def _near(self, vertices: np.ndarray, rings: int) -> np.ndarray:
        """(n,) bool: those within so many rings of the marked ones of all ranks."""
        rows = [block.vertices for block in self.domain.cells]
        return self.store.within_rings(self.local, rows, vertices, rings)

    def _gathered(self, points: np.ndarray, numbers: np.ndarray, marked: np.ndarray) -> _Part | None:
        """The cells around the vertices of all ranks with these numbers, on the leading rank; None on others.

        points: (n, d) of the rank's mesh, flat. marked: (n,) bool, of its vertices.
        """
        store, freedom = self.store, self.freedom
        all_of_them = store.comm.gather(numbers, LEAD)
        named = numbers[:0] if all_of_them is None else distinct(np.concatenate(all_of_them))
        cells = store.around(named)
        part = store.local(cells, CellRows(*(column[:0] for column in store.lower)))
        d = points.shape[1]
        columns = np.column_stack([points, freedom.axis, freedom.dimension, marked])
        values, _ = store.of_others(part.number, store.rows_of(self.local, columns))
        mirrored = of_cells(store, self.mirrored, cells)
        targets = self.targets.around(store, self.local, cells, part)
        if all_of_them is None:
            return None
        return _Part(
            targets.on(domain_of(part.mesh, regions=(NONE,), mirrored=mirrored))[0],
            part.number,
            Freedom(values[:, -2].astype(np.uint8), np.ascontiguousarray(values[:, d : 2 * d])),
            np.ascontiguousarray(values[:, :d]),
            values[:, -1] > 0.0,
        )

    def _spread(self, points: np.ndarray, numbers: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """(n, d) points of the rank's mesh where some are elsewhere; numbers, moved: of the leading rank."""
        store = self.store
        numbers, moved = sent(store.comm, store.owner(numbers), numbers, moved)
        rows = store.rows_of(self.local, points)
        rows[numbers - store.first] = moved
        return store.of_others(self.local.number, rows)[0]


def _untangled(part: _Part, store: Store, interrupted: Callable[[], bool]) -> Untangling | None:
    """The result for a part of a mesh; None where it is too small."""
    # two vertices more, of no cell, so that the part is as large as the whole
    corners = np.stack([store.low, store.high])[:, store.axes]
    dimension, axis = part.freedom.dimension, part.freedom.axis
    freedom = Freedom(np.pad(dimension, (0, 2)), np.pad(axis, ((0, 2), (0, 0))))
    complete = np.pad(part.marked, (0, 2), constant_values=True)
    points = np.concatenate([part.points, corners])
    try:
        found = untangle(points, part.domain.corners, freedom, interrupted, complete=complete)
    except OutOfReach:
        return None
    return replace(found, points=found.points[:-2])


def _overlap(boxes: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(n,) bool: the boxes (n, 2, d), lowest corner first, that overlap one of the others (m, 2, d)."""
    result = np.zeros(len(boxes), dtype=bool)
    low, high = boxes[:, None, 0], boxes[:, None, 1]
    step = max(1, _PAIRS // max(len(boxes), 1))
    for first in range(0, len(others), step):
        some = others[first : first + step]
        over = (low <= some[:, 1]).all(axis=2) & (some[:, 0] <= high).all(axis=2)
        result |= np.logical_or.reduce(over, axis=1)
    return result
