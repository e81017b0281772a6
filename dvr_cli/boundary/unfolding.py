"""Unfolding: facets of a boundary that lie folded over others are laid beside them.

Scans and noisy surfaces hold folded triangles. Their edges turn by nearly 180 degrees, so they would pose as
features, and keep the worst elements as they are. A triangle is *folded* if its normal points away from the
mean normal around its vertices. A sliver poses as a feature likewise if it turns by more than the feature
angle against a neighbour, while its neighbours do not turn against each other, or two slivers side by side
do; they count with the folded ones.

Their vertices move within the tangent plane, across the mean normal of the facets around, to the place that
is farthest from all the lines through the edges around, which is on the inner side of all of them. The sum of
the vector areas around a vertex does not depend on the place of that vertex, so the mean normal is sound even
where these facets lie folded. A vertex moves only if the facets around it that are not folded are one smooth
face, with no border, label or line among them: so no feature is worn down.

What would bring the boundary farther from the input than the bound, or make a cell of a volume worse than the
worst around it was, is undone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from dvr_cli.backend import Backend
from dvr_cli.boundary.constraints import Constraints
from dvr_cli.boundary.freedom import unit
from dvr_cli.boundary.gaps import frames, gaps, samples
from dvr_cli.boundary.triangles import triangulated
from dvr_cli.mesh.corners import Simplices
from dvr_cli.mesh.csr import group, row_entries
from dvr_cli.mesh.facets import numbered
from dvr_cli.mesh.orientation import connected_parts
from dvr_cli.mesh.ranks import distinct
from dvr_cli.quality.mean_ratio import corner_qualities

_SWEEPS = 10  # at most; two or three are usual
_MOST = 16  # edges around a vertex that moves, at most
_GAIN = 1.1  # times as far from the lines around as before a vertex has to come
_REACH = 4  # rings around a vertex that moves in which triangles may be folded afterwards or no longer,
_SIGHT = 3  # and rings around these that this depends on
_FLAT = 1e-9  # determinant of three lines up to which they have no common place


@dataclass(frozen=True)
class Unfolding:
    """A boundary that has been unfolded.

    points: (N, d) where its vertices are then. folded: (n, 3) the triangles that were folded, and left:
    (m, 3) those that still are, by their vertices. off: (T,) how far each of all triangles is from the
    input's boundary, and the other way, at most.
    """

    points: np.ndarray
    folded: np.ndarray
    left: np.ndarray
    off: np.ndarray


def unfold(
    points: np.ndarray,
    constraints: Constraints,
    movable: np.ndarray,
    angle: float,
    bound: float,
    corners: Simplices | None = None,
) -> Unfolding:
    """Lay the folded facets of a boundary beside the others, as far as ``bound`` on the deviation allows.

    points: (N, 3). movable: (N,) bool, all others stay. angle: the feature angle in radians. corners: those
    of a volume mesh, None for a surface.
    """
    triangles, facet = triangulated(constraints.facets)
    everything = _Sheet(triangles, len(points), angle, constraints.backend)
    suspect = triangles[everything.suspects(points)]
    off = np.zeros(len(triangles))
    if not len(suspect):
        return Unfolding(points, suspect, suspect, off)
    here = np.zeros(len(points), dtype=bool)
    here[suspect] = True
    inner = triangles[here[triangles].any(axis=1)]
    here[inner] = True
    near = np.flatnonzero(here[triangles].any(axis=1))
    sheet = everything.part(near)
    first = sheet.folded(points)
    if not first.any():
        return Unfolding(points, suspect[:0], suspect[:0], off)
    may = movable & ~constraints.fixed & sheet.closed() & sheet.alike(constraints.label[facet[near]])
    may[constraints.coincident] = False
    may[constraints.lines] = False
    if constraints.facets.shape[1] > 3:  # quadrilaterals stay as they are
        may[constraints.facets[constraints.facets[:, 3] >= 0]] = False
    mine = np.zeros(len(points), dtype=bool)
    mine[sheet.triangles[first]] = True
    used, numbers = np.unique(sheet.triangles, return_inverse=True)  # few of a large boundary's vertices
    small = _Sheet(numbers.reshape(-1, 3), len(used), angle, constraints.backend)
    moved = points.copy()
    moved[used] = small.unfolded(points[used], (may & mine)[used], first)
    moved, off[near] = _bounded(points, moved, sheet, bound, corners)
    return Unfolding(moved, sheet.triangles[first], sheet.triangles[sheet.folded(moved)], off)


class _Sheet:
    """Triangles of a boundary, and what is around each vertex and beyond each edge."""

    def __init__(self, triangles: np.ndarray, n_points: int, angle: float, backend: Backend) -> None:
        """triangles: (T, 3) of N points. angle: the feature angle in radians. backend: what computes."""
        self.triangles = triangles
        self._n_points, self._angle, self._backend = n_points, angle, backend
        self._cosine = float(np.cos(angle))
        self._half = float(np.cos(0.5 * angle))
        self._corner, self._start = backend.twin(group)(triangles.ravel(), n_points)

    def suspects(self, points: np.ndarray) -> np.ndarray:
        """(T,) bool: the triangles that turn by more than half the feature angle from the mean normal."""
        return self._suspects(*self._normals(points))

    def _suspects(self, area: np.ndarray, mean: np.ndarray) -> np.ndarray:
        """See ``suspects``; area, mean: as ``_normals`` gives them."""
        around = self._around_corners(mean)
        size = np.sqrt((area * area).sum(axis=1) * (around * around).sum(axis=1))
        return (area * around).sum(axis=1) < self._half * size

    def folded(self, points: np.ndarray) -> np.ndarray:
        """(T,) bool: the triangles that are folded, or pose as features."""
        area, mean = self._normals(points)
        away = np.less((area * self._around_corners(mean)).sum(axis=1), 0.0)
        normal, beyond = unit(area), self._beyond
        inside = np.all(beyond >= 0, axis=1)
        turns = inside & ((normal[:, None] * normal[beyond]).sum(axis=2) < self._cosine).any(axis=1)
        alone = np.flatnonzero(turns)
        away[alone[self._agree(normal, beyond[alone])]] = True
        # of two side by side no other neighbour turns from the mean
        off = self._suspects(area, mean)
        partner = np.where((off[beyond] & (beyond >= 0)).sum(axis=1) == 1, off[beyond].argmax(axis=1), -1)
        one = np.flatnonzero(off & turns & (partner >= 0))
        other = beyond[one, partner[one]]
        back = beyond[other, partner[other]]
        paired = off[other] & inside[other] & (partner[other] >= 0) & (back == one)
        one, other = one[paired], other[paired]
        around = np.concatenate([beyond[one], beyond[other]], axis=1)
        outer = (around != one[:, None]) & (around != other[:, None])
        four = outer.sum(axis=1) == 4
        one, other = one[four], other[four]
        agree = self._agree(normal, around[four][outer[four]].reshape(-1, 4))
        away[one[agree]], away[other[agree]] = True, True
        return away

    def closed(self) -> np.ndarray:
        """(N,) bool: the vertices at which every edge has two triangles."""
        result = np.ones(self._n_points, dtype=bool)
        for k in range(3):
            single = self.triangles[self._beyond[:, k] < 0]
            result[single[:, (k + 1) % 3]] = False
            result[single[:, (k + 2) % 3]] = False
        return result

    def alike(self, label: np.ndarray) -> np.ndarray:
        """(N,) bool: the vertices whose triangles all have the same of the labels (T,)."""
        least, most = np.full(self._n_points, np.iinfo(np.int64).max), np.full(self._n_points, -1)
        for column in self.triangles.T:
            np.minimum.at(least, column, label)
            np.maximum.at(most, column, label)
        return least >= most

    def unfolded(self, points: np.ndarray, may: np.ndarray, folded: np.ndarray) -> np.ndarray:
        """The points (N, 3) with those vertices that ``may`` ((N,) bool) moved to where nothing is folded.

        folded: (T,) bool, the triangles that are folded where the points are.
        """
        points, folded = points.copy(), folded.copy()
        for _ in range(_SWEEPS):
            vertices = distinct(self.triangles[folded].ravel())
            vertices = vertices[may[vertices]]
            if not len(vertices):
                break
            around = self._touching(vertices)
            star = self.part(around)
            vertices = vertices[star._smooth(points, folded[around])[vertices]]
            vertices, places, room = star._places(points, vertices)
            chosen = star._apart(vertices[np.argsort(-room, kind="stable")], len(points))
            if not chosen.any():
                break
            here = chosen[vertices]
            points[vertices[here]] = places[here]
            changed = self._within(_REACH, vertices[here])
            near = self._within(_REACH + _SIGHT, vertices[here])
            folded[changed] = self.part(near).folded(points)[np.searchsorted(near, changed)]
        return points

    def part(self, triangles: np.ndarray) -> _Sheet:
        """Some of the triangles ((n,) numbers) as a sheet."""
        return _Sheet(self.triangles[triangles], self._n_points, self._angle, self._backend)

    def _touching(self, vertices: np.ndarray) -> np.ndarray:
        """(n,) the triangles around vertices (m,), ascending."""
        here = np.zeros(len(self.triangles), dtype=bool)
        here[self._corner[row_entries(self._start, vertices)[0]] // 3] = True
        return np.flatnonzero(here)

    def _within(self, rings: int, vertices: np.ndarray) -> np.ndarray:
        """(n,) the triangles within so many rings around vertices (m,), ascending."""
        triangles = self._touching(vertices)
        for _ in range(1, rings):
            reached = np.zeros(self._n_points, dtype=bool)
            reached[self.triangles[triangles]] = True
            triangles = self._touching(np.flatnonzero(reached))
        return triangles

    def gaps(self, before: np.ndarray, after: np.ndarray, part: np.ndarray) -> np.ndarray:
        """(T,) how far the triangles that moved are from the sheet as it was, and the other way, at most.

        part: (N,) the part of the sheet that each vertex moved with, -1 for those that did not.
        """
        own = part[self.triangles].max(axis=1)
        moved = np.flatnonzero(own >= 0)
        own = np.unique(own[moved], return_inverse=True)[1]
        area = self._normals(after)[0][moved]
        total = np.stack([np.bincount(own, component) for component in area.T], axis=1)
        frame = frames(unit(total))
        # facets that lay folded may have lain over what is around their part, or farther out
        near = self._around(own, moved)
        far = np.zeros(len(self.triangles))
        for origin, target in ((before, after), (after, before)):
            found = self._gaps(origin, target, moved, own, near, frame)
            off = np.isinf(found)
            if off.any():
                wide = np.isin(near[:, 0], own[off])
                wider = self._around(*near[wide].T)
                found[off] = self._gaps(origin, target, moved[off], own[off], wider, frame)
            far[moved] = np.maximum(far[moved], found)
        return far

    def _around(self, part: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        """(m, 2) pairs of a part and a triangle: those given ((n,) each), and with neighbours of these."""
        entries, start = row_entries(self._start, self.triangles[triangles].ravel())
        owner = np.repeat(np.repeat(part, 3), np.diff(start))
        return np.unique(np.stack([owner, self._corner[entries] // 3], axis=1), axis=0)

    def _gaps(
        self,
        origin: np.ndarray,
        target: np.ndarray,
        triangles: np.ndarray,
        part: np.ndarray,
        near: np.ndarray,
        frame: np.ndarray,
    ) -> np.ndarray:
        """(n,) the largest gap between triangles of a part at ``origin`` and those near at ``target``."""
        spread = samples(origin[self.triangles[triangles]])
        of = np.repeat(part, spread.shape[1])
        where = target[self.triangles[near[:, 1]]], near[:, 0], frame
        gap = gaps(spread.reshape(-1, 3), of, *where, self._backend)
        return gap.reshape(len(triangles), -1).max(axis=1)

    def _around_corners(self, mean: np.ndarray) -> np.ndarray:
        """(T, 3) the sum of the mean normals (N, 3) at the corners of each triangle."""
        a, b, c = (mean.take(column, axis=0) for column in self.triangles.T)
        return a + b + c

    def _agree(self, normal: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        """(n,) bool: whether none of ``triangles`` (n, k) turns against another by the feature angle."""
        several = normal[triangles]
        return (np.einsum("nik,njk->nij", several, several) >= self._cosine).all(axis=(1, 2))

    def _normals(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The vector areas (T, 3) of the triangles, and their sums (N, 3) around the vertices."""
        a, b, c = (points.take(column, axis=0) for column in self.triangles.T)
        area = np.cross(b - a, c - a)
        mean = np.stack(
            [
                np.bincount(self.triangles.ravel(), np.repeat(component, 3), minlength=len(points))
                for component in area.T
            ],
            axis=1,
        )
        return area, mean

    @cached_property
    def _beyond(self) -> np.ndarray:
        """(T, 3) the triangle across each edge, -1 where there is not exactly one."""
        sides = self.triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
        name = numbered(sides, self._backend)
        position, start = self._backend.twin(group)(name, int(name.max(initial=-1)) + 1)
        pair = start[:-1][np.diff(start) == 2]
        one, other = position[pair], position[pair + 1]
        beyond = np.full(len(name), -1)
        beyond[one], beyond[other] = other // 3, one // 3
        return beyond.reshape(-1, 3)

    def _smooth(self, points: np.ndarray, folded: np.ndarray) -> np.ndarray:
        """(N,) bool: the vertices whose triangles that are not folded are close to their mean normal."""
        area, mean = self._normals(points)
        normal, mean = unit(area), unit(mean)
        off = (normal[:, None] * mean[self.triangles]).sum(axis=2) < self._cosine
        off &= ~folded[:, None] & (area * area).sum(axis=1)[:, None].astype(bool)
        result = np.ones(len(points), dtype=bool)
        result[self.triangles[off]] = False
        return result

    def _places(self, points: np.ndarray, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The vertices among ``vertices`` (n,) that have a better place, that place, and its room."""
        _, mean = self._normals(points)
        size = np.diff(self._start)[vertices]
        found, places, rooms = [vertices[:0]], [points[:0]], [np.empty(0)]
        for count in np.unique(size[size <= _MOST]):
            some = vertices[size == count]
            entries, _ = row_entries(self._start, some)
            corner = self._corner[entries]
            triangle, k = corner // 3, corner % 3
            first = self.triangles[triangle, (k + 1) % 3].reshape(-1, count)
            second = self.triangles[triangle, (k + 2) % 3].reshape(-1, count)
            basis = frames(unit(mean[some]))[:, :, :2]
            here = points[some][:, None]
            p, q = ((points[end] - here) @ basis for end in (first, second))
            place, room, now = _roomiest(p, q)
            edge = np.sqrt(((p - q) ** 2).sum(axis=2)).mean(axis=1)
            better = (room > 0.0) & (room > _GAIN * now)
            found.append(some[better])
            places.append((here[:, 0] + np.einsum("nij,nj->ni", basis, place))[better])
            rooms.append((room / np.where(edge > 0.0, edge, 1.0))[better])
        return np.concatenate(found), np.concatenate(places), np.concatenate(rooms)

    def _apart(self, vertices: np.ndarray, n_points: int) -> np.ndarray:
        """(N,) bool: of ``vertices``, taken in this order, those that share no triangle with one before."""
        taken, chosen = np.zeros(n_points, dtype=bool), np.zeros(n_points, dtype=bool)
        for vertex in vertices:
            around = self.triangles[self._corner[self._start[vertex] : self._start[vertex + 1]] // 3]
            if not taken[around].any():
                taken[around], chosen[vertex] = True, True
            taken[vertex] = True
        return chosen


def _roomiest(p: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The place (n, 2) farthest on the inner side from the lines from p to q ((n, k, 2)), anticlockwise.

    Returns the place, its smallest distance (n,) from the lines, negative on the outer side of one, and that
    of the origin. The smallest distance is concave and its maximum at equal distance from three of the lines.
    """
    along = unit((q - p).reshape(-1, 2)).reshape(p.shape)
    normal = np.stack([-along[..., 1], along[..., 0]], axis=2)
    offset = (normal * p).sum(axis=2)
    three = np.array(list(combinations(range(p.shape[1]), 3)))
    a, c = normal[:, three], offset[:, three]
    matrix = np.concatenate([a, np.full((*a.shape[:-1], 1), -1.0)], axis=3)
    usable = np.abs(np.linalg.det(matrix)) > _FLAT
    matrix[~usable] = np.eye(3)
    place = np.linalg.solve(matrix, c[..., None])[..., :2, 0]
    distance = (np.einsum("nti,nki->ntk", place, normal) - offset[:, None]).min(axis=2)
    distance[~usable] = -np.inf
    best = distance.argmax(axis=1)
    rows = np.arange(len(p))
    return place[rows, best], distance[rows, best], (-offset).min(axis=1)


def _bounded(
    before: np.ndarray, after: np.ndarray, sheet: _Sheet, bound: float, corners: Simplices | None
) -> tuple[np.ndarray, np.ndarray]:
    """The points ``after`` with parts undone that are too far or make cells worse, and how far triangles are.

    A part is what moves together: vertices that have a triangle, or a corner of a volume, in common.
    """
    moved = (before != after).any(axis=1)
    if not moved.any():
        return before, np.zeros(len(sheet.triangles))
    around = moved[sheet.triangles].any(axis=1)
    groups = [sheet.triangles[around]]
    if corners is not None:
        touched = np.flatnonzero(moved[corners.vertices].any(axis=1))
        groups.append(corners.vertices[touched])
    part = _parts(moved, groups)
    far = sheet.gaps(before, after, part)
    undone = np.zeros(len(before) + 1, dtype=bool)  # the last for what has no moved vertex
    undone[part[sheet.triangles[far > bound]]] = True
    if corners is not None:
        some = corners.part(touched)
        worst = []
        for points in (before, after):
            least = np.full(len(before) + 1, np.inf)
            np.minimum.at(least, part[some.vertices], corner_qualities(points, some)[:, None])
            worst.append(least)
        undone |= worst[1] < worst[0]
    undone[-1] = False
    result = np.where(undone[part][:, None], before, after)
    far[undone[part[sheet.triangles]].any(axis=1)] = 0.0
    return result, far


def _parts(moved: np.ndarray, groups: list[np.ndarray]) -> np.ndarray:
    """(N,) the number of the part each moved vertex is in, -1 for others; see ``_bounded``."""
    tails, heads = [], []
    for rows in groups:
        lead = rows[np.arange(len(rows)), moved[rows].argmax(axis=1)]
        for column in rows.T:
            both = moved[column]
            tails.append(lead[both])
            heads.append(column[both])
    part = connected_parts(len(moved), np.concatenate(tails), np.concatenate(heads))
    return np.where(moved, part, -1)
