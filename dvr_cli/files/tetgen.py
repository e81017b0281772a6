"""TetGen meshes, and Triangle's in the plane: text files, .node (vertices) and .ele (elements).

Beside them may be .face and .edge files with boundary markers: what is marked there becomes cells of lower
dimension. Only the .node file holds coordinates, so it alone is written anew; the others go with it as they
are. What else these programs write (.neigh, .smesh, .poly, ...) is neither read nor written.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import Rows, inside_spans
from dvr_cli.files.patched_text import PatchedText
from dvr_cli.files.source import InputFile
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells, Mesh

_MOST = 1 << 40  # larger counts can only come from damage
# The place in the file of each node in meshio's order. TetGen lists the edges of a tetrahedron in another
# order; Triangle names midsides by the opposite corner.
_ORDERS = {
    "triangle": [0, 1, 2],
    "triangle6": [0, 1, 2, 5, 3, 4],
    "tetra": [0, 1, 2, 3],
    "tetra10": [0, 1, 2, 3, 6, 7, 9, 5, 8, 4],
}
_TYPES = {(CELL_TYPES[name].dimension, CELL_TYPES[name].nodes): name for name in _ORDERS}


# Files of facets that may be there, and for each kind of element (as above) by how many nodes its facets may
# be given. Of two that fit, the last is meant: TetGen names midsides where elements have some, Triangle does
# not. The faces of a planar mesh are its elements.
_MARKED = {
    ".face": {(3, 4): (3,), (3, 10): (3, 6)},
    ".edge": {(2, 3): (2,), (2, 6): (2,), (3, 4): (2,), (3, 10): (2, 3)},
}
_FACETS = {
    (".face", 3): ("triangle", [0, 1, 2]),
    (".face", 6): ("triangle6", [0, 1, 2, 5, 3, 4]),
    (".edge", 2): ("line", [0, 1]),
    (".edge", 3): ("line3", [0, 1, 2]),
}
_NEIGHBOURS = {".face": 2, ".edge": 1}  # columns with numbers of elements, which come last if at all


class TetgenSource(PatchedText):
    """Files of one mesh; ``write`` writes the .node file, those of ``beside`` (suffix -> bytes) go along."""

    def __init__(
        self, node: bytes, beside: dict[str, bytes], mesh: Mesh, starts: np.ndarray, ends: np.ndarray
    ) -> None:
        super().__init__("tetgen", node, mesh, starts, ends)
        self._beside = beside

    @property
    def main(self) -> Path | None:
        """The .node file, whichever of them was named."""
        return self.target and self.target.with_suffix(".node")

    def companions(self, points: np.ndarray) -> dict[Path, bytes]:
        """The other files, as they were."""
        return {self.target.with_suffix(suffix): data for suffix, data in self._beside.items() if self.target}


def read(file: InputFile) -> TetgenSource:
    """Read the files of a mesh, of which ``file`` is the .node or the .ele file; see ``read_files``."""
    if file.path is None:
        raise InputError("a TetGen mesh is several files and cannot be piped")
    there = [suffix for suffix in _MARKED if file.path.with_suffix(suffix).exists()]
    node, *others = (file.beside(file.path.with_suffix(suffix).name) for suffix in (".node", ".ele", *there))
    return read_files(node, dict(zip((".ele", *there), others, strict=True)))


def read_files(node: bytes, beside: dict[str, bytes]) -> TetgenSource:
    """Read the .node file of a mesh and those ``beside`` it, by suffix: .ele, and .face and .edge if any.

    Attributes of vertices become the point data "tetgen:attr1", "tetgen:attr2", ..., boundary markers the
    point data "tetgen:ref", and attributes of elements (regions) the cell data "tetgen:ref", "tetgen:ref2",
    ...; whole numbers come as integers. Points have 2 coordinates if the file says so.

    The faces and edges that have a boundary marker other than 0 are cells behind the elements, and
    "tetgen:ref" is their marker. (Marker 0 says that a facet is none of the boundary or of an interface.)

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

    elements = _Table(beside[".ele"], ".ele", "elements, nodes of each, attributes", 2)
    n_nodes, n_attributes = [*elements.header[1:], 0][:2]
    if (dimension, n_nodes) not in _TYPES:
        raise InputError(
            f"the .ele file has elements of {n_nodes} nodes in {dimension}D, which are not supported"
        )
    values = elements.read(1 + n_nodes + n_attributes)
    cell_type = _TYPES[dimension, n_nodes]
    cells = values[:, 1 : 1 + n_nodes][:, _ORDERS[cell_type]]
    blocks = [Cells(cell_type, _vertices(cells, ".ele", int(index[0]), len(points)))]
    cell_data = {name: [tags] for name, tags in _references(values[:, 1 + n_nodes :]).items()}
    for suffix, possible in _MARKED.items():
        if suffix in beside and (dimension, n_nodes) in possible:
            widths = possible[dimension, n_nodes]
            marked = _read_marked(beside[suffix], suffix, widths, int(index[0]), len(points))
            if marked is not None:
                _append(blocks, cell_data, *marked)
    mesh = Mesh(points, blocks, cell_data, point_data)
    return TetgenSource(node, beside, mesh, *vertices.spans(np.arange(1, 1 + dimension)))


def _vertices(cells: np.ndarray, suffix: str, first: int, n_points: int) -> np.ndarray:
    """Vertex numbers, as they stand in the file, counted from 0; (n, k) int64."""
    vertices = cells - first
    wrong = (vertices < 0) | (vertices >= n_points) | (vertices != np.rint(vertices))
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise InputError(
            f"row {row} of the {suffix} file names vertex {cells[row, column]:g}, which does not exist"
        )
    return vertices.astype(np.int64)


def _read_marked(
    data: bytes, suffix: str, possible: tuple[int, ...], first: int, n_points: int
) -> tuple[Cells, np.ndarray] | None:
    """The faces or edges in a file whose marker is not 0, and the markers; None if there are none.

    possible: how many nodes they may have. first: the number of the first vertex.
    """
    table = _Table(data, suffix, "facets, markers", 1)
    n_facets, n_markers = [*table.header, 0][:2]
    if n_markers == 0 or n_facets == table.columns() == 0:
        return None
    more = (0, _NEIGHBOURS[suffix])
    nodes_of = {1 + n_nodes + n_markers + extra: n_nodes for n_nodes in possible for extra in more}
    if table.columns() not in nodes_of:
        raise InputError(f"row 0 of the {suffix} file has {table.columns()} numbers, not {min(nodes_of)}")
    n_nodes = nodes_of[table.columns()]
    values = table.read(2 + n_nodes)
    markers = values[:, 1 + n_nodes]
    if not markers.any():
        return None
    vertices = _vertices(values[:, 1 : 1 + n_nodes], suffix, first, n_points)[markers != 0]
    cell_type, order = _FACETS[suffix, n_nodes]
    return Cells(cell_type, vertices[:, order]), _integers_if_whole(markers[markers != 0])


def _append(
    blocks: list[Cells], cell_data: dict[str, list[np.ndarray]], cells: Cells, markers: np.ndarray
) -> None:
    """Add a block of cells with their markers; other data, and those of elements without any, are 0."""
    if not cell_data:
        cell_data["tetgen:ref"] = [np.zeros(len(block.vertices), dtype=np.int64) for block in blocks]
    for name, tags in cell_data.items():
        tags.append(markers if name == "tetgen:ref" else np.zeros(len(markers), dtype=np.int64))
    blocks.append(cells)


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

    def columns(self) -> int:
        """The number of columns in the first row, 0 if there is none."""
        return int(self._rows.counts[self._filled[1]]) if len(self._filled) > 1 else 0

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
        """Begin and end in the file of the numbers in ``columns`` of each row, (rows, columns) each."""
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
