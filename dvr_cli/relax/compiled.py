"""The schedule and the worst corner compiled, vertex by vertex and corner by corner."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled
from dvr_cli.relax.kernel import badness


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
            here = _corner_badness_2d(points, vertices[c], norm, shapes[c, 0])
        else:
            here = _corner_badness_3d(points, vertices[c], norm, shapes[c, 0])
        if here > largest:
            worst, largest = c, here
    return worst, largest


@compiled
def _corner_badness_2d(points: np.ndarray, corner: np.ndarray, norm: np.ndarray, k: int) -> float:
    x, p, q = points[corner[0]], points[corner[1]], points[corner[2]]
    e0, e1 = p[0] - x[0], p[1] - x[1]
    f0, f1 = q[0] - x[0], q[1] - x[1]
    v = e0 * (q[1] - p[1]) + e1 * -(q[0] - p[0])
    s = norm[k, 0] * (e0 * e0 + e1 * e1)
    s = s + norm[k, 1] * (f0 * f0 + f1 * f1)
    s = s + norm[k, 2] * (e0 * f0 + e1 * f1)
    return badness(v, s, 2)


@compiled
def _corner_badness_3d(points: np.ndarray, corner: np.ndarray, norm: np.ndarray, k: int) -> float:
    x, p, q, r = points[corner[0]], points[corner[1]], points[corner[2]], points[corner[3]]
    a0, a1, a2 = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    b0, b1, b2 = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    e0, e1, e2 = p[0] - x[0], p[1] - x[1], p[2] - x[2]
    f0, f1, f2 = q[0] - x[0], q[1] - x[1], q[2] - x[2]
    g0, g1, g2 = r[0] - x[0], r[1] - x[1], r[2] - x[2]
    v = e0 * (a1 * b2 - a2 * b1) + e1 * (a2 * b0 - a0 * b2) + e2 * (a0 * b1 - a1 * b0)
    s = norm[k, 0] * (e0 * e0 + e1 * e1 + e2 * e2)
    s = s + norm[k, 1] * (f0 * f0 + f1 * f1 + f2 * f2)
    s = s + norm[k, 2] * (g0 * g0 + g1 * g1 + g2 * g2)
    s = s + norm[k, 3] * (e0 * f0 + e1 * f1 + e2 * f2)
    s = s + norm[k, 4] * (e0 * g0 + e1 * g1 + e2 * g2)
    s = s + norm[k, 5] * (f0 * g0 + f1 * g1 + f2 * g2)
    return badness(v, s, 3)
