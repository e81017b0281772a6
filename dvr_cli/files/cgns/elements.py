"""The element types of CGNS by number, and their node orders: Exodus's but for faces and the inside."""

from __future__ import annotations

from dvr_cli.errors import InputError
from dvr_cli.files.node_orders import UPRIGHT_BEFORE_UPPER

# number: meshio's name
TYPES = {
    2: "vertex",
    3: "line",
    4: "line3",
    5: "triangle",
    6: "triangle6",
    7: "quad",
    8: "quad8",
    9: "quad9",
    10: "tetra",
    11: "tetra10",
    12: "pyramid",
    13: "pyramid14",
    14: "wedge",
    15: "wedge15",
    16: "wedge18",
    17: "hexahedron",
    18: "hexahedron20",
    19: "hexahedron27",
    21: "pyramid13",
}
MIXED = 20
_UNSUPPORTED = {22: "polygons (NGON_n)", 23: "polyhedra (NFACE_n)"}
# meshio's type: the place in CGNS of each node in meshio's order, where these differ
NODE_ORDER: dict[str, tuple[int, ...]] = {
    **UPRIGHT_BEFORE_UPPER,
    "hexahedron27": (*UPRIGHT_BEFORE_UPPER["hexahedron20"], 24, 22, 21, 23, 20, 25, 26),
    "wedge18": (*UPRIGHT_BEFORE_UPPER["wedge15"], 15, 16, 17),
}


def cell_type(number: int) -> str:
    """meshio's name of an element type; raises InputError for those that are not supported, by name."""
    if number not in TYPES:
        what = _UNSUPPORTED.get(number, f"elements of type {number}, of third order or unknown,")
        raise InputError(f"{what} are not supported")
    return TYPES[number]
