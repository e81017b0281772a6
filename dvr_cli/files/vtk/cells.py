"""The cells of a legacy VTK file: cell types, the two layouts of cell lists, and blocks of cells.

Types and node orders are turned into meshio's, which differ from VTK's in the wedge, and in the pixel and
voxel (stored row by row), delivered as quad and hexahedron.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells
from dvr_cli.mesh.ranks import distinct

VERTEX, POLY_VERTEX, LINE, POLY_LINE, TRIANGLE, POLYGON, QUAD = 1, 2, 3, 4, 5, 7, 9

# VTK's number of a cell type: meshio's name.
_TYPES = {
    VERTEX: "vertex",
    LINE: "line",
    TRIANGLE: "triangle",
    8: "quad",  # VTK_PIXEL
    QUAD: "quad",
    10: "tetra",
    11: "hexahedron",  # VTK_VOXEL
    12: "hexahedron",
    13: "wedge",
    14: "pyramid",
    15: "penta_prism",
    16: "hexa_prism",
    21: "line3",
    22: "triangle6",
    23: "quad8",
    24: "tetra10",
    25: "hexahedron20",
    26: "wedge15",
    27: "pyramid13",
    28: "quad9",
    29: "hexahedron27",
    30: "quad6",
    31: "wedge12",
    32: "wedge18",
    33: "hexahedron24",
    34: "triangle7",
    35: "line4",
}
# How many nodes those have that are no cell types of dvr.
_OTHER_NODES = {"penta_prism": 10, "hexa_prism": 12, "quad6": 6, "wedge12": 12, "hexahedron24": 24}
MAX_BLOCKS = 1000
NODE_ORDER = {8: [0, 1, 3, 2], 11: [0, 1, 3, 2, 4, 5, 7, 6], 13: [0, 2, 1, 3, 5, 4]}
# The way back: VTK's number of a type of meshio's, and the place in meshio's order of each node in VTK's.
VTK_TYPE = {name: number for number, name in _TYPES.items() if number not in (8, 11)}
VTK_ORDER = {"wedge": np.argsort(NODE_ORDER[13]).tolist()}
_UNSUPPORTED = {
    0: "empty cells",
    6: "triangle strips",
    36: "quadratic polygons",
    37: "triquadratic pyramids",
    41: "convex point sets",
    42: "polyhedra",
    **dict.fromkeys(range(51, 57), "parametric cells"),
    **dict.fromkeys(range(60, 68), "higher-order cells"),
    **dict.fromkeys(range(68, 75), "Lagrange cells"),
    **dict.fromkeys(range(75, 82), "Bezier cells"),
}


@dataclass(frozen=True, eq=False)
class CellList:
    """Cells as VTK lists them.

    nodes: (m,) integers, among them the point indices of all cells.
    starts, sizes: (n,) where the indices of each cell begin in ``nodes``, and how many it has.
    """

    nodes: np.ndarray
    starts: np.ndarray
    sizes: np.ndarray


def list_with_counts(entries: np.ndarray, n: int, what: str) -> CellList:
    """Up to version 4.2: ``entries`` are n times a number of nodes followed by that many point indices."""
    entries = entries.astype(np.int64, copy=False)
    m = len(entries)
    if not n <= m or (n == 0) != (m == 0):
        raise InputError(f"{what} should hold {n} cells, but has {m} entries")
    size = entries[0] if m else 0
    if size >= 0 and n * (size + 1) == m and (entries[:: size + 1] == size).all():
        heads = np.arange(n) * (size + 1)
    else:
        heads = chain(np.arange(m) + 1 + np.clip(entries, 0, m), n)
    if len(heads):
        sizes = entries[np.minimum(heads, m - 1)]
        if heads[-1] + 1 + sizes[-1] != m or (sizes < 0).any():
            raise InputError(
                f"{what}: the numbers of nodes of its {n} cells do not add up to its {m} entries"
            )
    else:
        sizes = heads
    return CellList(entries, heads + 1, sizes)


def chain(following: np.ndarray, n: int) -> np.ndarray:
    """The first n of 0, following[0], following[following[0]], ...; m = len(following) where that leads out.

    By doubling: once the first k are known, jumping k steps from each gives the next k.
    """
    m = len(following)
    jump = np.append(np.minimum(following, m), m)
    chain = np.zeros(1, dtype=np.int64)
    while len(chain) < n:
        chain = np.concatenate([chain, jump[chain]])
        jump = jump[jump]
    return chain[:n]


def list_with_offsets(offsets: np.ndarray, nodes: np.ndarray, what: str) -> CellList:
    """From version 5.0: cell i has the point indices nodes[offsets[i]:offsets[i + 1]]."""
    offsets = offsets.astype(np.int64, copy=False)
    if len(offsets) == 0 and len(nodes) == 0:
        offsets = np.zeros(1, dtype=np.int64)
    sizes = np.diff(offsets)
    if len(offsets) == 0 or offsets[0] != 0 or offsets[-1] != len(nodes) or (sizes < 0).any():
        raise InputError(
            f"{what}: the offsets do not ascend from 0 to {len(nodes)}, the number of its entries"
        )
    return CellList(nodes, offsets[:-1], sizes)


def joined(lists: list[CellList]) -> CellList:
    """One list of the cells of all, in that order."""
    if len(lists) == 1:
        return lists[0]
    begin = np.cumsum([0, *(len(cells.nodes) for cells in lists)])
    return CellList(
        np.concatenate([cells.nodes for cells in lists] or [np.empty(0, np.int64)]),
        np.concatenate([cells.starts + begin[i] for i, cells in enumerate(lists)] or [np.empty(0, np.int64)]),
        np.concatenate([cells.sizes for cells in lists] or [np.empty(0, np.int64)]),
    )


def blocks_of(
    cells: CellList, types: np.ndarray, n_points: int, by_size: bool
) -> tuple[list[Cells], list[np.ndarray]]:
    """Blocks of cells, and for each the numbers in the file of its cells (where their data are).

    types: (n,) VTK's type of each cell. Polygons of 3 and 4 nodes are triangles and quads, larger ones
        "polygon" in blocks of one size; polylines and poly-vertices are taken apart into "line" and
        "vertex" cells, so several of these may have the same number in the file.
    by_size: False: a block is a run of cells of one kind, so cells keep the order of the file. True, or
        where that would make over a thousand blocks: there is one block for each number of nodes and kind,
        ascending, in which cells keep the order of the file.

    Raises InputError for types that are not supported, by name, and for cells that cannot be right.
    """
    _check_types(types)
    cells, types, number = _taken_apart(cells, types)
    types = np.where((types == POLYGON) & (cells.sizes == 3), TRIANGLE, types)
    types = np.where((types == POLYGON) & (cells.sizes == 4), QUAD, types)
    _check_sizes(types, cells.sizes, number)
    starts, sizes = cells.starts, cells.sizes
    bounds = _runs(types, sizes)
    if by_size or len(bounds) > MAX_BLOCKS:
        order = np.lexsort((types, sizes))  # stable
        starts, sizes, types, number = starts[order], sizes[order], types[order], number[order]
        bounds = _runs(types, sizes)
    blocks, numbers = [], []
    for first, last in pairwise(bounds):
        kind = int(types[first])
        order = np.array(NODE_ORDER.get(kind, range(sizes[first])), dtype=np.int64)
        vertices = cells.nodes[starts[first:last, None] + order]
        outside = (vertices < 0) | (vertices >= n_points)
        if outside.any():
            row, column = np.argwhere(outside)[0]
            raise InputError(
                f"cell {number[first + row]} names point {vertices[row, column]}, "
                f"but there are {n_points} points, counted from 0"
            )
        blocks.append(Cells("polygon" if kind == POLYGON else _TYPES[kind], vertices))
        numbers.append(number[first:last])
    return blocks, numbers


def _runs(types: np.ndarray, sizes: np.ndarray) -> list[int]:
    """The first cells of runs of one type and size, and the number behind the last cell."""
    if not len(types):
        return []
    breaks = np.flatnonzero((np.diff(types) != 0) | (np.diff(sizes) != 0)) + 1
    return [0, *breaks.tolist(), len(types)]


def structured_block(dimensions: tuple[int, int, int]) -> Cells:
    """The cells of a structured grid of dimensions[0] x ... points, the first index running fastest."""
    points = np.arange(dimensions[0] * dimensions[1] * dimensions[2]).reshape(dimensions[::-1])
    points = points.reshape([d for d in dimensions[::-1] if d > 1])
    if points.ndim == 0:
        return Cells("vertex", points.reshape(1, 1))
    if points.ndim == 1:
        return Cells("line", np.stack([points[:-1], points[1:]], axis=1))
    low, high = slice(None, -1), slice(1, None)
    around = [(low, low), (low, high), (high, high), (high, low)]
    if points.ndim == 2:
        return Cells("quad", np.stack([points[c].ravel() for c in around], axis=1))
    corners = [points[k, j, i].ravel() for k in (low, high) for j, i in around]
    return Cells("hexahedron", np.stack(corners, axis=1))


def _check_types(types: np.ndarray) -> None:
    for kind in distinct(types).tolist():
        if kind not in _TYPES and kind not in (POLY_VERTEX, POLY_LINE, POLYGON):
            cell = int(np.argmax(types == kind))
            name = _UNSUPPORTED.get(kind, "unknown cells")
            raise InputError(f"{name} (VTK cell type {kind}, cell {cell}) are not supported")


def _check_sizes(types: np.ndarray, sizes: np.ndarray, number: np.ndarray) -> None:
    right = np.zeros(max(_TYPES) + 1, dtype=np.int64)
    for kind, name in _TYPES.items():
        right[kind] = _OTHER_NODES[name] if name in _OTHER_NODES else CELL_TYPES[name].nodes
    wrong = np.where(types == POLYGON, sizes < 3, sizes != right[types])
    if wrong.any():
        i = int(np.argmax(wrong))
        name = _TYPES.get(int(types[i]), "polygon")
        raise InputError(f"cell {number[i]} is a {name}, but has {sizes[i]} nodes")


def _taken_apart(cells: CellList, types: np.ndarray) -> tuple[CellList, np.ndarray, np.ndarray]:
    """Polylines as lines and poly-vertices as vertices; with the types, and each cell's number before."""
    number = np.arange(len(types))
    lines, points = types == POLY_LINE, types == POLY_VERTEX
    if not (lines.any() or points.any()):
        return cells, types, number
    pieces = np.where(lines, cells.sizes - 1, np.where(points, cells.sizes, 1))
    if (pieces < 1).any():
        i = int(np.argmax(pieces < 1))
        raise InputError(f"cell {i} has {cells.sizes[i]} nodes, too few for its type")
    number = np.repeat(number, pieces)
    nth = np.arange(len(number)) - (np.cumsum(pieces) - pieces)[number]
    sizes = np.where(lines, 2, np.where(points, 1, cells.sizes))
    types = np.where(lines, LINE, np.where(points, VERTEX, types))
    return CellList(cells.nodes, cells.starts[number] + nth, sizes[number]), types[number], number
