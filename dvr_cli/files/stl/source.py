"""STL files, read and written back with other coordinates in the bytes they were read from.

STL lists the corners of each facet: corners at equal coordinates are one vertex. Where a vertex of a facet
has moved, its normal is computed anew, as readers expect it to be that of the facet; a normal of zeros, which
leaves that to the reader, stays.
"""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.losses import number_not_kept
from dvr_cli.files.source import Source, differing, rounded
from dvr_cli.files.stl.binary import FACET, HEADER, BinaryStl, declared
from dvr_cli.files.stl.text import TextStl
from dvr_cli.mesh.mesh import Cells, Mesh


class StlSource(Source):
    """An STL file."""

    format = "stl"

    def __init__(self, data: bytes) -> None:
        """Raises InputError for what is damaged, or has no facets."""
        super().__init__()
        self._data = data
        self._file = BinaryStl(data) if _is_binary(data) else TextStl(data)
        if not len(self._file.corners):
            raise InputError("it has no facets")
        points, self._vertex = merged(self._file.corners.reshape(-1, 3))
        self._points = points.copy()  # as read, whatever becomes of the mesh
        facets = self._vertex.reshape(-1, 3)
        real = (facets != np.roll(facets, 1, axis=1)).all(axis=1)
        if not real.any():
            raise InputError("all its facets have two corners in one place: there is no surface")
        self.mesh = _mesh(self._file, points, facets, real)
        self.unread = number_not_kept(int((~real).sum()), "facet of two corners in one place")

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the file with the coordinates ``points`` ((N, 3)), rounded to float32 if it is binary."""
        points = self.stored(points)
        changed = differing(points, self._points)
        if not changed.any():
            file.write(self._data)
            return
        shape = self._file.corners.shape
        corners, moved = points[self._vertex].reshape(shape), changed[self._vertex].reshape(shape)
        normals = normals_of(corners)
        turned = moved.any(axis=(1, 2)) & (self._file.normals != 0).any(axis=1)
        self._file.write(corners, moved, normals, np.repeat(turned[:, None], 3, axis=1), file)

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of the output gets: rounded to float32 if it is binary."""
        return rounded(points) if self._file.single else points


def read(data: bytes) -> StlSource:
    """Read an STL file, text or binary.

    The cell data "stl:solid" number its solids from 0, and those with a name are cell sets. Attributes of
    facets in binary files are the cell data "stl:attribute" unless all are 0. Facets two corners of which are
    in one place are no cells, but written back.

    Raises InputError for what is damaged, or has no facets.
    """
    return StlSource(data)


def merged(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The vertices (N, 3) at the places of some corners (n, 3), in order of appearance, and which of them is
    at each corner (n,). Places are equal if their numbers are (so 0 and -0).
    """
    order = np.lexsort(corners.T)
    there = corners[order]
    new = np.ones(len(order), dtype=bool)
    new[1:] = (there[1:] != there[:-1]).any(axis=1)
    first = np.minimum.reduceat(order, np.flatnonzero(new))
    number = np.empty(len(first), dtype=np.int64)
    by_appearance = np.argsort(first)
    number[by_appearance] = np.arange(len(first))
    vertex = np.empty(len(order), dtype=np.int64)
    vertex[order] = number[np.cumsum(new) - 1]
    return corners[first[by_appearance]], vertex


def normals_of(corners: np.ndarray) -> np.ndarray:
    """(F, 3) unit normals of facets (F, 3, 3) by the right-hand rule, 0 for those without area."""
    a, b, c = corners.swapaxes(0, 1)
    with np.errstate(all="ignore"):
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.divide(normals, length, out=np.zeros_like(normals), where=(length > 0) & (length < np.inf))


def _mesh(file: TextStl | BinaryStl, points: np.ndarray, facets: np.ndarray, real: np.ndarray) -> Mesh:
    solid = file.solid[real]
    cell_data = {"stl:solid": [solid]}
    if file.tags is not None:
        cell_data["stl:attribute"] = [file.tags[real]]
    numbers: dict[str, list[int]] = {}
    for i, name in enumerate(file.names):
        if name:
            numbers.setdefault(name, []).append(i)
    sets = {name: [np.flatnonzero(np.isin(solid, chosen))] for name, chosen in numbers.items()}
    return Mesh(points, [Cells("triangle", facets[real])], cell_data, cell_sets=sets)


def _is_binary(data: bytes) -> bool:
    """True if a file is binary: its length says so, or it is no text that begins with the word solid."""
    if len(data) >= HEADER and len(data) == HEADER + FACET.itemsize * declared(data):
        return True
    words = data[:1024].split(None, 1)
    return not words or words[0].lower() != b"solid" or b"\0" in data
