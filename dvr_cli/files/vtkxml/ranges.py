"""The byte ranges of VTU files with raw appended arrays that are not compressed, in one piece."""

from __future__ import annotations

import mmap
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.ranges import Counted, Ranges, Rows
from dvr_cli.files.vtk.cell_runs import Run, ranges_of_cells
from dvr_cli.files.vtkxml.arrays import is_numeric
from dvr_cli.files.vtkxml.layout import Layout, count_of, layout_of
from dvr_cli.files.vtkxml.source import GHOSTS, appended_arrays, piece_arrays, points_element
from dvr_cli.files.xml_places import Element

_APPENDED = re.compile(rb"<AppendedData[^>]*>\s*_")
_END = b"</AppendedData>"
_TAIL = 1 << 10  # bytes of the end of a file among which the appended data end


def ranges_of(path: Path) -> Ranges | None:
    """The ranges of the file at ``path``, None where a process has to read it whole; raises OSError.

    Only what is in front of the appended data is read, and the header of each array.
    """
    with path.open("rb") as file:
        data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)  # views of it may outlive an error
    begin = _APPENDED.search(data)
    end = data.rfind(_END, max(0, len(data) - _TAIL))
    if begin is None or end < 0:
        return None
    try:
        layout = layout_of(data[: begin.end()] + _END, "UnstructuredGrid", "vtu")
        if layout.appended is None or layout.appended[0] != begin.end() or layout.appended[2]:
            return None
        return _found(path, _Raw(cast(bytes, data), replace(layout, appended=(begin.end(), end, False))))
    except InputError:  # whoever reads the file whole will say why
        return None


def _found(path: Path, raw: _Raw) -> Ranges | None:
    layout = raw.layout
    if layout.coding.compressor is not None or len(layout.pieces) != 1:
        return None
    (piece,) = layout.pieces
    n, count = count_of(piece, "NumberOfPoints"), count_of(piece, "NumberOfCells")
    place = points_element(piece, n)
    if not n or not count or place is None:
        return None
    if place.attributes.get("NumberOfComponents") != "3":
        return None
    points = raw.rows(place, 3, n, "f")
    wanted = ("connectivity", None), ("offsets", count), ("types", count)
    nodes, ends, types = (raw.rows(_named(piece, name), 1, rows, "iu") for name, rows in wanted)
    data, fields = dict[str, Rows](), dict[str, Rows]()
    for array in piece_arrays(piece, "PointData"):
        rows = raw.rows(array, _components(array), n, "iuf")
        if rows is None:
            return None
        fields[array.attributes.get("Name", "")] = rows
    for array in piece_arrays(piece, "CellData"):
        rows = raw.rows(array, _components(array), count, "iuf")
        if rows is None or array.attributes.get("Name", "") in GHOSTS:
            return None
        data[array.attributes.get("Name", "")] = rows
    if points is None or nodes is None or ends is None or types is None:
        return None
    begin, end = raw.begin(place), points.offset(n)
    shared = [e for e, at in appended_arrays(layout) if e is not place and begin <= at < end]
    if np.dtype(points.dtype).itemsize != 8 or shared:
        return None
    data.pop("", None)  # what has no name is not read
    part_of = partial(_part_of, nodes, ends)
    return ranges_of_cells(path, points, types, nodes.count, part_of, data, fields)


def _part_of(nodes: Rows, ends: Rows, run: Run) -> tuple[Rows, Counted]:
    """The nodes of a run of cells, and where each cell ends; nodes, ends: of all cells."""
    sizes = Counted(ends.part(run.first, run.count), (run.start + run.nodes,), run.nodes)
    return run.cells(nodes), sizes


class _Raw(NamedTuple):
    """The raw appended arrays of a file, with its layout."""

    data: bytes
    layout: Layout

    def begin(self, element: Element) -> int:
        """The place of the header of an array."""
        return self.layout.array(element, "").begin

    def rows(self, element: Element | None, columns: int, count: int | None, kinds: str) -> Rows | None:
        """The rows of an array, None if it is not there, of another kind of number or another size.

        count: how many they are, None for as many as there are.
        """
        layout = self.layout
        if element is None or element.attributes.get("format") != "appended" or not is_numeric(element):
            return None
        array, header = layout.array(element, ""), layout.coding.header
        first, width = array.begin + header.itemsize, columns * array.dtype.itemsize
        if array.dtype.kind not in kinds or width < 1 or first > array.limit:
            return None
        size = int(np.frombuffer(self.data, header, 1, array.begin)[0])
        if size % width or first + size > array.limit or count not in (None, size // width):
            return None
        count = size // width
        return Rows(first, array.dtype.newbyteorder(layout.coding.order).str, columns, count)


def _named(piece: Element, name: str) -> Element | None:
    """The array of the cells with this name, None if it is not there once."""
    arrays = piece_arrays(piece, "Cells")
    found = [array for array in arrays if array.attributes.get("Name", "").lower() == name]
    return found[0] if len(found) == 1 else None


def _components(array: Element) -> int:
    """The count of numbers that an array has for each point, 0 where that is not said rightly."""
    text = array.attributes.get("NumberOfComponents", "1")
    return int(text) if text.isascii() and text.isdigit() and len(text) < 9 else 0
