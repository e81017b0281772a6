"""Determinants of simplices compiled: those that ``simplex`` gives, simplex by simplex."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty
from dvr_cli.jit.kernels import compiled, inlined


@compiled
def determinants(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """As ``simplex.determinants``."""
    result = empty(len(vertices), np.float64)
    for i in range(len(vertices)):
        if vertices.shape[1] == 3:
            result[i] = determinant_2d(points, vertices[i])
        else:
            result[i] = determinant_3d(points, vertices[i])
    return result


@inlined
def determinant_2d(points: np.ndarray, corner: np.ndarray) -> float:
    """Determinant of the edges of one triangle (3,) from its first vertex."""
    x, p, q = points[corner[0]], points[corner[1]], points[corner[2]]
    return (p[0] - x[0]) * (q[1] - p[1]) + (p[1] - x[1]) * -(q[0] - p[0])


@inlined
def determinant_3d(points: np.ndarray, corner: np.ndarray) -> float:
    """Determinant of the edges of one tetrahedron (4,) from its first vertex."""
    x, p, q, r = points[corner[0]], points[corner[1]], points[corner[2]], points[corner[3]]
    a0, a1, a2 = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    b0, b1, b2 = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    e0, e1, e2 = p[0] - x[0], p[1] - x[1], p[2] - x[2]
    return e0 * (a1 * b2 - a2 * b1) + e1 * (a2 * b0 - a0 * b2) + e2 * (a0 * b1 - a1 * b0)
