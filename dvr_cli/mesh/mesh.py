"""The mesh as data: points, blocks of cells, and whatever the file said about them.

The fields and the names of cell types are those of meshio, so that a ``meshio.Mesh`` converts both ways
without loss; importing this module does not import meshio.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

Entity = tuple[int, int]  # of a model: its dimension, 1 for curves and 2 for surfaces, and its tag


@dataclass
class Cells:
    """A block of cells of one type.

    type: meshio's name of the cell type ("triangle", "tetra", ...).
    vertices: (n, k) integer array of 0-based point indices, in meshio's node order.
    """

    type: str
    vertices: np.ndarray


@dataclass
class Mesh:
    """A mesh as read from a file or handed over by a caller.

    points: (N, 2) or (N, 3) float64 coordinates.
    cells: blocks of cells, in file order; a cell's id is its position counted through all blocks.
    cell_data: per name one array for each block; region tags live here under the names meshio gives them
        ("gmsh:physical", "gmsh:geometrical", "medit:ref", ...).
    point_data: per name an array with N rows.
    field_data: names of groups: name -> (tag, dimension).
    cell_sets: groups by their cells: name -> for each block the positions in it.
    point_sets: groups of vertices by name.
    facet_sets: named facets that are no cells of the file (side sets, surfaces): name -> (n, w) vertices of
        each, w the largest, shorter rows ending in -1.
    entities: the vertices that lie inside each curve and surface of the model that the mesh was made of (not
        on its border), where the file says so.
    periodic: (K, 2) int array of linked vertices (slave, master), empty when there are none.
    """

    points: np.ndarray
    cells: list[Cells]
    cell_data: dict[str, list[np.ndarray]] = field(default_factory=dict)
    point_data: dict[str, np.ndarray] = field(default_factory=dict)
    field_data: dict[str, np.ndarray] = field(default_factory=dict)
    cell_sets: dict[str, list[np.ndarray]] = field(default_factory=dict)
    point_sets: dict[str, np.ndarray] = field(default_factory=dict)
    facet_sets: dict[str, np.ndarray] = field(default_factory=dict)
    entities: dict[Entity, np.ndarray] = field(default_factory=dict)
    periodic: np.ndarray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))

    @property
    def is_planar(self) -> bool:
        """True if all points have the same third coordinate, or none."""
        return self.points.shape[1] == 2 or not np.ptp(self.points[:, 2])

    @property
    def unlinked(self) -> np.ndarray:
        """(N,) bool: the vertices that no periodic link ties to another; only these may move on their own."""
        free = np.ones(len(self.points), dtype=bool)
        free[self.periodic] = False
        return free
