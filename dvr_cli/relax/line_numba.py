"""The line problem compiled, vertex by vertex: the same operations in the same order as ``line``.

Each function here is the scalar twin of one there, where the mathematics is explained. Nothing is fused,
reassociated or skipped that could change a bit, so both engines give the same mesh.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.kernels import inlined
from dvr_cli.quality.badness_numba import badness
from dvr_cli.relax.columns_numba import (
    BADNESS,
    S0,
    S1,
    S2,
    V0,
    V1,
    first_largest,
    padded,
)
from dvr_cli.relax.line import GAIN, MAX_NEWTON, MAX_ROUNDS, NEARLY_CROSSED, ROUNDING


@inlined
def _falling(lines: np.ndarray, c: int, at: float, d: int) -> bool:
    half = d * (lines[S1, c] + lines[S2, c] * at)
    return half * v_at(lines, c, at) - lines[V1, c] * s_at(lines, c, at) < 0


@inlined
def maximise_minimum(lines: np.ndarray, n: int, d: int) -> tuple[float, float]:
    """(λ, largest badness at λ = 0); see ``line.maximise_minimum``."""
    low, high, low_corner, high_corner = -np.inf, np.inf, 0, 0
    possible = True
    for c in range(n):
        v0, v1 = lines[V0, c], lines[V1, c]
        barrier = -v0 / v1
        above = barrier if v1 > 0 else -np.inf
        below = barrier if v1 < 0 else np.inf
        if above > low:
            low, low_corner = above, c
        if below < high:
            high, high_corner = below, c
        if v1 == 0 and v0 <= 0:
            possible = False
    worst = worst_corner(lines, n, 0.0, d)
    worst_now = lines[BADNESS, worst]
    if not (possible and low < high):
        return 0.0, worst_now
    if worst_now < np.inf:
        rises = falls = False
        for c in range(n):
            if lines[BADNESS, c] >= worst_now * (1.0 - GAIN):
                slope = d * lines[S1, c] * lines[V0, c] - lines[S0, c] * lines[V1, c]
                rises = rises or slope >= 0
                falls = falls or slope <= 0
        if rises and falls:
            return 0.0, worst_now
        at = 0.0
    else:
        at = _inside(lines, low, high, low_corner, high_corner)
        worst = worst_corner(lines, n, at, d)
    return _exchange(lines, n, d, at, worst, (low, high), (low_corner, high_corner)), worst_now


@inlined
def _inside(lines: np.ndarray, low: float, high: float, low_corner: int, high_corner: int) -> float:
    if high == np.inf and low > -np.inf:
        return low + np.sqrt(max(lines[S0, low_corner] / lines[S2, low_corner], 0.0))
    if low == -np.inf:
        if high == np.inf:
            return 0.0
        return high - np.sqrt(max(lines[S0, high_corner] / lines[S2, high_corner], 0.0))
    return 0.5 * (low + high)


@inlined
def _exchange(
    lines: np.ndarray,
    n: int,
    d: int,
    at: float,
    worst: int,
    ends: tuple[float, float],
    corners: tuple[int, int],
) -> float:
    """λ by exchanging bracket corners, from ``at``, where ``worst`` is the worst; see ``line._exchange``."""
    low, high = ends
    a, b = corners
    bound = 0.0
    bottom_a = _lowest(lines, a, d) if low > -np.inf else np.nan
    bottom_b = _lowest(lines, b, d) if high < np.inf else np.nan
    for _ in range(MAX_ROUNDS):
        if not bound * (1.0 + GAIN) < lines[BADNESS, worst] < np.inf:
            break
        if _falling(lines, worst, at, d):
            low, a, bottom_a = at, worst, _lowest(lines, worst, d)
        else:
            high, b, bottom_b = at, worst, _lowest(lines, worst, d)
        at = _lower_envelope(lines, a, b, low, high, bottom_a, bottom_b, d)
        bound = 0.0
        if low > -np.inf:
            bound = badness_at(lines, a, at, d)
        if high < np.inf:
            bound = max(bound, badness_at(lines, b, at, d))
        worst = worst_corner(lines, n, at, d)
    return at


@inlined
def _lowest(lines: np.ndarray, c: int, d: int) -> float:
    v0, v1, s0, s1, s2 = lines[V0, c], lines[V1, c], lines[S0, c], lines[S1, c], lines[S2, c]
    p = (d - 1) * s2 * v1
    q = d * s2 * v0
    if d == 3:
        q = q + s1 * v1
    r = d * s1 * v0 - s0 * v1
    root = np.sqrt(max(q * q - 4.0 * p * r, 0.0))
    return -2.0 * r / (q + root) if q > 0 else (root - q) / (2.0 * p)


@inlined
def _lower_envelope(
    lines: np.ndarray,
    a: int,
    b: int,
    low: float,
    high: float,
    bottom_a: float,
    bottom_b: float,
    d: int,
) -> float:
    if low == -np.inf:
        return bottom_b
    if high == np.inf:
        return bottom_a
    if bottom_a < high and badness_at(lines, b, bottom_a, d) <= badness_at(lines, a, bottom_a, d):
        return bottom_a
    if bottom_b > low and badness_at(lines, a, bottom_b, d) <= badness_at(lines, b, bottom_b, d):
        return bottom_b
    return _crossing(lines, a, b, max(low, bottom_b), min(high, bottom_a), d)


@inlined
def _crossing(lines: np.ndarray, a: int, b: int, above: float, below: float, d: int) -> float:
    at = 0.5 * (above + below)
    for _ in range(MAX_NEWTON):
        va, ta, dta = root(lines, a, at, d)
        vb, tb, dtb = root(lines, b, at, d)
        one, other = ta * vb, tb * va
        h = one - other
        dh = (dta * vb + ta * lines[V1, b]) - (dtb * va + tb * lines[V1, a])
        if h > 0:
            above = at
        else:
            below = at
        before, newton = at, at - h / dh
        near = abs(h) <= NEARLY_CROSSED * one
        if (newton - above) * (newton - below) < 0:
            at = newton
        elif not near:
            at = 0.5 * (above + below)
        if near or at == before:
            break
    return at


@inlined
def improves(before: float, after: float, d: int) -> bool:
    margin = 1.5 * d * GAIN + ROUNDING * (before if d == 2 else np.sqrt(before))
    certain = ROUNDING * (after if d == 2 else np.sqrt(after)) < 0.5
    return certain and (before == np.inf or after * (1.0 + margin) < before)


@inlined
def keeps_within(largest: float, limit: float, d: int) -> bool:
    uncertain = ROUNDING * (largest if d == 2 else np.sqrt(largest))
    return uncertain < 0.5 and largest * (1.0 + (1.5 * d * GAIN + uncertain)) <= limit


@inlined
def v_at(lines: np.ndarray, c: int, at: float) -> float:
    return lines[V0, c] + lines[V1, c] * at


@inlined
def s_at(lines: np.ndarray, c: int, at: float) -> float:
    return lines[S0, c] + at * (2.0 * lines[S1, c] + lines[S2, c] * at)


@inlined
def badness_at(lines: np.ndarray, c: int, at: float, d: int) -> float:
    return badness(v_at(lines, c, at), s_at(lines, c, at), d)


@inlined
def worst_corner(lines: np.ndarray, n: int, at: float, d: int) -> int:
    """The first corner with the largest badness at λ; leaves the badness of all in their row."""
    for c in range(padded(n)):
        lines[BADNESS, c] = badness_at(lines, c, at, d)
    return first_largest(lines, n)


@inlined
def root(lines: np.ndarray, c: int, at: float, d: int) -> tuple[float, float, float]:
    s = s_at(lines, c, at)
    slope = 2.0 * (lines[S1, c] + lines[S2, c] * at)
    if d == 2:
        return v_at(lines, c, at), s, slope
    root = np.sqrt(s)
    return v_at(lines, c, at), s * root, 1.5 * root * slope
