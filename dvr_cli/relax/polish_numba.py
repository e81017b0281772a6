"""The price of a ring along a line compiled: the same operations in the same order as ``polish``."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import bits_of
from dvr_cli.jit.kernels import inlined
from dvr_cli.relax.columns_numba import (
    BADNESS,
    POWER,
    S0,
    S1,
    S2,
    TERM,
    V0,
    V1,
    WEIGHT,
    padded,
)
from dvr_cli.relax.line_numba import keeps_within, root, s_at, v_at, worst_corner
from dvr_cli.relax.polish import CLOSE, CUBE_ROOT, INSIDE, MAX_CLIPS, MAX_STEPS, SQUARINGS, SUM_GAIN, Aim

EXPONENT = 2.0**SQUARINGS  # of ``rise``; in a kernel the compiler would make a loop of it


@inlined
def keeps(before: float, after: float, largest: float, limit: float, d: int) -> bool:
    return keeps_within(largest, limit, d) and after < before * (1.0 - SUM_GAIN)


@inlined
def set_powers(lines: np.ndarray, n: int, d: int, at: float) -> None:
    """v^(-2/d) of all corners at λ, into their row; see ``polish.inverse_power``."""
    if d == 2:
        for c in range(n):
            lines[POWER, c] = 1.0 / v_at(lines, c, at)
        return
    bits = bits_of(lines)
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
def price(lines: np.ndarray, n: int, d: int, aim: Aim) -> float:
    """The price at λ = 0, with the weights in their row; puts the powers there in theirs."""
    set_powers(lines, n, d, 0.0)
    return price_of_powers(lines, n, aim)


@inlined
def price_of_powers(lines: np.ndarray, n: int, aim: Aim) -> float:
    """The price at λ = 0, with the weights and the powers there in their rows."""
    for c in range(padded(n)):
        x = lines[S0, c] * lines[POWER, c]
        lines[TERM, c] = lines[WEIGHT, c] * x + rise(x, aim) * x / (EXPONENT + 1.0)
    total = 0.0
    for c in range(n):
        total = total + lines[TERM, c]
    return total


@inlined
def set_weights(lines: np.ndarray, n: int, aim: Aim) -> None:
    """The weights of all corners where they are, into their row, with the powers in theirs."""
    for c in range(n):
        lines[WEIGHT, c] = weight(lines[S0, c] * lines[POWER, c], aim)


@inlined
def bottom(lines: np.ndarray, n: int, d: int, aim: Aim) -> float:
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
        set_powers(lines, n, d, at)
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
        share, steep = lines[WEIGHT, c], rise(x, aim)
        slope = slope + (share + steep) * first
        curvature = curvature + ((share + steep) * second + EXPONENT * steep / x * first * first)
    return slope, curvature


@inlined
def clip(lines: np.ndarray, n: int, d: int, at: float, limit: float) -> float:
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
