"""The altitude rule: no move takes an element below a given altitude (see ``quality.altitudes``).

As a vertex moves along a line, v of a corner is affine, and so is the normal of a facet through the vertex,
by whose length v is divided. So v >= h |n|, an altitude of at least h, holds on an interval, whose ends are
roots of a quadratic. A move that would leave it ends there. That is the best place of the interval: the price
of a ring is convex, and so is its largest 1/Q, and both are lower there than at the beginning of the move.

The rule is applied after the moves of a batch, to the vertices that moved: hardly any comes near the smallest
altitude of a mesh, and to see that takes one determinant a corner.
"""

from __future__ import annotations

from functools import reduce

import numpy as np

from dvr_cli.mesh.csr import row_entries
from dvr_cli.mesh.simplex import Components, cross, dot, opposite_normal, subtract
from dvr_cli.quality.altitudes import squared_facets
from dvr_cli.quality.badness import badness
from dvr_cli.quality.mean_ratio import weighted_norm
from dvr_cli.relax.line import keeps_within
from dvr_cli.relax.problem import RingArrays

SHORT = 1.0 - 1e-6  # part of the way to the end of the interval that a move makes


def hold_altitudes(
    points: np.ndarray,
    before: np.ndarray,
    start: int,
    stop: int,
    rings: RingArrays,
    bound: float,
    limit: float,
    by_ring: bool,
) -> int:
    """Shorten the moves of the rings start .. stop that took an altitude below ``bound``.

    points: (N, d), changed in place. before: (stop - start, d) where the vertices of these rings, which are
    independent, were. limit: the badness that no corner may have; by_ring: unless it is no larger than the
    largest of its ring was. A move that cannot be shortened is undone; returns how many were.
    """
    vertices = rings.vertices[start:stop]
    moved = np.flatnonzero((points[vertices] != before).any(axis=1))
    with np.errstate(all="ignore"):
        here = _Corners(points, rings, start + moved)
        low = moved[here.any_of_ring(here.below(points[vertices[moved]], bound))]
        if not len(low):
            return 0
        ring = _Corners(points, rings, start + low)
        origin, reached = before[low], points[vertices[low]]
        part = ring.smallest(ring.way_out(origin, reached - origin, bound)) * SHORT
        target = origin + part[:, None] * (reached - origin)
        now, after = ring.largest_badness(origin), ring.largest_badness(target)
        good = (part > 0.0) & (part < 1.0) & ~ring.any_of_ring(ring.below(target, bound))
        good &= keeps_within(after, np.maximum(now, limit) if by_ring else limit, points.shape[1])
    points[vertices[low]] = np.where(good[:, None], target, origin)
    return int(np.count_nonzero(~good))


class _Corners:
    """The corners of some rings, one after the other; positions of the rings' vertices come as (k, d)."""

    def __init__(self, points: np.ndarray, rings: RingArrays, chosen: np.ndarray) -> None:
        entries, first = row_entries(rings.start, chosen)
        self._first = first[:-1]
        self._ring = np.repeat(np.arange(len(chosen)), np.diff(first))
        shapes = rings.shapes[entries]
        self._norm = list(rings.norm[shapes].T)
        self._factor = list(rings.factor[shapes].T) if len(rings.factor) else None
        self._ends = [list(points[other].T) for other in rings.others[entries].T]
        self._normal = opposite_normal(self._ends)

    def any_of_ring(self, which: np.ndarray) -> np.ndarray:
        """(k,) bool: whether it is so for any corner of a ring."""
        return np.logical_or.reduceat(which, self._first) if len(self._first) else np.empty(0, dtype=bool)

    def smallest(self, values: np.ndarray) -> np.ndarray:
        """(k,) the smallest value of each ring."""
        return np.minimum.reduceat(values, self._first)

    def largest_badness(self, x: np.ndarray) -> np.ndarray:
        """(k,) the largest badness of each ring."""
        edges = self._edges(x)
        s = weighted_norm(edges, self._norm, self._factor)
        return np.maximum.reduceat(badness(dot(edges[0], self._normal), s, len(edges)), self._first)

    def below(self, x: np.ndarray, bound: float) -> np.ndarray:
        """(C,) bool: whether an altitude of the corner is below the bound."""
        edges = self._edges(x)
        largest = reduce(np.maximum, squared_facets(edges))
        return dot(edges[0], self._normal) < bound * np.sqrt(largest)

    def way_out(self, x: np.ndarray, move: np.ndarray, bound: float) -> np.ndarray:
        """(C,) the part of the move after which an altitude that is not below the bound falls below it."""
        edges, way = self._edges(x), [component[self._ring] for component in move.T]
        v, dv = dot(edges[0], self._normal), -dot(way, self._normal)
        still = np.zeros(len(v))
        part = _exit(v, dv, dot(self._normal, self._normal), still, still, bound)
        for n, dn in _facets_through(edges, way):
            part = np.minimum(part, _exit(v, dv, dot(n, n), dot(n, dn), dot(dn, dn), bound))
        return part

    def _edges(self, x: np.ndarray) -> list[list[np.ndarray]]:
        own = [component[self._ring] for component in x.T]
        return [subtract(end, own) for end in self._ends]


def _facets_through(
    edges: list[list[np.ndarray]], way: Components
) -> list[tuple[list[np.ndarray], list[np.ndarray]]]:
    """The sides or normals of the facets through the vertex that moves, and how they change on the way."""
    if len(edges) == 2:
        back = [-component for component in way]
        return [(edge, back) for edge in edges]
    pairs = (edges[0], edges[1]), (edges[1], edges[2]), (edges[2], edges[0])
    return [(cross(e, f), cross(subtract(f, e), way)) for e, f in pairs]


def _exit(
    v: np.ndarray, dv: np.ndarray, nn: np.ndarray, ndn: np.ndarray, dndn: np.ndarray, bound: float
) -> np.ndarray:
    """The first t > 0 at which v + t dv >= bound |n + t dn|, which holds at 0, does not; infinite without."""
    square = bound * bound
    a, b, c = dv * dv - square * dndn, v * dv - square * ndn, v * v - square * nn
    root = np.sqrt(b * b - a * c)  # NaN where there is no root
    falling = c / (root - b)
    rising = np.where(a < 0.0, (b + root) / -a, np.inf)
    found = np.where(b > 0.0, rising, np.where(root - b > 0.0, falling, np.where(a < 0.0, 0.0, np.inf)))
    return np.where((c >= 0.0) & (found >= 0.0), found, np.inf)
