"""Repeated cells compiled: the sums by which ``repeated`` tells cells apart."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import zeros
from dvr_cli.jit.kernels import compiled


@compiled
def summed(of_vertex: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """As ``repeated.summed``."""
    result = zeros(len(vertices), np.uint64)
    for c in range(len(vertices)):
        for k in range(vertices.shape[1]):
            result[c] += of_vertex[vertices[c, k]]
    return result
