"""PLY files, read and written back with other coordinates in the bytes they were read from."""

from __future__ import annotations

import io
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import write_replaced
from dvr_cli.files.ply.header import Header, read_header
from dvr_cli.files.records import Kind, Places, Records, items_of
from dvr_cli.files.source import Source, differing, rounded
from dvr_cli.files.vtk.cells import LINE, POLYGON, CellList, blocks_of, joined
from dvr_cli.mesh.mesh import Mesh

_AXES = ("x", "y", "z")
_INDICES = ("vertex_indices", "vertex_index")
_READ = ("vertex", "face", "tristrips", "edge")


class PlySource(Source):
    """A PLY file.

    begin: where its vertices begin. places: (N, 3) where each coordinate is. These are positions in
        ``records``.
    """

    format = "ply"

    def __init__(
        self, data: bytes, header: Header, records: Records, mesh: Mesh, begin: int, places: np.ndarray
    ) -> None:
        super().__init__()
        self.mesh = mesh
        self._data = data
        self._header = header
        self._records = records
        self._points = mesh.points.copy()  # as read, whatever becomes of the mesh
        self._begin = begin
        self._places = places
        vertex = header.kind("vertex")
        assert vertex is not None  # there are points
        self._vertex = vertex
        self._properties = [p for name in _AXES for p in vertex.properties if p.name == name]

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the file with the coordinates ``points`` ((N, 3)), rounded where it stores float.

        In a file whose coordinates are whole numbers they become double as soon as one has changed.
        """
        points = self.stored(points)
        changed = differing(points, self._points)
        if changed.any() and any(p.type[0] != "f" for p in self._properties):
            self._as_double().write(points, file)
            return
        if not self._records.order:
            starts, ends = (side[self._places[changed]] for side in self._records.spans)
            order = np.argsort(starts)  # x need not be the first of the three
            write_replaced(file, self._data, starts[order], ends[order], points[changed][order])
            return
        buffer = np.frombuffer(bytearray(self._data), dtype=np.uint8)
        for axis, p in enumerate(self._properties):
            dtype = np.dtype(self._records.order + p.type)
            moved = changed[:, axis]
            values = np.ascontiguousarray(points[moved, axis].astype(dtype))
            at = self._places[moved, axis, None] + np.arange(dtype.itemsize)
            buffer[at] = values.view(np.uint8).reshape(at.shape)
        file.write(buffer.data)

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of the output gets: rounded to float32 where the file stores float."""
        single = [p.type == "f4" for p in self._properties]
        if not any(single):
            return points
        return np.where(single, rounded(points), points)

    def widened(self) -> PlySource | None:
        """The same file with coordinates of type double, for those that rounding would spoil."""
        if all(p.type == "f8" for p in self._properties) or any(p.count for p in self._vertex.properties):
            return None
        return self._as_double()

    def _as_double(self) -> PlySource:
        """The same file with coordinates of type double; in a binary one vertices have no lists."""
        end = self._header.end
        head, done = b"", 0
        for p in sorted((p for p in self._properties if p.type != "f8"), key=lambda p: p.word):
            first, last = p.word
            head += self._data[done:first]
            head += b"float64" if self._data[last - 1 : last].isdigit() else b"double"
            done = last
        head += self._data[done:end]
        return read(head + (self._wide_rows() if self._records.order else self._rounded_text()[end:]))

    def _rounded_text(self) -> bytes:
        """The file with the coordinates as they were rounded on reading."""
        text = io.BytesIO()
        exact = self._records.values(self._places.ravel(), "f8").reshape(self._places.shape)
        rounded = differing(exact, self._points)
        starts, ends = (side[self._places[rounded]] for side in self._records.spans)
        order = np.argsort(starts)
        write_replaced(text, self._data, starts[order], ends[order], self._points[rounded][order])
        return text.getvalue()

    def _wide_rows(self) -> bytes:
        """The bytes behind the header of a binary file, coordinates in 64 bits."""
        order, properties = self._records.order, self._vertex.properties
        names = [str(i) for i in range(len(properties))]
        old = np.dtype([(name, order + p.type) for name, p in zip(names, properties, strict=True)])
        types = ["f8" if p in self._properties else p.type for p in properties]
        new = np.dtype([(name, order + t) for name, t in zip(names, types, strict=True)])
        before = np.frombuffer(self._data, old, self._vertex.count, self._begin)
        rows = np.empty(len(before), new)
        for name in names:
            rows[name] = before[name]
        behind = self._begin + before.nbytes
        return self._data[self._header.end : self._begin] + rows.tobytes() + self._data[behind:]


def read(data: bytes) -> PlySource:
    """Read a PLY file.

    Cells come in one block for each number of vertices, ascending: edges, triangles, quads, larger polygons;
    strips are taken apart into triangles behind the faces. Numbers that vertices and faces have beside
    coordinates are point and cell data under their names (0 for cells that are no faces).

    Raises InputError for what is no PLY file or damaged, and for vertices without x, y and z.
    """
    header = read_header(data)
    records = Records(data, header.end, header.order)
    at = records.begin
    found: dict[str, tuple[Kind, Places]] = {}
    for kind in header.kinds:
        places = records.places(kind, at)
        found[kind.name] = kind, places
        at = places.end
    if at != records.length and (not header.order or data[at:].strip(b"\0 \t\r\n")):
        raise InputError("there is more behind its last element than the header says")
    if "vertex" not in found or not found["vertex"][0].count:
        raise InputError("it has no vertices")
    points, coordinates = _coordinates(records, *found["vertex"])
    blocks, cell_data = _cells(records, found, len(points))
    mesh = Mesh(points, blocks, cell_data, _scalars(records, *found["vertex"], leave=_AXES))
    source = PlySource(data, header, records, mesh, int(found["vertex"][1].where[0][0]), coordinates)
    source.unread = _unread(header)
    return source


def _coordinates(records: Records, vertex: Kind, places: Places) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (N, 3), and where each is."""
    columns = [vertex.find(name) for name in _AXES]
    properties = [vertex.properties[i] for i in columns if i is not None]
    if len(properties) != 3 or any(p.count for p in properties):
        raise InputError("its vertices do not have the properties x, y and z")
    if any(p.count for p in vertex.properties) and any(p.type[0] != "f" for p in properties):
        raise InputError("vertices that have lists and whole numbers for coordinates are not supported")
    where = np.stack([places.where[i] for i in columns if i is not None], axis=1)
    points = np.empty(where.shape)
    for axis, p in enumerate(properties):
        with np.errstate(over="ignore"):
            values = records.values(where[:, axis], p.type)
            points[:, axis] = values.astype(np.float32) if p.type == "f4" else values
    return points, where


def _scalars(records: Records, kind: Kind, places: Places, leave: tuple[str, ...]) -> dict[str, np.ndarray]:
    """The properties of a kind that are single numbers, by name, but for those to leave out."""
    found = {}
    for p, where in zip(kind.properties, places.where, strict=True):
        if not p.count and p.name not in leave:
            values = records.values(where, p.type)
            kept = values.astype(p.type) if p.type[0] == "f" else records.whole(where, p.type)
            fits = p.type[0] == "f" or _fit(kept, p.type)
            found[p.name] = kept.astype(p.type) if fits else kept
    return found


def _fit(values: np.ndarray, type_name: str) -> bool:
    limits = np.iinfo(type_name)
    return bool(((values >= limits.min) & (values <= limits.max)).all())


def _cells(
    records: Records, found: dict[str, tuple[Kind, Places]], n_points: int
) -> tuple[list, dict[str, list[np.ndarray]]]:
    """The blocks of cells, and their data."""
    nothing = CellList(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, np.int64))
    edges = _edges(records, *found["edge"]) if "edge" in found else nothing
    faces = _lists(records, *found["face"]) if "face" in found else nothing
    strips = _triangles(_lists(records, *found["tristrips"])) if "tristrips" in found else nothing
    lists = [edges, faces, strips]
    lengths = [len(cells.starts) for cells in lists]
    types = np.repeat([LINE, POLYGON, POLYGON], lengths)
    blocks, numbers = blocks_of(joined(lists), types, n_points, by_size=True)
    data = _scalars(records, *found["face"], leave=()) if lengths[1] else {}
    padded = {
        name: np.concatenate([np.zeros(lengths[0], v.dtype), v, np.zeros(lengths[2], v.dtype)])
        for name, v in data.items()
    }
    return blocks, {name: [values[number] for number in numbers] for name, values in padded.items()}


def _lists(records: Records, kind: Kind, places: Places) -> CellList:
    """The lists of vertices that a kind has."""
    i = kind.find(*_INDICES)
    if i is None or not kind.properties[i].count:
        if not kind.count:
            none = np.empty(0, np.int64)
            return CellList(none, none, none)
        raise InputError(f"element {kind.name} has no list vertex_indices")
    p = kind.properties[i]
    positions, starts = items_of(places.where[i], places.sizes[i], records.size(p.type))
    return CellList(records.whole(positions, p.type), starts, places.sizes[i])


def _edges(records: Records, kind: Kind, places: Places) -> CellList:
    """Edges, by their properties vertex1 and vertex2."""
    ends = [kind.find(name) for name in ("vertex1", "vertex2")]
    if None in ends:
        raise InputError("element edge has no properties vertex1 and vertex2")
    columns = [records.whole(places.where[i], kind.properties[i].type) for i in ends if i is not None]
    return CellList(np.stack(columns, 1).ravel(), np.arange(kind.count) * 2, np.full(kind.count, 2))


def _triangles(strips: CellList) -> CellList:
    """The triangles of strips; -1 ends one strip and begins another, every second triangle is turned."""
    nodes = strips.nodes
    begins = np.zeros(len(nodes) + 1, dtype=bool)
    begins[strips.starts] = True
    begins[1:] |= nodes == -1
    index = np.arange(len(nodes))
    begin = np.maximum.accumulate(np.where(begins[:-1], index, 0)) if len(nodes) else index
    first = index[: max(len(nodes) - 2, 0)]
    whole = (begin[first] == begin[first + 2]) & (nodes[first + 2] != -1) if len(first) else first > 0
    first = first[whole]
    rows = nodes[first[:, None] + np.arange(3)]
    odd = (first - begin[first]) % 2 == 1
    rows[odd] = rows[odd][:, [1, 0, 2]]
    real = (rows != np.roll(rows, 1, axis=1)).all(axis=1)  # strips turn corners by triangles without area
    rows = rows[real]
    return CellList(rows.ravel(), np.arange(len(rows)) * 3, np.full(len(rows), 3))


def _unread(header: Header) -> list[str]:
    others = [f"{kind.count} {kind.name}" for kind in header.kinds if kind.name not in _READ and kind.count]
    lists = [
        f"{p.name} of {kind.name}"
        for kind in header.kinds
        if kind.name in _READ and kind.count
        for p in kind.properties
        if p.count and p.name not in _INDICES
    ]
    found = [f"not kept: elements {', '.join(others)}"] if others else []
    return [*found, f"not kept: lists {', '.join(lists)}"] if lists else found
