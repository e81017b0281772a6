"""Target shapes: the ideal one of its type, or a corner's own shape in the input (docs/design.md).

With A = E W⁻¹ of a corner (E its edges, W those of its ideal target) and AᵀA = Z Σ² Zᵀ, the target

    W_t with W_tᵀ W_t = Wᵀ Z Σ^(2t) Zᵀ W

is the ideal shape for t = 0 and the corner's own for t = 1, whichever way round; between them it is a blend.
Quality depends on a target by this matrix of products of its edges only, and not on its size.
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
    """The place of each cell's target between the ideal shape and its own in the input.

    share: (n_cells,) t, from 0 for the ideal target to 1 for the own shape.
    max_aspect: the largest aspect that is kept, 1 where none is. See ``stretching.coherent``.
    """

    share: np.ndarray
    max_aspect: float

    @property
    def kept(self) -> np.ndarray:
        """(n_cells,) bool: the cells whose own shape is their target."""
        return self.share >= 1.0

    def held_vertices(self, corners: Corners, n_points: int) -> np.ndarray:
        """(N,) bool: the vertices with kept cells only."""
        cell = np.repeat(self.kept, np.diff(corners.start))
        used, free = np.zeros((2, n_points), dtype=bool)
        used[corners.vertices] = True
        free[corners.vertices[~cell]] = True
        return used & ~free


def with_targets(points: np.ndarray, corners: Corners, targets: Targets, still: np.ndarray) -> Corners:
    """The corners measured against these targets, formed from their shape at ``points`` (N, d or 3).

    still: (N,) bool, vertices that will never move. Corners of kept cells with no other vertices get no rows
    in the table: they keep their shape and so have quality 1.
    """
    share = np.repeat(targets.share, np.diff(corners.start))
    held = (share >= 1.0) & still[corners.vertices].all(axis=1)
    own = np.flatnonzero((share > 0.0) & ~held)
    matrices = [
        _target_matrices(points, corners, own[chunk], share[own[chunk]]) for chunk in chunks(len(own))
    ]
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


def _target_matrices(
    points: np.ndarray, corners: Corners, which: np.ndarray, share: np.ndarray
) -> np.ndarray:
    """(n (d+1), d, d) the matrices M of the targets of the corners ``which``, for each choice of origin."""
    d = corners.dimension
    gram = gram_of_edges(points, corners.vertices[which])
    blended = np.flatnonzero(share < 1.0)
    if len(blended):
        ideal = np.linalg.inv(corners.table.matrices[corners.shapes[which[blended], 0]])  # WᵀW, in any scale
        gram[blended] = _power(ideal, gram[blended], share[blended])
    result = np.empty((len(which), d + 1, d, d))
    for p, order in enumerate(ORIGIN_FIRST[d]):
        change = _change_of_origin(order)
        inverse = np.linalg.inv(np.einsum("ja,njk,kb->nab", change, gram, change))
        size = np.linalg.det(inverse) ** (-1.0 / d) / d  # of the target's simplex: quality is blind to it
        result[:, p] = inverse * size[:, None, None]
    return result.reshape(-1, d, d)


def _power(ideal: np.ndarray, gram: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Wᵀ (W⁻ᵀ G W⁻¹)^t W for ideal = WᵀW and G = gram, each (n, d, d)."""
    lower = np.linalg.cholesky(ideal)
    inverse = np.linalg.inv(lower)
    value, vector = np.linalg.eigh(inverse @ gram @ inverse.transpose(0, 2, 1))
    raised = (vector * (value ** share[:, None])[:, None, :]) @ vector.transpose(0, 2, 1)
    return lower @ raised @ lower.transpose(0, 2, 1)


def _change_of_origin(order: np.ndarray) -> np.ndarray:
    """(d, d) the matrix P with E' = E P, for edges E from vertex 0 and E' from vertex order[0]."""
    d = len(order) - 1
    place = np.vstack([np.zeros(d), np.eye(d)])  # of each vertex in terms of the edges from vertex 0
    return (place[order[1:]] - place[order[0]]).T
