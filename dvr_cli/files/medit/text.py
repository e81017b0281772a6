"""MEDIT meshes as text (.mesh): words and numbers between blanks; a keyword begins a section.

Version 1 stands for float32, but FreeFem++, TetGen and others write float64 under it, and what stands in the
text is what most programs read. So it is taken as it stands, whatever the version.
"""

from __future__ import annotations

import re
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.medit.keywords import ELEMENTS, NAMES, UNCOUNTED
from dvr_cli.files.numbers_in_text import is_blank, parse_numbers, shown, token_spans, write_replaced

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_ASIDE = re.compile(rb'"[^"\r\n]*"|#[^\r\n]*')  # strings and comments
_WORD = re.compile(rb"[^\s]+")
_COUNT = re.compile(rb"\s*(\d{1,15})(?!\S)")
_FORTRAN = bytes.maketrans(b"Dd", b"ee")


class TextFile:
    """A .mesh file cut into sections.

    dimension: as it says. sections: names of its sections in order, those before End.
    single: whether its coordinates are float32.
    """

    single = False

    def __init__(self, data: bytes) -> None:
        """Raises InputError for what is no MEDIT file, or has a section twice."""
        self._data = data
        self._text = readable(data)
        self._spans = sections_of(self._text)
        version = self._value("MeshVersionFormatted")
        if version not in range(5):  # 0 is what BAMG writes
            raise InputError(f"MeshVersionFormatted {version} is not known; there are versions 1 to 4")
        self.dimension = self._value("Dimension")
        if self.dimension not in (2, 3):
            raise InputError(f"Dimension {self.dimension}; 2 or 3 are possible")
        if "Vertices" not in self._spans:
            raise InputError("the section Vertices is missing")
        self._vertices, self._places = self._read_vertices()
        self._check_end()

    @property
    def sections(self) -> list[str]:
        return list(self._spans)

    def count(self, name: str) -> int | None:
        """The number of rows a section says it has, None if it is of another kind."""
        match = _COUNT.match(self._text, *self._spans[name])
        return int(match[1]) if match and name not in UNCOUNTED else None

    def as_double(self) -> None:
        """Its coordinates are float64 already."""

    def integers(self, name: str, columns: int) -> np.ndarray:
        """The rows of a section, (n, columns) int64."""
        count, begin, end = self._body(name, columns)
        try:
            numbers = parse_numbers(self._text[begin:end], count * columns, np.int64)
        except ValueError as error:
            what = f"{count} rows of {columns} whole numbers" if columns > 1 else f"{count} whole numbers"
            raise InputError(f"section {name} should have {what}: {error}") from None
        return numbers.reshape(count, columns)

    def vertices(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (N, d) and references (N,)."""
        reference = self._vertices[:, -1]
        if not (np.abs(reference) < 2**53).all() or (reference != np.rint(reference)).any():
            raise InputError("section Vertices has references that are no whole numbers")
        return self._vertices[:, :-1].copy(), reference.astype(np.int64)

    def write(self, points: np.ndarray, changed: np.ndarray, file: BinaryIO) -> None:
        """Write the file with the coordinates in ``points`` (N, d) that are ``changed`` (N, d) replaced."""
        starts, ends = (side[:, :-1][changed] for side in self._places)
        write_replaced(file, self._data, starts, ends, points[changed])

    def _check_end(self) -> None:
        """Raise InputError for a file without End, which many programs leave out, that seems to break off."""
        name, (start, end) = next(reversed(self._spans.items()))
        rest = self._text[end:].split()
        if rest[:1] == [b"End"]:
            return
        remedy = "and there is no End: truncated; if it is whole, end the line"
        if not self._data.rstrip(b" \t").endswith((b"\n", b"\r")):
            raise InputError(f"it breaks off within its last line, {remedy}")
        if not self._text[start:end].strip():
            raise InputError(f"nothing follows its last keyword {shown(name)}, {remedy}")

    def _read_vertices(self) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """The rows of the section (N, d + 1), and where in the file each number begins and ends."""
        columns = self.dimension + 1
        count, begin, end = self._body("Vertices", columns)
        text = self._text[begin:end]
        starts, ends = token_spans(np.frombuffer(text, dtype=np.uint8))
        try:
            if len(starts) != count * columns:
                raise ValueError(f"{len(starts)} numbers instead of {count * columns}")
            values = parse_numbers(with_e(text), len(starts), np.float64)
        except ValueError as error:
            what = f"{count} rows of {columns} numbers"
            raise InputError(f"section Vertices should have {what}: {error}") from None
        shape = count, columns
        return values.reshape(shape), (begin + starts.reshape(shape), begin + ends.reshape(shape))

    def _body(self, name: str, columns: int) -> tuple[int, int, int]:
        """The number of rows of a section, and where they begin and end."""
        begin, end = self._spans[name]
        match = _COUNT.match(self._text, begin, end)
        if match is None:
            raise InputError(f"section {name} should begin with the number of its rows")
        count = int(match[1])
        if 2 * count * columns > end - match.end() + 1:  # a digit and a blank each
            raise InputError(f"section {name} should have {count} rows, which the file is too short for")
        return count, match.end(), end

    def _value(self, name: str) -> int:
        match = _COUNT.match(self._text, *self._spans.get(name, (0, 0)))
        if match is None:
            raise InputError(f"the keyword {name} and its number are missing")
        return int(match[1])


def readable(data: bytes) -> bytes:
    """The text of a file, of the same length, with blanks for what is no part of its sections."""
    text = b"   " + data[3:] if data.startswith(_BYTE_ORDER_MARK) else data
    if b"#" in text or b'"' in text:
        text = _ASIDE.sub(lambda match: b" " * len(match.group()), text)
    return text


def sections_of(text: bytes) -> dict[str, tuple[int, int]]:
    """The start of each section, behind its keyword, and its end.

    Raises InputError for what is no MEDIT file, or has a section twice.
    """
    characters = np.frombuffer(b" " + text, dtype=np.uint8)
    letter = (characters[1:] | 32) - ord("a") < 26  # unsigned: what lies before wraps round
    starts = np.flatnonzero(letter & is_blank(characters[:-1])).tolist()
    if not starts or not text.startswith(b"MeshVersionFormatted", starts[0]) or text[: starts[0]].strip():
        raise InputError(_what_else(text))
    spans: dict[str, tuple[int, int]] = {}
    for start, end in zip(starts, [*starts[1:], len(text)], strict=True):
        word = _WORD.match(text, start)
        assert word is not None  # it begins with a letter
        name = word.group().decode("ascii", "replace")
        if name == "End":
            break
        if name in spans and (name in ELEMENTS or name in NAMES.values()):
            raise InputError(f"it has two sections {shown(name)}; readers do not agree on what that means")
        spans.setdefault(name, (word.end(), end))
    return spans


def _what_else(text: bytes) -> str:
    """The reason why this is no MEDIT file; other programs use the suffix for files of their own."""
    head = text[:200].split()
    if head and head[0] == b"MFEM":
        return "a mesh of MFEM, which is not supported; only MEDIT's .mesh is (MFEM can save it as VTK)"
    if head and head[0].isdigit():
        return "it begins with a number, as Netgen's neutral format does; only MEDIT's .mesh is supported"
    return "not a MEDIT file: it does not begin with MeshVersionFormatted"


def with_e(text: bytes) -> bytes:
    """Numbers with exponents as Fortran writes them (1.5D-3) made readable."""
    return text.translate(_FORTRAN) if b"D" in text or b"d" in text else text
