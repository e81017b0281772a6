"""Morton order: an order of points in which neighbours in space are neighbours in memory."""

from __future__ import annotations

import numpy as np

_BITS = {2: 31, 3: 21}  # of each coordinate, so that all fit 63 bits


def morton_order(points: np.ndarray) -> np.ndarray:
    """(N,) the points (N, d), d = 2 or 3, in Morton order."""
    if not len(points):
        return np.empty(0, dtype=np.int64)
    return np.argsort(morton_codes(points, points.min(axis=0), points.max(axis=0)), kind="stable")


def morton_codes(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(n,) the places of points (n, d) on the curve; low, high: (d,) of the box of these and all others."""
    d = points.shape[1]
    extent = float((high - low).max())
    scale = (2 ** _BITS[d] - 1) / extent if 0.0 < extent < np.inf else 0.0
    cell = ((points - low) * scale).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for i in range(d):
        code |= _spread(cell[:, i], d) << i
    return code


def _spread(x: np.ndarray, d: int) -> np.ndarray:
    """Insert d - 1 zero bits between the bits of x (n,)."""
    steps: tuple[tuple[int, int], ...]
    if d == 2:
        steps = ((16, 0x0000FFFF0000FFFF), (8, 0x00FF00FF00FF00FF), (4, 0x0F0F0F0F0F0F0F0F))
        steps += ((2, 0x3333333333333333), (1, 0x5555555555555555))
    else:
        steps = ((32, 0x001F00000000FFFF), (16, 0x001F0000FF0000FF), (8, 0x100F00F00F00F00F))
        steps += ((4, 0x10C30C30C30C30C3), (2, 0x1249249249249249))
    x = x.copy()
    for shift, mask in steps:
        x |= x << shift
        x &= mask
    return x
