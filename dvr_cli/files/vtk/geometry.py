"""The geometry of a legacy VTK file: the sections in front of the data, that is its points and cells."""

from __future__ import annotations

import codecs
from dataclasses import dataclass, field

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import shown
from dvr_cli.files.vtk.cells import (
    POLY_LINE,
    POLY_VERTEX,
    POLYGON,
    CellList,
    joined,
    list_with_counts,
    list_with_offsets,
)
from dvr_cli.files.vtk.data import read_field
from dvr_cli.files.vtk.scan import Scanner, is_integer

# The sections with the cells of each kind of data set, in the order in which VTK counts the cells.
_CELL_SECTIONS = {
    "unstructured_grid": ("cells",),
    "polydata": ("vertices", "lines", "polygons"),
    "structured_grid": (),
}
_TYPE_OF = {"vertices": POLY_VERTEX, "lines": POLY_LINE, "polygons": POLYGON}
_IMPLICIT = ("structured_points", "rectilinear_grid")


@dataclass(frozen=True)
class PointsSection:
    """The place of a file's coordinates: offsets in its bytes.

    type_name: their type in lower case; the word itself begins at ``type_begin``.
    begin, end: the coordinates.
    """

    binary: bool
    type_name: str
    type_begin: int
    begin: int
    end: int


@dataclass
class Geometry:
    """The contents of the sections up to POINT_DATA or CELL_DATA.

    dataset: "unstructured_grid", "polydata" or "structured_grid".
    section, points: the POINTS, (N, 3) in the type of the file.
    lists: the list of cells of each section that has one.
    types: VTK's cell types, for an unstructured grid with cells.
    dimensions: points in each direction, for a structured grid.
    unread: what ended the reading when all of the above had been read; None if that was the data.
    """

    dataset: str
    section: PointsSection | None = None
    points: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    lists: dict[str, CellList] = field(default_factory=dict)
    types: np.ndarray | None = None
    dimensions: tuple[int, int, int] | None = None
    unread: str | None = None

    def cells(self) -> tuple[CellList, np.ndarray]:
        """All cells listed in the file in VTK's order, and the VTK type of each."""
        names = [name for name in _CELL_SECTIONS[self.dataset] if name in self.lists]
        cells = joined([self.lists[name] for name in names])
        if self.types is not None:
            return cells, self.types
        kinds = np.array([_TYPE_OF[name] for name in names], dtype=np.int64)
        return cells, np.repeat(kinds, [len(self.lists[name].sizes) for name in names])


def read_geometry(scanner: Scanner) -> Geometry:
    """Read from the beginning of the file up to its point or cell data.

    Raises InputError for what is no legacy VTK file, is damaged, or is of a kind that is not supported.
    """
    _read_header(scanner)
    geometry = Geometry(_read_dataset(scanner))
    while (keyword := scanner.peek()) not in ("", "point_data", "cell_data"):
        problem = _read_section(scanner, keyword, geometry)
        if problem and _is_complete(geometry):
            geometry.unread = problem
            break
        if problem:
            raise InputError(problem)
    _check(geometry)
    return geometry


def _read_header(scanner: Scanner) -> None:
    if scanner.data.startswith(codecs.BOM_UTF8):
        scanner.position = len(codecs.BOM_UTF8)
    if not scanner.line().startswith(b"# vtk DataFile Version"):
        raise InputError("not a legacy VTK file: it does not begin with '# vtk DataFile Version'")
    scanner.line()  # the title
    coding = scanner.word("ASCII or BINARY")
    if coding.lower() not in (b"ascii", b"binary"):
        raise InputError(f"the third line should be ASCII or BINARY, not {shown(coding)}")
    scanner.binary = coding.lower() == b"binary"


def _read_dataset(scanner: Scanner) -> str:
    keyword = scanner.word("DATASET")
    if keyword.lower() != b"dataset":
        raise InputError(f"DATASET should follow, not {shown(keyword)}")
    word = scanner.word("the kind of the data set")
    dataset = word.lower().decode("latin-1")
    if dataset in _IMPLICIT:
        name = dataset.upper()
        raise InputError(f"the points of a {name} are implied; convert it to an UNSTRUCTURED_GRID")
    if dataset not in _CELL_SECTIONS:
        raise InputError(f"DATASET {shown(word)} is not supported")
    return dataset


def _read_section(scanner: Scanner, keyword: str, geometry: Geometry) -> str | None:
    """Read one section into ``geometry``; what is wrong with its keyword, if it cannot be read."""
    scanner.word(keyword)
    grid = geometry.dataset == "structured_grid"
    if keyword == "field":
        for name, _ in read_field(scanner):  # belongs to neither points nor cells
            scanner.passed.append(("field array", name))
    elif keyword == "points":
        _once(geometry.section, "POINTS")
        _read_points(scanner, geometry)
    elif keyword in _CELL_SECTIONS[geometry.dataset]:
        _once(geometry.lists.get(keyword), keyword.upper())
        geometry.lists[keyword] = _read_cells(scanner, keyword.upper())
    elif keyword == "cell_types" and geometry.dataset == "unstructured_grid":
        _once(geometry.types, "CELL_TYPES")
        geometry.types = scanner.values("int", scanner.count("the number of CELL_TYPES"), "CELL_TYPES")
    elif keyword in ("dimensions", "extent") and grid:
        _once(geometry.dimensions, "DIMENSIONS")
        geometry.dimensions = _read_dimensions(scanner, keyword)
    elif keyword == "blanking" and grid:
        raise InputError("BLANKING (hidden points) is not supported")
    elif keyword == "triangle_strips":
        raise InputError("TRIANGLE_STRIPS are not supported; convert them to triangles")
    else:
        return f"unknown section {shown(keyword)}"
    return None


def _once(earlier: object, name: str) -> None:
    if earlier is not None:
        raise InputError(f"there are two {name} sections")


def _read_points(scanner: Scanner, geometry: Geometry) -> None:
    n = scanner.count("the number of POINTS")
    type_name = scanner.type_name("POINTS")
    type_begin = scanner.position - len(type_name)
    begin, end = scanner.extent(type_name, 3 * n, "POINTS")
    geometry.section = PointsSection(scanner.binary, type_name, type_begin, begin, end)
    geometry.points = scanner.parse(type_name, 3 * n, "POINTS", (begin, end)).reshape(n, 3)
    scanner.skip_metadata(3)


def _read_cells(scanner: Scanner, name: str) -> CellList:
    n = scanner.count(f"the number of {name}")
    m = scanner.count(f"the size of {name}")
    if scanner.peek() != "offsets":
        return list_with_counts(scanner.values("int", m, name), n, name)
    offsets = _read_integers(scanner, "OFFSETS", n)
    if scanner.peek() != "connectivity":
        raise InputError(f"{name} has OFFSETS, but no CONNECTIVITY behind them")
    return list_with_offsets(offsets, _read_integers(scanner, "CONNECTIVITY", m), name)


def _read_integers(scanner: Scanner, name: str, count: int) -> np.ndarray:
    scanner.word(name)
    type_name = scanner.type_name(name)
    if not is_integer(type_name):
        raise InputError(f"{name} should be whole numbers, not {shown(type_name)}")
    values = scanner.values(type_name, count, name)
    scanner.skip_metadata(1)
    return values


def _read_dimensions(scanner: Scanner, keyword: str) -> tuple[int, int, int]:
    if keyword == "extent":
        ends = [scanner.integer("EXTENT") for _ in range(6)]
        sizes = [last - first + 1 for first, last in zip(ends[::2], ends[1::2], strict=True)]
    else:
        sizes = [scanner.integer("DIMENSIONS") for _ in range(3)]
    if min(sizes) < 1:
        raise InputError(f"{keyword.upper()} should be positive in all directions")
    return sizes[0], sizes[1], sizes[2]


def _is_complete(geometry: Geometry) -> bool:
    if geometry.dataset == "unstructured_grid":
        return geometry.section is not None and "cells" in geometry.lists and geometry.types is not None
    return geometry.section is not None and geometry.dimensions is not None


def _check(geometry: Geometry) -> None:
    n = len(geometry.points)
    if n == 0:
        raise InputError("the file has no POINTS")
    if geometry.dataset == "unstructured_grid":
        listed = len(geometry.lists["cells"].sizes) if "cells" in geometry.lists else 0
        typed = 0 if geometry.types is None else len(geometry.types)
        if listed != typed:
            raise InputError(f"CELLS has {listed} cells, but CELL_TYPES has {typed} types")
    if geometry.dataset == "structured_grid":
        if geometry.dimensions is None:
            raise InputError("the STRUCTURED_GRID has no DIMENSIONS")
        nx, ny, nz = geometry.dimensions
        if nx * ny * nz != n:
            raise InputError(f"DIMENSIONS {nx} {ny} {nz} do not match the {n} POINTS")
