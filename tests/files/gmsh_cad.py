"""Meshes that Gmsh makes and writes in formats of others, and the nodes it finds in a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from needs import require

# kind of mesh: how it is made, its order, whether second-order cells have no nodes on faces and inside
KINDS = {
    "tetra": ("box", 1, False),
    "tetra10": ("box", 2, False),
    "hexahedron": ("extruded quads", 1, False),
    "hexahedron20": ("extruded quads", 2, True),
    "hexahedron27": ("extruded quads", 2, False),
    "wedge": ("extruded triangles", 1, False),
    "wedge15": ("extruded triangles", 2, True),
    "wedge18": ("extruded triangles", 2, False),
    "pyramid": ("pyramid", 1, False),
    "pyramid13": ("pyramid", 2, True),
    "pyramid14": ("pyramid", 2, False),
}


def written_by_gmsh(kind: str, path: Path) -> bytes:
    """A mesh of one of KINDS in the format of the suffix of ``path``."""
    made, order, incomplete = KINDS[kind]
    gmsh = require("gmsh")
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", int(incomplete))
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.8)
        gmsh.model.add(kind)
        if made == "pyramid":
            volume = gmsh.model.addDiscreteEntity(3)
            corners = [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0.5, 0.5, 1]
            gmsh.model.mesh.addNodes(3, volume, [1, 2, 3, 4, 5], corners)
            gmsh.model.mesh.addElementsByType(volume, 7, [1], [1, 2, 3, 4, 5])
        else:
            if made == "box":
                gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
            else:
                square = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
                gmsh.model.occ.extrude([(2, square)], 0, 0, 1, [2], recombine=True)
            gmsh.model.occ.synchronize()
            if made == "extruded quads":
                for _, curve in gmsh.model.getEntities(1):
                    gmsh.model.mesh.setTransfiniteCurve(curve, 3)
                gmsh.model.mesh.setTransfiniteSurface(square)
                gmsh.model.mesh.setRecombine(2, square)
            gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path.read_bytes()


def two_boxes(path: Path) -> bytes:
    """Tetrahedra in two unit boxes, "steel" and "brass", side by side along x.

    The groups "wall" and "inlet" are parts of the surface, "corner" is a point.
    """
    gmsh = require("gmsh")
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
        gmsh.model.add("two boxes")
        boxes = [gmsh.model.occ.addBox(i, 0, 0, 1, 1, 1) for i in range(2)]
        gmsh.model.occ.fragment([(3, boxes[0])], [(3, boxes[1])])
        gmsh.model.occ.synchronize()
        for box, name in zip(boxes, ("steel", "brass"), strict=True):
            gmsh.model.addPhysicalGroup(3, [box], name=name)
        surface = gmsh.model.getBoundary([(3, box) for box in boxes], oriented=False)
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in surface[:2]], name="wall")
        gmsh.model.addPhysicalGroup(2, [surface[2][1]], name="inlet")
        gmsh.model.addPhysicalGroup(0, [1], name="corner")
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path.read_bytes()


def nodes_by_gmsh(path: Path) -> np.ndarray:
    """(N, 3) the nodes of a file by ascending number, as Gmsh reads it."""
    gmsh = require("gmsh")
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        return coordinates.reshape(-1, 3)[np.argsort(tags)]
    finally:
        gmsh.finalize()
