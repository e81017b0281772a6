"""The compiled engine: the kernel over the vertices of a batch, on one thread or several."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from dvr_cli.mesh.corners import SHAPES
from dvr_cli.relax.compiled import worst_corner
from dvr_cli.relax.engine import Engine
from dvr_cli.relax.kernel import ROWS, WIDTH, relax_rings
from dvr_cli.relax.problem import Problem

_LEAST = 512  # rings or corners a thread is given at least: fewer cost more than they save


class NumbaEngine(Engine):
    """Gives each thread a part of the batch; vertices of a batch are independent, so parts are too."""

    name = "numba"

    def __init__(self, problem: Problem, threads: int = 1) -> None:
        """threads: how many to use at most; the result does not depend on it."""
        super().__init__(problem)
        self.threads = threads
        self._points = np.empty((0, problem.dimension))
        self._largest_ring = int(problem.rings.sizes.max(initial=0))
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def _set(self, points: np.ndarray) -> None:
        self._points = np.ascontiguousarray(points)

    def _get(self) -> np.ndarray:
        return self._points

    def relax_batch(self, batch: int, directions: np.ndarray) -> int:
        lo, hi = self.problem.batch_start[batch : batch + 2].tolist()
        return sum(self._in_parts(lambda a, b: self._relax(directions, a, b), lo, hi))

    def _relax(self, directions: np.ndarray, lo: int, hi: int) -> int:
        rings, table = self.problem.rings, SHAPES[self.problem.dimension]
        arrays = rings.vertices, rings.start, rings.others, rings.shapes
        tables = table.norm, table.slope, table.curvature
        scratch = np.zeros((ROWS, self._largest_ring + WIDTH))
        return relax_rings(self._points, directions, lo, hi, *arrays, *tables, scratch)

    def _worst_corner(self) -> tuple[int, float]:
        touched, norm = self.problem.touched, SHAPES[self.problem.dimension].norm
        parts = self._in_parts(
            lambda a, b: worst_corner(self._points, touched.vertices, touched.shapes, norm, a, b),
            0,
            len(touched.vertices),
        )
        return max(parts, key=lambda part: part[1])  # the first of equals

    def _in_parts(self, work: Callable[[int, int], Any], lo: int, hi: int) -> list[Any]:
        """work(a, b) for consecutive parts a .. b of lo .. hi, in order, on as many threads as pay."""
        parts = min(self.threads, (hi - lo) // _LEAST)
        if self._pool is None or parts < 2:
            return [work(lo, hi)]
        cuts = np.linspace(lo, hi, parts + 1).astype(np.int64).tolist()
        return list(self._pool.map(work, cuts[:-1], cuts[1:]))
