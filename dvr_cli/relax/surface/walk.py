"""The walk: a vertex on a surface or curve moves along a direction, from facet to facet of the input.

In the plane of a facet the direction is a line, and the line problem is solved on it as everywhere. If the
best place lies within the facet the vertex stays there; else it goes to the facet's edge, into the facet
beyond, with its direction unfolded about that edge, and on from there while the ring gets better. At a vertex
of the input it goes round, facet by facet, to the one whose wedge has the direction. So it is on the input's
surface by construction, cannot jump through a thin wall, and needs no nearest point. On curves the same holds
in one dimension.

At the end the ring is evaluated again: the vertex stays there if its minimum quality has grown (or its price
has fallen, above the floor), no triangle of a surface has turned over against the facets its vertices stand
on, no altitude is below the bound, and the mesh is nowhere farther from the input than the limit. Else the
walk is tried again, shorter.

These are kernels, written for one vertex at a time over the functions of ``ring``; ``walk_numba`` has them
compiled over those of ``ring_numba``, so both do the same operations in the same order. Records are taken out
of ``Walk`` once and passed on one by one: to take them out for each vertex costs a tenth of the time.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from dvr_cli.relax.polish import Aim
from dvr_cli.relax.problem import RingArrays
from dvr_cli.relax.surface.carriers import CURVE, SURFACE, Ground, RingCorners, Standing, Stars
from dvr_cli.relax.surface.overlay import look, take_over
from dvr_cli.relax.surface.ring import (
    BADNESS,
    END,
    GRADIENT,
    NORMAL,
    S0,
    S1,
    S2,
    V0,
    V1,
    bare,
    best_step,
    hull_direction,
    improves,
    keeps,
    lowest_step,
    new_scratch,
    price_of,
    set_gradient,
    set_lines,
    set_shares,
    worst_of,
)

_TRIES = 4  # walks tried, each at most half as long as the one before
_CROSSINGS = 64  # edges and vertices passed on a walk; about 1 is usual
_STILL = (0.0, 0.0, 0.0)  # the direction of a vertex that is not to move
_ACROSS = 1e-9  # length below which what a unit vector has in a plane or along a line is rounding

Vector = tuple[float, float, float]


class Walk(NamedTuple):
    """The ground of walks, and where they have come to. Kernels change ``points`` and ``standing``.

    points: (N, d) coordinates in the problem's numbering. The others are those of the problem.
    """

    points: np.ndarray
    rings: RingArrays
    ground: Ground
    stars: Stars
    corners: RingCorners
    standing: Standing


class Purpose(NamedTuple):
    """The purpose of a walk, and the rules it keeps to.

    limit: how far the mesh may come from the input. altitude: that below which no walk takes an element, 0.0
        for no such rule. polishing: whether to lower the price that ``aim`` says (see ``polish``), with no
        badness above that at the ``floor``, instead of raising the minimum.
    """

    limit: float
    altitude: float
    polishing: bool
    floor: float
    aim: Aim


def walk_rings(
    walk: Walk, directions: np.ndarray, start: int, stop: int, purpose: Purpose, largest_ring: int
) -> int:
    """Walk the vertices of rings start .. stop, which are independent, each along its direction.

    directions: (m, d). largest_ring: corners in a ring at most. Returns how many vertices moved.
    """
    walk, directions = bare(walk), bare(directions)
    vertices, at = walk.rings.vertices, walk.standing.at
    scratch = new_scratch(largest_ring)
    moved = 0
    for ring in range(start, stop):
        if at[vertices[ring]] >= 0 and _walk_one(walk, directions, ring, purpose, scratch):
            moved += 1
    return moved


def walk_directions(
    walk: Walk,
    directions: np.ndarray,
    start: int,
    stop: int,
    band: float,
    aim: Aim,
    active: np.ndarray,
    largest_ring: int,
) -> None:
    """Set the rows start .. stop of ``directions`` (m, d) to those of ascent, along the carriers.

    band: that of nearly worst corners, see ``steepest.Ascent``; if it is negative the directions are those
    along which the price falls fastest that ``aim`` says. active: (m,) bool, the rings that are asked about.
    Rows of others and of vertices that do not walk become zero.
    """
    walk, directions, active = bare(walk), bare(directions), bare(active)
    points, rings, ground, standing = walk.points, walk.rings, walk.ground, walk.standing
    scratch = new_scratch(largest_ring)
    d, components = rings.others.shape[1], points.shape[1]
    keep = 1.0 - band
    keep = keep if d == 2 else keep * keep * keep
    for ring in range(start, stop):
        vertex = rings.vertices[ring]
        for i in range(components):
            directions[ring, i] = 0.0
        if standing.at[vertex] < 0 or not active[ring]:
            continue
        n = _lines(walk, ring, _STILL, True, scratch)
        worst = worst_of(scratch, n, d)
        largest = scratch[BADNESS, worst]
        if band < 0.0:
            if largest < np.inf:
                set_shares(scratch, n, d, aim)
                _mean_direction(points, directions, ring, n, rings, ground, standing, scratch)
            continue
        count, initial = 0, -1
        for c in range(n):
            if scratch[BADNESS, c] >= largest * keep:
                _gradient(points, ring, c, largest < np.inf, rings, scratch, count)
                _onto_carrier(vertex, count, components, ground, standing, scratch)
                if _square(scratch, count, components) < np.inf:
                    if c == worst:
                        initial = count
                    count += 1
        hull_direction(directions, ring, initial, count, components, scratch)


def _mean_direction(
    points: np.ndarray,
    directions: np.ndarray,
    ring: int,
    n: int,
    rings: RingArrays,
    ground: Ground,
    standing: Standing,
    scratch: np.ndarray,
) -> None:
    """Set a row of ``directions`` to that of fastest fall of the price, whose shares stand in the scratch."""
    vertex, components = rings.vertices[ring], points.shape[1]
    total = n - 1  # the column of the sum
    t0 = t1 = t2 = 0.0
    for c in range(n):
        _gradient(points, ring, c, True, rings, scratch, total)
        share = scratch[BADNESS, c]
        t0 = t0 + share * scratch[GRADIENT, total]
        t1 = t1 + share * scratch[GRADIENT + 1, total]
        if components == 3:
            t2 = t2 + share * scratch[GRADIENT + 2, total]
    scratch[GRADIENT, total], scratch[GRADIENT + 1, total], scratch[GRADIENT + 2, total] = t0, t1, t2
    _onto_carrier(vertex, total, components, ground, standing, scratch)
    square = _square(scratch, total, components)
    if 0.0 < square < np.inf:
        length = sqrt(square)
        for i in range(components):
            directions[ring, i] = -scratch[GRADIENT + i, total] / length


def _gradient(
    points: np.ndarray, ring: int, c: int, positive: bool, rings: RingArrays, scratch: np.ndarray, to: int
) -> None:
    """d/2 times the gradient of log 1/Q of the corner in column c, put into column ``to``.

    positive: false for the unit vector against which the determinant grows, where a ring is not positive.
    """
    vertex = rings.vertices[ring]
    d, components = rings.others.shape[1], points.shape[1]
    if not positive:
        size = 0.0
        for i in range(components):
            size = size + scratch[NORMAL + i, c] * scratch[NORMAL + i, c]
        size = sqrt(size) if size > 0.0 else 1.0
        for i in range(components):
            scratch[GRADIENT + i, to] = scratch[NORMAL + i, c] / size
    elif components == d:
        set_gradient(points, vertex, ring, c, rings, scratch, to)
    else:
        k = rings.shapes[rings.start[ring] + c]
        for i in range(components):
            x = points[vertex, i]
            pull = rings.slope[k, 0] * (scratch[END + i, c] - x)
            pull = pull + rings.slope[k, 1] * (scratch[END + 3 + i, c] - x)
            scratch[GRADIENT + i, to] = scratch[NORMAL + i, c] / scratch[V0, c] - d * pull / scratch[S0, c]


def _onto_carrier(
    vertex: int, k: int, components: int, ground: Ground, standing: Standing, scratch: np.ndarray
) -> None:
    """Reduce the gradient in column k to the part in the vertex's facet or along its segment."""
    at = standing.at[vertex]
    if standing.kind[vertex] == CURVE:
        a0, a1, a2 = _tangent(at, ground)
    else:
        a0, a1, a2 = ground.normals[at, 0], ground.normals[at, 1], ground.normals[at, 2]
    g0, g1 = scratch[GRADIENT, k], scratch[GRADIENT + 1, k]
    g2 = scratch[GRADIENT + 2, k] if components == 3 else 0.0
    along = g0 * a0 + g1 * a1 + g2 * a2
    a0, a1, a2 = along * a0, along * a1, along * a2
    if standing.kind[vertex] != CURVE:
        a0, a1, a2 = g0 - a0, g1 - a1, g2 - a2
    scratch[GRADIENT, k], scratch[GRADIENT + 1, k], scratch[GRADIENT + 2, k] = a0, a1, a2


def _square(scratch: np.ndarray, k: int, components: int) -> float:
    """The squared length of the gradient in column k."""
    square = 0.0
    for i in range(components):
        square = square + scratch[GRADIENT + i, k] * scratch[GRADIENT + i, k]
    return square


def _walk_one(walk: Walk, directions: np.ndarray, ring: int, purpose: Purpose, scratch: np.ndarray) -> bool:
    """Walk one vertex; whether it moved."""
    points, rings, ground, stars = walk.points, walk.rings, walk.ground, walk.stars
    standing, number = walk.standing, walk.corners.number
    vertex, d = rings.vertices[ring], rings.others.shape[1]
    at, u, w = standing.at[vertex], standing.u[vertex], standing.w[vertex]
    x0, x1 = points[vertex, 0], points[vertex, 1]
    x2 = points[vertex, 2] if points.shape[1] == 3 else 0.0
    limit, longest = purpose.limit, np.inf
    for _ in range(_TRIES):
        walked, before, floor = _walk(walk, directions, ring, longest, purpose, scratch)
        if walked == 0.0:
            _put(points, vertex, x0, x1, x2)
            standing.at[vertex], standing.u[vertex], standing.w[vertex] = at, u, w
            return False
        n = _lines(walk, ring, _STILL, False, scratch)
        largest = scratch[BADNESS, worst_of(scratch, n, d)]
        if purpose.polishing:
            better = keeps(before, price_of(scratch, n, d, purpose.aim), largest, floor, d)
        else:
            better = improves(before, largest, d)
        if purpose.altitude > 0.0:
            better = better and _keeps_altitude(points, vertex, n, d, purpose.altitude, scratch)
        part = 0.5
        if better and _upright(walk, ring, (x0, x1, x2), at):
            y0, y1 = points[vertex, 0] - x0, points[vertex, 1] - x1
            y2 = points[vertex, 2] - x2 if points.shape[1] == 3 else 0.0
            moved = sqrt(y0 * y0 + y1 * y1 + y2 * y2)
            apart = look(points, vertex, moved, limit, ground, stars, standing)
            if apart <= limit:
                take_over(vertex, stars, standing)
                for entry in range(rings.start[ring], rings.start[ring + 1]):
                    if len(number):
                        standing.turned[number[entry]] = False
                return True
            part = min(max(limit / apart, 0.1), 0.5)
        longest = part * walked
        _put(points, vertex, x0, x1, x2)
        standing.at[vertex], standing.u[vertex], standing.w[vertex] = at, u, w
    return False


def _keeps_altitude(
    points: np.ndarray, vertex: int, n: int, d: int, altitude: float, scratch: np.ndarray
) -> bool:
    """True if no altitude of the ring's n corners, which stand in the scratch, is below the one given."""
    x0, x1 = points[vertex, 0], points[vertex, 1]
    x2 = points[vertex, 2] if points.shape[1] == 3 else 0.0
    for c in range(n):
        e0, e1, e2 = scratch[END, c] - x0, scratch[END + 1, c] - x1, scratch[END + 2, c] - x2
        f0, f1, f2 = scratch[END + 3, c] - x0, scratch[END + 4, c] - x1, scratch[END + 5, c] - x2
        g0, g1, g2 = f0 - e0, f1 - e1, f2 - e2
        if d == 2:
            largest = max(e0 * e0 + e1 * e1 + e2 * e2, f0 * f0 + f1 * f1 + f2 * f2)
            largest = max(largest, g0 * g0 + g1 * g1 + g2 * g2)
        else:
            h0, h1, h2 = scratch[END + 6, c] - x0, scratch[END + 7, c] - x1, scratch[END + 8, c] - x2
            largest = max(_area(e0, e1, e2, f0, f1, f2), _area(f0, f1, f2, h0, h1, h2))
            largest = max(largest, _area(h0, h1, h2, e0, e1, e2))
            largest = max(largest, _area(g0, g1, g2, h0 - e0, h1 - e1, h2 - e2))
        if scratch[V0, c] < altitude * sqrt(largest):
            return False
    return True


def _area(a0: float, a1: float, a2: float, b0: float, b1: float, b2: float) -> float:
    """Four times the squared area of the triangle with edges a and b."""
    n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    return n0 * n0 + n1 * n1 + n2 * n2


def _walk(
    walk: Walk, directions: np.ndarray, ring: int, longest: float, purpose: Purpose, scratch: np.ndarray
) -> tuple[float, float, float]:
    """Walk a vertex along its direction to the best place, not farther than ``longest``.

    Returns how far it went, the largest badness or the price at the beginning, and the badness at its floor.
    """
    points, rings, ground, standing = walk.points, walk.rings, walk.ground, walk.standing
    vertex, d = rings.vertices[ring], rings.others.shape[1]
    d0, d1 = directions[ring, 0], directions[ring, 1]
    d2 = directions[ring, 2] if points.shape[1] == 3 else 0.0
    d0, d1, d2 = _along_carrier(vertex, d0, d1, d2, ground, standing)
    if d0 == 0.0 and d1 == 0.0 and d2 == 0.0:
        return 0.0, 0.0, 0.0
    walked, before, floor, came = 0.0, 0.0, purpose.floor, -1
    for crossing in range(_CROSSINGS):
        step = np.inf
        way, out = 0.0, -1
        if crossing > 0:
            way, out = _way_out(vertex, d0, d1, d2, came, ground, standing)
        if crossing == 0 or way > 0.0:
            n = _lines(walk, ring, (d0, d1, d2), True, scratch)
            if purpose.polishing:
                step, now, highest = lowest_step(scratch, n, d, floor, purpose.aim, crossing == 0)
            else:
                step, now = best_step(scratch, n, d)
                highest = floor
            if crossing == 0:
                before, floor = now, highest
                if step < 0.0:
                    d0, d1, d2, step = -d0, -d1, -d2, -step
                way, out = _way_out(vertex, d0, d1, d2, came, ground, standing)
            if not step > 0.0:
                break
        rest = longest - walked
        step = min(step, rest)
        if step <= way:
            _go(points, vertex, (d0, d1, d2), step, ground, standing)
            walked += step
            break
        _go_out(points, vertex, (d0, d1, d2), way, out, ground, standing)
        walked += way
        d0, d1, d2, came = _cross(vertex, d0, d1, d2, out, ground, standing)
        if came < 0:
            break
    return walked, before, floor


def _along_carrier(
    vertex: int, d0: float, d1: float, d2: float, ground: Ground, standing: Standing
) -> tuple[float, float, float]:
    """The part of a direction in the plane of the vertex's facet or along its segment, made unit, or 0."""
    at = standing.at[vertex]
    if standing.kind[vertex] == CURVE:
        t0, t1, t2 = _tangent(at, ground)
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


def _tangent(segment: int, ground: Ground) -> tuple[float, float, float]:
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


def _rates(at: int, d0: float, d1: float, d2: float, ground: Ground) -> tuple[float, float]:
    """The rates at which the coordinates u and w of a facet grow along a direction in its plane."""
    places, i = ground.places, ground.triangles[at, 0]
    j, k = ground.triangles[at, 1], ground.triangles[at, 2]
    e0, e1, e2 = places[j, 0] - places[i, 0], places[j, 1] - places[i, 1], places[j, 2] - places[i, 2]
    f0, f1, f2 = places[k, 0] - places[i, 0], places[k, 1] - places[i, 1], places[k, 2] - places[i, 2]
    ee, ef, ff = e0 * e0 + e1 * e1 + e2 * e2, e0 * f0 + e1 * f1 + e2 * f2, f0 * f0 + f1 * f1 + f2 * f2
    p, q = d0 * e0 + d1 * e1 + d2 * e2, d0 * f0 + d1 * f1 + d2 * f2
    size = ee * ff - ef * ef
    return (ff * p - ef * q) / size, (ee * q - ef * p) / size


def _way_out(
    vertex: int, d0: float, d1: float, d2: float, came: int, ground: Ground, standing: Standing
) -> tuple[float, int]:
    """The distance along a direction to the end of the facet or segment, and the edge or end it leads to.

    An edge has the number of the vertex opposite. came: that over which the vertex came, or -1.
    """
    at, u = standing.at[vertex], standing.u[vertex]
    if standing.kind[vertex] == CURVE:
        e0, e1, e2, length = _span(at, ground)
        if d0 * e0 + d1 * e1 + d2 * e2 >= 0.0:
            return (1.0 - u) * length, 1
        return u * length, 0
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
    return least, out


def _go(
    points: np.ndarray, vertex: int, direction: Vector, step: float, ground: Ground, standing: Standing
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
    du, dw = _rates(at, d0, d1, d2, ground)
    u, w = max(u + step * du, 0.0), max(standing.w[vertex] + step * dw, 0.0)
    if u + w > 1.0:
        w = max(1.0 - u, 0.0)
        u = 1.0 - w
    _stand(points, vertex, at, u, w, ground, standing)


def _go_out(
    points: np.ndarray,
    vertex: int,
    direction: Vector,
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
    d0, d1, d2 = direction
    du, dw = _rates(at, d0, d1, d2, ground)
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


def _cross(
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
        t0, t1, t2 = _tangent(after, ground)
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


def _put(points: np.ndarray, vertex: int, x0: float, x1: float, x2: float) -> None:
    points[vertex, 0], points[vertex, 1] = x0, x1
    if points.shape[1] == 3:
        points[vertex, 2] = x2


def _lines(walk: Walk, ring: int, direction: Vector, signed: bool, scratch: np.ndarray) -> int:
    """Lay out a ring and its lines; signed: whether corners of a surface that turned over are negative."""
    points, rings, ground, standing = walk.points, walk.rings, walk.ground, walk.standing
    d0, d1, d2 = direction
    vertex = rings.vertices[ring]
    if points.shape[1] == rings.others.shape[1]:
        return set_lines(points, vertex, d0, d1, d2, ring, rings, scratch)
    others, shapes, norm, slope = rings.others, rings.shapes, rings.norm, rings.slope
    curvature, number, turned = rings.curvature, walk.corners.number, standing.turned
    h0 = h1 = h2 = 0.0  # the normal of a triangle of no area: that of the facet
    if standing.kind[vertex] == SURFACE:
        at = standing.at[vertex]
        h0, h1, h2 = ground.normals[at, 0], ground.normals[at, 1], ground.normals[at, 2]
    lo = rings.start[ring]
    n = rings.start[ring + 1] - lo
    x0, x1, x2 = points[vertex, 0], points[vertex, 1], points[vertex, 2]
    square = d0 * d0 + d1 * d1 + d2 * d2
    for c in range(n):
        p, q, k = others[lo + c, 0], others[lo + c, 1], shapes[lo + c]
        p0, p1, p2 = points[p, 0], points[p, 1], points[p, 2]
        q0, q1, q2 = points[q, 0], points[q, 1], points[q, 2]
        e0, e1, e2 = p0 - x0, p1 - x1, p2 - x2
        f0, f1, f2 = q0 - x0, q1 - x1, q2 - x2
        a0, a1, a2 = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
        size = sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        if size > 0.0:
            a0, a1, a2 = a0 / size, a1 / size, a2 / size
        else:
            a0, a1, a2 = h0, h1, h2
        if signed and turned[number[lo + c]]:
            size, a0, a1, a2 = -size, -a0, -a1, -a2
        g0, g1, g2 = q0 - p0, q1 - p1, q2 - p2
        n0, n1, n2 = g1 * a2 - g2 * a1, g2 * a0 - g0 * a2, g0 * a1 - g1 * a0
        s = norm[k, 0] * (e0 * e0 + e1 * e1 + e2 * e2)
        s = s + norm[k, 1] * (f0 * f0 + f1 * f1 + f2 * f2)
        s = s + norm[k, 2] * (e0 * f0 + e1 * f1 + e2 * f2)
        along = slope[k, 0] * (d0 * e0 + d1 * e1 + d2 * e2)
        along = along + slope[k, 1] * (d0 * f0 + d1 * f1 + d2 * f2)
        scratch[END, c], scratch[END + 1, c], scratch[END + 2, c] = p0, p1, p2
        scratch[END + 3, c], scratch[END + 4, c], scratch[END + 5, c] = q0, q1, q2
        scratch[NORMAL, c], scratch[NORMAL + 1, c], scratch[NORMAL + 2, c] = n0, n1, n2
        scratch[V0, c] = size
        scratch[V1, c] = -(d0 * n0 + d1 * n1 + d2 * n2)
        scratch[S0, c] = s
        scratch[S1, c] = -along
        scratch[S2, c] = curvature[k] * square
    return n


def _upright(walk: Walk, ring: int, x: Vector, at: int) -> bool:
    """True if no triangle of a surface's ring turned over as its vertex came here from x on facet ``at``.

    A triangle is upright if its normal is on the side of those of the facets that its vertices stand on; if
    none of them stands on one, of that of the facet it was in the input.
    """
    points, rings, corners, standing = walk.points, walk.rings, walk.corners, walk.standing
    if not len(corners.number):
        return True
    vertex = rings.vertices[ring]
    others, number, turned = rings.others, corners.number, standing.turned
    kind, stands, normals = standing.kind, standing.at, walk.ground.normals
    x0, x1, x2 = x
    y0, y1, y2 = points[vertex, 0], points[vertex, 1], points[vertex, 2]
    lo = rings.start[ring]
    for c in range(rings.start[ring + 1] - lo):
        p, q = others[lo + c, 0], others[lo + c, 1]
        sides = 0
        for k in range(3):
            member = vertex if k == 0 else others[lo + c, k - 1]
            if kind[member] != SURFACE:
                continue
            sides += 1
            after = stands[member]
            before = at if k == 0 else after
            now = _side(points, y0, y1, y2, p, q, after, normals)
            if not now > 0.0 and (
                turned[number[lo + c]] or _side(points, x0, x1, x2, p, q, before, normals) > 0.0
            ):
                return False
        if sides == 0 and not _side(points, y0, y1, y2, p, q, corners.triangle[lo + c], normals) > 0.0:
            return False
    return True


def _side(
    points: np.ndarray, x0: float, x1: float, x2: float, p: int, q: int, facet: int, normals: np.ndarray
) -> float:
    """The area of the triangle x, p, q as seen from above a facet, positive if it is upright there."""
    e0, e1, e2 = points[p, 0] - x0, points[p, 1] - x1, points[p, 2] - x2
    f0, f1, f2 = points[q, 0] - x0, points[q, 1] - x1, points[q, 2] - x2
    area = normals[facet, 0] * (e1 * f2 - e2 * f1)
    area = area + normals[facet, 1] * (e2 * f0 - e0 * f2)
    return area + normals[facet, 2] * (e0 * f1 - e1 * f0)
