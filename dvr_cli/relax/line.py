"""The line problem, solved for many vertices at once (paper section 3.2; docs/design.md, "The line problem").

Moving a vertex by λ along d, each corner of its ring has v(λ) = v0 + v1 λ and s(λ) = s0 + 2 s1 λ + s2 λ²,
and its quality is Q = v^(2/d) / s. Instead of maximising min Q the largest badness

    B = s/v = 1/Q  in 2D,        B = s³/v² = 1/Q³  in 3D,

is minimised: no roots or powers. On the interval where every v is positive each 1/Q is convex, so the
largest B falls up to the solution and rises after it. A bracket [low, high] is kept with the corner that is
worst at each end: a at low, where it falls, and b at high, where it rises. The minimum of the larger of these
two, at some λ, is a lower bound on the badness that can be reached; when no other corner is worse at λ, it is
the solution, and otherwise the worst corner there takes the place of a or b.

Arrays have shape (K, n): K corners a ring (short rings repeat their last corner, which changes nothing), n
vertices. The compiled engine does the same operations in the same order, vertex by vertex.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dvr_cli.mesh.simplex import Components, dot, opposite_normal, subtract, through
from dvr_cli.quality.badness import badness
from dvr_cli.quality.mean_ratio import weighted_norm

GAIN = 1e-12  # relative growth of min Q below which a vertex stays where it is
ROUNDING = 1e-13  # bound on the relative rounding error of B, in units of sqrt(B) (3D) or B (2D)
MAX_ROUNDS = 60  # exchanges of a bracket corner; about 3 are usual
MAX_NEWTON = 60  # steps towards the crossing of two corners; about 5 are usual
NEARLY_CROSSED = 1e-7  # relative difference of two corners from which one more Newton step is exact enough


@dataclass
class Lines:
    """The coefficients of v and s of every corner along its vertex's line.

    terms: (4, K, n), v0, v1, s0 and s1, which are attributes too. s2: (K, n), or (1, n) if it is the same for
    all corners, as of one target shape.
    """

    terms: np.ndarray
    s2: np.ndarray
    dimension: int

    def __post_init__(self) -> None:
        """Name the terms."""
        self.v0, self.v1, self.s0, self.s1 = self.terms

    def of(self, corner: np.ndarray) -> Lines:
        """The lines of one or two corners of each vertex; corner is (n,) or (2, n), and so are they."""
        column = np.arange(corner.shape[-1])
        s2 = self.s2[corner, column] if len(self.s2) > 1 else self.s2[0]
        return Lines(self.terms[:, corner, column], s2, self.dimension)

    def taken(self, vertices: np.ndarray) -> Lines:
        """All corners of some of the vertices."""
        return Lines(self.terms[..., vertices], self.s2[..., vertices], self.dimension)

    def v(self, at: np.ndarray) -> np.ndarray:
        """v(λ)."""
        return self.v0 + self.v1 * at

    def s(self, at: np.ndarray) -> np.ndarray:
        """s(λ)."""
        return self.s0 + at * (2.0 * self.s1 + self.s2 * at)

    def badness(self, at: np.ndarray) -> np.ndarray:
        """B(λ), infinite where v is not positive."""
        return badness(self.v(at), self.s(at), self.dimension)

    def slope(self, at: np.ndarray) -> np.ndarray:
        """A number with the sign of dB/dλ where v > 0: s'v·d/2 - s v'."""
        half = self.dimension * (self.s1 + self.s2 * at)
        return half * self.v(at) - self.v1 * self.s(at)

    def lowest(self) -> np.ndarray:
        """The one λ with v > 0 at which B is smallest: where the slope, a quadratic, grows through zero."""
        d = self.dimension
        a = (d - 1) * self.s2 * self.v1
        b = d * self.s2 * self.v0
        if d == 3:
            b = b + self.s1 * self.v1
        c = d * self.s1 * self.v0 - self.s0 * self.v1
        root = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
        return np.where(b > 0, -2.0 * c / (b + root), (root - b) / (2.0 * a))

    def root(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """v, and t with B = t/v (2D) or (t/v)² (3D), and dt/dλ."""
        bend = self.s2 * at
        s = self.s0 + at * (2.0 * self.s1 + bend)
        slope = 2.0 * (self.s1 + bend)
        if self.dimension == 2:
            return self.v(at), s, slope
        root = np.sqrt(s)
        return self.v(at), s * root, 1.5 * root * slope


def coefficients(
    x: Components,
    direction: Components,
    ends: Sequence[Components],
    norm: Sequence[np.ndarray],
    slope: Sequence[np.ndarray],
    curvature: np.ndarray,
    factor: Sequence[np.ndarray] | None = None,
) -> Lines:
    """The lines of all corners of n vertices at ``x`` that move along ``direction``.

    x, direction: d components (n,); ends: the d other vertices of each corner, d components (K, n) each;
    norm, slope, curvature, factor: the corner's row of the shape table, each entry (K, n) or of shape (1, 1).
    """
    edges = [subtract(end, x) for end in ends]
    normal = opposite_normal(ends)
    v = dot(edges[0], normal), -dot(direction, normal)
    if factor is not None:
        edges = [through(factor, edge) for edge in edges]
        direction = through(factor, direction)
    along = slope[0] * dot(direction, edges[0])
    for j in range(1, len(edges)):
        along = along + slope[j] * dot(direction, edges[j])
    terms = np.stack([*v, weighted_norm(edges, norm), -along])
    return Lines(terms, curvature * dot(direction, direction), len(x))


def maximise_minimum(lines: Lines) -> tuple[np.ndarray, np.ndarray]:
    """λ that maximises the ring's minimum quality, for each of n vertices; 0 where it should stay.

    Returns (λ, B at λ = 0), both (n,). A vertex stays when its ring is not all positive for any λ, or when at
    λ = 0 corners that are worst to within GAIN pull both ways, so that no λ can gain more than GAIN.
    """
    n = lines.v0.shape[1]
    step = np.zeros(n)
    with np.errstate(all="ignore"):  # corners at or beyond their barrier are dealt with by np.where
        barrier = -lines.v0 / lines.v1
        lows = np.where(lines.v1 > 0, barrier, -np.inf)
        highs = np.where(lines.v1 < 0, barrier, np.inf)
        low, high = lows.max(axis=0), highs.min(axis=0)
        possible = (low < high) & ~((lines.v1 == 0) & (lines.v0 <= 0)).any(axis=0)

        now = badness(lines.v0, lines.s0, lines.dimension)
        worst_now = now.max(axis=0)
        slope_now = lines.dimension * lines.s1 * lines.v0 - lines.s0 * lines.v1
        tight = now >= worst_now * (1.0 - GAIN)
        stuck = (tight & (slope_now >= 0)).any(axis=0) & (tight & (slope_now <= 0)).any(axis=0)
        positive = worst_now < np.inf
        active = np.flatnonzero(possible & ~(positive & stuck))
        if len(active):
            ends = low[active], high[active], lows[:, active].argmax(axis=0), highs[:, active].argmin(axis=0)
            step[active] = _exchange(lines.taken(active), *ends, now[:, active])
    return step, worst_now


def _exchange(
    lines: Lines,
    low: np.ndarray,
    high: np.ndarray,
    low_corner: np.ndarray,
    high_corner: np.ndarray,
    now: np.ndarray,
) -> np.ndarray:
    """λ of each vertex, all of whose corners are positive on (low, high), by exchanging bracket corners.

    now: (K, n) badness at λ = 0, where the search begins unless some corner is not positive there.
    """
    start_here = now.max(axis=0) < np.inf
    at, all_badness = np.zeros_like(low), now
    if not start_here.all():
        at = np.where(start_here, 0.0, _inside(lines, low, high, low_corner, high_corner))
        all_badness = lines.badness(at)
    result, which = at.copy(), np.arange(len(at))
    pair = np.stack([low_corner, high_corner])
    bound = np.zeros(len(at))  # the larger badness of the bracket corners at ``at``
    for _ in range(MAX_ROUNDS):
        worst = all_badness.argmax(axis=0)
        largest = all_badness[worst, np.arange(len(at))]
        keep = np.flatnonzero((largest > bound * (1.0 + GAIN)) & (largest < np.inf))
        if not len(keep):
            break
        if len(keep) < len(at):
            lines, pair = lines.taken(keep), pair[:, keep]
            which, at, worst, low, high = (x[keep] for x in (which, at, worst, low, high))
        falling = lines.of(worst).slope(at) < 0
        low, high = np.where(falling, at, low), np.where(falling, high, at)
        pair = np.where([falling, ~falling], worst, pair)
        two = lines.of(pair)
        at = _lower_envelope(two, low, high)
        result[which] = at
        bound = np.where([low > -np.inf, high < np.inf], two.badness(at), 0.0).max(axis=0)
        all_badness = lines.badness(at)
    return result


def _inside(
    lines: Lines, low: np.ndarray, high: np.ndarray, low_corner: np.ndarray, high_corner: np.ndarray
) -> np.ndarray:
    """A point of (low, high): the middle, or one corner size from the only end there is."""
    lower, upper = lines.of(low_corner), lines.of(high_corner)
    after = low + np.sqrt(np.maximum(lower.s0 / lower.s2, 0.0))
    before = high - np.sqrt(np.maximum(upper.s0 / upper.s2, 0.0))
    middle = 0.5 * (low + high)
    return np.where(
        high == np.inf, np.where(low == -np.inf, 0.0, after), np.where(low == -np.inf, before, middle)
    )


def _lower_envelope(two: Lines, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """λ in [low, high] that minimises the larger B of corner a, falling at low, and b, rising at high.

    two: the lines of a and b, (2, n) each. Where low is -∞ there is no corner a, where high is ∞ no b.
    """
    bottom = two.lowest()
    own, other = two.badness(bottom), two.badness(bottom[::-1])
    no_a, no_b = low == -np.inf, high == np.inf
    at_a = no_b | ((bottom[0] < high) & (other[1] <= own[0]))
    at_b = no_a | ((bottom[1] > low) & (other[0] <= own[1]))
    result = np.where(no_a, bottom[1], np.where(at_a, bottom[0], bottom[1]))
    cross = np.flatnonzero(~(at_a | at_b))
    if len(cross):
        above = np.maximum(low, bottom[1])[cross]
        below = np.minimum(high, bottom[0])[cross]
        result[cross] = _crossing(two.taken(cross), above, below)
    return result


def _crossing(two: Lines, above: np.ndarray, below: np.ndarray) -> np.ndarray:
    """A λ at which a and b are equally bad, between ``above``, where a is worse, and ``below``, where b is.

    Usually ``above`` is less than ``below``; it is not where both have their lowest points between crossings.
    two: the lines of a and b, (2, n) each. Newton's method on h = t_a v_b - t_b v_a, whose sign is that of
    B_a - B_b, kept inside a shrinking bracket by bisection.
    """
    result, which = np.empty(len(above)), np.arange(len(above))
    at, active = 0.5 * (above + below), np.ones(len(above), dtype=bool)
    for _ in range(MAX_NEWTON):
        v, t, dt = two.root(at)
        one, other = t * v[::-1]
        dh_one, dh_other = dt * v[::-1] + t * two.v1[::-1]
        h, dh = one - other, dh_one - dh_other
        positive = h > 0
        above, below = np.where(positive, at, above), np.where(positive, below, at)
        after = at - h / dh
        inside = (after - above) * (after - below) < 0
        near = np.abs(h) <= NEARLY_CROSSED * one
        if not inside.all():
            after = np.where(inside, after, np.where(near, at, 0.5 * (above + below)))
        result[which[active]] = after[active]
        active &= ~near & (after != at)
        at = after
        n = np.count_nonzero(active)
        if not n:
            break
        if 2 * n < len(at):  # leaving out fewer costs more than it saves
            keep = np.flatnonzero(active)
            two, active = two.taken(keep), active[keep]
            which, at, above, below = which[keep], at[keep], above[keep], below[keep]
    return result


def improves(before: np.ndarray, after: np.ndarray, dimension: int) -> np.ndarray:
    """True where the largest badness of a ring fell so far that its min Q grew, whatever the rounding.

    before, after: (n,) largest B of the ring, infinite where it is not all positive. The relative rounding
    error of v grows with the flatness of a corner, hence of B with sqrt(B) (3D) or B (2D): the margin covers
    it, so that min Q grows for any other order of the same arithmetic too, and no sign is in doubt.
    """
    margin = 1.5 * dimension * GAIN + ROUNDING * flatness(before, dimension)
    certain = ROUNDING * flatness(after, dimension) < 0.5
    with np.errstate(invalid="ignore"):
        return certain & ((before == np.inf) | (after * (1.0 + margin) < before))


def keeps_within(largest: np.ndarray, limit: np.ndarray | float, dimension: int) -> np.ndarray:
    """True where the largest badness is no more than the limit, whatever the rounding; see ``improves``.

    largest: (n,) of each ring; limit: for each or for all.
    """
    uncertain = ROUNDING * flatness(largest, dimension)
    with np.errstate(invalid="ignore"):
        within = largest * (1.0 + (1.5 * dimension * GAIN + uncertain)) <= limit
    return (uncertain < 0.5) & within


def flatness(b: np.ndarray, dimension: int) -> np.ndarray:
    """The measure of b with which its relative rounding error grows; see ROUNDING."""
    return b if dimension == 2 else np.sqrt(b)
