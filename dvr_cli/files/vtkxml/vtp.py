"""VTP files: VTK's XML files of a PolyData."""

from __future__ import annotations

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.vtk.cells import POLY_LINE, POLY_VERTEX, POLYGON, blocks_of, joined
from dvr_cli.files.vtkxml.layout import Layout, count_of
from dvr_cli.files.vtkxml.lists import cell_list
from dvr_cli.files.vtkxml.source import Kind, VtkXmlSource, read_file
from dvr_cli.files.xml_places import Element
from dvr_cli.mesh.mesh import Cells

# The sections in the order in which VTK counts their cells.
_TYPE_OF = {"Verts": POLY_VERTEX, "Lines": POLY_LINE, "Polys": POLYGON}


def read(data: bytes) -> VtkXmlSource:
    """Read a VTP file, see ``source.read_file``; cells come in blocks as those of legacy POLYDATA."""
    return read_file(data, Kind("vtp", "PolyData", tuple(f"NumberOf{name}" for name in _TYPE_OF), _cells))


def _cells(
    layout: Layout, piece: Element, n_points: int, n_cells: int
) -> tuple[list[Cells], list[np.ndarray]]:
    if count_of(piece, "NumberOfStrips"):
        raise InputError("triangle strips (Strips) are not supported; convert them to triangles")
    counts = [count_of(piece, f"NumberOf{name}") for name in _TYPE_OF]
    lists = [cell_list(layout, piece, name, n) for name, n in zip(_TYPE_OF, counts, strict=True)]
    types = np.repeat(list(_TYPE_OF.values()), counts)
    return blocks_of(joined(lists), types, n_points, by_size=True)
