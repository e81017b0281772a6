"""Distinct whole numbers, and ranks: numbers without gaps for values that may have any."""

from __future__ import annotations

import numpy as np


def ranks(values: np.ndarray) -> np.ndarray:
    """The rank of each of (n,) values among the distinct ones, from 0; integers are seldom sorted for it."""
    return distinct_and_ranks(values)[1]


def distinct_and_ranks(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distinct ones of (n,) values, ascending, and the rank of each value among them, from 0."""
    if values.dtype.kind not in "iu" or not len(values):
        return np.unique(values, return_inverse=True)
    lowest = values.min()
    spread = int(values.max()) - int(lowest)
    if spread > 4 * len(values) + 1000:
        return np.unique(values, return_inverse=True)
    offset = (values.astype(np.int64) if spread < 2**62 else values) - lowest.astype(np.int64)
    used = np.zeros(spread + 1, bool)
    used[offset] = True
    return np.flatnonzero(used) + lowest, (np.cumsum(used) - 1)[offset]


def distinct(values: np.ndarray) -> np.ndarray:
    """The distinct ones of (n,) whole numbers, ascending, as np.unique has them.

    That function loads numpy.ma first, which is a thirtieth of a short run.
    """
    ordered = np.sort(values)
    first = np.ones(len(ordered), bool)
    first[1:] = ordered[1:] != ordered[:-1]
    return ordered[first]
