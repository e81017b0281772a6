"""An Exodus file as a mesh: coordinates, element blocks and sets."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.container import ContainerSource, CoordinateArray
from dvr_cli.files.exodus.contents import beyond_mesh
from dvr_cli.files.exodus.elements import NODE_ORDER, element_type
from dvr_cli.files.exodus.variables import element_variables, nodal_variables
from dvr_cli.files.netcdf import NetCDF, open_netcdf, with_values
from dvr_cli.mesh.mesh import Cells, Mesh


class ExodusSource(ContainerSource):
    """An Exodus file."""

    format = "exodus"
    with_values = staticmethod(with_values)


@dataclass(frozen=True)
class _Block:
    """An element block that has elements.

    number: its place in the file, from 1; sides: see elements.ElementType.
    """

    number: int
    cells: Cells
    sides: tuple[tuple[int, ...], ...]


def read(data: bytes) -> ExodusSource:
    """Read an Exodus file of any netCDF variant.

    Each element block with elements is a block of cells, in file order, its id the cell data "exodus:block"
    and its name a cell set; what has no name gets the usual one, of kind and id ("block_10"). Node sets are
    point sets, element sets cell sets, side sets facet sets. Variables are those of the last time step.

    Raises InputError for damage and for what is not supported, by name.
    """
    with open_netcdf(data) as file:
        if file.length("num_processors") > 1:
            raise InputError(
                f"it is one of the {file.length('num_processors')} parts of a mesh; join them first (epu)"
            )
        points, arrays = _read_coordinates(file)
        blocks = _read_blocks(file, len(points), points.shape[1])
        numbers = [block.number for block in blocks]
        ids = _ids(file, "eb_prop1", file.length("num_el_blk"))
        sizes = [len(block.cells.vertices) for block in blocks]
        mesh = Mesh(
            points,
            [block.cells for block in blocks],
            {
                "exodus:block": [np.full(n, ids[b - 1]) for b, n in zip(numbers, sizes, strict=True)],
                **element_variables(file, numbers, sizes),
            },
            nodal_variables(file, *points.shape),
        )
        names = _names(file, "eb_names", "block", ids)
        for b, block in enumerate(blocks):
            members = [np.arange(n if i == b else 0) for i, n in enumerate(sizes)]
            mesh.cell_sets[names[block.number - 1]] = members
        mesh.cell_sets |= _element_sets(file, blocks, mesh.cell_sets)
        mesh.point_sets = _node_sets(file, len(points))
        mesh.facet_sets = _side_sets(file, blocks)
        return ExodusSource(data, mesh, arrays, beyond_mesh(file))


def _read_coordinates(file: NetCDF) -> tuple[np.ndarray, list[CoordinateArray]]:
    """The (N, 2) or (N, 3) points, and where they are stored."""
    dimension, n = file.length("num_dim"), file.length("num_nodes")
    if dimension not in (2, 3) or n == 0:
        raise InputError(f"it has {n} nodes of {dimension} coordinates; 2 or 3 coordinates are possible")
    points = np.empty((n, dimension))
    places: list[tuple[str, tuple[int, ...], tuple[int, ...]]]
    if "coord" in file:
        places = [("coord", tuple(range(dimension)), (dimension, n))]
    else:
        places = [(f"coord{axis}", (i,), (n,)) for i, axis in enumerate("xyz"[:dimension])]
    arrays = []
    for name, axes, shape in places:
        if name not in file:
            raise InputError(f"it has no variable {name}")
        values = file.array(name)
        if values.shape != shape or values.dtype.kind != "f":
            raise InputError(f"the variable {name} does not hold a number for each of {n} nodes")
        points[:, axes] = values.reshape(-1, n).T
        arrays.append(CoordinateArray(name, slice(None), axes, shape, values.dtype))
    return points, arrays


def _read_blocks(file: NetCDF, n_points: int, dimension: int) -> list[_Block]:
    blocks = []
    for number in range(1, file.length("num_el_blk") + 1):
        name = f"connect{number}"
        if name not in file:
            if f"ebconn{number}" in file or f"facconn{number}" in file:
                raise InputError(f"element block {number} holds polyhedra, which are not supported")
            if file.length(f"num_el_in_blk{number}"):
                raise InputError(f"it has no variable {name}")
            continue
        stored = file.array(name)
        if stored.size == 0:
            continue
        type_name = file.text_attribute(name, "elem_type")
        if type_name.upper() in ("NSIDED", "NFACED", "SUPER"):
            raise InputError(f"elements of type {type_name.upper()} are not supported")
        if stored.ndim != 2 or stored.dtype.kind not in "iu":
            raise InputError(f"the variable {name} does not hold a row of node numbers for each element")
        kind = element_type(type_name, stored.shape[1], dimension)
        order = NODE_ORDER.get(kind.cell_type)
        vertices = (stored if order is None else stored[:, list(order)]).astype(np.int64)
        _check_numbers(vertices, n_points, "node", f"element block {number}")
        blocks.append(_Block(number, Cells(kind.cell_type, vertices - 1), kind.sides))
    if not blocks:
        raise InputError("it has no elements")
    return blocks


def _check_numbers(numbers: np.ndarray, most: int, what: str, where: str) -> None:
    """Raise InputError unless all numbers lie between 1 and ``most``."""
    if numbers.size and not 1 <= numbers.min() <= numbers.max() <= most:
        wrong = numbers[(numbers < 1) | (numbers > most)][0]
        raise InputError(f"{where} names {what} {wrong}, but there are {most}, counted from 1")


def _node_sets(file: NetCDF, n_points: int) -> dict[str, np.ndarray]:
    ids = _ids(file, "ns_prop1", file.length("num_node_sets"))
    result = {}
    for i, name in enumerate(_names(file, "ns_names", "nodelist", ids)):
        members = _members(file, f"node_ns{i + 1}", f"num_nod_ns{i + 1}")
        _check_numbers(members, n_points, "node", f"node set {name}")
        result[name] = members - 1
    return result


def _element_sets(file: NetCDF, blocks: list[_Block], taken: Collection[str]) -> dict[str, list[np.ndarray]]:
    """Element sets; taken: names of other sets of cells."""
    ids = _ids(file, "els_prop1", file.length("num_elem_sets"))
    starts = _starts(file, blocks)
    result = {}
    for i, name in enumerate(_names(file, "els_names", "elemset", ids, taken)):
        members = _members(file, f"elem_els{i + 1}", f"num_ele_els{i + 1}")
        _check_numbers(members, _element_count(file), "element", f"element set {name}")
        result[name] = [
            np.unique(members[(members > start) & (members <= start + len(block.cells.vertices))]) - 1 - start
            for start, block in zip(starts, blocks, strict=True)
        ]
    return result


def _side_sets(file: NetCDF, blocks: list[_Block]) -> dict[str, np.ndarray]:
    """The corner vertices of the facets of each side set, facets in the order of the blocks."""
    ids = _ids(file, "ss_prop1", file.length("num_side_sets"))
    starts = _starts(file, blocks)
    result = {}
    for i, name in enumerate(_names(file, "ss_names", "surface", ids)):
        elements = _members(file, f"elem_ss{i + 1}", f"num_side_ss{i + 1}")
        sides = _members(file, f"side_ss{i + 1}", f"num_side_ss{i + 1}")
        _check_numbers(elements, _element_count(file), "element", f"side set {name}")
        facets = []
        for start, block in zip(starts, blocks, strict=True):
            inside = (elements > start) & (elements <= start + len(block.cells.vertices))
            chosen = sides[inside]
            _check_numbers(chosen, len(block.sides), "side", f"side set {name}")
            width = max(map(len, block.sides))
            local = np.array([[*side, *[-1] * (width - len(side))] for side in block.sides])[chosen - 1]
            rows = np.take_along_axis(block.cells.vertices[elements[inside] - 1 - start], local, axis=1)
            facets.append(np.where(local < 0, -1, rows))
        result[name] = _stacked(facets)
    return result


def _members(file: NetCDF, variable: str, dimension: str) -> np.ndarray:
    """The numbers in a variable that lists members of a set; empty sets may be without it."""
    numbers = file.integers(variable).ravel()
    if len(numbers) != file.length(dimension):
        raise InputError(f"{variable} should list {file.length(dimension)} members, but has {len(numbers)}")
    return numbers


def _stacked(rows: list[np.ndarray]) -> np.ndarray:
    """One array of all rows, filled up with -1."""
    filled = [row for row in rows if len(row)]
    width = max((row.shape[1] for row in filled), default=1)
    return np.concatenate(
        [np.pad(row, ((0, 0), (0, width - row.shape[1])), constant_values=-1) for row in filled]
        or [np.empty((0, width), dtype=np.int64)]
    )


def _starts(file: NetCDF, blocks: list[_Block]) -> list[int]:
    """The number of elements before each block: they are numbered through all blocks."""
    before = np.cumsum([0, *(file.length(f"num_el_in_blk{i + 1}") for i in range(file.length("num_el_blk")))])
    return [int(before[block.number - 1]) for block in blocks]


def _element_count(file: NetCDF) -> int:
    return sum(file.length(f"num_el_in_blk{i + 1}") for i in range(file.length("num_el_blk")))


def _ids(file: NetCDF, name: str, count: int) -> np.ndarray:
    """The ids of blocks or sets; where the file does not say, their numbers."""
    ids = file.integers(name).ravel()
    return ids if len(ids) == count else np.arange(1, count + 1)


def _names(file: NetCDF, variable: str, kind: str, ids: np.ndarray, taken: Collection[str] = ()) -> list[str]:
    """Names of blocks or sets, each once: those in the file, or of kind and id where it has none."""
    given = file.strings(variable)
    seen = set(taken)
    result = []
    for i, number in enumerate(ids.tolist()):
        name = (given[i] if i < len(given) else "") or f"{kind}_{number}"
        if name in seen:
            name = f"{name} ({kind} {number})"
        if name in seen:
            name = f"{name} #{i + 1}"
        seen.add(name)
        result.append(name)
    return result
