"""The schedule and the worst corner compiled, vertex by vertex and corner by corner."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled
from dvr_cli.quality.compiled import corner_terms_2d, corner_terms_3d
from dvr_cli.relax.ring_kernel import badness


@compiled
def along_curve(
    vertices: np.ndarray, shapes: np.ndarray, moves: np.ndarray, number: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and shapes of the corners with a vertex that moves; see ``problem._along_curve``."""
    n, width = vertices.shape
    smallest = np.full(n, -1, dtype=np.int32)
    place = np.zeros(len(number) + 1, dtype=np.int64)
    for c in range(n):
        least, touched = number[vertices[c, 0]], False
        for k in range(width):
            least = min(least, number[vertices[c, k]])
            touched = touched or moves[vertices[c, k]]
        if touched:
            smallest[c] = least
            place[least + 1] += 1
    for i in range(len(number)):
        place[i + 1] += place[i]
    new_vertices = np.empty((place[-1], width), dtype=np.int32)
    new_shapes = np.empty((place[-1], width), dtype=np.uint8)
    for c in range(n):
        if smallest[c] >= 0:
            to = place[smallest[c]]
            place[smallest[c]] += 1
            for k in range(width):
                new_vertices[to, k] = number[vertices[c, k]]
                new_shapes[to, k] = shapes[c, k]
    return new_vertices, new_shapes


@compiled
def levels(start: np.ndarray, corner: np.ndarray, members: np.ndarray, sequence: np.ndarray) -> np.ndarray:
    """(m,) number of each vertex's level: one more than the highest of its neighbours earlier in sequence."""
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
    """(m,) first colour that no neighbour earlier in sequence has."""
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
def _first_free(first: int, last: int, corner: np.ndarray, members: np.ndarray, colour: np.ndarray) -> int:
    """The first colour that none of the vertices of the corners of these entries has."""
    taken = np.zeros((last - first) * members.shape[1] + 1, dtype=np.bool_)
    for entry in range(first, last):
        for neighbour in members[corner[entry]]:
            if neighbour >= 0 and 0 <= colour[neighbour] < len(taken):
                taken[colour[neighbour]] = True
    free = 0
    while taken[free]:
        free += 1
    return free


@compiled
def worst_corner(
    points: np.ndarray, vertices: np.ndarray, shapes: np.ndarray, norm: np.ndarray, first: int, last: int
) -> tuple[int, float]:
    """The first of the corners first .. last with the largest badness, and that badness."""
    worst, largest = first, -1.0
    for c in range(first, last):
        if points.shape[1] == 2:
            v, s = corner_terms_2d(points, vertices[c], norm, shapes[c, 0])
        else:
            v, s = corner_terms_3d(points, vertices[c], norm, shapes[c, 0])
        here = badness(v, s, points.shape[1])
        if here > largest:
            worst, largest = c, here
    return worst, largest
