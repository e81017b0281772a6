"""The ring of a vertex laid out in columns, for all compiled kernels.

Each function here is the scalar twin of one of ``line`` or ``mean_ratio``, where the mathematics is
explained. Nothing is fused, reassociated or skipped that could change a bit.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.kernels import inlined
from dvr_cli.jit.kinds import MEASURED, PLANAR
from dvr_cli.quality.badness_numba import badness
from dvr_cli.relax.problem import RingArrays

# Rows of the scratch array, a column for each corner of a ring: the coordinates of the corner's other
# vertices (three rows each, also in 2D), the normal of the facet they span, the corner's line, its badness;
# then the row of the shape table that stands in the column, and its numbers; last some gradients, gathered in
# the first columns, their products with a vector and their weights, and v^(-2/d); L of the shape table's
# row, where it has one; the terms of some sums; -1 for a corner of a surface that is turned over, else 1.
# Loops over such rows without branches are what the compiler turns into vector instructions.
END, NORMAL, V0, V1, S0, S1, S2, BADNESS = 0, 9, 12, 13, 14, 15, 16, 17
SHAPE, NORM, SLOPE, CURVATURE = 18, 19, 25, 28
GRADIENT, ALONG, WEIGHT, POWER = 29, 32, 33, 34
FACTOR = 35
TERM = 41
SIGN = 50
ROWS = 51
WIDTH = 8  # loops run over whole groups of columns; those beyond the ring hold leftovers nobody looks at


@inlined
def set_ring(
    points: np.ndarray,
    vertex: int,
    d0: float,
    d1: float,
    d2: float,
    ring: int,
    rings: RingArrays,
    scratch: np.ndarray,
) -> int:
    """Lay out a ring and its lines along the direction (d0, d1, d2); returns how many corners it has."""
    n = set_shapes(ring, rings, scratch)
    if PLANAR:
        _set_lines_2d(points, vertex, d0, d1, ring, rings, scratch)
    else:
        _set_lines_3d(points, vertex, d0, d1, d2, ring, rings, scratch)
    if MEASURED:
        _set_metric_norms(points, vertex, d0, d1, d2, n, scratch)
    return n


@inlined
def set_ring_in_place(
    points: np.ndarray, vertex: int, ring: int, rings: RingArrays, scratch: np.ndarray
) -> int:
    """Lay out a ring without lines, which ``set_place`` is enough for; returns how many corners it has."""
    n = set_shapes(ring, rings, scratch)
    if PLANAR:
        _set_ends_2d(points, ring, rings, scratch)
        for c in range(padded(n)):
            scratch[NORMAL, c] = scratch[END + 4, c] - scratch[END + 1, c]
            scratch[NORMAL + 1, c] = -(scratch[END + 3, c] - scratch[END, c])
    else:
        _set_ends_3d(points, ring, rings, scratch)
        for c in range(padded(n)):
            p0, p1, p2 = scratch[END, c], scratch[END + 1, c], scratch[END + 2, c]
            a0, a1, a2 = scratch[END + 3, c] - p0, scratch[END + 4, c] - p1, scratch[END + 5, c] - p2
            b0, b1, b2 = scratch[END + 6, c] - p0, scratch[END + 7, c] - p1, scratch[END + 8, c] - p2
            scratch[NORMAL, c] = a1 * b2 - a2 * b1
            scratch[NORMAL + 1, c] = a2 * b0 - a0 * b2
            scratch[NORMAL + 2, c] = a0 * b1 - a1 * b0
    set_place(points, vertex, n, scratch)
    return n


@inlined
def set_shapes(ring: int, rings: RingArrays, scratch: np.ndarray) -> int:
    """Put the shapes of a ring into their columns; returns how many corners it has."""
    lo = rings.start[ring]
    n = rings.start[ring + 1] - lo
    for c in range(n):
        k = rings.shapes[lo + c]
        if scratch[SHAPE, c] != k:  # in most meshes all shapes are one and stay in place
            _set_shape(scratch, c, k, rings)
    return n


@inlined
def set_place(points: np.ndarray, vertex: int, n: int, scratch: np.ndarray) -> None:
    """Put v0 and s0 of the vertex where it is now in the place of those of a ring that is laid out.

    The others have not moved. The lines' other numbers are those of no direction in a metric, else as before.
    """
    x0, x1 = points[vertex, 0], points[vertex, 1]
    if PLANAR:
        for c in range(padded(n)):
            e0, e1 = scratch[END, c] - x0, scratch[END + 1, c] - x1
            f0, f1 = scratch[END + 3, c] - x0, scratch[END + 4, c] - x1
            scratch[V0, c] = e0 * scratch[NORMAL, c] + e1 * scratch[NORMAL + 1, c]
            scratch[S0, c] = _norm_2d(e0, e1, f0, f1, scratch, c)
    else:
        x2 = points[vertex, 2]
        for c in range(padded(n)):
            e0, e1, e2 = scratch[END, c] - x0, scratch[END + 1, c] - x1, scratch[END + 2, c] - x2
            f0, f1, f2 = scratch[END + 3, c] - x0, scratch[END + 4, c] - x1, scratch[END + 5, c] - x2
            g0, g1, g2 = scratch[END + 6, c] - x0, scratch[END + 7, c] - x1, scratch[END + 8, c] - x2
            scratch[V0, c] = (
                e0 * scratch[NORMAL, c] + e1 * scratch[NORMAL + 1, c] + e2 * scratch[NORMAL + 2, c]
            )
            scratch[S0, c] = _norm_3d((e0, e1, e2), (f0, f1, f2), (g0, g1, g2), scratch, c)
    if MEASURED:
        _set_metric_norms(points, vertex, 0.0, 0.0, 0.0, n, scratch)


@inlined
def _set_shape(scratch: np.ndarray, c: int, k: int, rings: RingArrays) -> None:
    """Put row k of the shape table into column c."""
    scratch[SHAPE, c] = k
    for i in range(rings.norm.shape[1]):
        scratch[NORM + i, c] = rings.norm[k, i]
    for i in range(rings.slope.shape[1]):
        scratch[SLOPE + i, c] = rings.slope[k, i]
    scratch[CURVATURE, c] = rings.curvature[k]
    if MEASURED:
        for i in range(rings.factor.shape[1]):
            scratch[FACTOR + i, c] = rings.factor[k, i]


@inlined
def _set_lines_2d(
    points: np.ndarray,
    vertex: int,
    d0: float,
    d1: float,
    ring: int,
    rings: RingArrays,
    scratch: np.ndarray,
) -> None:
    """Coefficients of the lines of all corners of a ring; see ``line.coefficients``."""
    n = rings.start[ring + 1] - rings.start[ring]
    x0, x1 = points[vertex, 0], points[vertex, 1]
    dd = d0 * d0 + d1 * d1
    _set_ends_2d(points, ring, rings, scratch)
    for c in range(padded(n)):
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


@inlined
def _set_lines_3d(
    points: np.ndarray,
    vertex: int,
    d0: float,
    d1: float,
    d2: float,
    ring: int,
    rings: RingArrays,
    scratch: np.ndarray,
) -> None:
    """Coefficients of the lines of all corners of a ring; see ``line.coefficients``."""
    n = rings.start[ring + 1] - rings.start[ring]
    x0, x1, x2 = points[vertex, 0], points[vertex, 1], points[vertex, 2]
    dd = d0 * d0 + d1 * d1 + d2 * d2
    _set_ends_3d(points, ring, rings, scratch)
    for c in range(padded(n)):
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
    for c in range(padded(n)):  # a loop of its own: with too many rows in one the compiler gives up
        e0, e1, e2 = scratch[END, c] - x0, scratch[END + 1, c] - x1, scratch[END + 2, c] - x2
        f0, f1, f2 = scratch[END + 3, c] - x0, scratch[END + 4, c] - x1, scratch[END + 5, c] - x2
        g0, g1, g2 = scratch[END + 6, c] - x0, scratch[END + 7, c] - x1, scratch[END + 8, c] - x2
        along = scratch[SLOPE, c] * (d0 * e0 + d1 * e1 + d2 * e2)
        along = along + scratch[SLOPE + 1, c] * (d0 * f0 + d1 * f1 + d2 * f2)
        along = along + scratch[SLOPE + 2, c] * (d0 * g0 + d1 * g1 + d2 * g2)
        scratch[S0, c] = _norm_3d((e0, e1, e2), (f0, f1, f2), (g0, g1, g2), scratch, c)
        scratch[S1, c] = -along
        scratch[S2, c] = scratch[CURVATURE, c] * dd


@inlined
def _set_ends_2d(points: np.ndarray, ring: int, rings: RingArrays, scratch: np.ndarray) -> None:
    """Put the coordinates of the other vertices of a ring's corners into their columns."""
    others, lo = rings.others, rings.start[ring]
    for c in range(rings.start[ring + 1] - lo):
        p, q = others[lo + c, 0], others[lo + c, 1]
        scratch[END, c], scratch[END + 1, c] = points[p, 0], points[p, 1]
        scratch[END + 3, c], scratch[END + 4, c] = points[q, 0], points[q, 1]


@inlined
def _set_ends_3d(points: np.ndarray, ring: int, rings: RingArrays, scratch: np.ndarray) -> None:
    """As ``_set_ends_2d``, in space."""
    others, lo = rings.others, rings.start[ring]
    for c in range(rings.start[ring + 1] - lo):
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


@inlined
def _set_metric_norms(
    points: np.ndarray, vertex: int, d0: float, d1: float, d2: float, n: int, scratch: np.ndarray
) -> None:
    """Put s0, s1 and s2 of edges seen through L in the place of those of the edges themselves."""
    x0, x1 = points[vertex, 0], points[vertex, 1]
    if PLANAR:
        for c in range(padded(n)):
            e0, e1 = _through_2d(scratch, c, scratch[END, c] - x0, scratch[END + 1, c] - x1)
            f0, f1 = _through_2d(scratch, c, scratch[END + 3, c] - x0, scratch[END + 4, c] - x1)
            u0, u1 = _through_2d(scratch, c, d0, d1)
            along = scratch[SLOPE, c] * (u0 * e0 + u1 * e1)
            along = along + scratch[SLOPE + 1, c] * (u0 * f0 + u1 * f1)
            scratch[S0, c] = _norm_2d(e0, e1, f0, f1, scratch, c)
            scratch[S1, c] = -along
            scratch[S2, c] = scratch[CURVATURE, c] * (u0 * u0 + u1 * u1)
        return
    x2 = points[vertex, 2]
    for c in range(padded(n)):
        e0, e1, e2 = _through_end(scratch, c, END, x0, x1, x2)
        f0, f1, f2 = _through_end(scratch, c, END + 3, x0, x1, x2)
        g0, g1, g2 = _through_end(scratch, c, END + 6, x0, x1, x2)
        u0, u1, u2 = _through_3d(scratch, c, d0, d1, d2)
        along = scratch[SLOPE, c] * (u0 * e0 + u1 * e1 + u2 * e2)
        along = along + scratch[SLOPE + 1, c] * (u0 * f0 + u1 * f1 + u2 * f2)
        along = along + scratch[SLOPE + 2, c] * (u0 * g0 + u1 * g1 + u2 * g2)
        scratch[S0, c] = _norm_3d((e0, e1, e2), (f0, f1, f2), (g0, g1, g2), scratch, c)
        scratch[S1, c] = -along
        scratch[S2, c] = scratch[CURVATURE, c] * (u0 * u0 + u1 * u1 + u2 * u2)


@inlined
def largest_metric_badness(x0: float, x1: float, x2: float, n: int, d: int, scratch: np.ndarray) -> float:
    """The largest badness of a ring with its vertex at x, its edges seen through L."""
    for c in range(padded(n)):
        if PLANAR:
            a0, a1 = scratch[END, c] - x0, scratch[END + 1, c] - x1
            v = a0 * scratch[NORMAL, c] + a1 * scratch[NORMAL + 1, c]
            e0, e1 = _through_2d(scratch, c, a0, a1)
            f0, f1 = _through_2d(scratch, c, scratch[END + 3, c] - x0, scratch[END + 4, c] - x1)
            s = _norm_2d(e0, e1, f0, f1, scratch, c)
        else:
            v = (scratch[END, c] - x0) * scratch[NORMAL, c] + (scratch[END + 1, c] - x1) * scratch[
                NORMAL + 1, c
            ]
            v = v + (scratch[END + 2, c] - x2) * scratch[NORMAL + 2, c]
            e0, e1, e2 = _through_end(scratch, c, END, x0, x1, x2)
            f0, f1, f2 = _through_end(scratch, c, END + 3, x0, x1, x2)
            g0, g1, g2 = _through_end(scratch, c, END + 6, x0, x1, x2)
            s = _norm_3d((e0, e1, e2), (f0, f1, f2), (g0, g1, g2), scratch, c)
        scratch[BADNESS, c] = badness(v, s, d)
    return scratch[BADNESS, first_largest(scratch, n)]


@inlined
def to_metric(scratch: np.ndarray, row: int, at: int, c: int, d: int) -> None:
    """Multiply the vector in column ``at`` of some rows by LᵀL of column c; see ``simplex.back_through``."""
    if PLANAR:
        a, b = _through_2d(scratch, c, scratch[row, at], scratch[row + 1, at])
        scratch[row, at] = scratch[FACTOR, c] * a
        scratch[row + 1, at] = scratch[FACTOR + 1, c] * a + scratch[FACTOR + 2, c] * b
        return
    a, b, e = _through_3d(scratch, c, scratch[row, at], scratch[row + 1, at], scratch[row + 2, at])
    scratch[row, at] = scratch[FACTOR, c] * a
    scratch[row + 1, at] = scratch[FACTOR + 1, c] * a + scratch[FACTOR + 3, c] * b
    scratch[row + 2, at] = (
        scratch[FACTOR + 2, c] * a + scratch[FACTOR + 4, c] * b + scratch[FACTOR + 5, c] * e
    )


@inlined
def see_through(scratch: np.ndarray, row: int, at: int, d: int) -> None:
    """Replace the vector u in column ``at`` of some rows by L u, with L of column 0."""
    if PLANAR:
        a, b = _through_2d(scratch, 0, scratch[row, at], scratch[row + 1, at])
        scratch[row, at], scratch[row + 1, at] = a, b
        return
    a, b, e = _through_3d(scratch, 0, scratch[row, at], scratch[row + 1, at], scratch[row + 2, at])
    scratch[row, at], scratch[row + 1, at], scratch[row + 2, at] = a, b, e


@inlined
def solve(scratch: np.ndarray, row: int, at: int, d: int) -> None:
    """Replace the vector u in column ``at`` of some rows by L⁻¹ u, with L of column 0."""
    if PLANAR:
        b = scratch[row + 1, at] / scratch[FACTOR + 2, 0]
        scratch[row, at] = (scratch[row, at] - scratch[FACTOR + 1, 0] * b) / scratch[FACTOR, 0]
        scratch[row + 1, at] = b
        return
    e = scratch[row + 2, at] / scratch[FACTOR + 5, 0]
    b = (scratch[row + 1, at] - scratch[FACTOR + 4, 0] * e) / scratch[FACTOR + 3, 0]
    a = scratch[row, at] - scratch[FACTOR + 1, 0] * b - scratch[FACTOR + 2, 0] * e
    scratch[row, at] = a / scratch[FACTOR, 0]
    scratch[row + 1, at], scratch[row + 2, at] = b, e


@inlined
def solve_back(scratch: np.ndarray, row: int, at: int, d: int) -> None:
    """Replace the vector u in column ``at`` of some rows by L⁻ᵀ u, with L of column 0."""
    a = scratch[row, at] / scratch[FACTOR, 0]
    scratch[row, at] = a
    if PLANAR:
        scratch[row + 1, at] = (scratch[row + 1, at] - scratch[FACTOR + 1, 0] * a) / scratch[FACTOR + 2, 0]
        return
    b = (scratch[row + 1, at] - scratch[FACTOR + 1, 0] * a) / scratch[FACTOR + 3, 0]
    e = scratch[row + 2, at] - scratch[FACTOR + 2, 0] * a - scratch[FACTOR + 4, 0] * b
    scratch[row + 1, at], scratch[row + 2, at] = b, e / scratch[FACTOR + 5, 0]


@inlined
def _through_2d(scratch: np.ndarray, c: int, a: float, b: float) -> tuple[float, float]:
    """L u with L of column c; see ``simplex.through``."""
    return scratch[FACTOR, c] * a + scratch[FACTOR + 1, c] * b, scratch[FACTOR + 2, c] * b


@inlined
def _through_3d(scratch: np.ndarray, c: int, a: float, b: float, e: float) -> tuple[float, float, float]:
    """L u with L of column c; see ``simplex.through``."""
    return (
        scratch[FACTOR, c] * a + scratch[FACTOR + 1, c] * b + scratch[FACTOR + 2, c] * e,
        scratch[FACTOR + 3, c] * b + scratch[FACTOR + 4, c] * e,
        scratch[FACTOR + 5, c] * e,
    )


@inlined
def _through_end(
    scratch: np.ndarray, c: int, end: int, x0: float, x1: float, x2: float
) -> tuple[float, float, float]:
    """The edge from x to one of the corner's ends, seen through L of column c."""
    return _through_3d(scratch, c, scratch[end, c] - x0, scratch[end + 1, c] - x1, scratch[end + 2, c] - x2)


@inlined
def _norm_2d(e0: float, e1: float, f0: float, f1: float, scratch: np.ndarray, c: int) -> float:
    """s of the corner in column c with edges e and f; see ``mean_ratio.weighted_norm``."""
    s = scratch[NORM, c] * (e0 * e0 + e1 * e1)
    s = s + scratch[NORM + 1, c] * (f0 * f0 + f1 * f1)
    return s + scratch[NORM + 2, c] * (e0 * f0 + e1 * f1)


@inlined
def _norm_3d(
    e: tuple[float, float, float],
    f: tuple[float, float, float],
    g: tuple[float, float, float],
    scratch: np.ndarray,
    c: int,
) -> float:
    """s of the corner in column c with edges e, f and g; see ``mean_ratio.weighted_norm``."""
    e0, e1, e2 = e
    f0, f1, f2 = f
    g0, g1, g2 = g
    s = scratch[NORM, c] * (e0 * e0 + e1 * e1 + e2 * e2)
    s = s + scratch[NORM + 1, c] * (f0 * f0 + f1 * f1 + f2 * f2)
    s = s + scratch[NORM + 2, c] * (g0 * g0 + g1 * g1 + g2 * g2)
    s = s + scratch[NORM + 3, c] * (e0 * f0 + e1 * f1 + e2 * f2)
    s = s + scratch[NORM + 4, c] * (e0 * g0 + e1 * g1 + e2 * g2)
    return s + scratch[NORM + 5, c] * (f0 * g0 + f1 * g1 + f2 * g2)


@inlined
def largest_badness_2d(x0: float, x1: float, n: int, scratch: np.ndarray) -> float:
    """The largest badness of a ring with its vertex at x."""
    for c in range(padded(n)):
        e0, e1 = scratch[END, c] - x0, scratch[END + 1, c] - x1
        f0, f1 = scratch[END + 3, c] - x0, scratch[END + 4, c] - x1
        v = e0 * scratch[NORMAL, c] + e1 * scratch[NORMAL + 1, c]
        scratch[BADNESS, c] = badness(v, _norm_2d(e0, e1, f0, f1, scratch, c), 2)
    return scratch[BADNESS, first_largest(scratch, n)]


@inlined
def largest_badness_3d(x0: float, x1: float, x2: float, n: int, scratch: np.ndarray) -> float:
    """The largest badness of a ring with its vertex at x."""
    for c in range(padded(n)):
        e0, e1, e2 = scratch[END, c] - x0, scratch[END + 1, c] - x1, scratch[END + 2, c] - x2
        f0, f1, f2 = scratch[END + 3, c] - x0, scratch[END + 4, c] - x1, scratch[END + 5, c] - x2
        g0, g1, g2 = scratch[END + 6, c] - x0, scratch[END + 7, c] - x1, scratch[END + 8, c] - x2
        v = e0 * scratch[NORMAL, c] + e1 * scratch[NORMAL + 1, c] + e2 * scratch[NORMAL + 2, c]
        scratch[BADNESS, c] = badness(v, _norm_3d((e0, e1, e2), (f0, f1, f2), (g0, g1, g2), scratch, c), 3)
    return scratch[BADNESS, first_largest(scratch, n)]


@inlined
def padded(n: int) -> int:
    """n rounded up to whole groups of WIDTH."""
    return (n + WIDTH - 1) // WIDTH * WIDTH


@inlined
def first_largest(scratch: np.ndarray, n: int) -> int:
    """The first corner with the largest badness in the scratch array."""
    worst, largest = 0, scratch[BADNESS, 0]
    for c in range(1, n):
        if scratch[BADNESS, c] > largest:
            worst, largest = c, scratch[BADNESS, c]
    return worst
