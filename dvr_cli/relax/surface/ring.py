"""One ring at a time, as walks need it: its lines, the best place on them, the worst corner, gradients.

A corner of a surface is a triangle in space. Its determinant is twice the area it has in its own plane, and
along a line it is taken to be linear, as seen from the direction of that plane's normal: so it never claims
more than the true area.

What stands here is the plain half of ``ring_numba``. The kernels of walks are written once, vertex by vertex,
and run either over this module, or compiled over that one.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from dvr_cli.mesh.simplex import opposite_normal
from dvr_cli.quality.badness import badness
from dvr_cli.relax import line, polish
from dvr_cli.relax.line import Lines, coefficients, maximise_minimum
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.problem import RingArrays
from dvr_cli.relax.steepest import _shortest_in_hull, gradient

# Rows of the scratch array, a column for each corner of a ring, as in ``columns_numba``.
END, NORMAL, V0, V1, S0, S1, S2, BADNESS = 0, 9, 12, 13, 14, 15, 16, 17
GRADIENT, WEIGHT, NORM, SLOPE, CURVATURE, SIGN, ROWS = 18, 21, 22, 25, 27, 28, 29


_Arrays = TypeVar("_Arrays")


def bare(arrays: _Arrays) -> _Arrays:
    """An array, or a named tuple of arrays or of such tuples, as kernels read single numbers fastest.

    Here these are memory views, whose items are plain numbers; compiled see ``jit.arrays.bare``.
    """
    if isinstance(arrays, tuple):
        return type(arrays)(*map(bare, arrays))
    return memoryview(arrays)  # type: ignore[arg-type, return-value]


def dimension_of(rings: RingArrays) -> int:
    """That of the corners: 2 or 3; compiled it is a constant."""
    return int(rings.others.shape[1])


def new_scratch(largest_ring: int) -> np.ndarray:
    """A scratch array for rings with so many corners at most."""
    return np.zeros((ROWS, largest_ring))


def set_lines(
    points: np.ndarray,
    vertex: int,
    d0: float,
    d1: float,
    d2: float,
    ring: int,
    rings: RingArrays,
    scratch: np.ndarray,
) -> int:
    """Lay out a ring of a planar or volume mesh and its lines along the direction (d0, d1, d2).

    Returns how many corners it has.
    """
    points, rings = np.asarray(points), RingArrays(*map(np.asarray, rings))
    entries = slice(rings.start[ring], rings.start[ring + 1])
    others, shapes = rings.others[entries], rings.shapes[entries]
    n, d = others.shape
    x = [points[vertex, i : i + 1] for i in range(d)]
    ends = [[points[other, i][:, None] for i in range(d)] for other in others.T]
    direction = [np.array([component]) for component in (d0, d1, d2)[:d]]
    norm, slope = rings.norm[shapes].T[:, :, None], rings.slope[shapes].T[:, :, None]
    factor = rings.factor[shapes].T[:, :, None] if len(rings.factor) else None
    curvature = rings.curvature[shapes][:, None]
    lines = coefficients(x, direction, ends, list(norm), list(slope), curvature, factor)
    for j in range(d):
        for i in range(d):
            scratch[END + 3 * j + i, :n] = ends[j][i][:, 0]
    for i, component in enumerate(opposite_normal(ends)):
        scratch[NORMAL + i, :n] = component[:, 0]
    for row, term in zip((V0, V1, S0, S1), lines.terms, strict=True):
        scratch[row, :n] = term[:, 0]
    scratch[S2, :n] = lines.s2[:, 0]
    return n


def set_place(points: np.ndarray, vertex: int, ring: int, rings: RingArrays, scratch: np.ndarray) -> None:
    """Put v0 and s0 of the vertex where it is now in the place of those of a ring that is laid out.

    The others have not moved, and what the lines are counts no more.
    """
    set_lines(points, vertex, 0.0, 0.0, 0.0, ring, rings, scratch)


def set_shapes(ring: int, rings: RingArrays, scratch: np.ndarray) -> int:
    """Put the shapes of a ring of a surface into their columns; returns how many corners it has."""
    lo = rings.start[ring]
    n = rings.start[ring + 1] - lo
    columns = bare(scratch)
    for c in range(n):
        k = rings.shapes[lo + c]
        for i in range(3):
            columns[NORM + i, c] = rings.norm[k, i]
        columns[SLOPE, c], columns[SLOPE + 1, c] = rings.slope[k, 0], rings.slope[k, 1]
        columns[CURVATURE, c] = rings.curvature[k]
    return n


def padded(n: int) -> int:
    """The columns that loops go over; compiled these are whole groups."""
    return n


def set_gradient(
    points: np.ndarray, vertex: int, ring: int, c: int, rings: RingArrays, scratch: np.ndarray, to: int
) -> None:
    """d/2 times the gradient of log 1/Q of a planar or volume mesh's corner, put into column ``to``."""
    k, d = rings.shapes[rings.start[ring] + c], rings.others.shape[1]
    edges = [[scratch[END + 3 * j + i, c] - points[vertex, i] for i in range(d)] for j in range(d)]
    normal = [scratch[NORMAL + i, c] for i in range(d)]
    slope = [rings.slope[k, j] for j in range(d)]
    factor = np.asarray(rings.factor)[k] if len(rings.factor) else None
    found = gradient(edges, normal, scratch[V0, c], scratch[S0, c], slope, factor)
    scratch[GRADIENT : GRADIENT + d, to] = found


def best_step(scratch: np.ndarray, n: int, d: int) -> tuple[float, float]:
    """The best λ and the largest badness at λ = 0; see ``line.maximise_minimum``."""
    step, before = maximise_minimum(_lines_in(scratch, n, d))
    return float(step[0]), float(before[0])


def lowest_step(
    scratch: np.ndarray, n: int, d: int, limit: float, aim: Aim, begins: bool
) -> tuple[float, float, float]:
    """The λ where the price is lowest, the price at λ = 0, the badness at the floor.

    begins: whether a walk begins here; if so its weights are put into their row, else those there count, and
    so does the ``limit`` as that badness. See ``polish.lowest_price``.
    """
    real, weights = np.ones((n, 1), dtype=bool), None
    if not begins:
        aim, weights = aim._replace(by_ring=False), scratch[WEIGHT, :n, None]
    lines = _lines_in(scratch, n, d)
    step, now, weights, floor = polish.lowest_price(lines, real, limit, aim, weights)
    scratch[WEIGHT, :n] = weights[:, 0]
    return float(step[0]), float(now[0]), float(floor[0])


def worst_of(scratch: np.ndarray, n: int, d: int) -> int:
    """The first corner with the largest badness at λ = 0; leaves the badness of all in their row."""
    scratch[BADNESS, :n] = badness(scratch[V0, :n], scratch[S0, :n], d)
    return int(scratch[BADNESS, :n].argmax())


def price_of(scratch: np.ndarray, n: int, d: int, aim: Aim) -> float:
    """The price at λ = 0, with the weights in their row; without meaning unless all corners are positive."""
    v, s, weights = scratch[V0, :n, None], scratch[S0, :n, None], scratch[WEIGHT, :n, None]
    return float(polish.price(v, s, np.ones((n, 1), dtype=bool), weights, aim, d)[0])


def set_shares(scratch: np.ndarray, n: int, d: int, aim: Aim) -> None:
    """Put the shares of all corners, which are positive, in the price's slope into their badness' row."""
    v, s = scratch[V0, :n], scratch[S0, :n]
    scratch[BADNESS, :n] = polish.share(s * (1.0 / v if d == 2 else polish.inverse_power(v)), aim)


def improves(before: float, after: float, d: int) -> bool:
    """See ``line.improves``."""
    return bool(line.improves(np.array(before), np.array(after), d))


def keeps(before: float, after: float, largest: float, limit: float, d: int) -> bool:
    """See ``polish.keeps``."""
    return bool(polish.keeps(np.array(before), np.array(after), np.array(largest), np.array(limit), d))


def hull_direction(
    directions: np.ndarray, row: int, initial: int, n: int, d: int, scratch: np.ndarray
) -> None:
    """Put minus the shortest vector in the hull of n gradients, of unit length, into a row of directions."""
    directions = np.asarray(directions)
    if initial < 0:
        directions[row] = 0.0
        return
    vectors = [scratch[GRADIENT + i, :n, None] for i in range(d)]
    found = _shortest_in_hull(vectors, np.ones((n, 1), dtype=bool), np.array([initial]))
    directions[row] = [component[0] for component in found]


def _lines_in(scratch: np.ndarray, n: int, d: int) -> Lines:
    return Lines(scratch[[V0, V1, S0, S1], :n, None], scratch[S2, :n, None], d)
