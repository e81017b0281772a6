"""Tracking: how far a boundary that moves is from the one it was, measured from both sides.

The facets of the moving boundary are compared with the manifold they began as. A move is looked at before it
is made: points in the facets it changes are taken to the input manifold, and those places of the input where
vertices and the middles of edges were are taken to the changed facets. The distances found are bounds from
above; between the points looked at the two may be somewhat farther apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.boundary.manifold import Manifold, closest_of
from dvr_cli.mesh.csr import group, row_entries

_CHUNK = 4096  # facets measured at a time
_ALONG = (1 / 3, 2 / 3)  # where on the edges at a moved vertex the distance is looked at
_GRID = 5  # intervals an edge is cut into to measure the deviation


@dataclass(frozen=True)
class Probe:
    """The consequences of moving some independent vertices; rows number these vertices.

    apart: (n,) the largest distance found around each. facets: (E,) those around them, row after row as start
    (n + 1,) says, and foot: (E,) the input simplex nearest to the centre of each. watched: (W,) the places
    whose host changes, with their rows and new hosts.
    """

    apart: np.ndarray
    facets: np.ndarray
    row: np.ndarray
    foot: np.ndarray
    watched: np.ndarray
    watched_row: np.ndarray
    host: np.ndarray


class Track:
    """The facets (F, k) of a curve or surface whose vertices move, and the manifold they began as.

    foot: (F,) the simplex of the manifold nearest to the centre of each facet.
    """

    def __init__(self, points: np.ndarray, facets: np.ndarray, patch: np.ndarray, moving: np.ndarray) -> None:
        """points: (N, d) of the input; patch: (F,); moving: (m,) the vertices whose places are watched."""
        self.manifold = Manifold(points, facets, patch)
        self.facets = facets
        self.foot = np.arange(len(facets))
        position, self._start = group(facets.ravel(), len(points))
        self._around = position // facets.shape[1]
        middles, hosts = _middles(points, facets)
        self._place = np.concatenate([points[moving], middles])
        self._host = np.concatenate([self._around[self._start[moving]], hosts])
        self._entry = np.full(len(facets), -1)  # scratch: where in a probe a facet is

    def star(self, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The facets around each of the vertices (n,), row after row, and where each row begins (n + 1,)."""
        entries, start = row_entries(self._start, vertices)
        return self._around[entries], start

    def probe(self, points: np.ndarray, vertices: np.ndarray, targets: np.ndarray) -> Probe:
        """The consequences of moving the independent ``vertices`` (n,) from ``points`` to ``targets``."""
        facets, start = self.star(vertices)
        row = np.repeat(np.arange(len(vertices)), np.diff(start))
        members = self.facets[facets]
        own = members == vertices[row][:, None]
        places = np.where(own[:, :, None], targets[row][:, None], points[members])
        _, foot, away = self.manifold.nearest(places.mean(axis=1), self.foot[facets])
        if members.shape[1] == 3:
            after = places[np.arange(len(own)), (own.argmax(axis=1) + 1) % 3]
            for t in _ALONG:
                samples = targets[row] + t * (after - targets[row])
                away = np.maximum(away, self.manifold.nearest(samples, foot)[2])
        apart = np.zeros(len(vertices))
        np.maximum.at(apart, row, away)

        self._entry[facets] = np.arange(len(facets))
        entry = self._entry[self._host]
        self._entry[facets] = -1
        watched = np.flatnonzero(entry >= 0)
        best, distance = closest_of(places, start, self._place[watched], entry[watched], row)
        np.maximum.at(apart, row[best], distance)
        return Probe(apart, facets, row, foot, watched, row[best], facets[best])

    def accept(self, probe: Probe, moved: np.ndarray) -> None:
        """Take over what was found for those rows of a probe that ``moved`` ((n,) bool)."""
        here = moved[probe.row]
        self.foot[probe.facets[here]] = probe.foot[here]
        here = moved[probe.watched_row]
        self._host[probe.watched[here]] = probe.host[here]

    def deviation(self, before: np.ndarray, after: np.ndarray) -> float:
        """The largest distance between the manifold and the facets at ``after``, sampled densely both ways.

        before, after: (N, d) coordinates of the input and of the mesh reached.
        """
        moved = (before != after).any(axis=1)
        changed = np.flatnonzero(moved[self.facets].any(axis=1))
        if not len(changed):
            return 0.0
        result = Manifold(after, self.facets, self.manifold.patch)
        weights = _grid(self.facets.shape[1])
        largest = 0.0
        for lo in range(0, len(changed), _CHUNK):
            chunk = changed[lo : lo + _CHUNK]
            for manifold, points, start in (
                (self.manifold, after, self.foot[chunk]),
                (result, before, chunk),
            ):
                samples = np.einsum("sk,fkd->fsd", weights, points[self.facets[chunk]])
                hints = np.repeat(start, len(weights))
                largest = max(largest, float(manifold.nearest(np.concatenate(samples), hints)[2].max()))
        return largest


def _middles(points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The middles (M, d) of the edges of facets (F, k), each once, and a facet (M,) that each lies on."""
    if facets.shape[1] == 2:
        return points[facets].mean(axis=1), np.arange(len(facets))
    edges = np.sort(facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, place = np.unique(edges, axis=0, return_index=True)
    return points[edges].mean(axis=1), place // 3


def _grid(k: int) -> np.ndarray:
    """(S, k) barycentric coordinates of points spread evenly over a segment or triangle."""
    steps = np.arange(_GRID + 1)
    if k == 2:
        return np.stack([steps, _GRID - steps], axis=1) / _GRID
    i, j = np.meshgrid(steps, steps, indexing="ij")
    inside = i + j <= _GRID
    return np.stack([i[inside], j[inside], _GRID - (i + j)[inside]], axis=1) / _GRID
