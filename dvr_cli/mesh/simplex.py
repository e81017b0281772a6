"""Edges, normals and measures of simplices, written over coordinate components.

A vector is a list of d arrays of any one shape, and each sum is taken in a fixed order, so that every engine
gets the same bits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

Components = Sequence[np.ndarray]

_CHUNK = 1 << 16  # simplices evaluated at a time: bounds the memory on large meshes


def dot(a: Components, b: Components) -> np.ndarray:
    """Scalar product of two vectors given by components, summed in component order."""
    total = a[0] * b[0]
    for i in range(1, len(a)):
        total = total + a[i] * b[i]
    return total


def subtract(a: Components, b: Components) -> list[np.ndarray]:
    """a - b, component by component."""
    return [ai - bi for ai, bi in zip(a, b, strict=True)]


def cross(a: Components, b: Components) -> list[np.ndarray]:
    """Vector product of two vectors in space, component by component."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def through(factor: Sequence[np.ndarray] | np.ndarray, vector: Components) -> list[np.ndarray]:
    """L u of a vector u, L being the upper triangular matrix whose entries, row after row, ``factor`` has."""
    if len(vector) == 2:
        a, b = vector
        return [factor[0] * a + factor[1] * b, factor[2] * b]
    a, b, c = vector
    return [
        factor[0] * a + factor[1] * b + factor[2] * c,
        factor[3] * b + factor[4] * c,
        factor[5] * c,
    ]


def back_through(factor: Sequence[np.ndarray] | np.ndarray, vector: Components) -> list[np.ndarray]:
    """Lᵀ u; see ``through``."""
    if len(vector) == 2:
        a, b = vector
        return [factor[0] * a, factor[1] * a + factor[2] * b]
    a, b, c = vector
    return [
        factor[0] * a,
        factor[1] * a + factor[3] * b,
        factor[2] * a + factor[4] * b + factor[5] * c,
    ]


def solve(factor: Sequence[np.ndarray] | np.ndarray, vector: Components) -> list[np.ndarray]:
    """L⁻¹ u; see ``through``."""
    if len(vector) == 2:
        b = vector[1] / factor[2]
        return [(vector[0] - factor[1] * b) / factor[0], b]
    c = vector[2] / factor[5]
    b = (vector[1] - factor[4] * c) / factor[3]
    return [(vector[0] - factor[1] * b - factor[2] * c) / factor[0], b, c]


def solve_back(factor: Sequence[np.ndarray] | np.ndarray, vector: Components) -> list[np.ndarray]:
    """L⁻ᵀ u; see ``through``."""
    a = vector[0] / factor[0]
    if len(vector) == 2:
        return [a, (vector[1] - factor[1] * a) / factor[2]]
    b = (vector[1] - factor[1] * a) / factor[3]
    return [a, b, (vector[2] - factor[2] * a - factor[4] * b) / factor[5]]


def opposite_normal(ends: Sequence[Components]) -> list[np.ndarray]:
    """The normal n of the facet spanned by the d ends of a corner's edges, with det E = e_0 · n.

    It does not depend on the corner's own vertex: moving that vertex along u changes det E by -λ u·n.
    """
    a = subtract(ends[1], ends[0])
    if len(ends) == 2:
        return [a[1], -a[0]]
    return cross(a, subtract(ends[2], ends[0]))


def determinants(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Determinant of the edges of each simplex (d! times its measure): (n,) float64.

    points: (N, d) coordinates; vertices: (n, d+1).
    """
    result = np.empty(len(vertices))
    for chunk in chunks(len(result)):
        result[chunk] = edges_and_determinant(points, vertices[chunk])[1]
    return result


def chunks(n: int) -> Iterator[slice]:
    """Slices that cut range(n) into pieces of bounded size."""
    return (slice(lo, lo + _CHUNK) for lo in range(0, n, _CHUNK))


def places_of(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(d+1, D, n) the coordinates of each vertex of each simplex; points: (N, D), vertices: (n, d+1)."""
    return np.ascontiguousarray(points[vertices.T].transpose(0, 2, 1))


def edges_and_determinant(
    points: np.ndarray, vertices: np.ndarray
) -> tuple[list[list[np.ndarray]], np.ndarray]:
    """The d edges of each simplex from its first vertex, by components, and their determinant (n,).

    points: (N, d), or (N, 3) for triangles in space, whose determinant is twice their area and has no sign.
    vertices: (n, d+1).
    """
    own, *ends = places_of(points, vertices)
    edges = [list(end - own) for end in ends]
    if len(edges) < points.shape[1]:
        area = cross(*edges)
        return edges, np.sqrt(dot(area, area))
    return edges, dot(edges[0], opposite_normal([list(end) for end in ends]))
