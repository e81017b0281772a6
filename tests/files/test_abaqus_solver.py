"""Decks that programs write and solve: Gmsh writes a mesh, CalculiX solves the deck before and after."""

from __future__ import annotations

import re
import subprocess

import meshio
import numpy as np
import pytest

import needs
from abaqus_corpus import FLAT
from dvr_cli.cli.main import main
from dvr_cli.files.reading import open_mesh
from dvr_cli.files.source import differing
from gmsh_session import gmsh_session

ANALYSIS = """*MATERIAL, NAME=STEEL
*ELASTIC
210000., 0.3
*DENSITY
1.
*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL
*STEP
*STATIC
*BOUNDARY
WALL, 1, 3
*DLOAD
BODY, GRAV, 1000., 0., 0., -1.
*NODE PRINT, NSET=TIP
U
*EL PRINT, ELSET=BODY, TOTALS=ONLY
EVOL
*END STEP
"""


@pytest.fixture(scope="module", params=[1, 2])
def beam(request, tmp_path_factory):
    """A clamped beam of tetrahedra as Gmsh writes it for Abaqus, and a step of an analysis."""
    gmsh = needs.require("gmsh")
    path = tmp_path_factory.mktemp("beam") / "beam.inp"
    with gmsh_session():
        gmsh.model.occ.addBox(0, 0, 0, 4, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
        gmsh.option.setNumber("Mesh.Optimize", 0)
        gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", 1)
        gmsh.option.setNumber("Mesh.SaveGroupsOfElements", -1000)
        gmsh.model.addPhysicalGroup(3, [1], name="BODY")
        for name, x in (("WALL", 0), ("TIP", 4)):
            faces = gmsh.model.getEntitiesInBoundingBox(x - 0.1, -1, -1, x + 0.1, 2, 2, 2)
            gmsh.model.addPhysicalGroup(2, [tag for _, tag in faces], name=name)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(request.param)
        gmsh.write(str(path))
        kind = gmsh.model.mesh.getElementType("Tetrahedron", request.param)
        tetrahedra = len(gmsh.model.mesh.getElementsByType(kind)[0])
    text = re.sub(r"\*ELEMENT, type=CPS\d, ELSET=\w+\n[^*]*", "", path.read_text(), flags=re.IGNORECASE)
    text = re.sub(r"\*ELSET,ELSET=(WALL|TIP)\n[^*]*", "", text)
    path.write_text(text + ANALYSIS)
    return path, tetrahedra


def solve(path) -> np.ndarray:
    """Numbers that CalculiX prints for a deck: displacements of TIP, and the volume."""
    ccx = needs.require_program("ccx")
    run = subprocess.run([ccx, path.stem], cwd=path.parent, capture_output=True, text=True, timeout=600)
    assert run.returncode == 0
    assert "*ERROR" not in run.stdout
    words = path.with_suffix(".dat").read_text().split()
    return np.array([float(word) for word in words if re.fullmatch(r"-?\d\.\d+E[+-]\d+", word)])


def test_calculix_solves_the_deck_before_and_after(beam, tmp_path):
    path, tetrahedra = beam
    out = tmp_path / "out.inp"
    assert main(["smooth", str(path), str(out), "-q", "-n", "5", "--no-patches"]) == 0
    source, after = open_mesh(path), open_mesh(out).mesh
    assert len(source.mesh.cells[0].vertices) == tetrahedra
    moved = differing(after.points, source.mesh.points).any(axis=1)
    assert moved.any()
    lines = zip(path.read_text().splitlines(), out.read_text().splitlines(), strict=True)
    changed = [a for a, b in lines if a != b]
    assert len(changed) == moved.sum()  # a line for each vertex that moved, and no other
    old, new = solve(path), solve(out)
    assert len(old) == len(new)
    assert len(old) > 3 * 9  # the tip has so many nodes at least
    assert np.abs(new - old).max() < 0.02 * np.abs(old).max()
    assert not np.array_equal(old, new)


def test_calculix_takes_every_coordinate_as_stored(tmp_path):
    """Numbers of 20 columns: CalculiX gives back, in its results, the coordinates it has read."""
    path, out = tmp_path / "in.inp", tmp_path / "out.inp"
    path.write_text(FLAT.replace("*NODE PRINT", "*NODE FILE\nU\n*NODE PRINT"))
    source = open_mesh(path)
    points = source.mesh.points.copy()
    points[4, :2] = 1.0123456789012345, 0.00012345678901234567
    with out.open("wb") as file:
        source.write(points, file)
    solve(out)
    lines = out.with_suffix(".frd").read_text().splitlines()
    line = next(line for line in lines if line.startswith(" -1       900"))
    shown = [float(line[begin : begin + 12]) for begin in (13, 25)]
    assert np.allclose(shown, source.stored(points)[4, :2], rtol=1e-4)


def test_calculix_runs_a_mesh_of_another_format_as_a_deck(tmp_path):
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    points = np.array([[*xy, z] for z in (0.0, 1.0) for xy in square] + [[0.5, 0.45, 0.55]])
    faces = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    cells = [(a, c, b, 8) for face in faces for a, b, c in (face[:3], (face[0], face[2], face[3]))]
    meshio.write(tmp_path / "cube.vtk", meshio.Mesh(points, {"tetra": np.array(cells)}))
    out = tmp_path / "cube.inp"
    assert main(["smooth", str(tmp_path / "cube.vtk"), str(out), "-q"]) == 0
    sets = "*ELSET, ELSET=BODY, GENERATE\n1, 12\n*NSET, NSET=WALL\n1, 2, 3, 4\n*NSET, NSET=TIP\n5, 6\n"
    out.write_text(out.read_text() + sets + ANALYSIS)
    numbers = solve(out)
    assert np.isfinite(numbers).all()
    assert abs(numbers[-1] - 1.0) < 1e-5  # the volume
