"""The byte ranges of legacy VTK files: binary ones of tetrahedra, in the layout of 4.2 or that of 5.1."""

from __future__ import annotations

import mmap
import re
from dataclasses import replace
from pathlib import Path
from typing import cast

from dvr_cli.errors import InputError
from dvr_cli.files.ranges import MAIN, Counted, Part, Ranges, Rows, Table
from dvr_cli.files.vtk.scan import Scanner

_TETRA, _NODES = 10, 4
_INTEGERS = {"vtktypeint64": ">i8", "vtktypeint32": ">i4", "int": ">i4"}
_OF_CELLS = re.compile(rb"cell_data", re.IGNORECASE)  # they may tell regions apart


def ranges_of(path: Path) -> Ranges | None:
    """The ranges of the file at ``path``, None where it is of another kind; raises OSError.

    Only what stands between the arrays is read.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        try:
            return _found(Scanner(cast(bytes, data)))
        except InputError:  # whoever reads the file whole will say why
            return None


def _found(scanner: Scanner) -> Ranges | None:
    if not scanner.line().startswith(b"# vtk DataFile Version"):
        return None
    scanner.line()  # the title
    words = [scanner.word("").lower() for _ in range(3)]
    if words != [b"binary", b"dataset", b"unstructured_grid"] or scanner.peek() != "points":
        return None
    scanner.binary = True
    scanner.word("POINTS")
    n = scanner.count("")
    if scanner.type_name("") != "double" or not n:
        return None
    points = Rows(scanner.extent("double", 3 * n, "")[0], ">f8", 3, n)
    scanner.skip_metadata(3)
    if scanner.peek() != "cells":
        return None
    scanner.word("CELLS")
    count, size = scanner.count(""), scanner.count("")
    if scanner.peek() == "offsets":
        count -= 1
        offsets = _integers(scanner, count + 1)
        cells = _integers(scanner, size, _NODES) if scanner.peek() == "connectivity" else None
        if offsets is None or cells is None or size != _NODES * count:
            return None
        pairs = Rows(offsets.begin, offsets.dtype, 2, count, stride=offsets.step)  # where cells begin and end
        sizes = Counted(pairs, (0, _NODES), _NODES)
    else:
        if size != (_NODES + 1) * count or not count:
            return None
        cells = Rows(scanner.extent("int", size, "")[0], ">i4", _NODES + 1, count)
        sizes = Counted(replace(cells, columns=1, stride=cells.step), (_NODES,))
    if scanner.peek() != "cell_types":
        return None
    scanner.word("CELL_TYPES")
    if scanner.count("") != count:
        return None
    types = Rows(scanner.extent("int", count, "")[0], ">i4", 1, count)
    if _OF_CELLS.search(scanner.data, scanner.position):
        return None
    part = Part(cells, (Counted(types, (_TETRA,)), sizes))
    return Ranges(Table((Part(points),)), ((MAIN, Table((part,))),))


def _integers(scanner: Scanner, count: int, columns: int = 1) -> Rows | None:
    """An array of whole numbers with its name; None for a type that is never written here."""
    scanner.word("")
    name = scanner.type_name("")
    if name not in _INTEGERS:
        return None
    rows = Rows(scanner.extent(name, count, "")[0], _INTEGERS[name], columns, count // columns)
    scanner.skip_metadata(1)
    return rows
