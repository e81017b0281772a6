"""Altitudes compiled, simplex by simplex: the same operations in the same order as ``altitudes``."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.kernels import inlined
from dvr_cli.jit.kinds import ON_SURFACE, PLANAR, compiled_by_kind


@compiled_by_kind
def extremes(points: np.ndarray, corners: np.ndarray) -> tuple[float, float]:
    """As ``altitudes.extremes``."""
    least, sharpest = np.inf, 0.0
    for c in range(len(corners)):
        if PLANAR:
            v, largest, total = plane_facets(points, corners[c, 0], corners[c, 1], corners[c, 2])
        elif ON_SURFACE:
            v, largest, total = surface_facets(points, corners[c, 0], corners[c, 1], corners[c, 2])
        else:
            o, p, q, r = corners[c, 0], corners[c, 1], corners[c, 2], corners[c, 3]
            v, largest, total = space_facets(points, o, p, q, r)
        least = min(least, 0.0 if v == 0.0 else v / np.sqrt(largest))
        sharpest = max(sharpest, np.inf if v == 0.0 else total / (v * v))
    return least, sharpest


@inlined
def surface_facets(points: np.ndarray, o: int, p: int, q: int) -> tuple[float, float, float]:
    """Twice the area of a triangle in space, and the largest and the sum of its squared sides."""
    e0, e1, e2 = points[p, 0] - points[o, 0], points[p, 1] - points[o, 1], points[p, 2] - points[o, 2]
    f0, f1, f2 = points[q, 0] - points[o, 0], points[q, 1] - points[o, 1], points[q, 2] - points[o, 2]
    g0, g1, g2 = f0 - e0, f1 - e1, f2 - e2
    a, b, c = e0 * e0 + e1 * e1 + e2 * e2, f0 * f0 + f1 * f1 + f2 * f2, g0 * g0 + g1 * g1 + g2 * g2
    return np.sqrt(_squared_face(e0, e1, e2, f0, f1, f2)), max(max(a, b), c), a + b + c


@inlined
def plane_facets(points: np.ndarray, o: int, p: int, q: int) -> tuple[float, float, float]:
    """The determinant of a triangle, and the largest and the sum of its squared sides."""
    e0, e1 = points[p, 0] - points[o, 0], points[p, 1] - points[o, 1]
    f0, f1 = points[q, 0] - points[o, 0], points[q, 1] - points[o, 1]
    g0, g1 = f0 - e0, f1 - e1
    n0, n1 = points[q, 0] - points[p, 0], points[q, 1] - points[p, 1]
    v = e0 * n1 + e1 * -n0
    a, b, c = e0 * e0 + e1 * e1, f0 * f0 + f1 * f1, g0 * g0 + g1 * g1
    return v, max(max(a, b), c), a + b + c


@inlined
def space_facets(points: np.ndarray, o: int, p: int, q: int, r: int) -> tuple[float, float, float]:
    """The determinant of a tetrahedron, and the largest and the sum of four times its squared faces."""
    x0, x1, x2 = points[o, 0], points[o, 1], points[o, 2]
    p0, p1, p2 = points[p, 0], points[p, 1], points[p, 2]
    q0, q1, q2 = points[q, 0], points[q, 1], points[q, 2]
    r0, r1, r2 = points[r, 0], points[r, 1], points[r, 2]
    e0, e1, e2 = p0 - x0, p1 - x1, p2 - x2
    f0, f1, f2 = q0 - x0, q1 - x1, q2 - x2
    g0, g1, g2 = r0 - x0, r1 - x1, r2 - x2
    a0, a1, a2 = q0 - p0, q1 - p1, q2 - p2
    b0, b1, b2 = r0 - p0, r1 - p1, r2 - p2
    v = e0 * (a1 * b2 - a2 * b1) + e1 * (a2 * b0 - a0 * b2) + e2 * (a0 * b1 - a1 * b0)
    s = _squared_face(f0, f1, f2, g0, g1, g2)
    t = _squared_face(g0, g1, g2, e0, e1, e2)
    u = _squared_face(e0, e1, e2, f0, f1, f2)
    w = _squared_face(f0 - e0, f1 - e1, f2 - e2, g0 - e0, g1 - e1, g2 - e2)
    return v, max(max(max(s, t), u), w), s + t + u + w


@inlined
def _squared_face(a0: float, a1: float, a2: float, b0: float, b1: float, b2: float) -> float:
    """The squared length of the vector product of two edges."""
    n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    return n0 * n0 + n1 * n1 + n2 * n2
