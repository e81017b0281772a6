"""The mean ratio of corners and elements (paper section 3.1).

Everything is written over coordinate *components* (lists of d arrays of any one shape), with each sum in a
fixed order, so that every engine gets the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.corners import Corners, Simplices
from dvr_cli.mesh.simplex import Components, chunks, dot, edges_and_determinant, through
from dvr_cli.mesh.sums import mean

DEGENERATE = 1e-10  # |Q| up to which an element counts as degenerate rather than positive or inverted
EXPONENT = 1  # of two, which no quality reaches


def weighted_norm(
    edges: Sequence[Components], norm: Sequence[np.ndarray], factor: Sequence[np.ndarray] | None = None
) -> np.ndarray:
    """s = Σ_jk M_jk e_j·e_k, with the coefficients of ``ShapeTable.norm``; factor: L of that table's rows."""
    d = len(edges)
    if factor is not None:
        edges = [through(factor, edge) for edge in edges]
    total = norm[0] * dot(edges[0], edges[0])
    for j in range(1, d):
        total = total + norm[j] * dot(edges[j], edges[j])
    pair = d
    for j in range(d):
        for k in range(j + 1, d):
            total = total + norm[pair] * dot(edges[j], edges[k])
            pair += 1
    return total


def mean_ratio(v: np.ndarray, s: np.ndarray, dimension: int) -> np.ndarray:
    """Q = sgn(v) |v|^(2/d) / s, in [-1, 1]; 0 where the corner is degenerate, also where it is a point."""
    power = v if dimension == 2 else np.sign(v) * np.square(np.cbrt(v))
    return np.divide(power, s, out=np.zeros_like(power), where=s > 0)


def corner_qualities(
    points: np.ndarray, corners: Simplices, backend: Backend = NUMPY, inverted: np.ndarray | None = None
) -> np.ndarray:
    """Mean ratio of every corner: (C,) float64.

    points: (N, d) coordinates. backend: what computes; the result is the same. inverted: (C,) bool, for
    triangles in space ((N, 3)), which have no sign of their own: those that are turned over.
    """
    # allocated here: NumPy is slow with the type of arrays that come from numba
    v, s = np.empty(len(corners.vertices)), np.empty(len(corners.vertices))
    table = corners.table
    backend.twin(corner_terms)(points, corners.vertices, corners.shapes, table.norm, v, s)
    if len(table.factor):
        backend.twin(metric_norms)(points, corners.vertices, corners.shapes, table.norm, table.factor, s)
    quality = mean_ratio(v, s, corners.dimension)
    if inverted is not None:
        quality[inverted] *= -1.0
    if corners.held is not None:
        quality[corners.held] = 1.0
    return quality


def mean_quality(qualities: np.ndarray) -> float:
    """The mean of (n,) qualities, n > 0, in whatever order they are."""
    return mean(qualities, EXPONENT)


def corner_terms(
    points: np.ndarray,
    corners: np.ndarray,
    shapes: np.ndarray,
    norm: np.ndarray,
    v: np.ndarray,
    s: np.ndarray,
) -> None:
    """Fill ``v`` and ``s`` ((C,) each) with the terms of Q of ``corners`` (C, d+1)."""
    for chunk in chunks(len(corners)):
        edges, v[chunk] = edges_and_determinant(points, corners[chunk])
        s[chunk] = weighted_norm(edges, norm[shapes[chunk, 0]].T)


def metric_norms(
    points: np.ndarray,
    vertices: np.ndarray,
    shapes: np.ndarray,
    norm: np.ndarray,
    factor: np.ndarray,
    s: np.ndarray,
) -> None:
    """Fill ``s`` (C,) with those of the corners ``vertices`` (C, d+1), edges seen through ``factor``."""
    for chunk in chunks(len(vertices)):
        edges, _ = edges_and_determinant(points, vertices[chunk])
        rows = shapes[chunk, 0]
        s[chunk] = weighted_norm(edges, norm[rows].T, factor[rows].T)


def turned_over(points: np.ndarray, corners: Simplices, normals: np.ndarray) -> np.ndarray:
    """(C,) bool: corners of a surface whose normals point away from ``normals`` (C, 3); points: (N, 3)."""
    a, b, c = (points[vertex] for vertex in corners.vertices.T)
    return (np.cross(b - a, c - a) * normals).sum(axis=1) < 0.0


def cell_normals(points: np.ndarray, corners: Corners) -> np.ndarray:
    """(C, 3) for each corner of a surface the vector area, in any scale, of the cell it is of."""
    a, b, c = (points[vertex] for vertex in corners.vertices.T)
    total = corners.by_cell(np.add, np.cross(b - a, c - a))
    return np.repeat(total, np.diff(corners.start), axis=0)


def element_qualities(points: np.ndarray, corners: Corners) -> np.ndarray:
    """Quality of every cell, the minimum over its corners: (n_cells,) float64 in [-1, 1].

    points: (N, d) coordinates.
    """
    return corners.by_cell(np.minimum, corner_qualities(points, corners))
