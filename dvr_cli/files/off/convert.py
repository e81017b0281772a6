"""Surfaces of any origin as OFF files, text, with what Gmsh and others read: OFF alone on the first line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import OutputError
from dvr_cli.files.losses import lost, number_not_kept
from dvr_cli.files.off.source import read
from dvr_cli.files.source import Source
from dvr_cli.mesh.mesh import Mesh

_FACES = ("triangle", "quad", "polygon")


class ConvertedOff(Source):
    """A mesh of another format, to be written as OFF."""

    format = "off"

    def __init__(self, mesh: Mesh, unread: Sequence[str]) -> None:
        """unread: what the file of the mesh holds beyond it. Raises OutputError where OFF cannot hold it."""
        super().__init__()
        self.mesh = mesh
        self.unread = list(unread)
        faces = [block for block in mesh.cells if block.type in _FACES and len(block.vertices)]
        others = {block.type for block in mesh.cells if len(block.vertices)} - {b.type for b in faces}
        if others - {"line", "vertex"} or not faces:
            raise OutputError(f"OFF has faces only, no cells of type {', '.join(sorted(others)) or 'any'}")
        self._left = sum(len(b.vertices) for b in mesh.cells if b.type in ("line", "vertex"))
        rows = []
        for block in faces:
            size = block.vertices.shape[1]
            row = f"{size} {' '.join(['%d'] * size)}\n"
            rows.append((row * len(block.vertices)) % tuple(block.vertices.ravel().tolist()))
        count = sum(len(block.vertices) for block in faces)
        self._head = f"OFF\n{len(mesh.points)} {count} 0\n".encode()
        self._tail = "".join(rows).encode()

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the mesh with the coordinates ``points`` ((N, d)), the third one 0 where there is none."""
        file.write(self._bytes(points))

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates, every bit of which is kept; finds out, too, what is lost."""
        back = read(self._bytes(points)).mesh
        left = number_not_kept(self._left, "cell of type vertex or line")
        self.notes = [*self.unread, *lost(self.mesh, back, points), *left]
        return points

    def _bytes(self, points: np.ndarray) -> bytes:
        xyz = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
        return self._head + (("%r %r %r\n" * len(xyz)) % tuple(xyz.ravel().tolist())).encode() + self._tail


def convert(mesh: Mesh, unread: Sequence[str]) -> ConvertedOff:
    """A source that writes ``mesh`` as OFF; raises OutputError where OFF cannot hold it."""
    return ConvertedOff(mesh, unread)
