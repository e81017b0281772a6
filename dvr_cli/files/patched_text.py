"""Text files of rows of numbers: their lines without comments, and a source that replaces numbers in them."""

from __future__ import annotations

import re
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import Rows, is_blank, shown, write_replaced
from dvr_cli.files.source import Source, differing
from dvr_cli.mesh.mesh import Mesh

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class PatchedText(Source):
    """A text file with the spans of bytes that hold its coordinates ((N, d) starts and ends)."""

    def __init__(self, name: str, data: bytes, mesh: Mesh, starts: np.ndarray, ends: np.ndarray) -> None:
        """name: that of its format."""
        super().__init__()
        self.format = name
        self.mesh = mesh
        self._data = data
        self._points = mesh.points.copy()  # as read, whatever becomes of the mesh
        self._starts = starts
        self._ends = ends

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the file with the coordinates ``points`` ((N, d))."""
        changed = differing(points, self._points)
        write_replaced(file, self._data, self._starts[changed], self._ends[changed], points[changed])


class TextLines:
    """The lines of a file that are not blank once its comments are.

    text: (m,) uint8, the file with blanks for its comments, in their places.
    starts, ends: (n,) where each of the lines lies in ``text``, its line end included.
    """

    def __init__(self, data: bytes, comment: re.Pattern[bytes]) -> None:
        text = comment.sub(lambda match: b" " * len(match.group()), data)
        if text.startswith(_BYTE_ORDER_MARK):
            text = b"   " + text[3:]
        self.text = np.frombuffer(bytearray(text + b"\n"), dtype=np.uint8)
        ends = np.flatnonzero((self.text == ord("\n")) | (self.text == ord("\r"))) + 1
        starts = np.concatenate([[0], ends[:-1]])
        filled = np.add.reduceat(~is_blank(self.text), starts, dtype=np.int64) > 0
        self.starts, self.ends = starts[filled], ends[filled]
        self._data = data

    def __len__(self) -> int:
        return len(self.starts)

    def words(self, line: int) -> list[bytes]:
        """The words of a line."""
        return self.text[self.starts[line] : self.ends[line]].tobytes().split()

    def rows(self, first: int, count: int, least: int, what: str) -> Rows:
        """``count`` lines from ``first`` on; InputError if the file ends early, or one has too few words.

        least: how many words each has to have. what: each line is, for messages.
        """
        if count > len(self) - first:
            raise InputError(
                f"{count} lines, one for each {what}, should follow, but there are {len(self) - first}"
            )
        rows = Rows(self.text, self.starts[first : first + count], self.ends[first : first + count])
        short = rows.counts < least
        if short.any():
            raise self.refusal(first + int(short.argmax()), f"{least} numbers are needed for a {what}")
        return rows

    def numbers(self, rows: Rows, first: int, dtype: type, blanked: int = 0) -> np.ndarray:
        """All numbers in the rows, the lines from ``first`` on; InputError names a line without.

        blanked: how many words of each row have been blanked out.
        """
        try:
            return rows.numbers(int(rows.counts.sum()) - blanked * len(rows.counts), dtype)
        except ValueError:
            line = rows.first_wrong(rows.counts - blanked, dtype)
            raise self.refusal(first + line, "not numbers of the kind that belongs here") from None

    def refusal(self, line: int, why: str) -> InputError:
        """An error that names a line, by the number an editor gives it, and shows it."""
        before = self._data[: int(self.starts[line])]
        number = len(re.findall(rb"\r\n|\r|\n", before)) + 1
        return InputError(f"line {number}: {why}: {shown(b' '.join(self.words(line)))}")
