"""Data lines, cut into fields at their commas: many lines at once, by NumPy."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import parse_numbers, shown, token_spans

_COMMA, _NEWLINE, _BLANK = b",\n "
_WITHOUT_E = re.compile(rb"(?<=[\d.])([+-]\d)")
_LARGEST = float(1 << 53)


class Fields:
    """Some data lines.

    starts, ends: (t,) where in the file each token lies; a token is what stands in a field that is not empty.
    counts, first: (n,) the number of tokens in each line that holds anything, and the index of its first.
    goes_on: (n,) bool, the lines that end in a comma.
    odd: (n,) bool, the lines with empty fields, or with more in a field than one token.
    """

    def __init__(self, text: np.ndarray, begin: int, end: int, place: Callable[[int], str]) -> None:
        """text: the file, uint8; place: words for a position in it."""
        self._place = place
        self._begin = begin
        self._text = text[begin:end]
        self._block = self._text.copy()
        commas = np.flatnonzero(self._block == _COMMA)
        self._block[commas] = _BLANK
        line_ends = np.flatnonzero(self._block == _NEWLINE)
        line_starts = np.concatenate([[0], line_ends[:-1] + 1])
        starts, ends = token_spans(self._block)
        first = np.searchsorted(starts, line_starts)
        counts = np.diff(first, append=len(starts))
        first_comma = np.searchsorted(commas, line_starts)
        n_commas = np.diff(first_comma, append=len(commas))
        filled = (counts > 0) | (n_commas > 0)
        self.first, self.counts, self._commas = first[filled], counts[filled], n_commas[filled]
        self._line_starts, self._line_ends = line_starts[filled], line_ends[filled]
        before = np.searchsorted(commas, starts)  # commas in front of each token
        wrong = np.diff(before, prepend=0) != 1
        some = self.counts > 0
        wrong[self.first[some]] = before[self.first[some]] != first_comma[filled][some]
        self.odd = ~some | ((self._commas - self.counts + 1) >> 1 != 0)
        self.odd[np.searchsorted(self.first, np.flatnonzero(wrong), side="right") - 1] = True
        self.goes_on = self._commas == self.counts
        last_comma = commas[(first_comma + n_commas - 1)[filled]] if len(commas) else np.zeros(len(some), int)
        last_token = np.where(some, ends[(self.first + self.counts - 1) * some], 0) if len(ends) else 0
        content = np.maximum(np.where(self._commas > 0, last_comma + 1, 0), last_token)
        self._content_ends = content
        self.starts, self.ends = starts + begin, ends + begin

    def place(self, line: int) -> str:
        """Words for where a line stands."""
        return self._place(self._begin + int(self._line_starts[line]))

    def line(self, line: int) -> bytes:
        """A line as it stands but for its commas, which are blanks."""
        return self._block[self._line_starts[line] : self._line_ends[line]].tobytes()

    def words(self, line: int) -> list[str]:
        """The texts in the fields of a line, without empty ones."""
        return [word.decode("utf-8", "replace") for word, _, _ in self.split(line) if word]

    def split(self, line: int) -> list[tuple[bytes, int, int]]:
        """The fields of a line, without blanks around them, and where in the file each begins and ends."""
        content = self._text[self._line_starts[line] : self._line_ends[line]].tobytes()
        begin = self._begin + int(self._line_starts[line])
        fields = []
        for part in content.split(b","):
            inner = part.strip()
            at = begin + (part.find(inner) if inner else len(part))
            fields.append((inner, at, at + len(inner)))
            begin += len(part) + 1
        return fields

    def content_ends(self) -> np.ndarray:
        """(n,) where in the file the last field of each line ends, or the last comma."""
        return self._content_ends + self._begin

    def check(self) -> None:
        """Raise InputError if a line is odd."""
        if self.odd.any():
            line = int(np.argmax(self.odd))
            raise InputError(f"{self.place(line)}: numbers have to be separated by one comma each")

    def integers(self) -> np.ndarray:
        """(t,) the tokens as whole numbers; raises InputError if one is none."""
        try:
            return parse_numbers(self._block.tobytes(), len(self.starts), np.int64)
        except (ValueError, OverflowError):
            raise InputError(self._no_number(rb"[+-]?\d{1,18}", "whole number")) from None

    def floats(self) -> np.ndarray:
        """(t,) the tokens as numbers, NaN in odd lines; raises InputError if one is none."""
        block = self._block.copy()
        for line in np.flatnonzero(self.odd):
            block[self._line_starts[line] : self._line_ends[line]] = _BLANK
        block[(block | 32) == ord("d")] = ord("e")  # as Fortran writes double precision
        even = np.repeat(~self.odd, self.counts)
        text = block.tobytes()
        values = np.full(len(self.starts), np.nan)
        try:
            values[even] = parse_numbers(text, int(even.sum()), np.float64)
        except ValueError:
            try:
                values[even] = parse_numbers(_WITHOUT_E.sub(rb"e\1", text), int(even.sum()), np.float64)
            except ValueError:
                raise InputError(
                    self._no_number(rb"[+-]?(\d+\.?\d*|\.\d+)([eEdD]?[+-]?\d+)?", "number")
                ) from None
        return values

    def _no_number(self, pattern: bytes, what: str) -> str:
        """The message for the first token that is not of a pattern."""
        for line in range(len(self.counts)):
            for token in self.line(line).split():
                if not re.fullmatch(pattern, token):
                    return f"{self.place(line)}: {shown(token)} is no {what}"
        return f"{self.place(0)}: a {what} is expected"


def number(text: bytes) -> float:
    """A number as Fortran reads it; raises ValueError."""
    if not re.fullmatch(rb"[+-]?(\d+\.?\d*|\.\d+)([eEdD]?[+-]?\d+)?", text):
        raise ValueError("no number")
    plain = text.lower().replace(b"d", b"e")
    return float(plain if b"e" in plain else _WITHOUT_E.sub(rb"e\1", plain))


def node_ids(values: np.ndarray, fields: Fields) -> np.ndarray:
    """(n,) the node numbers at the head of each line; raises InputError for what cannot be one."""
    bad = ~((values > 0) & (values < _LARGEST) & (values == np.rint(values)))
    if bad.any():
        line = int(np.argmax(bad))
        raise InputError(f"{fields.place(line)}: a node number is expected first")
    return values.astype(np.int64)
