"""Neighbourhoods compiled: the patches that ``neighbourhoods`` gives, corner by corner."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty, full, zeros
from dvr_cli.jit.kernels import compiled, inlined


@compiled
def choose(
    seeds: np.ndarray,
    layers: np.ndarray,
    most: int,
    relaxed: np.ndarray,
    start: np.ndarray,
    incident: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """As ``neighbourhoods.choose``."""
    claimed = zeros(len(relaxed), np.bool_)
    seen_vertex = full(len(start), -1, np.int32)  # the seed, by position, that last found it
    seen_corner = full(len(relaxed), -1, np.int32)
    freed, corners = empty(len(start), np.int64), empty(len(relaxed), np.int64)
    freed_start, corner_start = zeros(most + 1, np.int64), zeros(most + 1, np.int64)
    taken = empty(most, np.int64)
    n = 0
    for number, seed in enumerate(seeds):
        if n == most:
            break
        if claimed[seed]:
            continue
        vertex_end, corner_end = freed_start[n], corner_start[n]
        for vertex in relaxed[seed]:
            if vertex >= 0:
                freed[vertex_end] = vertex
                seen_vertex[vertex] = number
                vertex_end += 1
        vertex_done, corner_done = freed_start[n], corner_start[n]
        free = True
        for layer in range(layers[seed] + 1):
            for i in range(vertex_done, vertex_end):
                for entry in range(start[freed[i]], start[freed[i] + 1]):
                    corner = incident[entry]
                    if claimed[corner]:
                        free = False
                    elif seen_corner[corner] != number:
                        seen_corner[corner] = number
                        corners[corner_end] = corner
                        corner_end += 1
            if layer == layers[seed] or not free:
                break
            vertex_done = vertex_end
            for i in range(corner_done, corner_end):
                for vertex in relaxed[corners[i]]:
                    if vertex >= 0 and seen_vertex[vertex] != number:
                        seen_vertex[vertex] = number
                        freed[vertex_end] = vertex
                        vertex_end += 1
            corner_done = corner_end
        if not free:
            continue
        _sort(freed, freed_start[n], vertex_end)
        _sort(corners, corner_start[n], corner_end)
        for i in range(corner_start[n], corner_end):
            claimed[corners[i]] = True
        taken[n] = seed
        n += 1
        freed_start[n], corner_start[n] = vertex_end, corner_end
    return (
        taken[:n],
        freed_start[: n + 1],
        freed[: freed_start[n]],
        corner_start[: n + 1],
        corners[: corner_start[n]],
    )


@inlined
def _sort(values: np.ndarray, lo: int, hi: int) -> None:
    """Sort a part of an array by ever smaller steps; NumPy's way takes the compiler ten times as long."""
    step = (hi - lo) // 2
    while step > 0:
        for i in range(lo + step, hi):
            value, j = values[i], i
            while j >= lo + step and values[j - step] > value:
                values[j] = values[j - step]
                j -= step
            values[j] = value
        step = 1 if step == 2 else step * 5 // 11
