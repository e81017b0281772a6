"""As much as is enough: the nearest place on a line where a ring is as good as it needs to be.

B = limit is where t = rate · v (see ``line.Lines.root``). t - rate · v is convex in each corner, so Newton's
method on the worst, from a place that is not good enough, comes nearer and never goes beyond.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.relax.line import Lines

INSIDE = 1e-6  # how far beyond enough, in relative badness, the search aims
MAX_STEPS = 30  # Newton steps; about 4 are usual


def nearest(lines: Lines, to: np.ndarray, enough: float) -> np.ndarray:
    """λ between 0 and ``to`` (n,), the nearest to 0 at which no badness is above ``enough``.

    0 where that is so already, ``to`` where it is not so even there. lines: of n rings, (K, n).
    """
    aim = enough * (1.0 - INSIDE)
    rate = aim if lines.dimension == 2 else np.sqrt(aim)
    result = to.copy()
    with np.errstate(all="ignore"):
        which = np.flatnonzero(lines.badness(to).max(axis=0) <= enough)
        lines, to, at = lines.taken(which), to[which], np.zeros(len(which))
        for _ in range(MAX_STEPS):
            if not len(which):
                break
            here = lines.badness(at)
            worst = here.argmax(axis=0)
            found = here[worst, np.arange(len(at))] <= enough
            result[which[found]] = at[found]
            one = lines.of(worst)
            v, t, dt = one.root(at)
            after = at - (t - rate * v) / (dt - rate * one.v1)
            keep = np.flatnonzero(~found & ((after - at) * (to - after) > 0.0))
            lines, which, at, to = lines.taken(keep), which[keep], after[keep], to[keep]
    return result
