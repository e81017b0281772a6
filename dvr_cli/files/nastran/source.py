"""From a deck to a mesh, and back with other coordinates in its GRID cards."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from dvr_cli.errors import InputError, OutputError
from dvr_cli.files.nastran.assembly import Assembly, statements
from dvr_cli.files.nastran.cards import LARGE, SMALL, Deck, Fields
from dvr_cli.files.nastran.columns import field_text, value_of
from dvr_cli.files.nastran.contents import beyond_mesh
from dvr_cli.files.nastran.elements import check_supported, read_elements
from dvr_cli.files.nastran.holding import held_vertices
from dvr_cli.files.numbers_in_text import write_texts
from dvr_cli.files.source import InputFile, Source, differing
from dvr_cli.files.tags import TagIndex, first_repeated
from dvr_cli.mesh.mesh import Cells, Mesh

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_SYSTEMS = {b"R": "rectangular", b"C": "cylindrical", b"S": "spherical"}
_FREE_DIGITS = 24  # as many characters as any number needs


class Change(NamedTuple):
    """A stretch of the assembly that is replaced."""

    start: int
    stop: int
    text: str


class NastranSource(Source):
    """A deck, with the places of its coordinates."""

    format = "nastran"
    wider = "coordinates are stored in columns of 16 (GRID*), as rounding them would lower the quality"

    def __init__(
        self, file: InputFile, assembly: Assembly, deck: Deck, mesh: Mesh, cards: np.ndarray, fields: Fields
    ) -> None:
        """cards: (N,) the GRID card of each vertex; fields: (N, 3) its coordinates."""
        super().__init__()
        self.mesh = mesh
        self._file = file
        self._assembly = assembly
        self._deck = deck
        self._cards = cards
        self._fields = fields
        self._large = False
        self._last: tuple[bytes, list[Change], np.ndarray] | None = None
        free = fields.free & fields.there
        longest = np.where(free, fields.stops - fields.starts, 0).max(axis=1, initial=0)
        self._free_width = {  # a program that writes more than its columns reads more, too
            width: _FREE_DIGITS if (longest[fields.width[:, 0] == width] > width).any() else width
            for width in (SMALL, LARGE)
        }

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the deck with the coordinates ``points`` ((N, 3)), without what it includes."""
        file.write(self._patched(points)[0])

    def companions(self, points: np.ndarray) -> dict[Path, bytes]:
        """The included files, as far as the output at ``target`` needs them anew."""
        if self.target is None:
            return {}
        own = self._file.path.parent.resolve() if self._file.path else None
        patched = self._patched(points)
        result = {}
        for part, data in zip(self._assembly.parts[1:], patched[1:], strict=True):
            path = self.target.parent / str(part.name)
            if own is None or path.resolve() != (own / str(part.name)).resolve() or data != part.data:
                result[path] = data
        return result

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates as the fields of the cards hold them."""
        self._check_target(points)
        return self._changes(points)[1]

    def widened(self) -> NastranSource | None:
        """The same deck in which the GRID cards of moved vertices get columns of 16."""
        if self._large or not self._narrow().any():
            return None
        wide = NastranSource(self._file, self._assembly, self._deck, self.mesh, self._cards, self._fields)
        wide.unread = self.unread
        wide._large = True
        return wide

    def _check_target(self, points: np.ndarray) -> None:
        """Raise OutputError where the input would be changed through a file that both decks include."""
        moved = differing(points, self.mesh.points).any(axis=1)
        lines = self._deck.start[self._deck.first[self._cards[moved]]]
        parts = np.unique(self._assembly.located(self._deck.to_source(lines))[0])
        for name in (self._assembly.parts[i].name for i in parts.tolist()):
            if name is None or self._file.path is None:
                continue
            source = (self._file.path.parent / name).resolve()
            if self.target is None:
                raise OutputError(f"coordinates are in {name}, which the deck includes: it cannot be piped")
            same = self.target.resolve() == self._file.path.resolve()
            if Path(name).is_absolute() or ((self.target.parent / name).resolve() == source and not same):
                raise OutputError(
                    f"coordinates are in {name}, which the input includes, too; "
                    "write into another directory, or over the input"
                )

    def _patched(self, points: np.ndarray) -> list[bytes]:
        """The bytes of each file of the deck."""
        changes, _ = self._changes(points)
        starts = np.array([change.start for change in changes], dtype=np.int64)
        lengths = np.array([change.stop for change in changes], dtype=np.int64) - starts
        parts, places = self._assembly.located(starts)
        texts = [change.text.encode() for change in changes]
        result = []
        for i, part in enumerate(self._assembly.parts):
            mine = np.flatnonzero(parts == i)
            file = io.BytesIO()
            ends = places[mine] + lengths[mine]
            write_texts(file, part.data, places[mine], ends, [texts[k] for k in mine.tolist()])
            result.append(file.getvalue())
        return result

    def _changes(self, points: np.ndarray) -> tuple[list[Change], np.ndarray]:
        """The replacements for these coordinates, ascending, and the coordinates that are read back."""
        key = np.ascontiguousarray(points).tobytes()
        if self._last is None or self._last[0] != key:
            stored = self.mesh.points.copy()
            changed = differing(points, stored)
            whole = changed.any(axis=1) & self._narrow() if self._large else np.zeros(len(points), dtype=bool)
            lacking = (changed & ~self._fields.there).any(axis=1) & ~whole
            changes = self._in_place(points, changed & ~(whole | lacking)[:, None], stored)
            changes += [self._as_large(points, i, stored) for i in np.flatnonzero(whole).tolist()]
            for i in np.flatnonzero(lacking).tolist():
                changes += self._appended(points, i, changed[i], stored)
            self._last = key, sorted(changes, key=lambda change: change.start), stored
        return self._last[1:]

    def _in_place(self, points: np.ndarray, changed: np.ndarray, stored: np.ndarray) -> list[Change]:
        """Replace the coordinates ``changed`` (N, 3), all of which have a field; ``stored`` is filled in."""
        f = self._fields
        begins, stops = (
            np.where(f.free, f.starts, f.begins)[changed],
            np.where(f.free, f.stops, f.limits)[changed],
        )
        widths = np.where(f.free, self._free_columns()[:, None], f.width)[changed].tolist()
        right = ((f.stops == f.limits) & (f.starts > f.begins) & ~f.free)[changed].tolist()
        room = np.where(f.free[changed], 0, stops - begins).tolist()
        texts = list(map(field_text, points[changed].tolist(), widths))
        stored[changed] = list(map(value_of, texts))
        padded = [
            text.rjust(n) if to_right else text.ljust(n)
            for text, n, to_right in zip(texts, room, right, strict=True)
        ]
        begins, stops = self._deck.to_source(begins), self._deck.to_source(stops)
        return list(map(Change, begins.tolist(), stops.tolist(), padded))

    def _narrow(self) -> np.ndarray:
        """(N,) which vertices have coordinates of 8 characters at most."""
        small = self._fields.width[:, 0] == SMALL
        return small & ~(self._fields.free[:, 0] & (self._free_width[SMALL] > SMALL))

    def _free_columns(self) -> np.ndarray:
        """(N,) how many characters a coordinate between commas may have."""
        widths = self._fields.width[:, 0]
        return np.where(widths == SMALL, self._free_width[SMALL], self._free_width[LARGE])

    def _appended(self, points: np.ndarray, i: int, changed: np.ndarray, stored: np.ndarray) -> list[Change]:
        """Replace coordinates of a vertex some of which the card leaves out, as it ends before."""
        f, deck = self._fields, self._deck
        there = f.there[i]
        row = np.zeros_like(f.there)
        row[i] = changed & there
        changes = self._in_place(points, row, stored)
        first = int(deck.first[self._cards[i]])
        width, free = int(f.width[i, 0]), bool(f.free[i].any())
        grown: dict[int, int] = {}  # the last number of a line may have become longer
        for change, k in zip(changes, np.flatnonzero(row[i]).tolist(), strict=True):
            line = int(f.line[i, k])
            room = int(f.limits[i, k] - f.begins[i, k])
            grown[line] = grown.get(line, 0) + len(change.text) - room
        behind: dict[int, str] = {}
        for k in np.flatnonzero(~there[: np.flatnonzero(changed)[-1] + 1]).tolist():
            number = field_text(float(points[i, k]), int(self._free_columns()[i]) if free else width)
            stored[i, k] = value_of(number)
            line = int(f.line[i, k])
            text = behind.get(line, "")
            if line < 0:
                text = self._line_end() + (f"*,{number}" if free else f"{'*':<{SMALL}}{number}")
            elif free:
                before = k + 3 if line == first else 1  # a large card goes on with the third coordinate
                text += "," * (before - deck.commas(line) - text.count(",")) + number
            else:
                text += " " * int(f.begins[i, k] - deck.limit[line] - grown.get(line, 0) - len(text)) + number
            behind[line] = text
        for line, text in behind.items():
            at = deck.end[first] if line < 0 else deck.stop[line] if free else deck.limit[line]
            place = int(deck.to_source(np.array(at)))
            changes.append(Change(place, place, text))
        return changes

    def _as_large(self, points: np.ndarray, i: int, stored: np.ndarray) -> Change:
        """Replace the GRID card of a vertex by one in columns of 16."""
        deck = self._deck
        line = int(deck.first[self._cards[i]])
        words = deck.words(int(self._cards[i]), 8)
        texts = [field_text(value, LARGE) for value in points[i].tolist()]
        stored[i] = list(map(value_of, texts))
        fields = [*words[:2], *texts, *words[5:]]
        lines = [
            f"{name:<{SMALL}}" + "".join(f"{field:<{LARGE}}" for field in row)
            for name, row in (("GRID*", fields[:4]), ("*", fields[4:]))
        ]
        text = self._line_end().join(line.rstrip() for line in lines)
        start, stop = deck.to_source(np.array([deck.start[line], deck.stop[line]])).tolist()
        return Change(start, stop, text)

    def _line_end(self) -> str:
        data = self._file.data
        return "\r\n" if b"\r\n" in data else "\n" if b"\n" in data or b"\r" not in data else "\r"


def read(file: InputFile) -> NastranSource:
    """Read a deck and the files it includes.

    Cells come in one block for each kind of element card, cell type by cell type, with the numbers of their
    properties as cell data "nastran:property"; nodes that springs, rigid elements, loads, constraints and the
    like hold come as vertex cells, the last block. Coordinates are (N, 3).

    Raises InputError for what is damaged, and for what cannot be read rightly: nodes in coordinate systems of
    their own, elements with some of their mid nodes, superelements, repeated cards (=).
    """
    assembly = Assembly(file)
    begin, end = _bulk(assembly.data)
    deck = Deck(assembly, begin, end)
    check_supported(deck)
    cards = deck.cards(b"GRID")
    if not len(cards):
        raise InputError("it has no GRID cards, and so no mesh")
    fields = deck.fields(cards, 0, 5)
    numbers = deck.integers(Fields(*(array[:, :2] for array in fields)))
    coordinates = Fields(*(array[:, 2:] for array in fields))
    _check_systems(deck, cards, numbers)
    points = deck.reals(coordinates)
    ids = numbers[:, 0]
    if (ids < 1).any():
        deck.refuse(int(deck.first[cards[(ids < 1).argmax()]]), "a GRID needs a positive number")
    repeated = first_repeated(ids)
    if repeated is not None:
        line = int(deck.first[cards[np.flatnonzero(ids == repeated)[1]]])
        deck.refuse(line, f"node {repeated} is defined a second time")
    grids = TagIndex(ids)
    elements = read_elements(deck, grids)
    if end == len(assembly.data):
        _check_end(deck, file.data)
    held = held_vertices(deck, ids, grids, elements.blocks)
    if len(held):
        elements.blocks.append(Cells("vertex", held[:, None]))
        elements.properties.append(np.zeros(len(held), dtype=np.int64))
    mesh = Mesh(points, elements.blocks, {"nastran:property": elements.properties})
    source = NastranSource(file, assembly, deck, mesh, cards, coordinates)
    source.unread = beyond_mesh(deck, assembly.data[:begin])
    return source


def _bulk(data: bytes) -> tuple[int, int]:
    """Begin and end of the bulk data: all of a file without sections."""
    lower = data.lower()
    sections = list(statements(lower, b"begin"))
    if len(sections) > 1:
        raise InputError("several bulk data sections (superelements or auxiliary models) are not supported")
    if not sections and any(True for _ in statements(lower, b"cend")):
        raise InputError("it has case control, but no BEGIN BULK: truncated or damaged")
    if sections:
        begin = data.find(b"\n", sections[0]) + 1 or len(data)
    else:
        begin = len(_BYTE_ORDER_MARK) if data.startswith(_BYTE_ORDER_MARK) else 0
    end = next(statements(lower, b"enddata", begin), len(data))
    if sections and end == len(data):
        raise InputError("BEGIN BULK has no ENDDATA: truncated; if the deck is whole, add a line ENDDATA")
    return begin, end


def _check_end(deck: Deck, data: bytes) -> None:
    """Raise InputError where bulk data without ENDDATA seem to break off.

    These are whole if their last line ends, asks for no continuation, and does not leave its card with fewer
    lines than all others of its name have.
    """
    remedy = "and there is no ENDDATA: truncated; if the deck is whole, add a line ENDDATA"
    if not data.endswith((b"\n", b"\r")):
        raise InputError(f"it breaks off within its last line, {remedy}")
    if deck.goes_on(len(deck.start) - 1):
        deck.refuse(len(deck.start) - 1, f"the line asks for another one behind it, {remedy}")
    large = deck.large[deck.first]
    alike = deck.count[:-1][(deck.name[:-1] == deck.name[-1]) & (large[:-1] == large[-1])]
    if len(alike) and deck.count[-1] < alike.min():
        deck.refuse(int(deck.first[-1]), f"the last card has fewer lines than those like it, {remedy}")


def _check_systems(deck: Deck, cards: np.ndarray, numbers: np.ndarray) -> None:
    """Raise InputError where a vertex, or the default, is in a coordinate system other than the basic one."""
    systems = numbers[:, 1]
    default = deck.fields(deck.cards(b"GRDSET"), 1, 2)
    given = deck.integers(default)
    if given.any():
        deck.refuse(
            int(default.line[given.any(axis=1).argmax(), 0]),
            f"GRDSET puts vertices into coordinate system {_system(deck, int(given.max()))}, "
            "only basic coordinates are supported",
        )
    if systems.any():
        i = int((systems != 0).argmax())
        deck.refuse(
            int(deck.first[cards[i]]),
            f"node {numbers[i, 0]} is in coordinate system {_system(deck, int(systems[i]))}, "
            "only basic coordinates are supported",
        )


def _system(deck: Deck, number: int) -> str:
    """The number of a coordinate system, with what the deck says about it."""
    for name in deck.names:
        if re.fullmatch(rb"CORD\d[RCS]", name):
            for card in deck.cards(name).tolist():
                words = deck.words(card, 8)
                if str(number) in (words[0], *(words[4:5] if name[4:5] == b"1" else ())):
                    return f"{number} ({name.decode()}, {_SYSTEMS[name[5:]]})"
    return str(number)
