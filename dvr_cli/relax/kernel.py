"""The line problem compiled, vertex by vertex: the same operations in the same order as ``line``.

Each function here is the scalar twin of one there, where the mathematics is explained. Nothing is fused,
reassociated or skipped that could change a bit, so both engines give the same mesh.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled
from dvr_cli.relax.line import GAIN, MAX_NEWTON, MAX_ROUNDS, NEARLY_CROSSED, ROUNDING

# Rows of the scratch array, a column for each corner of a ring: the coordinates of the corner's other
# vertices (three rows each, also in 2D), the normal of the facet they span, the corner's line, its badness;
# then the row of the shape table that stands in the column, and its numbers. Loops over such rows without
# branches are what the compiler turns into vector instructions.
END, NORMAL, V0, V1, S0, S1, S2, BADNESS = 0, 9, 12, 13, 14, 15, 16, 17
SHAPE, NORM, SLOPE, CURVATURE = 18, 19, 25, 28
ROWS = 29
WIDTH = 8  # loops run over whole groups of columns; those beyond the ring hold leftovers nobody looks at


@compiled
def relax_rings(
    points: np.ndarray,
    directions: np.ndarray,
    first: int,
    last: int,
    vertices: np.ndarray,
    start: np.ndarray,
    others: np.ndarray,
    shapes: np.ndarray,
    norm: np.ndarray,
    slope: np.ndarray,
    curvature: np.ndarray,
    scratch: np.ndarray,
) -> int:
    """Move the vertices of rings first .. last, which are independent, each to the best point of its line.

    points: (N, d), changed in place; directions: (m, d); scratch: (ROWS, largest ring + WIDTH). The other
    arrays are those of ``Rings`` and ``ShapeTable``. Returns how many vertices moved.
    """
    scratch[SHAPE] = -1.0
    d = points.shape[1]
    moved = 0
    for ring in range(first, last):
        vertex, lo = vertices[ring], start[ring]
        n = start[ring + 1] - lo
        for c in range(n):
            k = shapes[lo + c]
            if scratch[SHAPE, c] != k:  # in most meshes all shapes are one and stay in place
                _set_shape(scratch, c, k, norm, slope, curvature)
        if d == 2:
            _lines_2d(points, vertex, directions, ring, others, lo, n, scratch)
        else:
            _lines_3d(points, vertex, directions, ring, others, lo, n, scratch)
        step, before = _maximise_minimum(scratch, n, d)
        if step == 0.0:
            continue
        x0 = points[vertex, 0] + step * directions[ring, 0]
        x1 = points[vertex, 1] + step * directions[ring, 1]
        x2 = points[vertex, 2] + step * directions[ring, 2] if d == 3 else 0.0
        if d == 2:
            after = _largest_badness_2d(x0, x1, n, scratch)
        else:
            after = _largest_badness_3d(x0, x1, x2, n, scratch)
        if _improves(before, after, d):
            points[vertex, 0], points[vertex, 1] = x0, x1
            if d == 3:
                points[vertex, 2] = x2
            moved += 1
    return moved


@compiled
def _set_shape(
    scratch: np.ndarray, c: int, k: int, norm: np.ndarray, slope: np.ndarray, curvature: np.ndarray
) -> None:
    """Put row k of the shape table into column c."""
    scratch[SHAPE, c] = k
    for i in range(norm.shape[1]):
        scratch[NORM + i, c] = norm[k, i]
    for i in range(slope.shape[1]):
        scratch[SLOPE + i, c] = slope[k, i]
    scratch[CURVATURE, c] = curvature[k]


@compiled
def _lines_2d(
    points: np.ndarray,
    vertex: int,
    directions: np.ndarray,
    ring: int,
    others: np.ndarray,
    lo: int,
    n: int,
    scratch: np.ndarray,
) -> None:
    """Coefficients of the lines of all corners of a ring; see ``line.coefficients``."""
    x0, x1 = points[vertex, 0], points[vertex, 1]
    d0, d1 = directions[ring, 0], directions[ring, 1]
    dd = d0 * d0 + d1 * d1
    for c in range(n):
        p, q = others[lo + c, 0], others[lo + c, 1]
        scratch[END, c], scratch[END + 1, c] = points[p, 0], points[p, 1]
        scratch[END + 3, c], scratch[END + 4, c] = points[q, 0], points[q, 1]
    for c in range(_padded(n)):
        p0, p1 = scratch[END, c], scratch[END + 1, c]
        q0, q1 = scratch[END + 3, c], scratch[END + 4, c]
        n0, n1 = q1 - p1, -(q0 - p0)
        e0, e1 = p0 - x0, p1 - x1
        f0, f1 = q0 - x0, q1 - x1
        along = scratch[SLOPE, c] * (d0 * e0 + d1 * e1)
        along = along + scratch[SLOPE + 1, c] * (d0 * f0 + d1 * f1)
        scratch[NORMAL, c], scratch[NORMAL + 1, c] = n0, n1
        scratch[V0, c] = e0 * n0 + e1 * n1
        scratch[V1, c] = -(d0 * n0 + d1 * n1)
        scratch[S0, c] = _norm_2d(e0, e1, f0, f1, scratch, c)
        scratch[S1, c] = -along
        scratch[S2, c] = scratch[CURVATURE, c] * dd


@compiled
def _lines_3d(
    points: np.ndarray,
    vertex: int,
    directions: np.ndarray,
    ring: int,
    others: np.ndarray,
    lo: int,
    n: int,
    scratch: np.ndarray,
) -> None:
    """Coefficients of the lines of all corners of a ring; see ``line.coefficients``."""
    x0, x1, x2 = points[vertex, 0], points[vertex, 1], points[vertex, 2]
    d0, d1, d2 = directions[ring, 0], directions[ring, 1], directions[ring, 2]
    dd = d0 * d0 + d1 * d1 + d2 * d2
    for c in range(n):
        p, q, r = others[lo + c, 0], others[lo + c, 1], others[lo + c, 2]
        scratch[END, c], scratch[END + 1, c], scratch[END + 2, c] = points[p, 0], points[p, 1], points[p, 2]
        scratch[END + 3, c], scratch[END + 4, c], scratch[END + 5, c] = (
            points[q, 0],
            points[q, 1],
            points[q, 2],
        )
        scratch[END + 6, c], scratch[END + 7, c], scratch[END + 8, c] = (
            points[r, 0],
            points[r, 1],
            points[r, 2],
        )
    for c in range(_padded(n)):
        p0, p1, p2 = scratch[END, c], scratch[END + 1, c], scratch[END + 2, c]
        q0, q1, q2 = scratch[END + 3, c], scratch[END + 4, c], scratch[END + 5, c]
        r0, r1, r2 = scratch[END + 6, c], scratch[END + 7, c], scratch[END + 8, c]
        a0, a1, a2 = q0 - p0, q1 - p1, q2 - p2
        b0, b1, b2 = r0 - p0, r1 - p1, r2 - p2
        n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
        e0, e1, e2 = p0 - x0, p1 - x1, p2 - x2
        scratch[NORMAL, c], scratch[NORMAL + 1, c], scratch[NORMAL + 2, c] = n0, n1, n2
        scratch[V0, c] = e0 * n0 + e1 * n1 + e2 * n2
        scratch[V1, c] = -(d0 * n0 + d1 * n1 + d2 * n2)
    for c in range(_padded(n)):  # a loop of its own: with too many rows in one the compiler gives up
        e0, e1, e2 = scratch[END, c] - x0, scratch[END + 1, c] - x1, scratch[END + 2, c] - x2
        f0, f1, f2 = scratch[END + 3, c] - x0, scratch[END + 4, c] - x1, scratch[END + 5, c] - x2
        g0, g1, g2 = scratch[END + 6, c] - x0, scratch[END + 7, c] - x1, scratch[END + 8, c] - x2
        along = scratch[SLOPE, c] * (d0 * e0 + d1 * e1 + d2 * e2)
        along = along + scratch[SLOPE + 1, c] * (d0 * f0 + d1 * f1 + d2 * f2)
        along = along + scratch[SLOPE + 2, c] * (d0 * g0 + d1 * g1 + d2 * g2)
        scratch[S0, c] = _norm_3d(e0, e1, e2, f0, f1, f2, g0, g1, g2, scratch, c)
        scratch[S1, c] = -along
        scratch[S2, c] = scratch[CURVATURE, c] * dd


@compiled
def _norm_2d(e0: float, e1: float, f0: float, f1: float, scratch: np.ndarray, c: int) -> float:
    """s of the corner in column c with edges e and f; see ``mean_ratio.weighted_norm``."""
    s = scratch[NORM, c] * (e0 * e0 + e1 * e1)
    s = s + scratch[NORM + 1, c] * (f0 * f0 + f1 * f1)
    return s + scratch[NORM + 2, c] * (e0 * f0 + e1 * f1)


@compiled
def _norm_3d(
    e0: float,
    e1: float,
    e2: float,
    f0: float,
    f1: float,
    f2: float,
    g0: float,
    g1: float,
    g2: float,
    scratch: np.ndarray,
    c: int,
) -> float:
    """s of the corner in column c with edges e, f and g; see ``mean_ratio.weighted_norm``."""
    s = scratch[NORM, c] * (e0 * e0 + e1 * e1 + e2 * e2)
    s = s + scratch[NORM + 1, c] * (f0 * f0 + f1 * f1 + f2 * f2)
    s = s + scratch[NORM + 2, c] * (g0 * g0 + g1 * g1 + g2 * g2)
    s = s + scratch[NORM + 3, c] * (e0 * f0 + e1 * f1 + e2 * f2)
    s = s + scratch[NORM + 4, c] * (e0 * g0 + e1 * g1 + e2 * g2)
    return s + scratch[NORM + 5, c] * (f0 * g0 + f1 * g1 + f2 * g2)


@compiled
def _largest_badness_2d(x0: float, x1: float, n: int, scratch: np.ndarray) -> float:
    """The largest badness of a ring with its vertex at x."""
    for c in range(_padded(n)):
        e0, e1 = scratch[END, c] - x0, scratch[END + 1, c] - x1
        f0, f1 = scratch[END + 3, c] - x0, scratch[END + 4, c] - x1
        v = e0 * scratch[NORMAL, c] + e1 * scratch[NORMAL + 1, c]
        scratch[BADNESS, c] = badness(v, _norm_2d(e0, e1, f0, f1, scratch, c), 2)
    return scratch[BADNESS, _first_largest(scratch, n)]


@compiled
def _largest_badness_3d(x0: float, x1: float, x2: float, n: int, scratch: np.ndarray) -> float:
    """The largest badness of a ring with its vertex at x."""
    for c in range(_padded(n)):
        e0, e1, e2 = scratch[END, c] - x0, scratch[END + 1, c] - x1, scratch[END + 2, c] - x2
        f0, f1, f2 = scratch[END + 3, c] - x0, scratch[END + 4, c] - x1, scratch[END + 5, c] - x2
        g0, g1, g2 = scratch[END + 6, c] - x0, scratch[END + 7, c] - x1, scratch[END + 8, c] - x2
        v = e0 * scratch[NORMAL, c] + e1 * scratch[NORMAL + 1, c] + e2 * scratch[NORMAL + 2, c]
        scratch[BADNESS, c] = badness(v, _norm_3d(e0, e1, e2, f0, f1, f2, g0, g1, g2, scratch, c), 3)
    return scratch[BADNESS, _first_largest(scratch, n)]


@compiled
def _padded(n: int) -> int:
    """n rounded up to whole groups of WIDTH."""
    return (n + WIDTH - 1) // WIDTH * WIDTH


@compiled
def _first_largest(scratch: np.ndarray, n: int) -> int:
    """The first corner with the largest badness in the scratch array."""
    worst, largest = 0, scratch[BADNESS, 0]
    for c in range(1, n):
        if scratch[BADNESS, c] > largest:
            worst, largest = c, scratch[BADNESS, c]
    return worst


@compiled
def badness(v: float, s: float, d: int) -> float:
    ratio = s / v if d == 2 else s * s * s / (v * v)
    return ratio if v > 0 else np.inf


@compiled
def _v(lines: np.ndarray, c: int, at: float) -> float:
    return lines[V0, c] + lines[V1, c] * at


@compiled
def _s(lines: np.ndarray, c: int, at: float) -> float:
    return lines[S0, c] + at * (2.0 * lines[S1, c] + lines[S2, c] * at)


@compiled
def _badness_at(lines: np.ndarray, c: int, at: float, d: int) -> float:
    return badness(_v(lines, c, at), _s(lines, c, at), d)


@compiled
def _falling(lines: np.ndarray, c: int, at: float, d: int) -> bool:
    half = d * (lines[S1, c] + lines[S2, c] * at)
    return half * _v(lines, c, at) - lines[V1, c] * _s(lines, c, at) < 0


@compiled
def _maximise_minimum(lines: np.ndarray, n: int, d: int) -> tuple[float, float]:
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
    worst = _worst_corner(lines, n, 0.0, d)
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
        worst = _worst_corner(lines, n, at, d)
    return _exchange(lines, n, d, at, worst, low, high, low_corner, high_corner), worst_now


@compiled
def _worst_corner(lines: np.ndarray, n: int, at: float, d: int) -> int:
    """The first corner with the largest badness at λ; leaves the badness of all in their row."""
    for c in range(_padded(n)):
        lines[BADNESS, c] = _badness_at(lines, c, at, d)
    return _first_largest(lines, n)


@compiled
def _inside(lines: np.ndarray, low: float, high: float, low_corner: int, high_corner: int) -> float:
    if high == np.inf and low > -np.inf:
        return low + np.sqrt(max(lines[S0, low_corner] / lines[S2, low_corner], 0.0))
    if low == -np.inf:
        if high == np.inf:
            return 0.0
        return high - np.sqrt(max(lines[S0, high_corner] / lines[S2, high_corner], 0.0))
    return 0.5 * (low + high)


@compiled
def _exchange(
    lines: np.ndarray,
    n: int,
    d: int,
    at: float,
    worst: int,
    left: float,
    right: float,
    a: int,
    b: int,
) -> float:
    """λ by exchanging bracket corners, from ``at``, where ``worst`` is the worst; see ``line._exchange``."""
    bound = 0.0
    bottom_a = _lowest(lines, a, d) if left > -np.inf else np.nan
    bottom_b = _lowest(lines, b, d) if right < np.inf else np.nan
    for _ in range(MAX_ROUNDS):
        if not bound * (1.0 + GAIN) < lines[BADNESS, worst] < np.inf:
            break
        if _falling(lines, worst, at, d):
            left, a, bottom_a = at, worst, _lowest(lines, worst, d)
        else:
            right, b, bottom_b = at, worst, _lowest(lines, worst, d)
        at = _lower_envelope(lines, a, b, left, right, bottom_a, bottom_b, d)
        bound = 0.0
        if left > -np.inf:
            bound = _badness_at(lines, a, at, d)
        if right < np.inf:
            bound = max(bound, _badness_at(lines, b, at, d))
        worst = _worst_corner(lines, n, at, d)
    return at


@compiled
def _lowest(lines: np.ndarray, c: int, d: int) -> float:
    v0, v1, s0, s1, s2 = lines[V0, c], lines[V1, c], lines[S0, c], lines[S1, c], lines[S2, c]
    p = (d - 1) * s2 * v1
    q = d * s2 * v0
    if d == 3:
        q = q + s1 * v1
    r = d * s1 * v0 - s0 * v1
    root = np.sqrt(max(q * q - 4.0 * p * r, 0.0))
    return -2.0 * r / (q + root) if q > 0 else (root - q) / (2.0 * p)


@compiled
def _lower_envelope(
    lines: np.ndarray,
    a: int,
    b: int,
    left: float,
    right: float,
    bottom_a: float,
    bottom_b: float,
    d: int,
) -> float:
    if left == -np.inf:
        return bottom_b
    if right == np.inf:
        return bottom_a
    if bottom_a < right and _badness_at(lines, b, bottom_a, d) <= _badness_at(lines, a, bottom_a, d):
        return bottom_a
    if bottom_b > left and _badness_at(lines, a, bottom_b, d) <= _badness_at(lines, b, bottom_b, d):
        return bottom_b
    return _crossing(lines, a, b, max(left, bottom_b), min(right, bottom_a), d)


@compiled
def _root(lines: np.ndarray, c: int, at: float, d: int) -> tuple[float, float, float]:
    s = _s(lines, c, at)
    slope = 2.0 * (lines[S1, c] + lines[S2, c] * at)
    if d == 2:
        return _v(lines, c, at), s, slope
    root = np.sqrt(s)
    return _v(lines, c, at), s * root, 1.5 * root * slope


@compiled
def _crossing(lines: np.ndarray, a: int, b: int, left: float, right: float, d: int) -> float:
    at = 0.5 * (left + right)
    for _ in range(MAX_NEWTON):
        va, ta, dta = _root(lines, a, at, d)
        vb, tb, dtb = _root(lines, b, at, d)
        one, other = ta * vb, tb * va
        h = one - other
        dh = (dta * vb + ta * lines[V1, b]) - (dtb * va + tb * lines[V1, a])
        if h > 0:
            left = at
        else:
            right = at
        newton = at - h / dh
        inside = left < newton < right
        if abs(h) <= NEARLY_CROSSED * one:
            return newton if inside else at
        at = newton if inside else 0.5 * (left + right)
        if not left < at < right:
            break
    return at


@compiled
def _improves(before: float, after: float, d: int) -> bool:
    margin = 1.5 * d * GAIN + ROUNDING * (before if d == 2 else np.sqrt(before))
    certain = ROUNDING * (after if d == 2 else np.sqrt(after)) < 0.5
    return certain and (before == np.inf or after * (1.0 + margin) < before)
