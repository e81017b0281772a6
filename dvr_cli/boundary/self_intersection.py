"""Facets that cross each other: a boundary that no valid mesh can have.

In the plane two edges cross when each has the ends of the other on either side. In space two faces cross when
an edge of one pierces the other; faces with four vertices are cut into two triangles. Facets with a common
vertex are not looked at.
"""

from __future__ import annotations

import numpy as np

_PAIRS = 1 << 20  # pairs of facets looked at together


def crossing_facets(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """(F,) bool: the facets that cross another one.

    points: (N, d); facets: (F, 2) edges in the plane, (F, 3) triangles in space.
    """
    crosses = np.zeros(len(facets), dtype=bool)
    boxes = points[facets]
    low, high = boxes.min(axis=1), boxes.max(axis=1)
    order = np.argsort(low[:, 0], kind="stable")
    facets, low, high = facets[order], low[order], high[order]
    last = np.searchsorted(
        low[:, 0], high[:, 0], side="right"
    )  # sweep along x: boxes that begin before one ends
    start, n = 0, len(facets)
    while start < n:
        ahead = np.cumsum(last[start:] - np.arange(start, n))
        until = start + max(int(np.searchsorted(ahead, _PAIRS)), 1)
        length = last[start:until] - np.arange(start, until)
        a = np.repeat(np.arange(start, until), length)
        b = a + np.arange(len(a)) - np.repeat(np.cumsum(length) - length, length)
        near = (a != b) & (low[a] <= high[b]).all(axis=1) & (low[b] <= high[a]).all(axis=1)
        a, b = a[near], b[near]
        apart = ~(facets[a][:, :, None] == facets[b][:, None, :]).any(axis=(1, 2))
        a, b = a[apart], b[apart]
        x, y = points[facets[a]], points[facets[b]]
        both = _edges_cross(x, y) if points.shape[1] == 2 else _pierces(x, y) | _pierces(y, x)
        crosses[order[a[both]]] = crosses[order[b[both]]] = True
        start = until
    return crosses


def _edges_cross(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n,) whether edges x and y (n, 2, 2) cross in their insides."""

    def apart(line: np.ndarray, ends: np.ndarray) -> np.ndarray:
        along, offset = line[:, 1] - line[:, 0], ends - line[:, :1]
        side = along[:, None, 0] * offset[:, :, 1] - along[:, None, 1] * offset[:, :, 0]
        return side[:, 0] * side[:, 1] < 0

    return apart(x, y) & apart(y, x)


def _pierces(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n,) whether an edge of triangle x passes through the inside of triangle y, both (n, 3, 3)."""
    result = np.zeros(len(x), dtype=bool)
    for i in range(3):
        p, q = x[:, i], x[:, (i + 1) % 3]
        ends = [_volume(y[:, 0], y[:, 1], y[:, 2], end) for end in (p, q)]
        around = [_volume(p, q, y[:, j], y[:, (j + 1) % 3]) for j in range(3)]
        inside = (around[0] * around[1] > 0) & (around[1] * around[2] > 0)
        result |= (ends[0] * ends[1] < 0) & inside
    return result


def _volume(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    return np.einsum("ni,ni->n", np.cross(b - a, c - a), d - a)
