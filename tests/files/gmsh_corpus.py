"""Mesh files made by Gmsh itself, and Gmsh's own account of a mesh file.

Every model is written in MSH 2.2 and 4.1, ASCII and binary. Files are made on first use and kept for the
rest of the session; nothing is left on disk.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gmsh_session import gmsh_session

VARIANTS = {"22-ascii": (2.2, 0), "22-binary": (2.2, 1), "41-ascii": (4.1, 0), "41-binary": (4.1, 1)}


# ------------------------------------------------------------------------------------------------ models


def box(gmsh: Any, size: float = 0.6) -> None:
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    mesh_3d(gmsh, size)


def mesh_3d(gmsh: Any, size: float) -> None:
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(3)


def rectangle(gmsh: Any, size: float = 0.4) -> None:
    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(2)


def one_group_each(gmsh: Any) -> None:
    box(gmsh)
    gmsh.model.addPhysicalGroup(3, [1], 7, "solid")
    gmsh.model.addPhysicalGroup(2, [1, 2, 3], 3, "walls")
    gmsh.model.addPhysicalGroup(1, [5], 9)  # without a name
    gmsh.model.addPhysicalGroup(0, [2], 4, "a corner, with a comma")


def several_groups(gmsh: Any) -> None:
    one_group_each(gmsh)
    gmsh.model.addPhysicalGroup(3, [1], 8, "body")
    gmsh.model.addPhysicalGroup(2, [1, 4], 5, "inlet")
    gmsh.model.addPhysicalGroup(2, [1], 6, "probe")


def equal_names(gmsh: Any) -> None:
    box(gmsh)
    gmsh.model.addPhysicalGroup(3, [1], 1, "part")
    gmsh.model.addPhysicalGroup(2, [2], 1, "part")


def reversed_group(gmsh: Any) -> None:
    box(gmsh)
    gmsh.model.addPhysicalGroup(2, [-1, 2], 5, "wall")
    gmsh.model.addPhysicalGroup(2, [1], 6, "probe")
    gmsh.model.addPhysicalGroup(3, [1], 7, "solid")


def periodic_box(gmsh: Any) -> None:
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.setPeriodic(2, [2], [1], [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
    mesh_3d(gmsh, 0.6)


def periodic_rectangle(gmsh: Any) -> None:
    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.setPeriodic(1, [2], [4], [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
    gmsh.model.addPhysicalGroup(2, [1], 1, "sheet")  # the linked curves are not saved with the mesh
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
    gmsh.model.mesh.generate(2)


def partitioned(gmsh: Any) -> None:
    several_groups(gmsh)
    gmsh.option.setNumber("Mesh.PartitionCreateGhostCells", 1)
    gmsh.model.mesh.partition(3)


def partitioned_topology(gmsh: Any) -> None:
    rectangle(gmsh, 0.25)
    gmsh.option.setNumber("Mesh.PartitionCreateTopology", 1)
    gmsh.model.mesh.partition(2)


def save_all(gmsh: Any) -> None:
    several_groups(gmsh)
    gmsh.option.setNumber("Mesh.SaveAll", 1)


def sparse_tags(gmsh: Any) -> None:
    """Node tags neither dense nor ascending, element numbers with gaps."""
    gmsh.option.setNumber("Mesh.PreserveNumberingMsh2", 1)
    gmsh.model.addDiscreteEntity(2, 4)
    tags = [900, 70, 3, 12345678, 41, 8]
    xyz = [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0.5, 0.4, 0, 2, 0.5, 0]
    gmsh.model.mesh.addNodes(2, 4, tags, xyz)
    triangles = [900, 70, 41, 70, 3, 41, 3, 12345678, 41, 12345678, 900, 41, 70, 8, 3]
    gmsh.model.mesh.addElementsByType(4, 2, [5, 1000, 7, 2000000000, 12], triangles)


def coarse(gmsh: Any) -> None:
    """No node inside the curves and some surfaces: their blocks of nodes are empty."""
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    mesh_3d(gmsh, 5.0)


def with_data(gmsh: Any) -> None:
    """A scalar with two steps and a vector on nodes, a tensor on some elements, values at element nodes."""
    rectangle(gmsh)
    model = gmsh.model.getCurrent()
    tags = gmsh.model.mesh.getNodes()[0]
    triangles = gmsh.model.mesh.getElementsByType(2)[0]
    for name, kind, on, values in (
        ("height", "NodeData", tags, [[0.1 * tag] for tag in tags]),
        ("direction", "NodeData", tags[:-2], [[tag / 3, 1e-300, -0.0] for tag in tags[:-2]]),
        ("stress of it", "ElementData", triangles[3:], [[tag / 7] * 9 for tag in triangles[3:]]),
        ("ignored", "ElementNodeData", triangles, [[1.0, 2.0, 3.0]] * len(triangles)),
    ):
        view = gmsh.view.add(name)
        gmsh.view.addModelData(view, 0, model, kind, on, values, 0.0)
        if name == "height":
            gmsh.view.addModelData(view, 1, model, kind, on, [[2 * v[0]] for v in values], 1.5)


def quads(gmsh: Any) -> None:
    gmsh.option.setNumber("Mesh.RecombineAll", 1)
    rectangle(gmsh, 0.3)


def triangles_and_quads(gmsh: Any) -> None:
    """Surfaces of triangles and of quads in turn, each in groups of its own."""
    for i in range(4):
        gmsh.model.occ.addRectangle(i, 0, 0, 1, 1)
    gmsh.model.occ.fragment([(2, 1)], [(2, 2), (2, 3), (2, 4)])
    gmsh.model.occ.synchronize()
    for _, surface in gmsh.model.getEntities(2)[::2]:
        gmsh.model.mesh.setRecombine(2, surface)
    for _, surface in gmsh.model.getEntities(2):
        gmsh.model.addPhysicalGroup(2, [surface], 10 + surface, f"tile {surface}")
    gmsh.model.addPhysicalGroup(2, [1, 2], 30, "left half")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
    gmsh.model.mesh.generate(2)


def second_order(gmsh: Any) -> None:
    several_groups(gmsh)
    gmsh.model.mesh.setOrder(2)


def third_order(gmsh: Any) -> None:
    box(gmsh)
    gmsh.model.mesh.setOrder(3)


def bricks(gmsh: Any, order: int = 1) -> None:
    """Hexahedra, wedges and a layer of pyramids with tetrahedra."""
    base = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    other = gmsh.model.occ.addRectangle(1, 0, 0, 1, 1)
    gmsh.model.occ.fragment([(2, base)], [(2, other)])
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
    gmsh.model.mesh.setRecombine(2, base)
    gmsh.model.mesh.setTransfiniteSurface(base)
    gmsh.model.occ.extrude([(2, base), (2, other)], 0, 0, 1, numElements=[2], recombine=True)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(3)
    pyramid = gmsh.model.addDiscreteEntity(3)
    start = int(gmsh.model.mesh.getMaxNodeTag()) + 1
    corners = [0, 0, 5, 1, 0, 5, 1, 1, 5, 0, 1, 5, 0.5, 0.5, 6]
    gmsh.model.mesh.addNodes(3, pyramid, range(start, start + 5), corners)
    gmsh.model.mesh.addElementsByType(pyramid, 7, [], range(start, start + 5))
    if order > 1:
        gmsh.model.mesh.setOrder(order)


def full_second_order(gmsh: Any) -> None:
    bricks(gmsh, order=2)


def incomplete_second_order(gmsh: Any) -> None:
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    bricks(gmsh, order=2)


def parametric_box(gmsh: Any) -> None:
    gmsh.option.setNumber("Mesh.SaveParametric", 1)
    several_groups(gmsh)


def parametric_sphere(gmsh: Any) -> None:
    gmsh.option.setNumber("Mesh.SaveParametric", 1)
    gmsh.model.occ.addSphere(0, 0, 0, 1)
    gmsh.model.occ.synchronize()
    mesh_3d(gmsh, 0.9)


def embedded(gmsh: Any) -> None:
    """A plane sheet off the origin with a point and a curve embedded; vertex and line elements inside."""
    gmsh.model.occ.addRectangle(10, -3, 2.5, 1, 1)
    point = gmsh.model.occ.addPoint(10.3, -2.6, 2.5)
    ends = [gmsh.model.occ.addPoint(10.5, y, 2.5) for y in (-2.8, -2.3)]
    line = gmsh.model.occ.addLine(*ends)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.embed(0, [point], 2, 1)
    gmsh.model.mesh.embed(1, [line], 2, 1)
    gmsh.model.addPhysicalGroup(0, [point], 1, "sensor")
    gmsh.model.addPhysicalGroup(1, [line], 2, "crack")
    gmsh.model.addPhysicalGroup(2, [1], 3, "sheet")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
    gmsh.model.mesh.generate(2)


MODELS: dict[str, Callable[[Any], None]] = {
    model.__name__: model
    for model in (
        box,
        one_group_each,
        several_groups,
        equal_names,
        reversed_group,
        periodic_box,
        periodic_rectangle,
        partitioned,
        partitioned_topology,
        save_all,
        sparse_tags,
        coarse,
        with_data,
        quads,
        triangles_and_quads,
        second_order,
        third_order,
        bricks,
        full_second_order,
        incomplete_second_order,
        parametric_box,
        parametric_sphere,
        embedded,
    )
}
NAMES = [f"{model}-{variant}" for model in MODELS for variant in VARIANTS]


def corpus(name: str) -> bytes:
    """The bytes of one file of the corpus, by a name of NAMES."""
    model, _, variant = name.partition("-")
    return _variants(model)[variant]


@cache
def _variants(model: str) -> dict[str, bytes]:
    files = {}
    with gmsh_session() as gmsh, tempfile.TemporaryDirectory() as folder:
        gmsh.model.add("model")
        MODELS[model](gmsh)
        for variant, (version, binary) in VARIANTS.items():
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.option.setNumber("PostProcessing.SaveMesh", 0)
            path = Path(folder, f"{variant}.msh")
            gmsh.write(str(path))
            for view in gmsh.view.getTags():
                gmsh.view.write(view, str(path), append=True)
            files[variant] = path.read_bytes()
    return files


# ------------------------------------------------------------------------------- what Gmsh says of a file


@dataclass
class Account:
    """What Gmsh makes of a mesh file, but for elements between partitions, which are none of the model's.

    nodes: tag -> coordinates. elements: (type, number) -> node tags. entities: (dimension, tag) -> kind.
    parents: (dimension, tag) of a part of an entity in one partition -> tag of that entity.
    groups: (dimension, tag) -> name and entities. elements_of: entity -> the (type, number) of its elements.
    periodic: pairs of node tags, slave and master. views: (name, step) -> tag -> values.
    complaints: its warnings; Gmsh has some about files of its own.
    """

    nodes: dict[int, tuple[float, ...]] = field(default_factory=dict)
    elements: dict[tuple[int, int], tuple[int, ...]] = field(default_factory=dict)
    entities: dict[tuple[int, int], str] = field(default_factory=dict)
    parents: dict[tuple[int, int], int] = field(default_factory=dict)
    groups: dict[tuple[int, int], tuple[str, list[int]]] = field(default_factory=dict)
    elements_of: dict[tuple[int, int], list[tuple[int, int]]] = field(default_factory=dict)
    periodic: set[tuple[int, int]] = field(default_factory=set)
    views: dict[tuple[str, int], dict[int, tuple[float, ...]]] = field(default_factory=dict)
    complaints: list[str] = field(default_factory=list)

    def members(self, dimension: int, tag: int) -> set[tuple[int, ...]]:
        """The elements of a physical group, each as its type and sorted node tags."""
        entities = self.groups[dimension, tag][1]
        keys = [key for entity in entities for key in self.elements_of[dimension, entity]]
        return {(key[0], *sorted(self.elements[key])) for key in keys}


def account(data: bytes) -> Account:
    """Let Gmsh open a mesh file; raises if it cannot."""
    found = Account()
    as_in_the_file = {"Mesh_PartitionCreateTopology": 0}  # else Gmsh adds elements between the parts of MSH 2
    with gmsh_session(**as_in_the_file) as gmsh, tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "mesh.msh")
        path.write_bytes(data)
        gmsh.logger.start()
        gmsh.open(str(path))
        found.complaints = [line for line in gmsh.logger.get() if line.startswith(("Warning", "Error"))]
        gmsh.logger.stop()
        tags, xyz, _ = gmsh.model.mesh.getNodes()
        found.nodes = dict(zip(tags.tolist(), map(tuple, xyz.reshape(-1, 3).tolist()), strict=True))
        found.entities = {entity: gmsh.model.getType(*entity) for entity in gmsh.model.getEntities()}
        for entity in found.entities:
            found.elements_of[entity] = []
            dimension, parent = gmsh.model.getParent(*entity)
            if dimension > entity[0]:
                continue
            if dimension == entity[0]:
                found.parents[entity] = parent
            for code, numbers, nodes in zip(*gmsh.model.mesh.getElements(*entity), strict=True):
                rows = map(tuple, nodes.reshape(len(numbers), -1).tolist())
                keys = [(int(code), number) for number in numbers.tolist()]
                found.elements.update(zip(keys, rows, strict=True))
                found.elements_of[entity] += keys
            found.elements_of[entity].sort()  # Gmsh gives ghosts in no fixed order
            _, slaves, masters, _ = gmsh.model.mesh.getPeriodicNodes(*entity)
            found.periodic |= set(zip(slaves.tolist(), masters.tolist(), strict=True))
        for group in gmsh.model.getPhysicalGroups():
            entities = [abs(tag) for tag in gmsh.model.getEntitiesForPhysicalGroup(*group).tolist()]
            found.groups[group] = (gmsh.model.getPhysicalName(*group), entities)
        for view in gmsh.view.getTags():
            name = gmsh.view.option.getString(view, "Name")
            for step in range(int(gmsh.view.option.getNumber(view, "NbTimeStep"))):
                kind, tags, values, _, _ = gmsh.view.getModelData(view, step)
                if kind != "ElementNodeData":
                    rows = map(tuple, np.array(values).tolist())
                    found.views[name, step] = dict(zip(tags.tolist(), rows, strict=True))
    return found
