"""Index arithmetic on rows of unequal length stored end to end (compressed sparse rows)."""

from __future__ import annotations

import numpy as np


def row_entries(start: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions of all entries of ``rows``, row after row, and where each row begins among them.

    start: (n + 1,) offsets; rows: (m,) row numbers. Returns ((sum of lengths,), (m + 1,)) int64.
    """
    length = start[rows + 1] - start[rows]
    row_start = np.concatenate([[0], np.cumsum(length)])
    return np.arange(row_start[-1]) + np.repeat(start[rows] - row_start[:-1], length), row_start


def group(keys: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions of ``keys`` grouped by value 0..n-1, ascending within each group, and the (n+1,) offsets.

    Negative keys are left out. The position is packed below the key, so that a plain sort is stable.
    """
    position = np.flatnonzero(keys >= 0)
    packed = keys[position].astype(np.int64) << 32 | position
    packed.sort()
    start = np.concatenate([[0], np.cumsum(np.bincount(packed >> 32, minlength=n))])
    return packed & 0xFFFFFFFF, start
