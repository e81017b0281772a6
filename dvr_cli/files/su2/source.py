"""SU2 meshes: text of statements ``KEYWORD= value``, some of them followed by rows of numbers.

    NDIME= 2
    NELEM= 1
    5  0 1 2  0          VTK's cell type, nodes counted from 0, and mostly the number of the element
    NPOIN= 3
    0.0 0.0  0           coordinates, and mostly the number of the point
    ...
    NMARK= 1
    MARKER_TAG= wall
    MARKER_ELEMS= 1
    3  0 1

A file of several zones (NZONE, IZONE) has all of this for each of them. Whatever else there is, such as boxes
for free-form deformation, stays as it is.
"""

from __future__ import annotations

from typing import NamedTuple, NoReturn

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.losses import not_kept
from dvr_cli.files.numbers_in_text import Rows, inside_spans, shown
from dvr_cli.files.patched_text import PatchedText
from dvr_cli.files.vtk.cells import VTK_TYPE
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells, Mesh

# VTK's numbers of cell types, with meshio's names.
TYPES = {
    VTK_TYPE[name]: name
    for name in (
        *("vertex", "line", "triangle", "quad", "tetra", "hexahedron", "wedge", "pyramid"),
        *("line3", "triangle6", "quad8", "tetra10", "hexahedron20", "wedge15", "pyramid13"),
    )
}
_SIZES = np.zeros(max(TYPES) + 1, dtype=np.int64)
_SIZES[list(TYPES)] = [CELL_TYPES[name].nodes for name in TYPES.values()]
_MOST = 1 << 40  # larger counts can only come from damage
_ROWS = ("NPOIN", "NELEM", "MARKER_ELEMS", "SEND_TO", "SEND_RECV")  # what is followed by rows
_HELD = "FFD_SURFACE_POINTS"  # rows of a marker, a point and its place in the box


class _Listed(NamedTuple):
    """The elements of one statement: VTK types (n,), rows of numbers of all, and where each row begins in it.

    offset: what to add to the nodes, those of the zones before. zone: counted from 1. marker: 0 for none.
    """

    types: np.ndarray
    numbers: np.ndarray
    first: np.ndarray
    offset: int
    zone: int
    marker: int


def read(data: bytes) -> PatchedText:
    """Read an SU2 file.

    Cells come in one block for each cell type; those of markers are in blocks of their own, in the cell data
    "su2:marker" with the number of the marker, which the field data name. The zones of a file that has
    several are the cell data "su2:zone". Points of free-form deformation boxes come as vertex cells, so that
    they stay. Coordinates are (N, 2) or (N, 3).

    Raises InputError for what is damaged, and for cell types other than those SU2 and VTK have.
    """
    return _File(data).source()


class _File:
    """An SU2 file as it is read, statement by statement."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._text = np.frombuffer(bytearray(data + b"\n"), dtype=np.uint8)
        self._blank_comments()
        self._dimension = 0
        self._zone = 1
        self._zones = 1
        self._offset = 0  # points of the zones before
        self._points: list[np.ndarray] = []
        self._spans: list[tuple[np.ndarray, np.ndarray]] = []
        self._listed: list[_Listed] = []
        self._held: list[np.ndarray] = []
        self._markers: dict[str, int] = {}
        self._expected: int | None = None  # markers still to come in this zone
        self._marker: int | None = None
        self._bare = ""  # the name of a marker whose elements are still to come
        self._count: int | None = None  # elements of the marker that SEND_TO interrupts
        self._others: list[str] = []

    def source(self) -> PatchedText:
        """The file, read."""
        statements = list(self._statements())
        if not statements:
            raise InputError("it has no statements KEYWORD= value: no SU2 file")
        for at, keyword, value, begin, end in statements:
            self._take(at, keyword, value, begin, end)
        self._finish_zone()
        if keyword in _ROWS and not self._is_blank(begin, end) and self._data[-1:] not in (b"\n", b"\r"):
            raise InputError(
                f"it breaks off within a row of {keyword}: truncated; if it is whole, end that line"
            )
        if self._zone != self._zones:
            raise InputError(f"NZONE declares {self._zones} zones, but the file has {self._zone}")
        if len({points.shape[1] for points in self._points}) > 1:
            raise InputError("its zones have different dimensions, which is not supported")
        points = np.concatenate(self._points)
        mesh = self._mesh(points)
        starts, ends = (np.concatenate(parts) for parts in zip(*self._spans, strict=True))
        source = PatchedText("su2", self._data, mesh, starts, ends)
        source.unread = not_kept(set(self._others), "kind of statement")
        return source

    def _blank_comments(self) -> None:
        marks = np.flatnonzero(self._text == ord("%"))
        breaks = np.flatnonzero((self._text == ord("\n")) | (self._text == ord("\r")))
        self._breaks = breaks
        line = np.searchsorted(breaks, marks)
        first = np.diff(line, prepend=-1) > 0
        self._text[inside_spans(len(self._text), marks[first], breaks[line[first]])] = ord(" ")

    def _statements(self) -> list[tuple[int, str, bytes, int, int]]:
        """For each statement where it begins, its keyword and value, and where its rows begin and end."""
        signs = np.flatnonzero(self._text == ord("="))
        line = np.searchsorted(self._breaks, signs)
        signs, line = signs[np.diff(line, prepend=-1) > 0], np.unique(line)
        starts = np.concatenate([[0], self._breaks + 1])[line]
        ends = self._breaks[line]
        bodies = np.append(starts, len(self._text))[1:].tolist()
        found = []
        for at, sign, end, stop in zip(starts.tolist(), signs.tolist(), ends.tolist(), bodies, strict=True):
            keyword = self._text[at:sign].tobytes().strip()
            if not keyword.replace(b"_", b"").isalnum():
                self._refuse(at, f"{shown(keyword)} is no keyword")
            value = self._text[sign + 1 : end].tobytes().strip()
            found.append((at, keyword.decode("latin-1").upper(), value, end + 1, stop))
        return found

    def _take(self, at: int, keyword: str, value: bytes, begin: int, end: int) -> None:
        if keyword == "NZONE":
            self._zones = self._number(at, keyword, value)
        elif keyword == "IZONE":
            if self._points or self._listed:
                self._finish_zone()
                self._zone += 1
        elif keyword == "NDIME":
            self._dimension = self._number(at, keyword, value)
            if self._dimension not in (2, 3):
                self._refuse(at, f"NDIME is {self._dimension}; 2 or 3 are possible")
        elif keyword == "NPOIN":
            self._read_points(at, self._number(at, keyword, value), begin, end)
        elif keyword == "NELEM":
            self._read_elements(at, keyword, self._number(at, keyword, value), begin, end, 0)
        elif keyword == "NMARK":
            self._expected = self._number(at, keyword, value)
        elif keyword == "MARKER_TAG":
            if self._bare:
                self._refuse(at, f"the marker before it, {shown(self._bare)}, has no MARKER_ELEMS")
            self._bare = value.decode("utf-8", "replace")
            name = value.decode("utf-8", "replace")
            self._marker = self._markers.setdefault(name, len(self._markers) + 1)
            self._expected = None if self._expected is None else self._expected - 1
        elif keyword == "MARKER_ELEMS":
            self._count = self._number(at, keyword, value)
            self._bare = ""
            if self._marker is None:
                self._refuse(at, "MARKER_ELEMS without a MARKER_TAG before it")
            if self._count == 0 or not self._is_blank(begin, end):
                self._read_elements(at, keyword, self._count, begin, end, self._marker)
                self._count = None
        elif keyword in ("SEND_TO", "SEND_RECV"):
            if self._count is None or self._marker is None:
                self._refuse(at, f"{keyword} without MARKER_ELEMS before it")
            self._read_elements(at, "MARKER_ELEMS", self._count, begin, end, self._marker)
            self._count = None
        else:
            self._others.append(keyword)
            if keyword == _HELD:
                self._read_held(begin, end)

    def _finish_zone(self) -> None:
        """Check that nothing is missing in the zone that ends here."""
        where = f" of zone {self._zone}" if self._zones > 1 else ""
        if len(self._points) != self._zone:
            raise InputError(f"NPOIN is missing{where}")
        if not any(listed.zone == self._zone and not listed.marker for listed in self._listed):
            raise InputError(f"NELEM is missing{where}")
        if self._count is not None:
            raise InputError(f"the elements of the last marker are missing{where}")
        if self._bare:
            raise InputError(f"the marker {shown(self._bare)} has no MARKER_ELEMS{where}: truncated")
        if self._expected:
            raise InputError(
                f"NMARK{where} declares {abs(self._expected)} markers "
                f"{'more' if self._expected > 0 else 'fewer'} than there are"
            )
        self._offset += len(self._points[-1])
        self._expected = self._marker = None

    def _read_points(self, at: int, count: int, begin: int, end: int) -> None:
        if not self._dimension:
            self._refuse(at, "NPOIN before NDIME")
        if len(self._points) == self._zone:
            self._refuse(at, "NPOIN a second time" + (" in one zone" if self._zones > 1 else ""))
        rows, filled = self._rows(at, "NPOIN", count, begin, end)
        short = rows.counts[filled] < self._dimension
        if short.any():
            self._refuse_row(rows, filled[short.argmax()], f"a point needs {self._dimension} coordinates")
        values = self._numbers(rows, np.float64)
        columns = np.arange(self._dimension)
        self._points.append(values[rows.first[filled][:, None] + columns])
        self._spans.append(rows.source_spans(filled, columns))

    def _read_elements(self, at: int, keyword: str, count: int, begin: int, end: int, marker: int) -> None:
        rows, filled = self._rows(at, keyword, count, begin, end)
        numbers = self._numbers(rows, np.int64)
        first = rows.first[filled]
        types = numbers[first] if len(first) else np.empty(0, dtype=np.int64)
        known = np.isin(types, list(TYPES))
        if not known.all():
            row = int(np.argmin(known))
            order, of = divmod(int(types[row]), 100)
            why = "is not known"
            if order > 0 and of in TYPES:  # as SU2's finite elements have them
                why = f"is a {TYPES[of]} of order {order + 1}, which is not supported"
            self._refuse_row(rows, filled[row], f"cell type {types[row]} {why}")
        short = rows.counts[filled] < 1 + _SIZES[types]
        if short.any():
            row = int(short.argmax())
            kind = CELL_TYPES[TYPES[int(types[row])]]
            self._refuse_row(rows, filled[row], f"a {kind.name} needs {kind.nodes} nodes")
        self._listed.append(_Listed(types, numbers, first, self._offset, self._zone, marker))

    def _read_held(self, begin: int, end: int) -> None:
        """Points whose place in a box is written down; rows of another form are nobody's business."""
        for line in self._text[begin:end].tobytes().splitlines():
            words = line.split()
            if len(words) > 1 and words[1].isdigit() and len(words[1]) < 16:
                self._held.append(np.array([int(words[1])]) + self._offset)

    def _mesh(self, points: np.ndarray) -> Mesh:
        before = np.cumsum([0, *map(len, self._points)])
        blocks: list[Cells] = []
        markers: list[np.ndarray] = []
        zones: list[np.ndarray] = []
        for inside in (True, False):
            mine = [listed for listed in self._listed if (listed.marker == 0) == inside]
            for number, name in TYPES.items():
                parts = [(listed, np.flatnonzero(listed.types == number)) for listed in mine]
                parts = [(listed, rows) for listed, rows in parts if len(rows)]
                if not parts:
                    continue
                places = np.arange(1, 1 + CELL_TYPES[name].nodes)
                vertices = []
                for listed, rows in parts:
                    found = listed.numbers[listed.first[rows][:, None] + places]
                    limit = before[listed.zone] - before[listed.zone - 1]
                    wrong = (found < 0) | (found >= limit)
                    if wrong.any():
                        raise InputError(
                            f"a {name} names point {found[wrong][0]}, but there are {limit}, counted from 0"
                        )
                    vertices.append(found + listed.offset)
                blocks.append(Cells(name, np.concatenate(vertices)))
                lengths = [len(rows) for _, rows in parts]
                markers.append(np.repeat([listed.marker for listed, _ in parts], lengths))
                zones.append(np.repeat([listed.zone for listed, _ in parts], lengths))
        held = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *self._held]))
        held = held[held < len(points)]
        if len(held):
            blocks.append(Cells("vertex", held[:, None]))
            markers.append(np.zeros(len(held), dtype=np.int64))
            zones.append(np.zeros(len(held), dtype=np.int64))
        data = {"su2:marker": markers} if self._markers else {}
        data |= {"su2:zone": zones} if self._zones > 1 else {}
        names = {name: np.array([tag, self._dimension - 1]) for name, tag in self._markers.items()}
        return Mesh(points, blocks, data, field_data=names)

    def _rows(self, at: int, keyword: str, count: int, begin: int, end: int) -> tuple[Rows, np.ndarray]:
        """The rows behind a statement, and which of the lines they are."""
        low, high = np.searchsorted(self._breaks, [begin, end])
        ends = self._breaks[low:high] + 1
        rows = Rows(self._text, np.concatenate([[begin], ends])[: len(ends)], ends)
        filled = np.flatnonzero(rows.counts)
        if len(filled) != count:
            self._refuse(at, f"{keyword} declares {count} rows, but {len(filled)} follow")
        return rows, filled

    def _numbers(self, rows: Rows, dtype: type) -> np.ndarray:
        try:
            return rows.numbers(int(rows.counts.sum()), dtype)
        except ValueError:
            self._refuse_row(rows, rows.first_wrong(rows.counts, dtype), "not numbers")

    def _number(self, at: int, keyword: str, value: bytes) -> int:
        """The first whole number of a statement's value; a second one may follow that counts halo points."""
        words = value.split()
        if not words or not words[0].isdigit() or len(words[0]) > 15 or int(words[0]) > _MOST:
            self._refuse(at, f"{keyword} needs a whole number, not {shown(value)}")
        return int(words[0])

    def _is_blank(self, begin: int, end: int) -> bool:
        return self._text[begin:end].tobytes().isspace() or begin >= end

    def _refuse_row(self, rows: Rows, line: int, why: str) -> NoReturn:
        at = int(rows.source_spans(np.array([line]), np.array([0]))[0][0, 0])
        self._refuse(at, why)

    def _refuse(self, at: int, why: str) -> NoReturn:
        text = self._data[:at]
        number = (text.count(b"\n") if b"\n" in self._data else text.count(b"\r")) + 1
        raise InputError(f"line {number}: {why}")
