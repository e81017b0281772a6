"""The relaxation problem: which vertices move, the corners around them, and the schedule of a sweep.

This is what the engines work on. It knows neither files nor directions. Vertices are renumbered along a
space-filling curve, and rings are stored in the order in which a sweep visits them, so that what is used
together lies together in memory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.mesh.corners import Corners
from dvr_cli.mesh.csr import group
from dvr_cli.mesh.morton import morton_order
from dvr_cli.mesh.rings import Rings, incidence_of
from dvr_cli.relax.schedule import batches


@dataclass(frozen=True)
class Problem:
    """Rings of the relaxed vertices in the order of a sweep, all in the problem's own numbering.

    order: (N,) the mesh's number of each vertex.
    rings: one ring a relaxed vertex, batch after batch.
    batch_start: (B + 1,) the rings of batch b are batch_start[b] .. batch_start[b+1].
    touched: the corners with a relaxed vertex, over which Q1 is taken.
    dimension: 2 or 3.
    freedom: how far the vertex of each ring may move, one row a ring; None where all move anywhere.
    """

    order: np.ndarray
    rings: Rings
    batch_start: np.ndarray
    touched: Corners
    dimension: int
    freedom: Freedom | None = None

    @property
    def relaxed(self) -> np.ndarray:
        """(m,) the relaxed vertices in the order of a sweep, in the mesh's numbering."""
        return self.order[self.rings.vertices]


def build_problem(
    corners: Corners,
    relaxed: np.ndarray,
    points: np.ndarray,
    order: str = "coloured",
    seed: int = 0,
    compiled: bool = False,
    freedom: Freedom | None = None,
) -> Problem:
    """The problem of relaxing the vertices ``relaxed`` (I_R, in this order) of a mesh with these corners.

    points: (N, d); order: "coloured", "natural" or "shuffled", see ``schedule.batches``; compiled: use the
    compiled set-up, which gives the same problem; freedom: how far they may move, by default anywhere.
    """
    n_points = len(points)
    along_curve = morton_order(points)
    number = np.empty(n_points, dtype=np.int32)
    number[along_curve] = np.arange(n_points)
    moves = np.zeros(n_points, dtype=bool)
    moves[relaxed] = True
    touched = _along_curve(corners, moves, number, compiled)
    on_curve = moves[along_curve]
    incidence = incidence_of(touched, np.flatnonzero(on_curve), n_points, compiled)
    natural = (np.cumsum(on_curve) - 1)[number[relaxed]]
    parts = batches(incidence, order, seed, compiled, natural)
    sequence = np.concatenate([np.empty(0, dtype=np.int64), *parts])
    rings = incidence.rings(touched, sequence, compiled)
    return Problem(
        order=along_curve,
        rings=rings,
        batch_start=np.concatenate([[0], np.cumsum([len(part) for part in parts], dtype=np.int64)]),
        touched=touched,
        dimension=corners.dimension,
        freedom=_of_rings(freedom, along_curve[rings.vertices]),
    )


def _along_curve(corners: Corners, moves: np.ndarray, number: np.ndarray, compiled: bool) -> Corners:
    """The corners with a vertex that moves, vertices renumbered, in the order of their smallest ones."""
    if compiled:
        from dvr_cli.relax.problem_numba import along_curve

        return Corners(*along_curve(corners.vertices, corners.shapes, moves, number), corners.first[:1])
    touched = np.flatnonzero(moves[corners.vertices].any(axis=1))
    vertices = number[corners.vertices[touched]]
    order = group(vertices.min(axis=1), len(number))[0]
    return Corners(vertices[order], corners.shapes[touched[order]], corners.first[:1])


def _of_rings(freedom: Freedom | None, vertices: np.ndarray) -> Freedom | None:
    if freedom is None or not freedom.axis.any():
        return None
    return Freedom(freedom.dimension[vertices], freedom.axis[vertices])
