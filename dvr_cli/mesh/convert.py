"""Between ``meshio.Mesh`` and ``Mesh``: the same fields, so that nothing is lost either way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.mesh.mesh import Cells, Mesh

if TYPE_CHECKING:
    import meshio


def from_meshio(mesh: meshio.Mesh) -> Mesh:
    """A Mesh that shares the arrays of ``mesh`` where their types allow it; all native byte order."""
    pairs = mesh.gmsh_periodic or []
    links = [np.asarray(link[3], dtype=np.int64).reshape(-1, 2) for link in pairs]
    return Mesh(
        points=np.asarray(mesh.points, dtype=np.float64),
        cells=[Cells(block.type, _native(np.asarray(block.data))) for block in mesh.cells],
        cell_data={name: [_native(np.asarray(a)) for a in blocks] for name, blocks in mesh.cell_data.items()},
        point_data={name: _native(np.asarray(array)) for name, array in mesh.point_data.items()},
        field_data=dict(mesh.field_data),
        periodic=np.concatenate([np.empty((0, 2), dtype=np.int64), *links]),
    )


def to_meshio(mesh: Mesh, points: np.ndarray) -> meshio.Mesh:
    """A ``meshio.Mesh`` with the cells and data of ``mesh`` and the coordinates ``points``."""
    import meshio

    return meshio.Mesh(
        points,
        [(block.type, block.vertices) for block in mesh.cells],
        point_data=mesh.point_data,
        cell_data=mesh.cell_data,
        field_data=mesh.field_data,
    )


def _native(array: np.ndarray) -> np.ndarray:
    return array.astype(array.dtype.newbyteorder("="), copy=False)
