"""The datasets of a universal file: where each is, its lines and the numbers in them.

    -1                  begins and ends a dataset
  2411                  what it is
...
    -1
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import Rows, is_blank, shown

_BAR = re.compile(rb"^[ \t]*-1[ \t]*\r?$", re.MULTILINE)
_NAME = re.compile(rb"\s*(\d{1,6}\w?)\b[^\n]*\n?")
FORTRAN = bytes.maketrans(b"Dd", b"EE")  # exponents as C writes them


@dataclass(frozen=True)
class Dataset:
    """number: what it is ("2411"). begin, end: where its lines are in the file."""

    number: str
    begin: int
    end: int


class UniversalFile:
    """A file cut into datasets."""

    def __init__(self, data: bytes) -> None:
        """Raises InputError for what is no universal file, or ends within a dataset."""
        self.data = data
        self._text = np.frombuffer(bytearray(data.translate(FORTRAN) + b"\n"), dtype=np.uint8)
        bars = [match.span() for match in _BAR.finditer(data)]
        if not bars or data[: bars[0][0]].strip():
            raise InputError("not a universal file: it does not begin with a line -1")
        self.datasets: list[Dataset] = []
        for opening, closing in zip(bars[::2], bars[1::2], strict=False):
            name = _NAME.match(data, opening[1], closing[0])
            if name is None:
                raise InputError(f"{self.line_at(opening[1])}: a dataset without a number")
            self.datasets.append(Dataset(name[1].decode(), name.end(), closing[0]))
        for closing, opening in zip(bars[1::2], [*bars[2::2], (len(data), 0)], strict=False):
            if data[closing[1] : opening[0]].strip():
                raise InputError(
                    f"{self.line_at(closing[1] + 1)}: there is something outside of the datasets"
                )
        if len(bars) % 2:
            raise InputError("its last dataset does not end with a line -1: truncated or damaged")

    def of(self, *numbers: str) -> list[Dataset]:
        """The datasets with one of these numbers."""
        return [dataset for dataset in self.datasets if dataset.number in numbers]

    def line_at(self, position: int) -> str:
        """The line at a position in words."""
        before = self.data.count(b"\n", 0, position)
        return f"line {before + 1}"

    def lines(self, dataset: Dataset) -> tuple[np.ndarray, np.ndarray]:
        """Begin and end of its lines that are not blank, their line ends included."""
        text = self._text[dataset.begin : dataset.end]
        if not len(text):
            return np.empty(0, np.int64), np.empty(0, np.int64)
        ends = np.flatnonzero(text == ord("\n")) + 1
        ends = ends if len(ends) and ends[-1] == len(text) else np.append(ends, len(text))
        starts = np.concatenate([[0], ends[:-1]])
        filled = np.add.reduceat(~is_blank(text), starts, dtype=np.int64) > 0
        return starts[filled] + dataset.begin, ends[filled] + dataset.begin

    def rows(self, starts: np.ndarray, ends: np.ndarray) -> Rows:
        """Some lines, cut into words; D of exponents has become E."""
        return Rows(self._text, starts, ends)

    def numbers(self, dataset: Dataset, rows: Rows, dtype: type) -> np.ndarray:
        """All numbers in some rows of a dataset; InputError says where there is something else."""
        try:
            return rows.numbers(int(rows.counts.sum()), dtype)
        except ValueError:
            line = rows.first_wrong(rows.counts, dtype)
            first, last = rows.source_spans(np.array([line]), np.array([0, rows.counts[line] - 1]))
            words = self.data[int(first[0, 0]) : int(last[0, 1])]
            raise InputError(
                f"{self.line_at(int(first[0, 0]))}: {shown(words)} is not what dataset {dataset.number} has"
            ) from None
