"""Interior vertices: those around which every facet is shared by two cells of one region.

Facets are not listed for this. Every facet gets a random number that depends on its vertices and the region
of the cell that has it; each cell adds the numbers of its facets to their vertices by exclusive or. The two
cells on either side of a facet cancel, so what is left at a vertex is zero exactly where no facet is single
(any other sum of 64-bit random numbers vanishes with a chance of 2^-64).
"""

from __future__ import annotations

import numpy as np

from dvr_cli.mesh.facets import FACETS, local_facets
from dvr_cli.mesh.hashing import mixed
from dvr_cli.mesh.mesh import Cells

_CELLS = 1 << 14  # cells looked at together: small enough for the cache


def enclosed(blocks: list[Cells], region: np.ndarray, n_points: int, compiled: bool = False) -> np.ndarray:
    """(N,) bool: vertices of the cells without a facet that belongs to an odd number of cells of a region.

    blocks: linear cells of one dimension; region: (n,) region number of each, through all blocks.
    compiled: use compiled code; the result is the same.
    """
    used = np.zeros(n_points, dtype=bool)
    left_over = np.zeros(n_points, dtype=np.uint64)
    of_vertex = mixed(np.arange(1, n_points + 1, dtype=np.uint64))
    of_region = mixed(~region.astype(np.uint64)) if region.any() else np.zeros(len(region), dtype=np.uint64)
    first = 0
    for block in blocks:
        here = of_region[first : first + len(block.vertices)]
        first += len(block.vertices)
        if compiled:
            from dvr_cli.mesh import interior_numba as fast

            with np.errstate(over="ignore"):  # numbers are modulo 2^64, and numba may be told to run Python
                if block.type in ("triangle", "tetra"):
                    fast.cancel_facets_of_simplices(block.vertices, of_vertex, here, used, left_over)
                else:
                    facets = local_facets(block.type)
                    fast.cancel_facets(block.vertices, facets, of_vertex, here, used, left_over)
        else:
            _cancel_facets(block, of_vertex, here, used, left_over)
    return used & (left_over == 0)


def _cancel_facets(
    block: Cells, of_vertex: np.ndarray, of_region: np.ndarray, used: np.ndarray, left_over: np.ndarray
) -> None:
    """Add the cells of a block to what ``enclosed`` knows of their vertices."""
    facets = FACETS[block.type]
    for lo in range(0, len(block.vertices), _CELLS):
        vertices = block.vertices[lo : lo + _CELLS].T.astype(np.intp)
        number, here = of_vertex[vertices], of_region[lo : lo + _CELLS]
        numbers = [mixed(sum((number[k] for k in facet), here)) for facet in facets]
        for k, vertex in enumerate(vertices):
            around = [n for n, facet in zip(numbers, facets, strict=True) if k in facet]
            used[vertex] = True
            np.bitwise_xor.at(left_over, vertex, np.bitwise_xor.reduce(around))
