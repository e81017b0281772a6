"""Reading the sections of MSH 3, ASCII and binary: flat lists of nodes and elements with their entity."""

from __future__ import annotations

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh.cells import cell_type
from dvr_cli.files.gmsh.elements import MAX_GROUPS, Elements
from dvr_cli.files.gmsh.msh2 import DAMAGED, chain, check_end
from dvr_cli.files.gmsh.msh4 import Entity
from dvr_cli.files.gmsh.nodes import NodeBlocks, Nodes
from dvr_cli.files.gmsh.numbers import TextNumbers
from dvr_cli.files.gmsh.sections import Header, Section, read_count

# Words of 4 bytes that the parameters of a node take, by the dimension of its entity: doubles, but for a
# volume's zeros.
_WORDS = {0: 0, 1: 2, 2: 4, 3: 3}


def read_entities(data: bytes, section: Section) -> dict[Entity, list[int]]:
    """Read $Entities, which is text in binary files too, for the physical groups of each entity."""
    numbers = TextNumbers(data, section, np.int64)
    physical: dict[Entity, list[int]] = {}
    for dimension, entities in enumerate(numbers.record("4q")):
        for _ in range(entities):
            (tag,) = numbers.record("q")
            if dimension > 0:
                (bounds,) = numbers.record("q")
                numbers.skip("i", bounds)
            (groups,) = numbers.record("q")
            if groups > MAX_GROUPS:
                raise InputError(f"an entity is in {groups} physical groups; dvr takes {MAX_GROUPS}")
            if groups:
                physical[dimension, tag] = abs(numbers.integers("i", groups)).tolist()
    numbers.finish()
    return physical


def read_nodes(data: bytes, section: Section, header: Header) -> Nodes:
    """Read $Nodes: tag, x, y, z, entity, and unless that is 0 its dimension and as many parameters.

    In a volume these are zeros, which say nothing and stay.
    """
    if header.byte_order:
        return _nodes_from_binary(data, section, header.byte_order)
    numbers = TextNumbers(data, section, np.float64)
    (count,) = numbers.record("q")
    values = np.append(numbers.values[1:], 0.0)  # a dimension is looked for behind the last node, too
    tables, end = chain(values, count, [4, 5], _shape_of_line, section.name)
    if end != len(values) - 1:
        raise numbers.goes_on()
    layout, first = [], 2  # token 0 is the count, token 1 the first tag
    for table in tables:
        width = table.shape[1]
        layout.append((first, len(table), width, width - 4 if width > 5 else 0, width in (7, 8), -1))
        first += table.size
    tags = [numbers.whole(table[:, 0]) for table in tables]
    return Nodes.join(tags, [table[:, 1:4] for table in tables], NodeBlocks.of(layout))


def _nodes_from_binary(data: bytes, section: Section, byte_order: str) -> Nodes:
    count, start = read_count(data, section.start, section)
    words = np.frombuffer(data, byte_order + "i4", (section.stop - start) // 4, start)
    tables, end = chain(np.append(words, 0), count, [7, 8], _shape_of_record, section.name)
    check_end(data, start + 4 * end, section)
    points, layout, first = [], [], start + 4
    for table in tables:
        width = table.shape[1]
        stride = 4 * width
        points.append(np.ndarray((len(table), 3), byte_order + "f8", data, first, (stride, 8)))
        tail = stride - 28 if width > 8 else 0
        layout.append((first - section.start, len(table), stride, tail, width in (11, 13), -1))
        first += 4 * table.size
    return Nodes.join([table[:, 0] for table in tables], points, NodeBlocks.of(layout))


def _shape_of_line(key: list) -> tuple[int, int]:
    entity, dimension = key
    if entity == 0:
        return 5, 1
    return (6 + int(dimension), 1) if dimension in range(4) else DAMAGED


def _shape_of_record(key: list) -> tuple[int, int]:
    """In words of 4 bytes."""
    entity, dimension = key
    if entity == 0:
        return 8, 1
    return (9 + _WORDS[dimension], 1) if dimension in _WORDS else DAMAGED


def read_elements(
    data: bytes, section: Section, header: Header, physical: dict[Entity, list[int]]
) -> list[Elements]:
    """Read $Elements: number, type, entity, how many numbers follow: nodes, and partitions behind them."""
    if header.byte_order:
        count, start = read_count(data, section.start, section)
        values = np.frombuffer(data, header.byte_order + "i4", (section.stop - start) // 4, start)
        tables, end = chain(values, count, [1, 2, 3], _shape_of_element, section.name)
        check_end(data, start + 4 * end, section)
    else:
        numbers = TextNumbers(data, section, np.int64)
        (count,) = numbers.record("q")
        tables, end = chain(numbers.values[1:], count, [1, 2, 3], _shape_of_element, section.name)
        if end + 1 != len(numbers.values):
            raise numbers.goes_on()
    elements = []
    for table in tables:
        code, entity = table[0, 1:3].tolist()
        kind = cell_type(code)
        groups = physical.get((kind.dimension, entity), [0])
        elements.append(
            Elements(
                code,
                numbers=table[:, 0],
                nodes=table[:, 4 : 4 + kind.nodes],
                geometrical=table[:, 2],
                physical=np.full((len(table), len(groups)), groups),
            )
        )
    return elements


def _shape_of_element(key: list) -> tuple[int, int]:
    code, _, follow = key
    return (4 + follow, 1) if follow >= cell_type(code).nodes else DAMAGED
