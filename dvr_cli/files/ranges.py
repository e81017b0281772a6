"""Byte ranges: where in a file the rows of coordinates and cells lie, for processes that each read some.

Only for files of one block of cells of one type, with coordinates in 64 bits and nothing that tells regions
apart, as each process then knows what its rows are.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Rows:
    """Rows of numbers that lie one after the other in a file.

    begin: the offset of the first byte. dtype: of the numbers, with their byte order. columns: numbers a row.
    count: rows.
    """

    begin: int
    dtype: str
    columns: int
    count: int

    def offset(self, row: int) -> int:
        """The offset of the first byte of a row."""
        return self.begin + row * self.columns * np.dtype(self.dtype).itemsize

    def read(self, path: Path, first: int, last: int) -> np.ndarray:
        """(last - first, columns) the rows first .. last in native byte order; raises OSError.

        They are fewer where the file ends before.
        """
        count, dtype = (last - first) * self.columns, np.dtype(self.dtype)
        values = np.fromfile(path, dtype, count, offset=self.offset(first))
        whole = len(values) // self.columns
        return values[: whole * self.columns].reshape(whole, self.columns).astype(dtype.newbyteorder("="))


@dataclass(frozen=True)
class Ranges:
    """The places of coordinates and cells in a file.

    points: (N, 3) coordinates. cell_type: of all cells. cells: their vertices in the last columns, in the
    order of that type. alike: rows of one number, one a cell, and that number: what has to be so if all cells
    are of that type. steps: rows of one number, one a cell, which has to grow by so much from cell to cell.
    """

    points: Rows
    cell_type: str
    cells: Rows
    alike: tuple[tuple[Rows, int], ...]
    steps: tuple[tuple[Rows, int], ...]

    def cells_of(self, path: Path, first: int, last: int, nodes: int) -> np.ndarray | None:
        """(last - first, nodes) the vertices of some cells; None where not all are of that type."""
        rows = self.cells.read(path, first, last)
        good = len(rows) == last - first and bool((rows[:, : self.cells.columns - nodes] == nodes).all())
        for place, value in self.alike:
            found = place.read(path, first, last)
            good = good and len(found) == last - first and bool((found == value).all())
        for place, step in self.steps:
            found = place.read(path, first, last)
            wanted = step * np.arange(first, last)
            good = good and len(found) == last - first and bool((found[:, 0] == wanted).all())
        return rows[:, self.cells.columns - nodes :].astype(np.int64) if good else None
