"""Walls: how far from a sheet of facets the sheet across is, be there material or a gap between them.

Two sheets that each come half as far from the input as they are apart can cross. So where a wall is thin the
boundary may come from the input by at most a third of its thickness (see ``relax.surface.overlay``).

From a few points of each facet a ray goes both ways along its normal, through the cells of a grid that have
the facets which are near. Where all that are near are of one patch and look the same way as the facet, they
are its own sheet, and are not looked at one by one. Large cells tell first for most facets that this is so.
The sides of a channel in the plane are walls that stand on it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dvr_cli.boundary.freedom import unit
from dvr_cli.mesh.csr import group, row_entries
from dvr_cli.mesh.ranks import distinct

_SAMPLES = np.array([[1, 1, 1], [8, 1, 1], [1, 8, 1], [1, 1, 8]])  # barycentric, within a triangle
_CELLS = 27  # cells of the grid that a facet is in, on average at most
_BITS = 20  # of the number of a cell along an axis
_FARTHEST = (1 << _BITS) - 1  # that number at most; all beyond are one
_ONE_WAY = 0.5  # cosine of the angle up to which two facets look the same way
_HALF_THAT = 0.75**0.5  # the cosine of half that angle
_LARGE = 1.5  # width of large cells, in that of a facet and what its rays reach
_PAIRS = 1 << 20  # pairs of a ray and a facet looked at together


def thickness(
    points: np.ndarray, triangles: np.ndarray, patch: np.ndarray, plane: np.ndarray, reach: float
) -> np.ndarray:
    """(T,) how far from each triangle the next one straight across is, infinite beyond ``reach``.

    points: (N, 3); triangles: (T, 3) of the boundary or surface; patch: (T,) the smooth part each is of.
    plane: (T,) bool, those whose shape stays as it is: between two of these no wall counts.
    Triangles with a vertex or an edge in common, or between them, are not across from each other.
    """
    corners = points.take(triangles, axis=0)
    normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    result = np.full(len(triangles), np.inf)
    chosen = _near_others(corners, normals, patch, plane, reach)
    if not len(chosen):
        return result
    corners, normals, patch, plane = corners[chosen], normals[chosen], patch[chosen], plane[chosen]
    grid, edges = _Grid.of(corners, normals, patch), _Edges(triangles, len(points))
    steps = int(np.ceil(reach / grid.step))
    facets = np.arange(len(chosen))
    for weights in _SAMPLES / _SAMPLES.sum(axis=1, keepdims=True):
        origin, passed = weights @ corners[facets], np.zeros(len(facets), dtype=bool)
        for along in np.arange(-steps, steps + 1) * (reach / max(steps, 1)):
            cell = grid.find(origin + along * normals[facets])
            ray = np.flatnonzero(cell >= 0)
            ray = ray[~grid.is_sheet_of(cell[ray], normals[facets[ray]], patch[facets[ray]])]
            passed[ray] = True
            for some, other in grid.pairs(ray, cell[ray]):
                moves = ~(plane[facets[some]] & plane[other])
                some, other = some[moves], other[moves]
                one = facets[some]
                gap = _gap(origin[some], corners[other], normals[one])
                near = np.flatnonzero(gap <= reach)
                one, other, gap = chosen[one[near]], chosen[other[near]], gap[near]
                apart = ~edges.between(one, other)
                np.minimum.at(result, one[apart], gap[apart])
                np.minimum.at(result, other[apart], gap[apart])
        facets = facets[passed]  # where the ray from the middle comes by no other sheet none will
    return result


def width(points: np.ndarray, segments: np.ndarray, curve: np.ndarray, reach: float) -> np.ndarray:
    """(S,) how far from each segment of a plane's curves the next one straight across is; see ``thickness``.

    points: (N, 3), in the plane z = 0; segments: (S, 2); curve: (S,) the number of the curve each is of. They
    are taken for the lower edges of walls that stand on the plane.
    """
    used, number = np.unique(segments, return_inverse=True)
    lower = points[used]
    a, b = number.reshape(-1, 2).T
    height = np.sqrt(((lower[b] - lower[a]) ** 2).sum(axis=1)).mean()
    both = np.concatenate([lower, lower + np.array([0.0, 0.0, height])])
    c, d = b + len(used), a + len(used)
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    across = thickness(both, triangles, np.tile(curve, 2), np.zeros(len(triangles), dtype=bool), reach)
    return across.reshape(2, -1).min(axis=0)


def _near_others(
    corners: np.ndarray, normals: np.ndarray, patch: np.ndarray, plane: np.ndarray, reach: float
) -> np.ndarray:
    """(n,) the facets that may have another sheet within ``reach``, and all that this may be, ascending.

    corners: (T, 3, 3); normals, patch, plane: of each. Each facet is in all cells that it comes to within
    half of ``reach``, so it shares one with any that a ray of it hits.
    """
    cells = _Cells.of(corners, 0.5 * reach, _LARGE, 0.0)
    alike, start = cells.alike(normals, patch, _HALF_THAT)[0], cells.start
    still = np.logical_and.reduceat(plane[cells.facet], start[:-1])
    looked_at = ~(np.logical_and.reduceat(alike, start[:-1]) | still)
    chosen = np.zeros(len(corners), dtype=bool)
    chosen[cells.facet[np.repeat(looked_at, np.diff(start))]] = True
    return np.flatnonzero(chosen)


@dataclass(frozen=True, eq=False)
class _Cells:
    """The cells of a grid that are not empty.

    keys: (C,) their numbers, ascending; facet, start: the facets in each, in their order.
    """

    origin: np.ndarray
    step: float
    keys: np.ndarray
    facet: np.ndarray
    start: np.ndarray

    @classmethod
    def of(cls, corners: np.ndarray, around: float, wide: float, margin: float) -> _Cells:
        """Those of cells so wide, or wider, that are no farther than ``margin`` steps from facets.

        corners: (T, 3, 3). around: how far beyond its corners each facet reaches. wide: in mean widths of
        these.
        """
        a, b, c = corners.swapaxes(0, 1)
        low = np.minimum(np.minimum(a, b), c) - around
        high = np.maximum(np.maximum(a, b), c) + around
        step = wide * float((high - low).max(axis=1).mean())
        while True:
            origin = low.min(axis=0) - step
            first = _place(low - margin * step, origin, step)
            width = _place(high + margin * step, origin, step) - first + 1
            count = width.prod(axis=1)
            if count.sum() <= _CELLS * len(low):
                break
            step *= 1.5
        # these arrays are the largest of a run: 32 bits where they are enough, and column by column
        first, width = first.astype(np.int32), width.astype(np.int32)
        facet = np.repeat(np.arange(len(low), dtype=np.int32), count)
        number = np.arange(len(facet), dtype=np.int32)
        number -= np.repeat((np.cumsum(count) - count).astype(np.int32), count)
        key = np.zeros(len(facet), dtype=np.int64)
        for i in range(3):
            across = width[:, i][facet]
            key = key << _BITS | (first[:, i][facet] + number % across)
            number //= across
        del number, across, first, width, count, low, high
        keys = distinct(key)
        key = np.searchsorted(keys, key).astype(np.int32)
        position, start = group(key, len(keys))
        return cls(origin, step, keys, facet[position], start)

    def alike(
        self, normals: np.ndarray, patch: np.ndarray, cosine: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The facets in a cell that are of the patch of its first, and look as its facets do on average.

        normals, patch: of each facet. cosine: that of the angle up to which this is so. Returns a bool for
        each entry of ``facet``, the mean normals (C, 3) and the patch (C,) of each cell.
        """
        facet, start = self.facet, self.start
        own = patch[facet[start[:-1]]]
        cell = np.repeat(np.arange(len(own), dtype=np.int32), np.diff(start))
        mean = unit(np.stack([np.bincount(cell, along[facet]) for along in normals.T], axis=1))
        along = np.zeros(len(facet))
        for one, other in zip(normals.T, mean.T, strict=True):
            along += one[facet] * other[cell]
        return (along > cosine) & (patch[facet] == own[cell]), mean, own


@dataclass(frozen=True, eq=False)
class _Grid:
    """The cells of a grid, and the facets in each.

    A ray that is looked at every ``step`` comes by all facets that it hits. single: (C,) bool, whether the
    facets of a cell are of one patch and look the same way, that of ``normals`` (C, 3); patch: (C,) that of
    the first.
    """

    cells: _Cells
    single: np.ndarray
    normals: np.ndarray
    patch: np.ndarray

    @classmethod
    def of(cls, corners: np.ndarray, normals: np.ndarray, patch: np.ndarray) -> _Grid:
        """That of facets with these corners (T, 3, 3), unit normals (T, 3) and patches (T,)."""
        cells = _Cells.of(corners, 0.0, 1.0, 0.5)
        alike, mean, own = cells.alike(normals, patch, _ONE_WAY)
        return cls(cells, np.logical_and.reduceat(alike, cells.start[:-1]), mean, own)

    @property
    def step(self) -> float:
        """The width of a cell."""
        return self.cells.step

    def find(self, points: np.ndarray) -> np.ndarray:
        """(n,) the cell of each point, -1 for one without facets."""
        keys = self.cells.keys
        key = _key(_place(points, self.cells.origin, self.step))
        cell = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
        return np.where(keys[cell] == key, cell, -1)

    def is_sheet_of(self, cell: np.ndarray, normals: np.ndarray, patch: np.ndarray) -> np.ndarray:
        """(n,) bool: whether all in a cell are of the sheet of a facet with this normal and patch."""
        alike = (self.normals[cell] * normals).sum(axis=1) > _ONE_WAY
        return np.asarray(self.single[cell] & (self.patch[cell] == patch) & alike)

    def pairs(self, ray: np.ndarray, cell: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Each ray with each facet in its cell, in portions."""
        start, facet = self.cells.start, self.cells.facet
        ahead = np.cumsum(np.diff(start)[cell])
        cuts = np.searchsorted(ahead, np.arange(_PAIRS, ahead[-1] if len(ahead) else 0, _PAIRS))
        for some, where in zip(np.split(ray, cuts), np.split(cell, cuts), strict=True):
            entries, row_start = row_entries(start, where)
            yield np.repeat(some, np.diff(row_start)), facet[entries]


class _Edges:
    """The edges of triangles, to ask whether two of these are neighbours."""

    def __init__(self, triangles: np.ndarray, n_points: int) -> None:
        self._triangles, self._n = triangles.astype(np.int64), n_points

    @cached_property
    def _keys(self) -> np.ndarray:
        """Of all ordered pairs of vertices of a triangle, a vertex with itself too, ascending."""
        a, b, n = self._triangles.ravel(), self._triangles[:, [1, 2, 0]].ravel(), self._n
        return distinct(np.concatenate([a * n + b, b * n + a, np.arange(n) * (n + 1)]))

    def between(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(n,) bool: whether triangles share a vertex, or an edge leads from the one to the other."""
        a, b = self._triangles[one], self._triangles[other]
        wanted = (a[:, :, None] * self._n + b[:, None, :]).reshape(-1, 9)
        place = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
        return np.asarray((self._keys[place] == wanted).any(axis=1))


def _place(points: np.ndarray, origin: np.ndarray, step: float) -> np.ndarray:
    """(n, 3) the cell of each point along each axis."""
    return np.clip((points - origin) // step, 0, _FARTHEST).astype(np.int64)


def _key(place: np.ndarray) -> np.ndarray:
    """(n,) one number for each cell."""
    return place[:, 0] << 2 * _BITS | place[:, 1] << _BITS | place[:, 2]


def _gap(origin: np.ndarray, other: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(n,) how far along its normal (n, 3), either way, the ray of a point hits a triangle (n, 3, 3)."""
    e, f = other[:, 1] - other[:, 0], other[:, 2] - other[:, 0]
    x, area = origin - other[:, 0], np.cross(e, f)
    det = (area * normals).sum(axis=1)
    size = np.where(det == 0.0, np.inf, det)
    turned = np.cross(normals, x)  # Möller and Trumbore's test
    u, w = (f * turned).sum(axis=1) / size, -(e * turned).sum(axis=1) / size
    over = (u >= 0.0) & (w >= 0.0) & (u + w <= 1.0) & (det != 0.0)
    return np.where(over, np.abs((x * area).sum(axis=1) / size), np.inf)
