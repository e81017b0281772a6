"""Altitudes of simplices, which explicit time steps and the largest eigenvalues of matrices follow.

The altitude of a vertex is its distance from the facet opposite: with v the determinant of the edges, v over
the length of that side in the plane, and v over twice the area of that face in space. It has the sign of v.
The gradient of a vertex's linear shape function is 1/h long, so the sum of the squared gradients of a simplex
is Σ 1/h². Its element matrix of conduction with unit conductivity is K = |T| (∇N_i · ∇N_j), and with its
measure lumped at the d+1 vertices M = |T|/(d+1) I. So no eigenvalue of M⁻¹ K of a whole mesh is larger than
the largest (d+1) Σ 1/h², the *conduction bound*: an explicit step in time is stable up to 2 over it.

Elements that are no simplices have the altitudes of their corners.
"""

from __future__ import annotations

from functools import reduce

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.simplex import Components, chunks, cross, dot, edges_and_determinant, subtract


def altitude_and_conduction(
    points: np.ndarray, vertices: np.ndarray, backend: Backend = NUMPY
) -> tuple[float, float]:
    """The smallest altitude of all simplices, and the largest (d+1) Σ 1/h² of any.

    points: (N, d), or (N, 3) for triangles in space; vertices: (n, d+1). The altitudes of a simplex without
    size are zero, and then the second is infinite.
    backend: what computes; the result is the same.
    """
    least, sharpest = backend.twin(extremes)(np.ascontiguousarray(points), vertices)
    return float(least), vertices.shape[1] * float(sharpest)


def extremes(points: np.ndarray, corners: np.ndarray) -> tuple[float, float]:
    """The smallest altitude of all simplices, and the largest Σ 1/h² of any; see ``altitude_and_conduction``.

    Of none they are infinity and 0.
    """
    least, sharpest = np.inf, 0.0
    for chunk in chunks(len(corners)):
        edges, v = edges_and_determinant(points, corners[chunk])
        facets = squared_facets(edges)
        largest, total = facets[0], facets[0]
        for facet in facets[1:]:
            largest, total = np.maximum(largest, facet), total + facet
        with np.errstate(all="ignore"):
            low = np.where(v == 0.0, 0.0, v / np.sqrt(largest))
            sharp = np.where(v == 0.0, np.inf, total / (v * v))
        least, sharpest = min(least, low.min()), max(sharpest, sharp.max())
    return least, sharpest


def smallest_altitudes(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(n,) the smallest altitude of each simplex; arguments as for ``altitude_and_conduction``."""
    edges, v = edges_and_determinant(points, vertices)
    with np.errstate(all="ignore"):
        return np.where(v == 0.0, 0.0, v / np.sqrt(reduce(np.maximum, squared_facets(edges))))


def squared_facets(edges: list[list[np.ndarray]] | list[Components]) -> list[np.ndarray]:
    """The squared sides of triangles, or four times the squared areas of the faces of tetrahedra.

    edges: the d edges of each simplex from its first vertex, by components. The facets through that vertex
    come first.
    """
    between = subtract(edges[1], edges[0])
    if len(edges) == 2:
        return [dot(side, side) for side in (*edges, between)]
    normals = [cross(edges[1], edges[2]), cross(edges[2], edges[0]), cross(edges[0], edges[1])]
    normals.append(cross(between, subtract(edges[2], edges[0])))
    return [dot(normal, normal) for normal in normals]
