"""Byte ranges: where in a file the rows of coordinates and cells lie, for processes that each read some.

Only for files with linear cells and coordinates in 64 bits.
What else has to be so is said with the rows, and looked at by whoever reads them.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dvr_cli.files.source import differing
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.ranks import ranks

_CHUNK = 1 << 20  # bytes that are copied together
_LARGE = 2.0**62  # of which size real numbers stand for all larger ones
LINEAR = ("vertex", "line", "triangle", "quad", "tetra", "hexahedron", "wedge", "pyramid")


@dataclass(frozen=True)
class Rows:
    """Rows of numbers that lie one after the other in a file.

    begin: the offset of the first byte. dtype: of the numbers, with their byte order. columns: numbers a row.
    count: rows. stride: bytes from one row to the next, 0 where nothing lies between them.
    """

    begin: int
    dtype: str
    columns: int
    count: int
    stride: int = 0

    @property
    def step(self) -> int:
        """Bytes from one row to the next."""
        return self.stride or self._width

    @property
    def _width(self) -> int:
        return self.columns * np.dtype(self.dtype).itemsize

    def offset(self, row: int) -> int:
        """The offset of the first byte of a row."""
        return self.begin + row * self.step

    @property
    def tight(self) -> Rows:
        """As many rows from there on with nothing between them."""
        return replace(self, stride=0)

    def part(self, first: int, count: int) -> Rows:
        """Some of the rows, from ``first`` on."""
        return replace(self, begin=self.offset(first), count=count)

    def read(self, path: Path, first: int, last: int) -> np.ndarray:
        """(last - first, columns) the rows first .. last in native byte order; raises OSError.

        They are fewer where the file ends before.
        """
        return self._rows(self._bytes(path, first, last)).astype(np.dtype(self.dtype).newbyteorder("="))

    def patched(self, path: Path, first: int, values: np.ndarray) -> np.ndarray:
        """The bytes from the row ``first`` on with other ``values`` (n, columns); raises OSError."""
        if self.step == self._width:
            return np.ascontiguousarray(values, dtype=self.dtype).reshape(-1).view(np.uint8)
        data = self._bytes(path, first, first + len(values))
        self._rows(data)[:] = values
        return data

    def _bytes(self, path: Path, first: int, last: int) -> np.ndarray:
        size = self.step * (last - first - 1) + self._width if last > first else 0
        return np.fromfile(path, np.uint8, size, offset=self.offset(first))

    def _rows(self, data: np.ndarray) -> np.ndarray:
        """The rows in some bytes, as a view of them."""
        whole = (len(data) + self.step - self._width) // self.step if len(data) else 0
        number = np.dtype(self.dtype)
        return np.ndarray((whole, self.columns), number, data, strides=(self.step, number.itemsize))


@dataclass(frozen=True)
class Counted:
    """Rows of which row r has the numbers values + r * step, if the file is what it seems to be."""

    rows: Rows
    values: tuple[int, ...]
    step: int = 0

    def holds(self, path: Path, first: int, last: int) -> bool:
        """True if that is so of the rows first .. last, and they are there; raises OSError."""
        found = self.rows.read(path, first, last)
        wanted = np.array(self.values) + self.step * np.arange(first, last)[:, None]
        return len(found) == last - first and bool((found == wanted).all())


@dataclass(frozen=True)
class Part:
    """Rows of a table that lie together.

    sure: rows of numbers that have to be what is said of them, one for each of ``rows``. tags: of cells, one
    number each or the same one for all. flag: the offset of 4 bytes, before the rows, that say that more
    numbers follow in each, which hold as long as no row changes; None where nothing follows.
    """

    rows: Rows
    sure: tuple[Counted, ...] = ()
    tags: tuple[int | Rows, ...] = ()
    flag: int | None = None


@dataclass(frozen=True)
class Table:
    """Rows that lie in one part of a file or in several."""

    parts: tuple[Part, ...]

    @cached_property
    def count(self) -> int:
        """The number of rows."""
        return sum(part.rows.count for part in self.parts)

    def stretches(self, first: int, last: int) -> Iterator[tuple[Part, int, int]]:
        """The parts with rows among first .. last, and which rows of each these are."""
        start = 0
        for part in self.parts:
            lo, hi = max(first - start, 0), min(last - start, part.rows.count)
            if lo < hi:
                yield part, lo, hi
            start += part.rows.count

    def stale(self, path: Path, first: int, values: np.ndarray) -> set[int]:
        """The flags of the parts in which numbers that follow rows do not hold with others; raises OSError.

        values: (n, columns) the rows from ``first`` on.
        """
        found, done = set(), 0
        for part, lo, hi in self.stretches(first, first + len(values)):
            new = values[done : done + hi - lo]
            if part.flag is not None and differing(new, part.rows.read(path, lo, hi)).any():
                found.add(part.flag)
            done += hi - lo
        return found

    def without(self, stale: set[int]) -> Table:
        """The table in a copy of the file, see ``copy_without``."""
        parts, gone = [], 0
        for part in self.parts:
            rows = replace(part.rows, begin=part.rows.begin - gone)
            if part.flag in stale:
                rows = rows.tight
                gone += rows.count * (part.rows.step - rows.step)
            parts.append(Part(rows))
        return Table(tuple(parts))

    def copy_without(self, source: Path, target: Path, stale: set[int]) -> None:
        """Copy a file without the numbers that follow the rows of parts with a flag in ``stale``.

        These rows are empty in the copy. Raises OSError.
        """
        if not stale:
            shutil.copyfile(source, target)
            return
        with source.open("rb") as old, target.open("wb") as new:
            for part in self.parts:
                if part.flag is not None and part.flag in stale:
                    _pass_on(old, new, part.flag)
                    new.write(bytes(4))
                    old.seek(part.flag + 4)
                    _pass_on(old, new, part.rows.begin)
                    new.seek(part.rows.count * part.rows.tight.step, os.SEEK_CUR)
                    old.seek(part.rows.offset(part.rows.count))
            shutil.copyfileobj(old, new)

    def read(self, path: Path, first: int, last: int) -> np.ndarray | None:
        """(last - first, columns) the rows first .. last; None where not all is as said; raises OSError."""
        found = [self.parts[0].rows.read(path, 0, 0)] if self.parts else [np.empty((0, 0))]
        for part, lo, hi in self.stretches(first, last):
            rows = part.rows.read(path, lo, hi)
            if len(rows) < hi - lo or not all(some.holds(path, lo, hi) for some in part.sure):
                return None
            found.append(rows)
        return found[-1] if len(found) == 2 else np.concatenate(found)

    def kinds(self, path: Path, first: int, last: int) -> tuple[list[tuple[int, ...]], np.ndarray]:
        """The distinct tags of the rows first .. last, and (last - first,) which of them each row has."""
        known: dict[tuple[int, ...], int] = {}
        found = [np.empty(0, dtype=np.int32)]
        for part, lo, hi in self.stretches(first, last):
            columns = [tag.read(path, lo, hi)[:, 0] for tag in part.tags if isinstance(tag, Rows)]
            if not columns:
                kind = known.setdefault(tuple(tag for tag in part.tags if isinstance(tag, int)), len(known))
                found.append(np.full(hi - lo, kind, dtype=np.int32))
                continue
            place = np.zeros(hi - lo, dtype=np.int64)
            for column in columns:
                of_column = ranks(column)
                place = ranks(place * (of_column.max() + 1) + of_column)
            some = np.empty(place.max() + 1, dtype=np.int64)
            some[place] = np.arange(hi - lo)
            at = []
            for row in some.tolist():
                of_row = iter([int(column[row]) for column in columns])
                tags = tuple(next(of_row) if isinstance(tag, Rows) else tag for tag in part.tags)
                at.append(known.setdefault(tags, len(known)))
            found.append(np.array(at, dtype=np.int32)[place])
        return list(known), np.concatenate(found)

    def values(self, path: Path, first: int, last: int, nth: int) -> np.ndarray | None:
        """The distinct values of one tag of the rows first .. last, ascending; raises OSError.

        None where they are no whole numbers. Real ones may be larger than what is returned for them.
        """
        tags = [(part.tags[nth], lo, hi) for part, lo, hi in self.stretches(first, last)]
        found = [tag.read(path, lo, hi) if isinstance(tag, Rows) else [tag] for tag, lo, hi in tags]
        values = [np.ravel(some) for some in [[], *found]]
        real = [n for n, some in enumerate(values) if some.dtype.kind == "f"]
        for n in real:
            if not (np.isfinite(values[n]) & (values[n] == np.rint(values[n]))).all():
                return None
            values[n] = np.clip(values[n], -_LARGE, _LARGE)
        return np.unique(np.concatenate([some.astype(np.int64) for some in values]))

    def with_tags(self, which: Sequence[int]) -> Table:
        """The table with these of its tags alone."""
        parts = (replace(part, tags=tuple(part.tags[nth] for nth in which)) for part in self.parts)
        return Table(tuple(parts))


def _pass_on(old: BinaryIO, new: BinaryIO, end: int) -> None:
    """Copy one file into another up to an offset of the first."""
    while data := old.read(min(end - old.tell(), _CHUNK)):
        new.write(data)


@dataclass(frozen=True)
class Field:
    """The point data of some vertices.

    rows: (n, components). numbers: (n, 1) of the vertex that each row is for, None where there is one for
    each vertex in their order. Of several for a vertex the last counts; without any it has NaN.
    """

    rows: Table
    numbers: Table | None = None


@dataclass(frozen=True)
class Ranges:
    """The places of coordinates and cells in a file.

    points: (N, 3) coordinates. cells: the type and the vertices of cells that come one after the other, in
    the order of the file; a type may come again. base: the number of the first vertex, and numbers: (N, 1)
    those of all, by which cells name them, None where they count from ``base``. names: of the cell data
    that tags are. once: whether a cell that is there twice counts once, in all its groups. order: of the
    types whose nodes have another order in the file the place there of each. groups: their names, with tag
    and dimension. fields: the point data. linked: (k, 2) the numbers of vertices that periodic links tie
    together.
    """

    points: Table
    cells: tuple[tuple[str, Table], ...]
    base: int = 0
    numbers: Table | None = None
    names: tuple[str, ...] = ()
    once: bool = False
    order: Mapping[str, list[int]] = field(default_factory=dict)
    groups: Mapping[str, np.ndarray] = field(default_factory=dict)
    fields: Mapping[str, Field] = field(default_factory=dict)
    linked: np.ndarray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))

    @property
    def dimension(self) -> int:
        """Of the cells whose vertices move."""
        return max(CELL_TYPES[name].dimension for name, _ in self.cells)

    @property
    def counts(self) -> dict[str, int]:
        """The number of cells of each type, types in the order of the file."""
        counts: dict[str, int] = {}
        for name, table in self.cells:
            counts[name] = counts.get(name, 0) + table.count
        return counts

    @property
    def count(self) -> int:
        """The number of cells whose vertices move."""
        dimension = self.dimension
        return sum(n for name, n in self.counts.items() if CELL_TYPES[name].dimension == dimension)
