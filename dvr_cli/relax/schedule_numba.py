"""The schedule compiled, vertex by vertex."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled, part


@compiled
def levels(start: np.ndarray, corner: np.ndarray, members: np.ndarray, sequence: np.ndarray) -> np.ndarray:
    """As ``schedule.levels``."""
    level = np.full(len(sequence), -1)
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
    colour = np.full(m, -1, dtype=np.int32)
    bit = np.zeros(m + 1, dtype=np.uint64)  # of the colours below 64; the number -1 looks up the last entry
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
    width = vertices.shape[1]
    most = 1
    for position in sequence:
        most = max(most, (start[position + 1] - start[position]) * width + 1)
    taken_by = np.full(most, -1, dtype=np.int64)  # the last position that found a colour taken
    for position in sequence:
        vertex, waits = own[position], False
        for entry in range(start[position], start[position + 1]):
            for k in range(width):
                other = vertices[corner[entry], k]
                if turn[other] < turn[vertex]:
                    if colour[other] < 0:
                        waits = True
                    elif colour[other] < most:
                        taken_by[colour[other]] = position
            if waits:
                break
        if not waits:
            free = 0
            while taken_by[free] == position:
                free += 1
            colour[vertex] = free


@part
def _first_free(start: int, stop: int, corner: np.ndarray, members: np.ndarray, colour: np.ndarray) -> int:
    """The first colour that none of the vertices of the corners of these entries has."""
    taken = np.zeros((stop - start) * members.shape[1] + 1, dtype=np.bool_)
    for entry in range(start, stop):
        for neighbour in members[corner[entry]]:
            if neighbour >= 0 and 0 <= colour[neighbour] < len(taken):
                taken[colour[neighbour]] = True
    free = 0
    while taken[free]:
        free += 1
    return free
