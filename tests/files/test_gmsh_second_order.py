"""Second-order meshes of Gmsh itself: the order of their nodes is the one that smoothing believes in."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest

from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.files.gmsh import read
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.second_order import mid_nodes
from dvr_cli.relax.stopping import Stopping
from gmsh_corpus import corpus
from gmsh_session import gmsh_session


def gmsh_mesh(shape: str, incomplete: bool) -> Mesh:
    """A second-order mesh of a straight geometry that Gmsh makes, as its file is read here."""
    options = {"Mesh_SecondOrderIncomplete": float(incomplete), "Mesh_MeshSizeMax": 0.5}
    with gmsh_session(**options) as gmsh, tempfile.TemporaryDirectory() as folder:
        base = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        if shape in ("tetra", "pyramid"):
            gmsh.model.occ.addBox(0, 0, 1, 1, 1, 1)
            gmsh.model.occ.remove([(2, base)])
        gmsh.model.occ.synchronize()
        if shape in ("quad", "hexahedron"):
            gmsh.model.mesh.setRecombine(2, base)
        if shape in ("hexahedron", "wedge"):
            gmsh.model.occ.extrude([(2, base)], 0.2, 0.1, 1, numElements=[2], recombine=True)
            gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(2 if shape in ("triangle", "quad") else 3)
        if shape == "pyramid":
            entity = gmsh.model.addDiscreteEntity(3)
            corners = [0, 0, 5, 1, 0.1, 5, 1.3, 1, 5, 0, 1, 5, 0.4, 0.5, 6]
            first = int(gmsh.model.mesh.getMaxNodeTag()) + 1
            gmsh.model.mesh.addNodes(3, entity, range(first, first + 5), corners)
            gmsh.model.mesh.addElementsByType(entity, 7, [], range(first, first + 5))
        gmsh.model.mesh.setOrder(2)
        path = Path(folder, "mesh.msh")
        gmsh.write(str(path))
        return read(path.read_bytes()).mesh


@pytest.mark.parametrize(
    ("shape", "incomplete", "name"),
    [
        ("triangle", False, "triangle6"),
        ("quad", True, "quad8"),
        ("quad", False, "quad9"),
        ("tetra", False, "tetra10"),
        ("hexahedron", True, "hexahedron20"),
        ("hexahedron", False, "hexahedron27"),
        ("wedge", True, "wedge15"),
        ("wedge", False, "wedge18"),
        ("pyramid", True, "pyramid13"),
        ("pyramid", False, "pyramid14"),
    ],
)
def test_straight_meshes_of_gmsh_are_found_straight(shape, incomplete, name):
    mesh = gmsh_mesh(shape, incomplete)
    assert name in {block.type for block in mesh.cells}
    assert mid_nodes(mesh).curved == 0
    for k in range(
        CELL_TYPES[name].linear.nodes, CELL_TYPES[name].nodes - 1
    ):  # and no other order of nodes would be
        swapped = [Cells(b.type, b.vertices.copy()) for b in mesh.cells if b.type == name]
        swapped[0].vertices[:, [k, k + 1]] = swapped[0].vertices[:, [k + 1, k]]
        assert mid_nodes(Mesh(mesh.points, swapped)).curved == len(swapped[0].vertices)


@pytest.mark.parametrize("model", ["second_order", "full_second_order", "incomplete_second_order"])
def test_models_of_gmsh_stay_straight_when_smoothed(model):
    source = read(corpus(f"{model}-41-binary"))
    points, _ = smooth_mesh(source.mesh, SmoothOptions(stopping=Stopping(max_iterations=4)))
    assert mid_nodes(Mesh(points, source.mesh.cells)).curved == 0
