"""As much as is enough, compiled: the same operations in the same order as ``enough``."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import inlined
from dvr_cli.relax.columns_numba import BADNESS, V1
from dvr_cli.relax.enough import INSIDE, MAX_STEPS
from dvr_cli.relax.line_numba import root, worst_corner


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
