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
from dvr_cli.files.gmsh.data import ViewHead, read_physical_names, read_view_head
from dvr_cli.files.gmsh.elements import MAX_BLOCKS
from dvr_cli.files.gmsh.mesh import field_data, tags_of_entities
from dvr_cli.files.gmsh.msh2 import agreeing
from dvr_cli.files.gmsh.msh2 import read_periodic as read_periodic_2
from dvr_cli.files.gmsh.msh4 import Entities, read_entities
from dvr_cli.files.gmsh.msh4 import read_periodic as read_periodic_4
from dvr_cli.files.gmsh.numbers import BinaryNumbers, read_numbers
from dvr_cli.files.gmsh.sections import (
    VIEWS,
    Header,
    Section,
    Sections,
    next_section,
    opening_of,
    read_count,
    read_header,
)
from dvr_cli.files.ranges import LINEAR, Counted, Field, Part, Ranges, Rows, Table
from dvr_cli.mesh.regions import is_region_name

_TAGS = ("gmsh:physical", "gmsh:geometrical")
_ENTITIES = ("Entities", "PartitionedEntities")
_NEEDED = ("MeshFormat", "PhysicalNames", *_ENTITIES, "Nodes", "Elements", "Periodic")
_OTHER = ("ParametricNodes", "NOD", "ELM")  # what a run depends on
_MOST = 10_000  # parts of a table
_END_OF_ELEMENTS = re.compile(rb"\s*\$EndElements")
_VERSIONS_2 = ("2", "2.0", "2.1", "2.2")


class _Other(Exception):
    """A file that a process has to read whole."""


class _Nodes(NamedTuple):
    """The nodes of a file, and where the section's body ends."""

    points: Table
    tags: Table
    end: int


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
    except (InputError, OverflowError, _Other):  # whoever reads the file whole will say why
        return None


def _found(data: bytes) -> Ranges:
    once: dict[str, Section] = {}
    header, at = Header("", ""), 0
    nodes, blocks, views = _Nodes(Table(()), Table(()), 0), list[_Block](), list[ViewHead]()
    while (section := opening_of(data, at)) is not None:
        name = section.name
        _need(name not in _OTHER and not (name in _NEEDED and name in once))
        if name in ("Nodes", "Elements"):
            _need(header.byte_order != "" and (header.version == "4.1" or header.version in _VERSIONS_2))
            older = header.version != "4.1"
            if name == "Nodes":
                nodes = (_nodes_2 if older else _nodes_4)(data, section, header.byte_order)
                at = nodes.end
            else:
                blocks, at = (_elements_2 if older else _elements_4)(data, section, header.byte_order)
            section = section._replace(end=_end(data, at, name))
        elif name in VIEWS:
            view = read_view_head(data, section)
            _need(header.byte_order != "" and min(view.components, view.rows) >= 0)
            # what elements have could tell regions apart
            _need(name == "NodeData" or not is_region_name(view.name))
            if name == "NodeData" and view.is_field:
                views.append(view)
            at = view.at + view.rows * (4 + 8 * view.components)
            section = section._replace(end=_end(data, at, name))
        else:
            section = next_section(data, at)
        if name in _NEEDED:
            once[name] = section
        if name == "MeshFormat":
            header = read_header(data, Sections(once, [], []))
        at = section.end
    named = read_physical_names(data, once["PhysicalNames"]) if "PhysicalNames" in once else []
    names: tuple[str, ...] = _TAGS
    if header.version == "4.1":
        entities = Entities({}, {}, set())
        for name in _ENTITIES:
            if name in once:
                numbers = read_numbers(data, once[name], header)
                read_entities(numbers, name == "PartitionedEntities", entities, older=False)
        blocks = [one for one in blocks if one.part.rows.count and one.entity not in entities.between]
        blocks, names = _with_tags(blocks, entities)
    tables = _tables(blocks)
    _need(nodes.points.count > 0 and len(tables) > 0)
    found = Ranges(nodes.points, tables, base=1, numbers=nodes.tags, names=names)
    fields = _fields(views, header.byte_order)
    found = replace(found, once=header.version != "4.1", groups=field_data(named), fields=fields)
    if "Periodic" not in once:
        return found
    return replace(found, linked=_linked(data, once["Periodic"], header))


def _fields(views: list[ViewHead], order: str) -> dict[str, Field]:
    """The fields of views on nodes; of those of one name all of the last step count."""
    last: dict[str, list[ViewHead]] = {}
    for view in views:
        of_name = last.setdefault(view.name, [])
        if of_name and (view.step, view.components) != (of_name[-1].step, of_name[-1].components):
            of_name.clear()
        of_name.append(view)
    fields = {}
    for name, of_name in last.items():
        _need(len(of_name) <= _MOST)
        rows, tags = [], []
        for view in of_name:
            stride = 4 + 8 * view.components
            tags.append(Part(Rows(view.at, f"{order}i4", 1, view.rows, stride)))
            rows.append(Part(Rows(view.at + 4, f"{order}f8", view.components, view.rows, stride)))
        fields[name] = Field(Table(tuple(rows)), Table(tuple(tags)))
    return fields


def _linked(data: bytes, section: Section, header: Header) -> np.ndarray:
    """(k, 2) the tags of nodes that periodic links tie together, some of which may not be there."""
    older = header.version != "4.1"
    pairs = read_periodic_2(data, section) if older else read_periodic_4(read_numbers(data, section, header))
    return pairs.astype(np.int64)


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


def _nodes_4(data: bytes, section: Section, order: str) -> _Nodes:
    numbers = BinaryNumbers(data, section, order)
    blocks, declared = numbers.record("4q")[:2]
    parts, labels, nodes = [], [], 0
    _need(blocks <= _MOST)
    for _ in range(blocks):
        flag = section.start + numbers.position + 8
        dimension, _, parametric, count = numbers.record("3iq")
        _need(0 <= dimension <= 3 and parametric in (0, 1))
        more = dimension * parametric
        tags = Rows(section.start + numbers.position, f"{order}i8", 1, count)
        numbers.skip("q", count)
        rows = Rows(section.start + numbers.position, f"{order}f8", 3, count, 8 * (3 + more) if more else 0)
        numbers.skip("d", (3 + more) * count)
        parts.append(Part(rows, flag=flag if more else None))
        labels.append(Part(tags))
        nodes += count
    _need(nodes == declared)
    return _Nodes(Table(tuple(parts)), Table(tuple(labels)), section.start + numbers.position)


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


def _with_tags(blocks: list[_Block], entities: Entities) -> tuple[list[_Block], tuple[str, ...]]:
    """The blocks with the groups and the entity of their elements as tags, and the names of these."""
    of_blocks = [block.entity or (0, 0) for block in blocks]
    groups = [entities.physical.get(one, [0]) for one in of_blocks]
    names, tags = tags_of_entities([(one[0], entities.whole.get(one, one[1])) for one in of_blocks], groups)
    rows = zip(blocks, tags, strict=True)
    return [b._replace(part=replace(b.part, tags=tuple(row))) for b, row in rows], names


# ---------------------------------------------------------------------------------- MSH 2


def _nodes_2(data: bytes, section: Section, order: str) -> _Nodes:
    count, begin = read_count(data, section.start, section)
    stride = 4 + 3 * 8
    tags = Rows(begin, f"{order}i4", 1, count, stride)
    rows = Rows(begin + 4, f"{order}f8", 3, count, stride)
    return _Nodes(Table((Part(rows),)), Table((Part(tags),)), begin + stride * count)


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
