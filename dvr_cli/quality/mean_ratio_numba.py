"""Qualities compiled, corner by corner and cell by cell: the bits that ``mean_ratio`` and ``angles`` give."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.kernels import inlined
from dvr_cli.jit.kinds import ON_SURFACE, PLANAR, compiled_by_kind
from dvr_cli.mesh.simplex_numba import determinant_2d, determinant_3d


@compiled_by_kind
def corner_terms(
    points: np.ndarray,
    corners: np.ndarray,
    shapes: np.ndarray,
    norm: np.ndarray,
    v: np.ndarray,
    s: np.ndarray,
) -> None:
    """Put (v, s) of each corner, whose mean ratio is sgn(v) |v|^(2/d) / s, into the arrays v and s (n,).

    norm: as in ``ShapeTable``.
    """
    for c in range(len(corners)):
        if PLANAR:
            v[c], s[c] = corner_terms_2d(points, corners[c], norm, shapes[c, 0])
        elif ON_SURFACE:
            v[c], s[c] = corner_terms_on_surface(points, corners[c], norm, shapes[c, 0])
        else:
            v[c], s[c] = corner_terms_3d(points, corners[c], norm, shapes[c, 0])


@compiled_by_kind
def metric_norms(
    points: np.ndarray,
    vertices: np.ndarray,
    shapes: np.ndarray,
    norm: np.ndarray,
    factor: np.ndarray,
    s: np.ndarray,
) -> None:
    """As ``mean_ratio.metric_norms``."""
    for c in range(len(vertices)):
        s[c] = metric_norm(points, vertices[c], norm, factor, shapes[c, 0])


@inlined
def metric_norm(
    points: np.ndarray, corner: np.ndarray, norm: np.ndarray, factor: np.ndarray, k: int
) -> float:
    """s of one corner with row k of the shape table, its edges seen through L."""
    x, p, q = points[corner[0]], points[corner[1]], points[corner[2]]
    if PLANAR:
        e0, e1 = through_2d(factor, k, p[0] - x[0], p[1] - x[1])
        f0, f1 = through_2d(factor, k, q[0] - x[0], q[1] - x[1])
        s = norm[k, 0] * (e0 * e0 + e1 * e1)
        s = s + norm[k, 1] * (f0 * f0 + f1 * f1)
        return s + norm[k, 2] * (e0 * f0 + e1 * f1)
    r = points[corner[3]]
    e0, e1, e2 = through_3d(factor, k, p[0] - x[0], p[1] - x[1], p[2] - x[2])
    f0, f1, f2 = through_3d(factor, k, q[0] - x[0], q[1] - x[1], q[2] - x[2])
    g0, g1, g2 = through_3d(factor, k, r[0] - x[0], r[1] - x[1], r[2] - x[2])
    s = norm[k, 0] * (e0 * e0 + e1 * e1 + e2 * e2)
    s = s + norm[k, 1] * (f0 * f0 + f1 * f1 + f2 * f2)
    s = s + norm[k, 2] * (g0 * g0 + g1 * g1 + g2 * g2)
    s = s + norm[k, 3] * (e0 * f0 + e1 * f1 + e2 * f2)
    s = s + norm[k, 4] * (e0 * g0 + e1 * g1 + e2 * g2)
    return s + norm[k, 5] * (f0 * g0 + f1 * g1 + f2 * g2)


@inlined
def through_2d(factor: np.ndarray, k: int, a: float, b: float) -> tuple[float, float]:
    """L u with row k of the shape table; see ``simplex.through``."""
    return factor[k, 0] * a + factor[k, 1] * b, factor[k, 2] * b


@inlined
def through_3d(factor: np.ndarray, k: int, a: float, b: float, c: float) -> tuple[float, float, float]:
    """L u with row k of the shape table; see ``simplex.through``."""
    return (
        factor[k, 0] * a + factor[k, 1] * b + factor[k, 2] * c,
        factor[k, 3] * b + factor[k, 4] * c,
        factor[k, 5] * c,
    )


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


@inlined
def corner_terms_on_surface(
    points: np.ndarray, corner: np.ndarray, norm: np.ndarray, k: int
) -> tuple[float, float]:
    """(v, s) of one triangle in space with row k of the shape table; v is twice its area."""
    x, p, q = points[corner[0]], points[corner[1]], points[corner[2]]
    e0, e1, e2 = p[0] - x[0], p[1] - x[1], p[2] - x[2]
    f0, f1, f2 = q[0] - x[0], q[1] - x[1], q[2] - x[2]
    a0, a1, a2 = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
    s = norm[k, 0] * (e0 * e0 + e1 * e1 + e2 * e2)
    s = s + norm[k, 1] * (f0 * f0 + f1 * f1 + f2 * f2)
    s = s + norm[k, 2] * (e0 * f0 + e1 * f1 + e2 * f2)
    return np.sqrt(a0 * a0 + a1 * a1 + a2 * a2), s
