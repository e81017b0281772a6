"""The keywords of MEDIT files: elements, what belongs to them, and the numbers binary files give them."""

from __future__ import annotations

from dvr_cli.mesh.cell_types import CELL_TYPES

# Keyword: meshio's type of the cell. Gmsh and others leave the h out of hexahedra.
_CELLS = {
    "Edges": "line",
    "Triangles": "triangle",
    "Quadrilaterals": "quad",
    "Tetrahedra": "tetra",
    "Pyramids": "pyramid",
    "Prisms": "wedge",
    "Hexahedra": "hexahedron",
    "Hexaedra": "hexahedron",
    "EdgesP2": "line3",
    "TrianglesP2": "triangle6",
    "QuadrilateralsQ2": "quad9",
    "TetrahedraP2": "tetra10",
    "PyramidsP2": "pyramid14",
    "PrismsP2": "wedge18",
    "HexahedraQ2": "hexahedron27",
}
# Keyword: meshio's type of the cell, number of its nodes.
ELEMENTS = {keyword: (name, CELL_TYPES[name].nodes) for keyword, name in _CELLS.items()}

_SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2)]
_CUBE = [(x, y, z) for z in (0, 2) for x, y in _SQUARE]
_PYRAMID = [*((x, y, 0) for x, y in _SQUARE), (0, 0, 2)]
_PRISM = [(*corner, z) for z in (0, 2) for corner in ((2, 0, 0), (0, 2, 0), (0, 0, 2))]


def _with_middles(corners: list[tuple[int, ...]], cell_type: str) -> list[tuple[int, ...]]:
    """Places of the corners of a cell, and of its further nodes in meshio's order."""
    middles = [
        tuple(sum(axis) // len(around) for axis in zip(*(corners[i] for i in around), strict=True))
        for around in CELL_TYPES[cell_type].mids
    ]
    return [*corners, *middles]


# For types whose nodes a file may list in an order of its own: the place of each node, in meshio's order, as
# such a list gives it. These are indices of Bézier's control points: twice the barycentric coordinates, or
# coordinates from 0 to 2; both for prisms.
ORDERINGS: dict[str, list[tuple[int, ...]]] = {
    "EdgesP2": [(0,), (2,), (1,)],
    "TrianglesP2": [(2, 0, 0), (0, 2, 0), (0, 0, 2), (1, 1, 0), (0, 1, 1), (1, 0, 1)],
    "TetrahedraP2": [
        *[(2, 0, 0, 0), (0, 2, 0, 0), (0, 0, 2, 0), (0, 0, 0, 2)],
        *[(1, 1, 0, 0), (0, 1, 1, 0), (1, 0, 1, 0), (1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1)],
    ],
    "QuadrilateralsQ2": _with_middles([*_SQUARE], "quad9"),
    "HexahedraQ2": _with_middles([*_CUBE], "hexahedron27"),
    "PyramidsP2": _with_middles([*_PYRAMID], "pyramid14"),
    "PrismsP2": _with_middles([*_PRISM], "wedge18"),
}
# Element: the section that lists the order of its nodes.
LISTED = {name: f"{name}Ordering" for name in ORDERINGS}
# So for linear cells, whose coordinates go to 1.
for _name in list(ORDERINGS):
    _linear = _name[:-2]
    _corners = ORDERINGS[_name][: ELEMENTS[_linear][1]]
    ORDERINGS[_linear] = [tuple(place // 2 for place in corner) for corner in _corners]
    LISTED[_linear] = f"{_name[:-1]}1Ordering"

# Types whose nodes beside the corners programs list in different orders.
DISPUTED = ("PyramidsP2", "PrismsP2", "HexahedraQ2")

_HIGHER = ("EdgesP", "TrianglesP", "QuadrilateralsQ", "TetrahedraP", "PyramidsP", "PrismsP", "HexahedraQ")
# What a mesh with such a section holds that cannot be relaxed.
UNSUPPORTED: dict[str, str] = {
    **{f"{name}{order}": "cells of order 3 or 4" for name in _HIGHER for order in (3, 4)},
    **{f"ExtraVerticesAt{name}": "nodes of curved cells apart from them" for name in ELEMENTS},
    "Polyhedra": "polyhedra",
    "Polygons": "polygons",
}

# Sections of text that hold values instead of a count and rows.
UNCOUNTED = frozenset(
    {
        *("MeshVersionFormatted", "Dimension", "AngleOfCornerBound", "MaximalAngleOfCorner", "Identifier"),
        *("Geometry", "BoundingBox", "Iterations", "Time", "BezierBasis", "FloatingPointPrecision", "End"),
    }
)

# Sections of rows of as many numbers, not whole ones, as the mesh has dimensions.
VECTORS = frozenset({"Tangents", "Normals"})

MESH_VERSION, DIMENSION, VERTICES, END, SOLUTION, PRECISION = 1, 3, 4, 54, 62, 155
# The number of each keyword in binary files.
NAMES: dict[int, str] = {
    MESH_VERSION: "MeshVersionFormatted",
    DIMENSION: "Dimension",
    VERTICES: "Vertices",
    5: "Edges",
    6: "Triangles",
    7: "Quadrilaterals",
    8: "Tetrahedra",
    9: "Prisms",
    10: "Hexahedra",
    13: "Corners",
    14: "Ridges",
    15: "RequiredVertices",
    16: "RequiredEdges",
    17: "RequiredTriangles",
    18: "RequiredQuadrilaterals",
    19: "TangentAtEdgeVertices",
    20: "NormalAtVertices",
    21: "NormalAtTriangleVertices",
    22: "NormalAtQuadrilateralVertices",
    23: "AngleOfCornerBound",
    24: "TrianglesP2",
    25: "EdgesP2",
    27: "QuadrilateralsQ2",
    29: "SubDomainFromGeom",
    30: "TetrahedraP2",
    33: "HexahedraQ2",
    34: "ExtraVerticesAtEdges",
    35: "ExtraVerticesAtTriangles",
    36: "ExtraVerticesAtQuadrilaterals",
    37: "ExtraVerticesAtTetrahedra",
    38: "ExtraVerticesAtPrisms",
    39: "ExtraVerticesAtHexahedra",
    40: "VerticesOnGeometricVertices",
    41: "VerticesOnGeometricEdges",
    42: "VerticesOnGeometricTriangles",
    43: "VerticesOnGeometricQuadrilaterals",
    44: "EdgesOnGeometricEdges",
    46: "Polyhedra",
    47: "Polygons",
    49: "Pyramids",
    50: "BoundingBox",
    END: "End",
    59: "Tangents",
    60: "Normals",
    61: "TangentAtVertices",
    SOLUTION: "SolAtVertices",
    82: "PeriodicVertices",
    83: "PeriodicEdges",
    84: "PeriodicTriangles",
    85: "PeriodicQuadrilaterals",
    86: "PrismsP2",
    87: "PyramidsP2",
    88: "QuadrilateralsQ3",
    89: "QuadrilateralsQ4",
    90: "TrianglesP3",
    91: "TrianglesP4",
    92: "EdgesP3",
    93: "EdgesP4",
    96: "TetrahedraP3",
    97: "TetrahedraP4",
    98: "HexahedraQ3",
    99: "HexahedraQ4",
    100: "PyramidsP3",
    101: "PyramidsP4",
    102: "PrismsP3",
    103: "PrismsP4",
    127: "EdgesP2Ordering",
    129: "TrianglesP2Ordering",
    131: "QuadrilateralsQ2Ordering",
    133: "TetrahedraP2Ordering",
    135: "PyramidsP2Ordering",
    137: "PrismsP2Ordering",
    139: "HexahedraQ2Ordering",
    141: "EdgesP1Ordering",
    143: "TrianglesP1Ordering",
    145: "QuadrilateralsQ1Ordering",
    147: "TetrahedraP1Ordering",
    149: "PyramidsP1Ordering",
    151: "PrismsP1Ordering",
    153: "HexahedraQ1Ordering",
    PRECISION: "FloatingPointPrecision",
}

# Sections of whole numbers, beside the elements.
WHOLE = frozenset(
    {
        *("Corners", "Ridges", "RequiredVertices", "RequiredEdges", "RequiredTriangles"),
        *("RequiredQuadrilaterals", "NormalAtVertices", "NormalAtTriangleVertices"),
        *("NormalAtQuadrilateralVertices", "TangentAtVertices", "TangentAtEdgeVertices"),
        *("PeriodicVertices", "PeriodicEdges", "PeriodicTriangles", "PeriodicQuadrilaterals"),
    }
)
