"""Carriers: the input's facets and curves that vertices walk on, and where each of these vertices stands.

A vertex on a surface stands on a *facet* of the input, a triangle, at the barycentric coordinates
(1 - u - w, u, w); one on a curve on a *segment* of the input, at (1 - t, t). Facets lead to each other across
their edges, unless the edge is a feature or one of the two facets has no area; segments lead to each other at
the vertices of their curve.

How far the mesh has come from the input is bounded edge by edge and, for the places where vertices of the
input were, triangle by triangle (see ``overlay``).

All is in the problem's numbering, and laid out in arrays as kernels read them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.boundary.deviation import deviation
from dvr_cli.boundary.freedom import Freedom, unit
from dvr_cli.boundary.manifold import Manifold
from dvr_cli.boundary.smooth_parts import SmoothParts
from dvr_cli.boundary.walls import thickness, width
from dvr_cli.mesh.corners import Corners, Simplices
from dvr_cli.mesh.csr import group, row_entries
from dvr_cli.mesh.facets import numbered
from dvr_cli.mesh.rings import Rings
from dvr_cli.quality.mean_ratio import cell_normals, turned_over

NOWHERE, CURVE, SURFACE = 0, 1, 2  # the kind of carrier a vertex stands on
_OF_WALL = 1.0 / 3.0  # part of the thickness of a wall that the mesh may come from the input by,
_MOST = 1e6  # and how many times distances count there at most
_NO_AREA = 1e-7  # sine of an angle up to which a facet has no inside to walk in


class Ground(NamedTuple):
    """The facets and segments of the input.

    places: (N, 3) where vertices were in the input; in a plane the third coordinate is 0.
    triangles: (T, 3) vertices of each facet. beyond: (T, 3) the facet across the edge opposite each of them,
        -1 where walks end. normals: (T, 3) unit, 0 for a facet without area. patch: (T,) the number of its
        patch. plane: (T,) bool, whether that patch is plane.
    off: (T,) how far each facet is from the input at most, where folded ones were unfolded; 0 elsewhere.
    off_at: (N,) the largest of these around each vertex.
    weight: (T,) how many times distances from each facet count, over 1 where a wall is thin.
    weight_at: (N,) the largest of these around each vertex; heaviest: (1,) the largest of all.
    segments: (S, 2) vertices of each; onward: (S, 2) the segment that goes on beyond each of them, or -1.
    """

    places: np.ndarray
    triangles: np.ndarray
    beyond: np.ndarray
    normals: np.ndarray
    patch: np.ndarray
    plane: np.ndarray
    off: np.ndarray
    off_at: np.ndarray
    weight: np.ndarray
    weight_at: np.ndarray
    heaviest: np.ndarray
    segments: np.ndarray
    onward: np.ndarray


class Stars(NamedTuple):
    """The triangles and edges of the boundary or surface around each vertex.

    Triangles have the numbers of facets: the one is the other's place in the input. An edge is a side of some
    triangle or a segment of a curve.

    triangle_start: (N + 1,), triangle: those around vertex v at triangle_start[v] .. triangle_start[v + 1].
    edge_start: (N + 1,), edge, end: likewise the edges at v, and the vertex at the other end of each.
    of: (E,) for each edge a triangle it is a side of, or -1 - s for one that is segment s of a curve.
    """

    triangle_start: np.ndarray
    triangle: np.ndarray
    edge_start: np.ndarray
    edge: np.ndarray
    end: np.ndarray
    of: np.ndarray


class RingCorners(NamedTuple):
    """The corners of the rings of a surface, entry by entry as ``Rings.others``; empty in other meshes.

    number: (R,) their numbers among the touched corners. triangle: (R,) one that the cell of each is cut in.
    """

    number: np.ndarray
    triangle: np.ndarray


class Standing(NamedTuple):
    """The places where vertices stand, and bounds on the distance from the input. Kernels change it.

    kind: (N,) the carrier of each vertex. at: (N,) its facet or segment, -1 for vertices that do not walk.
    u, w: (N,) where on it; on a segment u is t.
    bound: (E,) how far each edge is from the input at most; these and ``apart`` are weighted.
    first: (T,) the first place of an input vertex that a triangle answers for, -1 for none; following: (N,)
        the next such place; apart: (N,) how far it is from that triangle at most.
    turned: (C,) the touched corners of a surface that are turned over.
    next_bound, next_apart, next_host: scratch for a move that is looked at.
    """

    kind: np.ndarray
    at: np.ndarray
    u: np.ndarray
    w: np.ndarray
    bound: np.ndarray
    first: np.ndarray
    following: np.ndarray
    apart: np.ndarray
    turned: np.ndarray
    next_bound: np.ndarray
    next_apart: np.ndarray
    next_host: np.ndarray


@dataclass(frozen=True, eq=False)
class Carriers:
    """The facets and curves that the vertices of a problem walk on.

    before: (N, d) where vertices were in the input.
    on_surface, on_curve: the vertices that walk. curve: (S,) the number of the curve each segment is of.
    turned: (C,) bool, the touched corners of a surface that are turned over in the input. limit: how far the
    mesh may come from the input. across: (T,) how far the sheet across from each facet is, see
    ``thickness``, in a plane (S,) that from each segment, see ``width``; None before there was a limit.
    """

    ground: Ground
    stars: Stars
    corners: RingCorners
    before: np.ndarray
    on_surface: np.ndarray
    on_curve: np.ndarray
    curve: np.ndarray
    turned: np.ndarray
    limit: float = np.inf
    across: np.ndarray | None = None

    def within(self, limit: float, across: np.ndarray | None = None) -> Carriers:
        """The same with another limit; where a wall is thin it is a third of the thickness at most.

        Distances count more there, so that one limit holds for all. across: as ``across_of`` gives it for
        this limit, by default sought here; for a smaller limit than before no wall is sought again.
        """
        ground, in_plane = self.ground, self.before.shape[1] == 2
        sheets = ground.segments if in_plane else ground.triangles
        weight = np.ones(len(sheets))
        if limit < np.inf:
            reach = limit / _OF_WALL
            if across is None:
                across = self.across
            if across is None or limit > self.limit:
                across = _across(ground.places, ground, ground.plane, self.curve, reach, in_plane)
            weight = np.minimum(np.maximum(reach / np.maximum(across, reach / _MOST), 1.0), _MOST)
        at = np.ones(len(ground.places))
        for column in sheets.T:
            np.maximum.at(at, column, weight)
        of_facets, heaviest = weight[: len(ground.triangles)], np.array([weight.max(initial=1.0)])
        weighed = ground._replace(weight=of_facets, weight_at=at, heaviest=heaviest)
        return replace(self, ground=weighed, limit=limit, across=across)

    def standing(self) -> Standing:
        """Everybody where the input has them."""
        n, ground, stars = len(self.ground.places), self.ground, self.stars
        kind = np.zeros(n, dtype=np.uint8)
        kind[self.on_surface], kind[self.on_curve] = SURFACE, CURVE
        at = np.full(n, -1, dtype=np.int32)
        u, w = np.zeros(n), np.zeros(n)
        # the first facet around with area, and the first segment
        size = (ground.normals != 0.0).any(axis=1)
        for carrier, members, usable in (
            (SURFACE, ground.triangles, size),
            (CURVE, ground.segments, np.ones(len(ground.segments), dtype=bool)),
        ):
            owner, place = np.nonzero((kind[members] == carrier) & usable[:, None])
            at[members[owner, place][::-1]] = owner[::-1]
        walks = np.flatnonzero(at >= 0)
        kind[at < 0] = NOWHERE
        surface = walks[kind[walks] == SURFACE]
        u[surface] = ground.triangles[at[surface], 1] == surface
        w[surface] = ground.triangles[at[surface], 2] == surface
        curve = walks[kind[walks] == CURVE]
        u[curve] = ground.segments[at[curve], 1] == curve
        first = np.full(len(ground.triangles), -1, dtype=np.int32)
        following = np.full(n, -1, dtype=np.int32)
        chain = surface[np.argsort(at[surface], kind="stable")]
        first[at[chain[::-1]]] = chain[::-1]
        same = at[chain[:-1]] == at[chain[1:]]
        following[chain[:-1][same]] = chain[1:][same]
        edges, off = len(stars.of), np.zeros(len(stars.of))
        owner = np.repeat(np.arange(n), np.diff(stars.edge_start))
        np.maximum.at(off, stars.edge, ground.heaviest * ground.off_at[owner])
        return Standing(
            *(kind, at, u, w, off, first, following, ground.weight_at * ground.off_at, self.turned.copy()),
            *(np.zeros(edges), np.zeros(n), np.zeros(n, dtype=np.int32)),
        )

    def deviation(self, standing: Standing, points: np.ndarray) -> float:
        """The largest distance between the surfaces and curves of the input and those at ``points`` (N, d).

        Measured from both sides. standing: where vertices stand, with bounds that hold.
        """
        ground, stars, before = self.ground, self.stars, self.before
        near = np.arange(len(ground.triangles))
        for column in ground.triangles.T[::-1]:
            near = np.where(standing.kind[column] == SURFACE, standing.at[column], near)
        along = np.arange(len(ground.segments))
        for column in ground.segments.T:
            along = np.where(standing.kind[column] == CURVE, standing.at[column], along)
        triangles, segments = self.apart(standing)
        surface = Manifold(before, ground.triangles, ground.patch, (stars.triangle_start, stars.triangle))
        curves = Manifold(before, ground.segments, self.curve)
        return max(
            deviation(surface, points, near, triangles),
            deviation(curves, points, along, segments),
        )

    def tangents(self, standing: Standing, vertices: np.ndarray) -> Freedom:
        """The planes of the facets and the lines of the segments on which vertices (n,) that walk stand."""
        ground, at, d = self.ground, standing.at[vertices], self.before.shape[1]
        dimension, axis = standing.kind[vertices].copy(), np.zeros((len(vertices), d))
        on_curve = dimension == CURVE
        ends = ground.places[ground.segments[at[on_curve]], :d]
        axis[on_curve] = unit(ends[:, 1] - ends[:, 0])
        axis[~on_curve] = ground.normals[at[~on_curve], :d]
        return Freedom(dimension, axis)

    def apart_at(self, standing: Standing) -> np.ndarray:
        """(N,) bounds on how far the edges at each vertex are from the input."""
        stars, bound = self.stars, np.zeros(len(self.ground.places))
        owner = np.repeat(np.arange(len(bound)), np.diff(stars.edge_start))
        np.maximum.at(bound, owner, standing.bound[stars.edge])
        return bound

    def apart_around(self, standing: Standing, vertices: np.ndarray) -> np.ndarray:
        """(n,) the same for some vertices (n,) alone, each with an edge at least."""
        entries, start = row_entries(self.stars.edge_start, vertices)
        return np.maximum.reduceat(standing.bound[self.stars.edge[entries]], start[:-1])

    def apart(self, standing: Standing) -> tuple[np.ndarray, np.ndarray]:
        """Bounds (T,) and (S,) on how far each triangle and segment of the mesh is from the input."""
        ground = self.ground
        triangle = np.zeros(len(ground.triangles))
        bound = self.apart_at(standing)
        if len(triangle):
            triangle = bound[ground.triangles].max(axis=1)
            host = np.flatnonzero(standing.first >= 0)
            place = standing.first[host]
            while len(host):
                np.maximum.at(triangle, host, standing.apart[place])
                place = standing.following[place]
                host, place = host[place >= 0], place[place >= 0]
        return triangle, bound[ground.segments].max(axis=1, initial=0.0)


def carriers_of(
    corners: Corners,
    points: np.ndarray,
    parts: SmoothParts,
    number: np.ndarray,
    rings: Rings,
    touched: Simplices,
    touched_ids: np.ndarray,
    backend: Backend = NUMPY,
) -> Carriers:
    """The carriers of a problem.

    corners, points, parts: of the mesh, whose vertices have the ``number`` (N,) in the problem. rings,
    touched, touched_ids: the problem's. backend: what computes; the result is the same.
    """
    ground = ground_of(points, parts, number, backend)
    before = np.empty_like(parts.before)
    before[number] = parts.before
    of_rings = RingCorners(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    turned = np.zeros(len(touched.vertices), dtype=bool)
    if points.shape[1] > corners.dimension:
        ring = np.full(len(points), -1)
        ring[rings.vertices] = np.arange(len(rings.vertices))
        position, _ = backend.twin(group)(ring[touched.vertices.ravel()], len(rings.vertices))
        cell = np.repeat(np.arange(len(corners.start) - 1), np.diff(corners.start))
        triangle = np.searchsorted(parts.facet, cell)[touched_ids]
        of_rings = RingCorners(position // 3, triangle[position // 3])
        turned = turned_over(points, corners, cell_normals(points, corners))[touched_ids]
    return Carriers(
        ground=ground,
        stars=stars_of(ground, backend),
        corners=of_rings,
        before=before,
        on_surface=number[parts.on_patch],
        on_curve=number[parts.on_curve],
        curve=parts.curve,
        turned=turned,
    )


def ground_of(points: np.ndarray, parts: SmoothParts, number: np.ndarray, backend: Backend) -> Ground:
    """The ground that ``parts`` are.

    points: (N, d) of the input; number: (N,) the problem's of each; backend: what computes.
    """
    places = np.zeros((len(points), 3))
    places[number, : points.shape[1]] = points
    triangles = number[parts.triangles].astype(np.int32).reshape(-1, 3)
    segments = number[parts.segments].astype(np.int32).reshape(-1, 2)
    a, b, c = (places.take(column, axis=0) for column in triangles.T)
    area = np.cross(b - a, c - a)
    size = np.sqrt((area * area).sum(axis=1))
    longest = np.maximum.reduce([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))])
    flat = ~(size > _NO_AREA * longest)
    normals = unit(area)
    normals[flat] = 0.0
    off_at = np.zeros(len(points))
    for column in triangles.T:
        np.maximum.at(off_at, column, parts.off)
    return Ground(
        places=places,
        triangles=triangles,
        beyond=_beyond(triangles, segments, flat, backend),
        normals=normals,
        patch=parts.patch.astype(np.int32),
        plane=_plane_of(parts),
        off=parts.off,
        off_at=off_at,
        weight=np.ones(len(triangles)),
        weight_at=np.ones(len(points)),
        heaviest=np.ones(1),
        segments=segments,
        onward=_onward(segments, number[parts.on_curve], len(points)),
    )


def across_of(points: np.ndarray, parts: SmoothParts, limit: float) -> np.ndarray:
    """The distance of what is across, as ``Carriers.within`` needs it for a limit.

    points: (N, d) of the input. It takes as long as the problem, and does not wait for it.
    """
    places = np.zeros((len(points), 3))
    places[:, : points.shape[1]] = points
    return _across(places, parts, _plane_of(parts), parts.curve, limit / _OF_WALL, points.shape[1] == 2)


def _across(
    places: np.ndarray,
    of: Ground | SmoothParts,
    plane: np.ndarray,
    curve: np.ndarray,
    reach: float,
    in_plane: bool,
) -> np.ndarray:
    """The distance of what is across from each facet, or in a plane each segment, up to ``reach``."""
    if in_plane:
        return width(places, of.segments, curve, reach) if len(of.segments) else np.empty(0)
    if plane.all():
        return np.full(len(plane), np.inf)
    return thickness(places, of.triangles, of.patch, plane, reach)


def _plane_of(parts: SmoothParts) -> np.ndarray:
    """(T,) bool: whether all of a facet's patch is in one plane."""
    plane = parts.plane.copy()
    plane[parts.patch[parts.off > 0.0]] = False
    return plane[parts.patch]


def stars_of(ground: Ground, backend: Backend) -> Stars:
    """The stars of all vertices; backend: what computes."""
    grouped = backend.twin(group)
    n, triangles, segments = len(ground.places), ground.triangles, ground.segments
    position, triangle_start = grouped(triangles.ravel(), n)
    sides = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
    both = np.concatenate([np.sort(segments, axis=1), sides])
    name = numbered(both, backend)
    edges = int(name.max(initial=-1)) + 1
    ends, of = np.empty((edges, 2), dtype=np.int32), np.empty(edges, dtype=np.int32)
    ends[name[::-1]] = both[::-1]
    of[name[len(segments) :]] = np.arange(len(sides)) // 3
    of[name[: len(segments)]] = -1 - np.arange(len(segments))
    at, edge_start = grouped(ends.ravel(), n)
    return Stars(
        triangle_start=triangle_start,
        triangle=(position // 3).astype(np.int32),
        edge_start=edge_start,
        edge=(at // 2).astype(np.int32),
        end=ends.ravel()[at ^ 1],
        of=of,
    )


def _beyond(triangles: np.ndarray, segments: np.ndarray, flat: np.ndarray, backend: Backend) -> np.ndarray:
    """(T, 3) the facet across the edge opposite each vertex; see Ground. flat: (T,) those without area."""
    sides = triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    name = numbered(np.concatenate([sides, segments]), backend)
    n = int(name.max(initial=-1)) + 1
    parted = np.zeros(n, dtype=bool)
    parted[name[len(sides) :]] = True
    position, start = backend.twin(group)(name[: len(sides)], n)
    pair = start[:-1][(np.diff(start) == 2) & ~parted]
    one, other = position[pair], position[pair + 1]
    passable = ~flat[one // 3] & ~flat[other // 3]
    one, other = one[passable], other[passable]
    beyond = np.full(3 * len(triangles), -1, dtype=np.int32)
    beyond[one], beyond[other] = other // 3, one // 3
    return beyond.reshape(-1, 3)


def _onward(segments: np.ndarray, inner: np.ndarray, n: int) -> np.ndarray:
    """(S, 2) the segment beyond each end, see Ground; inner: the vertices at which curves go on."""
    position, start = group(segments.ravel(), n)
    first = start[inner]
    one, other = position[first], position[first + 1]
    onward = np.full(2 * len(segments), -1, dtype=np.int32)
    onward[one], onward[other] = other // 2, one // 2
    return onward.reshape(-1, 2)
