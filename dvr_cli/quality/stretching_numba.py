"""Averages over cells compiled: the same sums in the same order as ``stretching``."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled


@compiled
def averaged(values: np.ndarray, vertices: np.ndarray, start: np.ndarray, n_points: int) -> np.ndarray:
    """As ``stretching.averaged``."""
    n, width, parts = len(values), vertices.shape[1], values.shape[1]
    count = np.zeros(n_points)
    total = np.zeros((n_points, parts))
    for k in range(width):
        for cell in range(n):
            for c in range(start[cell], start[cell + 1]):
                count[vertices[c, k]] += 1.0
                for i in range(parts):
                    total[vertices[c, k], i] += values[cell, i]
    for vertex in range(n_points):
        for i in range(parts):
            total[vertex, i] /= max(count[vertex], 1.0)
    result = np.zeros((n, parts))
    for k in range(width):
        for cell in range(n):
            for c in range(start[cell], start[cell + 1]):
                for i in range(parts):
                    result[cell, i] += total[vertices[c, k], i]
    for cell in range(n):
        for i in range(parts):
            result[cell, i] /= (start[cell + 1] - start[cell]) * width
    return result
