"""The unstructured zones of a base: vertices, cells, boundary conditions and what ties zones together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files import hdf5
from dvr_cli.files.cgns.nodes import DATA, Node, children, integers_of, refuse_rind, text_below, text_of
from dvr_cli.files.cgns.sections import Section, read_sections
from dvr_cli.files.container import CoordinateArray


@dataclass(frozen=True, eq=False)
class NamedSet:
    """A boundary condition, or a zone that belongs to a family.

    names: its own and those of its families. on_vertices: whether members are vertices or elements of the
    zone. members: their numbers from 1.
    """

    names: list[str]
    on_vertices: bool
    members: np.ndarray


@dataclass
class Zone:
    """A zone.

    first: how many vertices the zones before it have. connected: the vertices, from 0, that connect it to
    others or to itself.
    """

    name: str
    first: int
    points: np.ndarray
    arrays: list[CoordinateArray]
    sections: list[Section]
    sets: list[NamedSet] = field(default_factory=list)
    connected: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))


def is_unstructured(zone: Node) -> bool:
    """True if a zone is unstructured; one that does not say is structured."""
    return text_below(zone, "ZoneType_t") == "Unstructured"


def read_zone(zone: Node, first: int, dimension: int) -> Zone:
    """Read an unstructured zone with points of 2 or 3 coordinates; first: how many vertices came before."""
    count = int(integers_of(zone, 3)[0])
    points, arrays = _coordinates(zone, count, first, dimension)
    result = Zone(zone.name.rsplit("/", 1)[-1], first, points, arrays, read_sections(zone, count))
    families = _families(zone)
    if families:
        numbers = [section.numbers for section in result.sections]
        result.sets.append(NamedSet(families, False, np.concatenate(numbers or [np.empty(0, np.int64)])))
    for boundary in children(zone, "ZoneBC_t").values():
        for name, condition in children(boundary, "BC_t").items():
            on_vertices, members = _members(condition, result)
            result.sets.append(NamedSet([name, *_families(condition)], on_vertices, members))
    result.connected = np.unique(np.concatenate([np.empty(0, np.int64), *_connections(zone, result)]))
    return result


def _coordinates(
    zone: Node, count: int, first: int, dimension: int
) -> tuple[np.ndarray, list[CoordinateArray]]:
    grids = list(children(zone, "GridCoordinates_t").values())
    if len(grids) != 1 or count < 1:
        raise InputError(
            f"{zone.name} has {len(grids)} sets of coordinates for {count} vertices; one set is possible"
        )
    refuse_rind(grids[0])
    stored = children(grids[0], "DataArray_t")
    points = np.empty((count, dimension))
    arrays = []
    for axis, letter in enumerate("XYZ"[:dimension]):
        name = f"Coordinate{letter}"
        if name not in stored:
            listed = ", ".join(stored) or "none"
            raise InputError(f"{grids[0].name} has no {name}; Cartesian ones are needed, there are: {listed}")
        dataset = stored[name].data
        values = np.empty(0) if dataset is None else hdf5.values(dataset)
        if values.shape != (count,) or values.dtype.kind != "f":
            raise InputError(f"{stored[name].name} does not hold a number for each of {count} vertices")
        points[:, axis] = values
        rows = slice(first, first + count)
        path = f"{stored[name].name}/{DATA}"
        arrays.append(CoordinateArray(path, rows, (axis,), values.shape, values.dtype))
    return points, arrays


def _families(node: Node) -> list[str]:
    """The names of the families that a zone or a boundary condition belongs to."""
    named = children(node, "FamilyName_t", "AdditionalFamilyName_t").values()
    return [name for name in map(text_of, named) if name]


def _members(node: Node, zone: Zone) -> tuple[bool, np.ndarray]:
    """Numbers from 1 that a node lists, after True if they are of vertices, False if of elements."""
    lists = children(node, "IndexArray_t", "IndexRange_t")
    at_vertices = text_below(node, "GridLocation_t") in ("", "Vertex")
    last_element = max((int(section.numbers[-1]) for section in zone.sections), default=0)
    for name in ("PointList", "PointRange", "ElementList", "ElementRange"):
        if name not in lists:
            continue
        on_vertices = at_vertices and name.startswith("Point")
        most = len(zone.points) if on_vertices else last_element
        if name.endswith("List"):
            numbers = integers_of(lists[name])
            if len(numbers) and not 1 <= numbers.min() <= numbers.max() <= most:
                raise InputError(f"{node.name} names more than there are: {most}")
            return on_vertices, numbers
        first, last = integers_of(lists[name], 2)[:2].tolist()
        if not 1 <= first <= last <= most:
            raise InputError(f"{node.name} names {first} to {last}, but there are {most}")
        return on_vertices, np.arange(first, last + 1)
    return True, np.empty(0, dtype=np.int64)


def _connections(zone: Node, result: Zone) -> Iterator[np.ndarray]:
    """The vertices of the zone that connect it to others, or to itself, from 0."""
    for node in children(zone, "ZoneGridConnectivity_t").values():
        for connection in children(node, "GridConnectivity_t", "GridConnectivity1to1_t").values():
            on_vertices, members = _members(connection, result)
            if on_vertices:
                yield members - 1
                continue
            for section in result.sections:
                yield section.vertices[np.isin(section.numbers, members)].ravel()
