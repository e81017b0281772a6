"""A Mesh from the parts of a Gmsh file.

Physical groups. The names of $PhysicalNames are the keys of ``field_data``. Gmsh allows one name for several
groups, of different dimensions or not; all but the first are filed as "NAME (dim D, tag T)". A cell's first
physical tag is in ``cell_data["gmsh:physical"]``; if any cell is in several groups, further tags are in
"gmsh:physical:2", "gmsh:physical:3" and so on (0 for none), and "dvr:region" numbers, from 1, the distinct
combinations of dimension, entity and set of groups. ``mesh.groups`` puts all this together.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh.cells import NODE_ORDER, cell_type
from dvr_cli.files.gmsh.data import View
from dvr_cli.files.gmsh.elements import Elements, join_consecutive, merge_repeated
from dvr_cli.files.gmsh.nodes import Nodes
from dvr_cli.files.tags import TagIndex
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.ranks import ranks


def make_mesh(
    nodes: Nodes,
    elements: list[Elements],
    names: list[tuple[str, int, int]],
    periodic: np.ndarray,
    views: list[View],
    repeated: bool,
) -> Mesh:
    """Put a mesh together.

    elements: as read, their nodes given by tags. names: (name, tag, dimension) of the physical groups.
    periodic: (K, 2) node tags, slave and master; pairs with a node the file does not hold are left out.
    repeated: whether the format repeats an element for each of its groups.
    InputError if an element refers to a node that is missing.
    """
    index = TagIndex(nodes.tags)
    blocks = [_with_indices(block, index) for block in join_consecutive(elements)]
    given = blocks
    cell: np.ndarray | None = None
    if repeated:
        blocks, cell = merge_repeated(blocks)
    cell_data = _group_data(blocks)
    ends = np.cumsum([len(block.numbers) for block in blocks], dtype=np.int64)
    on_cells = [view for view in views if not view.on_nodes]
    if on_cells and blocks:
        numbers = np.concatenate([block.numbers for block in given])
        position = np.arange(len(numbers)) if cell is None else cell
        fields = _fields(on_cells, TagIndex(numbers), position, int(ends[-1]))
        cell_data = {name: np.split(values, ends[:-1]) for name, values in fields.items()} | cell_data
    count = len(nodes.tags)
    pairs = index.find(periodic)
    return Mesh(
        points=nodes.points,
        cells=[_cells(block) for block in blocks],
        cell_data=cell_data,
        point_data=_fields([view for view in views if view.on_nodes], index, np.arange(count), count),
        field_data=field_data(names),
        entities=nodes.entities,
        periodic=pairs[(pairs >= 0).all(axis=1)].astype(np.int64),
    )


def _with_indices(block: Elements, index: TagIndex) -> Elements:
    """The block with its nodes given by index instead of tag."""
    vertices = index.find(block.nodes)
    missing = vertices < 0
    if missing.any():
        element = int(block.numbers[missing.any(axis=1)][0])
        raise InputError(f"element {element} refers to node {block.nodes[missing][0]}, which the file lacks")
    return block._replace(nodes=vertices)


def _cells(block: Elements) -> Cells:
    name = cell_type(block.code).name
    order = NODE_ORDER.get(name)
    return Cells(name, block.nodes if order is None else block.nodes[:, order])


def _group_data(blocks: list[Elements]) -> dict[str, list[np.ndarray]]:
    """The cell data that hold physical groups, entities and regions."""
    width = max((block.physical.shape[1] for block in blocks), default=1)
    physical = [np.pad(block.physical, ((0, 0), (0, width - block.physical.shape[1]))) for block in blocks]
    data = {
        "gmsh:physical": [np.ascontiguousarray(tags[:, 0]) for tags in physical],
        "gmsh:geometrical": [block.geometrical for block in blocks],
    }
    for column in range(1, width):
        data[f"gmsh:physical:{column + 1}"] = [np.ascontiguousarray(tags[:, column]) for tags in physical]
    if width > 1:
        data["dvr:region"] = _regions(blocks, np.concatenate(physical))
    return data


def tags_of_entities(
    entities: list[tuple[int, int]], groups: list[list[int]]
) -> tuple[tuple[str, ...], list[list[int]]]:
    """The names of the cell data that say of what entities and groups elements are, and these of each block.

    entities: dimension and tag of each block of elements; groups: the physical groups of each, 0 for none.
    """
    width = max(map(len, groups), default=1)
    rows = [[*of_block, *([0] * (width - len(of_block)))] for of_block in groups]
    tags = [[row[0], tag, *row[1:]] for row, (_, tag) in zip(rows, entities, strict=True)]
    names = ["gmsh:physical", "gmsh:geometrical", *(f"gmsh:physical:{nth + 1}" for nth in range(1, width))]
    if width > 1:
        names.append("dvr:region")
        known = [(*entity, *sorted(row)) for entity, row in zip(entities, rows, strict=True)]
        place = {region: nth for nth, region in enumerate(sorted(set(known)), start=1)}
        tags = [[*row, place[region]] for row, region in zip(tags, known, strict=True)]
    return tuple(names), tags


def _regions(blocks: list[Elements], physical: np.ndarray) -> list[np.ndarray]:
    """Number the distinct combinations of dimension, entity and set of physical groups from 1."""
    sizes = [len(block.numbers) for block in blocks]
    dimensions = np.repeat([cell_type(block.code).dimension for block in blocks], sizes)
    entities = np.concatenate([block.geometrical for block in blocks])
    region = np.zeros(len(entities), np.int64)
    for column in (dimensions, entities, *np.sort(physical, axis=1).T):
        place = ranks(column)
        region = ranks(region * (place.max(initial=0) + 1) + place)
    return np.split((region + 1).astype(np.int32), np.cumsum(sizes)[:-1])


def _fields(views: list[View], index: TagIndex, position: np.ndarray, size: int) -> dict[str, np.ndarray]:
    """Arrays of ``size`` rows from views, NaN where a view gives no value.

    position[i] is the row of the i-th tag in the index. The last step of a name is kept; several views of
    one name and step (as partitions write them) are put together.
    """
    fields: dict[str, np.ndarray] = {}
    steps: dict[str, int] = {}
    for view in views:
        shape = (size,) if view.values.shape[1] == 1 else (size, view.values.shape[1])
        if view.name not in fields or steps[view.name] != view.step or fields[view.name].shape != shape:
            fields[view.name] = np.full(shape, np.nan)
            steps[view.name] = view.step
        at = index.find(view.tags)
        fields[view.name][position[at[at >= 0]]] = view.values[at >= 0].reshape(-1, *shape[1:])
    return fields


def field_data(names: list[tuple[str, int, int]]) -> dict[str, np.ndarray]:
    groups: dict[str, np.ndarray] = {}
    for name, tag, dimension in names:
        key = f"{name} (dim {dimension}, tag {tag})" if name in groups else name
        groups[key] = np.array([tag, dimension])
    return groups
