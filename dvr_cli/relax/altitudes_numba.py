"""The altitude rule compiled, ring by ring: the same operations in the same order as ``altitudes``."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty
from dvr_cli.jit.kernels import inlined
from dvr_cli.jit.kinds import MEASURED, PLANAR, compiled_by_kind
from dvr_cli.quality.altitudes_numba import plane_facets, space_facets
from dvr_cli.quality.badness_numba import badness
from dvr_cli.quality.mean_ratio_numba import corner_terms_2d, corner_terms_3d, metric_norm
from dvr_cli.relax.altitudes import SHORT
from dvr_cli.relax.line_numba import keeps_within
from dvr_cli.relax.problem import RingArrays

# The largest face of a tetrahedron, doubled, is at most √3/8 of the sum of its squared edges: a face is at
# most √3/12 of the sum of its own, and these are at most 3/4 of all.
_FACE = 0.2166

Vector = tuple[float, float, float]


@compiled_by_kind
def hold_altitudes(
    points: np.ndarray,
    before: np.ndarray,
    start: int,
    stop: int,
    rings: RingArrays,
    bound: float,
    limit: float,
    by_ring: bool,
) -> int:
    """See ``altitudes.hold_altitudes``."""
    d = points.shape[1]
    origin, reached = empty(d, np.float64), empty(d, np.float64)
    corner = empty(d + 1, np.int32)
    undone = 0
    for ring in range(start, stop):
        vertex = rings.vertices[ring]
        moved = False
        for i in range(d):
            origin[i], reached[i] = before[ring - start, i], points[vertex, i]
            moved = moved or origin[i] != reached[i]
        if not (moved and _below(points, vertex, ring, rings, bound)):
            continue
        _put(points, vertex, origin)
        now = _largest_badness(points, vertex, ring, rings, corner)
        part = np.inf
        for c in range(rings.start[ring], rings.start[ring + 1]):
            part = min(part, _way_out(points, vertex, reached, c, rings, bound))
        part = part * SHORT
        good = False
        if 0.0 < part < 1.0:
            for i in range(d):
                points[vertex, i] = origin[i] + part * (reached[i] - origin[i])
            after = _largest_badness(points, vertex, ring, rings, corner)
            good = keeps_within(after, max(now, limit) if by_ring else limit, d)
            good = good and not _below(points, vertex, ring, rings, bound)
        if not good:
            _put(points, vertex, origin)
            undone += 1
    return undone


@inlined
def _put(points: np.ndarray, vertex: int, x: np.ndarray) -> None:
    for i in range(len(x)):
        points[vertex, i] = x[i]


@inlined
def _below(points: np.ndarray, o: int, ring: int, rings: RingArrays, bound: float) -> bool:
    """True if an altitude of a corner of the ring is below the bound."""
    others = rings.others
    for c in range(rings.start[ring], rings.start[ring + 1]):
        p, q = others[c, 0], others[c, 1]
        if PLANAR:
            v, largest, _ = plane_facets(points, o, p, q)
            if v < bound * np.sqrt(largest):
                return True
        else:
            if _is_far(points, o, p, q, others[c, 2], bound):
                continue
            v, largest, _ = space_facets(points, o, p, q, others[c, 2])
            if v < bound * np.sqrt(largest):
                return True
    return False


@inlined
def _is_far(points: np.ndarray, o: int, p: int, q: int, r: int, bound: float) -> bool:
    """True only if all altitudes of a tetrahedron are above the bound: what takes little."""
    x0, x1, x2 = points[o, 0], points[o, 1], points[o, 2]
    p0, p1, p2 = points[p, 0], points[p, 1], points[p, 2]
    q0, q1, q2 = points[q, 0], points[q, 1], points[q, 2]
    r0, r1, r2 = points[r, 0], points[r, 1], points[r, 2]
    e0, e1, e2 = p0 - x0, p1 - x1, p2 - x2
    f0, f1, f2 = q0 - x0, q1 - x1, q2 - x2
    g0, g1, g2 = r0 - x0, r1 - x1, r2 - x2
    a0, a1, a2 = q0 - p0, q1 - p1, q2 - p2
    b0, b1, b2 = r0 - p0, r1 - p1, r2 - p2
    v = e0 * (a1 * b2 - a2 * b1) + e1 * (a2 * b0 - a0 * b2) + e2 * (a0 * b1 - a1 * b0)
    h0, h1, h2 = e0 + f0 + g0, e1 + f1 + g1, e2 + f2 + g2
    own = e0 * e0 + e1 * e1 + e2 * e2 + f0 * f0 + f1 * f1 + f2 * f2 + g0 * g0 + g1 * g1 + g2 * g2
    return v >= bound * _FACE * (4.0 * own - (h0 * h0 + h1 * h1 + h2 * h2))  # of all six edges


@inlined
def _largest_badness(
    points: np.ndarray, vertex: int, ring: int, rings: RingArrays, corner: np.ndarray
) -> float:
    largest = 0.0
    d = points.shape[1]
    corner[0] = vertex
    for c in range(rings.start[ring], rings.start[ring + 1]):
        for i in range(d):
            corner[i + 1] = rings.others[c, i]
        if PLANAR:
            v, s = corner_terms_2d(points, corner, rings.norm, rings.shapes[c])
        else:
            v, s = corner_terms_3d(points, corner, rings.norm, rings.shapes[c])
        if MEASURED:
            s = metric_norm(points, corner, rings.norm, rings.factor, rings.shapes[c])
        largest = max(largest, badness(v, s, d))
    return largest


@inlined
def _way_out(
    points: np.ndarray, vertex: int, reached: np.ndarray, c: int, rings: RingArrays, bound: float
) -> float:
    """See ``altitudes._Corners.way_out``, of the corner with number c among those of rings."""
    x0, x1 = points[vertex, 0], points[vertex, 1]
    w0, w1 = reached[0] - x0, reached[1] - x1
    p, q = rings.others[c, 0], rings.others[c, 1]
    p0, p1, q0, q1 = points[p, 0], points[p, 1], points[q, 0], points[q, 1]
    e0, e1, f0, f1 = p0 - x0, p1 - x1, q0 - x0, q1 - x1
    if PLANAR:
        n0, n1 = q1 - p1, -(q0 - p0)
        v, dv = e0 * n0 + e1 * n1, -(w0 * n0 + w1 * n1)
        part = _exit(v, dv, n0 * n0 + n1 * n1, 0.0, 0.0, bound)
        ww = w0 * w0 + w1 * w1
        part = min(part, _exit(v, dv, e0 * e0 + e1 * e1, e0 * -w0 + e1 * -w1, ww, bound))
        return min(part, _exit(v, dv, f0 * f0 + f1 * f1, f0 * -w0 + f1 * -w1, ww, bound))
    x2, r = points[vertex, 2], rings.others[c, 2]
    w2, p2, q2 = reached[2] - x2, points[p, 2], points[q, 2]
    r0, r1, r2 = points[r, 0], points[r, 1], points[r, 2]
    e2, f2, g0, g1, g2 = p2 - x2, q2 - x2, r0 - x0, r1 - x1, r2 - x2
    n0, n1, n2 = _cross(q0 - p0, q1 - p1, q2 - p2, r0 - p0, r1 - p1, r2 - p2)
    v, dv = e0 * n0 + e1 * n1 + e2 * n2, -(w0 * n0 + w1 * n1 + w2 * n2)
    part = _exit(v, dv, n0 * n0 + n1 * n1 + n2 * n2, 0.0, 0.0, bound)
    e, f, g, w = (e0, e1, e2), (f0, f1, f2), (g0, g1, g2), (w0, w1, w2)
    part = min(part, _exit_through(v, dv, e, f, w, bound))
    part = min(part, _exit_through(v, dv, f, g, w, bound))
    return min(part, _exit_through(v, dv, g, e, w, bound))


@inlined
def _exit_through(v: float, dv: float, e: Vector, f: Vector, w: Vector, bound: float) -> float:
    """See ``altitudes._exit``, for the face with the edges e and f at the vertex that moves along w."""
    (e0, e1, e2), (f0, f1, f2), (w0, w1, w2) = e, f, w
    n0, n1, n2 = _cross(e0, e1, e2, f0, f1, f2)
    m0, m1, m2 = _cross(f0 - e0, f1 - e1, f2 - e2, w0, w1, w2)
    ndn, dndn = n0 * m0 + n1 * m1 + n2 * m2, m0 * m0 + m1 * m1 + m2 * m2
    return _exit(v, dv, n0 * n0 + n1 * n1 + n2 * n2, ndn, dndn, bound)


@inlined
def _exit(v: float, dv: float, nn: float, ndn: float, dndn: float, bound: float) -> float:
    """See ``altitudes._exit``."""
    square = bound * bound
    a, b, c = dv * dv - square * dndn, v * dv - square * ndn, v * v - square * nn
    root = np.sqrt(b * b - a * c)
    if b > 0.0:
        found = (b + root) / -a if a < 0.0 else np.inf
    elif root - b > 0.0:
        found = c / (root - b)
    else:
        found = 0.0 if a < 0.0 else np.inf
    return found if c >= 0.0 and found >= 0.0 else np.inf


@inlined
def _cross(a0: float, a1: float, a2: float, b0: float, b1: float, b2: float) -> tuple[float, float, float]:
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
