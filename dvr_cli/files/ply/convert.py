"""Surfaces of any origin as PLY files with coordinates of type double.

They are binary where all faces have as many vertices: some programs read other ones as text only.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import OutputError
from dvr_cli.files.losses import lost, number_not_kept
from dvr_cli.files.ply.source import read
from dvr_cli.files.source import Source
from dvr_cli.mesh.mesh import Mesh

_FACES = ("triangle", "quad", "polygon")
_TYPES = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"}
_TYPES |= {"f4": "float", "f8": "double"}
_NAME = re.compile(r"[!-~]+")  # of a property


class ConvertedPly(Source):
    """A mesh of another format, to be written as PLY."""

    format = "ply"

    def __init__(self, mesh: Mesh, unread: Sequence[str]) -> None:
        """unread: what the file of the mesh holds beyond it. Raises OutputError where PLY cannot hold it."""
        super().__init__()
        self.mesh = mesh
        self.unread = list(unread)
        self._faces = [
            b for b, block in enumerate(mesh.cells) if block.type in _FACES and len(block.vertices)
        ]
        kinds = {block.type for block in mesh.cells if len(block.vertices)}
        others = sorted(kinds - {*_FACES, "line", "vertex"})
        if others or not self._faces:
            raise OutputError(f"PLY has faces only, no cells of type {', '.join(others) or 'any'}")
        if max(mesh.cells[b].vertices.shape[1] for b in self._faces) > 255:
            raise OutputError("PLY has faces of 255 vertices at most")
        self._left = sum(len(b.vertices) for b in mesh.cells if b.type in ("line", "vertex"))

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the mesh with the coordinates ``points`` ((N, d)), the third one 0 where there is none."""
        file.write(self._bytes(points))

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates, every bit of which is kept; finds out, too, what is lost."""
        back = read(self._bytes(points)).mesh
        left = number_not_kept(self._left, "cell of type vertex or line")
        self.notes = [*self.unread, *lost(self._without_others(), back, points), *left]
        return points

    def _without_others(self) -> Mesh:
        """The mesh without edges and points."""
        mesh = self.mesh
        data = {name: [blocks[b] for b in self._faces] for name, blocks in mesh.cell_data.items()}
        sets: dict[str, list[np.ndarray]] = {name: [] for name in mesh.cell_sets}
        return Mesh(
            mesh.points,
            [mesh.cells[b] for b in self._faces],
            data,
            mesh.point_data,
            mesh.field_data,
            point_sets=mesh.point_sets,
            cell_sets=sets,
            facet_sets=mesh.facet_sets,
            periodic=mesh.periodic,
        )

    def _bytes(self, points: np.ndarray) -> bytes:
        mesh = self.mesh
        of_points = _storable(mesh.point_data, ("x", "y", "z"))
        joined = {
            name: np.concatenate([blocks[b] for b in self._faces]) for name, blocks in mesh.cell_data.items()
        }
        of_faces = _storable(joined, ("vertex_indices", "vertex_index"))
        xyz = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
        columns = {**dict(zip("xyz", xyz.T, strict=True)), **of_points}
        sizes = {mesh.cells[b].vertices.shape[1] for b in self._faces}
        encoding, rows = ("binary_little_endian", _rows) if len(sizes) == 1 else ("ascii", _lines)
        faces, begin = [], 0
        for block in (mesh.cells[b] for b in self._faces):
            n, size = block.vertices.shape
            mine = {name: values[begin : begin + n] for name, values in of_faces.items()}
            lists: dict[str, np.ndarray] = {
                "size": np.full(n, size, np.uint8),
                "vertices": block.vertices.astype(np.int32),
            }
            faces.append(rows({**lists, **mine}))
            begin += n
        head = [
            "ply",
            f"format {encoding} 1.0",
            f"element vertex {len(points)}",
            *(f"property {_TYPES[values.dtype.str[1:]]} {name}" for name, values in columns.items()),
            f"element face {begin}",
            "property list uchar int vertex_indices",
            *(f"property {_TYPES[values.dtype.str[1:]]} {name}" for name, values in of_faces.items()),
            "end_header\n",
        ]
        return "\n".join(head).encode() + rows(columns) + b"".join(faces)


def convert(mesh: Mesh, unread: Sequence[str]) -> ConvertedPly:
    """A source that writes ``mesh`` as PLY; raises OutputError where PLY cannot hold it."""
    return ConvertedPly(mesh, unread)


def _storable(data: dict[str, np.ndarray], taken: Sequence[str]) -> dict[str, np.ndarray]:
    """The arrays of one number a row that properties can hold, in types that PLY has; taken: other names."""
    result = {}
    for name, array in data.items():
        values = np.asarray(array)
        if values.ndim != 1 or name in taken or not _NAME.fullmatch(name):
            continue
        if values.dtype.kind in "iu" and values.dtype.itemsize == 8:
            small = ((values >= -(1 << 31)) & (values < 1 << 31)).all()
            values = values.astype(np.int32) if small else values
        elif values.dtype.kind == "b":
            values = values.astype(np.uint8)
        if values.dtype.str[1:] in _TYPES:
            result[name] = values
    return result


def _rows(columns: dict[str, np.ndarray]) -> bytes:
    """Records, one a row, of arrays (n,) or (n, k)."""
    items = list(columns.values())
    kinds = [(f"f{i}", v.dtype.newbyteorder("<"), v.shape[1:]) for i, v in enumerate(items)]
    rows = np.empty(len(items[0]), np.dtype(kinds))
    for i, values in enumerate(items):
        rows[f"f{i}"] = values
    return rows.tobytes()


def _lines(columns: dict[str, np.ndarray]) -> bytes:
    """The same as text."""
    flat = [column.tolist() for values in columns.values() for column in np.atleast_2d(values.T)]
    return "".join(" ".join(map(repr, row)) + "\n" for row in zip(*flat, strict=True)).encode()
