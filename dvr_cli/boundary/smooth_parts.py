"""Smooth parts of boundaries: the surfaces and curves that boundary vertices walk on.

Constraint facets that no ridge parts form a *patch*, ridges that no tip parts a *curve*. Where all of a
patch is plane, or all of a curve straight between plane patches, moving in that plane or line is exact and
needs no walk; elsewhere vertices walk on their patch or curve as the input has it. The lips of a slit,
coincident but not connected, would cut into each other along different chords of a curve: there vertices
stay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.backend import Backend
from dvr_cli.boundary.constraints import Constraints, edges_of
from dvr_cli.boundary.features import Features
from dvr_cli.boundary.freedom import Freedom, unit
from dvr_cli.boundary.triangles import triangulated
from dvr_cli.boundary.unconnected import coincident_vertices
from dvr_cli.boundary.unfolding import Unfolding
from dvr_cli.mesh.csr import group
from dvr_cli.mesh.facets import numbered, vertices_of
from dvr_cli.mesh.mesh import Cells
from dvr_cli.mesh.orientation import connected_parts, unlike_cells, with_mirrored


@dataclass(frozen=True, eq=False)
class SmoothParts:
    """The vertices that walk, and the freedom of those that move exactly.

    triangles: (T, 3) the constraint facets, quadrilaterals cut in two; none in a planar mesh. facet: (T,) the
        facet each is of. patch: (T,) the number of its patch. plane: (P,) bool, whether all of a patch is
        in one plane, to rounding.
    segments: (S, 2) the ridges; curve: (S,) the number of the curve each is of.
    on_patch, on_curve: (m,) the vertices that walk on their patch or their curve.
    exact: the freedom of all other vertices.
    before: (N, d) the coordinates of the input, and off: (T,) how far each triangle is from its boundary,
        where folded triangles were unfolded.
    """

    triangles: np.ndarray
    facet: np.ndarray
    patch: np.ndarray
    plane: np.ndarray
    segments: np.ndarray
    curve: np.ndarray
    on_patch: np.ndarray
    on_curve: np.ndarray
    exact: Freedom
    before: np.ndarray
    off: np.ndarray

    @property
    def walking(self) -> np.ndarray:
        """(m,) all vertices that walk, in index order."""
        return np.sort(np.concatenate([self.on_patch, self.on_curve]))


def smooth_parts_of(
    before: np.ndarray, constraints: Constraints, smooth: Features, flat: Freedom, unfolding: Unfolding | None
) -> SmoothParts:
    """The smooth parts of a boundary, and who moves on them.

    before: (N, d) the coordinates of the input; unfolding: what was done to it, None for nothing.
    smooth: the features at the feature angle; flat: the freedom within exact planes and lines. What may move
    by neither stays.
    """
    points = before if unfolding is None else unfolding.points
    facets, ridges, n_points = constraints.facets, smooth.ridges, len(points)
    dimension, exact = smooth.freedom.dimension, flat.dimension
    faces = facets if facets.shape[1] > 2 else np.empty((0, 3), dtype=np.int64)
    triangles, facet = triangulated(faces)
    triangles = _alike(triangles, constraints.two_sided[facet], constraints.backend)
    patch = _patches(faces, ridges, constraints.backend)[facet]
    curve = _curves(ridges, dimension == 1)

    plane = _plane(points, triangles, patch, constraints.rounding)
    at_bend = np.zeros(n_points, dtype=bool)
    at_bend[triangles[~plane[patch]]] = True
    movable = (dimension == 1) | ((dimension == 2) & (len(faces) > 0))
    stays_exact = movable & (exact == dimension) & ~at_bend
    # a curve is straight if none of its vertices bends it
    crooked = np.zeros(int(curve.max(initial=-1)) + 1, dtype=bool)
    crooked[curve[(movable & ~stays_exact & (dimension == 1))[ridges].any(axis=1)]] = True
    on_crooked = np.zeros(n_points, dtype=bool)
    on_crooked[ridges[crooked[curve]]] = True
    stays_exact &= (dimension != 1) | ~on_crooked
    walks = movable & ~stays_exact & ~_coincident(points, facets)
    kept = np.where(movable, stays_exact, exact > 0)
    return SmoothParts(
        triangles=triangles,
        facet=facet,
        patch=patch,
        plane=plane,
        segments=ridges,
        curve=curve,
        on_patch=np.flatnonzero(walks & (dimension == 2)),
        on_curve=np.flatnonzero(walks & (dimension == 1)),
        exact=flat.only(kept),
        before=before,
        off=np.zeros(len(triangles)) if unfolding is None else unfolding.off,
    )


def _patches(facets: np.ndarray, ridges: np.ndarray, backend: Backend) -> np.ndarray:
    """(F,) the number of each facet's patch: facets with a common edge that is no ridge have the same."""
    if not len(facets):
        return np.empty(0, dtype=np.int64)
    edges, owner = edges_of(facets)
    number = numbered(np.concatenate([edges, ridges]), backend)
    n = int(number.max(initial=-1)) + 1
    parted = np.zeros(n, dtype=bool)
    parted[number[len(edges) :]] = True
    position, start = backend.twin(group)(number[: len(edges)], n)
    pair = start[:-1][(np.diff(start) == 2) & ~parted]
    parts = backend.twin(connected_parts)
    return _numbers(parts(len(facets), owner[position[pair]], owner[position[pair + 1]]))


def _alike(triangles: np.ndarray, two_sided: np.ndarray, backend: Backend) -> np.ndarray:
    """Triangles (T, 3), those whose order means nothing (``two_sided``) in the order of their neighbours."""
    if not two_sided.any():
        return triangles
    sheets, alike = [Cells("triangle", triangles[two_sided])], triangles.copy()
    unlike = unlike_cells(np.ones(two_sided.sum()), sheets, backend)
    alike[two_sided] = with_mirrored(sheets, unlike)[0].vertices
    return alike


def _curves(ridges: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """(R,) the number of each ridge's curve: ridges that meet at an ``inner`` vertex ((N,) bool) share it."""
    position, start = group(ridges.ravel(), len(inner))
    pair = start[:-1][inner]  # two ridges meet there
    return _numbers(connected_parts(len(ridges), position[pair] // 2, position[pair + 1] // 2))


def _plane(points: np.ndarray, triangles: np.ndarray, patch: np.ndarray, rounding: float) -> np.ndarray:
    """(P,) bool: whether all vertices of each patch lie in one plane, to rounding."""
    n = int(patch.max(initial=-1)) + 1
    if not n:
        return np.empty(0, dtype=bool)
    a, b, c = (points.take(column, axis=0) for column in triangles.T)
    area, centre = np.cross(b - a, c - a), (a + b + c) / 3.0
    total, all_places = (np.stack([np.bincount(patch, x, n) for x in of.T], axis=1) for of in (area, centre))
    middle = (all_places / np.bincount(patch, minlength=n)[:, None]).take(patch, axis=0)
    normal = unit(total).take(patch, axis=0)
    plane = np.ones(n, dtype=bool)
    for corner in (a, b, c):
        height = np.abs(((corner - middle) * normal).sum(axis=1))
        plane[patch[height > 4.0 * rounding]] = False
    return plane


def _coincident(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """(N,) bool: the vertices of the facets that lie where another one of them does."""
    result = np.zeros(len(points), dtype=bool)
    result[coincident_vertices(points, vertices_of(facets))] = True
    return result


def _numbers(labels: np.ndarray) -> np.ndarray:
    return np.unique(labels, return_inverse=True)[1]
