"""Projection: relaxing the vertices of curved boundaries and surfaces (the paper's Algorithm 3).

A vertex moves in the tangent plane of its patch, or along the tangent of its curve, to the best point of its
line, and from there to the nearest point of the input patch or curve. It stays there if the ring's minimum
quality has grown and the boundary has nowhere come farther from the input than the bound; else half the way
is tried, and so on. So the quality vector never decreases (Theorem 4.10).

In a surface mesh every vertex is moved this way, and corners are triangles in space. Such a corner is
inverted when its normal points away from that of the input surface at the point nearest to its centre.

There is one implementation, in NumPy: which engine relaxes the other vertices makes no difference.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from dvr_cli.boundary.freedom import Freedom, unit
from dvr_cli.boundary.smooth_parts import SmoothParts
from dvr_cli.boundary.tracking import Probe, Track
from dvr_cli.mesh.corners import Corners
from dvr_cli.mesh.csr import group
from dvr_cli.mesh.simplex import Components, cross, dot, opposite_normal, subtract
from dvr_cli.quality.badness import badness
from dvr_cli.quality.mean_ratio import cell_normals, corner_qualities, turned_over, weighted_norm
from dvr_cli.relax.columns import RingChunk, ring_chunks
from dvr_cli.relax.directions import DirectionField
from dvr_cli.relax.line import Lines, coefficients, improves, maximise_minimum, surface_coefficients
from dvr_cli.relax.problem import build_problem

_TRIES = 4  # steps tried, each at most half as long as the one before


class Projection:
    """The projected vertices of a mesh, their schedule, and the curves and surfaces they move on."""

    def __init__(
        self,
        corners: Corners,
        points: np.ndarray,
        parts: SmoothParts,
        field: DirectionField,
        limit: float,
        order: str = "coloured",
        seed: int = 0,
    ) -> None:
        """corners, points (N, d): of the mesh. field: given directions, of which vertices take the tangential
        part. limit: how far from the input the boundary may be found at the points that are looked at.

        order, seed: as for ``build_problem``, which numbers the vertices as it does for the engines.
        """
        self._input = points
        self._parts = parts
        self._field = field
        self._limit = limit
        self.problem = problem = build_problem(corners, parts.projected, points, order, seed)
        self._is_surface = points.shape[1] > corners.dimension
        number = np.empty(len(points), dtype=np.int64)
        number[problem.order] = np.arange(len(points))
        self._on_curve = np.zeros(len(points), dtype=bool)
        self._on_curve[number[parts.on_curve]] = True
        self.inverted = np.zeros(len(corners.vertices), dtype=bool)
        if self._is_surface:
            self.inverted = turned_over(points, corners, cell_normals(points, corners))
            ring = np.full(len(points), -1)
            ring[problem.rings.vertices] = np.arange(len(problem.rings.vertices))
            position, _ = group(ring[problem.touched.vertices.ravel()], len(problem.rings.vertices))
            self._corner = problem.touched_ids[position // 3]  # of each entry of the rings
            cell = np.repeat(np.arange(len(corners.start) - 1), np.diff(corners.start))
            self._triangle = np.searchsorted(parts.facet, cell)  # one each corner's cell is cut in
        places = points[problem.order]
        self._surface = Track(places, number[parts.triangles], parts.patch, number[parts.on_patch])
        self._curve = Track(places, number[parts.segments], parts.curve, number[parts.on_curve])
        self._at = np.zeros(len(points), dtype=np.int64)  # the input simplex that each vertex is on
        for track, moving in ((self._surface, parts.on_patch), (self._curve, parts.on_curve)):
            facets, start = track.star(number[moving])
            self._at[number[moving]] = facets[start[:-1]]
        self._batches = [list(ring_chunks(problem, lo, hi)) for lo, hi in pairwise(problem.batch_start)]

    def sweep(self, sweep: int, points: np.ndarray) -> Iterator[int]:
        """Relax each vertex once in ``points`` ((N, d), the problem's numbering), batch by batch.

        sweep: its number k from 0. Yields how many vertices of each batch moved.
        """
        directions = self._field(sweep, points[self.problem.rings.vertices], self.problem.relaxed)
        assert isinstance(directions, np.ndarray)
        for batch in self._batches:
            yield sum(self._relax_chunk(chunk, points, directions[chunk.rings]) for chunk in batch)

    def q1(self, points: np.ndarray) -> float:
        """The worst quality of a corner with a projected vertex; points: (N, d), the problem's numbering."""
        qualities = corner_qualities(
            points, self.problem.touched, inverted=self.inverted[self.problem.touched_ids]
        )
        return float(qualities.min(initial=np.inf))

    def deviation(self, points: np.ndarray) -> float:
        """The largest distance between the input's curves and surfaces and those at ``points`` (N, d)."""
        before, after = self._input[self.problem.order], points[self.problem.order]
        return max(track.deviation(before, after) for track in (self._surface, self._curve))

    def _relax_chunk(self, chunk: RingChunk, points: np.ndarray, directions: np.ndarray) -> int:
        vertices, x = chunk.vertices, points[chunk.vertices]
        along = self._tangential(points, vertices, directions)
        ends = [[component[end] for component in points.T] for end in chunk.ends]
        corner = self._corners_of(chunk)
        lines = self._lines(x, along, ends, chunk.shapes, corner)
        step, before = maximise_minimum(lines)
        rest = np.flatnonzero(step != 0.0)
        moved = 0
        for _ in range(_TRIES):
            if not len(rest):
                break
            target, simplex = self._projected(vertices[rest], x[rest] + step[rest, None] * along[rest])
            here = [[component[:, rest] for component in end] for end in ends]
            shapes = chunk.shapes[:, rest] if chunk.shapes.size > 1 else chunk.shapes
            after = self._largest_badness(target, here, shapes)
            good = np.flatnonzero(improves(before[rest], after, self.problem.dimension))
            here = [[component[:, good] for component in end] for end in here]
            good = good[self._upright(target[good], here, corner[:, rest[good]])]
            probes = self._probes(points, vertices[rest[good]], target[good])
            apart = np.zeros(len(good))
            for rows, _, probe in probes:
                apart[rows] = np.maximum(apart[rows], probe.apart)
            near = apart <= self._limit
            for rows, track, probe in probes:
                track.accept(probe, near[rows])
            factor = np.full(len(rest), 0.5)
            far = good[~near]
            factor[far] = np.clip(self._limit / apart[~near], 0.1, 0.5)
            good = good[near]
            points[vertices[rest[good]]] = target[good]
            self._at[vertices[rest[good]]] = simplex[good]
            self.inverted[corner[:, rest[good]]] = False
            moved += len(good)
            step[rest] *= factor
            rest = np.delete(rest, good)
        return moved

    def _corners_of(self, chunk: RingChunk) -> np.ndarray:
        """(K, n) the numbers of the corners in the rings of a chunk, in a volume mesh all 0."""
        if not self._is_surface:
            return np.zeros((1, len(chunk.rings)), dtype=np.int64)
        start, sizes = self.problem.rings.start[chunk.rings], self.problem.rings.sizes[chunk.rings]
        return self._corner[start + np.minimum(np.arange(chunk.ends.shape[1])[:, None], sizes - 1)]

    def _tangential(self, points: np.ndarray, vertices: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """The part of the directions (n, d) in the tangent plane or along the tangent at each vertex, unit.

        The plane is that of the vector area of the facets around the vertex, the tangent bisects its ridges.
        """
        axis = np.zeros_like(directions)
        curve = self._on_curve[vertices]
        for rows, track in ((~curve, self._surface), (curve, self._curve)):
            facets, start = track.star(vertices[rows])
            if not len(facets):
                continue
            a, *others = (points[corner] for corner in track.facets[facets].T)
            if len(others) == 2:
                around = np.cross(others[0] - a, others[1] - a)
                # facets within the mesh are stored either way round
                reference = np.repeat(around[start[:-1]], np.diff(start), axis=0)
                around[(around * reference).sum(axis=1) < 0.0] *= -1.0
            else:
                around = unit(others[0] - a)
                # from one neighbour to the other, whichever way round the two ridges are stored
                ahead = track.facets[facets, 0] == np.repeat(vertices[rows], np.diff(start))
                second = np.arange(len(facets)) > np.repeat(start[:-1], np.diff(start))
                around[ahead != second] *= -1.0
            axis[rows] = unit(np.add.reduceat(around, start[:-1]))
        freedom = Freedom(np.where(curve, np.uint8(1), np.uint8(2)), axis)
        return freedom.directions(directions, np.arange(len(vertices)))

    def _projected(self, vertices: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The points (n, d) of the input nearest to the targets, and the simplices (n,) they are on."""
        simplex = self._at[vertices]
        curve = self._on_curve[vertices]
        result = targets.copy()
        for rows, track in ((~curve, self._surface), (curve, self._curve)):
            if rows.any():
                result[rows], simplex[rows], _ = track.manifold.nearest(targets[rows], simplex[rows])
        return result, simplex

    def _probes(
        self, points: np.ndarray, vertices: np.ndarray, targets: np.ndarray
    ) -> list[tuple[np.ndarray, Track, Probe]]:
        """The consequences of moving the vertices to the targets, for the surface and for curves."""
        curve = np.flatnonzero(self._on_curve[vertices])
        everywhere = np.arange(len(vertices))
        tracks = [(everywhere, self._surface)] if len(self._surface.facets) else []
        tracks += [(curve, self._curve)] if len(curve) else []
        return [
            (rows, track, track.probe(points, vertices[rows], targets[rows]))
            for rows, track in tracks
            if len(rows)
        ]

    def _lines(
        self,
        x: np.ndarray,
        along: np.ndarray,
        ends: Sequence[Components],
        shapes: np.ndarray,
        corner: np.ndarray,
    ) -> Lines:
        """The lines of rings with the ``corner`` numbers (K, n)."""
        table = self.problem.touched.table
        norm, slope = table.norm[shapes].transpose(2, 0, 1), table.slope[shapes].transpose(2, 0, 1)
        parts = norm, slope, table.curvature[shapes]
        if self._is_surface:
            return surface_coefficients(list(x.T), list(along.T), ends, self.inverted[corner], *parts)
        return coefficients(list(x.T), list(along.T), ends, *parts)

    def _largest_badness(self, x: np.ndarray, ends: Sequence[Components], shapes: np.ndarray) -> np.ndarray:
        """(n,) the badness of the worst corner of each ring with its vertex at ``x`` (n, d)."""
        norm = self.problem.touched.table.norm[shapes].transpose(2, 0, 1)
        edges = [subtract(end, list(x.T)) for end in ends]
        if self._is_surface:
            area = cross(*edges)
            v = np.sqrt(dot(area, area))
        else:
            v = dot(edges[0], opposite_normal(ends))
        with np.errstate(all="ignore"):  # a degenerate corner is not positive, whatever s/v says
            return badness(v, weighted_norm(edges, norm), self.problem.dimension).max(axis=0)

    def _upright(self, x: np.ndarray, ends: Sequence[Components], corner: np.ndarray) -> np.ndarray:
        """(n,) bool: whether no triangle of the ring with its vertex at ``x`` (n, 3) is turned over."""
        if not self._is_surface:
            return np.ones(len(x), dtype=bool)
        one, other = (np.stack(np.broadcast_arrays(*end), axis=-1) for end in ends)
        centre = (x + one + other) / 3.0
        hints = self._surface.foot[self._triangle[corner]]
        _, foot, _ = self._surface.manifold.nearest(centre.reshape(-1, 3), hints.ravel())
        normal = self._surface.manifold.normals[foot].reshape(centre.shape)
        return ((np.cross(one - x, other - x) * normal).sum(axis=2) > 0.0).all(axis=0)
