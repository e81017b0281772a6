"""Gmsh's element types by number, under meshio's names and in meshio's node order.

meshio orders nodes as VTK does. Gmsh agrees for most types and numbers the edges (and faces) of others
differently. meshio's own reader leaves wedge18 and pyramid14 in Gmsh's order; here they follow VTK, as the
smaller wedge15 and pyramid13 do.
"""

from __future__ import annotations

from typing import NamedTuple

from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES


class CellType(NamedTuple):
    """A Gmsh element type: meshio's name, topological dimension, number of nodes."""

    name: str
    dimension: int
    nodes: int


def _family(shape: str, code: int, **codes_by_size: int) -> dict[int, CellType]:
    """Types of one shape, the linear one first; keyword ``n6=9`` says that the 6-node cell is number 9."""
    linear = CELL_TYPES[shape]
    sizes = {number: int(size[1:]) for size, number in codes_by_size.items()}
    others = {number: CellType(f"{shape}{size}", linear.dimension, size) for number, size in sizes.items()}
    return {code: CellType(shape, linear.dimension, linear.nodes), **others}


_TYPES = {
    **_family("vertex", 15),
    **_family("line", 1, n3=8, n4=26, n5=27, n6=28, n7=62, n8=63, n9=64, n10=65, n11=66),
    **_family("triangle", 2, n6=9, n10=21, n15=23, n21=25, n28=42, n36=43, n45=44, n55=45, n66=46),
    **_family("quad", 3, n8=16, n9=10, n16=36, n25=37, n36=38, n49=47, n64=48, n81=49, n100=50, n121=51),
    **_family("tetra", 4, n10=11, n20=29, n35=30, n56=31, n84=71, n120=72, n165=73, n220=74, n286=75),
    **_family("hexahedron", 5, n20=17, n27=12, n64=92, n125=93, n216=94, n343=95, n512=96, n729=97, n1000=98),
    **_family("wedge", 6, n15=18, n18=13, n40=90, n75=91, n126=106, n196=107, n288=108, n405=109, n550=110),
    **_family("pyramid", 7, n13=19, n14=14),
}

# NODE_ORDER[name][i] is the place, in Gmsh's order, of the node that meshio lists i-th.
NODE_ORDER = {
    "tetra10": [0, 1, 2, 3, 4, 5, 6, 7, 9, 8],
    "hexahedron20": [*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15],
    "hexahedron27": [*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26],
    "wedge15": [*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11],
    "wedge18": [*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16],
    "pyramid13": [*range(5), 5, 8, 10, 6, 7, 9, 11, 12],
    "pyramid14": [*range(5), 5, 8, 10, 6, 7, 9, 11, 12, 13],
}


def cell_type(code: int) -> CellType:
    """The element type with Gmsh's number ``code``; InputError if there is none dvr knows."""
    try:
        return _TYPES[code]
    except KeyError:
        raise InputError(f"Gmsh element type {code} is not supported") from None
