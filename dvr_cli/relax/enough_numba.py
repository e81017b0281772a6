"""As much as is enough, compiled, and the moves of a batch along lines, which end there.

The operations are those of ``enough`` and ``line``, in the same order.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.kernels import inlined
from dvr_cli.jit.kinds import MEASURED, PLANAR, compiled_by_kind
from dvr_cli.relax.columns_numba import (
    BADNESS,
    SHAPE,
    V1,
    RingArrays,
    largest_badness_2d,
    largest_badness_3d,
    largest_metric_badness,
    set_ring,
)
from dvr_cli.relax.enough import INSIDE, MAX_STEPS
from dvr_cli.relax.line_numba import improves, maximise_minimum, root, worst_corner


@inlined
def nearest(lines: np.ndarray, n: int, d: int, to: float, enough: float) -> float:
    """See ``enough.nearest``, for one ring of n corners."""
    if not lines[BADNESS, worst_corner(lines, n, to, d)] <= enough:
        return to
    aim = enough * (1.0 - INSIDE)
    rate = aim if d == 2 else np.sqrt(aim)
    at = 0.0
    for _ in range(MAX_STEPS):
        worst = worst_corner(lines, n, at, d)
        if lines[BADNESS, worst] <= enough:
            return at
        v, t, dt = root(lines, worst, at, d)
        after = at - (t - rate * v) / (dt - rate * lines[V1, worst])
        if not (after - at) * (to - after) > 0.0:
            return to
        at = after
    return to


@compiled_by_kind
def relax_rings(
    points: np.ndarray,
    directions: np.ndarray,
    start: int,
    stop: int,
    rings: RingArrays,
    enough: float,
    scratch: np.ndarray,
) -> int:
    """Move the vertices of rings start .. stop, which are independent, each to the best point of its line.

    enough: the badness with which a ring is good enough: its vertex goes no further, 0.0 for no such thing.
    points: (N, d), changed in place; directions: (m, d); scratch: (ROWS, largest ring + WIDTH).
    Returns how many vertices moved.
    """
    scratch[SHAPE] = -1.0
    d = points.shape[1]
    moved = 0
    for ring in range(start, stop):
        vertex = rings.vertices[ring]
        d0, d1, d2 = directions[ring, 0], directions[ring, 1], directions[ring, 2] if d == 3 else 0.0
        if d0 == 0.0 and d1 == 0.0 and d2 == 0.0:
            continue
        n = set_ring(points, vertex, d0, d1, d2, ring, rings, scratch)
        step, before = maximise_minimum(scratch, n, d)
        if enough > 0.0:
            step = nearest(scratch, n, d, step, enough)
        if step == 0.0:
            continue
        x0 = points[vertex, 0] + step * d0
        x1 = points[vertex, 1] + step * d1
        x2 = points[vertex, 2] + step * d2 if d == 3 else 0.0
        if MEASURED:
            after = largest_metric_badness(x0, x1, x2, n, d, scratch)
        elif PLANAR:
            after = largest_badness_2d(x0, x1, n, scratch)
        else:
            after = largest_badness_3d(x0, x1, x2, n, scratch)
        if improves(before, after, d):
            points[vertex, 0], points[vertex, 1] = x0, x1
            if d == 3:
                points[vertex, 2] = x2
            moved += 1
    return moved
