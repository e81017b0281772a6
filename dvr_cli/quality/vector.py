"""The quality vector of a mesh and the ordering of such vectors (paper sections 2.2 and 3.4)."""

from __future__ import annotations

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.corners import Simplices


def ring_minima(
    corner_quality: np.ndarray, corners: Simplices, n_points: int, backend: Backend = NUMPY
) -> np.ndarray:
    """(N,) minimum quality in the ring of each vertex; infinite for a vertex without corners.

    corner_quality: (C,) quality of each corner. backend: what computes; the result is the same.
    """
    minima = np.full(n_points, np.inf)
    backend.twin(lower)(minima, corner_quality, corners.vertices)
    return minima


def lower(minima: np.ndarray, values: np.ndarray, vertices: np.ndarray) -> None:
    """Lower each of ``minima`` (N,) to the least of the ``values`` (C,) of corners ``vertices`` it is in."""
    for vertex in vertices.T:
        np.minimum.at(minima, vertex, values)


def first_difference(a: np.ndarray, b: np.ndarray) -> int | None:
    """0-based position of the first component in which two quality vectors differ, None if they are equal.

    a, b: (m,) sorted ascending. The paper's ordering (eq. 2) is decided by this component.
    """
    different = np.flatnonzero(a != b)
    return int(different[0]) if len(different) else None


def at_least(a: np.ndarray, b: np.ndarray) -> bool:
    """True if a ≥ b in the paper's ordering of quality vectors (eq. 2); both (m,) sorted ascending."""
    where = first_difference(a, b)
    return where is None or bool(a[where] > b[where])
