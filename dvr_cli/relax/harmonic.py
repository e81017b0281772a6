"""Harmonic displacements: a displacement of some vertices spread to all others.

Each vertex that is not given moves by the mean of its neighbours' displacements, weighted by 1 / length² of
the edge between them: short edges, as those across a boundary layer, pass a displacement on nearly whole. The
graph Laplacian that says so is solved by conjugate gradients.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells

PRECISION = 1e-8  # of the residual, relative to that at the beginning
MAX_STEPS = 2000


def edges_of(blocks: list[Cells], n_points: int) -> np.ndarray:
    """(E, 2) the edges of linear cells, each once, ascending."""
    pairs = [block.vertices[:, list(edge)] for block in blocks for edge in CELL_TYPES[block.type].edges]
    tail, head = np.sort(np.concatenate(pairs), axis=1).astype(np.int64).T
    return np.stack(np.divmod(np.unique(tail * n_points + head), n_points), axis=1)


def spread(points: np.ndarray, edges: np.ndarray, shift: np.ndarray, given: np.ndarray) -> np.ndarray:
    """(N, D) ``shift`` at the vertices marked in ``given`` ((N,) bool), harmonic at the others with an edge.

    points: (N, D); edges: (E, 2); shift: (N, D), of which other rows are not looked at.
    """
    tail, head = edges.T
    length = ((points[tail] - points[head]) ** 2).sum(axis=1)
    weight = 1.0 / np.maximum(length, 1e-30 * length.max(initial=1.0))
    n = len(points)
    diagonal = np.bincount(tail, weight, n) + np.bincount(head, weight, n)
    free = ~given & (diagonal > 0)
    result = np.where(given[:, None], shift, 0.0)

    def neighbours(x: np.ndarray) -> np.ndarray:
        """The weighted sum of the neighbours' values."""
        return np.bincount(tail, weight * x[head], n) + np.bincount(head, weight * x[tail], n)

    for i in range(points.shape[1]):
        if shift[given, i].any():
            result[:, i] += _solved(neighbours, diagonal, free, neighbours(result[:, i]))
    return result


def _solved(
    neighbours: Callable[[np.ndarray], np.ndarray], diagonal: np.ndarray, free: np.ndarray, pull: np.ndarray
) -> np.ndarray:
    """x with diagonal · x - neighbours(x) = pull at the free vertices, zero elsewhere."""
    x = np.zeros(len(diagonal))
    residual = np.where(free, pull, 0.0)
    scale = np.where(free, 1.0 / np.where(free, diagonal, 1.0), 0.0)
    z = scale * residual
    direction = z
    product = first = float((residual * z).sum())
    for _ in range(MAX_STEPS):
        if not product > PRECISION**2 * first:
            break
        image = np.where(free, diagonal * direction - neighbours(direction), 0.0)
        step = product / float((direction * image).sum())
        x = x + step * direction
        residual = residual - step * image
        z = scale * residual
        before, product = product, float((residual * z).sum())
        direction = z + (product / before) * direction
    return x
