"""The byte ranges of binary Gmsh files, MSH 2 and 4.1, of linear elements.

Only the headers of blocks are read, and of MSH 2 the elements before those of the last type, as there each
may have a header.
"""

from __future__ import annotations

import mmap
import re
import struct
from dataclasses import replace
from itertools import groupby, pairwise
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh.cells import cell_type
from dvr_cli.files.gmsh.data import read_physical_names
from dvr_cli.files.gmsh.elements import MAX_BLOCKS
from dvr_cli.files.gmsh.mesh import field_data
from dvr_cli.files.gmsh.msh2 import agreeing
from dvr_cli.files.gmsh.msh4 import Entities, read_entities
from dvr_cli.files.gmsh.numbers import BinaryNumbers, read_numbers
from dvr_cli.files.gmsh.sections import (
    Header,
    Section,
    Sections,
    next_section,
    opening_of,
    read_count,
    read_header,
)
from dvr_cli.files.ranges import LINEAR, Counted, Part, Ranges, Rows, Table

_TAGS = ("gmsh:physical", "gmsh:geometrical")
_KNOWN = ("MeshFormat", "PhysicalNames", "Entities", "Nodes", "Elements")
_MOST = 10_000  # parts of a table
_END_OF_ELEMENTS = re.compile(rb"\s*\$EndElements")
_VERSIONS_2 = ("2", "2.0", "2.1", "2.2")


class _Other(Exception):
    """A file that a process has to read whole."""


class _Block(NamedTuple):
    """The elements of one type that lie together; entity: theirs in MSH 4.1, dimension and tag."""

    type: str
    part: Part
    entity: tuple[int, int] | None = None


def ranges_of(path: Path) -> Ranges | None:
    """The ranges of the file at ``path``, None where a process has to read it whole; raises OSError."""
    with path.open("rb") as file:
        data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)  # views of it may outlive an error
    try:
        return _found(cast(bytes, data))
    except (InputError, _Other):  # whoever reads the file whole will say why
        return None


def _found(data: bytes) -> Ranges:
    once: dict[str, Section] = {}
    header, at = Header("", ""), 0
    points, blocks = Table(()), list[_Block]()
    while (section := opening_of(data, at)) is not None:
        name = section.name
        _need(name in _KNOWN and name not in once)
        if name in ("Nodes", "Elements"):
            _need(header.byte_order != "" and (header.version == "4.1" or header.version in _VERSIONS_2))
            older = header.version != "4.1"
            if name == "Nodes":
                points, at = (_nodes_2 if older else _nodes_4)(data, section, header.byte_order)
            else:
                blocks, at = (_elements_2 if older else _elements_4)(data, section, header.byte_order)
            once[name] = section._replace(end=_end(data, at, name))
        else:
            once[name] = next_section(data, at)
        if name == "MeshFormat":
            header = read_header(data, Sections(once, [], []))
        at = once[name].end
    named = read_physical_names(data, once["PhysicalNames"]) if "PhysicalNames" in once else []
    if header.version == "4.1":
        entities = Entities({}, {}, set())
        if "Entities" in once:
            read_entities(read_numbers(data, once["Entities"], header), False, entities, older=False)
        blocks = [_with_tags(block, entities) for block in blocks]
    tables = _tables(blocks)
    _need(points.count > 0 and len(tables) > 0)
    return Ranges(points, tables, base=1, names=_TAGS, once=header.version != "4.1", groups=field_data(named))


def _need(holds: bool) -> None:
    if not holds:
        raise _Other


def _end(data: bytes, at: int, name: str) -> int:
    """Behind the marker that ends a section whose body ends at ``at``."""
    match = re.compile(rb"\s*\$End%b" % name.encode()).match(data, at)
    if match is None:
        raise _Other
    return match.end()


def _tables(blocks: list[_Block]) -> tuple[tuple[str, Table], ...]:
    """The tables of the types of cells, in file order, where there are no more than keep that order."""
    _need(sum(a.type != b.type for a, b in pairwise(blocks)) <= MAX_BLOCKS)
    tables: list[tuple[str, Table]] = []
    for name, of_type in groupby((block for block in blocks if block.part.rows.count), lambda b: b.type):
        parts = tuple(block.part for block in of_type)
        _need(len(parts) <= _MOST)
        tables.append((name, Table(parts)))
    return tuple(tables)


# ---------------------------------------------------------------------------------- MSH 4.1


def _nodes_4(data: bytes, section: Section, order: str) -> tuple[Table, int]:
    """The coordinates, and where the section's body ends."""
    numbers = BinaryNumbers(data, section, order)
    blocks, declared = numbers.record("4q")[:2]
    parts, nodes = [], 0
    _need(blocks <= _MOST)
    for _ in range(blocks):
        dimension, _, parametric, count = numbers.record("3iq")
        _need(0 <= dimension <= 3 and parametric == 0)
        tags = Rows(section.start + numbers.position, f"{order}i8", 1, count)
        numbers.skip("q", count)
        rows = Rows(section.start + numbers.position, f"{order}f8", 3, count)
        numbers.skip("d", 3 * count)
        parts.append(Part(rows, (Counted(tags, (nodes + 1,), 1),)))
        nodes += count
    _need(nodes == declared)
    return Table(tuple(parts)), section.start + numbers.position


def _elements_4(data: bytes, section: Section, order: str) -> tuple[list[_Block], int]:
    """The elements in blocks, and where the section's body ends."""
    numbers = BinaryNumbers(data, section, order)
    blocks, declared = numbers.record("4q")[:2]
    found, elements = [], 0
    for _ in range(blocks):
        dimension, entity, code, count = numbers.record("3iq")
        kind = cell_type(code)
        _need(kind.name in LINEAR)
        begin, stride = section.start + numbers.position + 8, 8 * (1 + kind.nodes)
        rows = Rows(begin, f"{order}i8", kind.nodes, count, stride)
        numbers.skip("q", count * (1 + kind.nodes))
        found.append(_Block(kind.name, Part(rows), (dimension, entity)))
        elements += count
    _need(elements == declared)
    return found, section.start + numbers.position


def _with_tags(block: _Block, entities: Entities) -> _Block:
    """The block with the physical group, which has to be one, and the entity of its elements."""
    assert block.entity is not None
    groups = entities.physical.get(block.entity, [0])
    _need(len(groups) == 1)
    return block._replace(part=replace(block.part, tags=(groups[0], block.entity[1])))


# ---------------------------------------------------------------------------------- MSH 2


def _nodes_2(data: bytes, section: Section, order: str) -> tuple[Table, int]:
    """The coordinates, and where the section's body ends."""
    count, begin = read_count(data, section.start, section)
    stride = 4 + 3 * 8
    tags = Rows(begin, f"{order}i4", 1, count, stride)
    rows = Rows(begin + 4, f"{order}f8", 3, count, stride)
    return Table((Part(rows, (Counted(tags, (1,), 1),)),)), begin + stride * count


def _elements_2(data: bytes, section: Section, order: str) -> tuple[list[_Block], int]:
    """The elements in blocks, and where the section's body ends."""
    total, at = read_count(data, section.start, section)
    found: list[_Block] = []
    elements = 0
    while elements < total:
        _need(at + 12 <= len(data) and len(found) < _MOST)
        head = struct.unpack_from(f"{order}3i", data, at)
        code, count, tags = head
        kind = cell_type(code)
        _need(kind.name in LINEAR and min(count, tags) >= 0)
        width = 1 + tags + kind.nodes
        alike: tuple[Counted, ...] = ()
        if count == 1:  # so each element has a header
            stride = 4 * (3 + width)
            count, begin = total - elements, at + 12
            if _END_OF_ELEMENTS.match(data, at + stride * count) is None:  # they are not all of one type
                count = _alike(data, at, stride // 4, count, order)
            alike = (Counted(Rows(at, f"{order}i4", 3, count, stride), head),)
        else:
            stride, begin = 4 * width, at + 12
        rows = Rows(begin + 4 * (1 + tags), f"{order}i4", kind.nodes, count, stride)
        of_tags = [replace(rows, begin=begin + 4 * (1 + i), columns=1) if tags > i else 0 for i in range(2)]
        found.append(_Block(kind.name, Part(rows, alike, tuple(of_tags))))
        at = begin + stride * count if not alike else at + stride * count
        elements += count
        _need(at <= len(data))
    return found, at


def _alike(data: bytes, at: int, words: int, most: int, order: str) -> int:
    """The number of elements from ``at`` on that have a header each, like the first one's."""
    most = min(most, (len(data) - at) // (4 * words))
    _need(most > 0)
    table = np.frombuffer(data, f"{order}i4", words * most, at).reshape(most, words)
    return agreeing(table, [0, 1, 2])
