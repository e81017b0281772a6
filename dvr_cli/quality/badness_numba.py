"""Badness compiled, corner by corner."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.kernels import inlined
from dvr_cli.jit.kinds import MEASURED, PLANAR, compiled_by_kind
from dvr_cli.quality.mean_ratio_numba import corner_terms_2d, corner_terms_3d, metric_norm


@inlined
def badness(v: float, s: float, d: int) -> float:
    ratio = s / v if d == 2 else s * s * s / (v * v)
    return ratio if v > 0 else np.inf


@compiled_by_kind
def worst_corner(
    points: np.ndarray,
    vertices: np.ndarray,
    shapes: np.ndarray,
    norm: np.ndarray,
    factor: np.ndarray,
    first: int,
    last: int,
) -> tuple[int, float]:
    """The first of the corners first .. last with the largest badness, and that badness."""
    worst, largest = first, -1.0
    for c in range(first, last):
        if PLANAR:
            v, s = corner_terms_2d(points, vertices[c], norm, shapes[c, 0])
        else:
            v, s = corner_terms_3d(points, vertices[c], norm, shapes[c, 0])
        if MEASURED:
            s = metric_norm(points, vertices[c], norm, factor, shapes[c, 0])
        here = badness(v, s, points.shape[1])
        if here > largest:
            worst, largest = c, here
    return worst, largest
