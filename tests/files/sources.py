"""Sources as tests look at them: the bytes they write, and the cells of a mesh in a form that compares."""

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
