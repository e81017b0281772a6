"""Neighbourhoods: the vertices within a number of rings of others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def within_rings(rows: Sequence[np.ndarray], near: np.ndarray, rings: int) -> np.ndarray:
    """(N,) bool: the vertices marked in ``near`` ((N,) bool) and those within that many rings of them.

    rows: arrays (n, k) of vertices. The first ring of a vertex are those it shares a row with: the vertices
    of its cells, or with corners as rows those it shares an edge of a cell with.
    """
    reached = near.copy()
    for _ in range(rings):
        before = np.count_nonzero(reached)
        touched = [vertices[reached[vertices].any(axis=1)] for vertices in rows]
        for vertices in touched:
            reached[vertices] = True
        if np.count_nonzero(reached) == before:
            break  # however many rings are asked for
    return reached
