"""Element types by their names in Abaqus and CalculiX.

A name is a family, a number of nodes and letters for the formulation (C3D8R, CPE4H, DC2D8E ...). Types that
are no cells of a mesh (springs, masses, beams, user elements, cohesive and infinite elements
...) have no shape here: what they join is held.
"""

from __future__ import annotations

import re
from typing import NamedTuple

_SOLID = "C3D DC3D DCC3D AC3D FC3D EMC3D Q3D F3D SC CSS CSC"
_PLANE = "CPS CPE CPEG CAX CGAX DC2D DCC2D DCAX DCCAX AC2D ACAX EMC2D WARP2D"
_SHELL = "S DS STRI M3D SFM3D R3D"
_LINE = "T2D T3D DC1D AC1D"  # those with a fixed number of nodes: beams may have one more for a direction
_NAME = re.compile(r"([A-Z]+(?:[123]D)?)(\d+)([A-Z]*)5?")
_SPECIAL = {"STRI65": "S6", "F3D3": "R3D3"}
_VARIABLE = {"C3D15V", "C3D15VH", "C3D27", "C3D27H", "C3D27R", "C3D27RH"}

_SOLID_SHAPES = {
    4: "tetra",
    5: "pyramid",
    6: "wedge",
    8: "hexahedron",
    10: "tetra10",
    13: "pyramid13",
    15: "wedge15",
    18: "wedge18",
    20: "hexahedron20",
    27: "hexahedron27",
}
_LINE_SHAPES = {2: "line", 3: "line3"}
_FLAT_SHAPES = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
# The place in the deck of each node in meshio's order, where the two differ.
NODE_ORDER = {
    "line3": [0, 2, 1],
    "hexahedron27": [*range(20), 26, 24, 23, 25, 21, 22, 20],
}

# Corner nodes of the faces S1, S2, ... of volume elements, of the edges of planar ones and shells.
FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}


class ElementType(NamedTuple):
    """An element type as a cell.

    cell: meshio's name. nodes: how many a deck gives it. shell: whether S1 and S2 are its sides, not edges.
    """

    cell: str
    nodes: int
    shell: bool = False


def element_type(name: str) -> ElementType | None:
    """The type of this name, in capitals; None if it has no shape here, or not always as many nodes."""
    if name in _VARIABLE:
        return None
    match = _NAME.fullmatch(_SPECIAL.get(name, name))
    if match is None:
        return None
    family, digits = match[1], int(match[2])
    if family in _LINE.split() and digits in _LINE_SHAPES:
        return ElementType(_LINE_SHAPES[digits], digits)
    if family == "F3D" and digits == 4:
        return None  # a tetrahedron to CalculiX, a quadrilateral to Abaqus
    if family in _SOLID.split() and digits in _SOLID_SHAPES:
        return ElementType(_SOLID_SHAPES[digits], digits)
    if family in (*_PLANE.split(), *_SHELL.split()) and digits in _FLAT_SHAPES:
        return ElementType(_FLAT_SHAPES[digits], digits, family in _SHELL.split())
    return None


def variable_type(name: str, nodes: int) -> ElementType | None:
    """The type of an element whose name leaves the number of nodes open, by that number."""
    if name in _VARIABLE and nodes in (15, 18, 27):
        return ElementType(_SOLID_SHAPES[nodes], nodes)
    return None
