"""Interior vertices compiled: the numbers that ``interior`` adds, cell by cell."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty
from dvr_cli.jit.kernels import compiled, inlined
from dvr_cli.mesh.hashing import mixed

_mixed = inlined(mixed)


@compiled
def cancel_facets(
    vertices: np.ndarray,
    facets: np.ndarray,
    of_vertex: np.ndarray,
    of_region: np.ndarray,
    used: np.ndarray,
    unpaired: np.ndarray,
) -> None:
    """As ``interior.cancel_facets``."""
    width = vertices.shape[1]
    number, around = empty(width, np.uint64), empty(width, np.uint64)
    for c in range(len(vertices)):
        for k in range(width):
            number[k], around[k] = of_vertex[vertices[c, k]], 0
        for f in range(len(facets)):
            total = of_region[c]
            for j in range(facets.shape[1]):
                if facets[f, j] >= 0:
                    total += number[facets[f, j]]
            total = _mixed(total)
            for j in range(facets.shape[1]):
                if facets[f, j] >= 0:
                    around[facets[f, j]] ^= total
        for k in range(width):
            used[vertices[c, k]] = True
            unpaired[vertices[c, k]] ^= around[k]


@compiled
def cancel_facets_of_simplices(
    vertices: np.ndarray,
    of_vertex: np.ndarray,
    of_region: np.ndarray,
    used: np.ndarray,
    unpaired: np.ndarray,
) -> None:
    """The same for triangles or tetrahedra, each facet of which lacks one vertex."""
    width = vertices.shape[1]
    number = empty(width, np.uint64)
    for c in range(len(vertices)):
        total, around = of_region[c], np.uint64(0)
        for k in range(width):
            total += of_vertex[vertices[c, k]]
        for k in range(width):
            number[k] = _mixed(total - of_vertex[vertices[c, k]])
            around ^= number[k]
        for k in range(width):
            used[vertices[c, k]] = True
            unpaired[vertices[c, k]] ^= around ^ number[k]
