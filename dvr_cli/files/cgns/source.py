"""A CGNS file as a mesh: the unstructured zones of a base, its families and boundary conditions."""

from __future__ import annotations

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files import hdf5
from dvr_cli.files.cgns.nodes import Node, children, integers_of
from dvr_cli.files.cgns.zones import Zone, is_unstructured, read_zone
from dvr_cli.files.container import ContainerSource
from dvr_cli.files.losses import number_not_kept
from dvr_cli.mesh.groups import topological_dimension
from dvr_cli.mesh.mesh import Cells, Mesh

_ADF = b"ADF Database"  # near the beginning of files of the older kind
# labels of what is not in the mesh: what each of them is
_BEYOND = {
    "BC_t": "boundary condition",
    "GridConnectivity_t": "connection of zones",
    "GridConnectivity1to1_t": "connection of zones",
    "FlowSolution_t": "flow solution",
    "DiscreteData_t": "set of discrete data",
    "ReferenceState_t": "reference state",
    "FlowEquationSet_t": "set of flow equations",
    "ConvergenceHistory_t": "convergence history",
    "BaseIterativeData_t": "set of iterative data",
    "ZoneIterativeData_t": "set of iterative data",
    "IntegralData_t": "set of integral data",
    "UserDefinedData_t": "set of user's data",
    "Descriptor_t": "descriptor",
}


class CgnsSource(ContainerSource):
    """A CGNS file."""

    format = "cgns"


def read(data: bytes) -> CgnsSource:
    """Read a CGNS file with unstructured zones in one base.

    Zones make one mesh, numbered in the cell data "cgns:zone"; vertices that connect them, or lie at the same
    place in two, are linked. Boundary conditions and families are cell sets or point sets, and the cell data
    "cgns:family" tells apart what they tell apart. Sections of lower dimension are cell sets, too.

    Raises InputError for damage and for what is not supported, by name.
    """
    if _ADF in data[:64]:
        raise InputError("it is an ADF file; adf2hdf makes an HDF5 file of it, which can be read")
    with hdf5.opened(data) as file:
        base = _chosen(children(Node(file), "CGNSBase_t"))
        cell_dimension, dimension = integers_of(base, 2)[:2].tolist()
        if dimension not in (2, 3):
            raise InputError(f"{base.name} has {dimension} coordinates; 2 or 3 are possible")
        zones: list[Zone] = []
        first = 0
        for group in children(base, "Zone_t").values():
            if not is_unstructured(group):
                raise InputError(f"{group.name} is a structured zone, which is not supported")
            zones.append(read_zone(group, first, dimension))
            first += len(zones[-1].points)
        mesh = _joined(zones)
        if not mesh.cells:
            raise InputError(f"{base.name} has no elements")
        _add_sets(mesh, zones, _aliases(base))
        _add_sections(mesh, zones, cell_dimension)
        mesh.cell_data["cgns:family"] = _told_apart(mesh)
        return CgnsSource(data, mesh, [array for zone in zones for array in zone.arrays], _beyond_mesh(base))


def _chosen(bases: dict[str, Node]) -> Node:
    """The only base that has zones which can be read."""
    with_zones = [base for base in bases.values() if children(base, "Zone_t")]
    readable = [base for base in with_zones if any(map(is_unstructured, children(base, "Zone_t").values()))]
    if len(readable) > 1:
        raise InputError(f"it has several bases with unstructured zones: {', '.join(bases)}")
    if readable:
        return readable[0]
    if with_zones:
        raise InputError("all its zones are structured, which is not supported")
    raise InputError("it has no CGNS base with a zone")


def _joined(zones: list[Zone]) -> Mesh:
    points = np.concatenate([zone.points for zone in zones])
    cells, tags = [], []
    for number, zone in enumerate(zones, 1):
        for section in zone.sections:
            cells.append(Cells(section.type, section.vertices + zone.first))
            tags.append(np.full(len(section.vertices), number))
    mesh = Mesh(points, cells, {"cgns:zone": tags})
    connected = np.concatenate([zone.connected + zone.first for zone in zones])
    links = [np.stack([connected, connected], axis=1)]
    if len(zones) > 1:
        links.append(_coincident(points, np.repeat(np.arange(len(zones)), [len(z.points) for z in zones])))
    mesh.periodic = np.concatenate(links)
    return mesh


def _coincident(points: np.ndarray, zone: np.ndarray) -> np.ndarray:
    """(K, 2) pairs of points at the same place in different zones."""
    order = np.lexsort((*points.T, zone))
    order = order[np.lexsort(points[order].T)]  # by place, where that is the same by zone
    same = (points[order[1:]] == points[order[:-1]]).all(axis=1) & (zone[order[1:]] != zone[order[:-1]])
    return np.stack([order[1:][same], order[:-1][same]], axis=1)


def _aliases(base: Node) -> dict[str, list[str]]:
    """Other names of each family of the base, as Gmsh gives them for physical groups."""
    return {
        name: list(children(family, "FamilyName_t")) for name, family in children(base, "Family_t").items()
    }


def _add_sets(mesh: Mesh, zones: list[Zone], aliases: dict[str, list[str]]) -> None:
    """Put boundary conditions and families among the sets of the mesh; equal names are one set."""
    vertices: dict[str, list[np.ndarray]] = {}
    block = 0
    for zone in zones:
        own = range(block, block + len(zone.sections))
        block = own.stop
        for named in zone.sets:
            names = dict.fromkeys(alias for name in named.names for alias in (name, *aliases.get(name, ())))
            if named.on_vertices:
                for name in names:
                    vertices.setdefault(name, []).append(named.members - 1 + zone.first)
                continue
            inside = [np.flatnonzero(np.isin(section.numbers, named.members)) for section in zone.sections]
            for name in names:
                lists = mesh.cell_sets.setdefault(name, [np.empty(0, np.int64) for _ in mesh.cells])
                for b, found in zip(own, inside, strict=True):
                    lists[b] = np.union1d(lists[b], found)
    mesh.point_sets = {name: np.unique(np.concatenate(lists)) for name, lists in vertices.items()}


def _add_sections(mesh: Mesh, zones: list[Zone], dimension: int) -> None:
    """Put sections of lower dimension than the base's cells among the sets, if in no set so far."""
    in_sets = [np.unique(np.concatenate(lists)) for lists in zip(*mesh.cell_sets.values(), strict=True)]
    sections = [(zone.name, section) for zone in zones for section in zone.sections]
    for b, (zone_name, section) in enumerate(sections):
        lower = (topological_dimension(section.type) or 0) < dimension
        if lower and not (in_sets and len(in_sets[b]) == len(section.vertices)):
            name = section.name if len(zones) == 1 else f"{zone_name}/{section.name}"
            lists = mesh.cell_sets.setdefault(name, [np.empty(0, np.int64) for _ in mesh.cells])
            lists[b] = np.arange(len(section.vertices))


def _told_apart(mesh: Mesh) -> list[np.ndarray]:
    """A number for each cell, equal for those in the same sets."""
    sizes = [len(block.vertices) for block in mesh.cells]
    number = np.zeros(sum(sizes), dtype=np.int64)
    first = np.cumsum([0, *sizes[:-1]])
    new = 1
    for lists in mesh.cell_sets.values():
        inside = np.concatenate([found + start for found, start in zip(lists, first, strict=True)])
        old, place = np.unique(number[inside], return_inverse=True)
        number[inside] = new + place
        new += len(old)
    return np.split(number, first[1:])


def _beyond_mesh(base: Node) -> list[str]:
    """One line for each kind of thing in the base that is not in the mesh."""
    counts: dict[str, int] = {}
    zones = list(children(base, "Zone_t").values())
    lists = [part for zone in zones for part in children(zone, "ZoneBC_t", "ZoneGridConnectivity_t").values()]
    for node in (base, *zones, *lists):
        for child in children(node, *_BEYOND).values():
            what = _BEYOND[child.label]
            counts[what] = counts.get(what, 0) + 1
    return [line for what, count in counts.items() for line in number_not_kept(count, what)]
