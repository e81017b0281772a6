"""Joint moves: the vertices of a patch, some of which walk, go together to the places found for them.

The solver of patches sees a vertex that walks in the plane of its facet or on the line of its segment. Here
each of them goes its way on the input, so it is on the surface or curve again, however that bends. Then all
rings of the patch are evaluated: the vertices stay there if the patch's smallest quality has grown, no
altitude is below the bound, no triangle of a surface or of a volume's boundary has turned over, and the mesh
is nowhere farther from the input than the limit. Else the move is tried again, shorter.

Untangling moves many vertices at once, in rings that are not positive yet. There each goes its way as well,
and what comes too far from the input, or turns a facet of the boundary over, goes a shorter way by itself.

A point of an edge or triangle moves no farther than the farthest of its vertices does, so bounds on the
distance grow by that at most, as in ``overlay``, until they have to be found anew.

In the plane the edges of curves must not be turned round likewise. On the hollow side of one all triangles
may be positive and go round a vertex twice, with an edge reversed.

These are kernels, for one patch; ``joint_numba`` has them compiled. A patch writes what belongs to its own
vertices, edges and triangles, and reads nothing that another patch of the round writes.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from dvr_cli.relax.surface.carriers import CURVE, SURFACE, Ground, Standing
from dvr_cli.relax.surface.overlay import edge_distance, place_distance
from dvr_cli.relax.surface.ring import BADNESS, bare, dimension_of, improves, new_scratch, worst_of
from dvr_cli.relax.surface.strides import CROSSINGS, along_carrier, cross, go, go_out, put, tangent, way_out
from dvr_cli.relax.surface.walk import Walk, keeps_altitude, lay_out, side

_TRIES = 6  # moves tried, each half as long as the one before
_STOPS = 64  # and then with those staying that are at fault, and again: what is beside them may be next
_STILL = (0.0, 0.0, 0.0)


def move_jointly(
    walk: Walk,
    chosen: np.ndarray,
    moves: np.ndarray,
    slot: np.ndarray,
    limit: float,
    altitude: float,
    largest_ring: int,
) -> tuple[float, float]:
    """Move the vertices of a patch if that makes its smallest quality grow and keeps to the rules.

    chosen: (n,) the rings of its vertices; moves: (n, d) how far each is to go, in a straight line or from
    facet to facet. slot: (N,) the number of each vertex among those that move, negative for all that stay.
    limit: how far the mesh may come from the input. altitude: that below which no element may come, 0.0 for
    none. largest_ring: corners in a ring at most.

    Returns the largest badness of the patch before and after, the same if nothing moved.
    """
    walk, chosen, moves, slot = bare(walk), bare(chosen), bare(moves), bare(slot)
    points, vertices, n = walk.points, walk.rings.vertices, len(chosen)
    scratch = new_scratch(largest_ring)
    before = _largest(walk, chosen, 0.0, scratch)
    if before == np.inf:
        return before, before
    start, uw, stood, far = np.zeros((n, 3)), np.empty((n, 2)), np.empty(n, np.int64), np.empty(n)
    for i in range(n):
        _remember(walk, vertices[chosen[i]], i, start, uw, stood)
    down, part = _turned_over(walk, chosen), 1.0
    for _ in range(_TRIES):
        for i in range(n):
            _go_part(walk, vertices[chosen[i]], moves, i, part)
            far[i] = _distance(points, vertices[chosen[i]], i, start)
        after = _largest(walk, chosen, altitude, scratch)
        better = improves(before, after, dimension_of(walk.rings)) and _upright(walk, chosen)
        if better and _keeps_sides(walk, chosen, slot, down) and _look(walk, chosen, far, slot, limit):
            _take_over(walk, chosen, slot)
            return before, after
        for i in range(n):
            _return(walk, vertices[chosen[i]], i, start, uw, stood)
        part *= 0.5
    return before, before


def go_jointly(walk: Walk, chosen: np.ndarray, moves: np.ndarray, slot: np.ndarray, limit: float) -> None:
    """Move vertices together, each as far as no rule for boundaries is in its way.

    chosen, moves, slot, limit: as in ``move_jointly``. What is at fault where the mesh would come farther
    from the input than the limit, or a facet of a boundary would turn over against those that its vertices
    stand on, goes half as far, and again, and in the end stays. Other vertices go all the way.
    """
    walk, chosen, moves, slot = bare(walk), bare(chosen), bare(moves), bare(slot)
    points, vertices, stars = walk.points, walk.rings.vertices, walk.stars
    n = len(chosen)
    start, uw, stood, far = np.zeros((n, 3)), np.empty((n, 2)), np.empty(n, np.int64), np.empty(n)
    part, fault, again = np.ones(n), np.ones(n, np.bool_), np.ones(n, np.bool_)
    down = _turned_over(walk, chosen)
    for i in range(n):
        _remember(walk, vertices[chosen[i]], i, start, uw, stood)
    for look in range(_TRIES + _STOPS):
        for i in range(n):
            if fault[i]:
                _return(walk, vertices[chosen[i]], i, start, uw, stood)
                _go_part(walk, vertices[chosen[i]], moves, i, part[i])
                far[i] = _distance(points, vertices[chosen[i]], i, start)
        if _faultless(walk, chosen, far, slot, limit, down, fault, again):
            _take_over(walk, chosen, slot)
            return
        for i in range(n):
            again[i] = fault[i]
        for i in range(n):
            if fault[i]:
                part[i] = 0.5 * part[i] if look < _TRIES else 0.0
                vertex = vertices[chosen[i]]
                for entry in range(stars.edge_start[vertex], stars.edge_start[vertex + 1]):
                    if slot[stars.end[entry]] >= 0:
                        again[slot[stars.end[entry]]] = True
    for i in range(n):
        _return(walk, vertices[chosen[i]], i, start, uw, stood)


def _remember(walk: Walk, vertex: int, i: int, start: np.ndarray, uw: np.ndarray, stood: np.ndarray) -> None:
    """Note where a vertex is, for ``_return``."""
    points, standing = walk.points, walk.standing
    for j in range(points.shape[1]):
        start[i, j] = points[vertex, j]
    stood[i], uw[i, 0], uw[i, 1] = standing.at[vertex], standing.u[vertex], standing.w[vertex]


def _return(walk: Walk, vertex: int, i: int, start: np.ndarray, uw: np.ndarray, stood: np.ndarray) -> None:
    """Put a vertex back."""
    standing = walk.standing
    put(walk.points, vertex, start[i, 0], start[i, 1], start[i, 2])
    standing.at[vertex], standing.u[vertex], standing.w[vertex] = stood[i], uw[i, 0], uw[i, 1]


def _distance(points: np.ndarray, vertex: int, i: int, start: np.ndarray) -> float:
    """The distance of a vertex from where it was."""
    square = 0.0
    for j in range(points.shape[1]):
        square += (points[vertex, j] - start[i, j]) * (points[vertex, j] - start[i, j])
    return sqrt(square)


def _largest(walk: Walk, chosen: np.ndarray, altitude: float, scratch: np.ndarray) -> float:
    """The largest badness in these rings, infinite where an altitude is below the one given."""
    points, d, largest = walk.points, dimension_of(walk.rings), 0.0
    for i in range(len(chosen)):
        n = lay_out(walk, chosen[i], _STILL, scratch)
        largest = max(largest, scratch[BADNESS, worst_of(scratch, n, d)])
        vertex = walk.rings.vertices[chosen[i]]
        if altitude > 0.0 and not keeps_altitude(points, vertex, n, d, altitude, scratch):
            return np.inf
    return largest


def _go_part(walk: Walk, vertex: int, moves: np.ndarray, i: int, part: float) -> None:
    """Move a vertex by a part of its move, from facet to facet if it walks, to the end of the way at most."""
    points, ground, standing = walk.points, walk.ground, walk.standing
    d0, d1 = part * moves[i, 0], part * moves[i, 1]
    d2 = part * moves[i, 2] if points.shape[1] == 3 else 0.0
    if standing.at[vertex] < 0:
        x2 = points[vertex, 2] + d2 if points.shape[1] == 3 else 0.0
        put(points, vertex, points[vertex, 0] + d0, points[vertex, 1] + d1, x2)
        return
    rest, came = sqrt(d0 * d0 + d1 * d1 + d2 * d2), -1
    if not 0.0 < rest < np.inf:
        return
    d0, d1, d2 = along_carrier(vertex, d0 / rest, d1 / rest, d2 / rest, ground, standing)
    if d0 == 0.0 and d1 == 0.0 and d2 == 0.0:
        return
    for _ in range(CROSSINGS):
        way, out, rates = way_out(vertex, d0, d1, d2, came, ground, standing)
        if rest <= way:
            go(points, vertex, (d0, d1, d2), rates, rest, ground, standing)
            return
        go_out(points, vertex, rates, way, out, ground, standing)
        rest -= way
        d0, d1, d2, came = cross(vertex, d0, d1, d2, out, ground, standing)
        if came < 0:
            return


def _upright(walk: Walk, chosen: np.ndarray) -> bool:
    """True if all triangles of a surface's patch are upright against the facets that their vertices stand on.

    One none of whose vertices stands on a facet has to be so against the facet it was in the input.
    """
    points, rings, corners, standing = walk.points, walk.rings, walk.corners, walk.standing
    if not len(corners.number):
        return True
    others, normals = rings.others, walk.ground.normals
    for i in range(len(chosen)):
        vertex = rings.vertices[chosen[i]]
        x0, x1, x2 = points[vertex, 0], points[vertex, 1], points[vertex, 2]
        for entry in range(rings.start[chosen[i]], rings.start[chosen[i] + 1]):
            p, q = others[entry, 0], others[entry, 1]
            stand = 0
            for k in range(3):
                member = vertex if k == 0 else others[entry, k - 1]
                if standing.kind[member] == SURFACE:
                    stand += 1
                    if not side(points, x0, x1, x2, p, q, standing.at[member], normals) > 0.0:
                        return False
            if stand == 0 and not side(points, x0, x1, x2, p, q, corners.triangle[entry], normals) > 0.0:
                return False
    return True


def _facet_upright(walk: Walk, triangle: int) -> bool:
    """True if a facet of a boundary is upright against those that its vertices stand on; see ``_upright``."""
    points, ground, standing = walk.points, walk.ground, walk.standing
    a, b, c = ground.triangles[triangle, 0], ground.triangles[triangle, 1], ground.triangles[triangle, 2]
    x0, x1, x2 = points[a, 0], points[a, 1], points[a, 2]
    stand = 0
    for k in range(3):
        member = ground.triangles[triangle, k]
        if standing.kind[member] == SURFACE:
            stand += 1
            if not side(points, x0, x1, x2, b, c, standing.at[member], ground.normals) > 0.0:
                return False
    return stand > 0 or bool(side(points, x0, x1, x2, b, c, triangle, ground.normals) > 0.0)


def _edge_upright(walk: Walk, edge: int) -> bool:
    """True if an edge of a curve in the plane runs as the segments do that its ends stand on.

    If neither stands on one it has to run as in the input.
    """
    points, ground, standing = walk.points, walk.ground, walk.standing
    segment = -1 - walk.stars.of[edge]
    a, b = ground.segments[segment, 0], ground.segments[segment, 1]
    e0, e1 = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    stand = 0
    for k in range(2):
        member = ground.segments[segment, k]
        if standing.kind[member] == CURVE:
            stand += 1
            t0, t1, _ = tangent(standing.at[member], ground)
            if not t0 * e0 + t1 * e1 > 0.0:
                return False
    t0, t1, _ = tangent(segment, ground)
    return stand > 0 or bool(t0 * e0 + t1 * e1 > 0.0)


def _turned_over(walk: Walk, chosen: np.ndarray) -> np.ndarray:
    """The facets around vertices of a volume's boundary that are turned over where they are, (T,) bool.

    In the plane these are edges, (E,) bool.
    """
    vertices, stars = walk.rings.vertices, walk.stars
    in_plane = walk.points.shape[1] == 2
    down = np.zeros(len(stars.of) if in_plane else len(walk.ground.triangles), np.bool_)
    if len(walk.corners.number):
        return down
    for i in range(len(chosen)):
        vertex = vertices[chosen[i]]
        if in_plane:
            for entry in range(stars.edge_start[vertex], stars.edge_start[vertex + 1]):
                down[stars.edge[entry]] = not _edge_upright(walk, stars.edge[entry])
            continue
        for entry in range(stars.triangle_start[vertex], stars.triangle_start[vertex + 1]):
            down[stars.triangle[entry]] = not _facet_upright(walk, stars.triangle[entry])
    return down


def _keeps_sides(walk: Walk, chosen: np.ndarray, slot: np.ndarray, down: np.ndarray) -> bool:
    """True if no facet or edge is turned over but those that were, ``down``, see ``_turned_over``."""
    vertices, ground, stars = walk.rings.vertices, walk.ground, walk.stars
    if len(walk.corners.number):
        return True
    for i in range(len(chosen)):
        vertex = vertices[chosen[i]]
        if walk.points.shape[1] == 2:
            for entry in range(stars.edge_start[vertex], stars.edge_start[vertex + 1]):
                if not (down[stars.edge[entry]] or _edge_upright(walk, stars.edge[entry])):
                    return False
            continue
        for entry in range(stars.triangle_start[vertex], stars.triangle_start[vertex + 1]):
            triangle = stars.triangle[entry]
            first = _has_first(triangle, vertex, slot, ground)
            if first and not (down[triangle] or _facet_upright(walk, triangle)):
                return False
    return True


def _faultless(
    walk: Walk,
    chosen: np.ndarray,
    far: np.ndarray,
    slot: np.ndarray,
    limit: float,
    down: np.ndarray,
    fault: np.ndarray,
    again: np.ndarray,
) -> bool:
    """True if vertices that have moved keep to all rules; ``fault`` becomes whether each does not.

    down: facets that were turned over before, see ``_turned_over``. again: (n,) the vertices that have to be
    looked at. Leaves what was found as ``_look`` does.
    """
    vertices, ground, stars = walk.rings.vertices, walk.ground, walk.stars
    good, in_plane = True, walk.points.shape[1] == 2
    for i in range(len(chosen)):
        fault[i] = False
    for i in range(len(chosen)):
        if not again[i]:
            continue
        vertex = vertices[chosen[i]]
        if walk.standing.at[vertex] >= 0:
            for entry in range(stars.edge_start[vertex], stars.edge_start[vertex + 1]):
                edge = stars.edge[entry]
                keeps = not in_plane or down[edge] or _edge_upright(walk, edge)
                if not (_edge_keeps(walk, entry, vertex, far, slot, limit) and keeps):
                    good, fault[i] = False, True
        for entry in range(stars.triangle_start[vertex], stars.triangle_start[vertex + 1]):
            triangle = stars.triangle[entry]
            if not _has_first(triangle, vertex, slot, ground):
                continue
            keeps = down[triangle] or _facet_upright(walk, triangle)
            if not (_places_keep(walk, triangle, far, slot, limit) and keeps):
                good = False
                for k in range(3):
                    if slot[ground.triangles[triangle, k]] >= 0:
                        fault[slot[ground.triangles[triangle, k]]] = True
    return good


def _look(walk: Walk, chosen: np.ndarray, far: np.ndarray, slot: np.ndarray, limit: float) -> bool:
    """True if the mesh around vertices that have just moved ``far`` ((n,) each) is within the limit.

    Leaves what was found as ``next_bound``, ``next_apart`` and ``next_host``.
    """
    vertices, ground, stars = walk.rings.vertices, walk.ground, walk.stars
    for i in range(len(chosen)):
        vertex = vertices[chosen[i]]
        if walk.standing.at[vertex] < 0:
            continue
        for entry in range(stars.edge_start[vertex], stars.edge_start[vertex + 1]):
            if not _edge_keeps(walk, entry, vertex, far, slot, limit):
                return False
    for i in range(len(chosen)):
        vertex = vertices[chosen[i]]
        for entry in range(stars.triangle_start[vertex], stars.triangle_start[vertex + 1]):
            triangle = stars.triangle[entry]
            first = _has_first(triangle, vertex, slot, ground)
            if first and not _places_keep(walk, triangle, far, slot, limit):
                return False
    return True


def _edge_keeps(walk: Walk, entry: int, vertex: int, far: np.ndarray, slot: np.ndarray, limit: float) -> bool:
    """True if the edge of an entry of the star of a vertex that moved is within the limit."""
    points, ground, stars, standing = walk.points, walk.ground, walk.stars, walk.standing
    edge, end = stars.edge[entry], stars.end[entry]
    moved = far[slot[vertex]]
    if slot[end] >= 0:
        moved = max(moved, far[slot[end]])
    bound = standing.bound[edge] + ground.heaviest[0] * moved
    if bound > limit:
        bound = edge_distance(points, edge, vertex, end, ground, stars, standing)
    standing.next_bound[edge] = bound
    return bool(bound <= limit)


def _places_keep(walk: Walk, triangle: int, far: np.ndarray, slot: np.ndarray, limit: float) -> bool:
    """True if all places that a triangle answers for find one within the limit."""
    place = walk.standing.first[triangle]
    while place >= 0:
        if not _finds(walk, place, triangle, far, slot, limit):
            return False
        place = walk.standing.following[place]
    return True


def _finds(walk: Walk, place: int, triangle: int, far: np.ndarray, slot: np.ndarray, limit: float) -> bool:
    """True if the place of an input vertex is within the limit of its triangle, or of one around it."""
    points, ground, stars, standing = walk.points, walk.ground, walk.stars, walk.standing
    moved = 0.0
    for k in range(3):
        number = slot[ground.triangles[triangle, k]]
        if number >= 0:
            moved = max(moved, far[number])
    apart, host = standing.apart[place] + ground.weight_at[place] * moved, triangle
    if apart > limit:
        apart = np.inf
        for k in range(3):
            member = ground.triangles[triangle, k]
            if slot[member] >= 0:  # all its triangles belong to the patch
                found, near = place_distance(points, place, member, ground, stars)
                if found < apart:
                    apart, host = found, near
    standing.next_apart[place], standing.next_host[place] = apart, host
    return bool(apart <= limit)


def _has_first(triangle: int, vertex: int, slot: np.ndarray, ground: Ground) -> bool:
    """True if no vertex of a triangle that moves comes before this one among its vertices."""
    for k in range(3):
        member = ground.triangles[triangle, k]
        if slot[member] >= 0:
            return bool(member == vertex)
    return False


def _take_over(walk: Walk, chosen: np.ndarray, slot: np.ndarray) -> None:
    """Keep what ``_look`` has found around the vertices that moved."""
    vertices, ground, stars, standing = walk.rings.vertices, walk.ground, walk.stars, walk.standing
    chain = -1
    for i in range(len(chosen)):
        vertex = vertices[chosen[i]]
        if standing.at[vertex] >= 0:
            for entry in range(stars.edge_start[vertex], stars.edge_start[vertex + 1]):
                standing.bound[stars.edge[entry]] = standing.next_bound[stars.edge[entry]]
        for entry in range(stars.triangle_start[vertex], stars.triangle_start[vertex + 1]):
            triangle = stars.triangle[entry]
            if _has_first(triangle, vertex, slot, ground):
                chain = _unhost(triangle, chain, standing)
    while chain >= 0:
        after, host = standing.following[chain], standing.next_host[chain]
        standing.apart[chain] = standing.next_apart[chain]
        standing.following[chain], standing.first[host] = standing.first[host], chain
        chain = after


def _unhost(triangle: int, chain: int, standing: Standing) -> int:
    """Put the places that a triangle answers for before those of a chain; returns the chain's new first."""
    place = standing.first[triangle]
    standing.first[triangle] = -1
    while place >= 0:
        after = standing.following[place]
        standing.following[place] = chain
        chain, place = place, after
    return chain
