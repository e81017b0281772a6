"""The corners of a problem compiled, corner by corner."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty, full, zeros
from dvr_cli.jit.kernels import compiled


@compiled
def touched_corners(
    vertices: np.ndarray, shapes: np.ndarray, moves: np.ndarray, number: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As ``problem.touched_corners``."""
    n, width = vertices.shape
    smallest = full(n, -1, np.int32)
    place = zeros(len(number) + 1, np.int64)
    for c in range(n):
        least, touched = number[vertices[c, 0]], False
        for k in range(width):
            least = min(least, number[vertices[c, k]])
            touched = touched or moves[vertices[c, k]]
        if touched:
            smallest[c] = least
            place[least + 1] += 1
    for i in range(len(number)):
        place[i + 1] += place[i]
    new_vertices = empty((place[-1], width), np.int32)
    new_shapes = empty((place[-1], width), np.int32)
    numbers = empty(place[-1], np.int64)
    for c in range(n):
        if smallest[c] >= 0:
            to = place[smallest[c]]
            place[smallest[c]] += 1
            numbers[to] = c
            for k in range(width):
                new_vertices[to, k] = number[vertices[c, k]]
                new_shapes[to, k] = shapes[c, k]
    return new_vertices, new_shapes, numbers
