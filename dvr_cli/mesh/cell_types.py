"""Cell types: all that is known of each kind of cell, one record a type.

Names and node order are meshio's, those of VTK and Gmsh for linear cells:

    quad          hexahedron           wedge             pyramid
    3---2         bottom 0 1 2 3       bottom 0 1 2      base 0 1 2 3
    |   |         top    4 5 6 7       top    3 4 5      apex 4
    0---1

A new entry in CELL_TYPES is all that a new type takes. With corners it can be relaxed; with a linear type its
first nodes are those of that type, and the others are carried along.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Tuples = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, eq=False)
class CellType:
    """One type of cell; vertices are numbered from 0 within the cell.

    name: meshio's. dimension: 0 to 3. nodes: how many a cell has.
    corners: the vertices of each corner, its own first, then the far ends of its edges, so that a positively
        oriented cell has positive determinants only. Simplices have one corner, which stands for all.
    targets: (d+1, d) coordinates of the shape each corner is measured against, in the order of its vertices.
    mirror: node order of the mirror image, which turns a cell stored inside out into a positive one.
    facets: the vertices of each in positive order: outward by the right-hand rule, counterclockwise and one
        after the other round a planar cell.
    edges: the two ends of each, in the order in which second-order types have nodes on them.
    linear: the type of the first nodes of a second-order cell, None for other types.
    mids: the vertices around each further node of a second-order cell, in whose middle it ordinarily lies.
    """

    name: str
    dimension: int
    nodes: int
    corners: Tuples = ()
    targets: tuple[np.ndarray, ...] = ()
    mirror: tuple[int, ...] = ()
    facets: Tuples = ()
    edges: Tuples = ()
    linear: CellType | None = None
    mids: Tuples = ()

    @property
    def is_simplex(self) -> bool:
        """True if each facet lacks one vertex."""
        return self.nodes == self.dimension + 1

    @property
    def outline(self) -> tuple[int, ...]:
        """The vertices of a planar cell, counterclockwise."""
        return tuple(facet[0] for facet in self.facets)


_H = np.sqrt(3.0) / 2.0
_REGULAR_TRIANGLE = np.array([[0, 0], [1, 0], [0.5, _H]])
_SQUARE_CORNER = np.array([[0, 0], [1, 0], [0, 1.0]])
_REGULAR_TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0.5, _H, 0], [0.5, _H / 3, np.sqrt(2 / 3)]])
_CUBE_CORNER = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
_WEDGE_LOWER = np.array([[0, 0, 0], [1, 0, 0], [0.5, _H, 0], [0, 0, 1.0]])
_WEDGE_UPPER = _WEDGE_LOWER[[0, 2, 1, 3]] * [1, 1, -1]  # seen from the top the triangle turns the other way
_PYRAMID_BASE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.5, np.sqrt(0.5)]])

_VERTEX = CellType("vertex", 0, 1)
_LINE = CellType("line", 1, 2, edges=((0, 1),))
_TRIANGLE = CellType(
    "triangle",
    2,
    3,
    corners=((0, 1, 2),),
    targets=(_REGULAR_TRIANGLE,),
    mirror=(0, 2, 1),
    facets=((0, 1), (1, 2), (2, 0)),
    edges=((0, 1), (1, 2), (2, 0)),
)
_QUAD = CellType(
    "quad",
    2,
    4,
    corners=((0, 1, 3), (1, 2, 0), (2, 3, 1), (3, 0, 2)),
    targets=(_SQUARE_CORNER,) * 4,
    mirror=(0, 3, 2, 1),
    facets=((0, 1), (1, 2), (2, 3), (3, 0)),
    edges=((0, 1), (1, 2), (2, 3), (3, 0)),
)
_TETRA = CellType(
    "tetra",
    3,
    4,
    corners=((0, 1, 2, 3),),
    targets=(_REGULAR_TETRAHEDRON,),
    mirror=(0, 2, 1, 3),
    facets=((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    edges=((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
)
_HEXAHEDRON = CellType(
    "hexahedron",
    3,
    8,
    corners=(
        (0, 1, 3, 4),
        (1, 2, 0, 5),
        (2, 3, 1, 6),
        (3, 0, 2, 7),
        (4, 7, 5, 0),
        (5, 4, 6, 1),
        (6, 5, 7, 2),
        (7, 6, 4, 3),
    ),
    targets=(_CUBE_CORNER,) * 8,
    mirror=(4, 5, 6, 7, 0, 1, 2, 3),
    facets=((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    edges=(*_QUAD.edges, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
)
_WEDGE = CellType(
    "wedge",
    3,
    6,
    corners=((0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2)),
    targets=(_WEDGE_LOWER,) * 3 + (_WEDGE_UPPER,) * 3,
    mirror=(3, 4, 5, 0, 1, 2),
    facets=((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    edges=(*_TRIANGLE.edges, (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
)
_PYRAMID = CellType(
    "pyramid",
    3,
    5,
    corners=((0, 1, 3, 4), (1, 2, 0, 4), (2, 3, 1, 4), (3, 0, 2, 4)),
    targets=(_PYRAMID_BASE,) * 4,
    mirror=(0, 3, 2, 1, 4),
    facets=((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    edges=(*_QUAD.edges, (0, 4), (1, 4), (2, 4), (3, 4)),
)


def _second_order(linear: CellType, *more: tuple[int, ...]) -> CellType:
    """The type with a node on each edge of a linear one, and one more inside each of ``more``."""
    mids = (*linear.edges, *more)
    nodes = linear.nodes + len(mids)
    return CellType(f"{linear.name}{nodes}", linear.dimension, nodes, linear=linear, mids=mids)


_HEXAHEDRON_FACES = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (2, 3, 7, 6), (0, 1, 2, 3), (4, 5, 6, 7))

CELL_TYPES: dict[str, CellType] = {
    cell_type.name: cell_type
    for cell_type in (
        _VERTEX,
        _LINE,
        _TRIANGLE,
        _QUAD,
        _TETRA,
        _HEXAHEDRON,
        _WEDGE,
        _PYRAMID,
        _second_order(_LINE),
        _second_order(_TRIANGLE),
        _second_order(_TRIANGLE, (0, 1, 2)),
        _second_order(_QUAD),
        _second_order(_QUAD, (0, 1, 2, 3)),
        _second_order(_TETRA),
        _second_order(_HEXAHEDRON),
        _second_order(_HEXAHEDRON, *_HEXAHEDRON_FACES, tuple(range(8))),
        _second_order(_WEDGE),
        _second_order(_WEDGE, (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
        _second_order(_PYRAMID),
        _second_order(_PYRAMID, (0, 1, 2, 3)),
        CellType("line4", 1, 4),  # may come along; its vertices stay
    )
}


def topological_dimension(name: str) -> int | None:
    """The dimension of a cell type of any order by meshio's name, None if it is not known."""
    cell_type = CELL_TYPES.get(name) or CELL_TYPES.get(name.rstrip("0123456789"))
    return None if cell_type is None else cell_type.dimension


def relaxed_dimension(name: str) -> int | None:
    """The dimension of a linear cell type that can be relaxed, None for all others."""
    cell_type = CELL_TYPES.get(name)
    return cell_type.dimension if cell_type is not None and cell_type.corners else None
