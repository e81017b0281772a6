"""Raising the mean quality without giving up the worst: a price of the ring along a line, above a floor.

The price of a corner with x = 1/Q is

    w x + x (L x)^16 / 17,

where w is 1, or Q² at λ = 0: then the sum of Q grows at least by as much as that of w x falls, since -1/x
lies below its tangents. L is a level, or zero: below that quality the price rises steeply. Along its line
each 1/Q of a vertex's ring is convex where the ring is positive, and the price grows with it and is convex in
it. So the sum over the ring has one lowest point, and the λ at which no Q is below a floor form an interval.
The lowest price on that interval is found by Newton's method, and by Newton's method again from outside to
the end of the interval when it lies beyond.

    x = s u,   u = v^(-2/d),   r = v'/v,   q = 2/d:
    x' = u (s' - q s r),     x'' = u (s'' - 2 q s' r + q (q + 1) s r²)

Only + - * / and square roots are used, and sums run over the corners one after the other, so that
the compiled twin gets the same bits. Arrays have shape (K, n) as in ``line``; real marks the columns' own
corners, as opposed to repetitions that fill short rings.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dvr_cli.quality.badness import badness
from dvr_cli.relax.line import Lines, keeps_within

SUM_GAIN = 1e-9  # relative fall of the sum below which a vertex stays where it is
CLOSE = 1e-2  # relative length of the last Newton step
MAX_STEPS = 30  # Newton steps towards the lowest sum; about 4 are usual
MAX_CLIPS = 30  # Newton steps towards the floor; about 4 are usual
INSIDE = 1e-6  # how far above the floor, in relative badness, the search along a line ends
CUBE_ROOT = 0x553EF0FF289DD796  # first guess of v^(-1/3): this less a third of the bits of v
SQUARINGS = 4  # log2 of the power with which the price rises below the level of care


class Aim(NamedTuple):
    """The price of a corner, and the floor of a ring.

    level: the quality below which it rises, 0.0 for none. relative: whether the weight of a corner is its Q²
    where the vertex is, rather than 1.
    by_ring: whether a ring that is worse than the floor has its own worst quality for one.
    stretch: how many times as far as to the lowest price a vertex goes. Above 1, and below 2, what is far
    apart comes to terms in fewer sweeps, as by successive over-relaxation.
    """

    level: float = 0.0
    relative: bool = False
    by_ring: bool = False
    stretch: float = 1.0


PLAIN = Aim()  # the sum of 1/Q, and one floor for all


def inverse_power(v: np.ndarray) -> np.ndarray:
    """v^(-2/3) for positive v, to rounding, by three steps of Halley's method."""
    y = (np.int64(CUBE_ROOT) - np.ascontiguousarray(v).view(np.int64) // 3).view(np.float64)
    for _ in range(3):
        t = 1.0 - v * y * y * y
        y = y + y * t * (1.0 / 3.0 + 2.0 / 9.0 * t)
    return y * y


def weight(x: np.ndarray, aim: Aim) -> np.ndarray:
    """w of corners with x = 1/Q."""
    return 1.0 / (x * x) if aim.relative else np.ones_like(x)


def weights_at(v: np.ndarray, s: np.ndarray, aim: Aim, dimension: int) -> np.ndarray:
    """w of corners with positive v."""
    return weight(_inverses(v, s, dimension), aim)


def rise(x: np.ndarray, aim: Aim) -> np.ndarray:
    """(L x)^16: the slope of the price in x beyond w."""
    power = aim.level * x
    for _ in range(SQUARINGS):
        power = power * power
    return power


def share(x: np.ndarray, aim: Aim) -> np.ndarray:
    """The part of corners with x = 1/Q in the slope of the price: what d log x is multiplied with."""
    return x * (weight(x, aim) + rise(x, aim))


def lowest_price(
    lines: Lines, real: np.ndarray, limit: float, aim: Aim, weights: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """λ that minimises the ring's price with no badness above its floor's; 0 where it should stay.

    limit: the badness at the floor. weights: (K, n), by default those of λ = 0. Returns λ and the price at
    λ = 0, (n,) each, the weights (K, n), and the badness at each ring's floor (n,). A vertex stays when its
    ring is not all positive.
    """
    with np.errstate(all="ignore"):  # corners that are not positive are dealt with at the end
        barrier = -lines.v0 / lines.v1
        low = np.where(lines.v1 > 0, barrier, -np.inf).max(axis=0)
        high = np.where(lines.v1 < 0, barrier, np.inf).min(axis=0)
        largest = badness(lines.v0, lines.s0, lines.dimension).max(axis=0)
        positive = largest < np.inf
        floor = np.maximum(largest, limit) if aim.by_ring else np.full(len(largest), limit)
        if weights is None:
            weights = weights_at(lines.v0, lines.s0, aim, lines.dimension)
        now = price(lines.v0, lines.s0, real, weights, aim, lines.dimension)
        step = np.zeros(len(now))
        active = np.flatnonzero(positive)
        if len(active):
            ring = lines.taken(active)
            at = _bottom(ring, real[:, active], weights[:, active], low[active], high[active], aim)
            step[active] = _clip(ring, aim.stretch * at, floor[active])
    return step, now, weights, floor


def price(
    v: np.ndarray, s: np.ndarray, real: np.ndarray, weights: np.ndarray, aim: Aim, dimension: int
) -> np.ndarray:
    """The price of each ring; without meaning unless all v are positive."""
    x = _inverses(v, s, dimension)
    return sum_of_columns(weights * x + rise(x, aim) * x / (2.0**SQUARINGS + 1.0), real)


def _inverses(v: np.ndarray, s: np.ndarray, dimension: int) -> np.ndarray:
    """1/Q of corners with positive v."""
    return s * (1.0 / v if dimension == 2 else inverse_power(v))


def keeps(
    before: np.ndarray, after: np.ndarray, largest: np.ndarray, limit: np.ndarray, dimension: int
) -> np.ndarray:
    """True where the price fell while the largest badness stayed within the limit, whatever the rounding.

    before, after: (n,) prices; largest: (n,) the badness after, and limit: (n,) that at the floor; for the
    margin see ``line.keeps_within``.
    """
    return keeps_within(largest, limit, dimension) & (after < before * (1.0 - SUM_GAIN))


def sum_of_columns(terms: np.ndarray, real: np.ndarray) -> np.ndarray:
    """Sums of columns, in their order."""
    terms = np.where(real, terms, 0.0)
    total = terms[0]
    for k in range(1, len(terms)):
        total = total + terms[k]
    return total


def _bottom(
    lines: Lines, real: np.ndarray, weights: np.ndarray, low: np.ndarray, high: np.ndarray, aim: Aim
) -> np.ndarray:
    """λ in (low, high) that minimises the price, from λ = 0."""
    n = len(low)
    result, which, at = np.zeros(n), np.arange(n), np.zeros(n)
    for _ in range(MAX_STEPS):
        slope, curvature = _derivatives(lines, real, weights, at, aim)
        low, high = np.where(slope < 0.0, at, low), np.where(slope < 0.0, high, at)
        newton = at - slope / curvature
        after = np.where((newton > low) & (newton < high), newton, 0.5 * (low + high))
        after = np.where(slope == 0.0, at, after)
        result[which] = after
        keep = np.flatnonzero(np.abs(after - at) > CLOSE * np.abs(after))
        if not len(keep):
            break
        at = after[keep]
        lines, real, weights, which, low, high = (
            lines.taken(keep),
            real[:, keep],
            weights[:, keep],
            which[keep],
            low[keep],
            high[keep],
        )
    return result


def _derivatives(
    lines: Lines, real: np.ndarray, weights: np.ndarray, at: np.ndarray, aim: Aim
) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivative of the price at λ."""
    q = 2.0 / lines.dimension
    v, s = lines.v(at), lines.s(at)
    u = 1.0 / v if lines.dimension == 2 else inverse_power(v)
    r = lines.v1 / v
    ds = 2.0 * (lines.s1 + lines.s2 * at)
    first = u * (ds - q * s * r)
    second = u * (2.0 * lines.s2 - 2.0 * q * ds * r + q * (q + 1.0) * s * r * r)
    x = s * u
    steep = rise(x, aim)
    second = (weights + steep) * second + 2.0**SQUARINGS * steep / x * first * first
    return sum_of_columns((weights + steep) * first, real), sum_of_columns(second, real)


def _clip(lines: Lines, at: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """λ between 0 and ``at``, as near to that as the limit (n,) on the badness allows.

    B = limit is where t = rate · v; t - rate · v is convex, so Newton's method stays outside all the way.
    """
    aim = limit * (1.0 - INSIDE)
    rate = aim if lines.dimension == 2 else np.sqrt(aim)
    result, which = at.copy(), np.arange(len(at))
    for _ in range(MAX_CLIPS):
        all_badness = lines.badness(at)
        worst = all_badness.argmax(axis=0)
        keep = np.flatnonzero(all_badness[worst, np.arange(len(at))] > limit * (1.0 - 0.1 * INSIDE))
        if not len(keep):
            break
        lines, which, at, worst = lines.taken(keep), which[keep], at[keep], worst[keep]
        limit, rate = limit[keep], rate[keep]
        one = lines.of(worst)
        v, t, dt = one.root(at)
        after = at - (t - rate * v) / (dt - rate * one.v1)
        # beyond 0 there is nothing to gain
        at = np.where((after * at > 0.0) & (np.abs(after) < np.abs(at)), after, 0.0)
        result[which] = at
    return result
