"""Elements by their FE descriptor: cell types, the order of nodes, and what has no cell type."""

from __future__ import annotations

BEAMS = frozenset({11, 21, 22, 23, 24})  # rods and beams have a line of orientation and sections, too

_NUMBERS = {
    "triangle": (41, 51, 61, 74, 81, 91),
    "triangle6": (42, 52, 62, 72, 82, 92),
    "quad": (44, 54, 64, 71, 84, 94),
    "quad8": (45, 55, 65, 75, 85, 95),
    "tetra": (111,),
    "tetra10": (118,),
    "wedge": (101, 112),
    "wedge15": (102, 113),
    "hexahedron": (104, 115),
    "hexahedron20": (105, 116),
    "pyramid": (312,),
}
# meshio's names of cell types; those of beams depend on how many nodes they have.
TYPES = {number: name for name, numbers in _NUMBERS.items() for number in numbers}
LINES = {2: "line", 3: "line3"}
# Rigid elements, springs, dampers, gaps, masses, constraints: they hold their nodes.
HOLDING = frozenset({121, 122, 136, 137, 138, 139, 141, 142, 151, 152, 161, 181})

# Where in a record each node of meshio's order is: nodes go round the edges, corners and middles in turn.
NODE_ORDER = {
    "line3": [0, 2, 1],
    "triangle6": [0, 2, 4, 1, 3, 5],
    "quad8": [0, 2, 4, 6, 1, 3, 5, 7],
    "tetra10": [0, 2, 4, 9, 1, 3, 5, 6, 7, 8],
    "wedge15": [0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8],
    "hexahedron20": [0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11],
}
