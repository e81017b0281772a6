"""Directions of steepest ascent compiled: the same operations in the same order as ``steepest``."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled, inlined
from dvr_cli.relax.columns_numba import (
    ALONG,
    BADNESS,
    END,
    GRADIENT,
    NORMAL,
    S0,
    SHAPE,
    SLOPE,
    V0,
    WEIGHT,
    RingArrays,
    set_ring,
    solve,
    solve_back,
    to_metric,
)
from dvr_cli.relax.line_numba import worst_corner
from dvr_cli.relax.steepest import MAX_TRANSFERS, SHORTEST, VANISHING


@compiled
def steepest_directions(
    points: np.ndarray,
    directions: np.ndarray,
    start: int,
    stop: int,
    rings: RingArrays,
    on_line: np.ndarray,
    axis: np.ndarray,
    band: float,
    active: np.ndarray,
    scratch: np.ndarray,
) -> None:
    """Set the rows start .. stop of ``directions`` (m, d) to those of steepest ascent of their rings.

    active: (m,) bool, the rings that are asked about; the rows of others become zero. on_line, axis: (m,)
    and (m, d), see ``freedom.project``; empty where all vertices move anywhere.
    The other arrays are as for ``relax_rings``.
    """
    scratch[SHAPE] = -1.0
    d = points.shape[1]
    keep = 1.0 - band
    keep = keep if d == 2 else keep * keep * keep
    for ring in range(start, stop):
        if not active[ring]:
            directions[ring] = 0.0
            continue
        vertex = rings.vertices[ring]
        n = set_ring(points, vertex, 0.0, 0.0, 0.0, ring, rings, scratch)
        worst = worst_corner(scratch, n, 0.0, d)
        largest = scratch[BADNESS, worst]
        count, initial = 0, -1
        own = len(rings.factor) > 0 and moves_anywhere(axis, ring)
        for c in range(n):
            if scratch[BADNESS, c] >= largest * keep:
                if largest < np.inf:
                    gradient(points, vertex, c, d, len(rings.factor) > 0, scratch, count)
                    if own:
                        solve_back(scratch, GRADIENT, count, d)
                else:
                    _raising(c, d, own, scratch, count)
                if len(axis):
                    project(on_line[ring], axis, ring, d, scratch, count)
                if _size(scratch, count, d) < np.inf:
                    if c == worst:
                        initial = count
                    count += 1
        _shortest_in_hull(directions, ring, initial, count, d, scratch)
        if own:
            _unit_through(directions, ring, d, scratch)


@inlined
def gradient(
    points: np.ndarray, vertex: int, c: int, d: int, metric: bool, scratch: np.ndarray, to: int
) -> None:
    """d/2 times the gradient of log 1/Q of the corner in column c, put into column ``to``.

    metric: whether the corner's edges are seen through L.
    """
    for i in range(d):
        x = points[vertex, i]
        pull = scratch[SLOPE, c] * (scratch[END + i, c] - x)
        for j in range(1, d):
            pull = pull + scratch[SLOPE + j, c] * (scratch[END + 3 * j + i, c] - x)
        scratch[GRADIENT + i, to] = pull
    if metric:
        to_metric(scratch, GRADIENT, to, c, d)
    for i in range(d):
        pull = scratch[GRADIENT + i, to]
        scratch[GRADIENT + i, to] = scratch[NORMAL + i, c] / scratch[V0, c] - d * pull / scratch[S0, c]


@inlined
def moves_anywhere(axis: np.ndarray, ring: int) -> bool:
    """True if the ring's vertex is free to move in all directions; axis: as for ``steepest_directions``."""
    if len(axis):
        for i in range(axis.shape[1]):
            if axis[ring, i] != 0.0:
                return False
    return True


@inlined
def _raising(c: int, d: int, own: bool, scratch: np.ndarray, to: int) -> None:
    """The unit vector against which the determinant of column c grows, put into column ``to``.

    own: whether vectors are measured through L of the ring's first corner.
    """
    for i in range(d):
        scratch[GRADIENT + i, to] = scratch[NORMAL + i, c]
    if own:
        solve_back(scratch, GRADIENT, to, d)
    size = np.sqrt(_size(scratch, to, d))
    for i in range(d):
        scratch[GRADIENT + i, to] = scratch[GRADIENT + i, to] / size


@inlined
def _unit_through(directions: np.ndarray, row: int, d: int, scratch: np.ndarray) -> None:
    """See ``steepest.unit_through``, of a row of ``directions``."""
    for i in range(d):
        scratch[GRADIENT + i, 0] = directions[row, i]
    solve(scratch, GRADIENT, 0, d)
    length = np.sqrt(_size(scratch, 0, d))
    for i in range(d):
        directions[row, i] = scratch[GRADIENT + i, 0] / length if length > 0.0 else 0.0


@inlined
def project(on_line: bool, axis: np.ndarray, ring: int, d: int, scratch: np.ndarray, k: int) -> None:
    """Reduce the gradient in column k to the part that the ring's vertex is free to follow."""
    along = scratch[GRADIENT, k] * axis[ring, 0]
    for i in range(1, d):
        along = along + scratch[GRADIENT + i, k] * axis[ring, i]
    for i in range(d):
        part = along * axis[ring, i]
        scratch[GRADIENT + i, k] = part if on_line else scratch[GRADIENT + i, k] - part


@inlined
def _shortest_in_hull(
    directions: np.ndarray, row: int, initial: int, n: int, d: int, scratch: np.ndarray
) -> None:
    """Put minus the shortest vector in the hull of n gradients, of unit length, into a row of ``directions``.

    The row is zero if that vector is. See ``steepest._shortest_in_hull``; the row holds the vector meanwhile.
    """
    for i in range(d):
        directions[row, i] = scratch[GRADIENT + i, initial] if initial >= 0 else 0.0
    size = _length(directions, row, d)
    for k in range(n):
        scratch[WEIGHT, k] = 0.0
    scratch[WEIGHT, initial] = 1.0
    for _ in range(MAX_TRANSFERS):
        least = most = -1
        for k in range(n):
            along = directions[row, 0] * scratch[GRADIENT, k]
            for i in range(1, d):
                along = along + directions[row, i] * scratch[GRADIENT + i, k]
            scratch[ALONG, k] = along
            if least < 0 or along < scratch[ALONG, least]:
                least = k
            if scratch[WEIGHT, k] > 0.0 and (most < 0 or along > scratch[ALONG, most]):
                most = k
        length = _length(directions, row, d)
        if not length > VANISHING * VANISHING * size:
            break
        if scratch[ALONG, least] >= SHORTEST * length and length < np.inf:
            root = np.sqrt(length)
            for i in range(d):
                directions[row, i] = -directions[row, i] / root
            return
        edge = 0.0
        for i in range(d):
            e = scratch[GRADIENT + i, least] - scratch[GRADIENT + i, most]
            edge = e * e if i == 0 else edge + e * e
        all_of_it = scratch[WEIGHT, most]
        part = (scratch[ALONG, most] - scratch[ALONG, least]) / edge
        part = part if part < all_of_it else all_of_it
        for i in range(d):
            e = scratch[GRADIENT + i, least] - scratch[GRADIENT + i, most]
            directions[row, i] = directions[row, i] + part * e
        scratch[WEIGHT, least] += part
        scratch[WEIGHT, most] -= part
    for i in range(d):
        directions[row, i] = 0.0


@inlined
def _size(scratch: np.ndarray, k: int, d: int) -> float:
    """Squared length of the gradient in column k."""
    size = scratch[GRADIENT, k] * scratch[GRADIENT, k]
    for i in range(1, d):
        size = size + scratch[GRADIENT + i, k] * scratch[GRADIENT + i, k]
    return size


@inlined
def _length(vectors: np.ndarray, row: int, d: int) -> float:
    """Squared length of a row."""
    length = vectors[row, 0] * vectors[row, 0]
    for i in range(1, d):
        length = length + vectors[row, i] * vectors[row, i]
    return length
