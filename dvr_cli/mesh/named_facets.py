"""Named facets: those that a file lists in sets, not as cells: side sets, surfaces of decks."""

from __future__ import annotations

import numpy as np

from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.second_order import linear_cells


def named_facets(mesh: Mesh, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """The facets (n, w) in sets, by their corner vertices, shorter rows ending in -1; and which set's (n,).

    dimension: of the mesh's cells. What has more vertices than a facet of these is a cell and left out.
    """
    if not mesh.facet_sets:
        return np.empty((0, 2), dtype=np.int64), np.empty(0, dtype=np.int64)
    width = max(2, *(rows.shape[1] for rows in mesh.facet_sets.values()))
    rows = np.concatenate(
        [np.pad(r, ((0, 0), (0, width - r.shape[1])), constant_values=-1) for r in mesh.facet_sets.values()]
    ).astype(np.int64)
    which = np.repeat(np.arange(len(mesh.facet_sets)), [len(rows) for rows in mesh.facet_sets.values()])
    corner = np.zeros(len(mesh.points) + 1, dtype=bool)  # the last is for -1
    for block in linear_cells(mesh.cells):
        corner[block.vertices] = True
    rows = np.where(corner[rows], rows, -1)
    rows = np.take_along_axis(rows, np.argsort(rows < 0, axis=1, kind="stable"), axis=1)
    most = 2 if dimension == 2 else 4
    count = (rows >= 0).sum(axis=1)
    chosen = (count > 0) & (count <= most)
    return rows[chosen, :most], which[chosen]
