"""Directions of steepest ascent compiled: the same operations in the same order as ``steepest``."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.kernels import inlined
from dvr_cli.jit.kinds import MEASURED, compiled_by_kind
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
    see_through,
    set_ring,
    solve,
    solve_back,
    to_metric,
)
from dvr_cli.relax.line_numba import worst_corner
from dvr_cli.relax.problem import RingFreedom
from dvr_cli.relax.steepest import MAX_TRANSFERS, SHORTEST, VANISHING


@compiled_by_kind
def steepest_directions(
    points: np.ndarray,
    directions: np.ndarray,
    start: int,
    stop: int,
    rings: RingArrays,
    freedom: RingFreedom,
    band: float,
    scratch: np.ndarray,
) -> None:
    """Set the rows start .. stop of ``directions`` (m, d) to those of steepest ascent of their rings.

    The rows of rings that are not active become zero. band: see ``steepest.Ascent``. The other arguments are
    as for ``relax_rings``.
    """
    scratch[SHAPE] = -1.0
    d = points.shape[1]
    keep = 1.0 - band
    keep = keep if d == 2 else keep * keep * keep
    on_line, axis = freedom.on_line, freedom.axis
    for ring in range(start, stop):
        if not freedom.active[ring]:
            directions[ring] = 0.0
            continue
        vertex = rings.vertices[ring]
        n = set_ring(points, vertex, 0.0, 0.0, 0.0, ring, rings, scratch)
        worst = worst_corner(scratch, n, 0.0, d)
        largest = scratch[BADNESS, worst]
        count, initial = 0, -1
        axis0, axis1, axis2 = axis_of(on_line, axis, ring, d, scratch)
        for c in range(n):
            if scratch[BADNESS, c] >= largest * keep:
                if largest < np.inf:
                    gradient(points, vertex, c, d, scratch, count)
                    if MEASURED:
                        solve_back(scratch, GRADIENT, count, d)
                else:
                    _raising(c, d, scratch, count)
                if len(axis):
                    project(on_line[ring], axis0, axis1, axis2, d, scratch, count)
                if _size(scratch, count, d) < np.inf:
                    if c == worst:
                        initial = count
                    count += 1
        _shortest_in_hull(directions, ring, initial, count, d, scratch)
        if MEASURED:
            _unit_move(directions, ring, d, on_line, axis, scratch)


@inlined
def gradient(points: np.ndarray, vertex: int, c: int, d: int, scratch: np.ndarray, to: int) -> None:
    """d/2 times the gradient of log 1/Q of the corner in column c, put into column ``to``."""
    for i in range(d):
        x = points[vertex, i]
        pull = scratch[SLOPE, c] * (scratch[END + i, c] - x)
        for j in range(1, d):
            pull = pull + scratch[SLOPE + j, c] * (scratch[END + 3 * j + i, c] - x)
        scratch[GRADIENT + i, to] = pull
    if MEASURED:
        to_metric(scratch, GRADIENT, to, c, d)
    for i in range(d):
        pull = scratch[GRADIENT + i, to]
        scratch[GRADIENT + i, to] = scratch[NORMAL + i, c] / scratch[V0, c] - d * pull / scratch[S0, c]


@inlined
def axis_of(
    on_line: np.ndarray, axis: np.ndarray, ring: int, d: int, scratch: np.ndarray
) -> tuple[float, float, float]:
    """The axis of a ring's line or plane, seen through L of column 0 in a metric; zeros if it has none.

    on_line, axis: as for ``steepest_directions``. See ``measured.seen_axis``.
    """
    if len(axis) == 0:
        return 0.0, 0.0, 0.0
    a0, a1, a2 = axis[ring, 0], axis[ring, 1], axis[ring, 2] if d == 3 else 0.0
    if not MEASURED:
        return a0, a1, a2
    scratch[GRADIENT, 0], scratch[GRADIENT + 1, 0], scratch[GRADIENT + 2, 0] = a0, a1, a2
    if on_line[ring]:
        see_through(scratch, GRADIENT, 0, d)
    else:
        solve_back(scratch, GRADIENT, 0, d)
    length = np.sqrt(_size(scratch, 0, d))
    if not length > 0.0:
        return 0.0, 0.0, 0.0
    a2 = scratch[GRADIENT + 2, 0] / length if d == 3 else 0.0
    return scratch[GRADIENT, 0] / length, scratch[GRADIENT + 1, 0] / length, a2


@inlined
def _raising(c: int, d: int, scratch: np.ndarray, to: int) -> None:
    """The unit vector against which the determinant of column c grows, put into column ``to``."""
    for i in range(d):
        scratch[GRADIENT + i, to] = scratch[NORMAL + i, c]
    if MEASURED:
        solve_back(scratch, GRADIENT, to, d)
    size = np.sqrt(_size(scratch, to, d))
    for i in range(d):
        scratch[GRADIENT + i, to] = scratch[GRADIENT + i, to] / size


@inlined
def _unit_move(
    directions: np.ndarray, row: int, d: int, on_line: np.ndarray, axis: np.ndarray, scratch: np.ndarray
) -> None:
    """See ``Measured.direction``, of a row of ``directions``."""
    for i in range(d):
        scratch[GRADIENT + i, 0] = directions[row, i]
    move(row, 0, d, on_line, axis, scratch)
    length = np.sqrt(_size(scratch, 0, d))
    for i in range(d):
        directions[row, i] = scratch[GRADIENT + i, 0] / length if length > 0.0 else 0.0


@inlined
def move(ring: int, k: int, d: int, on_line: np.ndarray, axis: np.ndarray, scratch: np.ndarray) -> None:
    """Replace the vector in column k by the move it stands for, see ``Measured.move``."""
    solve(scratch, GRADIENT, k, d)
    if len(axis):
        a2 = axis[ring, 2] if d == 3 else 0.0
        project(on_line[ring], axis[ring, 0], axis[ring, 1], a2, d, scratch, k)


@inlined
def project(on_line: bool, a0: float, a1: float, a2: float, d: int, scratch: np.ndarray, k: int) -> None:
    """Reduce the gradient in column k to the part that lies in a line or plane with this axis."""
    along = scratch[GRADIENT, k] * a0 + scratch[GRADIENT + 1, k] * a1
    if d == 3:
        along = along + scratch[GRADIENT + 2, k] * a2
    _leave(on_line, along * a0, GRADIENT, k, scratch)
    _leave(on_line, along * a1, GRADIENT + 1, k, scratch)
    if d == 3:
        _leave(on_line, along * a2, GRADIENT + 2, k, scratch)


@inlined
def _leave(on_line: bool, part: float, row: int, k: int, scratch: np.ndarray) -> None:
    """Leave of a component that part of it, or the rest."""
    scratch[row, k] = part if on_line else scratch[row, k] - part


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
