"""The README's blocks are done here, one after the other, on small meshes with the names they use.

Installing and the tests themselves are left to CI, which runs these two commands in a fresh environment.
"""

from __future__ import annotations

import re
import tomllib

import meshio
import numpy as np
import pytest

from meshes import random_mesh
from needs import require, require_program
from test_tutorials import ROOT, blocks, environment, shell

README = ROOT / "README.md"
BLOCKS = blocks(README)
SHOWN = ("dvr smooth IN OUT",)  # what the commands are, not what to type
GEOMETRY = 'SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 1, 1, 1}; Mesh.MeshSizeMax = 0.6;'
_FORMATS = {".msh": "gmsh22", ".vtk": "vtk42", ".vtu": "vtu"}


def of_meshio(mesh):
    """A mesh as meshio has it, in space."""
    points = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.points.shape[1])))
    return meshio.Mesh(points, [(cells.type, cells.vertices) for cells in mesh.cells])


def of(language):
    """The blocks in a language."""
    return [text for name, _, text in BLOCKS if name == language]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the meshes that the README names, and programs for what is not tried."""
    samples = tmp_path / "sample_meshes"
    samples.mkdir()
    tetrahedra, triangles = (
        of_meshio(random_mesh("tetra", 1, n=2)),
        of_meshio(random_mesh("triangle", 1, n=2)),
    )
    for path in (
        "part.msh",
        "before.msh",
        "dvr.msh",
        "gmsh.msh",
        "part.vtu",
        "sample_meshes/random_cube.vtk",
    ):
        meshio.write(tmp_path / path, tetrahedra, _FORMATS[path[-4:]], binary=False)
    meshio.write(samples / "random_square.msh", triangles, "gmsh22", binary=False)
    (tmp_path / "part.geo").write_text(GEOMETRY)
    programs = {"pip": 'echo "$@" >> pip.log', "solver": "cat > solved.msh"}
    for name, text in programs.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_block_is_tried():
    for path in re.findall(r"sample_meshes/\w+\.\w+", README.read_text("utf-8")):
        assert (ROOT / path).is_file(), path
    fences = re.findall(r"^```.*$", README.read_text("utf-8"), re.MULTILINE)
    assert len(fences) == 2 * len(BLOCKS)
    assert {name for name, _, _ in BLOCKS} == {"sh", "python", "text"}
    assert all(text.startswith(SHOWN) for text in of("text"))


def test_commands_work(folder):
    require_program("gmsh")
    require("matplotlib")
    setup = [text for text in of("sh") if "pip install" in text]
    use = [text for text in of("sh") if text not in setup]
    use += re.findall(r"`(dvr smooth sample_meshes/[^`]*)`", README.read_text("utf-8"))
    assert (len(setup), len(use)) == (2, 4)
    run, tests = setup
    shell(run.replace("python -m venv .venv && . .venv/bin/activate\n", ""), environment(folder))
    assert tests == run.split("pip")[0] + "pip install -e '.[dev]' && python -m pytest\n"
    extras = re.findall(r"-e \.\[(\w+)\]", (folder / "pip.log").read_text())
    known = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    assert extras == ["fast"]
    assert set(extras) < set(known)
    printed = [shell(text, environment(folder)) for text in use]
    for name in ("smoothed.msh", "repaired.msh", "solved.msh", "picture.png"):
        assert (folder / name).stat().st_size > 1000, name
    worst, *ranking = next(filter(None, printed)).splitlines()
    assert 0 < float(worst) < 1
    assert [line.split("\t")[0] for line in ranking[1:]] == ["before.msh", "dvr.msh", "gmsh.msh"]


def test_python_works(folder):
    pyvista, skfem, gmsh = require("pyvista"), require("skfem"), require("gmsh")
    arrays, others, in_gmsh, motion = of("python")
    names = {}
    exec(arrays, names)
    assert names["report"].after.q1 >= names["report"].before.q1
    exec(others, names)
    assert isinstance(names["better"], pyvista.UnstructuredGrid)
    assert isinstance(names["finite_elements"], skfem.MeshTet)
    mesh = meshio.read(folder / "sample_meshes" / "random_cube.vtk")
    names |= {"mesh": mesh, "motion": [np.zeros_like(mesh.points)] * 2}
    exec(motion, names)
    assert names["points"].shape == mesh.points.shape
    try:
        exec(in_gmsh, names)
        assert len(gmsh.model.mesh.getElementsByType(11)[0])  # of ten nodes
    finally:
        gmsh.finalize()
