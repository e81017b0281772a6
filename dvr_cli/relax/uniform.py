"""Directions drawn uniformly, each from its own numbers: a key, the sweep and the vertex say what it is.

Nothing is drawn in sequence, so any part of the vertices, in any order, on any number of threads or machines,
gets what it would get among all. The generator is Philox4x32-10 (Salmon, Moraes, Dror & Shaw, *Parallel
random numbers: as easy as 1, 2, 3*, SC 2011). The method is Marsaglia's (*Choosing a point from the surface
of a sphere*, 1972): a point of a square is drawn until it lies within the circle, and goes to the sphere or
the circle with a square root, which is the same on every processor, unlike sines and logarithms.
"""

from __future__ import annotations

import numpy as np

FACTORS = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)  # of Philox4x32
STEPS = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)  # by which the two halves of its key grow
ROUNDS = 10
HALF, LOW = np.uint64(32), np.uint64(0xFFFFFFFF)
DROPPED, UNIT = 11, 2.0**-52  # of 64 bits those that a float has no room for; the last one that it has

_CHUNK = 1 << 14  # vertices at a time: their numbers stay in cache


def unit_vectors(vertices: np.ndarray, key: np.uint64, sweep: np.uint64, result: np.ndarray) -> None:
    """Fill ``result`` (m, d) with unit vectors for the vertices of these numbers ((m,) int64) in a sweep."""
    for lo in range(0, len(vertices), _CHUNK):
        pending, attempt = np.arange(lo, min(lo + _CHUNK, len(vertices))), 0
        while len(pending):
            u, v = _points_of_square(vertices[pending].astype(np.uint64), key, sweep, np.uint64(attempt))
            square = u * u + v * v
            inside = (square < 1.0) & (square > 0.0)
            rows, u, v, square = pending[inside], u[inside], v[inside], square[inside]
            if result.shape[1] == 2:
                length = np.sqrt(square)
                result[rows, 0], result[rows, 1] = u / length, v / length
            else:
                width = 2.0 * np.sqrt(1.0 - square)
                result[rows, 0], result[rows, 1] = u * width, v * width
                result[rows, 2] = 1.0 - 2.0 * square
            pending, attempt = pending[~inside], attempt + 1


def _points_of_square(
    vertices: np.ndarray, key: np.uint64, sweep: np.uint64, attempt: np.uint64
) -> tuple[np.ndarray, np.ndarray]:
    """Points of the square from -1 to 1, their coordinates u and v, one for each of ``vertices`` (uint64)."""
    counter = vertices & LOW, vertices >> HALF, np.full_like(vertices, sweep), np.full_like(vertices, attempt)
    a, b, c, d = philox(counter, key)
    u, v = (b << HALF | a).view(np.int64), (d << HALF | c).view(np.int64)
    return (u >> DROPPED) * UNIT, (v >> DROPPED) * UNIT


def philox(
    counter: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], key: np.uint64
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Philox4x32-10: the four words of 32 bits, as (m,) uint64, for counters of four such words each."""
    a, b, c, d = counter
    left, right = key & LOW, key >> HALF
    for _ in range(ROUNDS):
        one, other = a * FACTORS[0], c * FACTORS[1]
        a, b, c, d = other >> HALF ^ b ^ left, other & LOW, one >> HALF ^ d ^ right, one & LOW
        left, right = left + STEPS[0] & LOW, right + STEPS[1] & LOW
    return a, b, c, d
