"""Numbers in text files: find them, parse many at once, replace some and leave every other byte alone.

Shared by the formats that may be text (legacy VTK, OBJ, TetGen).
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterable
from itertools import islice
from typing import BinaryIO

import numpy as np

_BLANK = np.zeros(256, dtype=bool)
_BLANK[list(b" \t\n\v\f\r")] = True
_LONE_SIGN = re.compile(rb"[+-](\s|\Z)")
_BLANK_CHARACTER = re.compile(rb"\s")
_BLOCK = 1 << 22  # bytes looked at in one go when counting tokens
_CHUNK = 1 << 16  # tokens replaced in one go when writing


_ROWS_ALIKE = 3  # rows that tell how long another one is at least


def is_blank(characters: np.ndarray) -> np.ndarray:
    """A mask of the uint8 ``characters`` (any shape) that are white space."""
    return _BLANK[characters]


def parse_numbers(text: bytes, count: int, dtype: type | np.dtype) -> np.ndarray:
    """The ``count`` blank-separated numbers in ``text`` as an array of ``dtype``.

    Raises ValueError if there are more or fewer, or something in it is no number.
    """
    # NumPy takes a sign and the integer behind the next blank for one number.
    if np.issubdtype(dtype, np.integer) and (b"-" in text or b"+" in text) and _LONE_SIGN.search(text):
        raise ValueError("a sign without a number")
    if not text or text.isspace():  # NumPy reads a number out of blanks
        numbers = np.empty(0, dtype=dtype)
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # how older NumPy reports stray text
            try:
                numbers = np.fromstring(text, dtype=dtype, sep=" ")
            except DeprecationWarning as warning:
                raise ValueError(str(warning)) from None
    if len(numbers) != count:
        raise ValueError(f"{len(numbers)} numbers instead of {count}")
    return numbers


def token_spans(text: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts and ends of the runs of non-blank characters in ``text`` (uint8), two (n,) arrays."""
    solid = np.zeros(len(text) + 2, dtype=bool)
    np.logical_not(is_blank(text), out=solid[1:-1])
    edges = np.flatnonzero(solid[1:] != solid[:-1])
    return edges[0::2], edges[1::2]


def inside_spans(length: int, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(length,) bool: which positions lie in one of the ascending, disjoint spans [start, end)."""
    if not len(starts):
        return np.zeros(length, dtype=bool)
    apart = starts[1:] != ends[:-1]  # spans that touch are taken together: whole runs of lines often do
    edges = np.stack([starts[np.r_[True, apart]], ends[np.r_[apart, True]]], axis=1).ravel()
    runs = np.diff(edges, prepend=0, append=length)
    return np.repeat(np.arange(len(runs)) % 2 == 1, runs)


def end_of_tokens(data: bytes, begin: int, count: int) -> int | None:
    """The end of the ``count``-th token at or after ``begin``; None if there are fewer."""
    if count == 0:
        return begin
    characters = np.frombuffer(data, dtype=np.uint8)
    after_solid = False
    for block_begin in range(begin, len(data), _BLOCK):
        solid = ~is_blank(characters[block_begin : block_begin + _BLOCK])
        first = solid.copy()
        first[1:] &= ~solid[:-1]
        first[0] &= not after_solid
        after_solid = bool(solid[-1])
        found = int(np.count_nonzero(first))
        if found >= count:
            last = block_begin + int(np.flatnonzero(first)[count - 1])
            blank = _BLANK_CHARACTER.search(data, last)
            return blank.start() if blank else len(data)
        count -= found
    return None


def is_cut(rows: list[bytes]) -> bool:
    """True if the last of some rows of one kind is shorter than all others, three at least."""
    *others, last = [len(row.strip()) for row in rows if row.strip()] or [0]
    return len(others) >= _ROWS_ALIKE and last < min(others)


def write_replaced(
    file: BinaryIO, data: bytes, starts: np.ndarray, ends: np.ndarray, values: np.ndarray
) -> None:
    """Write ``data`` with the bytes from ``starts[i]`` to ``ends[i]`` replaced by the number ``values[i]``.

    The spans are ascending and do not overlap. Numbers get the fewest digits that read back exactly.
    """
    write_texts(file, data, starts, ends, (repr(value).encode() for value in map(float, values)))


def write_texts(
    file: BinaryIO, data: bytes, starts: np.ndarray, ends: np.ndarray, texts: Iterable[bytes]
) -> None:
    """Write ``data`` with the bytes from ``starts[i]`` to ``ends[i]`` replaced by the i-th of ``texts``.

    The spans are ascending and do not overlap.
    """
    done, remaining = 0, iter(texts)
    for chunk in range(0, len(starts), _CHUNK):
        gap_ends = starts[chunk : chunk + _CHUNK].tolist()
        token_ends = ends[chunk : chunk + _CHUNK].tolist()
        pieces = [b""] * (2 * len(gap_ends))
        pieces[0::2] = map(data.__getitem__, map(slice, [done, *token_ends[:-1]], gap_ends))
        pieces[1::2] = islice(remaining, len(gap_ends))
        file.write(b"".join(pieces))
        done = token_ends[-1]
    file.write(memoryview(data)[done:])


def fitted(value: float, width: int, exponent: str = "e") -> bytes:
    """The shortest text of at most ``width`` characters that reads back as ``value``, else the nearest one.

    It has a decimal point, so that no reader takes it for a whole number. exponent: what stands between
    digits and exponent: "e", "D", or nothing where a sign is enough ("1.5-3", as Nastran writes).
    Raises ValueError for a number that no text of this width comes near.
    """
    nearest, error = b"", math.inf
    for digits in range(17, 0, -1):
        for text in _spellings(value, digits, exponent):
            off = abs(float(text.replace(exponent, "e") if exponent else _with_e(text)) - value)
            if len(text) <= width and (off < error or (off == error and len(text) < len(nearest))):
                nearest, error = text.encode(), off
        if error == 0.0 and digits < 15:  # shorter ones are not equal, or were found already
            break
    if not nearest:
        raise ValueError(f"{value!r} does not fit {width} characters")
    return nearest


def _spellings(value: float, digits: int, exponent: str) -> list[str]:
    """Texts for ``value`` rounded to so many significant digits: positional, and with an exponent."""
    mantissa, power = f"{value:.{digits - 1}e}".split("e")
    mantissa = f"{mantissa.rstrip('0') if '.' in mantissa else mantissa}"
    mantissa = mantissa if "." in mantissa else f"{mantissa}."
    positional = f"{value:.{max(0, digits - 1 - int(power))}f}" if -20 < int(power) < 20 else ""
    if "." in positional:
        positional = positional.rstrip("0")
    elif positional:
        positional += "."
    positional = re.sub(r"^(-?)0\.(?=\d)", r"\1.", positional)
    sign = "-" if power[0] == "-" else "" if exponent else "+"
    texts = [f"{mantissa}{exponent}{sign}{power[1:].lstrip('0') or '0'}"]
    return [positional, *texts] if positional else texts


def _with_e(text: str) -> str:
    """The text of a number whose exponent is marked by its sign alone, as Python reads it."""
    return re.sub(r"(?<=[\d.])([+-])", r"e\1", text)


def shown(word: bytes | str) -> str:
    """A word of the file as it may appear in a message of one line: quoted, escaped, and not too long."""
    text = word if isinstance(word, str) else word[:64].decode("latin-1")
    return ascii(text if len(text) <= 40 else text[:40] + "...")


class Rows:
    """Some lines of a text file, cut into tokens.

    text: (m,) uint8, those lines one after the other, each with its line end.
    counts: (n,) number of tokens in each line.
    first: (n,) index of each line's first token.
    starts, ends: (t,) where each token lies in ``text``.
    """

    def __init__(self, characters: np.ndarray, line_starts: np.ndarray, line_ends: np.ndarray) -> None:
        """``characters``: the file, uint8; lines as ascending [start, end), the line end included."""
        self.text = characters[inside_spans(len(characters), line_starts, line_ends)]
        lengths = line_ends - line_starts
        self._text_starts = np.concatenate([[0], np.cumsum(lengths)])
        self._shift = line_starts - self._text_starts[:-1]
        self.starts, self.ends = token_spans(self.text)
        self.first = np.searchsorted(self.starts, self._text_starts[:-1])
        self.counts = np.diff(self.first, append=len(self.starts))

    def blank_out(self, starts: np.ndarray, ends: np.ndarray) -> None:
        """Overwrite ascending, disjoint spans [start, end) of ``text`` with blanks; tokens stay counted."""
        self.text[inside_spans(len(self.text), starts, ends)] = ord(" ")

    def numbers(self, count: int, dtype: type | np.dtype) -> np.ndarray:
        """The ``count`` numbers in all lines; ValueError if ``text`` holds anything else."""
        return parse_numbers(self.text.tobytes(), count, dtype)

    def line_numbers(self, line: int, count: int, dtype: type | np.dtype) -> np.ndarray:
        """The ``count`` numbers in one line; ValueError if it holds anything else."""
        begin, end = self._text_starts[line : line + 2]
        return parse_numbers(self.text[begin:end].tobytes(), count, dtype)

    def first_wrong(self, counts: np.ndarray, dtype: type | np.dtype) -> int:
        """The first line that does not hold ``counts`` (n,) numbers, one count a line; the last if all do."""
        for line, count in enumerate(counts.tolist()):
            try:
                self.line_numbers(line, count, dtype)
            except ValueError:
                return line
        return len(counts) - 1

    def source_spans(self, lines: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Begin and end in the file of the tokens number ``columns`` of ``lines``, (lines, columns) each."""
        tokens = self.first[lines, None] + columns
        shift = self._shift[lines, None]
        return self.starts[tokens] + shift, self.ends[tokens] + shift
