"""The grids of an XDMF file: those that share one Geometry are one mesh, others are refused by name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import shown
from dvr_cli.files.xdmf.references import follow_references
from dvr_cli.files.xml_places import Element, parse

_POINTS = {"xyz": 3, "xy": 2, "x_y_z": 3, "x_y": 2}


@dataclass
class Grids:
    """The parts that make up the mesh.

    geometries: the Geometry elements, all with the same text; dimension: of the points.
    grids: those that hold cells of their own: name, Topology and Attributes.
    steps: how many grids are steps of a series in time.
    """

    geometries: list[Element] = field(default_factory=list)
    dimension: int = 3
    grids: list[tuple[str, Element, list[Element]]] = field(default_factory=list)
    steps: int = 0

    @property
    def apart(self) -> bool:
        """True if each coordinate has an array of its own."""
        return len(self.geometries[0].named("DataItem")) > 1


def grids_of(data: bytes) -> Grids:
    """The grids of a file; raises InputError where they are not one mesh."""
    root = parse(data, entities=True)
    if root.name != "Xdmf":
        raise InputError(f"not an XDMF file: it begins with {shown(root.name)}")
    follow_references(data, root)
    result = Grids()
    topologies: dict[bytes, list[Element]] = {}
    for grid, in_time in _leaves(root):
        _add(data, grid, in_time, result, topologies)
    if not result.geometries or not result.grids:
        raise InputError("there is no Grid with a Geometry and a Topology of its own")
    return result


def _leaves(root: Element) -> Iterator[tuple[Element, bool]]:
    """The grids that hold no others, in the order of the file, and whether they are steps in time."""
    waiting = [(grid, False) for domain in root.named("Domain") for grid in domain.named("Grid")][::-1]
    while waiting:
        grid, in_time = waiting.pop()
        kind = grid.attributes.get("GridType", "Uniform").lower()
        if kind in ("collection", "tree"):
            in_time = in_time or grid.attributes.get("CollectionType", "").lower() == "temporal"
            waiting.extend((child, in_time) for child in reversed(grid.named("Grid")))
        elif kind != "uniform" or "Reference" in grid.attributes or grid.named("Grid"):
            raise InputError(f"the Grid {_name(grid)} of the kind {shown(kind)} is not supported")
        else:
            yield grid, in_time


def _add(
    data: bytes, grid: Element, in_time: bool, result: Grids, topologies: dict[bytes, list[Element]]
) -> None:
    """Take a grid into the result; topologies: by their bytes, the Attributes of the grid that has each."""
    included = " ".join(child.attributes.get("xpointer", "") for child in grid.named("include", "xi:include"))
    geometries, found = grid.named("Geometry"), grid.named("Topology")
    if any("Reference" in element.attributes for element in geometries + found):
        raise InputError(f"the Grid {_name(grid)} refers to parts of another; that is not supported")
    if len(geometries) + ("Geometry" in included) != 1:
        raise InputError(f"the Grid {_name(grid)} has {len(geometries)} geometries, where one is needed")
    for geometry in geometries:
        _check(grid, geometry)
        if result.geometries and _inner(data, geometry) != _inner(data, result.geometries[0]):
            raise InputError(
                f"the Grid {_name(grid)} has points of its own; only grids that share one Geometry "
                "are one mesh"
            )
        result.geometries.append(geometry)
        result.dimension = _POINTS[_kind(geometry)]
    attributes = grid.named("Attribute")
    result.steps += in_time
    for topology in found:
        known = topologies.get(_inner(data, topology))
        if known is None:
            topologies[_inner(data, topology)] = known = []
            result.grids.append((grid.attributes.get("Name", ""), topology, known))
        known.extend([] if in_time else attributes)
    if not found and result.grids and not in_time:
        result.grids[0][2].extend(attributes)  # of the mesh whose Topology it includes


def _check(grid: Element, geometry: Element) -> None:
    if _kind(geometry) not in _POINTS:
        raise InputError(
            f"the points of the Grid {_name(grid)} are implied ({shown(_kind(geometry))}); "
            "that is not supported"
        )
    wanted = _POINTS[_kind(geometry)] if "_" in _kind(geometry) else 1
    if len(geometry.named("DataItem")) != wanted:
        raise InputError(f"the Geometry of the Grid {_name(grid)} should have {wanted} DataItems")


def _kind(geometry: Element) -> str:
    return geometry.attributes.get("GeometryType", geometry.attributes.get("Type", "XYZ")).lower()


def _inner(data: bytes, element: Element) -> bytes:
    """The contents of an element, with its type: equal for elements that refer to the same arrays."""
    kind = repr(sorted(element.attributes.items())).encode()
    return b" ".join([kind, *data[element.inside : element.end_tag].split()])


def _name(grid: Element) -> str:
    return shown(grid.attributes.get("Name", ""))
