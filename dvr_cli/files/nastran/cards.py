"""Lines of bulk data, the cards they make up, and the fields of these.

A card is a line with its name in the first field, and the lines that go on with it: their first field is
blank or begins with ``+`` or ``*``. A line has ten fields, the last of which names its continuation:

    small    |name    |   1    |   2    | ... |   8    |+next   |      columns of 8
    large    |name*   |        1       | ... |        4       |*next   |      4 fields in columns of 16
    free     name,1,2,...,8,+next                                             commas anywhere (small or large)

Fields are found with NumPy for many cards at once.
"""

from __future__ import annotations

import re
from typing import NamedTuple, NoReturn

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.nastran.assembly import Assembly
from dvr_cli.files.numbers_in_text import is_blank, parse_numbers, shown

SMALL, LARGE = 8, 16  # columns of a field
_MARGIN = 96  # blanks behind the text, so that fields of the last lines may be looked at
_LONGEST = 40  # characters of a number
_CHUNK = 1 << 16  # cards whose fields are looked at in one go
_DECK = 72  # columns that hold data; what follows in columns marks the continuation
_REAL = np.zeros(256, dtype=bool)
_REAL[list(b"0123456789.+-eEdD ")] = True
_WHOLE = np.zeros(256, dtype=bool)
_WHOLE[list(b"0123456789+- ")] = True
_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eEdD]?[+-]?\d+)?")
_INTEGER = re.compile(rb"[+-]?\d+")


class Fields(NamedTuple):
    """The places of some fields of some cards, in positions of ``Deck.text``, all of shape (cards, fields).

    starts, stops: of the text in the field, blanks around it left out; equal for a blank field.
    begins, limits: the field itself; in columns where it begins and where it, or the line, ends.
    line: the line it is in, -1 where the card has too few lines.
    there: whether the line reaches that far.
    width: (cards, fields) its columns, SMALL or LARGE.
    free: whether it ends at a comma.
    """

    starts: np.ndarray
    stops: np.ndarray
    begins: np.ndarray
    limits: np.ndarray
    line: np.ndarray
    there: np.ndarray
    width: np.ndarray
    free: np.ndarray


class Deck:
    """The bulk data of a deck.

    text: the deck, uint8, behind it lines whose tabs have become blanks, and more blanks.
    start, stop: (L,) of the lines that hold anything, comments and blanks at the end left out.
    limit: (L,) where the comment or the end of each line begins. end: (L,) the end of the line.
    large: (L,) whether its fields have columns of 16.
    first: (C,) the first line of each card, count: (C,) how many it has.
    names: the distinct names of cards, in capitals. name: (C,) which of them each card has.
    """

    def __init__(self, deck: Assembly, begin: int, end: int) -> None:
        """The cards between the bytes ``begin`` and ``end`` of a deck; raises InputError."""
        self._deck = deck
        self._data = deck.data
        self.text = np.frombuffer(deck.data + b" " * _MARGIN, dtype=np.uint8)
        self._source = np.empty(0, dtype=np.int64)  # of what stands behind the deck, for lines with tabs
        self._cut_into_lines(begin, end)
        self._expand_tabs()
        self._sort_into_cards()

    def to_source(self, positions: np.ndarray) -> np.ndarray:
        """Positions in the deck of ``positions`` in ``text``."""
        beyond = np.asarray(positions) - len(self._data)
        if not len(self._source):
            return np.asarray(positions)
        return np.where(beyond <= 0, positions, self._source.take(beyond - 1, mode="clip"))

    def cards(self, *names: bytes) -> np.ndarray:
        """The cards with one of these names, ascending."""
        wanted = [i for i, name in enumerate(self.names) if name in names]
        return np.flatnonzero(np.isin(self.name, wanted))

    def fields(self, cards: np.ndarray, first: int, last: int, stripped: bool = True) -> Fields:
        """The places of the fields from number ``first`` up to ``last``, without it; 0 is behind the name.

        stripped: False: blanks around the text in a field count as text, which is quicker to find.
        Raises InputError for lines of too many fields and for lines that do not follow the one they continue.
        """
        n, m = len(cards), last - first
        start, stop, begin, limit, width, line = (np.zeros((n, m), dtype=np.int64) for _ in range(6))
        line -= 1
        width += SMALL
        free = np.zeros((n, m), dtype=bool)
        ahead = np.zeros(n, dtype=np.int64)  # fields in the lines so far
        for k in range(int(self.count[cards].max(initial=0))):
            rows = np.flatnonzero((self.count[cards] > k) & (ahead < last))
            if not len(rows):
                break
            here = self.first[cards[rows]] + k
            self._check_marks(here, k)
            room = np.where(self.large[here], 4, 8)
            columns = np.where(self.large[here], LARGE, SMALL)
            for j in range(8):
                to = ahead[rows] + j - first
                i = np.flatnonzero((j < room) & (to >= 0) & (to < m))
                if not len(i):
                    continue
                at, row, to = here[i], rows[i], to[i]
                line[row, to], width[row, to], free[row, to] = at, columns[i], self._free[at]
                begin[row, to], limit[row, to] = self._span(at, j, columns[i])
            ahead[rows] += room
        there = (line >= 0) & (begin <= limit)
        limit = np.maximum(begin, limit)
        start, stop = self._stripped(begin, limit) if stripped else (begin, limit)
        return Fields(start, stop, begin, limit, line, there, width, free)

    def integers(self, fields: Fields) -> np.ndarray:
        """The whole numbers in the fields, 0 for a blank one; raises InputError for anything else."""
        return self._numbers(fields, np.int64, _WHOLE, _INTEGER, "a whole number")

    def reals(self, fields: Fields) -> np.ndarray:
        """The numbers in the fields, 0.0 for a blank one; raises InputError for anything else."""
        return self._numbers(fields, np.float64, _REAL, _NUMBER, "a number")

    def whole(self, fields: Fields) -> np.ndarray:
        """The whole numbers, not negative, in the fields; -1 for a field that holds anything else."""
        starts, stops = fields.starts.ravel(), fields.stops.ravel()
        short = np.flatnonzero((stops > starts) & (stops - starts <= LARGE))
        place = starts[short, None] + np.arange(LARGE)
        digits = self.text.take(place, mode="clip")
        plain = ((digits >= ord("0")) & (digits <= ord("9"))) | (place >= stops[short, None])
        found = short[plain.all(axis=1)]
        numbers = np.full(len(starts), -1, dtype=np.int64)
        numbers[found] = self._parsed(starts[found], stops[found], np.int64, _WHOLE)
        return numbers.reshape(fields.starts.shape)

    def says(self, fields: Fields, word: bytes) -> np.ndarray:
        """True for fields that hold a word, given in capitals; bool, of their shape."""
        places = fields.starts[..., None] + np.arange(len(word))
        letters = self.text.take(places, mode="clip") & 0xDF  # without the bit that tells small ones
        as_long = fields.stops - fields.starts == len(word)
        return as_long & (letters == np.frombuffer(word, dtype=np.uint8)).all(axis=-1)

    def words(self, card: int, count: int) -> list[str]:
        """The text of the first ``count`` fields of one card."""
        fields = self.fields(np.array([card]), 0, count)
        pairs = zip(fields.starts[0].tolist(), fields.stops[0].tolist(), strict=True)
        return [self.text[a:b].tobytes().decode("latin-1") for a, b in pairs]

    def has_commas(self, cards: np.ndarray) -> bool:
        """True if a line that any of the cards begins or ends with has commas."""
        first = self.first[cards]
        return bool((self._free[first] | self._free[first + self.count[cards] - 1]).any())

    def commas(self, line: int) -> int:
        """The number of commas in a line."""
        return int(self._n_commas[line])

    def goes_on(self, line: int) -> bool:
        """True if a line asks for one that continues it, with a mark in its last field or a comma."""
        text = self.text[self.start[line] : self.stop[line]].tobytes()
        if self._free[line]:
            return text.endswith(b",") or self.commas(line) == (5 if self.large[line] else 9)
        return bool(text[_DECK:].strip())

    def refuse(self, line: int, why: str) -> NoReturn:
        """Raise InputError for what is wrong in a line."""
        raise InputError(f"{self._deck.line_at(int(self.to_source(self.start[line])))}: {why}")

    def _cut_into_lines(self, begin: int, end: int) -> None:
        text = self.text[begin:end]
        breaks = np.flatnonzero(text == ord("\n")) + begin
        if not len(breaks) or breaks[-1] != end - 1:
            breaks = np.append(breaks, end)
        start = np.concatenate([[begin], breaks[:-1] + 1])
        limit = breaks.copy()
        returns = (limit > start) & (self.text[limit - 1] == ord("\r"))
        limit[returns] -= 1
        ends = limit.copy()
        dollars = np.flatnonzero(text == ord("$")) + begin
        line = np.searchsorted(start, dollars, side="right") - 1
        first = np.diff(line, prepend=-1) > 0
        limit[line[first]] = dollars[first]
        stop = limit.copy()
        inside = np.arange(len(start))
        while len(inside):
            inside = inside[stop[inside] > start[inside]]
            inside = inside[is_blank(self.text[stop[inside] - 1])]
            stop[inside] -= 1
        filled = stop > start
        self.start, self.stop, self.limit, self.end = (a[filled] for a in (start, stop, limit, ends))
        commas = np.flatnonzero(text == ord(",")) + begin
        line, inside = self._lines_of(commas)
        self._commas = commas[inside]
        self._n_commas = np.bincount(line[inside], minlength=len(self.start))
        self._first_comma = np.cumsum(self._n_commas) - self._n_commas
        self._free = self._n_commas > 0

    def _lines_of(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The line that each position is in, and whether it is in the part of it that counts."""
        if not len(self.start):
            return np.zeros(len(positions), dtype=np.int64), np.zeros(len(positions), dtype=bool)
        line = np.searchsorted(self.start, positions, side="right") - 1
        return line, (line >= 0) & (positions < self.stop[line])

    def _expand_tabs(self) -> None:
        """Give lines in columns that have tabs a copy in which blanks stand for them, behind the deck."""
        tabs = np.flatnonzero(self.text[: len(self._data)] == ord("\t"))
        line, inside = self._lines_of(tabs)
        copies: list[bytes] = []
        sources: list[int] = []
        at = len(self._data)
        for i in np.unique(line[inside & ~self._free[line]] if len(tabs) else line).tolist():
            text = self._data[self.start[i] : self.limit[i]]
            columns: list[int] = []
            expanded = bytearray()
            for offset, character in enumerate(text):
                fill = SMALL - len(expanded) % SMALL if character == ord("\t") else 1
                expanded += b" " * fill if character == ord("\t") else bytes([character])
                columns += [int(self.start[i]) + offset] * fill
            copies.append(b" " + bytes(expanded))
            sources += [*columns, int(self.limit[i])]
            self.start[i], self.limit[i] = at + 1, at + 1 + len(expanded)
            self.stop[i] = self.start[i] + len(expanded.rstrip())
            self.end[i] = self.limit[i]
            at += len(copies[-1])
        if copies:
            whole = self._data + b"".join(copies) + b" " * _MARGIN
            self.text = np.frombuffer(whole, dtype=np.uint8)
            self._source = np.array(sources)

    def _sort_into_cards(self) -> None:
        columns = np.arange(SMALL)
        names = self.text[self.start[:, None] + columns]
        names[self.start[:, None] + columns >= self.stop[:, None]] = ord(" ")
        names = np.where(is_blank(names), ord(" "), names).astype(np.uint8)
        names[np.logical_or.accumulate(names == ord(","), axis=1)] = ord(" ")
        small = (names >= ord("a")) & (names <= ord("z"))
        names[small] -= 32
        head = names[np.arange(len(names)), (names != ord(" ")).argmax(axis=1)] if len(names) else names[:, 0]
        begins = (head >= ord("A")) & (head <= ord("Z"))
        continues = np.isin(head, np.frombuffer(b" +*", dtype=np.uint8))
        self.large = ((names == ord("*")).any(axis=1) & begins) | (head == ord("*"))
        if not (begins | continues).all():
            i = int(np.argmin(begins | continues))
            word = self.text[self.start[i] : self.stop[i]].tobytes()
            if head[i] == ord("="):
                self.refuse(i, "cards repeated by = are not supported")
            self.refuse(i, f"{shown(word)} begins no card: damaged, or not bulk data")
        if len(begins) and not begins[0]:
            self.refuse(0, "it continues a card, but there is none before it")
        self._marks = names
        self.first = np.flatnonzero(begins)
        self.count = np.diff(self.first, append=len(begins))
        self._name_cards(names[self.first])

    def _name_cards(self, names: np.ndarray) -> None:
        names = np.ascontiguousarray(np.where(names == ord("*"), ord(" "), names).astype(np.uint8))
        codes = names.view(np.uint64).ravel()
        distinct, first, self.name = np.unique(codes, return_index=True, return_inverse=True)
        self.names = [names[i].tobytes().strip() for i in first[: len(distinct)]]

    def _span(self, line: np.ndarray, j: int, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Begin and end of field j of each line; the end comes first where the line is too short."""
        begin = self.start[line] + SMALL + j * columns
        limit = np.minimum(begin + columns, self.limit[line])
        free = self._free[line]
        if free.any():
            i = line[free]
            comma = self._first_comma[i] + j
            has = j < self._n_commas[i]
            more = j + 1 < self._n_commas[i]
            after = self._commas.take(comma, mode="clip") + 1
            begin[free] = np.where(has, after, self.stop[i] + 1)
            limit[free] = np.where(more, self._commas.take(comma + 1, mode="clip"), self.stop[i])
        return begin, limit

    def _stripped(self, begin: np.ndarray, limit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        start, stop = begin.ravel().copy(), limit.ravel().copy()
        inside = np.arange(len(start))
        while len(inside):
            inside = inside[start[inside] < stop[inside]]
            inside = inside[is_blank(self.text[start[inside]])]
            start[inside] += 1
        inside = np.arange(len(start))
        while len(inside):
            inside = inside[start[inside] < stop[inside]]
            inside = inside[is_blank(self.text[stop[inside] - 1])]
            stop[inside] -= 1
        return start.reshape(begin.shape), stop.reshape(begin.shape)

    def _check_marks(self, lines: np.ndarray, k: int) -> None:
        """Raise InputError where a line has too many fields, or does not continue the one before it."""
        most = np.where(self.large[lines], 4, 8) + 1
        many = self._n_commas[lines] > most
        if many.any():
            self.refuse(int(lines[many.argmax()]), "too many fields, there is room for ten (large ones: six)")
        if k == 0:
            return
        wide = self.stop[lines - 1] - self.start[lines - 1] > _DECK
        for i in lines[(wide & ~self._free[lines - 1]) | (self._n_commas[lines - 1] == 9)].tolist():
            before = self.text[self.start[i - 1] : self.stop[i - 1]].tobytes()
            mark = before.split(b",")[9] if self._free[i - 1] else before[_DECK:]
            own = self._marks[i].tobytes().strip(b" +*")
            wanted = mark.upper().strip(b" +*\t")[: SMALL - 1]
            if wanted and own and wanted != own:
                self.refuse(
                    i, f"it does not continue the line before it, which asks for {shown(mark.strip())}"
                )

    def _numbers(
        self, fields: Fields, dtype: type, allowed: np.ndarray, pattern: re.Pattern[bytes], what: str
    ) -> np.ndarray:
        shape = fields.starts.shape
        starts, stops = fields.starts.ravel(), fields.stops.ravel()
        numbers: np.ndarray = np.empty(len(starts), dtype=dtype)
        for begin in range(0, len(starts), _CHUNK):
            span = slice(begin, begin + _CHUNK)
            try:
                numbers[span] = self._parsed(starts[span], stops[span], dtype, allowed)
            except ValueError:
                for i in range(begin, min(begin + _CHUNK, len(starts))):
                    word = self.text[starts[i] : stops[i]].tobytes().strip()
                    if word and (not pattern.fullmatch(word) or len(word) > _LONGEST):
                        self.refuse(int(fields.line.ravel()[i]), f"{shown(word)} is not {what}")
                self.refuse(
                    int(fields.line.ravel()[begin]), "its fields, or those of a card below, are too long"
                )
        return numbers.reshape(shape)

    def _parsed(self, starts: np.ndarray, stops: np.ndarray, dtype: type, allowed: np.ndarray) -> np.ndarray:
        """The numbers between ``starts`` and ``stops``; ValueError if there is anything else."""
        width = int((stops - starts).max(initial=1))
        if width > (18 if dtype is np.int64 else _LONGEST):
            raise ValueError("too long")
        place = starts[:, None] + np.arange(width)
        characters = np.where(place < stops[:, None], self.text.take(place, mode="clip"), ord(" "))
        characters[is_blank(characters)] = ord(" ")
        if not allowed[characters].all():
            raise ValueError("a strange character")
        rows = np.full((len(starts), width + 2), ord(" "), dtype=np.uint8)
        rows[:, :width] = characters
        rows[(characters == ord(" ")).all(axis=1), 0] = ord("0")
        if dtype is not np.int64:
            _mark_exponents(rows)
        return parse_numbers(rows.tobytes(), len(starts), dtype)


def _mark_exponents(rows: np.ndarray) -> None:
    """Write exponents with an e: 1.5-3 and 1.5D-3 become 1.5e-3; the last column is free for it."""
    rows[np.isin(rows, np.frombuffer(b"dDE", dtype=np.uint8))] = ord("e")
    sign = (rows == ord("+")) | (rows == ord("-"))
    before = np.zeros_like(sign)
    before[:, 1:] = (rows[:, :-1] == ord(".")) | ((rows[:, :-1] >= ord("0")) & (rows[:, :-1] <= ord("9")))
    sign &= before
    i = np.flatnonzero(sign.any(axis=1))
    at = sign[i].argmax(axis=1)[:, None]
    columns = np.arange(rows.shape[1])
    longer = np.take_along_axis(rows[i], np.maximum(columns - (columns > at), 0), axis=1)
    np.put_along_axis(longer, at, ord("e"), axis=1)
    rows[i] = longer
