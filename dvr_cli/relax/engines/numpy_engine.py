"""The NumPy engine: updates all vertices of a batch at once, in chunks that stay in cache."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from dvr_cli.backend import NUMPY
from dvr_cli.mesh.simplex import Components, dot, opposite_normal, subtract
from dvr_cli.quality.badness import badness, worst_corner
from dvr_cli.quality.mean_ratio import weighted_norm
from dvr_cli.relax.columns import RingChunk, ring_chunks
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.line import coefficients, improves, maximise_minimum
from dvr_cli.relax.newton import FALL, Shapes, corners_at, newton
from dvr_cli.relax.polish import Aim, keeps, lowest_price, price, weights_at
from dvr_cli.relax.problem import Problem
from dvr_cli.relax.steepest import steepest


class NumpyEngine(Engine):
    """Keeps coordinates by component, and each batch cut into chunks once and for all."""

    backend = NUMPY

    def __init__(self, problem: Problem, threads: int = 1) -> None:
        """threads: one is used, whatever is asked for."""
        super().__init__(problem)
        self._dimension = problem.dimension
        self._coordinates = np.empty((0, problem.components)).T
        parts = [problem.parts(batch) for batch in range(self.batches)]
        self._batches = [list(ring_chunks(problem, lo, walking)) for lo, walking, _ in parts]

    def _set(self, points: np.ndarray) -> None:
        self._coordinates = np.ascontiguousarray(points).T  # as kernels read them

    def _get(self) -> np.ndarray:
        return self._coordinates.T

    def _worst_corner(self) -> tuple[int, float]:
        return worst_corner(self._get(), self.problem.touched)

    def _relax(self, batch: int, lo: int, hi: int, directions: np.ndarray, enough: float) -> int:
        moving = directions.any(axis=1)
        return sum(self._relax_chunk(chunk, directions, enough) for chunk in self._chunks(batch, moving))

    def _steepest(self, batch: int, lo: int, hi: int, band: float, active: np.ndarray) -> None:
        self._directions[lo:hi] = 0.0
        for chunk in self._chunks(batch, active):
            x, ends, norm, slope, _, factor = self._ring(chunk)
            found = steepest(x, ends, norm, slope, self._within(chunk), band, factor)
            self._directions[chunk.rings] = np.stack(found, axis=1)

    def _polish(self, batch: int, lo: int, hi: int, limit: float, aim: Aim, active: np.ndarray) -> int:
        return sum(self._polish_chunk(chunk, limit, aim) for chunk in self._chunks(batch, active))

    def _chunks(self, batch: int, active: Any) -> Iterator[RingChunk]:
        """The chunks of a batch, without the rings that are not ``active`` ((m,) bool)."""
        for chunk in self._batches[batch]:
            keep = np.flatnonzero(active[chunk.rings])
            if len(keep):
                yield chunk if len(keep) == len(chunk.rings) else chunk.of(keep)

    def _within(self, chunk: RingChunk) -> tuple[np.ndarray, list[np.ndarray]] | None:
        """The lines and planes of the chunk's vertices, as ``freedom.project`` takes them."""
        freedom = self.problem.freedom
        if freedom is None:
            return None
        return freedom.dimension[chunk.rings] == 1, list(freedom.axis[chunk.rings].T)

    def _ring(
        self, chunk: RingChunk
    ) -> tuple[
        list[np.ndarray],
        list[list[np.ndarray]],
        list[np.ndarray],
        list[np.ndarray],
        np.ndarray,
        list[np.ndarray] | None,
    ]:
        """x, ends, norm, slope, curvature and factor of the chunk's rings, as ``line.coefficients`` takes
        them.
        """
        table = self.problem.touched.table
        norm = list(table.norm[chunk.shapes].transpose(2, 0, 1))
        slope = list(table.slope[chunk.shapes].transpose(2, 0, 1))
        ends = [[component[end] for component in self._coordinates] for end in chunk.ends]
        x = [component[chunk.vertices] for component in self._coordinates]
        return x, ends, norm, slope, table.curvature[chunk.shapes], table.factors(chunk.shapes)

    def _relax_chunk(self, chunk: RingChunk, directions: np.ndarray, enough: float) -> int:
        x, ends, norm, slope, curvature, factor = self._ring(chunk)
        direction = list(directions[chunk.rings].T)
        lines = coefficients(x, direction, ends, norm, slope, curvature, factor)
        step, before = maximise_minimum(lines)
        if enough > 0.0:
            from dvr_cli.relax.enough import nearest

            step = nearest(lines, step, enough)
        moving = np.flatnonzero(step != 0.0)
        if not len(moving):
            return 0
        target, v, s = self._at_target(x, direction, step, ends, norm, factor, moving)
        with np.errstate(all="ignore"):
            after = badness(v, s, self._dimension).max(axis=0)
        better = improves(before[moving], after, self._dimension)
        return self._move(chunk, moving, target, better)

    def _polish_chunk(self, chunk: RingChunk, limit: float, aim: Aim) -> int:
        """Move the vertices of a chunk by Newton's steps, or along them to the lowest price."""
        x, ends, norm, _, _, factor = ring = self._ring(chunk)
        shapes, d = Shapes(*ring[2:]), self._dimension
        corners = corners_at(x, ends, shapes)
        with np.errstate(all="ignore"):
            largest = badness(corners.v, corners.s, d).max(axis=0)
            weights = weights_at(corners.v, corners.s, aim, d)
            before = price(corners.v, corners.s, chunk.real, weights, aim, d)
            way, slope = newton(corners, shapes, self._within(chunk), chunk.real, weights, aim)
        moving = np.flatnonzero((largest < np.inf) & (slope < 0.0) & (slope > -np.inf))
        if not len(moving):
            return 0
        floor = np.maximum(largest, limit) if aim.by_ring else np.full(len(largest), limit)
        target, v, s = self._at_target(x, way, np.ones(len(slope)), ends, norm, factor, moving)
        with np.errstate(all="ignore"):
            largest = badness(v, s, d).max(axis=0)
            after = price(v, s, chunk.real[:, moving], weights[:, moving], aim, d)
            good = keeps(before[moving], after, largest, floor[moving], d)
            good &= after <= before[moving] + FALL * slope[moving]
        moved, others = self._move(chunk, moving, target, good), moving[~good]
        if not len(others):
            return moved
        return moved + self._polish_on_lines(chunk.of(others), [w[others] for w in way], limit, aim)

    def _polish_on_lines(self, chunk: RingChunk, direction: Components, limit: float, aim: Aim) -> int:
        """Move the vertices of a chunk to the lowest price in their direction (d components (n,))."""
        x, ends, norm, slope, curvature, factor = self._ring(chunk)
        lines = coefficients(x, direction, ends, norm, slope, curvature, factor)
        step, before, weights, floor = lowest_price(lines, chunk.real, limit, aim)
        moving = np.flatnonzero(step != 0.0)
        if not len(moving):
            return 0
        target, v, s = self._at_target(x, direction, step, ends, norm, factor, moving)
        with np.errstate(all="ignore"):
            largest = badness(v, s, self._dimension).max(axis=0)
            after = price(v, s, chunk.real[:, moving], weights[:, moving], aim, self._dimension)
        better = keeps(before[moving], after, largest, floor[moving], self._dimension)
        return self._move(chunk, moving, target, better)

    def _at_target(
        self,
        x: Components,
        direction: Components,
        step: np.ndarray,
        ends: Sequence[Components],
        norm: Sequence[np.ndarray],
        factor: Sequence[np.ndarray] | None,
        moving: np.ndarray,
    ) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """The targets of a chunk's vertices ``moving``, as rounded, and v and s of their corners there."""
        target = [xi[moving] + step[moving] * di[moving] for xi, di in zip(x, direction, strict=True)]
        ends = [[component[:, moving] for component in end] for end in ends]
        edges = [subtract(end, target) for end in ends]
        if norm[0].size > 1:
            norm = [row[:, moving] for row in norm]
            factor = None if factor is None else [row[:, moving] for row in factor]
        return target, dot(edges[0], opposite_normal(ends)), weighted_norm(edges, norm, factor)

    def _move(self, chunk: RingChunk, moving: np.ndarray, target: Components, better: np.ndarray) -> int:
        moved = chunk.vertices[moving[better]]
        for component, value in zip(self._coordinates, target, strict=True):
            component[moved] = value[better]
        return len(moved)
