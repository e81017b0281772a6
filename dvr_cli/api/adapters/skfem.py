"""Meshes of scikit-fem: linear and second-order triangles, quadrilaterals, tetrahedra, hexahedra, wedges."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.mesh.mesh import Cells, Mesh

if TYPE_CHECKING:
    import skfem

_TYPES = {
    "MeshTri1": "triangle",
    "MeshTri2": "triangle6",
    "MeshQuad1": "quad",
    "MeshQuad2": "quad9",
    "MeshTet1": "tetra",
    "MeshTet2": "tetra10",
    "MeshHex1": "hexahedron",
    "MeshHex2": "hexahedron27",
    "MeshWedge1": "wedge",
}
# the place among scikit-fem's nodes of each of meshio's
_NODE_ORDER = {
    "hexahedron": [0, 3, 6, 2, 1, 5, 7, 4],
    "hexahedron27": [
        *(0, 3, 6, 2, 1, 5, 7, 4),
        *(10, 16, 14, 9, 12, 18, 17, 11, 8, 15, 19, 13),
        *(20, 25, 22, 23, 21, 24, 26),
    ],
}


def read(mesh: skfem.Mesh) -> Mesh:
    """The cells of a mesh; its subdomains are sets of cells and its boundaries named facets.

    Raises InputError for meshes of another kind, by name.
    """
    kind = _TYPES.get(type(mesh).__name__)
    if kind is None:
        raise InputError(f"a skfem.{type(mesh).__name__} cannot be relaxed; {', '.join(_TYPES)} can")
    nodes = mesh.dofs.element_dofs.T.astype(np.int64)
    nodes = nodes[:, _NODE_ORDER[kind]] if kind in _NODE_ORDER else nodes
    facets = np.asarray(mesh.facets).T
    return Mesh(
        np.array(mesh.doflocs.T, dtype=np.float64),
        [Cells(kind, nodes)],
        cell_sets={name: [np.asarray(part)] for name, part in (mesh.subdomains or {}).items()},
        facet_sets={
            name: facets[np.asarray(part, dtype=np.int64)] for name, part in (mesh.boundaries or {}).items()
        },
    )


def moved(mesh: skfem.Mesh, points: np.ndarray) -> skfem.Mesh:
    """A mesh with other coordinates; cells, subdomains and boundaries stay."""
    return replace(mesh, doflocs=np.ascontiguousarray(points.T))
