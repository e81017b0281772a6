"""One ring at a time, compiled: the functions of ``ring``, made of those of the other kernels."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import bare, zeros
from dvr_cli.jit.kernels import inlined
from dvr_cli.jit.kinds import ON_SURFACE, PLANAR
from dvr_cli.relax.columns_numba import (
    BADNESS,
    CURVATURE,
    END,
    GRADIENT,
    NORM,
    NORMAL,
    POWER,
    ROWS,
    S0,
    S1,
    S2,
    SHAPE,
    SIGN,
    SLOPE,
    V0,
    V1,
    WIDTH,
    RingArrays,
    padded,
    set_ring,
    set_shapes,
)
from dvr_cli.relax.columns_numba import set_place as _set_place
from dvr_cli.relax.line_numba import improves, maximise_minimum, worst_corner
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.polish_numba import bottom, clip, keeps, price, rise, set_powers, set_weights, weight
from dvr_cli.relax.steepest_numba import _shortest_in_hull, gradient

# what kernels of walks take over: rows of the scratch array, and functions of other kernels
ROWS_USED = BADNESS, CURVATURE, END, GRADIENT, NORM, NORMAL, S0, S1, S2, SIGN, SLOPE, V0, V1
TAKEN = improves, keeps, bare, padded, set_shapes
set_lines = set_ring
best_step = maximise_minimum
price_of = price
hull_direction = _shortest_in_hull


@inlined
def dimension_of(rings: RingArrays) -> int:
    return 2 if PLANAR or ON_SURFACE else 3


@inlined
def new_scratch(largest_ring: int) -> np.ndarray:
    scratch = zeros((ROWS, largest_ring + WIDTH), np.float64)
    scratch[SHAPE] = -1.0
    return scratch


@inlined
def set_place(points: np.ndarray, vertex: int, ring: int, rings: RingArrays, scratch: np.ndarray) -> None:
    _set_place(points, vertex, rings.start[ring + 1] - rings.start[ring], scratch)


@inlined
def set_gradient(
    points: np.ndarray, vertex: int, ring: int, c: int, rings: RingArrays, scratch: np.ndarray, to: int
) -> None:
    gradient(points, vertex, c, points.shape[1], scratch, to)


@inlined
def lowest_step(
    scratch: np.ndarray, n: int, d: int, limit: float, aim: Aim, begins: bool
) -> tuple[float, float, float]:
    largest = scratch[BADNESS, worst_of(scratch, n, d)]
    if largest == np.inf:
        return 0.0, 0.0, limit
    if begins:
        set_powers(scratch, n, d, 0.0)
        set_weights(scratch, n, aim)
        if aim.by_ring:
            limit = max(largest, limit)
    before = price(scratch, n, d, aim)
    return clip(scratch, n, d, aim.stretch * bottom(scratch, n, d, aim), limit), before, limit


@inlined
def worst_of(scratch: np.ndarray, n: int, d: int) -> int:
    return worst_corner(scratch, n, 0.0, d)


@inlined
def set_shares(scratch: np.ndarray, n: int, d: int, aim: Aim) -> None:
    set_powers(scratch, n, d, 0.0)
    for c in range(n):
        inverse = scratch[S0, c] * scratch[POWER, c]
        scratch[BADNESS, c] = inverse * (weight(inverse, aim) + rise(inverse, aim))
