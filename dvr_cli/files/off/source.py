"""OFF files, read and written back with other coordinates in the bytes they were read from.

    COFF                    vertices have colours; N: normals, ST: texture coordinates
    4 2 0                   numbers of vertices, faces and edges, the last of which nobody minds
    0 0 0  255 0 0 255
    ...
    3 0 1 2  0.5 0.5 0.5    a face may have a colour, of one to four numbers

In a binary file all numbers are of 4 bytes, the first one first, and each face says how many its colour has.
"""

from __future__ import annotations

import re
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import shown
from dvr_cli.files.patched_text import PatchedText, TextLines
from dvr_cli.files.records import Kind, Property, Records, items_of
from dvr_cli.files.source import Source, differing, rounded
from dvr_cli.files.vtk.cells import POLY_LINE, POLY_VERTEX, POLYGON, CellList, blocks_of
from dvr_cli.mesh.mesh import Mesh

_COMMENT = re.compile(rb"#[^\r\n]*")
_KEYWORD = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF")
_BINARY = re.compile(rb"\s*((?:ST)?C?N?4?n?OFF)[ \t]+BINARY[ \t]*(?:\r\n|\n|\r)")
_EXTRA = (2, 4, 3)  # numbers that ST, C and N add to a vertex
_BEYOND = ("texture coordinates", "colours", "normals")
_MOST = 1 << 40  # larger counts can only come from damage


class BinaryOff(Source):
    """A binary OFF file; its vertices are records of ``width`` float32 from ``begin`` on."""

    format = "off"

    def __init__(self, data: bytes, mesh: Mesh, begin: int, width: int) -> None:
        super().__init__()
        self.mesh = mesh
        self._data = data
        self._points = mesh.points.copy()  # as read, whatever becomes of the mesh
        self._begin = begin
        self._width = width

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the file with the coordinates ``points`` ((N, 3)), rounded to float32."""
        points = self.stored(points)
        changed = differing(points, self._points)
        buffer = bytearray(self._data)
        rows = np.ndarray((len(points), self._width), ">f4", buffer, self._begin)
        rows[:, :3][changed] = points[changed]
        file.write(buffer)

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of the output gets: rounded to float32."""
        return rounded(points)


def read(data: bytes) -> Source:
    """Read an OFF file.

    Cells come in one block for each number of vertices, ascending: vertices, lines, triangles, quads, larger
    polygons. Colours, normals and texture coordinates are no part of the mesh.

    Raises InputError for what is damaged, and for points of other dimensions than three (4OFF, nOFF).
    """
    binary = _BINARY.match(data)
    if binary:
        return _read_binary(data, binary.end(), binary[1])
    lines = TextLines(data, _COMMENT)
    keyword, n, faces, first = _header(lines)
    width = 3 + _extra(keyword)
    rows = lines.rows(first, n, width, "vertex")
    if len(lines) != first + n + faces:
        raise InputError(
            f"{n} lines of vertices and {faces} of faces should follow the counts, one each, "
            f"but there are {len(lines) - first} lines"
        )
    values = lines.numbers(rows, first, np.float64)
    axes = np.arange(3)
    points = values[rows.first[:, None] + axes]
    spans = rows.source_spans(np.arange(n), axes)
    coloured = bool((rows.counts > 3).any())
    first += n
    rows = lines.rows(first, faces, 1, "face")
    values = lines.numbers(rows, first, np.float64)
    sizes = values[rows.first]
    wrong = (sizes < 1) | (sizes != np.rint(sizes)) | ~(sizes < rows.counts)
    if wrong.any():
        raise lines.refusal(first + int(wrong.argmax()), "a face needs its number of vertices, then those")
    sizes = sizes.astype(np.int64)
    positions, starts = items_of(rows.first + 1, sizes, 1)
    nodes = values[positions]
    strange = (nodes != np.rint(nodes)) | ~(np.abs(nodes) < _MOST)
    if strange.any():
        face = int(np.searchsorted(starts, strange.argmax(), side="right")) - 1
        raise lines.refusal(first + face, "the vertices of a face are whole numbers")
    coloured = coloured or bool((rows.counts > 1 + sizes).any())
    mesh = _mesh(points, CellList(nodes.astype(np.int64), starts, sizes))
    source = PatchedText("off", data, mesh, *spans)
    source.unread = _unread(keyword, coloured)
    return source


def _header(lines: TextLines) -> tuple[bytes, int, int, int]:
    """The keyword, the numbers of vertices and faces, and the first line behind."""
    words: list[bytes] = []
    line = 0
    keyword = b"OFF"
    while line < len(lines) and len(words) < 3:
        found = lines.words(line)
        if line == 0 and _KEYWORD.fullmatch(found[0]):
            keyword = found.pop(0)
        words += found
        line += 1
        if not all(word.isdigit() and len(word) < 16 for word in words):
            raise lines.refusal(
                line - 1, "OFF and the numbers of vertices, faces and edges are expected here"
            )
    if len(words) != 3:
        raise InputError(f"three counts should follow {keyword.decode()}: vertices, faces, edges")
    return keyword, int(words[0]), int(words[1]), line


def _extra(keyword: bytes) -> int:
    """The number of values a vertex has beside its coordinates."""
    match = _KEYWORD.fullmatch(keyword)
    assert match is not None  # it was found by that
    if match[4] or match[5]:
        raise InputError(f"{shown(keyword)}: points of other dimensions than 3 are not supported")
    return sum(width for width, given in zip(_EXTRA, match.groups(), strict=False) if given)


def _read_binary(data: bytes, begin: int, keyword: bytes) -> BinaryOff:
    width = 3 + _extra(keyword)
    if len(data) < begin + 12:
        raise InputError("the numbers of vertices, faces and edges are missing")
    n, faces, _ = np.frombuffer(data, ">i4", 3, begin).tolist()
    if n < 0 or faces < 0:
        raise InputError(f"it says that it has {n} vertices and {faces} faces")
    records = Records(data, begin + 12, ">")
    vertex = Kind("vertex", n, tuple(Property(str(i), "f4") for i in range(width)))
    face = Kind("face", faces, (Property("vertices", "i4", "i4"), Property("colour", "f4", "i4")))
    vertices = records.places(vertex, records.begin)
    corners = records.places(face, vertices.end)
    if corners.end != len(data) and data[corners.end :].strip(b"\0 \t\r\n"):
        raise InputError("there is more behind its last face than its counts say")
    points = np.stack([records.values(where, "f4") for where in vertices.where[:3]], axis=1)
    positions, starts = items_of(corners.where[0], corners.sizes[0], 4)
    mesh = _mesh(
        points.astype(np.float64), CellList(records.whole(positions, "i4"), starts, corners.sizes[0])
    )
    source = BinaryOff(data, mesh, begin + 12, width)
    source.unread = _unread(keyword, bool(corners.sizes[1].any()))
    return source


def _mesh(points: np.ndarray, cells: CellList) -> Mesh:
    if not len(points):
        raise InputError("it has no vertices")
    types = np.select([cells.sizes == 1, cells.sizes == 2], [POLY_VERTEX, POLY_LINE], POLYGON)
    return Mesh(points, blocks_of(cells, types, len(points), by_size=True)[0])


def _unread(keyword: bytes, coloured: bool) -> list[str]:
    match = _KEYWORD.fullmatch(keyword)
    given = match.groups() if match else ()
    found = [what for what, letters in zip(_BEYOND, given, strict=False) if letters]
    found += ["colours"] if coloured and "colours" not in found else []
    return [f"not kept: {', '.join(found)}"] if found else []
