"""Parts with flat faces, made by Gmsh: two materials, holes, cracks, split faces, planar and solid."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

from dvr_cli.files import gmsh as reader
from dvr_cli.mesh.mesh import Mesh
from gmsh_session import gmsh_session


def _cube(model):
    model.occ.addBox(0, 0, 0, 1, 1, 1)
    model.occ.synchronize()


def _l_shape(model):
    one = model.occ.addBox(0, 0, 0, 2, 1, 1)
    model.occ.cut([(3, one)], [(3, model.occ.addBox(1, 0.5, 0, 1, 1, 1))])
    model.occ.synchronize()
    model.addPhysicalGroup(3, [1], 1, "solid")


def _two_materials(model):
    boxes = [(3, model.occ.addBox(0, 0, 0, 1, 1, 1)), (3, model.occ.addBox(1, 0, 0, 0.7, 0.6, 1))]
    model.occ.fragment(boxes[:1], boxes[1:])
    model.occ.synchronize()
    model.addPhysicalGroup(3, [1], 5, "steel")
    model.addPhysicalGroup(3, [2], 4, "rubber")


def _inclusion_and_hole(model):
    block = [(3, model.occ.addBox(0, 0, 0, 1.5, 1, 1))]
    block, _ = model.occ.cut(block, [(3, model.occ.addBox(0.9, 0.3, -1, 0.3, 0.3, 3))])
    block, _ = model.occ.cut(block, [(3, model.occ.addCylinder(1.3, 0.8, -1, 0, 0, 3, 0.1))])
    model.occ.fragment(block, [(3, model.occ.addBox(0.2, 0.25, 0.3, 0.45, 0.4, 0.5))])
    model.occ.synchronize()
    for number, (_, tag) in enumerate(model.getEntities(3)):
        model.addPhysicalGroup(3, [tag], 2 - number)


def _split_face(model):
    """Physical surfaces and a physical curve that lie within flat faces."""
    block = model.occ.addBox(0, 0, 0, 1, 1, 1)
    patch = model.occ.addRectangle(0.3, 0.2, 1, 0.4, 0.5)
    strip = model.occ.addLine(model.occ.addPoint(0, 0.5, 0), model.occ.addPoint(1, 0.5, 0))
    model.occ.fragment([(3, block)], [(2, patch), (1, strip)])
    model.occ.synchronize()
    top = model.getEntitiesInBoundingBox(0.2, 0.1, 0.9, 0.8, 0.8, 1.1, 2)
    model.addPhysicalGroup(3, [1], 1)
    model.addPhysicalGroup(2, [tag for _, tag in top], 2, "patch")
    rest = [tag for pair in model.getEntities(2) if pair not in top for tag in pair[1:]]
    model.addPhysicalGroup(2, rest, 3, "rest")
    line = model.getEntitiesInBoundingBox(-0.1, 0.4, -0.1, 1.1, 0.6, 0.1, 1)
    model.addPhysicalGroup(1, [tag for _, tag in line], 4, "line")


def _embedded_surface(model):
    block = model.occ.addBox(0, 0, 0, 1, 1, 1)
    sheet = model.occ.addRectangle(0.2, 0.2, 0.5, 0.6, 0.6)
    wire = model.occ.addLine(model.occ.addPoint(0.1, 0.1, 0.2), model.occ.addPoint(0.9, 0.1, 0.2))
    model.occ.fragment([(3, block)], [(2, sheet), (1, wire)])
    model.occ.synchronize()
    model.addPhysicalGroup(3, [1], 1)
    inside = model.getEntitiesInBoundingBox(0.1, 0.1, 0.4, 0.9, 0.9, 0.6, 2)
    model.addPhysicalGroup(2, [tag for _, tag in inside], 2, "crack")
    within = model.getEntitiesInBoundingBox(0.05, 0.05, 0.1, 0.95, 0.15, 0.3, 1)
    model.addPhysicalGroup(1, [tag for _, tag in within], 3, "wire")


def _open_crack(model):
    """A crack that comes in through a face of the cube."""
    block = model.occ.addBox(0, 0, 0, 1, 1, 1)
    model.occ.fragment([(3, block)], [(2, model.occ.addRectangle(0, 0, 0.5, 0.6, 1))])
    model.occ.synchronize()
    model.addPhysicalGroup(3, [tag for _, tag in model.getEntities(3)], 1)
    inside = model.getEntitiesInBoundingBox(-0.1, -0.1, 0.4, 0.7, 1.1, 0.6, 2)
    model.addPhysicalGroup(2, [tag for _, tag in inside], 2, "crack")
    mouth = [
        *model.getEntitiesInBoundingBox(-0.1, -0.1, 0.4, 0.1, 1.1, 0.6, 1),
        *model.getEntitiesInBoundingBox(-0.1, -0.1, 0.4, 0.7, 0.1, 0.6, 1),
        *model.getEntitiesInBoundingBox(-0.1, 0.9, 0.4, 0.7, 1.1, 0.6, 1),
    ]
    model.addPhysicalGroup(1, [tag for _, tag in mouth], 3, "mouth")


def _plate(model):
    """Two materials, a square hole, a round hole and a curve that is half of an edge."""
    left = [(2, model.occ.addRectangle(0, 0, 0, 1, 1))]
    left, _ = model.occ.cut(left, [(2, model.occ.addRectangle(0.3, 0.3, 0, 0.3, 0.4))])
    right, _ = model.occ.cut(
        [(2, model.occ.addRectangle(1, 0, 0, 1, 1))], [(2, model.occ.addDisk(1.5, 0.5, 0, 0.2, 0.2))]
    )
    model.occ.fragment([*left, *right], [(0, model.occ.addPoint(0.5, 0, 0))])
    model.occ.synchronize()
    for number, (_, tag) in enumerate(model.getEntities(2)):
        model.addPhysicalGroup(2, [tag], 7 - number)
    half = model.getEntitiesInBoundingBox(-0.1, -0.1, -1, 0.6, 0.1, 1, 1)
    model.addPhysicalGroup(1, [tag for _, tag in half], 9, "half an edge")


def _slit(model):
    square = model.occ.addRectangle(0, 0, 0, 1, 1)
    cut = model.occ.addLine(model.occ.addPoint(0, 0.4, 0), model.occ.addPoint(0.6, 0.4, 0))
    model.occ.fragment([(2, square)], [(1, cut)])
    model.occ.synchronize()
    model.addPhysicalGroup(2, [tag for _, tag in model.getEntities(2)], 1)
    inside = model.getEntitiesInBoundingBox(-0.1, 0.3, -1, 0.7, 0.5, 1, 1)
    model.addPhysicalGroup(1, [tag for _, tag in inside], 2, "crack")
    mouth = model.getEntitiesInBoundingBox(-0.1, 0.3, -1, 0.1, 0.5, 1, 0)
    model.addPhysicalGroup(0, [tag for _, tag in mouth], 3, "mouth")


# name: (model, dimension, element size, whether group 2 is opened into a crack, and its open end, a group)
PARTS = {
    "cube": (_cube, 3, 0.3, None),
    "L": (_l_shape, 3, 0.35, None),
    "two-materials": (_two_materials, 3, 0.3, None),
    "inclusion-and-hole": (_inclusion_and_hole, 3, 0.25, None),
    "split-face": (_split_face, 3, 0.3, None),
    "embedded": (_embedded_surface, 3, 0.25, None),
    "crack": (_embedded_surface, 3, 0.25, 0),
    "open-crack": (_open_crack, 3, 0.25, 3),
    "plate": (_plate, 2, 0.12, None),
    "slit": (_slit, 2, 0.1, 3),
}


@cache
def part(name: str, order: int = 1, quads: bool = False) -> Mesh:
    """The part called ``name`` as Gmsh meshes it; quads: recombine triangles."""
    build, dimension, size, opening = PARTS[name]
    with gmsh_session(Mesh_MeshSizeMin=size, Mesh_MeshSizeMax=size, Mesh_RecombineAll=int(quads)) as gmsh:
        build(gmsh.model)
        gmsh.model.mesh.generate(dimension)
        gmsh.model.mesh.setOrder(order)
        if opening is not None:
            gmsh.plugin.setNumber("Crack", "Dimension", dimension - 1)
            gmsh.plugin.setNumber("Crack", "PhysicalGroup", 2)
            gmsh.plugin.setNumber("Crack", "OpenBoundaryPhysicalGroup", opening)
            gmsh.plugin.run("Crack")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "part.msh"
            gmsh.write(str(path))
            return reader.read(path.read_bytes()).mesh
