"""Gradients and moves measured through L of a metric: a stretched mesh moves as one that is not.

With y = L x for a vertex's position x, the gradient by y is L⁻ᵀ g, and a step u of y is the move L⁻¹ u of x.
A line with the tangent a has the tangent L a then, a plane with the normal n the normal L⁻ᵀ n. Vectors are
lists of d components, L is given by its entries as in ``ShapeTable.factor``; kernels have twins of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dvr_cli.boundary.freedom import project
from dvr_cli.mesh.simplex import Components, dot, solve, solve_back, through

Within = tuple[np.ndarray, Components] | None  # what vertices are free to follow, see ``freedom.project``


@dataclass(frozen=True)
class Measured:
    """The L that each of n vertices is measured through, and the lines and planes they keep to.

    own: entries (n,) of L. within: the lines and planes as they are; seen: as they are through L.
    """

    own: Sequence[np.ndarray]
    within: Within
    seen: Within

    @classmethod
    def of(cls, own: Sequence[np.ndarray], within: Within) -> Measured:
        """The measure of vertices with these L that keep within these lines and planes; None for anywhere."""
        return cls(own, within, None if within is None else (within[0], seen_axis(own, *within)))

    def gradient(self, vectors: Components) -> list[np.ndarray]:
        """The gradients by y for those by x: components (n,) or (K, n)."""
        seen = solve_back(self.own, vectors)
        return seen if self.seen is None else project(seen, *self.seen)

    def move(self, vectors: Components) -> list[np.ndarray]:
        """The moves of x for those of y: components (n,)."""
        moved = solve(self.own, vectors)
        return moved if self.within is None else project(moved, *self.within)

    def direction(self, vectors: Components) -> list[np.ndarray]:
        """The same, of unit length, or zero where there is no move."""
        moved = self.move(vectors)
        length = np.sqrt(dot(moved, moved))
        return [np.where(length > 0.0, component / length, 0.0) for component in moved]


def seen_axis(own: Sequence[np.ndarray], on_line: np.ndarray, axis: Components) -> list[np.ndarray]:
    """The unit tangents of lines and normals of planes as seen through L; zero where ``axis`` is."""
    tangent, normal = through(own, axis), solve_back(own, axis)
    seen = [np.where(on_line, t, n) for t, n in zip(tangent, normal, strict=True)]
    length = np.sqrt(dot(seen, seen))
    with np.errstate(invalid="ignore"):
        return [np.where(length > 0.0, component / length, 0.0) for component in seen]
