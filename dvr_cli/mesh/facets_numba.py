"""The order of facets compiled: by counting the groups that ``facets`` gives by sorting."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled
from dvr_cli.mesh.csr_numba import group


@compiled
def facet_order(vertices: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """As ``facets.facet_order``: an order that puts facets with the same vertices together, and where each
    group begins. n: number of points.

    Facets are grouped by their largest vertex; the few of one group are sorted by the others.
    """
    m, width = vertices.shape
    largest = np.empty(m, dtype=np.int32)
    smallest_two = np.empty(m, dtype=np.int64)
    third = np.zeros(m, dtype=np.int32)
    row = np.empty(width, dtype=np.int64)
    for i in range(m):
        for k in range(width):  # insertion sort of the row
            j = k
            while j > 0 and row[j - 1] > vertices[i, k]:
                row[j] = row[j - 1]
                j -= 1
            row[j] = vertices[i, k]
        largest[i] = row[width - 1]
        smallest_two[i] = (row[0] + 1) * (n + 1) + row[1]
        if width == 4:
            third[i] = row[2]
    order, start = group(largest, n)
    new = np.ones(m, dtype=np.bool_)
    for g in range(n):
        for i in range(start[g] + 1, start[g + 1]):
            facet, key, last = order[i], smallest_two[order[i]], third[order[i]]
            j = i
            while j > start[g]:
                before = order[j - 1]
                if smallest_two[before] < key or (smallest_two[before] == key and third[before] <= last):
                    break
                order[j] = before
                j -= 1
            order[j] = facet
        for i in range(start[g] + 1, start[g + 1]):
            one, other = order[i - 1], order[i]
            new[i] = smallest_two[one] != smallest_two[other] or third[one] != third[other]
    return order, new
