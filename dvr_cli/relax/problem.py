"""The relaxation problem: which vertices move, the corners around them, and the schedule of a sweep.

This is what the engines work on. It knows neither files nor directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.mesh.corners import Corners
from dvr_cli.mesh.rings import Rings, rings_of
from dvr_cli.relax.schedule import batches


@dataclass(frozen=True)
class Problem:
    """Rings of the relaxed vertices, stored in the order in which a sweep visits them.

    rings: one ring a relaxed vertex, batch after batch.
    batch_start: (B + 1,) the rings of batch b are batch_start[b] .. batch_start[b+1].
    dimension: 2 or 3.
    """

    rings: Rings
    batch_start: np.ndarray
    dimension: int


def build_problem(
    corners: Corners, relaxed: np.ndarray, n_points: int, order: str = "coloured", seed: int = 0
) -> Problem:
    """The problem of relaxing the vertices ``relaxed`` (I_R, in this order) of a mesh with these corners.

    order: "coloured", "natural" or "shuffled"; see ``schedule.batches``.
    """
    rings = rings_of(corners, relaxed, n_points)
    parts = batches(rings, n_points, order, seed)
    sequence = np.concatenate([np.empty(0, dtype=np.int64), *parts])
    start = np.concatenate([[0], np.cumsum([len(part) for part in parts], dtype=np.int64)])
    return Problem(rings.permuted(sequence), start, corners.dimension)
