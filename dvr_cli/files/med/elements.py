"""The cell types of MED and their node orders: mirror images of meshio's in three dimensions.

Further nodes of second-order cells follow MED's own corners as meshio's follow meshio's, but for the faces of
the hexahedron::

    MED, HE8                 meshio, hexahedron

       6---------7              7---------6
      /|        /|             /|        /|
     5---------8 |            4---------5 |
     | |       | |            | |       | |
     | 2-------|-3            | 3-------|-2
     |/        |/             |/        |/
     1---------4              0---------1
"""

from __future__ import annotations

from dvr_cli.mesh.cell_types import CELL_TYPES

# MED's name: meshio's
TYPES = {
    "PO1": "vertex",
    "SE2": "line",
    "SE3": "line3",
    "TR3": "triangle",
    "TR6": "triangle6",
    "TR7": "triangle7",
    "QU4": "quad",
    "QU8": "quad8",
    "QU9": "quad9",
    "TE4": "tetra",
    "T10": "tetra10",
    "HE8": "hexahedron",
    "H20": "hexahedron20",
    "H27": "hexahedron27",
    "PE6": "wedge",
    "P15": "wedge15",
    "P18": "wedge18",
    "PY5": "pyramid",
    "P13": "pyramid13",
}
UNSUPPORTED = {
    "POG": "polygons",
    "PG2": "polygons of second order",
    "POE": "polyhedra",
    "SE4": "lines of third order",
    "OCT": "octagonal prisms",
}
# The place in MED of each corner in meshio's order.
_CORNERS = {
    "tetra": (0, 2, 1, 3),
    "hexahedron": (0, 3, 2, 1, 4, 7, 6, 5),
    "wedge": (0, 2, 1, 3, 5, 4),
    "pyramid": (0, 3, 2, 1, 4),
}
# Corners of MED around its nodes 21 to 26.
_HEXAHEDRON_FACES = ((0, 1, 2, 3), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 3, 7, 4), (4, 5, 6, 7))


def node_order(cell_type: str) -> list[int] | None:
    """The place in MED of each node of a cell in meshio's order; None where the orders are the same."""
    record = CELL_TYPES[cell_type]
    corners = _CORNERS.get((record.linear or record).name)
    if corners is None:
        return None
    own = [frozenset(ends) for ends in record.mids]
    if cell_type == "hexahedron27":
        own[12:18] = [frozenset(face) for face in _HEXAHEDRON_FACES]
    mirrored = [frozenset(corners[i] for i in ends) for ends in record.mids]
    return [*corners, *(len(corners) + own.index(ends) for ends in mirrored)]
