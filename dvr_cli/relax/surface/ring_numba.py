"""One ring at a time, compiled: the functions of ``ring``, made of those of the other kernels."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import bare, inlined
from dvr_cli.relax.columns_numba import (
    BADNESS,
    END,
    GRADIENT,
    NORMAL,
    POWER,
    ROWS,
    S0,
    S1,
    S2,
    SHAPE,
    V0,
    V1,
    WEIGHT,
    WIDTH,
    RingArrays,
    set_ring,
)
from dvr_cli.relax.line_numba import improves, maximise_minimum, worst_corner
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.polish_numba import _bottom, _clip, _keeps, _price, _set_powers
from dvr_cli.relax.steepest_numba import _shortest_in_hull, gradient

# what kernels of walks take over: rows of the scratch array, and functions of other kernels
ROWS_USED = BADNESS, END, GRADIENT, NORMAL, S0, S1, S2, V0, V1
TAKEN = improves, bare
set_lines = set_ring
best_step = maximise_minimum
keeps = _keeps
hull_direction = _shortest_in_hull


@inlined
def new_scratch(largest_ring: int) -> np.ndarray:
    scratch = np.zeros((ROWS, largest_ring + WIDTH))
    scratch[SHAPE] = -1.0
    return scratch


@inlined
def set_gradient(
    points: np.ndarray, vertex: int, ring: int, c: int, rings: RingArrays, scratch: np.ndarray, to: int
) -> None:
    gradient(points, vertex, c, points.shape[1], len(rings.factor) > 0, scratch, to)


@inlined
def lowest_step(scratch: np.ndarray, n: int, d: int, limit: float) -> tuple[float, float]:
    if scratch[BADNESS, worst_of(scratch, n, d)] == np.inf:
        return 0.0, 0.0
    before = sum_of(scratch, n, d)
    return _clip(scratch, n, d, _bottom(scratch, n, d, Aim(0.0, False, False)), limit), before


@inlined
def sum_of(scratch: np.ndarray, n: int, d: int) -> float:
    for c in range(n):
        scratch[WEIGHT, c] = 1.0
    return _price(scratch, n, d, Aim(0.0, False, False))


@inlined
def worst_of(scratch: np.ndarray, n: int, d: int) -> int:
    return worst_corner(scratch, n, 0.0, d)


@inlined
def set_inverses(scratch: np.ndarray, n: int, d: int) -> None:
    _set_powers(scratch, n, d, 0.0)
    for c in range(n):
        scratch[BADNESS, c] = scratch[S0, c] * scratch[POWER, c]
