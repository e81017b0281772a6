"""The cells with extreme angles compiled, cell by cell."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty, zeros
from dvr_cli.jit.kernels import compiled, inlined


@compiled
def with_extreme_cosines(
    points: np.ndarray, vertices: np.ndarray, faces: np.ndarray, pairs: np.ndarray, near: float
) -> np.ndarray:
    """As ``angles.with_extreme_cosines``: few other cells are among those it gives."""
    extreme = zeros(len(vertices), np.bool_)
    low, high = np.inf, -np.inf
    normal = empty((len(faces), 3), np.float64)
    length = empty(len(faces), np.float64)
    for c in range(len(vertices)):
        for f in range(len(faces)):
            p, q = vertices[c, faces[f, 0]], vertices[c, faces[f, 1]]
            r, t = vertices[c, faces[f, 2]], vertices[c, faces[f, 3]]
            a0, a1, a2 = points[r, 0] - points[p, 0], points[r, 1] - points[p, 1], points[r, 2] - points[p, 2]
            b0, b1, b2 = points[t, 0] - points[q, 0], points[t, 1] - points[q, 1], points[t, 2] - points[q, 2]
            n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
            normal[f, 0], normal[f, 1], normal[f, 2] = n0, n1, n2
            length[f] = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
        for e in range(len(pairs)):
            i, j = pairs[e, 0], pairs[e, 1]
            size = length[i] * length[j]
            inner = normal[i, 0] * normal[j, 0] + normal[i, 1] * normal[j, 1] + normal[i, 2] * normal[j, 2]
            if size > 0 and (inner >= (high - near) * size or inner <= (low + near) * size):
                extreme[c] = True
                low, high = min(low, inner / size), max(high, inner / size)
    return extreme


@compiled
def tetrahedra_with_extreme_cosines(points: np.ndarray, vertices: np.ndarray, near: float) -> np.ndarray:
    """As ``with_extreme_cosines``."""
    extreme = zeros(len(vertices), np.bool_)
    low, high = np.inf, -np.inf
    for c in range(len(vertices)):
        o, p, q, r = vertices[c, 0], vertices[c, 1], vertices[c, 2], vertices[c, 3]
        normals = (
            _normal(points, o, q, p),
            _normal(points, o, p, r),
            _normal(points, p, q, r),
            _normal(points, o, r, q),
        )
        for i in range(4):
            for j in range(i):
                size = normals[i][3] * normals[j][3]
                inner = normals[i][0] * normals[j][0] + normals[i][1] * normals[j][1]
                inner += normals[i][2] * normals[j][2]
                if size > 0 and (inner >= (high - near) * size or inner <= (low + near) * size):
                    extreme[c] = True
                    low, high = min(low, inner / size), max(high, inner / size)
    return extreme


@inlined
def _normal(points: np.ndarray, p: int, q: int, r: int) -> tuple[float, float, float, float]:
    """``angles.face_normal`` of a triangle, and its length."""
    a0, a1, a2 = points[r, 0] - points[p, 0], points[r, 1] - points[p, 1], points[r, 2] - points[p, 2]
    b0, b1, b2 = points[r, 0] - points[q, 0], points[r, 1] - points[q, 1], points[r, 2] - points[q, 2]
    n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    return n0, n1, n2, np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)


@compiled
def with_extreme_turns(points: np.ndarray, vertices: np.ndarray, near: float) -> np.ndarray:
    """As ``angles.with_extreme_turns``: few other cells are among those it gives.

    A turn grows with the angle, from 0 to 4. Cells whose turn cannot be told are given, too.
    """
    k, space = vertices.shape[1], points.shape[1]
    extreme = zeros(len(vertices), np.bool_)
    low, high = np.inf, -np.inf
    for c in range(len(vertices)):
        for i in range(k):
            o, p, q = vertices[c, i], vertices[c, (i + 1) % k], vertices[c, (i + k - 1) % k]
            a0, a1 = points[p, 0] - points[o, 0], points[p, 1] - points[o, 1]
            b0, b1 = points[q, 0] - points[o, 0], points[q, 1] - points[o, 1]
            inner, cross = a0 * b0 + a1 * b1, a0 * b1 - a1 * b0
            if space == 3:
                a2, b2 = points[p, 2] - points[o, 2], points[q, 2] - points[o, 2]
                n0, n1 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2
                inner, cross = inner + a2 * b2, np.sqrt(n0 * n0 + n1 * n1 + cross * cross)
            size = abs(inner) + abs(cross)
            if not 0.0 < size < np.inf:
                extreme[c] = True
                continue
            turn = 1.0 - inner / size if cross >= 0.0 else 3.0 + inner / size
            if turn <= low + near or turn >= high - near:
                extreme[c] = True
                low, high = min(low, turn), max(high, turn)
    return extreme
