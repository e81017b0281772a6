"""Quality vectors compiled: what ``vector`` gives."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.kernels import compiled


@compiled
def lower(minima: np.ndarray, values: np.ndarray, vertices: np.ndarray) -> None:
    """As ``vector.lower``."""
    for c in range(len(vertices)):
        for k in range(vertices.shape[1]):
            if values[c] < minima[vertices[c, k]]:
                minima[vertices[c, k]] = values[c]
