"""What all engines have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from dvr_cli.mesh.corners import Corners
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.relax.problem import Problem


class Engine(ABC):
    """The code that updates all vertices of a batch; engines differ in speed, never in result."""

    name: str
    threads = 1

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
    def relaxed_points(self) -> np.ndarray:
        """(m, d) coordinates reached of the relaxed vertices, in the order of the problem's rings."""
        return self._get()[self.problem.rings.vertices]

    def q1(self) -> float:
        """Q1: the worst quality of a corner with a relaxed vertex."""
        touched = self.problem.touched
        corner, badness = self._worst_corner()
        # where corners are not positive their badness does not order them
        chosen = slice(corner, corner + 1) if badness < np.inf else slice(None)
        worst = Corners(touched.vertices[chosen], touched.shapes[chosen], touched.first)
        return float(corner_qualities(self._get(), worst).min())

    @abstractmethod
    def relax_batch(self, batch: int, directions: np.ndarray) -> int:
        """Move each vertex of a batch to the best point of its line; returns how many moved.

        directions: (m, d), row i for ring i of the problem; a zero row leaves its vertex where it is.
        """

    @abstractmethod
    def _worst_corner(self) -> tuple[int, float]:
        """The first of the touched corners with the largest badness, and that badness."""

    @abstractmethod
    def _set(self, points: np.ndarray) -> None:
        """Take over coordinates in the problem's numbering."""

    @abstractmethod
    def _get(self) -> np.ndarray:
        """(N, d) coordinates reached, in the problem's numbering."""
