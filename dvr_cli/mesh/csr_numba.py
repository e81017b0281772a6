"""Grouping compiled: by counting the groups that ``csr`` gives by sorting."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty, zeros
from dvr_cli.jit.kernels import compiled


@compiled
def group(keys: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """As ``csr.group``: positions of ``keys`` grouped by value, ascending within each group, and offsets."""
    start = zeros(n + 1, np.int64)
    for key in keys:
        if key >= 0:
            start[key + 1] += 1
    for i in range(n):
        start[i + 1] += start[i]
    fill = start[:-1].copy()
    position = empty(start[n], np.int64)
    for i in range(len(keys)):
        if keys[i] >= 0:
            position[fill[keys[i]]] = i
            fill[keys[i]] += 1
    return position, start
