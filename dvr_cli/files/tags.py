"""From the tags that files give their nodes and elements to positions."""

from __future__ import annotations

import numpy as np


class TagIndex:
    """Finds the position of each tag in a list of tags, which may be sparse and in any order."""

    def __init__(self, tags: np.ndarray) -> None:
        """tags: (n,) integers."""
        dtype = np.int32 if len(tags) < 2**31 else np.int64
        self._table: np.ndarray | None = None
        if len(tags) == 0 or (tags.min() > 0 and tags.max() <= 4 * len(tags) + 1000):
            # Entry 0 answers for tags too low, the last one for tags too high.
            self._table = np.full(int(tags.max(initial=0)) + 2, -1, dtype)
            self._table[tags] = np.arange(len(tags), dtype=dtype)
        else:
            self._order = np.argsort(tags, kind="stable").astype(dtype)
            self._sorted = tags[self._order]

    def find(self, tags: np.ndarray) -> np.ndarray:
        """The positions of ``tags`` (any shape), -1 for a tag that is not in the list.

        Of a tag that the list repeats, one of its positions.
        """
        if self._table is not None:
            return self._table.take(tags, mode="clip")
        at = np.searchsorted(self._sorted, tags).clip(max=len(self._sorted) - 1)
        return np.where(self._sorted[at] == tags, self._order[at], -1)


def first_repeated(tags: np.ndarray) -> int | None:
    """A tag that occurs more than once among ``tags`` ((n,) integers), or None."""
    if (tags[1:] > tags[:-1]).all():
        return None
    ordered = np.sort(tags)
    repeats = ordered[1:][ordered[1:] == ordered[:-1]]
    return int(repeats[0]) if len(repeats) else None
