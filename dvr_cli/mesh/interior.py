"""Interior vertices: those around which every facet is shared by two cells of one region.

Facets are not listed for this. Every facet gets a random number that depends on its vertices and the region
of the cell that has it; each cell adds the numbers of its facets to their vertices by exclusive or. The two
cells on either side of a facet cancel, so what is left at a vertex is zero exactly where no facet is single
(any other sum of 64-bit random numbers vanishes with a chance of 2^-64).
"""

from __future__ import annotations

import numpy as np

from dvr_cli.mesh.facets import FACETS
from dvr_cli.mesh.mesh import Cells

_CELLS = 1 << 14  # cells looked at together: small enough for the cache


def enclosed(blocks: list[Cells], region: np.ndarray, n_points: int) -> np.ndarray:
    """(N,) bool: vertices of the cells without a facet that belongs to an odd number of cells of a region.

    blocks: linear cells of one dimension; region: (n,) region number of each, through all blocks.
    """
    used = np.zeros(n_points, dtype=bool)
    left_over = np.zeros(n_points, dtype=np.uint64)
    of_vertex = _mixed(np.arange(1, n_points + 1, dtype=np.uint64))
    of_region = _mixed(~region.astype(np.uint64)) if region.any() else None
    first = 0
    for block in blocks:
        facets = FACETS[block.type]
        for lo in range(0, len(block.vertices), _CELLS):
            vertices = block.vertices[lo : lo + _CELLS].T.astype(np.intp)
            number = of_vertex[vertices]
            sums = [sum((number[k] for k in facet[1:]), number[facet[0]]) for facet in facets]
            if of_region is not None:
                here = of_region[first + lo : first + lo + vertices.shape[1]]
                sums = [total + here for total in sums]
            numbers = [_mixed(total) for total in sums]
            for k, vertex in enumerate(vertices):
                around = [n for n, facet in zip(numbers, facets, strict=True) if k in facet]
                used[vertex] = True
                np.bitwise_xor.at(left_over, vertex, np.bitwise_xor.reduce(around))
        first += len(block.vertices)
    return used & (left_over == 0)


def _mixed(x: np.ndarray) -> np.ndarray:
    """Well-mixed 64-bit numbers, one to one with ``x`` (splitmix64)."""
    x = x * np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ x >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ x >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return x ^ x >> np.uint64(31)
