"""The worst qualities in rings compiled, corner by corner: only those are looked for that may have grown."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty, zeros
from dvr_cli.jit.kernels import compiled


@compiled
def corners_of_rings(rings: np.ndarray, start: np.ndarray, corner: np.ndarray, n: int) -> np.ndarray:
    """As ``ring_qualities.corners_of_rings``, in another order."""
    seen = zeros(n, np.bool_)
    found = empty(n, np.int64)
    count = 0
    for ring in rings:
        for entry in range(start[ring], start[ring + 1]):
            if not seen[corner[entry]]:
                seen[corner[entry]] = True
                found[count] = corner[entry]
                count += 1
    return found[:count]


@compiled
def renew(
    values: np.ndarray,
    qualities: np.ndarray,
    changed: np.ndarray,
    new: np.ndarray,
    start: np.ndarray,
    corner: np.ndarray,
    members: np.ndarray,
) -> None:
    """As ``ring_qualities.renew``."""
    before = empty(len(changed), np.float64)
    for i in range(len(changed)):
        before[i] = qualities[changed[i]]
        qualities[changed[i]] = new[i]
    for i in range(len(changed)):
        for k in range(members.shape[1]):
            ring = members[changed[i], k]
            if ring < 0:
                continue
            if new[i] <= values[ring]:
                values[ring] = new[i]
            elif before[i] <= values[ring]:  # it may have been the worst, and another is now
                worst = new[i]
                for entry in range(start[ring], start[ring + 1]):
                    worst = min(worst, qualities[corner[entry]])
                values[ring] = worst
