"""Overlay: a bound on how far a mesh whose vertices walk has come from the input.

Lay the mesh's edges over the input's facets: the plane through an edge and the mean normal at its ends cuts
facet after facet from one end to the other, and each input edge it crosses matches a point of the mesh's
edge. With the places of input vertices matched to triangles of the mesh likewise, the two surfaces are cut
into pieces on which the matching is affine, and the distance convex; so the largest distance at the crossings
and at these places bounds it everywhere, both ways. On curves the same holds in one dimension.

A vertex that moves by δ takes the points of its star along by δ at most. So while the last bound plus what
was moved since stays within the limit nothing needs to be traced.

Where a wall is thin distances are multiplied by a weight (see ``Carriers.within``), so that one limit holds
for all of the mesh.

These are kernels, written for one edge, place or star at a time; ``overlay_numba`` has them compiled.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from dvr_cli.relax.surface.carriers import CURVE, SURFACE, Ground, Standing, Stars
from dvr_cli.relax.surface.ring import bare

_SHIFT = 1e-7  # by which a trace begins nearer to its facet's middle: no vertex or edge is in its way there
_FACETS = 256  # facets or segments a trace may cross


def look(
    points: np.ndarray,
    vertex: int,
    moved: float,
    limit: float,
    ground: Ground,
    stars: Stars,
    standing: Standing,
) -> float:
    """The weighted distance from the input at most around a vertex that has just ``moved`` so far.

    Leaves what was found as ``next_bound``, ``next_apart`` and ``next_host``; ends early beyond the limit.
    """
    largest = 0.0
    bounds, next_bound, edges = standing.bound, standing.next_bound, stars.edge
    grown = ground.heaviest[0] * moved
    for entry in range(stars.edge_start[vertex], stars.edge_start[vertex + 1]):
        edge = edges[entry]
        bound = bounds[edge] + grown
        if bound > limit:
            bound = edge_distance(points, edge, vertex, stars.end[entry], ground, stars, standing)
        next_bound[edge] = bound
        largest = max(largest, bound)
        if largest > limit:
            return largest
    triangles, first, following = stars.triangle, standing.first, standing.following
    aparts, next_apart, next_host = standing.apart, standing.next_apart, standing.next_host
    for entry in range(stars.triangle_start[vertex], stars.triangle_start[vertex + 1]):
        triangle = triangles[entry]
        place = first[triangle]
        while place >= 0:
            apart = aparts[place] + ground.weight_at[place] * moved
            host = triangle
            if apart > limit:
                apart, host = place_distance(points, place, vertex, ground, stars)
            next_apart[place] = apart
            next_host[place] = host
            largest = max(largest, apart)
            if largest > limit:
                return largest
            place = following[place]
    return largest


def take_over(vertex: int, stars: Stars, standing: Standing) -> None:
    """Keep what ``look`` has found around a vertex."""
    bounds, next_bound, edges = standing.bound, standing.next_bound, stars.edge
    for entry in range(stars.edge_start[vertex], stars.edge_start[vertex + 1]):
        bounds[edges[entry]] = next_bound[edges[entry]]
    first, following, next_host = standing.first, standing.following, standing.next_host
    aparts, next_apart, triangles = standing.apart, standing.next_apart, stars.triangle
    chain = -1
    for entry in range(stars.triangle_start[vertex], stars.triangle_start[vertex + 1]):
        place = first[triangles[entry]]
        first[triangles[entry]] = -1
        while place >= 0:
            after = following[place]
            following[place] = chain
            chain, place = place, after
    while chain >= 0:
        after, host = following[chain], next_host[chain]
        aparts[chain] = next_apart[chain]
        following[chain], first[host] = first[host], chain
        chain = after


def renew(points: np.ndarray, ground: Ground, stars: Stars, standing: Standing) -> None:
    """Trace all edges and find all places anew, as far as that brings the bounds down.

    A place gets the triangle that is nearest to it: that which had it may have moved away from it.
    """
    points, ground, stars, standing = bare(points), bare(ground), bare(stars), bare(standing)
    for vertex in range(len(ground.places)):
        for entry in range(stars.edge_start[vertex], stars.edge_start[vertex + 1]):
            edge, end = stars.edge[entry], stars.end[entry]
            if end > vertex and standing.bound[edge] > 0.0:
                found = edge_distance(points, edge, vertex, end, ground, stars, standing)
                standing.bound[edge] = min(standing.bound[edge], found)
    first, following, host = standing.first, standing.following, standing.next_host
    for triangle in range(len(ground.triangles)):
        place = first[triangle]
        while place >= 0:
            host[place] = triangle
            if standing.apart[place] > 0.0:
                found, host[place] = _nearest_host(points, place, triangle, ground, stars)
                standing.apart[place] = min(standing.apart[place], found)
            place = following[place]
        first[triangle] = -1
    for place in range(len(ground.places)):
        if standing.kind[place] == SURFACE:
            following[place] = first[host[place]]
            first[host[place]] = place


def _nearest_host(
    points: np.ndarray, place: int, triangle: int, ground: Ground, stars: Stars
) -> tuple[float, int]:
    """The weighted distance of an input vertex's place from a triangle near one, and that triangle.

    It has no neighbour, at an edge or a vertex, that is nearer.
    """
    least, host = distance_to(points, place, triangle, ground), triangle
    for _ in range(_FACETS):
        last = host
        for k in range(3):
            found, near = place_distance(points, place, ground.triangles[last, k], ground, stars)
            if found < least:
                least, host = found, near
        if host == last:
            break
    return least, host


def edge_distance(
    points: np.ndarray,
    edge: int,
    vertex: int,
    end: int,
    ground: Ground,
    stars: Stars,
    standing: Standing,
) -> float:
    """A bound on the weighted distance of an edge, from ``vertex`` to ``end``, infinite without a trace."""
    of = stars.of[edge]
    if of < 0:
        return _along_curve(points, -1 - of, vertex, end, ground, standing)
    patch = ground.patch[of]
    if ground.plane[of]:
        return 0.0
    if standing.kind[vertex] != SURFACE and standing.kind[end] == SURFACE:
        vertex, end = end, vertex
    count, one, other = 0, vertex, vertex
    if standing.kind[vertex] != SURFACE:
        count, one, other = _support(vertex, ground, standing)
    # of two that stand on curves or stay: begin in each facet around the one, till a trace leads to the other
    for entry in range(stars.triangle_start[one], stars.triangle_start[one + 1]):
        facet = standing.at[vertex] if count == 0 else stars.triangle[entry]
        if count == 0 or (_has(ground.triangles, facet, other) and ground.patch[facet] == patch):
            found = _trace(points, facet, vertex, end, ground, standing)
            if found < np.inf or count == 0:
                return found
    return np.inf


def place_distance(
    points: np.ndarray, place: int, vertex: int, ground: Ground, stars: Stars
) -> tuple[float, int]:
    """The weighted distance of an input vertex's place from a star's nearest triangle, and that triangle."""
    least, host = np.inf, -1
    for entry in range(stars.triangle_start[vertex], stars.triangle_start[vertex + 1]):
        triangle = stars.triangle[entry]
        found = distance_to(points, place, triangle, ground)
        if found < least or host < 0:
            least, host = found, triangle
    return least, host


def distance_to(points: np.ndarray, place: int, triangle: int, ground: Ground) -> float:
    """The weighted distance of the place of a ground's vertex, and of the input there, from a triangle."""
    i, j, k = ground.triangles[triangle, 0], ground.triangles[triangle, 1], ground.triangles[triangle, 2]
    x0, x1, x2 = ground.places[place, 0], ground.places[place, 1], ground.places[place, 2]
    a0, a1, a2 = points[i, 0] - x0, points[i, 1] - x1, points[i, 2] - x2
    b0, b1, b2 = points[j, 0] - x0, points[j, 1] - x1, points[j, 2] - x2
    c0, c1, c2 = points[k, 0] - x0, points[k, 1] - x1, points[k, 2] - x2
    off, weight = ground.off_at[place], ground.weight_at[place]
    e0, e1, e2 = b0 - a0, b1 - a1, b2 - a2
    f0, f1, f2 = c0 - a0, c1 - a1, c2 - a2
    n0, n1, n2 = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
    square = n0 * n0 + n1 * n1 + n2 * n2
    # the sides as seen from the foot in the triangle's plane; the nearest place is on one it lies beyond
    ab = n0 * (a1 * b2 - a2 * b1) + n1 * (a2 * b0 - a0 * b2) + n2 * (a0 * b1 - a1 * b0)
    bc = n0 * (b1 * c2 - b2 * c1) + n1 * (b2 * c0 - b0 * c2) + n2 * (b0 * c1 - b1 * c0)
    ca = n0 * (c1 * a2 - c2 * a1) + n1 * (c2 * a0 - c0 * a2) + n2 * (c0 * a1 - c1 * a0)
    if square > 0.0 and ab >= 0.0 and bc >= 0.0 and ca >= 0.0:
        return weight * (abs(a0 * n0 + a1 * n1 + a2 * n2) / sqrt(square) + off)
    least = np.inf
    if not (square > 0.0 and ab >= 0.0):
        least = _to_segment(a0, a1, a2, b0, b1, b2)
    if not (square > 0.0 and bc >= 0.0):
        least = min(least, _to_segment(b0, b1, b2, c0, c1, c2))
    if not (square > 0.0 and ca >= 0.0):
        least = min(least, _to_segment(c0, c1, c2, a0, a1, a2))
    return weight * (sqrt(least) + off)


def _to_segment(a0: float, a1: float, a2: float, b0: float, b1: float, b2: float) -> float:
    """The squared distance of the origin from the segment from a to b."""
    e0, e1, e2 = b0 - a0, b1 - a1, b2 - a2
    square = e0 * e0 + e1 * e1 + e2 * e2
    t = 0.0
    if square > 0.0:
        t = min(max(-(a0 * e0 + a1 * e1 + a2 * e2) / square, 0.0), 1.0)
    r0, r1, r2 = a0 + t * e0, a1 + t * e1, a2 + t * e2
    return r0 * r0 + r1 * r1 + r2 * r2


def _support(vertex: int, ground: Ground, standing: Standing) -> tuple[int, int, int]:
    """The vertices of the input in whose hull a vertex stands: how many, and the first two.

    A facet that has them all has the vertex, too. Of a vertex inside a facet there are three.
    """
    at = standing.at[vertex]
    if at < 0:
        return 1, vertex, vertex
    u, w = standing.u[vertex], standing.w[vertex]
    if standing.kind[vertex] == CURVE:
        segments = ground.segments
        if u == 0.0 or u == 1.0:
            node = segments[at, 1 if u == 1.0 else 0]
            return 1, node, node
        return 2, segments[at, 0], segments[at, 1]
    triangles, rest = ground.triangles, 1.0 - u - w
    count, one, other = 0, -1, -1
    for k in range(3):
        if (rest if k == 0 else (u if k == 1 else w)) != 0.0:
            count += 1
            one, other = other, triangles[at, k]
    return count, one if count > 1 else other, other


def _has(triangles: np.ndarray, facet: int, node: int) -> bool:
    return triangles[facet, 0] == node or triangles[facet, 1] == node or triangles[facet, 2] == node


def _trace(
    points: np.ndarray, facet: int, vertex: int, end: int, ground: Ground, standing: Standing
) -> float:
    """The weighted largest distance at the crossings from ``vertex``, in or at a facet, to ``end``."""
    places, triangles, beyond, normals = ground.places, ground.triangles, ground.beyond, ground.normals
    goal = standing.at[end] if standing.kind[end] == SURFACE else -1
    count, one, other = _support(end, ground, standing)
    off, weight = ground.off[facet], ground.weight[facet]
    if facet == goal or (count < 3 and _has(triangles, facet, one) and _has(triangles, facet, other)):
        return weight * off
    x0, x1, x2 = points[vertex, 0], points[vertex, 1], points[vertex, 2]
    e0, e1, e2 = points[end, 0] - x0, points[end, 1] - x1, points[end, 2] - x2
    square = e0 * e0 + e1 * e1 + e2 * e2
    if not square > 0.0:
        return np.inf
    m0, m1, m2 = normals[facet, 0], normals[facet, 1], normals[facet, 2]
    if goal >= 0:
        sign = normals[goal, 0] * m0 + normals[goal, 1] * m1 + normals[goal, 2] * m2
        sign = 1.0 if sign >= 0.0 else -1.0
        m0 = m0 + sign * normals[goal, 0]
        m1 = m1 + sign * normals[goal, 1]
        m2 = m2 + sign * normals[goal, 2]
    k0, k1, k2 = e1 * m2 - e2 * m1, e2 * m0 - e0 * m2, e0 * m1 - e1 * m0
    i, j, h = triangles[facet, 0], triangles[facet, 1], triangles[facet, 2]
    out = -1
    y0 = x0 + _SHIFT * ((places[i, 0] + places[j, 0] + places[h, 0]) / 3.0 - x0)
    y1 = x1 + _SHIFT * ((places[i, 1] + places[j, 1] + places[h, 1]) / 3.0 - x1)
    y2 = x2 + _SHIFT * ((places[i, 2] + places[j, 2] + places[h, 2]) / 3.0 - x2)
    i, j, h = triangles[facet, 0], triangles[facet, 1], triangles[facet, 2]
    si = (places[i, 0] - y0) * k0 + (places[i, 1] - y1) * k1 + (places[i, 2] - y2) * k2
    sj = (places[j, 0] - y0) * k0 + (places[j, 1] - y1) * k1 + (places[j, 2] - y2) * k2
    sh = (places[h, 0] - y0) * k0 + (places[h, 1] - y1) * k1 + (places[h, 2] - y2) * k2
    # the edge ahead, from p to q: that of the two on the plane which is farther along
    p, q, sp, sq, far = -1, -1, 0.0, 0.0, 0.0
    for k in range(3):
        if (si > 0.0) != (sj > 0.0):
            r = si / (si - sj)
            t = (places[i, 0] + r * (places[j, 0] - places[i, 0]) - x0) * e0
            t = t + (places[i, 1] + r * (places[j, 1] - places[i, 1]) - x1) * e1
            t = t + (places[i, 2] + r * (places[j, 2] - places[i, 2]) - x2) * e2
            if p < 0 or t > far:
                p, q, sp, sq, far, out = i, j, si, sj, t, (k + 2) % 3
        i, j, h = j, h, i
        si, sj, sh = sj, sh, si
    if p < 0:
        return np.inf
    largest = 0.0
    for _ in range(_FACETS):
        r = sp / (sp - sq)
        c0 = places[p, 0] + r * (places[q, 0] - places[p, 0]) - x0
        c1 = places[p, 1] + r * (places[q, 1] - places[p, 1]) - x1
        c2 = places[p, 2] + r * (places[q, 2] - places[p, 2]) - x2
        t = min(max((c0 * e0 + c1 * e1 + c2 * e2) / square, 0.0), 1.0)
        c0, c1, c2 = c0 - t * e0, c1 - t * e1, c2 - t * e2
        largest = max(largest, c0 * c0 + c1 * c1 + c2 * c2)
        facet = beyond[facet, out]
        if facet < 0:
            return np.inf
        off, weight = max(off, ground.off[facet]), max(weight, ground.weight[facet])
        if facet == goal or (count < 3 and _has(triangles, facet, one) and _has(triangles, facet, other)):
            return weight * (sqrt(largest) + off)
        top = 0  # of the vertices of the facet reached, that which is not on the edge crossed
        if triangles[facet, 1] != p and triangles[facet, 1] != q:
            top = 1
        elif triangles[facet, 2] != p and triangles[facet, 2] != q:
            top = 2
        h = triangles[facet, top]
        sh = (places[h, 0] - y0) * k0 + (places[h, 1] - y1) * k1 + (places[h, 2] - y2) * k2
        # on over the edge from h to q or from p to h, whichever the plane cuts
        last = p if (sp > 0.0) == (sh > 0.0) else q
        if last == p:
            p, sp = h, sh
        else:
            q, sq = h, sh
        out = 0
        if triangles[facet, 1] == last:
            out = 1
        elif triangles[facet, 2] == last:
            out = 2
    return np.inf


def _along_curve(
    points: np.ndarray, segment: int, vertex: int, end: int, ground: Ground, standing: Standing
) -> float:
    """The weighted largest distance of the curve's vertices between the ends of an edge from that edge."""
    if standing.kind[vertex] != CURVE:
        vertex, end = end, vertex
    if standing.kind[vertex] != CURVE:
        return 0.0
    least = np.inf  # of the two ways along the curve
    for side in range(2):
        at, largest, toward = standing.at[vertex], 0.0, side
        for _ in range(_FACETS):
            if _on_segment(at, end, ground, standing):
                least = min(least, largest)
                break
            node = ground.segments[at, toward]
            largest = max(largest, _from_edge(points, node, vertex, end, ground))
            after = ground.onward[at, toward]
            if after < 0 or after == standing.at[vertex]:
                break
            toward = 1 if ground.segments[after, 0] == node else 0
            at = after
    return sqrt(least)


def _on_segment(segment: int, end: int, ground: Ground, standing: Standing) -> bool:
    count, one, _ = _support(end, ground, standing)
    if count == 2:
        return standing.at[end] == segment
    return ground.segments[segment, 0] == one or ground.segments[segment, 1] == one


def _from_edge(points: np.ndarray, node: int, vertex: int, end: int, ground: Ground) -> float:
    """The weighted squared distance of an input vertex's place from the edge from ``vertex`` to ``end``."""
    a2 = b2 = 0.0
    if points.shape[1] == 3:
        a2, b2 = points[vertex, 2] - ground.places[node, 2], points[end, 2] - ground.places[node, 2]
    a0, a1 = points[vertex, 0] - ground.places[node, 0], points[vertex, 1] - ground.places[node, 1]
    b0, b1 = points[end, 0] - ground.places[node, 0], points[end, 1] - ground.places[node, 1]
    weight = ground.weight_at[node]
    return weight * weight * _to_segment(a0, a1, a2, b0, b1, b2)
