"""A deck with the files it includes: one text, of which each stretch knows its file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import is_cut, shown
from dvr_cli.files.source import InputFile

_INCLUDE = re.compile(
    rb"^[ \t]*include\b[ \t]*=?[ \t]*(?:'([^']*)'|\"([^\"]*)\"|([^\s'\"$]+))", re.IGNORECASE | re.MULTILINE
)
_HEAD = re.compile(rb"[A-Za-z]\w*\*?|[+*]")  # the name of a card, or the mark of a line that goes on
_DEEPEST = 16  # files that include one another


def statements(lower: bytes, word: bytes, begin: int = 0) -> Iterator[int]:
    """The positions of ``word`` where it begins a line, blanks aside, in a text in lower case.

    A pattern would be slower.
    """
    at = lower.find(word, begin)
    while at >= 0:
        line = lower.rfind(b"\n", 0, at) + 1
        if not lower[line:at].strip(b" \t") and not lower[at + len(word) : at + len(word) + 1].isalnum():
            yield at
        at = lower.find(word, at + len(word))


class Part(NamedTuple):
    """One of the files: its path as the deck names it, None for the deck itself, and its bytes."""

    name: str | None
    data: bytes


class Assembly:
    """A deck and what it includes.

    data: one text, where each INCLUDE is followed by what it includes and itself is blank. Lines end in a
        line feed, before which there may be a return.
    parts: the files, the deck itself first.
    """

    def __init__(self, file: InputFile) -> None:
        """Raises InputError for what is missing, or includes itself."""
        self.parts: list[Part] = []
        self._file = file
        self._pieces: list[bytes] = []
        self._segments: list[tuple[int, int, int]] = []  # where it begins in data, its part, where there
        self._add(Part(None, file.data), [])
        self.data = b"".join(self._pieces)
        self._begin, self._part, self._offset = np.array(self._segments, dtype=np.int64).reshape(-1, 3).T
        del self._pieces

    def line_at(self, position: int) -> str:
        """The line at a position in ``data`` in words: its number, as an editor counts, and its file."""
        segment = int(np.searchsorted(self._begin, position, side="right")) - 1
        part = self.parts[int(self._part[segment])]
        own = position - int(self._begin[segment]) + int(self._offset[segment])
        number = part.data.count(b"\n" if b"\n" in part.data else b"\r", 0, own) + 1
        return f"line {number}" if part.name is None else f"line {number} of {part.name}"

    def located(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The part that each position in ``data`` is in, and where there."""
        segment = np.searchsorted(self._begin, positions, side="right") - 1
        return self._part[segment], positions - self._begin[segment] + self._offset[segment]

    def _add(self, part: Part, within: list[str | None]) -> None:
        """Append a file and what it includes; within: the files that include it."""
        if part.name in within or len(within) > _DEEPEST:
            raise InputError(f"{part.name} includes itself")
        number = len(self.parts)
        self.parts.append(part)
        text = part.data if b"\n" in part.data else part.data.replace(b"\r", b"\n")
        lower = text.lower()
        end = next(statements(lower, b"enddata"), len(text))
        if part.name is not None and end == len(text) and _breaks_off(text):
            raise InputError(
                f"{part.name} breaks off within its last line, which is shorter than all like it: truncated; "
                "if it is whole, end that line"
            )
        done = 0
        for match in _INCLUDE.finditer(text, 0, end) if b"include" in lower else ():
            self._append(number, done, text[done : match.start()] + re.sub(rb"[^\r\n]", b" ", match[0]))
            done = match.end()
            name = _name(match[1] or match[2] or match[3] or b"")
            self._append(number, done, b"\n")  # what is included may begin behind a whole line only
            self._add(Part(name, self._file.beside(name)), [*within, part.name])
            self._append(number, done, b"\n")
        self._append(number, done, text[done:])

    def _append(self, part: int, offset: int, piece: bytes) -> None:
        self._segments.append((sum(map(len, self._pieces)), part, offset))
        self._pieces.append(piece)


def _breaks_off(text: bytes) -> bool:
    """True if the last line has no end and is shorter than all that begin with the same word or mark."""
    if text.endswith(b"\n"):
        return False
    lines = [line.split(b"$")[0].rstrip() for line in text.split(b"\n")]
    head = _HEAD.match(lines[-1])
    return head is not None and is_cut(
        [line for line in lines if (m := _HEAD.match(line)) and m[0] == head[0]]
    )


def _name(quoted: bytes) -> str:
    """The path in an INCLUDE, which may be spread over several lines."""
    path = b"".join(line.strip() for line in quoted.splitlines()).replace(b"\\", b"/")
    try:
        name = path.decode("utf-8")
    except UnicodeDecodeError:
        name = ""
    if not name or not name.isprintable():
        raise InputError(f"INCLUDE names no file: {shown(path)}")
    return name
