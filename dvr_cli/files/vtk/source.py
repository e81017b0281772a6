"""Legacy VTK files, versions 1.0 to 5.1, ASCII and binary: UNSTRUCTURED_GRID, POLYDATA, STRUCTURED_GRID.

Read without VTK, and written back by replacing the coordinates in the bytes of the file.
"""

from __future__ import annotations

from io import BytesIO
from typing import BinaryIO

import numpy as np

from dvr_cli.files.numbers_in_text import parse_numbers, token_spans, write_replaced
from dvr_cli.files.source import Source, differing, rounded
from dvr_cli.files.vtk.cells import blocks_of, structured_block
from dvr_cli.files.vtk.data import read_data
from dvr_cli.files.vtk.geometry import Geometry, PointsSection, read_geometry
from dvr_cli.files.vtk.scan import Scanner, is_integer
from dvr_cli.mesh.mesh import Cells, Mesh


class VtkSource(Source):
    """A legacy VTK file.

    unread: what is no data of points and cells, and why some of the data behind the cells could not be read
        (they are copied all the same).
    """

    format = "vtk"

    def __init__(self, data: bytes, mesh: Mesh, section: PointsSection, unread: list[str]) -> None:
        super().__init__()
        self.mesh = mesh
        self.unread = unread
        self._data = data
        self._section = section

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the file with the coordinates ``points`` ((N, 3)), rounded if it stores float.

        In a file whose coordinates are whole numbers they become double as soon as one has changed.
        """
        points = self.stored(points)
        changed = differing(points, self.mesh.points)
        section = self._section
        if not changed.any():
            file.write(self._data)
            return
        if is_integer(section.type_name):
            self._as_double().write(points, file)
            return
        view = memoryview(self._data)
        file.write(view[: section.begin])
        if section.binary:
            file.write(points.astype(">f4" if section.type_name == "float" else ">f8").tobytes())
        else:
            self._write_text(points, changed, file)
        file.write(view[section.end :])

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of the output gets: rounded to float32 where the file declares float."""
        if self._section.type_name != "float":
            return points
        return rounded(points)

    def widened(self) -> VtkSource | None:
        """The same file with its points stored as double, for coordinates that rounding would spoil."""
        return None if self._section.type_name == "double" else self._as_double()

    def _as_double(self) -> VtkSource:
        old = self._section
        if old.binary:
            values = self.mesh.points.astype(">f8").tobytes()
        else:
            text = BytesIO()
            exact = parse_numbers(self._data[old.begin : old.end], self.mesh.points.size, np.float64)
            # what was rounded to float on reading is written as rounded
            self._write_text(self.mesh.points, differing(exact.reshape(-1, 3), self.mesh.points), text)
            values = text.getvalue()
        head = self._data[: old.type_begin] + b"double"
        head += self._data[old.type_begin + len(old.type_name) : old.begin]
        section = PointsSection(old.binary, "double", old.type_begin, len(head), len(head) + len(values))
        return VtkSource(head + values + self._data[old.end :], self.mesh, section, self.unread)

    def _write_text(self, points: np.ndarray, changed: np.ndarray, file: BinaryIO) -> None:
        """Write the text of the coordinates with those marked in ``changed`` ((N, 3) bool) replaced."""
        text = self._data[self._section.begin : self._section.end]
        starts, ends = token_spans(np.frombuffer(text, np.uint8))
        mask = changed.ravel()
        write_replaced(file, text, starts[mask], ends[mask], points[changed])


def read(data: bytes) -> VtkSource:
    """Read a legacy VTK file.

    The cells of an UNSTRUCTURED_GRID come in blocks of consecutive cells of one type, in file order (where
    that makes over a thousand blocks, in one block for each type, of ascending number of nodes); those of a
    POLYDATA in one block for each number of nodes, ascending (vertices, lines, triangles, quads, larger
    polygons); those of a STRUCTURED_GRID are what it implies. Polylines are taken apart into lines. Point
    and cell data are the arrays that hold numbers, under their names in the file.

    Raises InputError if the points or cells cannot be read or are of a kind that is not supported. Data
    behind them that cannot be read are left out (``VtkSource.unread`` says why).
    """
    scanner = Scanner(data)
    geometry = read_geometry(scanner)
    assert geometry.section is not None  # there are points
    blocks, numbers = _blocks(geometry)
    n_cells = 1 + max((int(number.max()) for number in numbers), default=-1)
    unread = geometry.unread
    point_data: dict[str, np.ndarray] = {}
    cell_arrays: dict[str, np.ndarray] = {}
    if unread is None:
        point_data, cell_arrays, unread = read_data(scanner, len(geometry.points), n_cells)
    cell_data = {name: [array[number] for number in numbers] for name, array in cell_arrays.items()}
    mesh = Mesh(geometry.points.astype(np.float64), blocks, cell_data, point_data)
    left_out = []
    if scanner.passed:
        from dvr_cli.files.losses import not_kept

        for what in dict.fromkeys(kind for kind, _ in scanner.passed):
            left_out += not_kept((name for kind, name in scanner.passed if kind == what), what)
    left_out += [] if unread is None else [f"some data are not read: {unread}"]
    return VtkSource(data, mesh, geometry.section, left_out)


def _blocks(geometry: Geometry) -> tuple[list[Cells], list[np.ndarray]]:
    """Blocks of cells, and the numbers in the file of the cells in each."""
    if geometry.dimensions is not None:
        block = structured_block(geometry.dimensions)
        return [block], [np.arange(len(block.vertices))]
    cells, types = geometry.cells()
    return blocks_of(cells, types, len(geometry.points), by_size=geometry.dataset == "polydata")
