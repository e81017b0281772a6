"""Meshes that Gmsh makes and writes in formats of others, and where the nodes of a file must be."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np

from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Mesh
from gmsh_session import gmsh_session, opened_by_gmsh

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
    with gmsh_session(Mesh_SecondOrderIncomplete=int(incomplete), Mesh_MeshSizeMax=0.8) as gmsh:
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
    return path.read_bytes()


def into_hexahedra(gmsh: ModuleType, box: int) -> None:
    """A box, the only volume of the model, is to be meshed by two hexahedra along each edge."""
    for _, tag in gmsh.model.getEntities(1):
        gmsh.model.mesh.setTransfiniteCurve(tag, 3)
    for _, tag in gmsh.model.getEntities(2):
        gmsh.model.mesh.setTransfiniteSurface(tag)
        gmsh.model.mesh.setRecombine(2, tag)
    gmsh.model.mesh.setTransfiniteVolume(box)


def two_boxes(path: Path) -> bytes:
    """Tetrahedra in two unit boxes, "steel" and "brass", side by side along x.

    The groups "wall" and "inlet" are parts of the surface, "corner" is a point.
    """
    with gmsh_session(Mesh_MeshSizeMax=0.5) as gmsh:
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
    return path.read_bytes()


def nodes_by_gmsh(path: Path) -> np.ndarray:
    """(N, 3) the nodes of a file by ascending number, as Gmsh reads it."""
    with opened_by_gmsh(path) as (_, _, points):
        return points


def check_nodes(mesh: Mesh) -> set[str]:
    """Middles of straight cells lie in the middle, volumes are positive; returns the types of cells."""
    for block in mesh.cells:
        record = CELL_TYPES[block.type]
        linear, around = (record.linear or record).name, record.mids
        x = mesh.points[block.vertices]
        first = x.shape[1] - len(around)
        for k, ends in enumerate(around):
            assert np.allclose(x[:, first + k], x[:, list(ends)].mean(axis=1), atol=1e-12), block.type
        corners = {"tetra": (2, 3), "wedge": (2, 3), "hexahedron": (3, 4), "pyramid": (3, 4)}.get(linear)
        if corners:
            edges = [x[:, i] - x[:, 0] for i in (1, *corners)]
            assert (np.linalg.det(np.stack(edges, axis=1)) > 0).all(), block.type
    return {block.type for block in mesh.cells}
