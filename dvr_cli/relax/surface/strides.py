"""Strides: how a vertex moves on its facet or segment, and from there into the next.

In a facet a stride is straight; beyond an edge it goes on in the plane of the next facet, unfolded about that
edge.

These are kernels, for one vertex at a time; ``strides_numba`` has them compiled.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from dvr_cli.relax.surface.carriers import CURVE, Ground, Standing

CROSSINGS = 64  # edges and vertices passed on a walk; about 1 is usual
_ACROSS = 1e-9  # length below which what a unit vector has in a plane or along a line is rounding

Vector = tuple[float, float, float]
Rates = tuple[float, float]  # at which u and w of a facet grow along a direction; on a segment 0


def along_carrier(
    vertex: int, d0: float, d1: float, d2: float, ground: Ground, standing: Standing
) -> tuple[float, float, float]:
    """The part of a direction in the plane of the vertex's facet or along its segment, made unit, or 0."""
    at = standing.at[vertex]
    if standing.kind[vertex] == CURVE:
        t0, t1, t2 = tangent(at, ground)
        along = d0 * t0 + d1 * t1 + d2 * t2
        if along > _ACROSS:
            return t0, t1, t2
        if along < -_ACROSS:
            return -t0, -t1, -t2
        return 0.0, 0.0, 0.0
    n0, n1, n2 = ground.normals[at, 0], ground.normals[at, 1], ground.normals[at, 2]
    for _ in range(2):  # once more: what is left across the plane is rounding of what may have been short
        across = d0 * n0 + d1 * n1 + d2 * n2
        d0, d1, d2 = d0 - across * n0, d1 - across * n1, d2 - across * n2
        length = sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        if not length > _ACROSS:
            return 0.0, 0.0, 0.0
        d0, d1, d2 = d0 / length, d1 / length, d2 / length
    return d0, d1, d2


def tangent(segment: int, ground: Ground) -> tuple[float, float, float]:
    """The unit vector from the first end of a segment to the second, 0 where they coincide."""
    t0, t1, t2, length = _span(segment, ground)
    if not length > 0.0:
        return 0.0, 0.0, 0.0
    return t0 / length, t1 / length, t2 / length


def _span(segment: int, ground: Ground) -> tuple[float, float, float, float]:
    """The vector from the first end of a segment to the second, and its length."""
    a, b, places = ground.segments[segment, 0], ground.segments[segment, 1], ground.places
    e0, e1, e2 = places[b, 0] - places[a, 0], places[b, 1] - places[a, 1], places[b, 2] - places[a, 2]
    return e0, e1, e2, sqrt(e0 * e0 + e1 * e1 + e2 * e2)


def _rates(at: int, d0: float, d1: float, d2: float, ground: Ground) -> Rates:
    """The rates at which the coordinates u and w of a facet grow along a direction in its plane."""
    places, i = ground.places, ground.triangles[at, 0]
    j, k = ground.triangles[at, 1], ground.triangles[at, 2]
    e0, e1, e2 = places[j, 0] - places[i, 0], places[j, 1] - places[i, 1], places[j, 2] - places[i, 2]
    f0, f1, f2 = places[k, 0] - places[i, 0], places[k, 1] - places[i, 1], places[k, 2] - places[i, 2]
    ee, ef, ff = e0 * e0 + e1 * e1 + e2 * e2, e0 * f0 + e1 * f1 + e2 * f2, f0 * f0 + f1 * f1 + f2 * f2
    p, q = d0 * e0 + d1 * e1 + d2 * e2, d0 * f0 + d1 * f1 + d2 * f2
    size = ee * ff - ef * ef
    return (ff * p - ef * q) / size, (ee * q - ef * p) / size


def way_out(
    vertex: int, d0: float, d1: float, d2: float, came: int, ground: Ground, standing: Standing
) -> tuple[float, int, Rates]:
    """The distance along a direction to the end of the facet or segment, and the edge or end it leads to.

    An edge has the number of the vertex opposite. came: that over which the vertex came, or -1. Returned with
    these are the rates along the direction.
    """
    at, u = standing.at[vertex], standing.u[vertex]
    if standing.kind[vertex] == CURVE:
        e0, e1, e2, length = _span(at, ground)
        if d0 * e0 + d1 * e1 + d2 * e2 >= 0.0:
            return (1.0 - u) * length, 1, (0.0, 0.0)
        return u * length, 0, (0.0, 0.0)
    w = standing.w[vertex]
    du, dw = _rates(at, d0, d1, d2, ground)
    least, out = np.inf, -1
    for k in range(3):
        b, rate = 1.0 - u - w, -du - dw
        if k == 1:
            b, rate = u, du
        elif k == 2:
            b, rate = w, dw
        if k != came and rate < 0.0:
            way = max(b, 0.0) / -rate
            if way < least:
                least, out = way, k
    return least, out, (du, dw)


def go(
    points: np.ndarray,
    vertex: int,
    direction: Vector,
    rates: Rates,
    step: float,
    ground: Ground,
    standing: Standing,
) -> None:
    """Move a vertex by ``step`` within its facet or segment."""
    d0, d1, d2 = direction
    at, u = standing.at[vertex], standing.u[vertex]
    if standing.kind[vertex] == CURVE:
        e0, e1, e2, length = _span(at, ground)
        part = step / length
        if d0 * e0 + d1 * e1 + d2 * e2 < 0.0:
            part = -part
        _stand(points, vertex, at, min(max(u + part, 0.0), 1.0), 0.0, ground, standing)
        return
    du, dw = rates
    u, w = max(u + step * du, 0.0), max(standing.w[vertex] + step * dw, 0.0)
    if u + w > 1.0:
        w = max(1.0 - u, 0.0)
        u = 1.0 - w
    _stand(points, vertex, at, u, w, ground, standing)


def go_out(
    points: np.ndarray,
    vertex: int,
    rates: Rates,
    way: float,
    out: int,
    ground: Ground,
    standing: Standing,
) -> None:
    """Move a vertex by ``way``, onto the edge or end ``out`` of its facet or segment."""
    at, u, w = standing.at[vertex], standing.u[vertex], standing.w[vertex]
    if standing.kind[vertex] == CURVE:
        _stand(points, vertex, at, 1.0 if out == 1 else 0.0, 0.0, ground, standing)
        return
    du, dw = rates
    u, w = min(max(u + way * du, 0.0), 1.0), min(max(w + way * dw, 0.0), 1.0)
    if out == 0:
        w = 1.0 - u
    elif out == 1:
        u = 0.0
    else:
        w = 0.0
    _stand(points, vertex, at, u, w, ground, standing)


def _stand(
    points: np.ndarray, vertex: int, at: int, u: float, w: float, ground: Ground, standing: Standing
) -> None:
    """Put a vertex on its facet or segment ``at``."""
    standing.at[vertex], standing.u[vertex], standing.w[vertex] = at, u, w
    places = ground.places
    if standing.kind[vertex] == CURVE:
        a, b = ground.segments[at, 0], ground.segments[at, 1]
        for i in range(points.shape[1]):
            if u == 1.0:
                points[vertex, i] = places[b, i]
            else:
                points[vertex, i] = places[a, i] + u * (places[b, i] - places[a, i])
        return
    a, b, c = ground.triangles[at, 0], ground.triangles[at, 1], ground.triangles[at, 2]
    for i in range(points.shape[1]):
        along = u * (places[b, i] - places[a, i])
        points[vertex, i] = places[a, i] + (along + w * (places[c, i] - places[a, i]))
    if u == 1.0 or w == 1.0:
        for i in range(points.shape[1]):
            points[vertex, i] = places[b if u == 1.0 else c, i]


def cross(
    vertex: int, d0: float, d1: float, d2: float, out: int, ground: Ground, standing: Standing
) -> tuple[float, float, float, int]:
    """Take a vertex from the edge or end ``out`` of its facet or segment into what lies beyond.

    Returns its direction there, and the edge or end over which it came, -1 if there is nothing beyond.
    """
    at = standing.at[vertex]
    if standing.kind[vertex] == CURVE:
        after = ground.onward[at, out]
        if after < 0:
            return d0, d1, d2, -1
        node = ground.segments[at, out]
        came = 0 if ground.segments[after, 0] == node else 1
        t0, t1, t2 = tangent(after, ground)
        standing.at[vertex], standing.u[vertex] = after, 1.0 if came == 1 else 0.0
        if t0 == 0.0 and t1 == 0.0 and t2 == 0.0:  # a segment of no length: nowhere to go
            standing.at[vertex], standing.u[vertex] = at, 1.0 if out == 1 else 0.0
            return d0, d1, d2, -1
        if came == 1:
            return -t0, -t1, -t2, came
        return t0, t1, t2, came
    after = ground.beyond[at, out]
    if after < 0:
        return d0, d1, d2, -1
    triangles, places = ground.triangles, ground.places
    i, j = (out + 1) % 3, (out + 2) % 3
    p, q = triangles[at, i], triangles[at, j]
    far = standing.u[vertex]  # the coordinate that belongs to q
    if j == 0:
        far = 1.0 - standing.u[vertex] - standing.w[vertex]
    elif j == 2:
        far = standing.w[vertex]
    came = 0
    for k in range(3):
        if triangles[after, k] != p and triangles[after, k] != q:
            came = k
    p_at = (came + 1) % 3
    first = far if triangles[after, p_at] == q else 1.0 - far
    u, w = first, 1.0 - first  # came == 0
    if came == 1:  # p_at is 2, the other 0
        u, w = 0.0, first
    elif came == 2:  # p_at is 0, the other 1
        u, w = 1.0 - first, 0.0
    standing.at[vertex], standing.u[vertex], standing.w[vertex] = after, u, w
    e0, e1, e2 = places[q, 0] - places[p, 0], places[q, 1] - places[p, 1], places[q, 2] - places[p, 2]
    length = sqrt(e0 * e0 + e1 * e1 + e2 * e2)
    e0, e1, e2 = e0 / length, e1 / length, e2 / length
    along = d0 * e0 + d1 * e1 + d2 * e2
    up = sqrt(max(1.0 - along * along, 0.0))
    top = triangles[after, came]
    f0, f1, f2 = places[top, 0] - places[p, 0], places[top, 1] - places[p, 1], places[top, 2] - places[p, 2]
    base = f0 * e0 + f1 * e1 + f2 * e2
    f0, f1, f2 = f0 - base * e0, f1 - base * e1, f2 - base * e2
    up = up / sqrt(f0 * f0 + f1 * f1 + f2 * f2)
    return along * e0 + up * f0, along * e1 + up * f1, along * e2 + up * f2, came


def put(points: np.ndarray, vertex: int, x0: float, x1: float, x2: float) -> None:
    points[vertex, 0], points[vertex, 1] = x0, x1
    if points.shape[1] == 3:
        points[vertex, 2] = x2
