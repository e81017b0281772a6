"""The relaxation problem: which vertices move, the corners around them, and the schedule of a sweep.

This is what the engines work on. It knows neither files nor directions. Vertices are renumbered in
Morton order, and rings are stored in the order in which a sweep visits them, so that what is used
together lies together in memory (docs/design.md, "The two numberings").
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.boundary.freedom import Freedom
from dvr_cli.mesh.corners import Corners, Simplices
from dvr_cli.mesh.csr import group
from dvr_cli.mesh.morton import morton_order
from dvr_cli.mesh.rings import Incidence, Rings, incidence_of
from dvr_cli.relax.schedule import batches

if TYPE_CHECKING:
    from dvr_cli.boundary.smooth_parts import SmoothParts
    from dvr_cli.relax.surface.carriers import Carriers

_FEW_ROWS = 1000  # of a shape table, which any cache holds


@dataclass(frozen=True, eq=False)
class Problem:
    """Rings of the relaxed vertices in the order of a sweep, all in the problem's own numbering.

    order: (N,) the mesh's number of each vertex.
    rings: one ring a relaxed vertex, batch after batch.
    batch_start: (B + 1,) the rings of batch b are batch_start[b] .. batch_start[b+1].
    touched: the corners with a relaxed vertex, over which Q1 is taken, in the order of their smallest vertex.
    touched_ids: (C,) the number of each among the corners of the mesh.
    dimension: 2 or 3, of the corners. components: how many coordinates the points have.
    walk_start: (B,) in each batch the rings of vertices that walk are its last, from walk_start[b] on.
    freedom: how far the vertex of each ring may move, one row a ring; None where all move anywhere.
    carriers: the input's facets and curves that vertices walk on; None where none does.
    """

    order: np.ndarray
    rings: Rings
    batch_start: np.ndarray
    touched: Simplices
    touched_ids: np.ndarray
    dimension: int
    components: int
    freedom: Freedom | None = None
    walk_start: np.ndarray | None = None
    carriers: Carriers | None = None
    _incidence: dict[Backend, Incidence] = field(default_factory=dict, init=False, repr=False)

    @property
    def is_surface(self) -> bool:
        """True for a surface in space, whose corners have one dimension less than its points coordinates."""
        return self.components > self.dimension

    @property
    def relaxed(self) -> np.ndarray:
        """(m,) the relaxed vertices in the order of a sweep, in the mesh's numbering."""
        return self.order[self.rings.vertices]

    def incidence(self, backend: Backend) -> Incidence:
        """The touched corners that contain the vertex of each ring; backend: what computes it once."""
        known, size = self._incidence, len(self.order)
        if backend not in known:
            known[backend] = incidence_of(self.touched, self.rings.vertices, size, backend)
        return known[backend]

    def parts(self, batch: int) -> tuple[int, int, int]:
        """The first ring of a batch, the first of its vertices that walk, and the first of the next batch."""
        lo, hi = self.batch_start[batch : batch + 2].tolist()
        return lo, hi if self.walk_start is None else int(self.walk_start[batch]), hi

    def of_rings(self, chosen: np.ndarray) -> Problem:
        """The same with the rings ``chosen`` ((k,) ascending numbers) alone, none of whose vertices walks."""
        freedom = self.freedom
        if freedom is not None:
            freedom = Freedom(freedom.dimension[chosen], freedom.axis[chosen])
        batch_start = np.searchsorted(chosen, self.batch_start)
        return replace(self, rings=self.rings.part(chosen), batch_start=batch_start, freedom=freedom)

    def keeping_within(self, limit: float, across: np.ndarray | None = None) -> Problem:
        """The same, in which walks take the mesh no farther from the input than ``limit``.

        across: see ``Carriers.within``.
        """
        if self.carriers is None:
            return self
        return replace(self, carriers=self.carriers.within(limit, across))


class RingArrays(NamedTuple):
    """The arrays of ``Rings`` and ``ShapeTable`` as kernels read them."""

    vertices: np.ndarray
    start: np.ndarray
    others: np.ndarray
    shapes: np.ndarray
    norm: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray
    factor: np.ndarray


class RingFreedom(NamedTuple):
    """The freedom of the vertices of rings, as kernels read it.

    active: (m,) bool, the rings that are asked about. on_line, axis: (m,) and (m, d), see
        ``freedom.project``; empty where all vertices move anywhere.
    """

    active: np.ndarray
    on_line: np.ndarray
    axis: np.ndarray


def ring_arrays(problem: Problem) -> RingArrays:
    """The rings of a problem and its targets, for kernels."""
    rings, table = problem.rings, problem.touched.table
    return RingArrays(
        *(rings.vertices, rings.start, rings.others, rings.shapes),
        *(table.norm, table.slope, table.curvature, table.factor),
    )


def build_problem(
    corners: Corners,
    relaxed: np.ndarray,
    points: np.ndarray,
    order: str = "coloured",
    seed: int = 0,
    backend: Backend = NUMPY,
    freedom: Freedom | None = None,
    parts: SmoothParts | None = None,
) -> Problem:
    """The problem of relaxing the vertices ``relaxed`` (I_R, in this order) of a mesh with these corners.

    points: (N, d); order: "coloured", "natural" or "shuffled", see ``schedule.batches``; backend: what
    computes; freedom: how far they may move, by default anywhere. parts: the curved boundary or surface that
    some of them walk on.
    """
    n_points = len(points)
    morton = morton_order(points)
    number = np.empty(n_points, dtype=np.int32)
    number[morton] = np.arange(n_points)
    moves = np.zeros(n_points, dtype=bool)
    moves[relaxed] = True
    vertices, shapes, touched_ids = backend.twin(touched_corners)(
        corners.vertices, corners.shapes, moves, number
    )
    touched = Simplices(vertices, shapes, corners.table)
    moving = moves[morton]
    incidence = incidence_of(touched, np.flatnonzero(moving), n_points, backend)
    natural = (np.cumsum(moving) - 1)[number[relaxed]]
    split = batches(incidence, order, seed, backend, natural)
    if parts is not None:
        walks = np.zeros(n_points, dtype=bool)
        walks[number[parts.walking]] = True
        split = [part[np.argsort(walks[incidence.vertices[part]], kind="stable")] for part in split]
    sequence = np.concatenate([np.empty(0, dtype=np.int64), *split])
    touched, rings = _in_order_of_use(touched, incidence.rings(touched, sequence, backend))
    batch_start = np.concatenate([[0], np.cumsum([len(part) for part in split], dtype=np.int64)])
    walk_start = carriers = None
    if parts is not None:
        free = [np.count_nonzero(~walks[incidence.vertices[part]]) for part in split]
        from dvr_cli.relax.surface.carriers import carriers_of  # only where vertices walk

        walk_start = batch_start[:-1] + np.array(free, dtype=np.int64)
        carriers = carriers_of(corners, points, parts, number, rings, touched, touched_ids, backend)
    return Problem(
        order=morton,
        rings=rings,
        batch_start=batch_start,
        touched=touched,
        touched_ids=touched_ids,
        dimension=corners.dimension,
        components=points.shape[1],
        freedom=_of_rings(freedom, morton[rings.vertices]),
        walk_start=walk_start,
        carriers=carriers,
    )


def touched_corners(
    vertices: np.ndarray, shapes: np.ndarray, moves: np.ndarray, number: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The corners with a vertex that moves, in the order of their smallest vertex: vertices, shapes, numbers.

    vertices, shapes: of Corners; moves: (N,) bool; number: (N,) the vertices are renumbered so.
    """
    touched = np.flatnonzero(moves[vertices].any(axis=1))
    renumbered = number[vertices[touched]]
    order = group(renumbered.min(axis=1), len(number))[0]
    return renumbered[order], shapes[touched[order]], touched[order]


def _in_order_of_use(touched: Simplices, rings: Rings) -> tuple[Simplices, Rings]:
    """The same with a table of those rows alone that they name, those that are used together near each other.

    Rows that several rings name come first, in the order of the corners, then those of one ring, in the order
    in which a sweep reads them. Few are left as they are.
    """
    table = touched.table
    if len(table.norm) <= _FEW_ROWS:
        return touched, rings
    of_corners = touched.shapes.ravel()
    shared = np.bincount(rings.shapes, minlength=len(table.norm)) > 1
    named = np.concatenate([of_corners[shared[of_corners]], rings.shapes, of_corners])
    place = np.arange(len(named))
    first = np.empty(len(table.norm), dtype=np.int64)
    first[named[::-1]] = place[::-1]  # the first place of each is the last to be put
    rows = named[first[named] == place]
    number = np.empty(len(table.norm), dtype=rings.shapes.dtype)
    number[rows] = np.arange(len(rows), dtype=number.dtype)
    return (
        replace(touched, shapes=number[touched.shapes], table=table.part(rows)),
        replace(rings, shapes=number[rings.shapes]),
    )


def _of_rings(freedom: Freedom | None, vertices: np.ndarray) -> Freedom | None:
    if freedom is None or not freedom.axis.any():
        return None
    return Freedom(freedom.dimension[vertices], freedom.axis[vertices])
