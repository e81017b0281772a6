"""The relaxation problem: which vertices move, the corners around them, and the schedule of a sweep.

This is what the engines work on. It knows neither files nor directions. Vertices are renumbered in
Morton order, and rings are stored in the order in which a sweep visits them, so that what is used
together lies together in memory (docs/design.md, "The two numberings").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.boundary.freedom import Freedom
from dvr_cli.mesh.corners import Corners, Simplices
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
    touched: the corners with a relaxed vertex, over which Q1 is taken, in the order of their smallest vertex.
    touched_ids: (C,) the number of each among the corners of the mesh.
    dimension: 2 or 3.
    freedom: how far the vertex of each ring may move, one row a ring; None where all move anywhere.
    """

    order: np.ndarray
    rings: Rings
    batch_start: np.ndarray
    touched: Simplices
    touched_ids: np.ndarray
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
    backend: Backend = NUMPY,
    freedom: Freedom | None = None,
) -> Problem:
    """The problem of relaxing the vertices ``relaxed`` (I_R, in this order) of a mesh with these corners.

    points: (N, d); order: "coloured", "natural" or "shuffled", see ``schedule.batches``; backend: what
    computes; freedom: how far they may move, by default anywhere.
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
    sequence = np.concatenate([np.empty(0, dtype=np.int64), *split])
    rings = incidence.rings(touched, sequence, backend)
    return Problem(
        order=morton,
        rings=rings,
        batch_start=np.concatenate([[0], np.cumsum([len(part) for part in split], dtype=np.int64)]),
        touched=touched,
        touched_ids=touched_ids,
        dimension=corners.dimension,
        freedom=_of_rings(freedom, morton[rings.vertices]),
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


def _of_rings(freedom: Freedom | None, vertices: np.ndarray) -> Freedom | None:
    if freedom is None or not freedom.axis.any():
        return None
    return Freedom(freedom.dimension[vertices], freedom.axis[vertices])
