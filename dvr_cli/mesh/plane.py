"""Planar meshes: found out, taken to two coordinates, and brought back to exactly their plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FLAT = 1e-8  # distance from the plane, relative to the mesh's extent, up to which points lie in it


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane with two coordinates: coordinate axes of the file where possible, else an orthonormal pair.

    axes: (2, D) unit vectors; points have D = 2 or 3 coordinates.
    selected: the two coordinates that are the axes, or None for a plane in general position.
    """

    axes: np.ndarray
    selected: tuple[int, int] | None

    def flatten(self, vectors: np.ndarray) -> np.ndarray:
        """(N, 2) coordinates in the plane of points or directions (N, D)."""
        if self.selected is not None:
            return np.ascontiguousarray(vectors[:, self.selected])
        return vectors @ self.axes.T

    def lift(self, points: np.ndarray, flat: np.ndarray) -> np.ndarray:
        """``points`` (N, D) moved to the plane coordinates ``flat`` (N, 2); unmoved ones keep their bits."""
        lifted = points.copy()
        if self.selected is not None:
            lifted[:, self.selected] = flat
        else:
            shift = flat - self.flatten(points)
            moved = np.flatnonzero(shift.any(axis=1))
            lifted[moved] += shift[moved] @ self.axes
        return lifted

    def holds(self, points: np.ndarray) -> bool:
        """True if ``points`` (N, D) lie in this plane or, all of them, in one parallel to it."""
        if self.axes.shape[1] == 2 or not len(points):
            return True
        height = points @ np.cross(self.axes[0], self.axes[1])
        extent = float(np.ptp(points, axis=0).max())
        return bool(np.ptp(height) <= 2 * FLAT * extent)  # FLAT to either side


def other_axes(low: np.ndarray, high: np.ndarray) -> tuple[int, int] | None:
    """The coordinates other than the constant one of points in a box, right-handed; None if none is constant.

    low, high: (3,) the corners of the box.
    """
    for constant, pair in ((2, (0, 1)), (0, (1, 2)), (1, (2, 0))):
        if high[constant] == low[constant]:
            return pair
    return None


def plane_of(points: np.ndarray) -> Plane | None:
    """The plane that contains all ``points`` ((N, 2) or (N, 3)) to within FLAT, or None."""
    dimension = points.shape[1]
    if dimension == 2:
        return Plane(np.eye(2), (0, 1))
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float(np.max(high - low))
    if (selected := other_axes(low, high)) is not None:
        return Plane(np.eye(3)[list(selected)], selected)
    centred = (points - points.mean(axis=0)) / max(extent, np.finfo(float).tiny)
    _, _, axes = np.linalg.svd(centred.T @ centred)
    if np.max(np.abs(centred @ axes[2])) > FLAT:
        return None
    for axis in range(3):  # nearly constant: keep that coordinate exactly as it is
        if high[axis] - low[axis] <= FLAT * extent:
            pair = ((1, 2), (2, 0), (0, 1))[axis]
            return Plane(np.eye(3)[list(pair)], pair)
    return Plane(axes[:2], None)
