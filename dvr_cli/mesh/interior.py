"""Interior vertices: those around which every facet is shared by two cells of one region.

Facets are not listed for this. Every facet gets a random number that depends on its vertices and the region
of the cell that has it; each cell adds the numbers of its facets to their vertices by exclusive or. The two
cells on either side of a facet cancel, so what remains at a vertex is zero exactly where no facet is single
(any other sum of 64-bit random numbers vanishes with a chance of 2^-64).
"""

from __future__ import annotations

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.facets import padded_facets
from dvr_cli.mesh.hashing import mixed
from dvr_cli.mesh.mesh import Cells

_CELLS = 1 << 14  # cells looked at together: small enough for the cache


def enclosed(blocks: list[Cells], region: np.ndarray, n_points: int, backend: Backend = NUMPY) -> np.ndarray:
    """(N,) bool: vertices of the cells without a facet that belongs to an odd number of cells of a region.

    blocks: linear cells of one dimension; region: (n,) region number of each, through all blocks.
    backend: what computes; the result is the same.
    """
    used = np.zeros(n_points, dtype=bool)
    unpaired = np.zeros(n_points, dtype=np.uint64)
    of_vertex = mixed(np.arange(1, n_points + 1, dtype=np.uint64))
    of_region = mixed(~region.astype(np.uint64)) if region.any() else np.zeros(len(region), dtype=np.uint64)
    start = 0
    with np.errstate(over="ignore"):  # numbers are modulo 2^64, and numba may be told to run Python
        for block in blocks:
            here = of_region[start : start + len(block.vertices)]
            start += len(block.vertices)
            sums = of_vertex, here, used, unpaired
            cell_type = CELL_TYPES[block.type]
            if cell_type.is_simplex:
                backend.twin(cancel_facets_of_simplices)(block.vertices, *sums)
            else:
                backend.twin(cancel_facets)(block.vertices, padded_facets(cell_type), *sums)
    return used & (unpaired == 0)


def cancel_facets(
    vertices: np.ndarray,
    facets: np.ndarray,
    of_vertex: np.ndarray,
    of_region: np.ndarray,
    used: np.ndarray,
    unpaired: np.ndarray,
) -> None:
    """Add the cells ``vertices`` (n, k) to what ``enclosed`` knows of their vertices.

    facets: (F, w) the local facets of their type, shorter ones ending in -1. of_region: (n,).
    """
    sides = [[k for k in facet if k >= 0] for facet in facets.tolist()]
    for lo in range(0, len(vertices), _CELLS):
        chunk = vertices[lo : lo + _CELLS].T.astype(np.intp)
        number, here = of_vertex[chunk], of_region[lo : lo + _CELLS]
        numbers = [mixed(sum((number[k] for k in side), here)) for side in sides]
        for k, vertex in enumerate(chunk):
            around = [n for n, side in zip(numbers, sides, strict=True) if k in side]
            used[vertex] = True
            np.bitwise_xor.at(unpaired, vertex, np.bitwise_xor.reduce(around))


def cancel_facets_of_simplices(
    vertices: np.ndarray,
    of_vertex: np.ndarray,
    of_region: np.ndarray,
    used: np.ndarray,
    unpaired: np.ndarray,
) -> None:
    """The same for triangles or tetrahedra, each facet of which lacks one vertex."""
    width = vertices.shape[1]
    facets = np.array([[k for k in range(width) if k != lacking] for lacking in range(width)])
    cancel_facets(vertices, facets, of_vertex, of_region, used, unpaired)
