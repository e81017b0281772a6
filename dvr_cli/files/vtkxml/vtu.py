"""VTU files: VTK's XML files of an UnstructuredGrid."""

from __future__ import annotations

import numpy as np

from dvr_cli.files.vtk.cells import blocks_of
from dvr_cli.files.vtkxml.layout import Layout
from dvr_cli.files.vtkxml.lists import cell_list, integers
from dvr_cli.files.vtkxml.source import Kind, VtkXmlSource, read_file
from dvr_cli.files.xml_places import Element
from dvr_cli.mesh.mesh import Cells


def read(data: bytes) -> VtkXmlSource:
    """Read a VTU file, see ``source.read_file``; cells come in blocks as those of legacy VTK files."""
    return read_file(data, Kind("vtu", "UnstructuredGrid", ("NumberOfCells",), _cells))


def _cells(
    layout: Layout, piece: Element, n_points: int, n_cells: int
) -> tuple[list[Cells], list[np.ndarray]]:
    if n_cells == 0:
        return [], []
    types = integers(layout, piece, "Cells", "types", n_cells)
    return blocks_of(cell_list(layout, piece, "Cells", n_cells), types, n_points, by_size=False)
