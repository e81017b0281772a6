"""Directions drawn uniformly, compiled: what ``uniform`` gives, vertex by vertex."""

from __future__ import annotations

from typing import Any

import numpy as np

from dvr_cli.jit.kernels import compiled, inlined
from dvr_cli.relax import uniform
from dvr_cli.relax.uniform import DROPPED, HALF, LOW, UNIT

philox: Any = inlined(uniform.philox)  # of numbers, where NumPy takes arrays: the same lines


@compiled
def unit_vectors(vertices: np.ndarray, key: np.uint64, sweep: np.uint64, result: np.ndarray) -> None:
    """As ``uniform.unit_vectors``."""
    for i in range(len(vertices)):
        vertex, attempt = np.uint64(vertices[i]), np.uint64(0)
        while True:
            a, b, c, d = philox((vertex & LOW, vertex >> HALF, sweep, attempt), key)
            u = (np.int64(b << HALF | a) >> DROPPED) * UNIT
            v = (np.int64(d << HALF | c) >> DROPPED) * UNIT
            square = u * u + v * v
            if 0.0 < square < 1.0:
                break
            attempt += np.uint64(1)
        if result.shape[1] == 2:
            length = np.sqrt(square)
            result[i, 0], result[i, 1] = u / length, v / length
        else:
            width = 2.0 * np.sqrt(1.0 - square)
            result[i, 0], result[i, 1] = u * width, v * width
            result[i, 2] = 1.0 - 2.0 * square
