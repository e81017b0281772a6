"""Angles of elements: interior angles of planar cells, dihedral angles of volume cells."""

from __future__ import annotations

import numpy as np

from dvr_cli.mesh.facets import FACETS
from dvr_cli.mesh.mesh import Cells


def extreme_angles(points: np.ndarray, blocks: list[Cells]) -> tuple[float, float]:
    """Smallest and largest angle in degrees over all cells of the blocks, in [0, 360) and [0, 180] resp.

    points: (N, d). In 2D the interior angles of triangles and quadrilaterals, in 3D the dihedral angles
    between the faces of each cell; a face with four vertices counts with its mean normal. An angle next to
    an edge or a face without extent is left out; (nan, nan) when nothing is left.
    """
    parts = [
        _interior_angles(points, b) if points.shape[1] == 2 else _dihedral_angles(points, b) for b in blocks
    ]
    angles = np.concatenate([np.empty(0), *parts])
    angles = angles[np.isfinite(angles)]
    return (float(angles.min()), float(angles.max())) if len(angles) else (np.nan, np.nan)


def _interior_angles(points: np.ndarray, block: Cells) -> np.ndarray:
    """(n·k,) angle at each vertex, turning from the next to the previous edge, in [0, 360) degrees."""
    here = points[block.vertices]
    onward = np.roll(here, -1, axis=1) - here
    back = np.roll(here, 1, axis=1) - here
    cross = onward[..., 0] * back[..., 1] - onward[..., 1] * back[..., 0]
    inner = (onward * back).sum(axis=-1)
    angle = np.degrees(np.arctan2(cross, inner)) % 360.0
    return np.where(onward.any(axis=-1) & back.any(axis=-1), angle, np.nan).ravel()


def _dihedral_angles(points: np.ndarray, block: Cells) -> np.ndarray:
    """(n·edges,) angle between the two faces at each edge of each cell, in [0, 180] degrees."""
    faces = FACETS[block.type]
    normals = []
    for face in faces:
        corners = points[block.vertices[:, face]]
        # half the cross product of the diagonals is a quadrilateral's vector area; for a triangle the same
        # holds with two of its edges
        ends = corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1]
        normals.append(np.cross(*ends))
    angles = []
    for i, face in enumerate(faces):
        for j in range(i + 1, len(faces)):
            if len(set(face) & set(faces[j])) == 2:
                angles.append(180.0 - _angle(normals[i], normals[j]))
    return np.concatenate(angles)


def _angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) angle between vectors in degrees, nan where one is zero."""
    sine = np.linalg.norm(np.cross(a, b), axis=1)
    cosine = (a * b).sum(axis=1)
    return np.where((sine == 0) & (cosine == 0), np.nan, np.degrees(np.arctan2(sine, cosine)))
