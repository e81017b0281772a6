"""Neighbourhoods: the vertices within a number of rings of others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dvr_cli.mesh.mesh import Cells


def within_rings(cells: Sequence[Cells], near: np.ndarray, rings: int) -> np.ndarray:
    """(N,) bool: the vertices marked in ``near`` ((N,) bool) and those within that many rings of them.

    The first ring of a vertex are the vertices it shares a cell with.
    """
    reached = near.copy()
    for _ in range(rings):
        before = np.count_nonzero(reached)
        touched = [block.vertices[reached[block.vertices].any(axis=1)] for block in cells]
        for vertices in touched:
            reached[vertices] = True
        if np.count_nonzero(reached) == before:
            break  # however many rings are asked for
    return reached
