"""Gaps compiled: each point with each triangle of its part."""

from __future__ import annotations

import numpy as np

from dvr_cli.boundary.gaps import SLACK
from dvr_cli.jit.arrays import full
from dvr_cli.jit.kernels import compiled


@compiled
def least_gaps(
    own: np.ndarray,
    part: np.ndarray,
    a: np.ndarray,
    e: np.ndarray,
    f: np.ndarray,
    triangle: np.ndarray,
    start: np.ndarray,
) -> np.ndarray:
    """As ``gaps.least_gaps``."""
    result = full(len(own), np.inf, np.float64)
    for point in range(len(own)):
        for entry in range(start[part[point]], start[part[point] + 1]):
            t = triangle[entry]
            det = e[t, 0] * f[t, 1] - e[t, 1] * f[t, 0]
            if det == 0.0:
                continue
            x, y, height = own[point, 0] - a[t, 0], own[point, 1] - a[t, 1], own[point, 2] - a[t, 2]
            u = (x * f[t, 1] - y * f[t, 0]) / det
            w = (e[t, 0] * y - e[t, 1] * x) / det
            if u >= -SLACK and w >= -SLACK and u + w <= 1.0 + SLACK:
                gap = abs(height - (u * e[t, 2] + w * f[t, 2]))
                result[point] = min(result[point], gap)
    return result
