"""Directions drawn uniformly, compiled: what ``uniform`` gives, vertex by vertex."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled, inlined
from dvr_cli.relax.uniform import DROPPED, FACTORS, HALF, LOW, ROUNDS, STEPS, UNIT


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


@inlined
def philox(
    counter: tuple[np.uint64, np.uint64, np.uint64, np.uint64], key: np.uint64
) -> tuple[np.uint64, np.uint64, np.uint64, np.uint64]:
    """As ``uniform.philox``, for one counter."""
    a, b, c, d = counter
    left, right = key & LOW, key >> HALF
    for _ in range(ROUNDS):
        one, other = a * FACTORS[0], c * FACTORS[1]
        a, b, c, d = other >> HALF ^ b ^ left, other & LOW, one >> HALF ^ d ^ right, one & LOW
        left, right = left + STEPS[0] & LOW, right + STEPS[1] & LOW
    return a, b, c, d
