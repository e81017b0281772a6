"""Reading the sections of MSH 2.2 (and 2.0, 2.1), ASCII and binary: flat lists of nodes and elements.

A node may carry parameters ($ParametricNodes) and an element tags, so records differ in length, and where
one begins is known only from those before it. Chains of records of equal shape are long, though, and are
taken one at a time.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh.cells import cell_type
from dvr_cli.files.gmsh.elements import Elements
from dvr_cli.files.gmsh.nodes import NodeBlocks, Nodes
from dvr_cli.files.gmsh.numbers import TextNumbers, is_blank, parse
from dvr_cli.files.gmsh.sections import Header, Section, read_count

# How many parameters a node in $ParametricNodes has, by the dimension of its entity.
PARAMETERS: dict[float, int] = {0: 0, 1: 1, 2: 2, 3: 0}

DAMAGED = (0, 0)  # the shape of a record that cannot be


def read_nodes(data: bytes, section: Section, header: Header) -> Nodes:
    """Read $Nodes, $ParametricNodes or $NOD of MSH 1, which may have the numbers of either.

    Parametric coordinates are passed over; the layout says where.
    """
    read = _nodes_from_binary if header.byte_order else _nodes_from_text
    return read(data, section, header.byte_order)


def _nodes_from_text(data: bytes, section: Section, _: str) -> Nodes:
    numbers = TextNumbers(data, section, np.float64)
    (count,) = numbers.record("q")
    if section.name == "Nodes" or (section.name == "NOD" and len(numbers.values) == 1 + 4 * count):
        tables = [numbers.doubles(4 * count).reshape(count, 4)]
        numbers.finish()
    else:
        values = numbers.values[1:]
        tables, end = chain(values, count, [4], _shape_of_node_line, section.name)
        if end != len(values):
            raise numbers.goes_on()
    layout, first = [], 2  # token 0 is the count, token 1 the first tag
    for table in tables:
        width = table.shape[1]
        layout.append((first, len(table), width, width - 4, width > 6, -1))
        first += table.size
    tags = [numbers.whole(table[:, 0]) for table in tables]
    return Nodes.join(tags, [table[:, 1:4] for table in tables], NodeBlocks.of(layout))


def _nodes_from_binary(data: bytes, section: Section, byte_order: str) -> Nodes:
    count, start = read_count(data, section.start, section)
    words = np.frombuffer(data, byte_order + "i4", (section.stop - start) // 4, start)
    if section.name == "Nodes":
        if 7 * count > len(words):
            raise InputError(f"section $Nodes declares {count} nodes and is too short for them")
        tables, end = [words[: 7 * count].reshape(count, 7)], 7 * count
    else:
        tables, end = chain(words, count, [7], _shape_of_node_record, section.name)
    check_end(data, start + 4 * end, section)
    points, layout, first = [], [], start + 4
    for table in tables:
        stride = 4 * table.shape[1]
        points.append(np.ndarray((len(table), 3), byte_order + "f8", data, first, (stride, 8)))
        layout.append((first - section.start, len(table), stride, stride - 28, stride > 36, -1))
        first += 4 * table.size
    return Nodes.join([table[:, 0] for table in tables], points, NodeBlocks.of(layout))


def _shape_of_node_line(key: list) -> tuple[int, int]:
    """Of an ASCII record of $ParametricNodes: tag, x, y, z, dimension, entity, parameters."""
    return (6 + PARAMETERS[key[0]], 1) if key[0] in PARAMETERS else DAMAGED


def _shape_of_node_record(key: list) -> tuple[int, int]:
    """Of a binary record of $ParametricNodes, in words of 4 bytes."""
    return (9 + 2 * PARAMETERS[key[0]], 1) if key[0] in PARAMETERS else DAMAGED


def read_elements(data: bytes, section: Section, header: Header) -> list[Elements]:
    """Read $Elements. The first tag of an element is its physical group, the second its entity.

    An element in several physical groups occurs once for each of them; here they all come back.
    """
    if header.byte_order:
        count, start = read_count(data, section.start, section)
        words = np.frombuffer(data, header.byte_order + "i4", (section.stop - start) // 4, start)
        tables, end = chain(words, count, [0, 1, 2], _shape_of_batch, section.name)
        check_end(data, start + 4 * end, section)
        return [_from_batches(table) for table in tables]
    numbers = TextNumbers(data, section, np.int64)
    (count,) = numbers.record("q")
    tables, end = chain(numbers.values[1:], count, [1, 2], _shape_of_line, section.name)
    if end + 1 != len(numbers.values):
        raise numbers.goes_on()
    return [_elements(int(table[0, 1]), int(table[0, 2]), table[:, 0], table[:, 3:]) for table in tables]


def _shape_of_line(key: list) -> tuple[int, int]:
    """Of an ASCII record: number, type, number of tags, tags, nodes."""
    code, tags = key
    return (3 + tags + cell_type(code).nodes, 1) if tags >= 0 else DAMAGED


def _shape_of_batch(key: list) -> tuple[int, int]:
    """Of a binary record: type, number of elements, number of tags; for each its number, tags, nodes."""
    code, count, tags = key
    return (3 + count * (1 + tags + cell_type(code).nodes), count) if min(count, tags) >= 0 else DAMAGED


def _from_batches(table: np.ndarray) -> Elements:
    code, count, tags = table[0, :3].tolist()
    rows = table[:, 3:].reshape(len(table) * count, 1 + tags + cell_type(code).nodes)
    return _elements(code, tags, rows[:, 0], rows[:, 1:])


def _elements(code: int, tags: int, numbers: np.ndarray, rows: np.ndarray) -> Elements:
    """Elements of one type from their numbers and rows of ``tags`` tags and then nodes."""
    none = np.zeros(len(rows), np.int32)
    return Elements(
        code,
        numbers=numbers,
        nodes=rows[:, tags:],
        geometrical=rows[:, 1] if tags > 1 else none,
        physical=(rows[:, 0] if tags > 0 else none)[:, np.newaxis],
    )


def read_periodic(data: bytes, section: Section) -> np.ndarray:
    """Read $Periodic, which is text in binary files too: (K, 2) node tags, slave and master."""
    text = re.sub(rb"Affine[^\n]*", b"", data[section.start : section.stop])
    numbers = parse(text, np.int64, section.name)
    pairs, at = [np.empty((0, 2), np.int64)], 1
    while at + 3 < len(numbers):  # three tags of entities, the number of pairs, the pairs
        end = at + 4 + 2 * int(numbers[at + 3])
        if not at + 4 <= end <= len(numbers):
            break
        pairs.append(numbers[at + 4 : end].reshape(-1, 2))
        at = end
    if at != len(numbers) or numbers[0] != len(pairs) - 1:
        raise InputError(f"section ${section.name} is truncated or damaged")
    return np.concatenate(pairs)


def chain(
    values: np.ndarray,
    total: int,
    key: list[int],
    shape: Callable[[list], tuple[int, int]],
    name: str,
) -> tuple[list[np.ndarray], int]:
    """Split a chain of records into tables of consecutive records that agree in their ``key`` columns.

    shape(key values) gives a record's length and how many of the ``total`` items it holds. Returns the
    tables, views of ``values``, and where the chain ends; InputError if the values do not hold it.
    """
    tables = []
    at = items = 0
    while items < total:
        head = values[at : at + key[-1] + 1]
        width, held = shape(head[key].tolist()) if len(head) > key[-1] else DAMAGED
        room = min((len(values) - at) // width, (total - items) // max(held, 1)) if width else 0
        if room < 1:
            raise InputError(f"section ${name} ends early or declares too much: truncated or damaged")
        table = values[at : at + room * width].reshape(room, width)
        tables.append(table[: agreeing(table, [column for column in key if column < width])])
        at += tables[-1].size
        items += held * len(tables[-1])
    return tables, at


def agreeing(table: np.ndarray, key: list[int]) -> int:
    """The number of rows at the beginning of ``table`` that agree with the first in the ``key`` columns.

    Looks ahead in growing windows, so that many short chains cost no more than a long one.
    """
    count, window = 1, 64
    while count < len(table):
        same = (table[count : count + window][:, key] == table[0, key]).all(axis=1)
        if not same.all():
            return count + int(same.argmin())
        count += len(same)
        window *= 4
    return count


def check_end(data: bytes, end: int, section: Section) -> None:
    if not is_blank(data, end, section.stop):
        raise InputError(f"section ${section.name} holds more than it declares: it is damaged")
