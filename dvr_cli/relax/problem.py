"""The relaxation problem: which vertices move, the corners around them, and the schedule of a sweep.

This is what the engines work on. It knows neither files nor directions. Vertices are renumbered along a
space-filling curve, and rings are stored in the order in which a sweep visits them, so that what is used
together lies together in memory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.mesh.corners import Corners
from dvr_cli.mesh.curve import curve_order
from dvr_cli.mesh.rings import Rings, rings_of
from dvr_cli.relax.schedule import batches


@dataclass(frozen=True)
class Problem:
    """Rings of the relaxed vertices in the order of a sweep, all in the problem's own numbering.

    order: (N,) the mesh's number of each vertex.
    rings: one ring a relaxed vertex, batch after batch.
    batch_start: (B + 1,) the rings of batch b are batch_start[b] .. batch_start[b+1].
    touched: the corners with a relaxed vertex, over which Q1 is taken.
    dimension: 2 or 3.
    """

    order: np.ndarray
    rings: Rings
    batch_start: np.ndarray
    touched: Corners
    dimension: int

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
) -> Problem:
    """The problem of relaxing the vertices ``relaxed`` (I_R, in this order) of a mesh with these corners.

    points: (N, d); order: "coloured", "natural" or "shuffled", see ``schedule.batches``; compiled: use the
    compiled set-up, which gives the same problem.
    """
    n_points = len(points)
    rings = rings_of(corners, relaxed, n_points, compiled)
    along_curve = curve_order(points)
    number = np.empty(n_points, dtype=np.int32)
    number[along_curve] = np.arange(n_points)
    sets = batches(rings, n_points, order, seed, compiled)
    parts = [members[np.argsort(number[rings.vertices[members]])] for members in sets]
    sequence = np.concatenate([np.empty(0, dtype=np.int64), *parts])
    rings = rings.permuted(sequence, compiled)
    moves = np.zeros(n_points, dtype=bool)
    moves[relaxed] = True
    touched = moves[corners.vertices].any(axis=1)
    return Problem(
        order=along_curve,
        rings=Rings(number[rings.vertices], rings.start, number[rings.others], rings.shapes),
        batch_start=np.concatenate([[0], np.cumsum([len(part) for part in parts], dtype=np.int64)]),
        touched=Corners(number[corners.vertices[touched]], corners.shapes[touched], corners.first[:1]),
        dimension=corners.dimension,
    )
