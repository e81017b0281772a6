"""Set-up compiled: the determinants that ``simplex`` gives, and by counting the groups that sorting gives."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled, inlined
from dvr_cli.mesh.interior import mixed

_mixed = inlined(mixed)


@compiled
def determinants(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """As ``simplex.corner_measures``: determinant of the edges of each simplex (n, d+1)."""
    result = np.empty(len(vertices))
    for i in range(len(vertices)):
        if vertices.shape[1] == 3:
            result[i] = determinant_2d(points, vertices[i])
        else:
            result[i] = determinant_3d(points, vertices[i])
    return result


@inlined
def determinant_2d(points: np.ndarray, corner: np.ndarray) -> float:
    """Determinant of the edges of one triangle (3,) from its first vertex."""
    x, p, q = points[corner[0]], points[corner[1]], points[corner[2]]
    return (p[0] - x[0]) * (q[1] - p[1]) + (p[1] - x[1]) * -(q[0] - p[0])


@inlined
def determinant_3d(points: np.ndarray, corner: np.ndarray) -> float:
    """Determinant of the edges of one tetrahedron (4,) from its first vertex."""
    x, p, q, r = points[corner[0]], points[corner[1]], points[corner[2]], points[corner[3]]
    a0, a1, a2 = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    b0, b1, b2 = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    e0, e1, e2 = p[0] - x[0], p[1] - x[1], p[2] - x[2]
    return e0 * (a1 * b2 - a2 * b1) + e1 * (a2 * b0 - a0 * b2) + e2 * (a0 * b1 - a1 * b0)


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
def incidence(members: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As ``rings.incidence_of``: offsets, and corner and place in it of each entry, by vertex 0..n-1."""
    start = np.zeros(n + 1, dtype=np.int64)
    for c in range(len(members)):
        for k in range(members.shape[1]):
            if members[c, k] >= 0:
                start[members[c, k] + 1] += 1
    for i in range(n):
        start[i + 1] += start[i]
    fill = start[:-1].copy()
    corner = np.empty(start[n], dtype=np.int32)
    place = np.empty(start[n], dtype=np.int8)
    for c in range(len(members)):
        for k in range(members.shape[1]):
            i = members[c, k]
            if i >= 0:
                corner[fill[i]], place[fill[i]] = c, k
                fill[i] += 1
    return start, corner, place


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
    """As ``Incidence.rings``: offsets, other vertices and shapes of the rings, one after the other."""
    width = vertices.shape[1]
    new_start = np.zeros(len(sequence) + 1, dtype=np.int64)
    begin = np.empty(len(sequence), dtype=np.int64)
    for i in range(len(sequence)):
        begin[sequence[i]] = new_start[i]
        new_start[i + 1] = new_start[i] + start[sequence[i] + 1] - start[sequence[i]]
    others = np.empty((new_start[-1], width - 1), dtype=np.int32)
    shape = np.empty(new_start[-1], dtype=np.uint8)
    for vertex in range(len(sequence)):  # not in sequence: neighbours' rings share corners
        new = begin[vertex]
        for entry in range(start[vertex], start[vertex + 1]):
            c, own = corner[entry], place[entry]
            for j in range(1, width):
                others[new, j - 1] = vertices[c, origin_first[own, j]]
            shape[new] = shapes[c, own]
            new += 1
    return new_start, others, shape


@compiled
def cancel_facets(
    vertices: np.ndarray,
    facets: np.ndarray,
    of_vertex: np.ndarray,
    of_region: np.ndarray,
    used: np.ndarray,
    left_over: np.ndarray,
) -> None:
    """As ``interior._cancel_facets``, of the cells (n, k) with these ``local_facets``."""
    width = vertices.shape[1]
    number, around = np.empty(width, dtype=np.uint64), np.empty(width, dtype=np.uint64)
    for c in range(len(vertices)):
        for k in range(width):
            number[k], around[k] = of_vertex[vertices[c, k]], 0
        for f in range(len(facets)):
            total = of_region[c]
            for j in range(facets.shape[1]):
                if facets[f, j] >= 0:
                    total += number[facets[f, j]]
            total = _mixed(total)
            for j in range(facets.shape[1]):
                if facets[f, j] >= 0:
                    around[facets[f, j]] ^= total
        for k in range(width):
            used[vertices[c, k]] = True
            left_over[vertices[c, k]] ^= around[k]


@compiled
def cancel_facets_of_simplices(
    vertices: np.ndarray,
    of_vertex: np.ndarray,
    of_region: np.ndarray,
    used: np.ndarray,
    left_over: np.ndarray,
) -> None:
    """The same for triangles or tetrahedra, each facet of which lacks one vertex."""
    width = vertices.shape[1]
    number = np.empty(width, dtype=np.uint64)
    for c in range(len(vertices)):
        total, around = of_region[c], np.uint64(0)
        for k in range(width):
            total += of_vertex[vertices[c, k]]
        for k in range(width):
            number[k] = _mixed(total - of_vertex[vertices[c, k]])
            around ^= number[k]
        for k in range(width):
            used[vertices[c, k]] = True
            left_over[vertices[c, k]] ^= around ^ number[k]


@compiled
def facet_order(vertices: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """As ``facets._facet_order``: an order that puts facets with the same vertices together, and where each
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
