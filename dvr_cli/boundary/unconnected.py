"""Vertices that touch what they are not connected to: those that hang on a facet, those in one place.

A vertex *hangs* on a facet if it lies inside it or inside an edge of it and is not one of its vertices: in a
mesh refined in part, in the middle of the edge or face of a coarser neighbour.
"""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np

from dvr_cli.mesh.facets import vertices_of
from dvr_cli.mesh.hashing import mixed
from dvr_cli.mesh.ranks import distinct

_NEAR = 1e-6  # of the size of a facet: how far off it a vertex may be to count as on it
_PAIRS = 1 << 20  # pairs of facets and vertices looked at together


def hanging_vertices(
    points: np.ndarray, facets: np.ndarray, vertices: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The vertices (m,) of ``facets`` (F, w) that hang on another one, and the facets (k,) they hang on.

    Shorter rows end in -1.

    points: (N, d). Facets are edges in the plane, planar faces in space. vertices: (n,) those asked about
    that differ in place from all corners of a facet they hang on; by default all of the facets.
    """
    vertices = vertices_of(facets) if vertices is None else vertices
    hangs, holds = np.zeros(len(points), dtype=bool), np.zeros(len(facets), dtype=bool)
    filled = np.where(facets < 0, facets[:, :1], facets)
    low, high = points[filled].min(axis=1), points[filled].max(axis=1)
    size = (high - low).max(axis=1, initial=0.0)
    level = levels_of(points[filled])
    for one in distinct(level[size > 0]):
        own = np.flatnonzero((level == one) & (size > 0))
        width = np.ldexp(1.0, int(one))
        place = boxes(np.floor(points[vertices] / width))
        order = np.argsort(place, kind="stable")
        first = np.floor(low[own] / width)
        for step in product((0.0, 1.0), repeat=points.shape[1]):
            box = boxes(first + step)
            start, stop = (np.searchsorted(place[order], box, side=side) for side in ("left", "right"))
            for lo, hi in _portions(stop - start):
                count = (stop - start)[lo:hi]
                facet = np.repeat(own[lo:hi], count)
                offset = np.arange(len(facet)) - np.repeat(np.cumsum(count) - count, count)
                vertex = vertices[order[np.repeat(start[lo:hi], count) + offset]]
                near = _NEAR * size[facet][:, None]
                above, below = points[vertex] - low[facet] >= -near, points[vertex] - high[facet] <= near
                inside = (above & below).all(axis=1)
                vertex, facet = vertex[inside], facet[inside]
                on = _lies_on(points, vertex, filled[facet], size[facet])
                hangs[vertex[on]] = True
                holds[facet[on]] = True
    return np.flatnonzero(hangs), np.flatnonzero(holds)


def coincident_vertices(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """The vertices among ``vertices`` (m,) that are in the very place of another one of them."""
    number = boxes(points[vertices])
    ascending = np.sort(number)
    again = ascending[1:][ascending[1:] == ascending[:-1]]
    if not len(again):  # the rule, found in a tenth of the time
        return vertices[:0]
    vertices = vertices[np.isin(number, again)]
    places = points[vertices] + 0.0  # of -0.0 and 0.0 one
    _, number, count = np.unique(places, axis=0, return_inverse=True, return_counts=True)
    return vertices[count[number.ravel()] > 1]


def levels_of(corners: np.ndarray) -> np.ndarray:
    """(F,) the level of each facet: into two boxes of width 2^level along each axis it reaches at most.

    corners: (F, w, d).
    """
    return np.frexp((corners.max(axis=1) - corners.min(axis=1)).max(axis=1, initial=0.0))[1]


def boxes(cells: np.ndarray) -> np.ndarray:
    """(n,) a number for each box of a grid, given by whole numbers (n, d), or for each place."""
    number = np.zeros(len(cells), dtype=np.uint64)
    for column in cells.T:
        number = mixed(number ^ (column + 0.0).view(np.uint64))
    return number


def _portions(counts: np.ndarray) -> list[tuple[int, int]]:
    """Stretches of rows with about _PAIRS pairs each."""
    total = np.cumsum(counts)
    cuts = np.searchsorted(total, np.arange(_PAIRS, int(total[-1]) if len(total) else 0, _PAIRS)) + 1
    ends = distinct(np.concatenate([[0], cuts, [len(counts)]])).tolist()
    return list(pairwise(ends))


def _lies_on(points: np.ndarray, vertex: np.ndarray, facets: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(n,) bool: whether each vertex lies on its facet (n, w), away from the facet's vertices."""
    place, around = points[vertex], points[facets]
    near = _NEAR * size
    away = (np.linalg.norm(around - place[:, None], axis=2) > near[:, None]).all(axis=1)
    if facets.shape[1] == 2:
        along = around[:, 1] - around[:, 0]
        offset = place - around[:, 0]
        t = (offset * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), np.finfo(float).tiny)
        distance = np.linalg.norm(offset - t[:, None] * along, axis=1)
        return away & (t > 0) & (t < 1) & (distance <= near)
    width = facets.shape[1]
    diagonal = around[:, 3] - around[:, 1] if width == 4 else around[:, 2] - around[:, 1]
    normal = (
        np.cross(around[:, 2] - around[:, 0], diagonal)
        if width == 4
        else np.cross(around[:, 1] - around[:, 0], around[:, 2] - around[:, 0])
    )
    length = np.linalg.norm(normal, axis=1)
    normal = np.divide(normal, length[:, None], out=np.zeros_like(normal), where=length[:, None] > 0)
    on = away & (length > 0) & (np.abs(((place - around[:, 0]) * normal).sum(axis=1)) <= near)
    for k in range(width):
        edge = around[:, (k + 1) % width] - around[:, k]
        inward = np.cross(normal, edge)
        reach = np.linalg.norm(edge, axis=1)
        on &= ((place - around[:, k]) * inward).sum(axis=1) >= -near * reach
    return on
