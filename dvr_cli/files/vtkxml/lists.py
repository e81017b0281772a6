"""Lists of cells in VTK's XML files: point indices one after the other, and where each cell ends."""

from __future__ import annotations

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.vtk.cells import CellList, list_with_offsets
from dvr_cli.files.vtkxml.layout import Layout
from dvr_cli.files.xml_places import Element


def cell_list(layout: Layout, piece: Element, section: str, n: int) -> CellList:
    """The ``n`` cells of a section ("Cells", "Polys" ...) of a piece; raises InputError."""
    if n == 0:
        return CellList(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, np.int64))
    ends = integers(layout, piece, section, "offsets", n)
    nodes = integers(layout, piece, section, "connectivity", int(ends[-1]))
    return list_with_offsets(np.concatenate([[0], ends]), nodes, section)


def integers(layout: Layout, piece: Element, section: str, name: str, count: int) -> np.ndarray:
    """An array of ``count`` whole numbers in a section, (count,) int64; raises InputError."""
    what = f"{name} of {section}"
    found = [
        array
        for part in piece.named(section)
        for array in part.named("DataArray")
        if array.attributes.get("Name", "").lower() == name
    ]
    if len(found) != 1:
        raise InputError(f"a piece has {len(found)} arrays {what}, where one is needed")
    if count < 0:
        raise InputError(f"{what} should have {count} numbers")
    values = layout.read(found[0], what, count).values
    if values.dtype.kind not in "iu":
        raise InputError(f"{what} should be whole numbers")
    if values.dtype == np.uint64 and len(values) and values.max() >= 1 << 63:
        raise InputError(f"{what} has numbers that cannot be right")
    return values.astype(np.int64, copy=False)
