"""MEDIT meshes in binary (.meshb): of either byte order, float32 or float64, counts of 32 or 64 bits.

    1, version                          int32 each; the first one tells the byte order
    keyword, next, ...                  int32; where the next keyword stands (int64 from version 3 on)
    keyword, next, count, rows          count and whole numbers are int64 in version 4

Coordinates are float32 in version 1, else float64, unless FloatingPointPrecision says so.
"""

from __future__ import annotations

from typing import BinaryIO, NamedTuple

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.medit.keywords import (
    DIMENSION,
    ELEMENTS,
    END,
    NAMES,
    PRECISION,
    SOLUTION,
    UNCOUNTED,
    VECTORS,
    VERTICES,
    WHOLE,
)

BINARY = (b"\x01\x00\x00\x00", b"\x00\x00\x00\x01")  # the first bytes of such a file


class _Section(NamedTuple):
    """code: its keyword; start: where that stands; begin, end: of what follows it and the next position."""

    code: int
    start: int
    begin: int
    end: int


class BinaryFile:
    """A .meshb file cut into sections; see ``TextFile`` for what is offered."""

    def __init__(self, data: bytes, needed: int = VERTICES) -> None:
        """Raises InputError for what is damaged, has a section twice, or lacks the one ``needed``."""
        self._data = data
        self._order = "<" if data[:1] == b"\x01" else ">"
        if len(data) < 8:
            raise InputError("the file ends in its header")
        self.version = self._number(4, 4)
        if self.version not in (1, 2, 3, 4):
            raise InputError(f"version {self.version} of the binary format is not known; there are 1 to 4")
        self._position = 4 if self.version < 3 else 8
        self._integer = np.dtype(f"{self._order}i{4 if self.version < 4 else 8}")
        self._sections = self._find()
        for code in (DIMENSION, needed):
            if code not in self._sections:
                raise InputError(f"the section {NAMES[code]} is missing")
        self.dimension = self._value(DIMENSION)
        if self.dimension not in (2, 3):
            raise InputError(f"Dimension {self.dimension}; 2 or 3 are possible")
        bits = self._value(PRECISION) if PRECISION in self._sections else 32 if self.version == 1 else 64
        if bits not in (32, 64):
            raise InputError(f"FloatingPointPrecision {bits}; 32 or 64 are possible")
        self._real = np.dtype(f"{self._order}f{bits // 8}")

    @property
    def sections(self) -> list[str]:
        return [_name(code) for code in self._sections]

    @property
    def single(self) -> bool:
        """True if coordinates are stored as float32."""
        return self._real.itemsize == 4

    def count(self, name: str) -> int | None:
        """The number of rows a section says it has, None if it is of another kind."""
        if name in UNCOUNTED or name not in NAMES.values():
            return None
        return self._count(self._named(name))

    def integers(self, name: str, columns: int) -> np.ndarray:
        """The rows of a section, (n, columns) int64."""
        rows = self._rows(self._named(name), np.dtype((self._integer, (columns,))))
        return rows.astype(np.int64)

    def vertices(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (N, d) and references (N,)."""
        rows = self._rows(self._sections[VERTICES], self._vertex)
        with np.errstate(invalid="ignore"):  # damaged ones may be signalling no number
            return rows["place"].astype(np.float64), rows["reference"].astype(np.int64)

    def solutions(self) -> tuple[int, list[int], np.ndarray]:
        """Of the solutions at vertices the number of rows, the kind of each, all numbers end to end."""
        section = self._sections[SOLUTION]
        count, at = self._count(section), section.begin + self._integer.itemsize
        if section.end < at + 4 or not 0 <= (solutions := self._number(at, 4)) <= (section.end - at) // 4 - 1:
            raise InputError(f"section {_name(SOLUTION)} is too short for its header")
        kinds = np.frombuffer(self._data, f"{self._order}i4", solutions, at + 4).tolist()
        at += 4 + 4 * solutions
        numbers = np.frombuffer(self._data, self._real, (section.end - at) // self._real.itemsize, at)
        return count, kinds, numbers.astype(np.float64)

    def write(self, points: np.ndarray, changed: np.ndarray, file: BinaryIO) -> None:
        """Write the file with the coordinates in ``points`` (N, d) that are ``changed`` (N, d) replaced."""
        section = self._sections[VERTICES]
        rows = self._rows(section, self._vertex).copy()
        rows["place"][changed] = points[changed]
        begin = section.begin + self._integer.itemsize
        view = memoryview(self._data)
        file.write(view[:begin])
        file.write(rows.tobytes())
        file.write(view[begin + rows.nbytes :])

    def as_double(self) -> bytes | None:
        """The same mesh in version 2, with float64 for float32; None if its coordinates are float64 already,
        it has sections that are not known well enough, or would be too long for this version.
        """
        if self.version != 1 or PRECISION in self._sections or len(self._data) >= 2**30:
            return None
        int32 = np.dtype(f"{self._order}i4")
        pieces = [self._data[:4], np.array(2, int32).tobytes()]
        length = 8
        for section in self._sections.values():
            body = self._wide_body(section)
            if body is None:
                return None
            length += 8 + len(body)
            following = 0 if section.end == len(self._data) else length
            pieces += [np.array([section.code, following], int32).tobytes(), body]
        pieces.append(self._data[section.end :])
        return b"".join(pieces)

    def _wide_body(self, section: _Section) -> bytes | None:
        """The bytes behind the positions of a section, its float32 as float64; None if they are not known."""
        name = _name(section.code)
        body = self._data[section.begin : section.end]
        if name in WHOLE or name in ELEMENTS or section.code == DIMENSION:
            return body
        wide = np.dtype(f"{self._order}f8")
        if section.code == VERTICES:
            narrow, into = self._vertex, self._vertex_with(wide)
        elif name in VECTORS:
            narrow, into = (np.dtype((real, (self.dimension,))) for real in (self._real, wide))
        else:
            return None
        rows = self._rows(section, narrow)
        head = self._integer.itemsize
        return body[:head] + rows.astype(into.base).tobytes() + body[head + rows.nbytes :]

    @property
    def _vertex(self) -> np.dtype:
        return self._vertex_with(self._real)

    def _vertex_with(self, real: np.dtype) -> np.dtype:
        return np.dtype([("place", real, (self.dimension,)), ("reference", self._integer)])

    def _find(self) -> dict[int, _Section]:
        sections: dict[int, _Section] = {}
        start = 8
        while True:
            begin = start + 4 + self._position
            if start + 4 <= len(self._data) and self._number(start, 4) == END:
                return sections
            if begin > len(self._data):
                raise InputError("the file ends before its keyword End")
            code, following = self._number(start, 4), self._number(start + 4, self._position)
            end = following or len(self._data)
            if not begin <= end <= len(self._data):
                raise InputError(
                    f"keyword {_name(code)} at byte {start} says that the next one is at {following}, "
                    f"but the file has {len(self._data)} bytes"
                )
            if code in sections:
                raise InputError(f"it has two sections {_name(code)}")
            sections[code] = _Section(code, start, begin, end)
            if not following:
                return sections
            start = following

    def _named(self, name: str) -> _Section:
        return next(section for code, section in self._sections.items() if _name(code) == name)

    def _value(self, code: int) -> int:
        section = self._sections[code]
        if section.end < section.begin + 4:
            raise InputError(f"the section {_name(code)} has no value")
        return self._number(section.begin, 4)

    def _count(self, section: _Section) -> int:
        size = self._integer.itemsize
        if section.end < section.begin + size:
            raise InputError(f"the section {_name(section.code)} has no count")
        return self._number(section.begin, size)

    def _rows(self, section: _Section, dtype: np.dtype) -> np.ndarray:
        count, begin = self._count(section), section.begin + self._integer.itemsize
        if not 0 <= count * dtype.itemsize <= section.end - begin:
            raise InputError(
                f"section {_name(section.code)} should have {count} rows, which it is too short for"
            )
        base, shape = dtype.base, dtype.shape
        entries = count * int(np.prod(shape, dtype=np.int64))
        return np.frombuffer(self._data, base, entries, begin).reshape(count, *shape)

    def _number(self, at: int, size: int) -> int:
        return int(np.frombuffer(self._data, f"{self._order}i{size}", 1, at)[0])


def _name(code: int) -> str:
    return NAMES.get(code, f"number {code}")
