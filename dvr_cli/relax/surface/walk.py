"""The walk: a vertex on a surface or curve moves along a direction, from facet to facet of the input.

In the plane of a facet the direction is a line, and the line problem is solved on it as everywhere. If the
best place lies within the facet the vertex stays there; else it goes to the facet's edge, into the facet
beyond, with its direction unfolded about that edge, and on from there while the ring gets better. At a vertex
of the input it goes round, facet by facet, to the one whose wedge has the direction. So it is on the input's
surface by construction, cannot jump through a thin wall, and needs no nearest point. On curves the same holds
in one dimension.

At the end the ring is evaluated again: the vertex stays there if its minimum quality has grown (or its price
has fallen, above the floor), no triangle of a surface or of a volume's boundary has turned over against the
facets its vertices stand on, no altitude is below the bound, and the mesh is nowhere farther from the input
than the limit. Else the walk is tried again, shorter.

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
    CURVATURE,
    END,
    GRADIENT,
    NORM,
    NORMAL,
    S0,
    S1,
    S2,
    SIGN,
    SLOPE,
    V0,
    V1,
    bare,
    best_step,
    dimension_of,
    hull_direction,
    improves,
    keeps,
    lowest_step,
    new_scratch,
    padded,
    price_of,
    set_gradient,
    set_lines,
    set_place,
    set_shapes,
    set_shares,
    worst_of,
)
from dvr_cli.relax.surface.strides import (
    CROSSINGS,
    Vector,
    along_carrier,
    cross,
    go,
    go_out,
    put,
    tangent,
    way_out,
)

_TRIES = 4  # walks tried, each at most half as long as the one before
_STILL = (0.0, 0.0, 0.0)  # the direction of a vertex that is not to move
_PRODUCT = END + 6  # where others have a third end: the vector product of a triangle's edges at the vertex


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
    d, components = dimension_of(rings), points.shape[1]
    keep = 1.0 - band
    keep = keep if d == 2 else keep * keep * keep
    for ring in range(start, stop):
        vertex = rings.vertices[ring]
        for i in range(components):
            directions[ring, i] = 0.0
        if standing.at[vertex] < 0 or not active[ring]:
            continue
        n = lay_out(walk, ring, _STILL, scratch)
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
    d, components = dimension_of(rings), points.shape[1]
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
        a0, a1, a2 = tangent(at, ground)
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
    vertex, d = rings.vertices[ring], dimension_of(rings)
    at, u, w = standing.at[vertex], standing.u[vertex], standing.w[vertex]
    x0, x1 = points[vertex, 0], points[vertex, 1]
    x2 = points[vertex, 2] if points.shape[1] == 3 else 0.0
    d0, d1, d2, step, before, floor = _first_step(walk, directions, ring, purpose, scratch)
    if not step > 0.0:
        return False
    limit, longest = purpose.limit, np.inf
    for _ in range(_TRIES):
        walked = _walk(walk, ring, (d0, d1, d2), step, longest, purpose, floor, scratch)
        if walked == 0.0:
            put(points, vertex, x0, x1, x2)
            standing.at[vertex], standing.u[vertex], standing.w[vertex] = at, u, w
            return False
        n = _lay_out_place(walk, ring, scratch)
        largest = scratch[BADNESS, worst_of(scratch, n, d)]
        if purpose.polishing:
            better = keeps(before, price_of(scratch, n, d, purpose.aim), largest, floor, d)
        else:
            better = improves(before, largest, d)
        if purpose.altitude > 0.0:
            better = better and keeps_altitude(points, vertex, n, d, purpose.altitude, scratch)
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
        put(points, vertex, x0, x1, x2)
        standing.at[vertex], standing.u[vertex], standing.w[vertex] = at, u, w
    return False


def keeps_altitude(
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


def _first_step(
    walk: Walk, directions: np.ndarray, ring: int, purpose: Purpose, scratch: np.ndarray
) -> tuple[float, float, float, float, float, float]:
    """The direction in which a vertex begins to walk, and how far along it the best place is, 0.0 for here.

    Returned with these are the largest badness or the price at the beginning, and the badness at its floor.
    """
    points, rings, ground, standing = walk.points, walk.rings, walk.ground, walk.standing
    vertex, d = rings.vertices[ring], dimension_of(rings)
    d0, d1 = directions[ring, 0], directions[ring, 1]
    d2 = directions[ring, 2] if points.shape[1] == 3 else 0.0
    d0, d1, d2 = along_carrier(vertex, d0, d1, d2, ground, standing)
    if d0 == 0.0 and d1 == 0.0 and d2 == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    floor = purpose.floor
    n = lay_out(walk, ring, (d0, d1, d2), scratch)
    if purpose.polishing:
        step, before, floor = lowest_step(scratch, n, d, floor, purpose.aim, True)
    else:
        step, before = best_step(scratch, n, d)
    if step < 0.0:
        return -d0, -d1, -d2, -step, before, floor
    return d0, d1, d2, step, before, floor


def _walk(
    walk: Walk,
    ring: int,
    direction: Vector,
    step: float,
    longest: float,
    purpose: Purpose,
    floor: float,
    scratch: np.ndarray,
) -> float:
    """Walk a vertex along its direction to the best place, not farther than ``longest``; how far it went.

    direction, step, floor: see ``_first_step``.
    """
    points, rings, ground, standing = walk.points, walk.rings, walk.ground, walk.standing
    vertex, d = rings.vertices[ring], dimension_of(rings)
    d0, d1, d2 = direction
    walked, came = 0.0, -1
    for crossing in range(CROSSINGS):
        way, out, rates = way_out(vertex, d0, d1, d2, came, ground, standing)
        if crossing > 0:
            step = np.inf
            if way > 0.0:
                n = _lay_out_lines(walk, ring, (d0, d1, d2), scratch)
                if purpose.polishing:
                    step, _, _ = lowest_step(scratch, n, d, floor, purpose.aim, False)
                else:
                    step, _ = best_step(scratch, n, d)
                if not step > 0.0:
                    break
        rest = longest - walked
        step = min(step, rest)
        if step <= way:
            go(points, vertex, (d0, d1, d2), rates, step, ground, standing)
            walked += step
            break
        go_out(points, vertex, rates, way, out, ground, standing)
        walked += way
        d0, d1, d2, came = cross(vertex, d0, d1, d2, out, ground, standing)
        if came < 0:
            break
    return walked


def lay_out(walk: Walk, ring: int, direction: Vector, scratch: np.ndarray) -> int:
    """Lay out a ring and its lines; corners of a surface that turned over in the input are negative there."""
    rings = walk.rings
    if walk.points.shape[1] != dimension_of(rings):
        points, others, lo = walk.points, rings.others, rings.start[ring]
        columns = bare(scratch)
        number, turned = walk.corners.number, walk.standing.turned
        for c in range(set_shapes(ring, rings, scratch)):
            p, q = others[lo + c, 0], others[lo + c, 1]
            for i in range(3):
                columns[END + i, c], columns[END + 3 + i, c] = points[p, i], points[q, i]
            columns[SIGN, c] = -1.0 if turned[number[lo + c]] else 1.0
    return _lay_out_lines(walk, ring, direction, scratch)


def _lay_out_lines(walk: Walk, ring: int, direction: Vector, scratch: np.ndarray) -> int:
    """Lay out the lines of a ring that was laid out before, of which only its vertex has moved since."""
    points, rings, ground, standing = walk.points, walk.rings, walk.ground, walk.standing
    d0, d1, d2 = direction
    vertex = rings.vertices[ring]
    if points.shape[1] == dimension_of(rings):
        return set_lines(points, vertex, d0, d1, d2, ring, rings, scratch)
    h0 = h1 = h2 = 0.0  # the normal of a triangle of no area: that of the facet
    if standing.kind[vertex] == SURFACE:
        at = standing.at[vertex]
        h0, h1, h2 = ground.normals[at, 0], ground.normals[at, 1], ground.normals[at, 2]
    n, columns = _lay_out_place(walk, ring, scratch), bare(scratch)
    x0, x1, x2 = points[vertex, 0], points[vertex, 1], points[vertex, 2]
    square = d0 * d0 + d1 * d1 + d2 * d2
    for c in range(padded(n)):
        e0, e1, e2 = columns[END, c] - x0, columns[END + 1, c] - x1, columns[END + 2, c] - x2
        f0, f1, f2 = columns[END + 3, c] - x0, columns[END + 4, c] - x1, columns[END + 5, c] - x2
        along = columns[SLOPE, c] * (d0 * e0 + d1 * e1 + d2 * e2)
        along = along + columns[SLOPE + 1, c] * (d0 * f0 + d1 * f1 + d2 * f2)
        columns[S1, c] = -along
        columns[S2, c] = columns[CURVATURE, c] * square
    for c in range(padded(n)):
        size, sign = columns[V0, c], columns[SIGN, c]
        a0, a1, a2 = columns[_PRODUCT, c], columns[_PRODUCT + 1, c], columns[_PRODUCT + 2, c]
        a0 = sign * (a0 / size if size > 0.0 else h0)
        a1 = sign * (a1 / size if size > 0.0 else h1)
        a2 = sign * (a2 / size if size > 0.0 else h2)
        g0, g1 = columns[END + 3, c] - columns[END, c], columns[END + 4, c] - columns[END + 1, c]
        g2 = columns[END + 5, c] - columns[END + 2, c]
        n0, n1, n2 = g1 * a2 - g2 * a1, g2 * a0 - g0 * a2, g0 * a1 - g1 * a0
        columns[NORMAL, c], columns[NORMAL + 1, c], columns[NORMAL + 2, c] = n0, n1, n2
        columns[V0, c] = sign * size
        columns[V1, c] = -(d0 * n0 + d1 * n1 + d2 * n2)
    return n


def _lay_out_place(walk: Walk, ring: int, scratch: np.ndarray) -> int:
    """As ``_lay_out_lines``, without lines, and positive however the corners of a surface lie."""
    points, rings = walk.points, walk.rings
    vertex, n = rings.vertices[ring], rings.start[ring + 1] - rings.start[ring]
    if points.shape[1] == dimension_of(rings):
        set_place(points, vertex, ring, rings, scratch)
        return n
    columns = bare(scratch)
    x0, x1, x2 = points[vertex, 0], points[vertex, 1], points[vertex, 2]
    for c in range(padded(n)):
        e0, e1, e2 = columns[END, c] - x0, columns[END + 1, c] - x1, columns[END + 2, c] - x2
        f0, f1, f2 = columns[END + 3, c] - x0, columns[END + 4, c] - x1, columns[END + 5, c] - x2
        a0, a1, a2 = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
        s = columns[NORM, c] * (e0 * e0 + e1 * e1 + e2 * e2)
        s = s + columns[NORM + 1, c] * (f0 * f0 + f1 * f1 + f2 * f2)
        s = s + columns[NORM + 2, c] * (e0 * f0 + e1 * f1 + e2 * f2)
        columns[_PRODUCT, c], columns[_PRODUCT + 1, c], columns[_PRODUCT + 2, c] = a0, a1, a2
        columns[V0, c] = sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        columns[S0, c] = s
    return n


def _upright(walk: Walk, ring: int, x: Vector, at: int) -> bool:
    """True if no triangle around a vertex turned over as it came here from x on facet ``at``.

    These are the corners of a surface's ring, or the facets of a volume's boundary. A triangle is upright if
    its normal is on the side of those of the facets that its vertices stand on; if none of them stands on
    one, of that of the facet it was in the input.
    """
    points, rings, corners, standing = walk.points, walk.rings, walk.corners, walk.standing
    stars, triangles, normals = walk.stars, walk.ground.triangles, walk.ground.normals
    vertex, on_surface = rings.vertices[ring], len(corners.number) > 0
    others, number, turned = rings.others, corners.number, standing.turned
    kind, stands = standing.kind, standing.at
    x0, x1, x2 = x
    y0, y1 = points[vertex, 0], points[vertex, 1]
    y2 = points[vertex, 2] if points.shape[1] == 3 else 0.0
    start, stop = stars.triangle_start[vertex], stars.triangle_start[vertex + 1]
    if on_surface:
        start, stop = rings.start[ring], rings.start[ring + 1]
    for entry in range(start, stop):
        down = False
        if on_surface:
            p, q, facet = others[entry, 0], others[entry, 1], corners.triangle[entry]
            down = turned[number[entry]]
        else:
            facet = stars.triangle[entry]
            k = _place_in(triangles, facet, vertex)
            p, q = triangles[facet, (k + 1) % 3], triangles[facet, (k + 2) % 3]
        e0, e1, e2 = points[p, 0] - y0, points[p, 1] - y1, points[p, 2] - y2
        f0, f1, f2 = points[q, 0] - y0, points[q, 1] - y1, points[q, 2] - y2
        a0, a1, a2 = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
        sides = 0
        for k in range(3):
            member = vertex if k == 0 else (p if k == 1 else q)
            if kind[member] != SURFACE:
                continue
            sides += 1
            after = stands[member]
            before = at if k == 0 else after
            if not normals[after, 0] * a0 + normals[after, 1] * a1 + normals[after, 2] * a2 > 0.0 and (
                down or side(points, x0, x1, x2, p, q, before, normals) > 0.0
            ):
                return False
        if (
            sides == 0
            and not side(points, y0, y1, y2, p, q, facet, normals) > 0.0
            and (on_surface or side(points, x0, x1, x2, p, q, facet, normals) > 0.0)
        ):
            return False
    return True


def _place_in(triangles: np.ndarray, triangle: int, vertex: int) -> int:
    """The place of a vertex among the three of a triangle."""
    if triangles[triangle, 0] == vertex:
        return 0
    return 1 if triangles[triangle, 1] == vertex else 2


def side(
    points: np.ndarray, x0: float, x1: float, x2: float, p: int, q: int, facet: int, normals: np.ndarray
) -> float:
    """The area of the triangle x, p, q as seen from above a facet, positive if it is upright there."""
    e0, e1, e2 = points[p, 0] - x0, points[p, 1] - x1, points[p, 2] - x2
    f0, f1, f2 = points[q, 0] - x0, points[q, 1] - x1, points[q, 2] - x2
    area = normals[facet, 0] * (e1 * f2 - e2 * f1)
    area = area + normals[facet, 1] * (e2 * f0 - e0 * f2)
    return area + normals[facet, 2] * (e0 * f1 - e1 * f0)
