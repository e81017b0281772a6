"""Set-up compiled: the same groups as the sort-based code gives, by counting."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled


@compiled
def group(keys: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """As ``csr.group``: positions of ``keys`` grouped by value, ascending within each group, and offsets."""
    start = np.zeros(n + 1, dtype=np.int64)
    for key in keys:
        if key >= 0:
            start[key + 1] += 1
    for i in range(n):
        start[i + 1] += start[i]
    fill = start[:-1].copy()
    position = np.empty(start[n], dtype=np.int64)
    for i in range(len(keys)):
        if keys[i] >= 0:
            position[fill[keys[i]]] = i
            fill[keys[i]] += 1
    return position, start


@compiled
def ring_entries(
    position: np.ndarray, vertices: np.ndarray, shapes: np.ndarray, origin_first: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Other vertices and shape of the corners at these flat positions, seen from the vertex there."""
    width = vertices.shape[1]
    others = np.empty((len(position), width - 1), dtype=np.int32)
    shape = np.empty(len(position), dtype=np.uint8)
    for i in range(len(position)):
        corner, local = position[i] // width, position[i] % width
        for j in range(1, width):
            others[i, j - 1] = vertices[corner, origin_first[local, j]]
        shape[i] = shapes[corner, local]
    return others, shape


@compiled
def sorted_rows(rows: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """As ``facets._sorted_rows``: an order that puts equal rows together, and where each new row begins.

    rows: (m, w) ascending in each row, entries from -1 to n - 1, the last not -1.
    """
    m, w = rows.shape
    last = np.empty(m, dtype=np.int32)
    for i in range(m):
        last[i] = rows[i, w - 1]
    order, start = group(last, n)
    for g in range(n):  # the few rows with one last entry are sorted by insertion
        for i in range(start[g] + 1, start[g + 1]):
            row = order[i]
            j = i
            while j > start[g] and _less(rows, row, order[j - 1]):
                order[j] = order[j - 1]
                j -= 1
            order[j] = row
    new = np.ones(m, dtype=np.bool_)
    for i in range(1, m):
        new[i] = False
        for k in range(w):
            if rows[order[i], k] != rows[order[i - 1], k]:
                new[i] = True
    return order, new


@compiled
def _less(rows: np.ndarray, a: int, b: int) -> bool:
    for k in range(rows.shape[1]):
        if rows[a, k] != rows[b, k]:
            return rows[a, k] < rows[b, k]
    return False
