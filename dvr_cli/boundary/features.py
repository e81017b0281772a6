"""Features: faces, ridges and tips among the facets that keep their shape, and the freedom of their vertices.

A *ridge* is an edge where facets of one part end: where not exactly two meet, where they meet at an angle,
where labels change, or where a line cell lies. In a planar mesh every facet is an edge and counts as a ridge.

A *face vertex* has no ridge and facets in one plane: it may move in that plane. A *ridge vertex* has exactly
two ridges of one label, one the continuation of the other, and facets that contain their line: it may move
along that line. All other vertices of the facets are *tips* and stay.

Facets count as in one plane when what is left of an angle between them can be rounding; then moving a vertex
in its plane or line keeps the shape of everything exactly. Given a feature angle, they may differ by as much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.boundary.constraints import EXACT, Constraints, edges_of
from dvr_cli.boundary.freedom import Freedom, unit
from dvr_cli.mesh.csr import group
from dvr_cli.mesh.facets import numbered

_FLAT = 1e-6  # radians; a ridge less sharp than this is none, but its vertices are not in one plane either


@dataclass(frozen=True, eq=False)
class Features:
    """The freedom of the vertices of the constraint facets, and its reasons.

    freedom: of all vertices: tips and vertices without cells 0, ridge vertices 1, face vertices 2 (in a
        volume mesh), interior vertices anywhere. axis: tangents and mean normals.
    ridges: (R, 2) edges, each once. ridge_label: (R,) the label of the facet in a planar mesh, that of the
        line cell or -1 in a volume mesh.
    """

    freedom: Freedom
    ridges: np.ndarray
    ridge_label: np.ndarray


def features_of(
    points: np.ndarray, interior: np.ndarray, constraints: Constraints, angle: float | None = None
) -> Features:
    """Classify the vertices of the constraint facets.

    points: (N, d); interior: (N,) bool, vertices that may move anywhere. angle: the feature angle in radians
    up to which facets count as one smooth face and edges as one smooth curve; None asks for exact planes and
    lines.
    """
    facets, n_points = constraints.facets, len(points)
    volume = facets.shape[1] > 2
    ridges, ridge_label = facets, constraints.label
    if volume:
        star = _star(points, constraints, angle)
        ridges, ridge_label = _ridges(constraints, star.normal, _FLAT if angle is None else angle)
    dimension = np.where(interior, np.uint8(points.shape[1]), np.uint8(0))
    axis = np.zeros(points.shape)

    count = np.bincount(ridges.ravel(), minlength=n_points)
    vertex, turn, tangent = _passing(points, ridges, ridge_label, count)
    if angle is not None:
        bound = np.full(len(vertex), 2.0 * np.sin(angle / 2.0))
    else:
        shortest = np.full(n_points, np.inf)
        length = _length(points[ridges[:, 1]] - points[ridges[:, 0]])
        np.minimum.at(shortest, ridges, length[:, None])
        with np.errstate(divide="ignore", invalid="ignore"):  # edges without length
            bound = np.fmin(2.0 * constraints.rounding / shortest[vertex], EXACT)
    smooth = (turn <= bound) & ~constraints.fixed[vertex]
    if volume:
        smooth &= ~star.leaves(vertex, tangent, n_points)
    dimension[vertex[smooth]] = 1
    axis[vertex[smooth]] = tangent[smooth] if angle is not None else _snapped(tangent[smooth], bound[smooth])

    if volume:
        flat, normal, bound = star.flat(n_points)
        flat &= (count == 0) & ~constraints.fixed
        dimension[flat] = 2
        axis[flat] = normal[flat] if angle is not None else _snapped(normal[flat], bound[flat])
    return Features(Freedom(dimension, axis), ridges, ridge_label)


@dataclass(frozen=True, eq=False)
class _Star:
    """The facets around each vertex of a volume mesh.

    vertex, facet: (n,) one entry for each vertex of each facet.
    area: (F, 3) normals of the length of the facets' areas; normal: (F, 3) unit, zero where there is none.
    limit: (F,) how far, as a chord of the unit sphere, a facet's normal may be from one that is the same.
    two_sided: (F,) as in Constraints.
    """

    vertex: np.ndarray
    facet: np.ndarray
    area: np.ndarray
    normal: np.ndarray
    limit: np.ndarray
    two_sided: np.ndarray

    def flat(self, n_points: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(N,) bool, the vertices whose facets all have the same normal; (N, 3) the mean normals; (N,) the
        smallest limit at each.
        """
        vertex, facet = self.vertex, self.facet
        normal, area = (of.take(facet, axis=0) for of in (self.normal, self.area))
        if self.two_sided.any():
            first = np.zeros(n_points, dtype=np.int64)
            first[vertex[::-1]] = facet[::-1]
            turned = (normal * self.normal.take(first[vertex], axis=0)).sum(axis=1) < 0
            sign = np.where(turned & self.two_sided[facet], -1.0, 1.0)[:, None]
            normal, area = sign * normal, sign * area
        mean = unit(np.stack([np.bincount(vertex, x, n_points) for x in area.T], axis=1))
        off = _length(normal - mean.take(vertex, axis=0)) > self.limit[facet]
        flat = np.zeros(n_points, dtype=bool)
        flat[vertex] = True
        flat[vertex[off]] = False
        least = np.full(n_points, np.inf)
        np.minimum.at(least, vertex, self.limit[facet])
        return flat, mean, least

    def leaves(self, vertices: np.ndarray, along: np.ndarray, n_points: int) -> np.ndarray:
        """(n,) bool, which of ``vertices`` (n,) would leave the plane of a facet moving along (n, 3)."""
        row = np.full(n_points, -1)
        row[vertices] = np.arange(len(vertices))
        here = np.flatnonzero(row[self.vertex] >= 0)
        facet, of = self.facet[here], row[self.vertex[here]]
        off = np.abs((self.normal[facet] * along[of]).sum(axis=1)) > self.limit[facet]
        result = np.zeros(len(vertices), dtype=bool)
        result[of[off]] = True
        return result


def _star(points: np.ndarray, constraints: Constraints, angle: float | None) -> _Star:
    facets = constraints.facets
    facet, column = np.nonzero(facets >= 0)
    closed = np.where(facets < 0, facets[:, :1], facets)
    a, b, c = (points.take(closed[:, k], axis=0) for k in range(3))
    d = points.take(closed[:, 3], axis=0) if closed.shape[1] == 4 else a
    area = 0.5 * np.cross(c - a, d - b)
    normal = unit(area)
    if angle is None:
        size = np.stack([_length(edge) for edge in (b - a, c - b, c - a, d - b)]).max(axis=0)
        height = np.divide(_length(area), size, out=np.zeros(len(area)), where=size > 0)
        limit = np.divide(constraints.rounding, height, out=np.full(len(area), EXACT), where=height > 0)
        warp = np.abs(((d - a) * normal).sum(axis=1))
        planar = (height > 0) & (warp <= np.minimum(constraints.rounding, EXACT * size))
        limit = np.where(planar, np.minimum(limit, EXACT), -1.0)
    else:
        limit = np.full(len(facets), 2.0 * np.sin(angle / 2.0))
    return _Star(facets[facet, column], facet, area, normal, limit, constraints.two_sided)


def _ridges(constraints: Constraints, normal: np.ndarray, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """The ridges (R, 2) of a volume mesh, each once, and the labels of the lines on them, -1 for none."""
    lines, label, two_sided = constraints.lines, constraints.label, constraints.two_sided
    edges, facet = edges_of(constraints.facets)
    backend = constraints.backend
    number = numbered(np.concatenate([edges, lines]), backend)
    n = int(number.max(initial=-1)) + 1
    positions, start = backend.twin(group)(number[: len(edges)], n)
    paired = np.diff(start) == 2
    one, other = (facet[positions[start[:-1][paired] + k]] for k in (0, 1))
    cosine = (normal.take(one, axis=0) * normal.take(other, axis=0)).sum(axis=1)
    cosine = np.where(two_sided[one] & two_sided[other], np.abs(cosine), cosine)
    smooth = np.zeros(n, dtype=bool)
    smooth[paired] = (cosine >= np.cos(angle)) & (label[one] == label[other])
    line_label = np.full(n, -1)
    line_label[number[len(edges) :]] = constraints.line_label
    ends = np.empty((n, 2), dtype=np.int64)
    ends[number] = np.concatenate([edges, lines])
    ridge = ~smooth | (line_label >= 0)
    return np.sort(ends[ridge], axis=1), line_label[ridge]


def _passing(
    points: np.ndarray, ridges: np.ndarray, label: np.ndarray, count: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The vertices (n,) where exactly two ridges of one label meet, in index order; by how much the one turns
    into the other (n,), as a chord of the unit sphere; the unit tangents (n, d), from one end to the other.
    """
    positions, start = group(ridges.ravel(), len(points))
    vertex = np.flatnonzero(count == 2)
    pair = np.stack([positions[start[vertex]], positions[start[vertex] + 1]])
    ends = np.sort(ridges.ravel()[pair ^ 1], axis=0)
    vertex, ends = (x[..., label[pair[0] // 2] == label[pair[1] // 2]] for x in (vertex, ends))
    first, second = (points[end] - points[vertex] for end in ends)
    return vertex, _length(unit(first) + unit(second)), unit(points[ends[1]] - points[ends[0]])


def _snapped(axes: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Unit vectors with those within ``bound`` (n,) of a coordinate axis put on it, so that sliding there
    changes no bit of a coordinate that is to stay.
    """
    largest = np.abs(axes).argmax(axis=1)[:, None] == np.arange(axes.shape[1])
    on_axis = np.where(largest, np.sign(axes), 0.0)
    near = np.abs(axes - on_axis).max(axis=1, initial=0.0) <= bound
    return np.where(near[:, None], on_axis, axes)


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt((vectors * vectors).sum(axis=-1))
