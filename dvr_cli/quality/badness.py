"""Badness: what stands for the quality of a corner where roots and powers would cost too much."""

from __future__ import annotations

import numpy as np

from dvr_cli.mesh.corners import Simplices
from dvr_cli.mesh.simplex import chunks, edges_and_determinant
from dvr_cli.quality.mean_ratio import weighted_norm


def badness(v: np.ndarray, s: np.ndarray, dimension: int) -> np.ndarray:
    """B of corners with determinant v and norm s: 1/Q^(d(d-1)/2), infinite where v is not positive."""
    ratio = s / v if dimension == 2 else s * s * s / (v * v)
    return np.where(v > 0, ratio, np.inf)


def badness_of(quality: float, dimension: int) -> float:
    """B of a corner with this quality, infinite where that is not positive."""
    return quality ** (-dimension * (dimension - 1) / 2) if quality > 0 else np.inf


def quality_growth(before: np.ndarray, after: np.ndarray, dimension: int) -> np.ndarray:
    """The relative growth of quality when badness falls from ``before`` to ``after``."""
    return (before / after) ** (2.0 / (dimension * (dimension - 1))) - 1.0


def worst_corner(points: np.ndarray, corners: Simplices) -> tuple[int, float]:
    """The first of the corners with the largest badness, and that badness; 0 and -1 if there are none.

    points: (N, d).
    """
    d = corners.dimension
    table = corners.table
    worst, largest = 0, -1.0
    for chunk in chunks(len(corners.vertices)):
        edges, v = edges_and_determinant(points, corners.vertices[chunk])
        rows = corners.shapes[chunk, 0]
        s = weighted_norm(edges, table.norm[rows].T, table.factors(rows))
        with np.errstate(all="ignore"):  # a degenerate corner is not positive, whatever s/v says
            here = badness(v, s, d)
        if here.max() > largest:
            worst, largest = chunk.start + int(here.argmax()), float(here.max())
    return worst, largest
