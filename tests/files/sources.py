"""Sources as tests look at them: the bytes they write, cells and coordinates in forms that compare."""

from __future__ import annotations

import io

import numpy as np

from dvr_cli.files.source import Source
from dvr_cli.mesh.mesh import Mesh


def written(source: Source, points: np.ndarray) -> bytes:
    """The bytes that a source writes for the coordinates ``points``."""
    file = io.BytesIO()
    source.write(points, file)
    return file.getvalue()


def cells_of(mesh: Mesh) -> list[tuple[str, list]]:
    """Type and vertices of each block of cells."""
    return [(block.type, block.vertices.tolist()) for block in mesh.cells]


def bits(points: np.ndarray) -> list[int]:
    """Coordinates as the integers of the same bits: -0.0 is not 0.0, and each nan is its own."""
    return np.ascontiguousarray(points, dtype=np.float64).view(np.int64).ravel().tolist()
