"""Incidence and rings compiled: by counting what ``rings`` gives by sorting."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty, zeros
from dvr_cli.jit.kernels import compiled


@compiled
def incidence(
    vertices: np.ndarray, number: np.ndarray, n: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """As ``rings.incidence``."""
    start = zeros(n + 1, np.int64)
    members = empty((len(vertices), vertices.shape[1]), np.int32)
    for c in range(len(members)):
        for k in range(members.shape[1]):
            i = number[vertices[c, k]]
            members[c, k] = i
            if i >= 0:
                start[i + 1] += 1
    for i in range(n):
        start[i + 1] += start[i]
    fill = start[:-1].copy()
    corner = empty(start[n], np.int32)
    place = empty(start[n], np.int8)
    for c in range(len(members)):
        for k in range(members.shape[1]):
            i = members[c, k]
            if i >= 0:
                corner[fill[i]], place[fill[i]] = c, k
                fill[i] += 1
    return start, corner, place, members


@compiled
def rings(
    sequence: np.ndarray,
    start: np.ndarray,
    corner: np.ndarray,
    place: np.ndarray,
    vertices: np.ndarray,
    shapes: np.ndarray,
    origin_first: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As ``rings.rings``, of a sequence of all the vertices."""
    width = vertices.shape[1]
    new_start = zeros(len(sequence) + 1, np.int64)
    ring_start = empty(len(sequence), np.int64)
    for i in range(len(sequence)):
        ring_start[sequence[i]] = new_start[i]
        new_start[i + 1] = new_start[i] + start[sequence[i] + 1] - start[sequence[i]]
    others = empty((new_start[-1], width - 1), np.int32)
    shape = empty(new_start[-1], np.int32)
    for vertex in range(len(sequence)):  # not in sequence: neighbours' rings share corners
        new = ring_start[vertex]
        for entry in range(start[vertex], start[vertex + 1]):
            c, own = corner[entry], place[entry]
            for j in range(1, width):
                others[new, j - 1] = vertices[c, origin_first[own, j]]
            shape[new] = shapes[c, own]
            new += 1
    return new_start, others, shape
