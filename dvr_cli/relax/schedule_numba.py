"""The schedule compiled, vertex by vertex."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty, full, zeros
from dvr_cli.jit.kernels import compiled, part

_WAITED_FOR = np.uint64(1 << 63)


@compiled
def levels(start: np.ndarray, corner: np.ndarray, members: np.ndarray, sequence: np.ndarray) -> np.ndarray:
    """As ``schedule.levels``."""
    level = full(len(sequence), -1, np.int64)
    for vertex in sequence:
        highest = -1
        for entry in range(start[vertex], start[vertex + 1]):
            for neighbour in members[corner[entry]]:
                if neighbour >= 0:
                    highest = max(highest, level[neighbour])
        level[vertex] = highest + 1
    return level


@compiled
def colours(start: np.ndarray, corner: np.ndarray, members: np.ndarray, sequence: np.ndarray) -> np.ndarray:
    """As ``schedule.colours``."""
    m = len(sequence)
    colour = full(m, -1, np.int32)
    bit = zeros(m + 1, np.uint64)  # of the colours below 64; the number -1 looks up the last entry
    for vertex in sequence:
        taken = np.uint64(0)
        for entry in range(start[vertex], start[vertex + 1]):
            for k in range(members.shape[1]):
                taken |= bit[members[corner[entry], k]]
        free = 0
        while free < 64 and taken >> np.uint64(free) & np.uint64(1):
            free += 1
        if free < 64:
            bit[vertex] = np.uint64(1) << np.uint64(free)
        else:
            free = _first_free(start[vertex], start[vertex + 1], corner, members, colour)
        colour[vertex] = free
    return colour


@compiled
def colour_ready(
    sequence: np.ndarray,
    own: np.ndarray,
    start: np.ndarray,
    corner: np.ndarray,
    vertices: np.ndarray,
    turn: np.ndarray,
    colour: np.ndarray,
) -> None:
    """As ``schedule.colour_ready``."""
    bit = empty(len(colour), np.uint64)  # of the colours below 63; the last: there is none yet
    for vertex in range(len(colour)):
        bit[vertex] = _bit_of(colour[vertex]) if colour[vertex] >= 0 else _WAITED_FOR
    for position in sequence:
        vertex, taken = own[position], np.uint64(0)
        for entry in range(start[position], start[position + 1]):
            for k in range(vertices.shape[1]):
                other = vertices[corner[entry], k]
                taken |= bit[other] if turn[other] < turn[vertex] else np.uint64(0)
            if taken & _WAITED_FOR:
                break
        if taken & _WAITED_FOR:
            continue
        free = 0
        while free < 63 and taken >> np.uint64(free) & np.uint64(1):
            free += 1
        if free == 63:
            entries = start[position], start[position + 1]
            free = _first_free_before(vertex, entries, corner, vertices, turn, colour)
        colour[vertex], bit[vertex] = free, _bit_of(free)


@part
def _bit_of(colour: int) -> np.uint64:
    """The bit of a colour below 63, zero of others."""
    return np.uint64(1) << np.uint64(colour) if colour < 63 else np.uint64(0)


@part
def _first_free_before(
    vertex: int,
    entries: tuple[int, int],
    corner: np.ndarray,
    vertices: np.ndarray,
    turn: np.ndarray,
    colour: np.ndarray,
) -> int:
    """The first colour that no vertex with an earlier turn has.

    entries: from where to where the entries are of whose corners they are.
    """
    start, stop = entries
    taken = zeros((stop - start) * vertices.shape[1] + 1, np.bool_)
    for entry in range(start, stop):
        for other in vertices[corner[entry]]:
            if turn[other] < turn[vertex] and colour[other] < len(taken):
                taken[colour[other]] = True
    free = 0
    while taken[free]:
        free += 1
    return free


@part
def _first_free(start: int, stop: int, corner: np.ndarray, members: np.ndarray, colour: np.ndarray) -> int:
    """The first colour that none of the vertices of the corners of these entries has."""
    taken = zeros((stop - start) * members.shape[1] + 1, np.bool_)
    for entry in range(start, stop):
        for neighbour in members[corner[entry]]:
            if neighbour >= 0 and 0 <= colour[neighbour] < len(taken):
                taken[colour[neighbour]] = True
    free = 0
    while taken[free]:
        free += 1
    return free
