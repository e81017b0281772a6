"""The byte ranges of legacy VTK files: binary ones, in the layout of 4.2 or that of 5.1."""

from __future__ import annotations

import mmap
from dataclasses import replace
from functools import partial
from math import prod
from pathlib import Path
from typing import cast

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.ranges import Counted, Ranges, Rows
from dvr_cli.files.vtk.cell_runs import Run, ranges_of_cells
from dvr_cli.files.vtk.data import read_data
from dvr_cli.files.vtk.scan import Scanner, dtype_of

_INTEGERS = {"vtktypeint64": ">i8", "vtktypeint32": ">i4", "int": ">i4"}


def ranges_of(path: Path) -> Ranges | None:
    """The ranges of the file at ``path``, None where it is of another kind; raises OSError.

    Only what stands between the arrays is read.
    """
    with path.open("rb") as file:
        data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)  # views of it may outlive an error
    try:
        return _found(path, _Views(cast(bytes, data)))
    except InputError:  # whoever reads the file whole will say why
        return None


class _Views(Scanner):
    """A scanner that reads no array: what it has for one is a view of the file."""

    def parse(self, type_name: str, count: int, what: str, extent: tuple[int, int]) -> np.ndarray:
        """A view of the values whose bytes ``extent`` has found."""
        if type_name == "bit":
            raise InputError(f"{what} is packed")
        return np.frombuffer(self.data, dtype_of(type_name), count, extent[0])

    def rows(self, view: np.ndarray) -> Rows:
        """The rows of such an array, (n,) or (n, ...)."""
        start = np.frombuffer(self.data, np.uint8).__array_interface__["data"][0]
        begin = view.__array_interface__["data"][0] - start
        return Rows(begin, view.dtype.str, prod(view.shape[1:]), len(view))


def _found(path: Path, scanner: _Views) -> Ranges | None:
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
        nodes = _integers(scanner, size) if scanner.peek() == "connectivity" else None
        if offsets is None or nodes is None:
            return None
        part_of = partial(_with_offsets, offsets, nodes)
    else:
        size -= count
        part_of = partial(_with_counts, Rows(scanner.extent("int", size + count, "")[0], ">i4", 1, size))
    if not count or scanner.peek() != "cell_types":
        return None
    scanner.word("CELL_TYPES")
    if scanner.count("") != count:
        return None
    types = Rows(scanner.extent("int", count, "")[0], ">i4", 1, count)
    *data, _ = read_data(scanner, n, count)
    fields, arrays = ({name: scanner.rows(view) for name, view in some.items()} for some in data)
    return ranges_of_cells(path, points, types, size, part_of, arrays, fields)


def _with_offsets(offsets: Rows, nodes: Rows, run: Run) -> tuple[Rows, Counted]:
    """The nodes of a run, and where cells begin and end; offsets: of all cells, and nodes: all of theirs."""
    pairs = replace(offsets.part(run.first, run.count), columns=2, stride=offsets.step)
    sizes = Counted(pairs, (run.start, run.start + run.nodes), run.nodes)
    return run.cells(nodes), sizes


def _with_counts(numbers: Rows, run: Run) -> tuple[Rows, Counted]:
    """The nodes of a run, and how many each cell has, which is in front of them; numbers: all of these."""
    begin, stride = numbers.offset(run.first + run.start), (1 + run.nodes) * numbers.step
    counts = replace(numbers, begin=begin, count=run.count, stride=stride)
    return replace(counts, begin=begin + numbers.step, columns=run.nodes), Counted(counts, (run.nodes,))


def _integers(scanner: Scanner, count: int) -> Rows | None:
    """An array of whole numbers with its name; None for a type that is never written here."""
    scanner.word("")
    name = scanner.type_name("")
    if name not in _INTEGERS:
        return None
    rows = Rows(scanner.extent(name, count, "")[0], _INTEGERS[name], 1, count)
    scanner.skip_metadata(1)
    return rows
