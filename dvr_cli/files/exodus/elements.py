"""The element types of Exodus: their names, node orders and numbered sides.

A name begins with that of a family, in any case, and the number of nodes decides the rest, as the records of
``mesh.cell_types`` say: HEX, hex8 and HEXAHEDRON with 8 nodes are the same. Node orders differ from meshio's
where vertical edges come before those of the top face::

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
from dvr_cli.mesh.cell_types import CELL_TYPES

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
# The linear types that a family has, where its name is not that of one.
_LINEAR = {"point": ("vertex",), "shell": ("triangle", "quad", "line")}
# meshio's type: the place in Exodus of each node in meshio's order, where these differ
NODE_ORDER: dict[str, tuple[int, ...]] = {
    **UPRIGHT_BEFORE_UPPER,
    "hexahedron27": (*UPRIGHT_BEFORE_UPPER["hexahedron20"], 23, 24, 25, 26, 21, 22, 20),
    "wedge18": (*UPRIGHT_BEFORE_UPPER["wedge15"], 15, 16, 17),
}
_EDGES_3, _EDGES_4 = CELL_TYPES["triangle"].facets, CELL_TYPES["quad"].facets
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
    cell_type = None if family is None else _cell_type(family, nodes)
    if family is None or cell_type is None:
        what = f"elements of type {upper}" if upper else "elements without a type"
        raise InputError(f"{what} with {nodes} nodes are not supported")
    if family == "shell" or (family == "triangle" and dimension == 3):
        corners = 2 if nodes == 2 else 3 if nodes in (3, 6, 7) else 4
        return ElementType(cell_type, _SHELL_SIDES[corners])
    return ElementType(cell_type, _SIDES[family])


def _cell_type(family: str, nodes: int) -> str | None:
    """The type with so many nodes that is of a linear type of the family, or that type itself."""
    for linear in _LINEAR.get(family, (family,)):
        for known in CELL_TYPES.values():
            if known.nodes == nodes and linear in (known.name, known.linear and known.linear.name):
                return known.name
    return None
