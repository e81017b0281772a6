"""``trimesh.Trimesh``: a surface in space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.mesh.mesh import Cells, Mesh

if TYPE_CHECKING:
    import trimesh


def read(mesh: trimesh.Trimesh) -> Mesh:
    """The triangles of a surface; InputError for a primitive, whose vertices follow from its parameters."""
    if hasattr(mesh, "primitive"):
        name = type(mesh).__name__
        raise InputError(f"a trimesh {name} has no vertices of its own; {name}.to_mesh() makes a mesh of it")
    return Mesh(
        np.array(mesh.vertices, dtype=np.float64),
        [Cells("triangle", np.array(mesh.faces, dtype=np.int64))],
        cell_data={name: [np.asarray(values)] for name, values in mesh.face_attributes.items()},
        point_data={name: np.asarray(values) for name, values in mesh.vertex_attributes.items()},
    )


def moved(mesh: trimesh.Trimesh, points: np.ndarray) -> trimesh.Trimesh:
    """A copy with other coordinates; colours, texture and attributes stay."""
    result = mesh.copy()
    result.vertices = points
    return result
