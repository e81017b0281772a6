"""The cells and attributes of all grids of an XDMF file, as one mesh."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import shown
from dvr_cli.files.xdmf.grids import Grids
from dvr_cli.files.xdmf.topology import blocks
from dvr_cli.files.xml_places import Element
from dvr_cli.mesh.groups import topological_dimension
from dvr_cli.mesh.mesh import Cells, Mesh

Reader = Callable[[Element], tuple[np.ndarray, tuple[int, ...]]]


def mesh_of(points: np.ndarray, grids: Grids, read: Reader) -> tuple[Mesh, list[list[np.ndarray]], list[str]]:
    """The mesh; for each grid, the numbers in it of the cells of the blocks it adds; what is not read.

    The first grid's cells are the mesh. Another grid whose cells are among them (tags of cells, as dolfinx
    writes them) adds data, any other one (tags of facets) its cells. Data that a block has not are 0 there,
    or not a number.
    """
    mesh = Mesh(points, [])
    found: dict[str, dict[int, np.ndarray]] = {}
    added: list[list[np.ndarray]] = []
    unread: dict[str, None] = {}
    for name, topology, attributes in grids.grids:
        of_grid, numbers, n_cells = blocks(topology, read, len(points))
        where = _places(mesh.cells, of_grid, numbers, name)
        if where is None:
            where = [
                (len(mesh.cells) + i, np.arange(len(number)), number) for i, number in enumerate(numbers)
            ]
            mesh.cells += of_grid
            added.append(numbers)
        else:
            added.append([])
        for attribute in attributes:
            _read_attribute(attribute, name, read, n_cells, mesh, where, found, unread)
    for name, of_blocks in found.items():
        like = next(iter(of_blocks.values()))
        mesh.cell_data[name] = [
            of_blocks.get(b, _nothing(like, len(block.vertices))) for b, block in enumerate(mesh.cells)
        ]
    return mesh, added, list(unread)


def _read_attribute(
    attribute: Element,
    grid: str,
    read: Reader,
    n_cells: int,
    mesh: Mesh,
    where: list[tuple[int, np.ndarray, np.ndarray]],
    found: dict[str, dict[int, np.ndarray]],
    unread: dict[str, None],
) -> None:
    """Take an Attribute into the data.

    where: for the blocks of its grid, which of the mesh they are, the rows there and the cells' numbers.
    """
    name = attribute.attributes.get("Name", "")
    center = attribute.attributes.get("Center", "Node").lower()
    items = attribute.named("DataItem")
    rows = {"node": len(mesh.points), "cell": n_cells}.get(center, 0)
    if len(items) != 1 or not rows or attribute.attributes.get("ItemType", ""):
        unread[name] = None
        return
    try:
        values, _ = read(items[0])
    except InputError:
        unread[name] = None
        return
    if len(values) == 0 or len(values) % rows:
        unread[name] = None
        return
    values = values if len(values) == rows else values.reshape(rows, -1)
    if center == "node":
        mesh.point_data[name if name not in mesh.point_data else f"{grid}:{name}"] = values
        return
    blocks_before = found.get(name, {})
    if any(b in blocks_before for b, _, _ in where) or _unlike(blocks_before, values):
        name = f"{grid}:{name}"
    of_blocks = found.setdefault(name, {})
    for b, at, numbers in where:
        if len(at):
            of_blocks.setdefault(b, _nothing(values, len(mesh.cells[b].vertices)))[at] = values[numbers]


def _unlike(of_blocks: dict[int, np.ndarray], values: np.ndarray) -> bool:
    return any(
        block.shape[1:] != values.shape[1:] or block.dtype != values.dtype for block in of_blocks.values()
    )


def _nothing(like: np.ndarray, n: int) -> np.ndarray:
    """n rows of data that are not there."""
    return np.full((n, *like.shape[1:]), np.nan if like.dtype.kind == "f" else 0, dtype=like.dtype)


def _places(
    known: list[Cells], of_grid: list[Cells], numbers: list[np.ndarray], name: str
) -> list[tuple[int, np.ndarray, np.ndarray]] | None:
    """The places of a grid's cells among those known: block, rows, and numbers in the grid; or None.

    Raises InputError if some are and some are not.
    """
    dimensions = [topological_dimension(block.type) or 0 for block in known]
    result = []
    missing = 0
    for block, number in zip(of_grid, numbers, strict=True):
        left = np.ones(len(number), dtype=bool)
        for b, other in enumerate(known):
            if other.type == block.type and dimensions[b] == max(dimensions):
                rows = _rows_of(block.vertices, other.vertices)
                result.append((b, rows[rows >= 0], number[rows >= 0]))
                left &= rows < 0
        missing += int(left.sum())
    total = sum(map(len, numbers))
    if missing and missing < total:
        raise InputError(
            f"{total - missing} of the {total} cells of the Grid {shown(name)} are those of another grid, "
            "the rest are not"
        )
    return None if missing or not total else result


def _rows_of(cells: np.ndarray, among: np.ndarray) -> np.ndarray:
    """(n,) the row with the same vertices as each of ``cells``, -1 for none."""
    both = np.sort(np.concatenate([among, cells]), axis=1)
    _, first, inverse = np.unique(both, axis=0, return_index=True, return_inverse=True)
    rows = first[inverse.ravel()[len(among) :]]
    return np.where(rows < len(among), rows, -1)
