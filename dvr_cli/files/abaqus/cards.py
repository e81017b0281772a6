"""The cards of a deck: a keyword line with its options, and the data lines that follow it.

A keyword line begins with one asterisk, a comment with two. Other files stand in place of the *INCLUDE that
names them, or are the data lines of the *NODE or *ELEMENT whose option INPUT names them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import inside_spans, is_cut, shown
from dvr_cli.files.source import InputFile

_NEWLINE, _STAR = ord("\n"), ord("*")
_DEEPEST = 32  # files that include one another
_WITH_ROWS = ("NODE", "ELEMENT", "NSET", "ELSET")  # of numbers, which may be in another file
_OPTION = re.compile(r'(?:"[^"]*"|[^",])+')
# What goes on behind a comma at the end of a keyword line: an option, not the first data line.
_MORE_OPTIONS = re.compile(
    rb"\s*([A-Za-z][A-Za-z \t]*=|(GENERATE|UNSORTED|INTERNAL)\s*(,|\Z))", re.IGNORECASE
)
_ENCODED = (b"\xff\xfe", b"\xfe\xff")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class Piece(NamedTuple):
    """Lines from ``begin`` to ``end`` of the deck's file number ``file``."""

    file: int
    begin: int
    end: int


@dataclass
class Card:
    """A keyword with what belongs to it.

    keyword: in capitals and without blanks, as programs compare it.
    options: by name, in capitals and without blanks; those without a value have "".
    line: where its keyword line stands.
    data: its data lines.
    """

    keyword: str
    options: dict[str, str]
    line: Piece
    data: list[Piece] = field(default_factory=list)


@dataclass
class Inclusion:
    """The place where a file takes in another one: for the keyword line, or behind it as its data lines."""

    line: Piece
    file: int
    keyword: str


class DeckFile:
    """A file of a deck.

    name: as the deck names it, relative to the first file's folder; Path() for the first file itself.
    data: its bytes. text: the same, uint8, with comments blanked and all lines ending in a line feed.
    """

    def __init__(self, name: Path, data: bytes) -> None:
        """Raises InputError for another encoding."""
        if data.startswith(_ENCODED):
            raise InputError("the text is encoded as UTF-16; save it as UTF-8")
        self.name = name
        self.data = data
        text = bytearray(data.replace(b"\r\n", b" \n").replace(b"\r", b"\n") + b"\n")
        if data.startswith(_BYTE_ORDER_MARK):
            text[:3] = b"   "
        self.text = np.frombuffer(text, dtype=np.uint8)
        newlines = np.flatnonzero(self.text == _NEWLINE)
        starts = np.concatenate([[0], newlines[:-1] + 1])
        stars = np.flatnonzero(self.text == _STAR)
        line = np.searchsorted(starts, stars, side="right") - 1
        first = np.diff(line, prepend=-1) > 0
        stars, line = stars[first], line[first]
        indented = np.flatnonzero(stars > starts[line]).tolist()
        kept = np.ones(len(stars), dtype=bool)
        for i in indented:
            kept[i] = not text[starts[line[i]] : stars[i]].strip()
        stars, line = stars[kept], line[kept]
        comment = self.text[stars + 1] == _STAR
        if comment.any():
            hidden = line[comment]
            self.text[inside_spans(len(text), starts[hidden], newlines[hidden])] = ord(" ")
        self._keyword_lines = line[~comment]
        self._starts, self._ends = starts, newlines + 1

    def keyword_lines(self) -> list[tuple[int, int]]:
        """Begin and end of each keyword line, together with those it goes on in."""
        spans = []
        for line in self._keyword_lines.tolist():
            last = line
            while self._goes_on(last):
                last += 1
            spans.append((int(self._starts[line]), int(self._ends[last])))
        return spans

    def _goes_on(self, line: int) -> bool:
        if line + 1 == len(self._starts) or not self.line(line).endswith(b","):
            return False
        following = self.line(line + 1)
        return not following.startswith(b"*") and _MORE_OPTIONS.match(following) is not None

    def line(self, line: int) -> bytes:
        """A line without the blanks around it."""
        return self.text[self._starts[line] : self._ends[line]].tobytes().strip()

    def line_number(self, position: int) -> int:
        """The number, from 1, of the line at a position."""
        return int(np.searchsorted(self._starts, position, side="right"))

    def breaks_off(self, begin: int, end: int) -> bool:
        """True if rows end with the file, in one that has no end and is shorter than all others."""
        if end != len(self.text) or self.data.endswith((b"\n", b"\r")):
            return False
        return is_cut(self.text[begin:end].tobytes().splitlines())

    def blank(self, begin: int, end: int) -> bool:
        """True if nothing stands between two positions."""
        return not self.text[begin:end].tobytes().strip()


class Deck:
    """A deck as read: its cards in order, its files, the first one first, and where each takes in others."""

    def __init__(self, file: InputFile) -> None:
        """Raises InputError for what is no deck, or one whose files are not all there."""
        self.cards: list[Card] = []
        self.files: list[DeckFile] = [DeckFile(Path(), file.data)]
        self.inclusions: list[Inclusion] = []
        self._input = file
        self._take_in(0, 0)

    def place(self, file: int, position: int) -> str:
        """Words for a place in a file."""
        owner = self.files[file]
        return (
            f"{shown(str(owner.name))[1:-1]}, line " * bool(file)
            + "line " * (not file)
            + str(owner.line_number(position))
        )

    def _take_in(self, number: int, depth: int) -> None:
        """Append the cards of a file to those so far; what precedes its first belongs to the last."""
        if depth > _DEEPEST:
            raise InputError(f"files include one another more than {_DEEPEST} deep")
        file = self.files[number]
        lines = file.keyword_lines()
        begins = [begin for begin, _ in lines] + [len(file.text)]
        self._append(Piece(number, 0, begins[0]))
        for (begin, end), following in zip(lines, begins[1:], strict=True):
            keyword, options = self._parsed(number, begin, end)
            line = Piece(number, begin, end)
            if keyword == "INCLUDE":
                if "INPUT" not in options or "PASSWORD" in options:
                    what = "is encrypted" if "PASSWORD" in options else "names no file (INPUT=)"
                    raise InputError(f"{self.place(number, begin)}: *INCLUDE {what}")
                self._take_in(self._opened(line, keyword, options["INPUT"]), depth + 1)
            else:
                card = Card(keyword, options, line)
                self.cards.append(card)
                if options.get("INPUT") and keyword in _WITH_ROWS:
                    other = self._opened(line, keyword, options["INPUT"])
                    if self.files[other].keyword_lines():
                        where = self.place(number, begin)
                        raise InputError(f"{where}: {shown(options['INPUT'])} should hold data lines only")
                    self._append(Piece(other, 0, len(self.files[other].text)))
            self._append(Piece(number, end, following))

    def _append(self, piece: Piece) -> None:
        """Give data lines to the last card."""
        if self.files[piece.file].blank(piece.begin, piece.end):
            return
        if not self.cards:
            raise InputError(f"{self.place(piece.file, piece.begin)}: no keyword (as *NODE) stands before it")
        card, file = self.cards[-1], self.files[piece.file]
        if card.keyword in _WITH_ROWS and file.breaks_off(piece.begin, piece.end):
            raise InputError(
                f"{self.place(piece.file, piece.end - 1)}: it breaks off within a row of *{card.keyword}, "
                "which is shorter than all others: truncated; if it is whole, end that line"
            )
        card.data.append(piece)

    def _parsed(self, number: int, begin: int, end: int) -> tuple[str, dict[str, str]]:
        text = self.files[number].text[begin:end].tobytes().decode("utf-8", "replace")
        parts = _OPTION.findall(text.replace("\n", " ").strip()[1:])
        keyword, *options = parts or [""]
        named = {}
        for option in options:
            name, _, value = option.partition("=")
            named["".join(name.split()).upper()] = value.strip().strip('"').strip()
        named.pop("", None)
        return "".join(keyword.split()).upper(), named

    def _opened(self, line: Piece, keyword: str, name: str) -> int:
        """The number of a file, newly read, that ``line`` names."""
        path = Path(name if self._input.path is None else name.replace("\\", "/"))
        data = self._input.beside(path)
        self.inclusions.append(Inclusion(line, len(self.files), keyword))
        self.files.append(DeckFile(path, data))
        if len(self.files) > 1000:
            raise InputError("more than 1000 files are included")
        return len(self.files) - 1
