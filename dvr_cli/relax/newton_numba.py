"""Newton's direction compiled: the same operations in the same order as ``newton``."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import MEASURED, PLANAR, compiled_by_kind, inlined
from dvr_cli.relax.columns_numba import (
    BADNESS,
    CURVATURE,
    END,
    FACTOR,
    GRADIENT,
    NORMAL,
    POWER,
    S0,
    SHAPE,
    SLOPE,
    V0,
    RingArrays,
    set_ring,
    to_metric,
)
from dvr_cli.relax.line_numba import worst_corner
from dvr_cli.relax.polish import SQUARINGS, Aim
from dvr_cli.relax.polish_numba import _set_powers, rise, weight
from dvr_cli.relax.problem import RingFreedom

_Plane = tuple[float, float, float]  # two numbers in a plane: g, or H by ``newton._PAIRS``
_Six = tuple[float, float, float, float, float, float]


@compiled_by_kind
def newton_directions(
    points: np.ndarray,
    directions: np.ndarray,
    start: int,
    stop: int,
    rings: RingArrays,
    freedom: RingFreedom,
    aim: Aim,
    scratch: np.ndarray,
) -> None:
    """Set the rows start .. stop of ``directions`` to Newton's.

    The arguments are as for ``steepest_directions``.
    """
    scratch[SHAPE] = -1.0
    d = points.shape[1]
    for ring in range(start, stop):
        vertex = rings.vertices[ring]
        directions[ring] = 0.0
        if not freedom.active[ring]:
            continue
        n = set_ring(points, vertex, 0.0, 0.0, 0.0, ring, rings, scratch)
        if scratch[BADNESS, worst_corner(scratch, n, 0.0, d)] == np.inf:
            continue
        _set_powers(scratch, n, d, 0.0)
        if PLANAR:
            _point_2d(points, ring, n, rings, freedom, aim, scratch, directions)
        else:
            _point_3d(points, ring, n, rings, freedom, aim, scratch, directions)


@inlined
def _point_2d(
    points: np.ndarray,
    ring: int,
    n: int,
    rings: RingArrays,
    freedom: RingFreedom,
    aim: Aim,
    scratch: np.ndarray,
    directions: np.ndarray,
) -> None:
    """Set the row of a ring in the plane."""
    vertex = rings.vertices[ring]
    q = 2.0 / 2
    x0, x1 = points[vertex, 0], points[vertex, 1]
    g0 = g1 = a = b = c = 0.0
    for k in range(n):
        p0 = scratch[SLOPE, k] * (scratch[END, k] - x0)
        p0 = p0 + scratch[SLOPE + 1, k] * (scratch[END + 3, k] - x0)
        p1 = scratch[SLOPE, k] * (scratch[END + 1, k] - x1)
        p1 = p1 + scratch[SLOPE + 1, k] * (scratch[END + 4, k] - x1)
        m = 2.0 * scratch[CURVATURE, k]
        m00, m01, m11 = m * 1.0, m * 0.0, m * 1.0
        if MEASURED:
            scratch[GRADIENT, k], scratch[GRADIENT + 1, k] = p0, p1
            to_metric(scratch, GRADIENT, k, k, 2)
            p0, p1 = scratch[GRADIENT, k], scratch[GRADIENT + 1, k]
            l0, l1, l2 = scratch[FACTOR, k], scratch[FACTOR + 1, k], scratch[FACTOR + 2, k]
            m00, m01, m11 = m * (l0 * l0), m * (l0 * l1), m * (l1 * l1 + l2 * l2)
        s, u, over = scratch[S0, k], scratch[POWER, k], 1.0 / scratch[V0, k]
        inverse = s * u
        steep = rise(inverse, aim)
        part = (weight(inverse, aim) + steep) * u
        more = 2.0**SQUARINGS * steep / inverse * u * u
        a0, a1 = scratch[NORMAL, k] * over, scratch[NORMAL + 1, k] * over
        f0, f1 = q * s * a0 - 2.0 * p0, q * s * a1 - 2.0 * p1
        bend = q * (q + 1.0) * s
        g0, g1 = g0 + part * f0, g1 + part * f1
        a = a + (part * (m00 - 2.0 * q * (p0 * a0 + a0 * p0) + bend * (a0 * a0)) + more * (f0 * f0))
        b = b + (part * (m01 - 2.0 * q * (p0 * a1 + a0 * p1) + bend * (a0 * a1)) + more * (f0 * f1))
        c = c + (part * (m11 - 2.0 * q * (p1 * a1 + a1 * p1) + bend * (a1 * a1)) + more * (f1 * f1))
    trace = a + c
    a, b, c = a / trace, b / trace, c / trace
    h = c, -b, a
    w0, w1 = _times_2d(h, g0, g1)
    w0, w1 = -w0, -w1
    axis = freedom.axis
    if len(axis):
        t0, t1 = axis[ring, 0], axis[ring, 1]
        if freedom.on_line[ring]:
            along = -(g0 * t0 + g1 * t1)
            w0, w1 = along * t0, along * t1
        elif t0 * t0 + t1 * t1 > 0.0:
            z0, z1 = _times_2d(h, t0, t1)
            share = (w0 * t0 + w1 * t1) / (z0 * t0 + z1 * t1)
            w0, w1 = w0 - share * z0, w1 - share * z1
    length = w0 * w0 + w1 * w1
    if 0.0 < length < np.inf and w0 * g0 + w1 * g1 < 0.0:
        root = np.sqrt(length)
        directions[ring, 0], directions[ring, 1] = w0 / root, w1 / root


@inlined
def _point_3d(
    points: np.ndarray,
    ring: int,
    n: int,
    rings: RingArrays,
    freedom: RingFreedom,
    aim: Aim,
    scratch: np.ndarray,
    directions: np.ndarray,
) -> None:
    """Set the row of a ring in space."""
    vertex = rings.vertices[ring]
    q = 2.0 / 3
    x0, x1, x2 = points[vertex, 0], points[vertex, 1], points[vertex, 2]
    g0 = g1 = g2 = h00 = h01 = h02 = h11 = h12 = h22 = 0.0
    for k in range(n):
        k0, k1, k2 = scratch[SLOPE, k], scratch[SLOPE + 1, k], scratch[SLOPE + 2, k]
        p0 = k0 * (scratch[END, k] - x0) + k1 * (scratch[END + 3, k] - x0) + k2 * (scratch[END + 6, k] - x0)
        p1 = k0 * (scratch[END + 1, k] - x1)
        p1 = p1 + k1 * (scratch[END + 4, k] - x1) + k2 * (scratch[END + 7, k] - x1)
        p2 = k0 * (scratch[END + 2, k] - x2)
        p2 = p2 + k1 * (scratch[END + 5, k] - x2) + k2 * (scratch[END + 8, k] - x2)
        m = 2.0 * scratch[CURVATURE, k]
        m00, m01, m02, m11, m12, m22 = m * 1.0, m * 0.0, m * 0.0, m * 1.0, m * 0.0, m * 1.0
        if MEASURED:
            scratch[GRADIENT, k], scratch[GRADIENT + 1, k], scratch[GRADIENT + 2, k] = p0, p1, p2
            to_metric(scratch, GRADIENT, k, k, 3)
            p0, p1, p2 = scratch[GRADIENT, k], scratch[GRADIENT + 1, k], scratch[GRADIENT + 2, k]
            l0, l1, l2 = scratch[FACTOR, k], scratch[FACTOR + 1, k], scratch[FACTOR + 2, k]
            l3, l4, l5 = scratch[FACTOR + 3, k], scratch[FACTOR + 4, k], scratch[FACTOR + 5, k]
            m00, m01, m02 = m * (l0 * l0), m * (l0 * l1), m * (l0 * l2)
            m11, m12 = m * (l1 * l1 + l3 * l3), m * (l1 * l2 + l3 * l4)
            m22 = m * (l2 * l2 + l4 * l4 + l5 * l5)
        s, u, over = scratch[S0, k], scratch[POWER, k], 1.0 / scratch[V0, k]
        inverse = s * u
        steep = rise(inverse, aim)
        part = (weight(inverse, aim) + steep) * u
        more = 2.0**SQUARINGS * steep / inverse * u * u
        a0, a1, a2 = scratch[NORMAL, k] * over, scratch[NORMAL + 1, k] * over, scratch[NORMAL + 2, k] * over
        f0, f1, f2 = q * s * a0 - 2.0 * p0, q * s * a1 - 2.0 * p1, q * s * a2 - 2.0 * p2
        bend = q * (q + 1.0) * s
        g0, g1, g2 = g0 + part * f0, g1 + part * f1, g2 + part * f2
        h00 = h00 + (part * (m00 - 2.0 * q * (p0 * a0 + a0 * p0) + bend * (a0 * a0)) + more * (f0 * f0))
        h01 = h01 + (part * (m01 - 2.0 * q * (p0 * a1 + a0 * p1) + bend * (a0 * a1)) + more * (f0 * f1))
        h02 = h02 + (part * (m02 - 2.0 * q * (p0 * a2 + a0 * p2) + bend * (a0 * a2)) + more * (f0 * f2))
        h11 = h11 + (part * (m11 - 2.0 * q * (p1 * a1 + a1 * p1) + bend * (a1 * a1)) + more * (f1 * f1))
        h12 = h12 + (part * (m12 - 2.0 * q * (p1 * a2 + a1 * p2) + bend * (a1 * a2)) + more * (f1 * f2))
        h22 = h22 + (part * (m22 - 2.0 * q * (p2 * a2 + a2 * p2) + bend * (a2 * a2)) + more * (f2 * f2))
    trace = h00 + h11 + h22
    a, b, c, e, f, i = h00 / trace, h01 / trace, h02 / trace, h11 / trace, h12 / trace, h22 / trace
    h = e * i - f * f, c * f - b * i, b * f - c * e, a * i - c * c, b * c - a * f, a * e - b * b
    w0, w1, w2 = _times_3d(h, g0, g1, g2)
    w0, w1, w2 = -w0, -w1, -w2
    axis = freedom.axis
    if len(axis):
        t0, t1, t2 = axis[ring, 0], axis[ring, 1], axis[ring, 2]
        if freedom.on_line[ring]:
            along = -(g0 * t0 + g1 * t1 + g2 * t2)
            w0, w1, w2 = along * t0, along * t1, along * t2
        elif t0 * t0 + t1 * t1 + t2 * t2 > 0.0:
            z0, z1, z2 = _times_3d(h, t0, t1, t2)
            share = (w0 * t0 + w1 * t1 + w2 * t2) / (z0 * t0 + z1 * t1 + z2 * t2)
            w0, w1, w2 = w0 - share * z0, w1 - share * z1, w2 - share * z2
    length = w0 * w0 + w1 * w1 + w2 * w2
    if 0.0 < length < np.inf and w0 * g0 + w1 * g1 + w2 * g2 < 0.0:
        root = np.sqrt(length)
        directions[ring, 0], directions[ring, 1], directions[ring, 2] = w0 / root, w1 / root, w2 / root


@inlined
def _times_2d(h: _Plane, x: float, y: float) -> tuple[float, float]:
    return h[0] * x + h[1] * y, h[1] * x + h[2] * y


@inlined
def _times_3d(h: _Six, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (
        h[0] * x + h[1] * y + h[2] * z,
        h[1] * x + h[3] * y + h[4] * z,
        h[2] * x + h[4] * y + h[5] * z,
    )
