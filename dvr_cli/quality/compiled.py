"""Qualities compiled, corner by corner and cell by cell: the bits that ``mean_ratio`` and ``angles`` give."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled, inlined
from dvr_cli.mesh.compiled import determinant_2d, determinant_3d


@compiled
def corner_terms(
    points: np.ndarray,
    vertices: np.ndarray,
    shapes: np.ndarray,
    norm: np.ndarray,
    v: np.ndarray,
    s: np.ndarray,
) -> None:
    """Put (v, s) of each corner, whose mean ratio is sgn(v) |v|^(2/d) / s, into the arrays v and s (n,).

    norm: as in ``ShapeTable``.
    """
    for c in range(len(vertices)):
        if points.shape[1] == 2:
            v[c], s[c] = corner_terms_2d(points, vertices[c], norm, shapes[c, 0])
        else:
            v[c], s[c] = corner_terms_3d(points, vertices[c], norm, shapes[c, 0])


@inlined
def corner_terms_2d(points: np.ndarray, corner: np.ndarray, norm: np.ndarray, k: int) -> tuple[float, float]:
    """(v, s) of one corner of a planar cell with row k of the shape table."""
    x, p, q = points[corner[0]], points[corner[1]], points[corner[2]]
    e0, e1 = p[0] - x[0], p[1] - x[1]
    f0, f1 = q[0] - x[0], q[1] - x[1]
    s = norm[k, 0] * (e0 * e0 + e1 * e1)
    s = s + norm[k, 1] * (f0 * f0 + f1 * f1)
    s = s + norm[k, 2] * (e0 * f0 + e1 * f1)
    return determinant_2d(points, corner), s


@inlined
def corner_terms_3d(points: np.ndarray, corner: np.ndarray, norm: np.ndarray, k: int) -> tuple[float, float]:
    """(v, s) of one corner of a volume cell with row k of the shape table."""
    x, p, q, r = points[corner[0]], points[corner[1]], points[corner[2]], points[corner[3]]
    e0, e1, e2 = p[0] - x[0], p[1] - x[1], p[2] - x[2]
    f0, f1, f2 = q[0] - x[0], q[1] - x[1], q[2] - x[2]
    g0, g1, g2 = r[0] - x[0], r[1] - x[1], r[2] - x[2]
    s = norm[k, 0] * (e0 * e0 + e1 * e1 + e2 * e2)
    s = s + norm[k, 1] * (f0 * f0 + f1 * f1 + f2 * f2)
    s = s + norm[k, 2] * (g0 * g0 + g1 * g1 + g2 * g2)
    s = s + norm[k, 3] * (e0 * f0 + e1 * f1 + e2 * f2)
    s = s + norm[k, 4] * (e0 * g0 + e1 * g1 + e2 * g2)
    s = s + norm[k, 5] * (f0 * g0 + f1 * g1 + f2 * g2)
    return determinant_3d(points, corner), s


@compiled
def with_extreme_cosines(
    points: np.ndarray, vertices: np.ndarray, faces: np.ndarray, pairs: np.ndarray, near: float
) -> np.ndarray:
    """(n,) bool: the cells with a cosine between the normals of neighbouring faces as large or small as any.

    All that come as near as ``near`` to these are among them, and few others. vertices: (n, k); faces: (F, 4)
    local vertices, of a triangle the last repeated; pairs: (E, 2) of faces with a common edge. The normals
    are those of ``angles``.
    """
    chosen = np.zeros(len(vertices), dtype=np.bool_)
    low, high = np.inf, -np.inf
    normal = np.empty((len(faces), 3))
    length = np.empty(len(faces))
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
                chosen[c] = True
                low, high = min(low, inner / size), max(high, inner / size)
    return chosen
