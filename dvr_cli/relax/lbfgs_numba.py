"""The direction of L-BFGS compiled: the same operations in the same order as ``lbfgs``."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.kernels import inlined, part


@part
def descent(
    g: np.ndarray,
    steps: np.ndarray,
    changes: np.ndarray,
    curvature: np.ndarray,
    factor: np.ndarray,
    kept: int,
    d: int,
    direction: np.ndarray,
) -> None:
    """As ``lbfgs.descent``, into ``direction`` (n·d,): pair i stands in row i modulo the number of rows.

    steps, changes: (MEMORY + 1, n·d); curvature: (MEMORY + 1,) their products; factor: scratch of that size.
    """
    rows = len(steps)
    oldest = max(kept - (rows - 1), 0)
    for i in range(len(g)):
        direction[i] = -g[i]
    for pair in range(kept - 1, oldest - 1, -1):
        row = pair % rows
        factor[row] = dot(steps[row], direction, d) / curvature[row]
        for i in range(len(g)):
            direction[i] = direction[i] - factor[row] * changes[row, i]
    if kept > 0:
        row = (kept - 1) % rows
        scale = curvature[row] / dot(changes[row], changes[row], d)
        for i in range(len(g)):
            direction[i] = direction[i] * scale
    for pair in range(oldest, kept):
        row = pair % rows
        weight = factor[row] - dot(changes[row], direction, d) / curvature[row]
        for i in range(len(g)):
            direction[i] = direction[i] + weight * steps[row, i]


@inlined
def dot(a: np.ndarray, b: np.ndarray, d: int) -> float:
    """Scalar product of two (n, d) vectors, flat: over the rows for each component, then over these."""
    t0, t1, t2 = 0.0, 0.0, 0.0
    if d == 2:
        for i in range(0, len(a), 2):
            t0 += a[i] * b[i]
            t1 += a[i + 1] * b[i + 1]
        return t0 + t1
    for i in range(0, len(a), 3):
        t0 += a[i] * b[i]
        t1 += a[i + 1] * b[i + 1]
        t2 += a[i + 2] * b[i + 2]
    return t0 + t1 + t2
