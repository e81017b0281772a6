"""The sections of a zone: lists of elements, of one type or mixed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.cgns.elements import MIXED, NODE_ORDER, cell_type
from dvr_cli.files.cgns.nodes import Node, children, integers_of, refuse_rind
from dvr_cli.mesh.cell_types import CELL_TYPES


@dataclass(frozen=True, eq=False)
class Section:
    """Cells of one type in a section.

    name: of the section. type: meshio's. vertices: (n, k) the zone's vertices, from 0, in meshio's order.
    numbers: (n,) of the elements in the zone, ascending.
    """

    name: str
    type: str
    vertices: np.ndarray
    numbers: np.ndarray


def read_sections(zone: Node, n_points: int) -> list[Section]:
    """The sections of a zone in the order of their elements, mixed ones taken apart by type."""
    found: list[Section] = []
    for name, node in children(zone, "Elements_t").items():
        kind = int(integers_of(node, 2)[0])
        bounds = children(node, "IndexRange_t").get("ElementRange")
        lists = children(node, "DataArray_t")
        if bounds is None or "ElementConnectivity" not in lists:
            raise InputError(f"{node.name} has no elements")
        first, last = integers_of(bounds, 2)[:2].tolist()
        refuse_rind(node)
        if kind != MIXED:
            cell_type(kind)  # says which it is
        entries = integers_of(lists["ElementConnectivity"])
        count = last - first + 1
        if not 0 <= count <= len(entries):
            raise InputError(f"{node.name} should hold {count} elements, which it does not")
        if count == 0:
            continue
        if kind == MIXED:
            offsets = lists.get("ElementStartOffset")
            starts = (
                _chained(entries, count, node.name)
                if offsets is None
                else _checked(integers_of(offsets), entries, count, node.name)
            )
            found += _taken_apart(name, entries, starts, first)
        else:
            nodes = CELL_TYPES[cell_type(kind)].nodes
            if len(entries) != count * nodes:
                raise InputError(f"{node.name} does not hold {nodes} nodes for each of {count} elements")
            numbers = np.arange(first, last + 1)
            found.append(_section(name, kind, entries.reshape(count, nodes), numbers))
    for section in found:
        if section.vertices.min() < 0 or section.vertices.max() >= n_points:
            outside = section.vertices[(section.vertices < 0) | (section.vertices >= n_points)][0] + 1
            raise InputError(
                f"{zone.name}/{section.name} names vertex {outside}, but there are {n_points}, counted from 1"
            )
    return sorted(found, key=lambda section: int(section.numbers[0]))


def _section(name: str, kind: int, nodes: np.ndarray, numbers: np.ndarray) -> Section:
    """A section of one type; nodes: those of each element in CGNS's order, from 1."""
    named = cell_type(kind)
    order = NODE_ORDER.get(named)
    return Section(name, named, (nodes if order is None else nodes[:, list(order)]) - 1, numbers)


def _taken_apart(name: str, entries: np.ndarray, starts: np.ndarray, first: int) -> list[Section]:
    """The elements of a mixed section by type; starts: where the entry with the type of each is."""
    kinds = entries[starts]
    sections = []
    for kind in np.unique(kinds).tolist():
        chosen = np.flatnonzero(kinds == kind)
        nodes = entries[starts[chosen, None] + 1 + np.arange(CELL_TYPES[cell_type(kind)].nodes)]
        sections.append(_section(name, kind, nodes, first + chosen))
    return sections


def _chained(entries: np.ndarray, count: int, name: str) -> np.ndarray:
    """The start of each element, in files before version 4: the end of the one before."""
    listed, starts, at = entries.tolist(), [], 0
    sizes: dict[int, int] = {}
    for _ in range(count):
        if at >= len(listed):
            raise InputError(f"{name} ends before its {count} elements do")
        starts.append(at)
        kind = listed[at]
        if kind not in sizes:
            sizes[kind] = 1 + CELL_TYPES[cell_type(kind)].nodes
        at += sizes[kind]
    if at != len(listed):
        raise InputError(f"the nodes of {name} do not add up to those of its {count} elements")
    return np.array(starts)


def _checked(offsets: np.ndarray, entries: np.ndarray, count: int, name: str) -> np.ndarray:
    """The start of each element, as the file says."""
    if len(offsets) != count + 1 or offsets[0] != 0 or offsets[-1] != len(entries):
        raise InputError(f"the offsets of {name} do not fit its {count} elements")
    sizes = np.diff(offsets)
    inside = (offsets[:-1] >= 0) & (offsets[:-1] < len(entries))
    kinds = entries[offsets[:-1][inside]]
    right = {int(kind): 1 + CELL_TYPES[cell_type(int(kind))].nodes for kind in np.unique(kinds)}
    if not inside.all() or any((sizes[kinds == kind] != size).any() for kind, size in right.items()):
        raise InputError(f"the offsets of {name} do not fit the types of its elements")
    return offsets[:-1]
