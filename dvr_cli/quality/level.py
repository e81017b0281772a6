"""The quality that few elements are below, by which phases tell what they are to help."""

from __future__ import annotations

import numpy as np

WORST = 0.004  # share of the elements that are below the level of care: patches can be paid for so many,
LEAST = 32  # and so many they are at least


def place_of_level(count: int, share: float, least: int) -> int:
    """The place of the level among so many qualities, in ascending order."""
    return min(max(int(share * count), least), count - 1)


def level_of(qualities: np.ndarray, share: float = WORST, least: int = LEAST) -> float:
    """The quality that this share of elements with these qualities (C,) is below, but so many at least."""
    place = place_of_level(len(qualities), share, least)
    return float(np.partition(qualities, place)[place])
