"""Connected parts compiled: trees of nodes, each rooted at the smallest, instead of rounds over all edges."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.kernels import compiled


@compiled
def connected_parts(n: int, tail: np.ndarray, head: np.ndarray) -> np.ndarray:
    """As ``orientation.connected_parts``."""
    label = np.arange(n)
    for i in range(len(tail)):
        one, other = tail[i], head[i]
        while label[one] != one:
            label[one] = label[label[one]]  # so that ways to the root stay short
            one = label[one]
        while label[other] != other:
            label[other] = label[label[other]]
            other = label[other]
        if one < other:
            label[other] = one
        else:
            label[one] = other
    for i in range(n):
        label[i] = label[label[i]]  # that of a smaller node, which is its root by now
    return label
