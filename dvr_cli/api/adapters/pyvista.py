"""``pyvista.UnstructuredGrid`` and ``pyvista.PolyData``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.vtk.cells import (
    POLY_LINE,
    POLY_VERTEX,
    POLYGON,
    CellList,
    blocks_of,
    joined,
    list_with_counts,
    list_with_offsets,
)
from dvr_cli.mesh.mesh import Mesh

if TYPE_CHECKING:
    import pyvista


def read(mesh: pyvista.UnstructuredGrid | pyvista.PolyData) -> Mesh:
    """The cells and numeric arrays of a data set; InputError for cells that are not supported, by name."""
    import pyvista

    cells, types = _lists(mesh) if isinstance(mesh, pyvista.PolyData) else _grid(mesh)
    blocks, numbers = blocks_of(cells, types, mesh.n_points, by_size=False)
    return Mesh(
        np.array(mesh.points, dtype=np.float64),
        blocks,
        cell_data={
            name: [values[block] for block in numbers] for name, values in _numeric(mesh.cell_data).items()
        },
        point_data=_numeric(mesh.point_data),
    )


def moved(mesh: Any, points: np.ndarray) -> Any:
    """A copy with other coordinates, in double precision where a vertex moved; cells and arrays stay.

    Normals are left out if there are any: they would be those of the old surface.
    """
    result = mesh.copy()
    if not np.array_equal(points, mesh.points):
        result.points = points
        for data in (result.point_data, result.cell_data):
            if "Normals" in data:
                del data["Normals"]
    return result


def _grid(mesh: pyvista.UnstructuredGrid) -> tuple[CellList, np.ndarray]:
    """The cells of a grid and VTK's type of each."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    cells = mesh.GetCells()
    offsets, nodes = (vtk_to_numpy(a) for a in (cells.GetOffsetsArray(), cells.GetConnectivityArray()))
    return list_with_offsets(offsets, nodes, "the grid"), np.asarray(mesh.celltypes)


def _lists(mesh: pyvista.PolyData) -> tuple[CellList, np.ndarray]:
    """The vertices, lines and polygons of a surface, in the order in which VTK counts cells."""
    if mesh.n_strips:
        raise InputError("triangle strips are not supported; PolyData.triangulate() makes triangles of them")
    lists = [
        list_with_counts(np.asarray(mesh.verts), mesh.GetNumberOfVerts(), "verts"),
        list_with_counts(np.asarray(mesh.lines), mesh.GetNumberOfLines(), "lines"),
        list_with_counts(np.asarray(mesh.faces), mesh.GetNumberOfPolys(), "faces"),
    ]
    kinds = [POLY_VERTEX, POLY_LINE, POLYGON]
    return joined(lists), np.repeat(kinds, [len(cells.starts) for cells in lists])


def _numeric(data: Any) -> dict[str, np.ndarray]:
    """The arrays of numbers among those of points or cells."""
    arrays = {name: np.asarray(values) for name, values in data.items()}
    return {name: array for name, array in arrays.items() if array.dtype.kind in "iufb"}
