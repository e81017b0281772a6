"""The compiled engine: the kernel over the vertices of a batch, on one thread or several."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from dvr_cli.backend import COMPILED
from dvr_cli.quality.badness_numba import worst_corner
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.relax.columns_numba import ROWS, WIDTH
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.enough_numba import relax_rings
from dvr_cli.relax.newton_numba import polish_rings
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.problem import Problem, RingFreedom
from dvr_cli.relax.steepest_numba import steepest_directions

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
_LEAST = 512  # rings or corners in a part at least: fewer cost more than they save
_SHARES = 4  # parts a thread gets on average: who is slowed down by other work on the machine takes fewer


class NumbaEngine(Engine):
    """Gives each thread a part of the batch; vertices of a batch are independent, so parts are too."""

    backend = COMPILED

    def __init__(self, problem: Problem, threads: int = 1) -> None:
        """threads: how many to use at most; the result does not depend on it."""
        super().__init__(problem)
        self.threads = threads
        self._points = np.empty((0, problem.components))
        freedom = problem.freedom
        self._within = (
            (np.empty(0, dtype=bool), np.empty((0, problem.dimension)))
            if freedom is None
            else (freedom.dimension == 1, freedom.axis)
        )
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def _over(self, problem: Problem) -> Engine:
        other = NumbaEngine(problem)
        other.threads, other._pool = self.threads, self._pool
        return other

    def _set(self, points: np.ndarray) -> None:
        self._points = np.ascontiguousarray(points)

    def _get(self) -> np.ndarray:
        return self._points

    def _relax(self, batch: int, lo: int, hi: int, directions: np.ndarray, enough: float) -> int:
        return relax_rings(self._points, directions, lo, hi, self._rows, float(enough), self._scratch())

    def _steepest(self, batch: int, lo: int, hi: int, band: float, active: np.ndarray) -> None:
        freedom = RingFreedom(active, *self._within)

        def part(a: int, b: int) -> None:
            scratch = self._scratch()
            steepest_directions(self._points, self._directions, a, b, self._rows, freedom, band, scratch)

        self._in_parts(part, lo, hi)

    def _polish(self, batch: int, lo: int, hi: int, limit: float, aim: Aim, active: np.ndarray) -> int:
        freedom = RingFreedom(active, *self._within)
        return polish_rings(self._points, lo, hi, self._rows, freedom, float(limit), aim, self._scratch())

    def qualities(self) -> np.ndarray:
        touched, turned = self.problem.touched, self.turned
        result = np.empty(len(touched.vertices))

        def part(lo: int, hi: int) -> None:
            inverted = None if turned is None else turned[lo:hi]
            result[lo:hi] = corner_qualities(self._points, touched.part(slice(lo, hi)), COMPILED, inverted)

        self._in_parts(part, 0, len(result))
        return result

    def _scratch(self) -> np.ndarray:
        """Columns for a ring, of any size that there is; see ``columns_numba``."""
        return np.zeros((ROWS, self._largest_ring + WIDTH))

    def _worst_corner(self) -> tuple[int, float]:
        touched = self.problem.touched
        table = touched.table.norm, touched.table.factor
        parts = self._in_parts(
            lambda a, b: worst_corner(self._points, touched.vertices, touched.shapes, *table, a, b),
            0,
            len(touched.vertices),
        )
        return max(parts, key=lambda part: part[1])  # the first of equals

    def _in_parts(self, work: Callable[[int, int], Any], lo: int, hi: int, least: int = 1) -> list[Any]:
        parts = min(_SHARES * self.threads, (hi - lo) // max(least, _LEAST))
        if self._pool is None or parts < 2:
            return [work(lo, hi)]
        ends = np.cumsum(np.arange(parts, 0, -1))  # ever shorter parts: threads end at about the same time
        cuts = [lo, *(lo + (hi - lo) * ends // ends[-1]).tolist()]
        return self._each(lambda cut: work(*cut), [cut for cut in pairwise(cuts) if cut[0] < cut[1]])

    def _each(self, work: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
        """As in Engine; each thread takes the next item from one iterator until there are none left."""
        if self._pool is None or len(items) < 2:
            return list(map(work, items))
        results: dict[int, _Result] = {}
        waiting = iter(enumerate(items))

        def take() -> None:
            for i, item in waiting:
                results[i] = work(item)

        others = [self._pool.submit(take) for _ in range(min(self.threads, len(items)) - 1)]
        take()
        for other in others:
            other.result()
        return [results[i] for i in range(len(items))]
