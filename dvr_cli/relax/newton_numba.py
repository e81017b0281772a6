"""Moves towards the lowest price compiled: the same operations in the same order as ``newton``."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.kernels import inlined
from dvr_cli.jit.kinds import MEASURED, PLANAR, compiled_by_kind
from dvr_cli.relax.columns_numba import (
    BADNESS,
    CURVATURE,
    END,
    FACTOR,
    GRADIENT,
    NORMAL,
    POWER,
    S0,
    S1,
    S2,
    SHAPE,
    SLOPE,
    TERM,
    V0,
    V1,
    WEIGHT,
    RingArrays,
    padded,
    set_place,
    set_ring,
    set_ring_in_place,
    to_metric,
)
from dvr_cli.relax.line_numba import worst_corner
from dvr_cli.relax.newton import FALL
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.polish_numba import (
    EXPONENT,
    bottom,
    clip,
    keeps,
    price,
    price_of_powers,
    rise,
    set_powers,
    set_weights,
)
from dvr_cli.relax.problem import RingFreedom

_Plane = tuple[float, float, float]  # H in a plane, by ``newton._PAIRS``
_Six = tuple[float, float, float, float, float, float]


@compiled_by_kind
def polish_rings(
    points: np.ndarray,
    start: int,
    stop: int,
    rings: RingArrays,
    freedom: RingFreedom,
    limit: float,
    aim: Aim,
    scratch: np.ndarray,
) -> int:
    """Move the vertices of rings start .. stop that are active, each towards the lowest price of its ring.

    limit: the badness at the floor. The other arguments are as for ``steepest_directions``. Returns how many
    moved.
    """
    scratch[SHAPE] = -1.0
    d = points.shape[1]
    moved = 0
    for ring in range(start, stop):
        if not freedom.active[ring]:
            continue
        vertex = rings.vertices[ring]
        n = set_ring_in_place(points, vertex, ring, rings, scratch)
        largest = scratch[BADNESS, worst_corner(scratch, n, 0.0, d)]
        if largest == np.inf:
            continue
        floor = max(largest, limit) if aim.by_ring else limit
        set_powers(scratch, n, d, 0.0)
        set_weights(scratch, n, aim)
        before = price_of_powers(scratch, n, aim)
        x0, x1, x2 = points[vertex, 0], points[vertex, 1], 0.0 if PLANAR else points[vertex, 2]
        if PLANAR:
            w0, w1, slope = _step_2d(x0, x1, ring, n, freedom, aim, scratch)
            w2 = 0.0
        else:
            w0, w1, w2, slope = _step_3d((x0, x1, x2), ring, n, freedom, aim, scratch)
        if not -np.inf < slope < 0.0:
            continue
        _put(points, vertex, x0 + w0, x1 + w1, x2 + w2)
        set_place(points, vertex, n, scratch)
        largest = scratch[BADNESS, worst_corner(scratch, n, 0.0, d)]
        after = price(scratch, n, d, aim)
        if keeps(before, after, largest, floor, d) and after <= before + FALL * slope:
            moved += 1
            continue
        _put(points, vertex, x0, x1, x2)
        n = set_ring(points, vertex, w0, w1, w2, ring, rings, scratch)
        set_powers(scratch, n, d, 0.0)
        step = clip(scratch, n, d, bottom(scratch, n, d, aim), floor)
        for c in range(padded(n)):
            scratch[V1, c] = scratch[S1, c] = scratch[S2, c] = 0.0
        if step == 0.0:
            continue
        _put(points, vertex, x0 + step * w0, x1 + step * w1, x2 + step * w2)
        set_place(points, vertex, n, scratch)
        largest = scratch[BADNESS, worst_corner(scratch, n, 0.0, d)]
        if keeps(before, price(scratch, n, d, aim), largest, floor, d):
            moved += 1
        else:
            _put(points, vertex, x0, x1, x2)
    return moved


@inlined
def _put(points: np.ndarray, vertex: int, x0: float, x1: float, x2: float) -> None:
    points[vertex, 0], points[vertex, 1] = x0, x1
    if not PLANAR:
        points[vertex, 2] = x2


@inlined
def _step_2d(
    x0: float, x1: float, ring: int, n: int, freedom: RingFreedom, aim: Aim, scratch: np.ndarray
) -> tuple[float, float, float]:
    """Newton's step in the plane, and the slope of the price along it.

    The ring of the vertex at x is laid out, with its powers and weights in their rows.
    """
    _set_terms_2d(x0, x1, n, aim, scratch)
    g0 = g1 = a = b = c = 0.0
    for k in range(n):
        g0, g1 = g0 + scratch[TERM, k], g1 + scratch[TERM + 1, k]
        a, b, c = a + scratch[TERM + 2, k], b + scratch[TERM + 3, k], c + scratch[TERM + 4, k]
    trace = a + c
    a, b, c = a / trace, b / trace, c / trace
    h = c, -b, a
    whole = (a * c - b * b) * trace
    w0, w1 = _times_2d(h, g0, g1)
    w0, w1 = -w0 / whole, -w1 / whole
    axis = freedom.axis
    if len(axis):
        t0, t1 = axis[ring, 0], axis[ring, 1]
        if freedom.on_line[ring]:
            u0, u1 = _times_2d((a, b, c), t0, t1)
            along = -(g0 * t0 + g1 * t1) / ((u0 * t0 + u1 * t1) * trace)
            w0, w1 = along * t0, along * t1
        elif t0 * t0 + t1 * t1 > 0.0:
            z0, z1 = _times_2d(h, t0, t1)
            share = (w0 * t0 + w1 * t1) / (z0 * t0 + z1 * t1)
            w0, w1 = w0 - share * z0, w1 - share * z1
            for _ in range(2):
                across = w0 * t0 + w1 * t1
                w0, w1 = w0 - across * t0, w1 - across * t1
    return w0, w1, w0 * g0 + w1 * g1


@inlined
def _step_3d(
    x: tuple[float, float, float], ring: int, n: int, freedom: RingFreedom, aim: Aim, scratch: np.ndarray
) -> tuple[float, float, float, float]:
    """As ``_step_2d``, in space."""
    _set_terms_3d(x, n, aim, scratch)
    g0 = g1 = g2 = a = b = c = e = f = i = 0.0
    for k in range(n):
        g0, g1, g2 = g0 + scratch[TERM, k], g1 + scratch[TERM + 1, k], g2 + scratch[TERM + 2, k]
        a, b, c = a + scratch[TERM + 3, k], b + scratch[TERM + 4, k], c + scratch[TERM + 5, k]
        e, f, i = e + scratch[TERM + 6, k], f + scratch[TERM + 7, k], i + scratch[TERM + 8, k]
    trace = a + e + i
    a, b, c, e, f, i = a / trace, b / trace, c / trace, e / trace, f / trace, i / trace
    h = e * i - f * f, c * f - b * i, b * f - c * e, a * i - c * c, b * c - a * f, a * e - b * b
    whole = (a * h[0] + b * h[1] + c * h[2]) * trace
    w0, w1, w2 = _times_3d(h, g0, g1, g2)
    w0, w1, w2 = -w0 / whole, -w1 / whole, -w2 / whole
    axis = freedom.axis
    if len(axis):
        t0, t1, t2 = axis[ring, 0], axis[ring, 1], axis[ring, 2]
        if freedom.on_line[ring]:
            u0, u1, u2 = _times_3d((a, b, c, e, f, i), t0, t1, t2)
            along = -(g0 * t0 + g1 * t1 + g2 * t2) / ((u0 * t0 + u1 * t1 + u2 * t2) * trace)
            w0, w1, w2 = along * t0, along * t1, along * t2
        elif t0 * t0 + t1 * t1 + t2 * t2 > 0.0:
            z0, z1, z2 = _times_3d(h, t0, t1, t2)
            share = (w0 * t0 + w1 * t1 + w2 * t2) / (z0 * t0 + z1 * t1 + z2 * t2)
            w0, w1, w2 = w0 - share * z0, w1 - share * z1, w2 - share * z2
            for _ in range(2):
                across = w0 * t0 + w1 * t1 + w2 * t2
                w0, w1, w2 = w0 - across * t0, w1 - across * t1, w2 - across * t2
    return w0, w1, w2, w0 * g0 + w1 * g1 + w2 * g2


@inlined
def _set_terms_2d(x0: float, x1: float, n: int, aim: Aim, scratch: np.ndarray) -> None:
    """The parts of the corners in g and H, into their rows."""
    q = 2.0 / 2
    for k in range(padded(n)):
        p0 = scratch[SLOPE, k] * (scratch[END, k] - x0)
        p0 = p0 + scratch[SLOPE + 1, k] * (scratch[END + 3, k] - x0)
        p1 = scratch[SLOPE, k] * (scratch[END + 1, k] - x1)
        p1 = p1 + scratch[SLOPE + 1, k] * (scratch[END + 4, k] - x1)
        scratch[GRADIENT, k], scratch[GRADIENT + 1, k] = p0, p1
    for k in range(padded(n)):
        m = 2.0 * scratch[CURVATURE, k]
        m00, m01, m11 = m * 1.0, m * 0.0, m * 1.0
        if MEASURED:
            to_metric(scratch, GRADIENT, k, k, 2)
            l0, l1, l2 = scratch[FACTOR, k], scratch[FACTOR + 1, k], scratch[FACTOR + 2, k]
            m00, m01, m11 = m * (l0 * l0), m * (l0 * l1), m * (l1 * l1 + l2 * l2)
        p0, p1 = scratch[GRADIENT, k], scratch[GRADIENT + 1, k]
        s, u, over = scratch[S0, k], scratch[POWER, k], 1.0 / scratch[V0, k]
        inverse = s * u
        steep = rise(inverse, aim)
        part = (scratch[WEIGHT, k] + steep) * u
        more = EXPONENT * steep / inverse * u * u
        a0, a1 = scratch[NORMAL, k] * over, scratch[NORMAL + 1, k] * over
        f0, f1 = q * s * a0 - 2.0 * p0, q * s * a1 - 2.0 * p1
        bend = q * (q + 1.0) * s
        scratch[TERM, k], scratch[TERM + 1, k] = part * f0, part * f1
        second = m00 - 2.0 * q * (p0 * a0 + a0 * p0) + bend * (a0 * a0)
        scratch[TERM + 2, k] = part * second + more * (f0 * f0)
        second = m01 - 2.0 * q * (p0 * a1 + a0 * p1) + bend * (a0 * a1)
        scratch[TERM + 3, k] = part * second + more * (f0 * f1)
        second = m11 - 2.0 * q * (p1 * a1 + a1 * p1) + bend * (a1 * a1)
        scratch[TERM + 4, k] = part * second + more * (f1 * f1)


@inlined
def _set_terms_3d(x: tuple[float, float, float], n: int, aim: Aim, scratch: np.ndarray) -> None:
    """As ``_set_terms_2d``, in space."""
    q = 2.0 / 3
    for i in range(3):
        for k in range(padded(n)):
            p = scratch[SLOPE, k] * (scratch[END + i, k] - x[i])
            p = p + scratch[SLOPE + 1, k] * (scratch[END + 3 + i, k] - x[i])
            scratch[GRADIENT + i, k] = p + scratch[SLOPE + 2, k] * (scratch[END + 6 + i, k] - x[i])
    for k in range(padded(n)):
        m = 2.0 * scratch[CURVATURE, k]
        m00, m01, m02, m11, m12, m22 = m * 1.0, m * 0.0, m * 0.0, m * 1.0, m * 0.0, m * 1.0
        if MEASURED:
            to_metric(scratch, GRADIENT, k, k, 3)
            l0, l1, l2 = scratch[FACTOR, k], scratch[FACTOR + 1, k], scratch[FACTOR + 2, k]
            l3, l4, l5 = scratch[FACTOR + 3, k], scratch[FACTOR + 4, k], scratch[FACTOR + 5, k]
            m00, m01, m02 = m * (l0 * l0), m * (l0 * l1), m * (l0 * l2)
            m11, m12 = m * (l1 * l1 + l3 * l3), m * (l1 * l2 + l3 * l4)
            m22 = m * (l2 * l2 + l4 * l4 + l5 * l5)
        p0, p1, p2 = scratch[GRADIENT, k], scratch[GRADIENT + 1, k], scratch[GRADIENT + 2, k]
        s, u, over = scratch[S0, k], scratch[POWER, k], 1.0 / scratch[V0, k]
        inverse = s * u
        steep = rise(inverse, aim)
        part = (scratch[WEIGHT, k] + steep) * u
        more = EXPONENT * steep / inverse * u * u
        a0, a1, a2 = scratch[NORMAL, k] * over, scratch[NORMAL + 1, k] * over, scratch[NORMAL + 2, k] * over
        f0, f1, f2 = q * s * a0 - 2.0 * p0, q * s * a1 - 2.0 * p1, q * s * a2 - 2.0 * p2
        bend = q * (q + 1.0) * s
        scratch[TERM, k], scratch[TERM + 1, k], scratch[TERM + 2, k] = part * f0, part * f1, part * f2
        second = m00 - 2.0 * q * (p0 * a0 + a0 * p0) + bend * (a0 * a0)
        scratch[TERM + 3, k] = part * second + more * (f0 * f0)
        second = m01 - 2.0 * q * (p0 * a1 + a0 * p1) + bend * (a0 * a1)
        scratch[TERM + 4, k] = part * second + more * (f0 * f1)
        second = m02 - 2.0 * q * (p0 * a2 + a0 * p2) + bend * (a0 * a2)
        scratch[TERM + 5, k] = part * second + more * (f0 * f2)
        second = m11 - 2.0 * q * (p1 * a1 + a1 * p1) + bend * (a1 * a1)
        scratch[TERM + 6, k] = part * second + more * (f1 * f1)
        second = m12 - 2.0 * q * (p1 * a2 + a1 * p2) + bend * (a1 * a2)
        scratch[TERM + 7, k] = part * second + more * (f1 * f2)
        second = m22 - 2.0 * q * (p2 * a2 + a2 * p2) + bend * (a2 * a2)
        scratch[TERM + 8, k] = part * second + more * (f2 * f2)


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
