"""Wavefront OBJ files: polygonal meshes with any texture, normal, group and material statements.

Read with NumPy as a whole rather than line by line, and written back by replacing the coordinates in the
``v`` lines of the file.
"""

from __future__ import annotations

import re

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.losses import number_not_kept
from dvr_cli.files.numbers_in_text import Rows, inside_spans, is_blank, shown
from dvr_cli.files.patched_text import PatchedText
from dvr_cli.files.vtk.cells import POLY_LINE, POLY_VERTEX, POLYGON, CellList, blocks_of, joined
from dvr_cli.mesh.mesh import Mesh

_UNSUPPORTED = {
    **dict.fromkeys((b"cstype", b"deg", b"curv", b"curv2", b"surf", b"parm", b"end"), "free-form geometry"),
    **dict.fromkeys((b"bzp", b"bsp", b"cdc", b"cdp"), "free-form geometry (superseded form)"),
    **dict.fromkeys((b"call", b"csh"), "including other files"),
    b"fo": "face outlines (superseded form of f)",
}
_GROUPING = (b"g", b"o", b"usemtl")
_BEYOND = {"vt": "texture coordinate", "vn": "normal"}
_CONTINUED = re.compile(rb"\\\r?\n")
_INDENT = re.compile(rb"[ \t\v\f]*")
_KEYWORD = re.compile(rb"[A-Za-z][A-Za-z0-9_]*")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def read(data: bytes) -> PatchedText:
    """Read an OBJ file.

    Cells come in one block for each number of vertices: points (``p``), lines (``l``, taken apart into
    segments), then faces: triangles, quads, larger polygons, ascending; a block keeps the order of the file.
    The cell data "obj:group" number the combinations of object (``o``), group (``g``) and material
    (``usemtl``), from 0 for the cells in front of the first such statement, in the order they appear. The
    cell sets are what each of these names holds.

    Raises InputError for what is no OBJ file, is damaged, or uses free-form geometry. Keywords that are not
    part of the format are passed over, as every reader of OBJ does.
    """
    lines = _Lines(data)
    is_v = lines.begin_with("v")
    points, starts, ends = _read_vertices(lines, is_v)
    statements = [
        _read_elements(lines, lines.begin_with("p"), is_v, "a point", 1),
        _read_elements(lines, lines.begin_with("l"), is_v, "a line", 2),
        _read_elements(lines, lines.begin_with("f"), is_v, "a face", 3),
    ]
    cells = joined([listed for listed, _ in statements])
    types = np.repeat([POLY_VERTEX, POLY_LINE, POLYGON], [len(line) for _, line in statements])
    blocks, numbers = blocks_of(cells, types, len(points), by_size=True)
    of_line, named = _read_groups(lines)
    group = of_line[np.concatenate([line for _, line in statements])]
    groups = [group[number] for number in numbers]
    sets = {name: [np.flatnonzero(np.isin(g, members)) for g in groups] for name, members in named.items()}
    mesh = Mesh(points, blocks, cell_data={"obj:group": groups}, cell_sets=sets)
    source = PatchedText("obj", data, mesh, starts, ends)
    source.unread = [
        line
        for keyword, what in _BEYOND.items()
        for line in number_not_kept(int(lines.begin_with(keyword).sum()), what)
    ]
    return source


class _Lines:
    """The lines of the file after continued lines have been joined, still in their places.

    text: the file, uint8, followed by line ends; continuations and comments behind elements are blanked.
    starts, ends: (n,) of each line, its line end included.
    keywords: (n,) where each line's first non-blank character stands.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        buffer = bytearray(data + b"\n\n\n")
        if data.startswith(_BYTE_ORDER_MARK):
            buffer[:3] = b"   "
        for match in _CONTINUED.finditer(data):
            begin = data.rfind(b"\n", 0, match.start()) + 1
            if data.find(b"#", begin, match.start()) < 0:  # comments do not go on in the next line
                buffer[match.start() : match.end()] = b" " * len(match.group())
        self.text = np.frombuffer(buffer, dtype=np.uint8)
        line_ends = np.flatnonzero(self._are_line_ends(slice(None)))
        self.ends = line_ends[:-2] + 1  # two of the three are there to be looked at behind a keyword
        self.starts = np.concatenate([[0], self.ends[:-1]])
        self.keywords = self.starts.copy()
        indented = np.flatnonzero(is_blank(self.text[self.starts]) & ~self._are_line_ends(self.starts))
        self.keywords[indented] = [_skip_blanks(buffer, start) for start in self.starts[indented].tolist()]
        self._blank_comments()

    def begin_with(self, keyword: str) -> np.ndarray:
        """(n,) bool: the lines whose keyword this is, of one or two characters."""
        found = is_blank(self.text[self.keywords + len(keyword)])
        for i, character in enumerate(keyword):
            found &= self.text[self.keywords + i] == ord(character)
        return found

    def number(self, line: int) -> int:
        """The number of a line as an editor counts: from 1, continuations as lines of their own."""
        return self._data.count(b"\n", 0, int(self.starts[line])) + 1

    def words(self, line: int) -> list[bytes]:
        """The words of a line."""
        return self.text[self.starts[line] : self.ends[line]].tobytes().split()

    def others(self) -> list[int]:
        """The lines that are neither empty, nor comments, nor one of the common statements with numbers."""
        rest = ~self._are_line_ends(self.keywords) & (self.text[self.keywords] != ord("#"))
        for keyword in ("v", "vt", "vn", "f", "l", "p", "s"):
            rest &= ~self.begin_with(keyword)
        return np.flatnonzero(rest).tolist()

    def _are_line_ends(self, positions: np.ndarray | slice) -> np.ndarray:
        return (self.text[positions] == ord("\n")) | (self.text[positions] == ord("\r"))

    def _blank_comments(self) -> None:
        hashes = np.flatnonzero(self.text == ord("#"))
        if not len(hashes):
            return
        line = np.searchsorted(self.starts, hashes, side="right") - 1
        first = np.diff(line, prepend=-1) > 0
        hashes, line = hashes[first], line[first]
        inner = hashes > self.keywords[line]
        named = np.isin(self.text[self.keywords[line]], np.frombuffer(b"gous", dtype=np.uint8))
        spans = inner & ~named  # the names of groups and materials may have a #
        self.text[inside_spans(len(self.text), hashes[spans], self.ends[line[spans]] - 1)] = ord(" ")


def _skip_blanks(buffer: bytearray, position: int) -> int:
    match = _INDENT.match(buffer, position)
    assert match is not None  # the pattern matches nothing at all, too
    return match.end()


def _read_vertices(lines: _Lines, is_v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates (N, 3) of the ``v`` lines, and where in the file each begins and ends."""
    line = np.flatnonzero(is_v)
    if not len(line):
        raise InputError("not an OBJ file, or one without vertices: it has no v lines")
    rows = Rows(lines.text, lines.starts[line], lines.ends[line])
    _check_counts(lines, line, rows, "a vertex", 3, "coordinates")
    values = _numbers(lines, line, rows, np.float64)
    xyz = values[(rows.first - np.arange(len(line)))[:, None] + np.arange(3)]
    return xyz, *rows.source_spans(np.arange(len(line)), np.arange(1, 4))


def _read_elements(
    lines: _Lines, chosen: np.ndarray, is_v: np.ndarray, what: str, least: int
) -> tuple[CellList, np.ndarray]:
    """The elements in the lines ``chosen``, with the line of each; their indices are counted from 0."""
    line = np.flatnonzero(chosen)
    rows = Rows(lines.text, lines.starts[line], lines.ends[line])
    _check_counts(lines, line, rows, what, least, "vertices")
    slashes = np.flatnonzero(rows.text == ord("/"))  # v/vt/vn: only v matters here
    token = np.searchsorted(rows.starts, slashes, side="right") - 1
    first = np.diff(token, prepend=-1) > 0
    rows.blank_out(slashes[first], rows.ends[token[first]])
    index = _numbers(lines, line, rows, np.int64)
    sizes = rows.counts - 1
    vertex_lines = np.flatnonzero(is_v)
    defined = np.repeat(np.searchsorted(vertex_lines, line), sizes)  # -1 is the last vertex so far
    nodes = np.where(index < 0, index + defined, index - 1)
    wrong = (nodes < 0) | (nodes >= len(vertex_lines))
    starts = np.cumsum(sizes) - sizes
    if wrong.any():
        i = int(np.argmax(wrong))
        here = line[np.searchsorted(starts, i, side="right") - 1]
        raise InputError(f"line {lines.number(here)}: there is no vertex {index[i]}")
    return CellList(nodes, starts, sizes), line


def _read_groups(lines: _Lines) -> tuple[np.ndarray, dict[str, list[int]]]:
    """(n,) number of the combination of object, group and material that holds in each line, and for each
    name of one of these the numbers of the combinations it is in (a cell may be in several groups)."""
    now = dict.fromkeys(_GROUPING, b"")
    known = {tuple(now.values()): 0}
    begin, number = [0], [0]
    for line in lines.others():
        keyword, *names = lines.words(line)
        if keyword in _UNSUPPORTED:
            raise InputError(
                f"line {lines.number(line)}: {_UNSUPPORTED[keyword]} ({keyword.decode()}) not supported"
            )
        if not _KEYWORD.fullmatch(keyword):
            raise InputError(
                f"line {lines.number(line)} does not begin with a keyword: damaged, or not an OBJ file"
            )
        if keyword in now:
            now[keyword] = b" ".join(names)
            begin.append(line)
            number.append(known.setdefault(tuple(now.values()), len(known)))
    named: dict[str, list[int]] = {}
    for combination, i in known.items():
        for keyword, text in zip(_GROUPING, combination, strict=True):
            for name in text.split() if keyword == b"g" else [text] if text else []:
                named.setdefault(name.decode("utf-8", "replace"), []).append(i)
    return np.repeat(number, np.diff(begin, append=len(lines.starts))), named


def _check_counts(lines: _Lines, line: np.ndarray, rows: Rows, what: str, least: int, of_what: str) -> None:
    few = rows.counts <= least
    if few.any():
        here = line[np.argmax(few)]
        raise InputError(f"line {lines.number(here)}: {what} needs at least {least} {of_what}")


def _numbers(lines: _Lines, line: np.ndarray, rows: Rows, dtype: type) -> np.ndarray:
    """All numbers behind the keywords of some lines."""
    rows.text[rows.starts[rows.first]] = ord(" ")
    counts = rows.counts - 1
    try:
        return rows.numbers(int(counts.sum()), dtype)
    except ValueError:
        i = rows.first_wrong(counts, dtype)
        raise InputError(
            f"line {lines.number(line[i])}: {shown(b' '.join(lines.words(line[i])))} is not valid"
        ) from None
