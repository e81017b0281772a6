"""``meshio.Mesh``."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.mesh.convert import from_meshio as read

if TYPE_CHECKING:
    import meshio

__all__ = ["moved", "read"]


def moved(mesh: meshio.Mesh, points: np.ndarray) -> meshio.Mesh:
    """A mesh with other coordinates, which shares cells and data with ``mesh``."""
    result = copy.copy(mesh)
    result.points = points
    return result
