"""The element types of Exodus: their names, node orders and numbered sides.

A name begins with that of a family, in any case, and the number of nodes decides the rest: HEX, hex8 and
HEXAHEDRON with 8 nodes are the same. Node orders differ from meshio's where vertical edges come before those
of the top face::

    Exodus, HEX20                     meshio, hexahedron20

       8----19-----7                     7----14-----6
      20          18                    15          13
      5----17-----6  |                  4----12-----5  |
      |  4--|-11--|--3                  |  3--|-10--|--2
     13  12       14 10                16  11       17 9
      | /         | /                   | /         | /
      1-----9-----2                     0-----8-----1
"""

from __future__ import annotations

from dataclasses import dataclass

from dvr_cli.errors import InputError
from dvr_cli.files.node_orders import UPRIGHT_BEFORE_UPPER

# The first three letters of a name: its family. Their order within Exodus's own library is the same test.
_FAMILIES = {
    "CIR": "point",
    "NOD": "point",
    "POI": "point",
    "SPH": "point",
    "VER": "point",
    "BAR": "line",
    "BEA": "line",
    "EDG": "line",
    "LIN": "line",
    "ROD": "line",
    "TRU": "line",
    "TRI": "triangle",
    "QUA": "quad",
    "SHE": "shell",
    "TET": "tetra",
    "HEX": "hexahedron",
    "PRI": "wedge",
    "WED": "wedge",
    "PYR": "pyramid",
}
# (family, nodes): meshio's type
_TYPES = {
    ("point", 1): "vertex",
    ("line", 2): "line",
    ("line", 3): "line3",
    ("triangle", 3): "triangle",
    ("triangle", 6): "triangle6",
    ("triangle", 7): "triangle7",
    ("quad", 4): "quad",
    ("quad", 8): "quad8",
    ("quad", 9): "quad9",
    ("shell", 2): "line",
    ("shell", 3): "triangle",
    ("shell", 4): "quad",
    ("shell", 6): "triangle6",
    ("shell", 8): "quad8",
    ("shell", 9): "quad9",
    ("tetra", 4): "tetra",
    ("tetra", 10): "tetra10",
    ("hexahedron", 8): "hexahedron",
    ("hexahedron", 20): "hexahedron20",
    ("hexahedron", 27): "hexahedron27",
    ("wedge", 6): "wedge",
    ("wedge", 15): "wedge15",
    ("wedge", 18): "wedge18",
    ("pyramid", 5): "pyramid",
    ("pyramid", 13): "pyramid13",
    ("pyramid", 14): "pyramid14",
}
# meshio's type: the place in Exodus of each node in meshio's order, where these differ
NODE_ORDER: dict[str, tuple[int, ...]] = {
    **UPRIGHT_BEFORE_UPPER,
    "hexahedron27": (*UPRIGHT_BEFORE_UPPER["hexahedron20"], 23, 24, 25, 26, 21, 22, 20),
    "wedge18": (*UPRIGHT_BEFORE_UPPER["wedge15"], 15, 16, 17),
}
_EDGES_3 = ((0, 1), (1, 2), (2, 0))
_EDGES_4 = ((0, 1), (1, 2), (2, 3), (3, 0))
# The corner vertices of each side, in the order in which Exodus numbers them.
_SIDES: dict[str, tuple[tuple[int, ...], ...]] = {
    "point": ((0,),),
    "line": ((0, 1),) * 4,  # faces of a beam, or its ends: the whole of it is meant
    "triangle": _EDGES_3,
    "quad": _EDGES_4,
    "tetra": ((0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 1)),
    "hexahedron": ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 4, 7, 3), (0, 3, 2, 1), (4, 5, 6, 7)),
    "wedge": ((0, 1, 4, 3), (1, 2, 5, 4), (0, 3, 5, 2), (0, 2, 1), (3, 4, 5)),
    "pyramid": ((0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 4, 3), (0, 3, 2, 1)),
}
# Shells have two faces before their edges.
_SHELL_SIDES = {
    2: ((0, 1),) * 4,
    3: ((0, 1, 2), (0, 2, 1), *_EDGES_3),
    4: ((0, 1, 2, 3), (0, 3, 2, 1), *_EDGES_4),
}


@dataclass(frozen=True)
class ElementType:
    """A block's element type as a cell.

    cell_type: meshio's name. sides: the corner vertices of each side, by Exodus's numbers less one.
    """

    cell_type: str
    sides: tuple[tuple[int, ...], ...]


def element_type(name: str, nodes: int, dimension: int) -> ElementType:
    """The element type that a block calls ``name``, of so many nodes, in a mesh of 2 or 3 coordinates.

    Raises InputError for those that are not supported, by name.
    """
    upper = name.strip().upper()
    family = _FAMILIES.get(upper[:3])
    cell_type = _TYPES.get((family or "", nodes))
    if family is None or cell_type is None:
        what = f"elements of type {upper}" if upper else "elements without a type"
        raise InputError(f"{what} with {nodes} nodes are not supported")
    if family == "shell" or (family == "triangle" and dimension == 3):
        corners = 2 if nodes == 2 else 3 if nodes in (3, 6, 7) else 4
        return ElementType(cell_type, _SHELL_SIDES[corners])
    return ElementType(cell_type, _SIDES[family])
