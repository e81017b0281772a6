"""A VTK XML file as a Source: read piece by piece, and written back by replacing arrays in its bytes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import BinaryIO
from xml.sax.saxutils import quoteattr

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.losses import not_kept
from dvr_cli.files.numbers_in_text import parse_numbers, shown
from dvr_cli.files.source import Source, differing
from dvr_cli.files.vtkxml.arrays import Stored, StoredArray, encode, is_numeric, text_with
from dvr_cli.files.vtkxml.layout import Layout, count_of, layout_of
from dvr_cli.files.xml_places import Edit, Element, attribute_place, edited, write_edited
from dvr_cli.mesh.mesh import Cells, Mesh

# Reads the cells of a piece: blocks, and for each the numbers in the piece of its cells.
CellReader = Callable[[Layout, Element, int, int], tuple[list[Cells], list[np.ndarray]]]


GHOSTS = ("vtkGhostLevels", "vtkGhostType")  # what says of cells that they are another piece's


@dataclass(frozen=True)
class Kind:
    """A kind of VTK XML file.

    format: its name here; dataset: its name in VTK.
    counts: the attributes of a piece that count its cells.
    cells: reads the cells of a piece, given its layout, element and numbers of points and cells.
    """

    format: str
    dataset: str
    counts: tuple[str, ...]
    cells: CellReader


@dataclass(frozen=True)
class PiecePoints:
    """The coordinates of a piece.

    array, stored: where and how they are; None in a piece without points.
    first, last: its points among those of the mesh, from first to below last.
    """

    element: Element
    array: StoredArray
    stored: Stored
    first: int
    last: int


class VtkXmlSource(Source):
    """A VTK XML file."""

    def __init__(self, kind: Kind, layout: Layout, mesh: Mesh, numbers: list[list[np.ndarray]]) -> None:
        """numbers: for each piece, for each of its blocks, the numbers in the piece of its cells."""
        super().__init__()
        self.format = kind.format
        self.mesh = mesh
        self._kind = kind
        self._layout = layout
        self._numbers = numbers
        self._points = _points_of(layout)

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the file with the coordinates ``points`` ((N, 3)), rounded where it stores Float32.

        Coordinates that are whole numbers become Float64 as soon as one has changed.
        """
        points = self.stored(points)
        if not differing(points, self.mesh.points).any():
            file.write(self._layout.data)
        elif self._integers():
            self._as_float64().write(points, file)
        else:
            write_edited(file, self._layout.data, self._edits(points))

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of the output gets: rounded in the pieces that store Float32."""
        result = points.copy()
        for piece in self._points:
            if piece.array.dtype == np.float32 and not self._integers():
                with np.errstate(over="ignore"):
                    result[piece.first : piece.last] = points[piece.first : piece.last].astype(np.float32)
        return result

    def widened(self) -> VtkXmlSource | None:
        """The same file with its points stored as Float64, for coordinates that rounding would spoil."""
        if all(piece.array.dtype == np.float64 for piece in self._points):
            return None
        return self._as_float64()

    def with_cell_field(self, name: str, values: list[np.ndarray], points: np.ndarray) -> VtkXmlSource:
        """The same file with one array more in each piece, in place of one of that name if there is one."""
        edits = []
        first = 0
        for piece, numbers in zip(self._layout.pieces, self._numbers, strict=True):
            n_cells = sum(count_of(piece, count) for count in self._kind.counts)
            of_cells = np.full(n_cells, np.nan)
            for number, block in zip(numbers, values[first : first + len(numbers)], strict=True):
                of_cells[number] = block
            first += len(numbers)
            if n_cells:
                edits.append(self._insertion(piece, name, of_cells))
        mesh = replace(self.mesh, cell_data={**self.mesh.cell_data, name: values})
        return self._rewritten(edited(self._layout.data, edits), mesh)

    def _insertion(self, piece: Element, name: str, values: np.ndarray) -> Edit:
        """The edit that puts an array into the CellData of a piece."""
        data = self._layout.data
        head = f'<DataArray type="Float64" Name={quoteattr(name)} format="binary">'
        array = b"\n".join([head.encode(), encode(self._layout.coding, True, values), b"</DataArray>"])
        parents = piece.named("CellData")
        if not parents:
            return Edit(piece.inside, piece.inside, b"\n<CellData>\n" + array + b"\n</CellData>")
        parent = parents[0]
        for old in parent.children:
            if old.attributes.get("Name") == name:
                return Edit(old.begin, old.end, array)
        if parent.end == parent.inside:  # <CellData/>
            slash = data.rindex(b"/", parent.begin, parent.inside)
            return Edit(slash, parent.end, b">\n" + array + b"\n</CellData>")
        return Edit(parent.end_tag, parent.end_tag, array + b"\n")

    def _integers(self) -> bool:
        return any(piece.array.dtype.kind != "f" for piece in self._points)

    def _edits(self, points: np.ndarray, wide: bool = False) -> list[Edit]:
        """The edits that replace the coordinates, and those that follow where arrays got longer or shorter.

        wide: store Float64 in all pieces.
        """
        layout = self._layout
        edits, moved = [], []
        for piece in self._points:
            values = points[piece.first : piece.last].ravel()
            stored, array = piece.stored, piece.array
            if wide and array.dtype != np.float64:
                edits.append(Edit(*attribute_place(layout.data, piece.element, "type"), b"Float64"))
                dtype, old = np.dtype(np.float64), _exactly(layout, array, stored)
            else:
                dtype, old = array.dtype, stored.values
            changed = differing(values, old.astype(np.float64))
            if not changed.any() and dtype == array.dtype:
                continue
            if array.form == "ascii":
                new = text_with(layout.data, array, changed, values)
            else:
                target = old.astype(dtype)
                target[changed] = values[changed]
                new = encode(layout.coding, array.form == "base64", target, stored)
            edits.append(Edit(stored.begin, stored.end, new))
            if piece.element.attributes.get("format") == "appended":
                moved.append((stored.begin, len(new) - (stored.end - stored.begin)))
        return edits + _shifts(layout, moved)

    def _as_float64(self) -> VtkXmlSource:
        """The same file with Float64 for all coordinates, of the values they have."""
        return self._rewritten(edited(self._layout.data, self._edits(self.mesh.points, wide=True)), self.mesh)

    def _rewritten(self, data: bytes, mesh: Mesh) -> VtkXmlSource:
        layout = layout_of(data, self._kind.dataset, self._kind.format)
        source = VtkXmlSource(self._kind, layout, mesh, self._numbers)
        source.unread, source.notes, source.target = self.unread, list(self.notes), self.target
        return source


def read_file(data: bytes, kind: Kind) -> VtkXmlSource:
    """Read a VTK XML file of this kind.

    Its pieces make one mesh, their points and cells one after the other: a point that two pieces share is
    there twice, and these are linked, so that none of them moves by itself. Point and cell data are the
    arrays of numbers that all pieces have.

    Raises InputError for what cannot be read, and for ghost cells, which two pieces share.
    """
    layout = layout_of(data, kind.dataset, kind.format)
    if not layout.pieces:
        raise InputError("there is no Piece in it")
    points, blocks, numbers = [np.empty((0, 3))], [], []
    point_data: list[dict[str, np.ndarray]] = []
    cell_data: list[dict[str, list[np.ndarray]]] = []
    first = 0
    for piece in layout.pieces:
        n_points = count_of(piece, "NumberOfPoints")
        n_cells = sum(count_of(piece, count) for count in kind.counts)
        points.append(_coordinates(layout, piece, n_points))
        of_piece, number = kind.cells(layout, piece, n_points, n_cells)
        blocks += [Cells(block.type, block.vertices + first) for block in of_piece]
        numbers.append(number)
        if n_points:
            point_data.append(_data(layout, piece, "PointData", n_points))
        if n_cells:
            arrays = _data(layout, piece, "CellData", n_cells)
            _refuse_ghosts(arrays)
            cell_data.append({name: [values[n] for n in number] for name, values in arrays.items()})
        first += n_points
    of_points = {name: np.concatenate([d[name] for d in point_data]) for name in _common(point_data)}
    of_cells = {name: [b for d in cell_data for b in d[name]] for name in _common(cell_data)}
    links = _shared(np.concatenate(points), [len(part) for part in points])
    mesh = Mesh(np.concatenate(points), blocks, of_cells, of_points, periodic=links)
    source = VtkXmlSource(kind, layout, mesh, numbers)
    source.unread = _unread(layout, set(of_points), set(of_cells))
    return source


def points_element(piece: Element, n_points: int) -> Element | None:
    """The array of the coordinates of a piece, None if it has no points."""
    arrays = [array for part in piece.named("Points") for array in part.named("DataArray")]
    if len(arrays) > 1:
        raise InputError(f"a piece has {len(arrays)} arrays of points; a series in time is not supported")
    if n_points and not arrays:
        raise InputError(f"a piece of {n_points} points has no array of them")
    return arrays[0] if n_points else None


def piece_arrays(piece: Element, where: str) -> list[Element]:
    """The arrays in a piece's PointData, CellData or the like."""
    return [array for part in piece.named(where) for array in part.children]


def _coordinates(layout: Layout, piece: Element, n_points: int) -> np.ndarray:
    element = points_element(piece, n_points)
    if element is None:
        return np.empty((0, 3))
    components = element.attributes.get("NumberOfComponents", "1")
    if components != "3":
        raise InputError(f"the points have {shown(components)} coordinates, where VTK has 3")
    return layout.read(element, "Points", 3 * n_points).values.reshape(-1, 3).astype(np.float64)


def _points_of(layout: Layout) -> list[PiecePoints]:
    """The coordinates of all pieces that have points, which no other array may share."""
    result = []
    first = 0
    for piece in layout.pieces:
        n = count_of(piece, "NumberOfPoints")
        element = points_element(piece, n)
        if element is not None:
            stored = layout.read(element, "Points", 3 * n)
            result.append(PiecePoints(element, layout.array(element, "Points"), stored, first, first + n))
        first += n
    for points in result:
        for element, begin in appended_arrays(layout):
            if element is not points.element and points.stored.begin <= begin < points.stored.end:
                raise InputError("the coordinates share their bytes with another array")
    return result


def appended_arrays(layout: Layout) -> list[tuple[Element, int]]:
    """The elements of arrays among the appended data, and where in the file each begins."""
    if layout.appended is None:
        return []
    return [
        (element, layout.appended[0] + int(element.attributes["offset"]))
        for element in layout.dataset.walk()
        if element.attributes.get("format") == "appended" and element.attributes.get("offset", "").isdecimal()
    ]


def _shifts(layout: Layout, moved: list[tuple[int, int]]) -> list[Edit]:
    """New offsets of the appended arrays behind those that begin at moved[i][0] and grew by moved[i][1]."""
    edits = []
    for element, begin in appended_arrays(layout) if any(by for _, by in moved) else ():
        by = sum(by for at, by in moved if at < begin)
        if by:
            place = attribute_place(layout.data, element, "offset")
            edits.append(Edit(*place, b"%d" % (int(element.attributes["offset"]) + by)))
    return edits


def _exactly(layout: Layout, array: StoredArray, stored: Stored) -> np.ndarray:
    """The values of an array in float64: as text has them, if they were rounded on reading."""
    if array.form != "ascii":
        return stored.values.astype(np.float64)
    return parse_numbers(layout.data[array.begin : array.limit], len(stored.values), np.float64)


def _data(layout: Layout, piece: Element, where: str, rows: int) -> dict[str, np.ndarray]:
    """The arrays of numbers in a piece's PointData or CellData: (rows,) or (rows, components) by name."""
    result = {}
    for element in piece_arrays(piece, where):
        name = element.attributes.get("Name", "")
        if not is_numeric(element) or not name:
            continue
        text = element.attributes.get("NumberOfComponents", "1") or "1"
        if not (text.isascii() and text.isdigit()) or not 0 < int(text[:9]) < 1 << 20:
            raise InputError(f"array {shown(name)} has {shown(text)} components")
        values = layout.read(element, f"array {shown(name)}", rows * int(text)).values
        result[name] = values if text == "1" else values.reshape(rows, int(text))
    return result


def _shared(points: np.ndarray, sizes: list[int]) -> np.ndarray:
    """(K, 2) points of a piece that are at the place of one in a piece before it, and that one."""
    if np.count_nonzero(sizes) < 2:
        return np.empty((0, 2), dtype=np.int64)
    piece = np.repeat(np.arange(len(sizes)), sizes)
    _, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    partner = first[inverse.ravel()]
    doubled = np.flatnonzero(piece != piece[partner])
    return np.stack([doubled, partner[doubled]], axis=1)


def _refuse_ghosts(arrays: dict[str, np.ndarray]) -> None:
    """Ghost cells are copies of another piece's: moved by themselves they would part from those."""
    levels, types = (arrays.get(name, np.zeros(1)) for name in GHOSTS)
    if not np.isfinite(types).all():
        raise InputError("vtkGhostType is to say which cells are copies, but has no number for some of them")
    ghosts = levels > 0
    copies = np.abs(np.fmod(types, 2)) >= 1  # the lowest bit, also of numbers that were stored as others
    if ghosts.any() or copies.any():
        raise InputError("ghost cells, copies of cells in another piece, are not supported; remove them")


def _common(pieces: list[dict]) -> list[str]:
    """The names that all pieces have, in the order of the first."""
    return [name for name in (pieces[0] if pieces else ()) if all(name in piece for piece in pieces)]


def _unread(layout: Layout, on_points: set[str], on_cells: set[str]) -> list[str]:
    """The contents of the file beyond the mesh, one line a kind."""
    kinds: dict[str, dict[str, None]] = {"field array": {}, "string array": {}, "array of a part": {}}
    kinds["field array"].update(
        (e.attributes.get("Name", ""), None)
        for part in layout.dataset.walk()
        if part.name == "FieldData"
        for e in part.children
    )
    for where, known in (("PointData", on_points), ("CellData", on_cells)):
        arrays = [array for piece in layout.pieces for array in piece_arrays(piece, where)]
        for array in arrays:
            name = array.attributes.get("Name", "")
            if name not in known:
                kind = "array of a part" if is_numeric(array) else "string array"
                kinds[kind][name] = None
    return [line for what, names in kinds.items() for line in not_kept(names, what)]
