"""Numbers in text files: find them, parse many at once, replace some and leave every other byte alone.

Shared by the formats that may be text (legacy VTK, OBJ, TetGen).
"""

from __future__ import annotations

import re
import warnings
from typing import BinaryIO

import numpy as np

_BLANK = np.zeros(256, dtype=bool)
_BLANK[list(b" \t\n\v\f\r")] = True
_BLOCK = 1 << 22  # bytes looked at in one go when counting tokens
_CHUNK = 1 << 16  # tokens replaced in one go when writing


def is_blank(characters: np.ndarray) -> np.ndarray:
    """Which of the uint8 ``characters`` (any shape) are white space."""
    return _BLANK[characters]


def parse_numbers(text: bytes, count: int, dtype: type | np.dtype) -> np.ndarray:
    """The ``count`` blank-separated numbers in ``text`` as an array of ``dtype``.

    Raises ValueError if there are more or fewer, or something in it is no number.
    """
    if count == 0 and not text.strip():
        return np.empty(0, dtype=dtype)
    with warnings.catch_warnings():
        # NumPy only warns when it stops in front of something that is no number.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            numbers = np.fromstring(text, dtype=dtype, sep=" ")
        except DeprecationWarning:
            raise ValueError("not a number") from None
    if len(numbers) != count:
        raise ValueError("not a number")
    return numbers


def token_spans(text: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts and ends of the runs of non-blank characters in ``text`` (uint8), two (n,) arrays."""
    solid = np.zeros(len(text) + 2, dtype=bool)
    np.logical_not(is_blank(text), out=solid[1:-1])
    edges = np.flatnonzero(solid[1:] != solid[:-1])
    return edges[0::2], edges[1::2]


def end_of_tokens(data: bytes, begin: int, count: int) -> int | None:
    """Where the ``count``-th token at or after ``begin`` ends; None if there are fewer."""
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
            blank = re.compile(rb"\s").search(data, last)
            return blank.start() if blank else len(data)
        count -= found
    return None


def write_replaced(
    file: BinaryIO, data: bytes, starts: np.ndarray, ends: np.ndarray, values: np.ndarray
) -> None:
    """Write ``data`` with the bytes from ``starts[i]`` to ``ends[i]`` replaced by the number ``values[i]``.

    The spans are ascending and do not overlap. Numbers get the fewest digits that read back exactly.
    """
    done = 0
    for chunk in range(0, len(starts), _CHUNK):
        gap_ends = starts[chunk : chunk + _CHUNK].tolist()
        token_ends = ends[chunk : chunk + _CHUNK].tolist()
        pieces = [b""] * (2 * len(gap_ends))
        pieces[0::2] = map(data.__getitem__, map(slice, [done, *token_ends[:-1]], gap_ends))
        pieces[1::2] = [repr(value).encode() for value in values[chunk : chunk + _CHUNK].tolist()]
        file.write(b"".join(pieces))
        done = token_ends[-1]
    file.write(memoryview(data)[done:])


class Rows:
    """Some lines of a text file, cut into tokens.

    text: (m,) uint8, those lines one after the other, each with its line end; may be overwritten
        before ``numbers`` is called to blank out what is no number.
    counts: (n,) number of tokens in each line.
    first: (n,) index of each line's first token.
    starts, ends: (t,) where each token lies in ``text``.
    """

    def __init__(self, characters: np.ndarray, line_starts: np.ndarray, line_ends: np.ndarray) -> None:
        """``characters``: the file, uint8; lines as ascending [start, end), the line end included."""
        inside = np.zeros(len(characters) + 1, dtype=np.int8)
        np.add.at(inside, line_starts, 1)
        np.add.at(inside, line_ends, -1)
        np.cumsum(inside, dtype=np.int8, out=inside)
        self.text = characters[inside[:-1].view(bool)]
        lengths = line_ends - line_starts
        text_starts = np.cumsum(lengths) - lengths
        self._shift = line_starts - text_starts
        self.starts, self.ends = token_spans(self.text)
        self.first = np.searchsorted(self.starts, text_starts)
        self.counts = np.diff(self.first, append=len(self.starts))

    def numbers(self, count: int, dtype: type | np.dtype) -> np.ndarray:
        """The ``count`` numbers in all lines; ValueError if ``text`` holds anything else."""
        return parse_numbers(self.text.tobytes(), count, dtype)

    def source_spans(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where the tokens number ``columns`` ((k,)) of each line lie in the file: two (n, k) arrays."""
        tokens = self.first[:, None] + columns
        shift = self._shift[:, None]
        return self.starts[tokens] + shift, self.ends[tokens] + shift
