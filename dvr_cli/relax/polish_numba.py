"""Raising the mean quality compiled: the same operations in the same order as ``polish``."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import MEASURED, PLANAR, compiled_by_kind, inlined
from dvr_cli.relax.columns_numba import (
    BADNESS,
    POWER,
    S0,
    S1,
    S2,
    SHAPE,
    V0,
    V1,
    WEIGHT,
    RingArrays,
    set_place,
    set_ring,
)
from dvr_cli.relax.line_numba import keeps_within, root, s_at, v_at, worst_corner
from dvr_cli.relax.polish import CLOSE, CUBE_ROOT, INSIDE, MAX_CLIPS, MAX_STEPS, SQUARINGS, SUM_GAIN, Aim


@compiled_by_kind
def polish_rings(
    points: np.ndarray,
    directions: np.ndarray,
    start: int,
    stop: int,
    rings: RingArrays,
    limit: float,
    aim: Aim,
    scratch: np.ndarray,
) -> int:
    """Move the vertices of rings start .. stop, each to where the price is lowest above the floor.

    limit: the badness at the floor. A vertex without a direction stays. The other arguments are as for
    ``relax_rings``. Returns how many moved.
    """
    scratch[SHAPE] = -1.0
    d = points.shape[1]
    moved = 0
    for ring in range(start, stop):
        vertex = rings.vertices[ring]
        d0, d1, d2 = directions[ring, 0], directions[ring, 1], directions[ring, 2] if d == 3 else 0.0
        if d0 == 0.0 and d1 == 0.0 and d2 == 0.0:
            continue
        n = set_ring(points, vertex, d0, d1, d2, ring, rings, scratch)
        largest = scratch[BADNESS, worst_corner(scratch, n, 0.0, d)]
        if largest == np.inf:
            continue
        floor = max(largest, limit) if aim.by_ring else limit
        _set_powers(scratch, n, d, 0.0)
        for c in range(n):
            scratch[WEIGHT, c] = weight(scratch[S0, c] * scratch[POWER, c], aim)
        before = _sum(scratch, n, aim)
        step = _clip(scratch, n, d, aim.stretch * _bottom(scratch, n, d, aim), floor)
        if step == 0.0:
            continue
        x0, x1, x2 = points[vertex, 0], points[vertex, 1], points[vertex, 2] if d == 3 else 0.0
        _put(points, vertex, x0 + step * d0, x1 + step * d1, x2 + step * d2)
        if MEASURED:
            set_ring(points, vertex, 0.0, 0.0, 0.0, ring, rings, scratch)
        else:
            set_place(points, vertex, n, scratch)
        largest = scratch[BADNESS, worst_corner(scratch, n, 0.0, d)]
        if _keeps(before, _price(scratch, n, d, aim), largest, floor, d):
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
def _keeps(before: float, after: float, largest: float, limit: float, d: int) -> bool:
    return keeps_within(largest, limit, d) and after < before * (1.0 - SUM_GAIN)


@inlined
def _set_powers(lines: np.ndarray, n: int, d: int, at: float) -> None:
    """v^(-2/d) of all corners at λ, into their row; see ``polish.inverse_power``."""
    if d == 2:
        for c in range(n):
            lines[POWER, c] = 1.0 / v_at(lines, c, at)
        return
    bits = lines.view(np.int64)
    for c in range(n):
        lines[POWER, c] = v_at(lines, c, at)
    for c in range(n):
        bits[POWER, c] = CUBE_ROOT - bits[POWER, c] // 3
    for c in range(n):
        v, y = v_at(lines, c, at), lines[POWER, c]
        for _ in range(3):
            t = 1.0 - v * y * y * y
            y = y + y * t * (1.0 / 3.0 + 2.0 / 9.0 * t)
        lines[POWER, c] = y * y


@inlined
def weight(x: float, aim: Aim) -> float:
    """See ``polish.weight``."""
    return 1.0 / (x * x) if aim.relative else 1.0


@inlined
def rise(x: float, aim: Aim) -> float:
    """See ``polish.rise``."""
    power = aim.level * x
    for _ in range(SQUARINGS):
        power = power * power
    return power


@inlined
def _price(lines: np.ndarray, n: int, d: int, aim: Aim) -> float:
    """The price at λ = 0, with the weights in their row; puts the powers there in theirs."""
    _set_powers(lines, n, d, 0.0)
    return _sum(lines, n, aim)


@inlined
def _sum(lines: np.ndarray, n: int, aim: Aim) -> float:
    """The price at λ = 0, with the weights and the powers there in their rows."""
    total = 0.0
    for c in range(n):
        x = lines[S0, c] * lines[POWER, c]
        total = total + (lines[WEIGHT, c] * x + rise(x, aim) * x / (2.0**SQUARINGS + 1.0))
    return total


@inlined
def _bottom(lines: np.ndarray, n: int, d: int, aim: Aim) -> float:
    """See ``polish._bottom``; the powers at λ = 0 are in their row."""
    low, high = -np.inf, np.inf
    for c in range(n):
        barrier = -lines[V0, c] / lines[V1, c]
        if lines[V1, c] > 0 and barrier > low:
            low = barrier
        if lines[V1, c] < 0 and barrier < high:
            high = barrier
    at = 0.0
    for _ in range(MAX_STEPS):
        slope, curvature = _derivatives(lines, n, d, at, aim)
        if slope == 0.0:
            break
        if slope < 0.0:
            low = at
        else:
            high = at
        before, newton = at, at - slope / curvature
        at = newton if low < newton < high else 0.5 * (low + high)
        if not abs(at - before) > CLOSE * abs(at):
            break
        _set_powers(lines, n, d, at)
    return at


@inlined
def _derivatives(lines: np.ndarray, n: int, d: int, at: float, aim: Aim) -> tuple[float, float]:
    """See ``polish._derivatives``; the powers at λ are in their row."""
    q = 2.0 / d
    slope = curvature = 0.0
    for c in range(n):
        s, u, s2 = s_at(lines, c, at), lines[POWER, c], lines[S2, c]
        r = lines[V1, c] / v_at(lines, c, at)
        ds = 2.0 * (lines[S1, c] + s2 * at)
        first = u * (ds - q * s * r)
        second = u * (2.0 * s2 - 2.0 * q * ds * r + q * (q + 1.0) * s * r * r)
        x = s * u
        price, steep = lines[WEIGHT, c], rise(x, aim)
        slope = slope + (price + steep) * first
        curvature = curvature + ((price + steep) * second + 2.0**SQUARINGS * steep / x * first * first)
    return slope, curvature


@inlined
def _clip(lines: np.ndarray, n: int, d: int, at: float, limit: float) -> float:
    aim = limit * (1.0 - INSIDE)
    rate = aim if d == 2 else np.sqrt(aim)
    for _ in range(MAX_CLIPS):
        worst = worst_corner(lines, n, at, d)
        if not lines[BADNESS, worst] > limit * (1.0 - 0.1 * INSIDE):
            break
        v, t, dt = root(lines, worst, at, d)
        after = at - (t - rate * v) / (dt - rate * lines[V1, worst])
        at = after if after * at > 0.0 and abs(after) < abs(at) else 0.0
    return at
