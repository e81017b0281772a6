"""Vertices that a deck's loads and constraints hold, as far as that does not depend on the format."""

from __future__ import annotations

import numpy as np

from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.interior import enclosed
from dvr_cli.mesh.mesh import Cells
from dvr_cli.mesh.second_order import linear_cells


def within(blocks: list[Cells], vertices: np.ndarray) -> np.ndarray:
    """(N,) bool: those of ``vertices`` ((N,) bool) that lie inside the mesh, not on its boundary."""
    linear = linear_cells(blocks)
    dimension = max((CELL_TYPES[block.type].dimension for block in linear), default=0)
    near = [
        Cells(block.type, block.vertices[vertices[block.vertices].any(axis=1)])
        for block in linear
        if CELL_TYPES[block.type].dimension == dimension
    ]
    n = sum(len(block.vertices) for block in near)
    return enclosed(near, np.zeros(n, dtype=np.int64), len(vertices))


def at_corners(blocks: list[Cells], held: np.ndarray) -> np.ndarray:
    """``held`` ((N,) bool) with the corners of an edge or face in place of the node in its middle."""
    result = held.copy()
    middle = np.zeros(len(held), dtype=bool)
    for block in blocks:
        around = CELL_TYPES[block.type].mids
        corners = block.vertices.shape[1] - len(around)
        for k, local in enumerate(around):
            node = block.vertices[:, corners + k]
            middle[node] = True
            result[block.vertices[held[node]][:, local]] = True
    result[middle] = False
    return result
