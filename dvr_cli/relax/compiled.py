"""The schedule and the worst corner compiled, vertex by vertex and corner by corner."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled
from dvr_cli.quality.compiled import corner_terms_2d, corner_terms_3d
from dvr_cli.relax.kernel import badness


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
def levels(start: np.ndarray, neighbours: np.ndarray, sequence: np.ndarray) -> np.ndarray:
    """(m,) number of each vertex's level: one more than the highest of its neighbours earlier in sequence."""
    level = np.full(len(sequence), -1)
    for vertex in sequence:
        highest = -1
        for entry in range(start[vertex], start[vertex + 1]):
            for neighbour in neighbours[entry]:
                if neighbour >= 0:
                    highest = max(highest, level[neighbour])
        level[vertex] = highest + 1
    return level


@compiled
def colours(start: np.ndarray, neighbours: np.ndarray, sequence: np.ndarray) -> np.ndarray:
    """(m,) first colour that no neighbour earlier in sequence has."""
    colour = np.full(len(sequence), -1)
    last_seen = np.full(len(sequence) + 1, -1)  # by colour: the vertex that last found it taken
    for vertex in sequence:
        for entry in range(start[vertex], start[vertex + 1]):
            for neighbour in neighbours[entry]:
                if neighbour >= 0 and colour[neighbour] >= 0:
                    last_seen[colour[neighbour]] = vertex
        free = 0
        while last_seen[free] == vertex:
            free += 1
        colour[vertex] = free
    return colour


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
