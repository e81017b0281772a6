"""TetGen meshes, and Triangle's in the plane: a pair of text files, .node (vertices) and .ele (elements).

Only the .node file holds coordinates, so it alone is written anew; the .ele file goes with it as it is.
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import Rows, inside_spans, write_replaced
from dvr_cli.files.source import InputFile, Source, differing
from dvr_cli.mesh.mesh import Cells, Mesh

_MOST = 1 << 40  # larger counts can only come from damage
# (dimension, nodes of an element): meshio's type, and the place in the file of each node in meshio's order.
# TetGen lists the edges of a tetrahedron in another order; Triangle names midsides by the opposite corner.
_TYPES = {
    (2, 3): ("triangle", [0, 1, 2]),
    (2, 6): ("triangle6", [0, 1, 2, 5, 3, 4]),
    (3, 4): ("tetra", [0, 1, 2, 3]),
    (3, 10): ("tetra10", [0, 1, 2, 3, 6, 7, 9, 5, 8, 4]),
}


class TetgenSource(Source):
    """A pair of .node and .ele files; ``write`` writes the .node file, the .ele file is a companion."""

    format = "tetgen"

    def __init__(self, node: bytes, ele: bytes, mesh: Mesh, starts: np.ndarray, ends: np.ndarray) -> None:
        super().__init__()
        self.mesh = mesh
        self._node = node
        self._ele = ele
        self._starts = starts
        self._ends = ends

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the .node file with the coordinates ``points`` ((N, 2) or (N, 3))."""
        changed = differing(points, self.mesh.points)
        write_replaced(file, self._node, self._starts[changed], self._ends[changed], points[changed])

    @property
    def main(self) -> Path | None:
        """The .node file, whichever of the two was named."""
        return self.target and self.target.with_suffix(".node")

    def companions(self, points: np.ndarray) -> dict[Path, bytes]:
        """The .ele file, as it was."""
        return {self.target.with_suffix(".ele"): self._ele} if self.target else {}


def read(file: InputFile) -> TetgenSource:
    """Read a pair of files, either of which is ``file``; see ``read_pair``."""
    if file.path is None:
        raise InputError("a TetGen mesh is two files and cannot be piped")
    return read_pair(*(file.beside(file.path.with_suffix(suffix).name) for suffix in (".node", ".ele")))


def read_pair(node: bytes, ele: bytes) -> TetgenSource:
    """Read the .node and the .ele file of a mesh.

    Attributes of vertices become the point data "tetgen:attr1", "tetgen:attr2", ..., boundary markers the
    point data "tetgen:ref", and attributes of elements (regions) the cell data "tetgen:ref", "tetgen:ref2",
    ...; whole numbers come as integers. Points have 2 coordinates if the file says so.

    Raises InputError for what is damaged, or elements other than linear and quadratic simplices.
    """
    vertices = _Table(node, ".node", "points, dimension, attributes, markers", 2)
    dimension, n_attributes, n_markers = [*vertices.header[1:], 0, 0][:3]
    if dimension not in (2, 3):
        raise InputError(f"the .node file declares dimension {dimension}; 2 or 3 are possible")
    values = vertices.read(1 + dimension + n_attributes + n_markers)
    index = values[:, 0]
    if index[0] not in (0, 1) or (index != index[0] + np.arange(len(index))).any():
        raise InputError("the vertices of the .node file are not numbered from 0 or 1 without gaps")
    points = values[:, 1 : 1 + dimension].astype(np.float64)
    extra = values[:, 1 + dimension :]
    point_data = {f"tetgen:attr{i + 1}": _integers_if_whole(extra[:, i]) for i in range(n_attributes)}
    point_data |= _references(extra[:, n_attributes:])

    elements = _Table(ele, ".ele", "elements, nodes of each, attributes", 2)
    n_nodes, n_attributes = [*elements.header[1:], 0][:2]
    if (dimension, n_nodes) not in _TYPES:
        raise InputError(
            f"the .ele file has elements of {n_nodes} nodes in {dimension}D, which are not supported"
        )
    values = elements.read(1 + n_nodes + n_attributes)
    cell_type, order = _TYPES[dimension, n_nodes]
    cells = values[:, 1 : 1 + n_nodes][:, order]
    corner = cells - index[0]
    wrong = (corner < 0) | (corner >= len(points)) | (corner != np.rint(corner))
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise InputError(
            f"element {row} of the .ele file names vertex {cells[row, column]:g}, which does not exist"
        )
    cell_data = {name: [tags] for name, tags in _references(values[:, 1 + n_nodes :]).items()}
    mesh = Mesh(points, [Cells(cell_type, corner.astype(np.int64))], cell_data, point_data)
    return TetgenSource(node, ele, mesh, *vertices.spans(np.arange(1, 1 + dimension)))


class _Table:
    """A text file of a header line of whole numbers and as many rows of numbers as it says first.

    header: the numbers of the header line.
    """

    def __init__(self, data: bytes, name: str, header: str, least: int) -> None:
        """``least``: how many numbers the header has at least; ``header`` and ``name`` are for messages."""
        text = np.frombuffer(bytearray(data + b"\n"), dtype=np.uint8)
        ends = np.flatnonzero((text == ord("\n")) | (text == ord("\r")))
        starts = np.concatenate([[0], ends[:-1] + 1])
        hashes = np.flatnonzero(text == ord("#"))
        line = np.searchsorted(ends, hashes)
        first = np.diff(line, prepend=-1) > 0
        text[inside_spans(len(text), hashes[first], ends[line[first]])] = ord(" ")  # comments
        self._name = name
        self._rows = Rows(text, starts, ends + 1)
        self._filled = np.flatnonzero(self._rows.counts)
        if not len(self._filled):
            raise InputError(f"the {name} file is empty")
        self.header = self._read_header(header, least)

    def read(self, columns: int) -> np.ndarray:
        """The first ``columns`` numbers of each row, (rows, columns); there has to be a row."""
        rows, body = self._rows, self._filled[1:]
        if len(body) != self.header[0] or not len(body):
            raise InputError(f"the {self._name} file declares {self.header[0]} rows, but has {len(body)}")
        short = rows.counts[body] < columns
        if short.any():
            raise InputError(
                f"row {np.argmax(short)} of the {self._name} file has fewer than {columns} numbers"
            )
        tokens = int(rows.counts[body].sum())
        header = self._filled[:1]
        skipped = rows.first[header] + rows.counts[header]
        rows.blank_out(rows.starts[rows.first[header]], rows.ends[skipped - 1])
        try:
            numbers = rows.numbers(tokens, np.int64)
        except ValueError:
            try:
                numbers = rows.numbers(tokens, np.float64)
            except ValueError:
                raise InputError(f"the {self._name} file holds something that is not a number") from None
        return numbers[(rows.first[body] - skipped)[:, None] + np.arange(columns)]

    def spans(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where in the file the numbers in ``columns`` of each row begin and end, (rows, columns) each."""
        return self._rows.source_spans(self._filled[1:], columns)

    def _read_header(self, what: str, least: int) -> list[int]:
        line = int(self._filled[0])
        count = int(self._rows.counts[line])
        try:
            header = self._rows.line_numbers(line, count, np.int64).tolist()
        except ValueError:
            header = []
        if len(header) < least or min(header) < 0 or max(header) > _MOST:
            raise InputError(f"the {self._name} file should begin with the numbers of {what}")
        return header


def _references(columns: np.ndarray) -> dict[str, np.ndarray]:
    """Columns by meshio's names for tags."""
    names = ["tetgen:ref", *(f"tetgen:ref{i + 1}" for i in range(1, columns.shape[1]))]
    return {name: _integers_if_whole(columns[:, i]) for i, name in enumerate(names[: columns.shape[1]])}


def _integers_if_whole(values: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        whole = values.astype(np.int64)
    return whole if (whole == values).all() else values.copy()
