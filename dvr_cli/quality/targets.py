"""Target shapes: the ideal one of its type, or a corner's own shape in the input (docs/design.md).

Quality depends on a target by the matrix of products of its edges only, and not on its size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dvr_cli.mesh.corners import ORIGIN_FIRST, Corners, shape_table
from dvr_cli.mesh.simplex import chunks

# By dimension, the quality above which a cell is no flatter than some 10⁶ : 1: its shape is well defined.
FORMED = {2: 1e-6, 3: 1e-4}


@dataclass(frozen=True, eq=False)
class Targets:
    """The cells whose target is their own shape in the input; that of others is the ideal one.

    kept: (n_cells,) bool, these cells. held: (N,) bool, the vertices that stay for their sake.
    max_aspect: the largest aspect that is kept, 1 where none is. See ``stretching.coherent``.
    """

    kept: np.ndarray
    held: np.ndarray
    max_aspect: float


def with_targets(points: np.ndarray, corners: Corners, targets: Targets) -> Corners:
    """The corners measured against these targets, formed from their shape at ``points`` (N, d or 3).

    Corners of kept cells whose vertices are all held get no rows in the table: they keep their shape and so
    have quality 1.
    """
    kept = np.repeat(targets.kept, np.diff(corners.start))
    held = kept & targets.held[corners.vertices].all(axis=1)
    own = np.flatnonzero(kept & ~held)
    matrices = [_target_matrices(points, corners, own[chunk]) for chunk in chunks(len(own))]
    d = corners.dimension
    known = len(corners.table.matrices)
    shapes = corners.shapes.copy()
    shapes[own] = known + np.arange(len(own) * (d + 1), dtype=np.int32).reshape(-1, d + 1)
    table = shape_table(np.concatenate([corners.table.matrices, *matrices]))
    return replace(corners, shapes=shapes, table=table, held=held if held.any() else None)


def gram_of_edges(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(n, d, d) the products EᵀE of the edges of corners ``vertices`` (n, d+1), in any scale."""
    edges = points[vertices[:, 1:]] - points[vertices[:, :1]]
    largest = np.abs(edges).max(axis=(1, 2), keepdims=True)  # so that nothing over- or underflows
    edges = edges / np.where(largest > 0, largest, 1.0)
    return np.einsum("nji,nki->njk", edges, edges)


def _target_matrices(points: np.ndarray, corners: Corners, which: np.ndarray) -> np.ndarray:
    """(n (d+1), d, d) the matrices M of the targets of the corners ``which``, for each choice of origin."""
    d = corners.dimension
    gram = gram_of_edges(points, corners.vertices[which])
    result = np.empty((len(which), d + 1, d, d))
    for p, order in enumerate(ORIGIN_FIRST[d]):
        change = _change_of_origin(order)
        inverse = np.linalg.inv(np.einsum("ja,njk,kb->nab", change, gram, change))
        size = np.linalg.det(inverse) ** (-1.0 / d) / d  # of the target's simplex: quality is blind to it
        result[:, p] = inverse * size[:, None, None]
    return result.reshape(-1, d, d)


def _change_of_origin(order: np.ndarray) -> np.ndarray:
    """(d, d) the matrix P with E' = E P, for edges E from vertex 0 and E' from vertex order[0]."""
    d = len(order) - 1
    place = np.vstack([np.zeros(d), np.eye(d)])  # of each vertex in terms of the edges from vertex 0
    return (place[order[1:]] - place[order[0]]).T
