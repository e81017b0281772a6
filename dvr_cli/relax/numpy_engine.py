"""The NumPy engine: updates all vertices of a batch at once, in chunks that stay in cache."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dvr_cli.mesh.corners import SHAPES
from dvr_cli.mesh.simplex import Components, chunks, dot, edges_and_determinant, opposite_normal, subtract
from dvr_cli.quality.mean_ratio import weighted_norm
from dvr_cli.relax.engine import Engine
from dvr_cli.relax.line import badness, coefficients, improves, maximise_minimum
from dvr_cli.relax.problem import Problem

_CHUNK_CORNERS = 32768  # corners worked on at a time: small enough for the cache, large enough for NumPy


@dataclass(frozen=True)
class _Chunk:
    """Independent vertices with rings of similar size, short rings padded with their last corner.

    rings: (n,) their numbers among the problem's rings.
    vertices: (n,); ends: (d, K, n) other vertices of each corner; shapes: (K, n) or (1, 1) if all are equal.
    """

    rings: np.ndarray
    vertices: np.ndarray
    ends: np.ndarray
    shapes: np.ndarray


class NumpyEngine(Engine):
    """Keeps coordinates by component, and each batch cut into chunks once and for all."""

    name = "numpy"

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self._dimension = problem.dimension
        self._coordinates = np.empty((problem.dimension, 0))
        self._batches = [list(_chunks(problem, lo, hi)) for lo, hi in pairwise(problem.batch_start.tolist())]

    def _set(self, points: np.ndarray) -> None:
        self._coordinates = np.ascontiguousarray(points.T)

    def _get(self) -> np.ndarray:
        return self._coordinates.T

    def _worst_corner(self) -> tuple[int, float]:
        touched = self.problem.touched
        norm = SHAPES[self._dimension].norm
        worst, largest = 0, -1.0
        for chunk in chunks(len(touched.vertices)):
            edges, v = edges_and_determinant(self._get(), touched.vertices[chunk])
            here = self._badness(v, edges, norm[touched.shapes[chunk, 0]].T)
            if here.max() > largest:
                worst, largest = chunk.start + int(here.argmax()), float(here.max())
        return worst, largest

    def _badness(self, v: np.ndarray, edges: Sequence[Components], norm: Sequence[np.ndarray]) -> np.ndarray:
        with np.errstate(all="ignore"):  # a degenerate corner is not positive, whatever s/v says
            return badness(v, weighted_norm(edges, norm), self._dimension)

    def relax_batch(self, batch: int, directions: np.ndarray) -> int:
        return sum(self._relax_chunk(chunk, directions) for chunk in self._batches[batch])

    def _relax_chunk(self, chunk: _Chunk, directions: np.ndarray) -> int:
        table = SHAPES[self._dimension]
        norm = table.norm[chunk.shapes].transpose(2, 0, 1)
        slope = table.slope[chunk.shapes].transpose(2, 0, 1)
        ends = [[component[end] for component in self._coordinates] for end in chunk.ends]
        x = [component[chunk.vertices] for component in self._coordinates]
        direction = list(directions[chunk.rings].T)
        lines = coefficients(x, direction, ends, norm, slope, table.curvature[chunk.shapes])
        step, before = maximise_minimum(lines)

        moving = np.flatnonzero(step != 0.0)
        if not len(moving):
            return 0
        target = [xi[moving] + step[moving] * di[moving] for xi, di in zip(x, direction, strict=True)]
        ends = [[component[:, moving] for component in end] for end in ends]
        edges = [subtract(end, target) for end in ends]
        if chunk.shapes.size > 1:
            norm = norm[:, :, moving]
        v = dot(edges[0], opposite_normal(ends))
        after = self._badness(v, edges, norm).max(axis=0)
        better = improves(before[moving], after, self._dimension)
        moved = chunk.vertices[moving[better]]
        for component, value in zip(self._coordinates, target, strict=True):
            component[moved] = value[better]
        return len(moved)


def _chunks(problem: Problem, lo: int, hi: int) -> Iterator[_Chunk]:
    """Cut the rings lo..hi of one batch, sorted by size, into chunks."""
    rings = problem.rings
    batch = lo + np.argsort(rings.sizes[lo:hi], kind="stable")
    sizes = rings.sizes[batch]
    while len(batch):
        # as many rings as keep K·n within bounds, K being the size of the last and largest
        area = sizes * np.arange(1, len(sizes) + 1)
        n = max(1, int(np.searchsorted(area, _CHUNK_CORNERS, side="right")))
        part = batch[:n]
        entry = rings.start[part] + np.minimum(np.arange(sizes[n - 1])[:, None], sizes[:n] - 1)
        shapes = rings.shapes[entry]
        yield _Chunk(
            rings=part,
            vertices=rings.vertices[part].astype(np.intp),
            ends=np.ascontiguousarray(rings.others[entry].transpose(2, 0, 1), dtype=np.intp),
            shapes=shapes if shapes.min() != shapes.max() else shapes[:1, :1],
        )
        batch, sizes = batch[n:], sizes[n:]
