"""The order of facets compiled: by counting the groups that ``facets`` gives by sorting."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty, zeros
from dvr_cli.jit.kernels import compiled
from dvr_cli.mesh.csr_numba import group


@compiled
def facet_order(vertices: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """As ``facets.facet_order``, but that equal facets are in the order of their rows.

    Facets are grouped by their number of vertices and the smallest; the few of one group are sorted by the
    others.
    """
    m, width = vertices.shape
    fewest = width
    for i in range(m):
        missing = 0
        for k in range(width):
            missing += vertices[i, k] < 0
        fewest = min(fewest, width - missing)
    place = empty(m, np.int64)
    next_two, last = zeros(m, np.int64), zeros(m if width == 4 else 0, np.int64)
    row = empty(width, np.int64)
    for i in range(m):
        for k in range(width):  # insertion sort of the row
            j = k
            while j > 0 and row[j - 1] > vertices[i, k]:
                row[j] = row[j - 1]
                j -= 1
            row[j] = vertices[i, k]
        first = 0
        while first < width and row[first] < 0:
            first += 1
        place[i] = (width - first - fewest) * n + (row[first] if first < width else 0)
        for k in range(first + 1, min(first + 3, width)):
            next_two[i] = next_two[i] * (n + 1) + row[k] + 1
        if first + 3 < width:
            last[i] = row[first + 3]
    order, start = group(place, (width - fewest + 1) * n)
    new = np.ones(m, dtype=np.bool_)
    keys, more = next_two[order], last[order[: len(last)]]
    for g in range(len(start) - 1):
        lo = start[g]
        for i in range(lo + 1, start[g + 1]):
            facet, key = order[i], keys[i]
            third = more[i] if width == 4 else 0
            j = i
            while j > lo and keys[j - 1] >= key:
                if keys[j - 1] == key and (width < 4 or more[j - 1] <= third):
                    break
                order[j], keys[j] = order[j - 1], keys[j - 1]
                if width == 4:
                    more[j] = more[j - 1]
                j -= 1
            order[j], keys[j] = facet, key
            if width == 4:
                more[j] = third
        for i in range(lo + 1, start[g + 1]):
            new[i] = keys[i] != keys[i - 1] or (width == 4 and more[i] != more[i - 1])
    return order, new
