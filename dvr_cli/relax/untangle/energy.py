"""The regularised mean-ratio energy of a mesh, finite for inverted elements too, and its gradient.

Garanzha, Kaporin, Kudryavtseva, Protais, Ray & Sokolov, Foldover-free maps in 50 lines of code (ACM TOG
2021), with their shape term alone. With s and v of a corner as in ``quality.mean_ratio``, 1/Q = s / v^(2/d),

    f = Σ s / χ(v, ε)^(2/d),    χ(v, ε) = (v + sqrt(ε² + v²)) / 2

over the corners, where χ is v for v ≫ ε, and positive and next to nothing for v ≪ -ε: the smaller ε, the
higher the price of an inverted corner. Each corner's v is measured in units of a volume of the elements
around it, so that ε means the same in coarse and fine parts of a mesh.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.mesh.corners import Corners
from dvr_cli.mesh.simplex import back_through, cross, dot, subtract, through
from dvr_cli.relax.measured import Measured

_CHUNK = 1 << 13  # corners evaluated at a time: what they take stays in the cache


class Energy:
    """The energy as a function of the displacements of some vertices, all others held.

    Displacements are a flat array (m·d,), in units of the size of the elements around each vertex. In a
    metric both are measured through L of the vertex's first corner, see ``measured``.
    """

    def __init__(self, points: np.ndarray, corners: Corners, freedom: Freedom) -> None:
        """points: (N, d), the origin of the displacements; freedom: which vertices move, and how."""
        self.dimension = d = points.shape[1]
        self._freedom = freedom
        self._moving = freedom.relaxed
        marked = freedom.dimension > 0
        touched = np.flatnonzero(marked[corners.vertices].any(axis=1))
        vertices, self._corner = np.unique(corners.vertices[touched], return_inverse=True)
        self._corner = np.ascontiguousarray(self._corner.reshape(-1, d + 1).T)
        table, rows = corners.table, corners.shapes[touched, 0]
        self._norm = np.ascontiguousarray(table.norm[rows].T)
        self._start = np.ascontiguousarray(points[vertices].T)
        self._here = np.searchsorted(vertices, self._moving)
        self._factor, self._measured = None, None
        if len(table.factor):
            self._factor = np.ascontiguousarray(table.factor[rows].T)
            first = np.empty(len(vertices), dtype=np.int64)
            first[self._corner[:, ::-1]] = rows[::-1]  # that of the first corner is the last to be put
            own = table.factor[first[self._here]].T
            on_line, axis = freedom.dimension[self._moving] == 1, freedom.axis[self._moving]
            self._measured = Measured.of(list(own), (on_line, list(axis.T)))
        size, self._unit = self._sizes()
        self._size = size[self._here]
        number = np.full(len(vertices), len(self._moving))
        number[self._here] = np.arange(len(self._moving))
        self._target = number[self._corner].ravel()  # held vertices share one number past the last

    def points_after(self, displacements: np.ndarray) -> np.ndarray:
        """(m, d) the moving vertices, in index order, after ``displacements``."""
        return self._at(displacements)[:, self._here].T

    def at(self, points: np.ndarray, epsilon: float) -> float:
        """The energy with this ε where the moving vertices are at ``points`` (m, d)."""
        x = self._start.copy()
        x[:, self._here] = points.T
        return self._evaluated(x, epsilon)[0]

    def least(self, displacements: np.ndarray) -> float:
        """The smallest v of a corner, in its unit."""
        x = self._at(displacements)
        edges = _edges(x, self._corner)
        return float((dot(edges[0], _normals(edges)[0]) / self._unit).min())

    def regularised(self, displacements: np.ndarray, epsilon: float) -> tuple[float, np.ndarray]:
        """The energy with this ε and its gradient (m·d,) in the lines and planes of the vertices."""
        energy, pull = self._evaluated(self._at(displacements), epsilon)
        m = len(self._moving)
        sums = [np.bincount(self._target, row.ravel(), minlength=m + 1)[:m] for row in pull]
        if self._measured is not None:
            sums = self._measured.gradient(sums)
        gradient = np.stack(sums, axis=1) * self._size[:, None]
        if self._measured is None and self._freedom.axis.any():
            gradient = self._freedom.project(gradient, self._moving)
        return energy, gradient.ravel()

    def _evaluated(self, x: np.ndarray, epsilon: float) -> tuple[float, np.ndarray]:
        """The energy of the coordinates x (d, n), and its derivatives by the vertices of each corner."""
        d, n = self.dimension, self._corner.shape[1]
        energy = 0.0
        pull = np.empty((d, d + 1, n))
        for low in range(0, n, _CHUNK):
            chunk = slice(low, low + _CHUNK)
            unit = self._unit[chunk]
            edges = _edges(x, self._corner[:, chunk])
            normals = _normals(edges)
            v = dot(edges[0], normals[0]) / unit
            factor = None if self._factor is None else self._factor[:, chunk]
            s, weighted = _norm_and_slopes(edges, self._norm[:, chunk], factor)
            root = np.sqrt(epsilon * epsilon + v * v)
            # (v + root) / 2 without the cancellation of negative v
            chi = np.where(v > 0, v + root, epsilon * epsilon / (root + np.abs(v))) / 2
            power = chi * unit if d == 2 else np.square(np.cbrt(chi * unit))
            energies = s / power
            energy += float(energies.sum())
            along, across = 2 / power, (2 / d) * energies / (root * unit)
            for i in range(d):
                total = np.zeros(len(unit))
                for j in range(d):
                    force = along * weighted[j][i] - across * normals[j][i]
                    pull[i, j + 1, chunk] = force
                    total -= force
                pull[i, 0, chunk] = total
        return energy, pull

    def _at(self, displacements: np.ndarray) -> np.ndarray:
        """(d, n) the coordinates after ``displacements``."""
        x = self._start.copy()
        moves = (displacements.reshape(-1, self.dimension) * self._size[:, None]).T
        x[:, self._here] += moves if self._measured is None else np.stack(self._measured.move(moves))
        return x

    def _sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """The size of the elements around each vertex (n,), and the unit of volume of each corner (C,)."""
        edges = _edges(self._start, self._corner)
        length = np.sqrt(_norm_and_slopes(edges, self._norm, self._factor)[0])
        count = np.bincount(self._corner.ravel())
        size = np.bincount(self._corner.ravel(), np.tile(length, self.dimension + 1)) / count
        size = np.maximum(size, 1e-6 * size.max() or 1.0)  # all elements around a vertex may be points
        return size, size[self._corner].mean(axis=0) ** self.dimension


def _edges(x: np.ndarray, corner: np.ndarray) -> list[list[np.ndarray]]:
    own, *ends = ([component[vertex] for component in x] for vertex in corner)
    return [subtract(end, own) for end in ends]


def _normals(edges: list[list[np.ndarray]]) -> list[list[np.ndarray]]:
    """The derivatives of v = det E by each edge."""
    if len(edges) == 2:
        a, b = edges
        return [[b[1], -b[0]], [-a[1], a[0]]]
    a, b, c = edges
    return [cross(b, c), cross(c, a), cross(a, b)]


def _norm_and_slopes(
    edges: list[list[np.ndarray]], norm: np.ndarray, factor: np.ndarray | None
) -> tuple[np.ndarray, list[list[np.ndarray]]]:
    """s of each corner, and half its derivatives by each edge; norm, factor: as in ``ShapeTable``."""
    if factor is not None:
        edges = [through(factor, edge) for edge in edges]
    weighted = _weighted(edges, norm)
    s = dot(edges[0], weighted[0])
    for j in range(1, len(edges)):
        s = s + dot(edges[j], weighted[j])
    if factor is not None:
        weighted = [back_through(factor, row) for row in weighted]
    return s, weighted


def _weighted(edges: list[list[np.ndarray]], norm: np.ndarray) -> list[list[np.ndarray]]:
    """Σ_k M_jk e_k for each edge j; ``norm`` as in ``ShapeTable``."""
    d = len(edges)
    result = [[norm[j] * component for component in edge] for j, edge in enumerate(edges)]
    pair = d
    for j in range(d):
        for k in range(j + 1, d):
            half = norm[pair] / 2
            for i in range(d):
                result[j][i] = result[j][i] + half * edges[k][i]
                result[k][i] = result[k][i] + half * edges[j][i]
            pair += 1
    return result
