"""Netgen's .vol files, read and written back with other coordinates in the lines they were read from.

    volumeelements          a keyword,
    28                      a count,
    1 4 9 16 21 17          and so many lines: here material, number of nodes, nodes

Older and newer versions differ in their sections. What stands behind endmesh is geometry.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.losses import number_not_kept
from dvr_cli.files.numbers_in_text import Rows, shown
from dvr_cli.files.patched_text import PatchedText, TextLines
from dvr_cli.mesh.mesh import Cells, Mesh

_COMMENT = re.compile(rb"#[^\r\n]*")
_COUNT = re.compile(rb"\d{1,15}")
_KEYWORD = re.compile(rb"[a-z_]\w*")


class _Kind(NamedTuple):
    """A section of elements of a dimension.

    tag, size, first: the columns of tag, number of nodes, and first node. nodes: their number where none of
    the columns tells (size -1).
    """

    dimension: int
    tag: int
    size: int
    first: int
    nodes: int = 0


_POINTS = _Kind(0, 1, -1, 0, 1)
_EDGES = _Kind(1, 0, -1, 2, 2)
_ELEMENTS = {
    "pointelements": _POINTS,
    **dict.fromkeys(("edgesegments", "edgesegmentsgi", "edgesegmentsgi2"), _EDGES),
    "edgesegmentsgi3": _Kind(1, 6, -1, 0, 2),
    **dict.fromkeys(("surfaceelements", "surfaceelementsgi", "surfaceelementsuv"), _Kind(2, 1, 4, 5)),
    "volumeelements": _Kind(3, 0, 1, 2),
}
# (dimension, number of nodes): type, and the place in the file of each node in meshio's order.
_TYPES = {
    (0, 1): ("vertex", [0]),
    (1, 2): ("line", [0, 1]),
    (2, 3): ("triangle", [0, 1, 2]),
    (2, 6): ("triangle6", [0, 1, 2, 5, 3, 4]),
    (2, 4): ("quad", [0, 1, 2, 3]),
    (2, 8): ("quad8", [0, 1, 2, 3, 4, 7, 5, 6]),
    (3, 4): ("tetra", [0, 2, 1, 3]),
    (3, 10): ("tetra10", [0, 2, 1, 3, 5, 7, 4, 6, 9, 8]),
    (3, 5): ("pyramid", [0, 3, 2, 1, 4]),
    (3, 13): ("pyramid13", [0, 3, 2, 1, 4, 7, 6, 8, 5, 9, 12, 11, 10]),
    (3, 6): ("wedge", [0, 2, 1, 3, 5, 4]),
    (3, 15): ("wedge15", [0, 2, 1, 3, 5, 4, 7, 8, 6, 13, 14, 12, 9, 11, 10]),
    (3, 8): ("hexahedron", [0, 3, 2, 1, 4, 7, 6, 5]),
    (3, 20): (
        "hexahedron20",
        [0, 3, 2, 1, 4, 7, 6, 5, 10, 9, 11, 8, 16, 19, 18, 17, 14, 13, 15, 12],
    ),
}
_NAMES = {"materials": 0, "bcnames": 1, "cd2names": 2, "cd3names": 3}  # of what codimension
_ONE_LINE = ("identificationtypes",)  # so many numbers in one line
_MOST = 1 << 40  # larger numbers can only come from damage
_VALUES = ("dimension", "geomtype")
_READ = {*_ELEMENTS, *_NAMES, "points", "identifications", "identificationtypes"}


class _Section(NamedTuple):
    """first: its first row among the lines. rows: how many."""

    first: int
    rows: int


def read(data: bytes) -> PatchedText:
    """Read a .vol file.

    Cells come section by section, in a block for each number of nodes, with their material, boundary
    condition or edge as the cell data "netgen:index"; the names of these are cell sets, and identified points
    are linked. Points have two coordinates if the file says so.

    Raises InputError for what is damaged.
    """
    end = re.search(rb"^[ \t]*endmesh\b", data, re.MULTILINE)
    if end is None:
        raise InputError("it has no endmesh: truncated, or not a mesh of Netgen")
    lines = TextLines(data[: end.start()], _COMMENT)
    if not len(lines) or lines.words(0) != [b"mesh3d"]:
        raise InputError("it does not begin with mesh3d, as meshes of Netgen do")
    values, sections = _sections(lines)
    dimension = values.get("dimension", 3)
    if dimension not in (2, 3):
        raise InputError(f"it says that it has {dimension} dimensions; 2 or 3 are possible")
    if "points" not in sections:
        raise InputError("it has no section points")
    first, n = sections["points"]
    rows = lines.rows(first, n, 3, "point")
    numbers = lines.numbers(rows, first, np.float64)
    axes = np.arange(dimension)
    points = numbers[rows.first[:, None] + axes]
    spans = rows.source_spans(np.arange(n), axes)
    mesh = Mesh(points, [])
    tags: list[np.ndarray] = []
    for name, section in sections.items():
        if name in _ELEMENTS:
            _read_elements(lines, name, section, mesh, tags)
            if name == "edgesegmentsgi3" and section.rows:
                tags[-1] = _edge_numbers(lines, sections.get("edgedescriptors"), tags[-1])
    if not mesh.cells:
        raise InputError("it has no elements")
    mesh.cell_data["netgen:index"] = tags
    for name, codimension in _NAMES.items():
        if name in sections:
            _add_names(lines, sections[name], dimension - codimension, mesh, tags)
    if "identifications" in sections:
        mesh.periodic = _links(lines, sections["identifications"], n)
    source = PatchedText("netgen", data, mesh, *spans)
    source.unread = [
        line
        for name, section in sections.items()
        if name not in _READ
        for line in number_not_kept(section.rows, f"row of {name}")
    ]
    source.unread += ["not kept: the geometry behind endmesh"] if data[end.end() :].strip() else []
    return source


def _sections(lines: TextLines) -> tuple[dict[str, int], dict[str, _Section]]:
    """The single numbers by their keyword, and the sections by theirs."""
    values: dict[str, int] = {}
    sections: dict[str, _Section] = {}
    at = 1
    while at < len(lines):
        words = lines.words(at)
        if len(words) != 1 or not _KEYWORD.fullmatch(words[0]):
            raise lines.refusal(at, "a keyword alone is expected here")
        name = words[0].decode()
        number = lines.words(at + 1) if at + 1 < len(lines) else []
        if len(number) != 1 or not _COUNT.fullmatch(number[0]):
            raise lines.refusal(at, "a number alone should follow this keyword")
        if name in sections or name in values:
            raise lines.refusal(at, "a second section of this name")
        count = int(number[0])
        at += 2
        if name in _VALUES:
            values[name] = count
            continue
        sections[name] = _Section(at, count)
        at += min(count, 1) if name in _ONE_LINE else count
        if at > len(lines):
            raise InputError(f"section {shown(name)} should have {count} lines, but ends early")
    return values, sections


def _read_elements(
    lines: TextLines, name: str, section: _Section, mesh: Mesh, tags: list[np.ndarray]
) -> None:
    """Add the elements of a section to the cells of ``mesh``, and their tags."""
    kind = _ELEMENTS[name]
    first, n = section
    if not n:
        return
    rows = lines.rows(first, n, max(kind.tag, kind.size, kind.first) + 1, "element")
    numbers = lines.numbers(rows, first, np.float64)
    sizes = np.full(n, kind.nodes) if kind.size < 0 else numbers[rows.first + kind.size]
    short = (sizes != np.rint(sizes)) | ~(rows.counts >= kind.first + sizes)
    if short.any():
        raise lines.refusal(first + int(short.argmax()), "an element has fewer nodes than it says")
    numbered = numbers[rows.first + kind.tag]
    wrong = (numbered != np.rint(numbered)) | ~(np.abs(numbered) < _MOST)
    if wrong.any():
        raise lines.refusal(first + int(wrong.argmax()), "the index of an element is a whole number")
    for size in np.unique(sizes).astype(np.int64).tolist():
        mine = np.flatnonzero(sizes == size)
        if (kind.dimension, size) not in _TYPES:
            raise lines.refusal(first + int(mine[0]), f"elements of {size} nodes are not supported here")
        cell_type, order = _TYPES[kind.dimension, size]
        begin = rows.first[mine, None]
        vertices = numbers[begin + kind.first + np.array(order)] - 1
        wrong = (vertices < 0) | (vertices >= len(mesh.points)) | (vertices != np.rint(vertices))
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            number = f"{vertices[row, column] + 1:g}"
            raise lines.refusal(first + int(mine[row]), f"there is no point {number}")
        mesh.cells.append(Cells(cell_type, vertices.astype(np.int64)))
        tags.append(numbered[mine].astype(np.int64))


def _edge_numbers(lines: TextLines, descriptors: _Section | None, places: np.ndarray) -> np.ndarray:
    """The numbers of edges, which their descriptors begin with; places: of each one's, counted from 0."""
    known = range(descriptors.first, descriptors.first + descriptors.rows) if descriptors else range(0)
    numbers = []
    for line in known:
        number = lines.words(line)[0]
        if not _COUNT.fullmatch(number):
            raise lines.refusal(line, "a descriptor begins with the number of its edge")
        numbers.append(int(number))
    wrong = (places < 0) | (places >= len(numbers))
    if wrong.any():
        raise InputError(f"an edge has descriptor {places[wrong][0]}, which does not exist")
    return np.array(numbers, dtype=np.int64)[places]


def _add_names(
    lines: TextLines, section: _Section, dimension: int, mesh: Mesh, tags: list[np.ndarray]
) -> None:
    """Make cell sets of the names of what has this dimension; what has no name has none."""
    for line in range(section.first, section.first + section.rows):
        number, *words = lines.words(line)
        if not _COUNT.fullmatch(number):
            raise lines.refusal(line, "a number and a name are expected here")
        name = b" ".join(words).decode("utf-8", "replace")
        members = [
            np.flatnonzero(tag == int(number)) if _dimension(block) == dimension else np.empty(0, np.int64)
            for block, tag in zip(mesh.cells, tags, strict=True)
        ]
        if name and any(map(len, members)):
            before = mesh.cell_sets.get(name, [np.empty(0, np.int64)] * len(members))
            mesh.cell_sets[name] = [np.union1d(a, b) for a, b in zip(before, members, strict=True)]


def _dimension(block: Cells) -> int:
    return next(dimension for (dimension, _), (name, _) in _TYPES.items() if name == block.type)


def _links(lines: TextLines, section: _Section, n_points: int) -> np.ndarray:
    """(K, 2) pairs of identified points."""
    rows: Rows = lines.rows(section.first, section.rows, 2, "pair of points")
    numbers = lines.numbers(rows, section.first, np.float64)
    pairs = numbers[rows.first[:, None] + np.arange(2)] - 1
    if not ((pairs >= 0) & (pairs < n_points) & (pairs == np.rint(pairs))).all():
        raise InputError("section identifications names points that do not exist")
    return pairs.astype(np.int64)
