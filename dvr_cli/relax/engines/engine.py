"""The interface of an engine, and what all engines share."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from dvr_cli.backend import Backend
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.relax.problem import Problem
from dvr_cli.relax.steepest import Ascent


class Engine(ABC):
    """The code that updates all vertices of a batch; engines differ in speed, never in result."""

    backend: Backend
    threads = 1

    @property
    def name(self) -> str:
        """Its name, as ``--engine`` takes it."""
        return self.backend.name

    def __init__(self, problem: Problem) -> None:
        """problem: what to relax; the coordinates are those last given to ``load``."""
        self.problem = problem

    @property
    def batches(self) -> int:
        """Number of batches a sweep has."""
        return len(self.problem.batch_start) - 1

    def load(self, points: np.ndarray) -> None:
        """Start from the coordinates ``points`` (N, d); they are copied."""
        self._set(np.asarray(points, dtype=np.float64)[self.problem.order])

    @property
    def points(self) -> np.ndarray:
        """(N, d) copy of the coordinates reached."""
        reached = self._get()
        points = np.empty_like(reached)
        points[self.problem.order] = reached
        return points

    @property
    def coordinates(self) -> np.ndarray:
        """(N, d) the coordinates reached in the problem's numbering; what is written there counts."""
        return self._get()

    @property
    def relaxed_points(self) -> np.ndarray:
        """(m, d) coordinates reached of the relaxed vertices, in the order of the problem's rings."""
        return self._get()[self.problem.rings.vertices]

    def q1(self) -> float:
        """Q1: the worst quality of a corner with a relaxed vertex, infinite if there are none."""
        touched = self.problem.touched
        if not len(touched.vertices):
            return np.inf
        corner, badness = self._worst_corner()
        # where corners are not positive their badness does not order them
        candidates = slice(corner, corner + 1) if badness < np.inf else slice(None)
        return float(corner_qualities(self._get(), touched.part(candidates)).min())

    def qualities(self) -> np.ndarray:
        """(C,) quality of each corner with a relaxed vertex."""
        return corner_qualities(self._get(), self.problem.touched)

    def move_batch(self, batch: int, directions: np.ndarray | Ascent) -> int:
        """Relax a batch along given directions (see ``relax_batch``) or those of steepest ascent.

        Returns how many vertices moved.
        """
        if not isinstance(directions, Ascent):
            return self.relax_batch(batch, directions)
        lo, hi = self.problem.batch_start[batch : batch + 2].tolist()
        before = self._get()[self.problem.rings.vertices[lo:hi]]
        for band in directions.bands:
            for _ in range(directions.searches):
                if not self.relax_batch(batch, self.steepest(batch, band)):
                    break
        after = self._get()[self.problem.rings.vertices[lo:hi]]
        return int((after != before).any(axis=1).sum())

    def steepest(self, batch: int, band: float) -> np.ndarray:
        """(m, d) directions of which those of a batch are of steepest ascent of their rings' minimum quality.

        They hold for the coordinates as they are now; see ``steepest.steepest``. The others mean nothing.
        """
        return self._inside(batch, self._steepest(batch, band))

    def mean_ascent(self, batch: int) -> np.ndarray:
        """(m, d) directions of which those of a batch are along which their rings' sums of 1/Q fall fastest.

        They hold for the coordinates as they are now; see ``polish.mean_ascent``. The others mean nothing.
        """
        return self._inside(batch, self._mean_ascent(batch))

    def _inside(self, batch: int, directions: np.ndarray) -> np.ndarray:
        """Remove from the batch's directions their parts across lines and planes, which rounding has made."""
        freedom = self.problem.freedom
        if freedom is not None:
            lo, hi = self.problem.batch_start[batch : batch + 2].tolist()
            directions[lo:hi] = freedom.directions(directions[lo:hi], np.arange(lo, hi))
        return directions

    @abstractmethod
    def relax_batch(self, batch: int, directions: np.ndarray) -> int:
        """Move each vertex of a batch to the best point of its line; returns how many moved.

        directions: (m, d), row i for ring i of the problem; a zero row leaves its vertex where it is.
        """

    @abstractmethod
    def polish_batch(self, batch: int, directions: np.ndarray, limit: float) -> int:
        """Move each vertex of a batch to where the sum of 1/Q along its line is lowest above the floor.

        directions: as for ``relax_batch``; limit: the badness at the floor. Returns how many moved.
        """

    @abstractmethod
    def _steepest(self, batch: int, band: float) -> np.ndarray:
        """The directions of ``steepest``, in lines and planes but for rounding."""

    @abstractmethod
    def _mean_ascent(self, batch: int) -> np.ndarray:
        """The directions of ``mean_ascent``, in lines and planes but for rounding."""

    @abstractmethod
    def _worst_corner(self) -> tuple[int, float]:
        """The first of the touched corners with the largest badness, and that badness."""

    @abstractmethod
    def _set(self, points: np.ndarray) -> None:
        """Take over coordinates in the problem's numbering."""

    @abstractmethod
    def _get(self) -> np.ndarray:
        """(N, d) coordinates reached, in the problem's numbering."""
