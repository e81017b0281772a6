"""Manifolds: curves of segments and surfaces of triangles, and the points on them nearest to given ones.

The nearest point is searched for by walking: from a simplex near by to that of its neighbours which is
nearest, until none is nearer. This is the nearest point of the part around the start, which is what is asked
for: a point is not taken to the other side of a thin wall or a crack, however near that is.
The distance found is never less than the distance to the whole manifold.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.mesh.csr import group, row_entries

_DEGENERATE = 1e-14  # squared sine of an angle up to which a triangle has no inside to speak of
_ZERO = 1e-13  # products of lengths up to which a place counts as beside an edge, in units of a triangle
_ON_SIDE = 1e-9  # barycentric coordinate up to which a point counts as on the side where it is zero


class Manifold:
    """Segments (k = 2) or triangles (k = 3) in d = 2 or 3 coordinates, in patches that walks do not leave.

    points: (N, d); simplices: (F, k) their vertices; patch: (F,) the number of the patch each belongs to.
    star: those around each vertex, as offsets (N + 1,) and numbers, ascending at each; None to find them.
    """

    def __init__(
        self,
        points: np.ndarray,
        simplices: np.ndarray,
        patch: np.ndarray,
        star: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        self.points, self.simplices, self.patch = points, simplices, patch
        if star is None:
            position, start = group(simplices.ravel(), len(points))
            star = start, position // simplices.shape[1]
        self._start, self._around = star

    def at(self, points: np.ndarray) -> Manifold:
        """The same with its vertices at ``points`` (N, d)."""
        return Manifold(points, self.simplices, self.patch, (self._start, self._around))

    def places(self, simplices: np.ndarray) -> np.ndarray:
        """(n, k, d) where the vertices of simplices (n,) are."""
        return self.points[self.simplices[simplices]]

    def nearest(self, queries: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The point nearest to each of ``queries`` (n, d) around the simplices ``near`` (n,).

        Returns the points (n, d), the simplices they lie on (n,), and their distances (n,).
        """
        simplex = near.copy()
        foot, square = _closest(self.places(simplex), queries)
        walking = np.arange(len(queries))
        while len(walking):
            at = simplex[walking]
            supports = _supports(self.places(at), foot[walking])
            on_side = ~supports.all(axis=1)  # inside a simplex the foot is nearer than what is around
            walking, at, supports = walking[on_side], at[on_side], supports[on_side]
            rows, candidate, row_start = self._beyond(at, supports)
            feet, squares = _closest(self.places(candidate), queries[walking[rows]])
            best = _first_least(squares, row_start)
            nearer = squares[best] < square[walking]
            walking, best = walking[nearer], best[nearer]
            simplex[walking], foot[walking], square[walking] = candidate[best], feet[best], squares[best]
        return foot, simplex, np.sqrt(square)

    def _beyond(self, simplex: np.ndarray, supports: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The simplices of its patch that share the vertices marked in ``supports`` (n, k) with each (n,).

        Returns row and simplex of each (E,), row after row, and where rows begin (n + 1,).
        """
        vertices = self.simplices[simplex]
        first, last = supports.argmax(axis=1), supports.shape[1] - 1 - supports[:, ::-1].argmax(axis=1)
        everyone = np.arange(len(simplex))
        entries, row_start = row_entries(self._start, vertices[everyone, first])
        candidate, row = self._around[entries], np.repeat(everyone, np.diff(row_start))
        other = np.where(supports.any(axis=1), vertices[everyone, last], vertices[everyone, first])
        shares = (self.simplices[candidate] == other[row][:, None]).any(axis=1)
        shares &= self.patch[candidate] == self.patch[simplex][row]
        row, candidate = row[shares], candidate[shares]
        return row, candidate, np.concatenate([[0], np.cumsum(np.bincount(row, minlength=len(simplex)))])


def _first_least(values: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(n,) position of the first least value in each row start[i] .. start[i+1]; no row may be empty."""
    row = np.repeat(np.arange(len(start) - 1), np.diff(start))
    least = np.flatnonzero(values == np.minimum.reduceat(values, start[:-1])[row])
    _, first = np.unique(row[least], return_index=True)
    return least[first]


def _closest(places: np.ndarray, queries: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The point of each simplex (n, k, d) nearest to its query (n, d), and the squared distance (n,)."""
    if places.shape[1] == 2:
        foot = _closest_on_segments(places, queries)
    else:
        foot = _closest_on_triangles(places, queries)
    way = queries - foot
    square = (way * way).sum(axis=1)
    return foot, np.where(np.isnan(square), np.inf, square)  # nothing is nearest on a degenerate triangle


def _supports(places: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, k) bool: the vertices of each simplex (n, k, d) that a point of it (n, d) is not opposite to.

    All of them inside, two on an edge of a triangle, one at a vertex; none in a degenerate triangle.
    """
    edges, way = places[:, 1:] - places[:, :1], points - places[:, 0]
    with np.errstate(all="ignore"):
        one = edges[:, 0]
        if places.shape[1] == 2:
            t = (way * one).sum(axis=1) / (one * one).sum(axis=1)
            weights = np.stack([1.0 - t, t], axis=1)
        else:
            other = edges[:, 1]
            aa, ab, bb = (one * one).sum(axis=1), (one * other).sum(axis=1), (other * other).sum(axis=1)
            a, b = (way * one).sum(axis=1), (way * other).sum(axis=1)
            u, v = (bb * a - ab * b) / (aa * bb - ab * ab), (aa * b - ab * a) / (aa * bb - ab * ab)
            weights = np.stack([1.0 - u - v, u, v], axis=1)
    return weights > _ON_SIDE


def _closest_on_segments(places: np.ndarray, queries: np.ndarray) -> np.ndarray:
    tail, head = places[:, 0], places[:, 1]
    edge = head - tail
    square = (edge * edge).sum(axis=1)
    along = ((queries - tail) * edge).sum(axis=1)
    t = np.clip(np.divide(along, square, out=np.zeros_like(along), where=square > 0), 0.0, 1.0)[:, None]
    return np.where(t < 1.0, tail + t * edge, head)


def _closest_on_triangles(places: np.ndarray, queries: np.ndarray) -> np.ndarray:
    """See ``_closest``; the regions around a triangle are told apart as Ericson does."""
    # in units of the triangle, from its first vertex
    origin = places[:, 0]
    b, c = places[:, 1] - origin, places[:, 2] - origin
    size = np.maximum(np.abs(b).max(axis=1), np.abs(c).max(axis=1))[:, None]
    size[size == 0.0] = 1.0
    b, c, x = b / size, c / size, (queries - origin) / size
    bb, bc, cc = _dot(b, b), _dot(b, c), _dot(c, c)
    d1, d2, d3, d4, d5, d6 = (_dot(edge, x - p) for p in (np.zeros(3), b, c) for edge in (b, c))
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    with np.errstate(all="ignore"):
        along = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        total = va + vb + vc
        u, w = _chosen(
            ((d1 < _ZERO) & (d2 < _ZERO), 0.0, 0.0),
            ((d3 > -_ZERO) & (d4 <= d3), 1.0, 0.0),
            ((vc < _ZERO) & (d1 > -_ZERO) & (d3 < _ZERO), d1 / (d1 - d3), 0.0),
            ((d6 > -_ZERO) & (d5 <= d6), 0.0, 1.0),
            ((vb < _ZERO) & (d2 > -_ZERO) & (d6 < _ZERO), 0.0, d2 / (d2 - d6)),
            ((va < _ZERO) & (d4 - d3 > -_ZERO) & (d5 - d6 > -_ZERO), 1.0 - along, along),
            (np.ones(len(x), dtype=bool), vb / total, vc / total),
        )
        foot = u[:, None] * b + w[:, None] * c
    foot[bb * cc - bc * bc <= _DEGENERATE * bb * cc] = np.nan
    return np.asarray(origin + size * foot)


def _chosen(*regions: tuple[np.ndarray, float | np.ndarray, float | np.ndarray]) -> list[np.ndarray]:
    """(n,) both coordinates, by the first region that each place is in."""
    where, *coordinates = zip(*regions, strict=True)
    return [np.select(where, column) for column in coordinates]


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) the inner products of vectors (n, 3)."""
    return np.asarray((a * b).sum(axis=1))
