"""Freedom: how far each vertex may move without changing the shape of the domain, a region or a group."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.mesh.simplex import Components, dot

_PERPENDICULAR = 1e-9  # length below which what a unit vector has in a line or plane is rounding


@dataclass(frozen=True, eq=False)
class Freedom:
    """The directions in which each vertex may move.

    dimension: (N,) uint8; 0 keeps a vertex in place, 1 lets it move along a line, 2 in a plane, 3 anywhere
        (in a planar mesh 2 is anywhere).
    axis: (N, d) unit vectors: the tangent of the line, the normal of the plane; zero for other vertices.
    """

    dimension: np.ndarray
    axis: np.ndarray

    @property
    def relaxed(self) -> np.ndarray:
        """(m,) the vertices that may move, in index order: I_R."""
        return np.flatnonzero(self.dimension)

    def only(self, selected: np.ndarray) -> Freedom:
        """The same, with all vertices but those marked in ``selected`` ((N,) bool) kept in place."""
        return Freedom(np.where(selected, self.dimension, np.uint8(0)), self.axis)

    def project(self, vectors: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        """The part of ``vectors`` (m, d), gradients or steps, that lies in the line or plane of each of
        ``vertices`` (m,): the orthogonal projection, zero for a vertex that stays.
        """
        dimension = self.dimension[vertices]
        inside = project(list(vectors.T), dimension == 1, list(self.axis[vertices].T))
        return np.where(dimension[:, None] > 0, np.stack(inside, axis=1), 0.0)

    def directions(self, vectors: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        """Directions (m, d), of unit length, along the part of unit ``vectors`` (m, d) that lies in the line
        or plane of each of ``vertices`` (m,); zero where there is no such part but rounding.

        A component that has to vanish is zero exactly where the line or plane is parallel to the axes.
        """
        result = vectors.copy()
        held = np.flatnonzero(self.dimension[vertices] < vectors.shape[1])
        dimension, axis = self.dimension[vertices[held]][:, None], self.axis[vertices[held]]
        inside = np.stack(project(list(vectors[held].T), dimension[:, 0] == 1, list(axis.T)), axis=1)
        inside[(inside * inside).sum(axis=1) < _PERPENDICULAR**2] = 0.0
        inside = unit(inside)
        # once more: what is left across a plane is rounding, relative to a part that may have been short
        across = (inside * axis).sum(axis=1, keepdims=True) * axis
        inside = np.where(dimension == 1, inside, unit(inside - across))
        result[held] = np.where(dimension > 0, inside, 0.0)
        return result


def project(vectors: Components, on_line: np.ndarray, axis: Components) -> list[np.ndarray]:
    """The part of vectors that lies in the line or plane of their vertices: d components of any one shape.

    on_line: (n,) bool, whether a vertex moves along a line only; axis: d components (n,), the tangent of that
    line or else the normal of the plane, zero where a vertex moves anywhere.
    """
    along = dot(vectors, axis)
    return [np.where(on_line, along * a, g - along * a) for g, a in zip(vectors, axis, strict=True)]


def unit(vectors: np.ndarray) -> np.ndarray:
    """The rows of ``vectors`` (n, d) scaled to length one; zero rows stay zero."""
    # scaled by the largest component first, so that no square over- or underflows
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    scaled = np.divide(vectors, largest, out=np.zeros_like(vectors), where=largest > 0)
    length = np.sqrt((scaled * scaled).sum(axis=1, keepdims=True))
    return np.divide(scaled, length, out=np.zeros_like(vectors), where=length > 0)


def interior_freedom(interior: np.ndarray, d: int) -> Freedom:
    """All vertices marked in ``interior`` ((N,) bool) move anywhere in d dimensions, all others stay."""
    return Freedom(np.where(interior, np.uint8(d), np.uint8(0)), np.zeros((len(interior), d)))
