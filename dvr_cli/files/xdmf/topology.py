"""The cells of an XDMF Topology, by VTK's numbers, whose node orders XDMF has."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import shown
from dvr_cli.files.vtk.cells import POLY_LINE, POLY_VERTEX, POLYGON, CellList, blocks_of, chain
from dvr_cli.files.xml_places import Element
from dvr_cli.mesh.mesh import Cells

# XDMF's number of a cell type: VTK's, the number of nodes (0: told by the file) and its names.
TYPES = {
    1: (POLY_VERTEX, 0, ("polyvertex",)),
    2: (POLY_LINE, 0, ("polyline",)),
    3: (POLYGON, 0, ("polygon",)),
    4: (5, 3, ("triangle",)),
    5: (9, 4, ("quadrilateral",)),
    6: (10, 4, ("tetrahedron",)),
    7: (14, 5, ("pyramid",)),
    8: (13, 6, ("wedge",)),
    9: (12, 8, ("hexahedron",)),
    34: (21, 3, ("edge_3",)),
    35: (28, 9, ("quadrilateral_9", "quad_9")),
    36: (22, 6, ("triangle_6", "tri_6")),
    37: (23, 8, ("quadrilateral_8", "quad_8")),
    38: (24, 10, ("tetrahedron_10", "tet_10")),
    39: (27, 13, ("pyramid_13",)),
    40: (26, 15, ("wedge_15",)),
    41: (32, 18, ("wedge_18",)),
    48: (25, 20, ("hexahedron_20", "hex_20")),
    49: (33, 24, ("hexahedron_24", "hex_24")),
    50: (29, 27, ("hexahedron_27", "hex_27")),
}
_NUMBER_OF = {name: number for number, (_, _, names) in TYPES.items() for name in names}


def blocks(
    topology: Element, read: Callable[[Element], tuple[np.ndarray, tuple[int, ...]]], n_points: int
) -> tuple[list[Cells], list[np.ndarray], int]:
    """Blocks of cells, the numbers in the topology of the cells of each, and how many it has.

    read: the numbers and the shape of a DataItem. Raises InputError.
    """
    given = topology.attributes
    name = given.get("TopologyType", given.get("Type", ""))
    if "Order" in given or given.get("BaseOffset", "0") != "0":
        raise InputError("a Topology with an Order or a BaseOffset is not supported")
    items = topology.named("DataItem")
    if len(items) != 1:
        raise InputError(f"the Topology {shown(name)} has {len(items)} DataItems, where one is needed")
    values, shape = read(items[0])
    if values.dtype.kind == "f" and not (np.abs(values) < 1 << 53).all():
        raise InputError("the Topology has numbers that are no points")
    entries = values.astype(np.int64)
    if (entries != values).any():
        raise InputError("the Topology has numbers that are no points")
    if name.lower() == "mixed":
        cells, types = _mixed(entries, given)
    elif name.lower() in _NUMBER_OF:
        cells, types = _uniform(entries, shape, _NUMBER_OF[name.lower()], given)
    else:
        raise InputError(f"the Topology {shown(name)} is not supported")
    found, numbers = blocks_of(cells, types, n_points, by_size=False)
    return found, numbers, len(types)


def _uniform(
    entries: np.ndarray, shape: tuple[int, ...], number: int, given: dict[str, str]
) -> tuple[CellList, np.ndarray]:
    kind, nodes, _ = TYPES[number]
    if not nodes:
        text = given.get("NodesPerElement", str(shape[-1] if len(shape) > 1 else 1 if number == 1 else 2))
        nodes = int(text) if text.isascii() and text.isdigit() and len(text) < 10 else 0
    if nodes < 1 or len(entries) % nodes:
        raise InputError(f"the Topology has {len(entries)} nodes, which are no cells of {nodes}")
    n = len(entries) // nodes
    _check_count(given, n)
    return CellList(entries, np.arange(n) * nodes, np.full(n, nodes)), np.full(n, kind)


def _mixed(entries: np.ndarray, given: dict[str, str]) -> tuple[CellList, np.ndarray]:
    """Cells one after the other: the number of the type, for some the number of nodes, and the nodes."""
    n = _count(given)
    m = len(entries)
    if n is None:
        raise InputError("a mixed Topology has no NumberOfElements")
    if n > m:
        raise InputError(f"the Topology should hold {n} cells, but has {m} entries")
    if n == 0:
        return CellList(entries, np.empty(0, np.int64), np.empty(0, np.int64)), np.empty(0, np.int64)
    nodes_of, vtk_of = np.zeros(51, dtype=np.int64), np.zeros(51, dtype=np.int64)
    for number, (kind, nodes, _) in TYPES.items():
        nodes_of[number], vtk_of[number] = nodes, kind
    types = np.clip(entries, 0, 50)
    counted = (types >= 1) & (types <= 3)
    sizes = np.where(counted, np.clip(np.append(entries[1:], 0), 0, m), nodes_of[types])
    first = np.arange(m) + 1 + counted
    heads = chain(np.minimum(first + sizes, m), n)
    if (
        heads[-1] >= m
        or first[heads[-1]] + sizes[heads[-1]] != m
        or not (entries[heads] == types[heads]).all()
    ):
        raise InputError(f"the {n} cells of the Topology do not add up to its {m} entries")
    unknown = vtk_of[types[heads]] == 0
    if unknown.any():
        what = entries[heads][unknown][0]
        raise InputError(f"cells of XDMF's type {what} are not supported")
    return CellList(entries, first[heads], sizes[heads]), vtk_of[types[heads]]


def _count(given: dict[str, str]) -> int | None:
    words = given.get("NumberOfElements", given.get("Dimensions", "")).split()
    if not all(word.isascii() and word.isdigit() and len(word) < 16 for word in words):
        raise InputError(f"NumberOfElements should be a whole number, not {shown(' '.join(words))}")
    return int(np.prod([int(word) for word in words])) if words else None


def _check_count(given: dict[str, str], n: int) -> None:
    count = _count(given)
    if count is not None and count != n:
        raise InputError(f"the Topology should hold {count} cells, but has {n}")
