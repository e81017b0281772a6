"""``--geometry``: vertices end on the curves and surfaces of the CAD model, as Gmsh itself finds."""

import re
import subprocess
import sys

import meshio
import numpy as np
import pytest

from cli_support import DVR
from gmsh_session import gmsh_session

QUICK = ("--engine", "numpy", "--no-patches", "-n", "1")


def block_with_hole(gmsh):
    """A block with a round hole, meshed coarsely and without Gmsh's optimiser."""
    occ = gmsh.model.occ
    occ.cut([(3, occ.addBox(0, 0, 0, 1, 1, 0.4))], [(3, occ.addCylinder(0.5, 0.5, -0.1, 0, 0, 1, 0.2))])
    occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.25)
    gmsh.option.setNumber("Mesh.Optimize", 0)
    gmsh.model.mesh.generate(3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A model, and its mesh in files with and without parameters, text and binary, of two versions."""
    path = tmp_path_factory.mktemp("model")
    with gmsh_session() as gmsh:
        block_with_hole(gmsh)
        gmsh.write(str(path / "block.brep"))
        for parametric in (0, 1):
            for binary in (0, 1):
                gmsh.option.setNumber("Mesh.SaveParametric", parametric)
                gmsh.option.setNumber("Mesh.Binary", binary)
                gmsh.write(str(path / f"mesh{parametric}{binary}.msh"))
        gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
        gmsh.write(str(path / "old.msh"))
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(path / "second.msh"))
    return path


def on_model(model, mesh):
    """The largest distance of a node from its curve or surface, and from where its parameters put it.

    Also how many tetrahedra are inverted once Gmsh has raised the order, on the model, and whether the
    file has parameters.
    """
    with gmsh_session() as gmsh:
        gmsh.open(str(model))
        gmsh.merge(str(mesh))
        away = wrong = known = 0
        for entity in [*gmsh.model.getEntities(1), *gmsh.model.getEntities(2)]:
            tags, points, parameters = gmsh.model.mesh.getNodes(*entity)
            if len(tags):
                away = max(away, np.abs(gmsh.model.getClosestPoint(*entity, points)[0] - points).max())
            if len(parameters):
                known = 1
                wrong = max(wrong, np.abs(gmsh.model.getValue(*entity, parameters) - points).max())
        gmsh.model.mesh.setOrder(2)
        tetrahedra, _ = gmsh.model.mesh.getElementsByType(11)
        inverted = (gmsh.model.mesh.getElementQualities(tetrahedra, "minSJ") <= 0.0).sum()
    return away, wrong, inverted, known


def sections(data):
    """The bytes of a Gmsh file before, in and after its section of nodes."""
    begin, end = data.index(b"$Nodes"), data.index(b"$EndNodes")
    return data[:begin], data[begin:end], data[end:]


@pytest.mark.parametrize("name", ["mesh00", "mesh01", "mesh10", "mesh11"])
def test_vertices_end_on_the_model_with_the_right_parameters(dvr, folder, tmp_path, name):
    model, source, output = folder / "block.brep", folder / f"{name}.msh", tmp_path / "out.msh"
    done = dvr("smooth", source, output, "--boundary", "project", "--geometry", model, *QUICK)
    assert done.code == 0, done.err
    assert "parametric" not in done.err
    away, wrong, inverted, known = on_model(model, output)
    assert known == (name in ("mesh10", "mesh11"))
    assert away < 1e-12
    assert wrong < 1e-12
    assert inverted == 0
    before, after = sections(source.read_bytes()), sections(output.read_bytes())
    assert (before[0], before[2]) == (after[0], after[2])
    assert before[1] != after[1]


def test_without_the_model_they_end_on_the_facets_of_the_input(dvr, folder, tmp_path):
    output = tmp_path / "out.msh"
    done = dvr("smooth", folder / "mesh10.msh", output, "--boundary", "project", *QUICK)
    assert done.code == 0, done.err
    assert "dropped the parametric coordinates" in done.err
    assert on_model(folder / "block.brep", output)[0] > 1e-5


@pytest.mark.long
def test_another_format_gets_the_points_on_the_model(dvr, folder, tmp_path):
    for output in ("out.msh", "out.vtk"):
        arguments = ("--boundary", "project", "--geometry", folder / "block.brep", "--no-report", *QUICK)
        assert dvr("smooth", folder / "mesh00.msh", tmp_path / output, *arguments).code == 0
    points = [meshio.read(tmp_path / "out.vtk").points]
    points.append(meshio.read(tmp_path / "out.msh", file_format="gmsh").points)
    assert np.array_equal(*points)


def test_the_kernel_of_gmsh_itself_knows_arcs(dvr, tmp_path):
    model = tmp_path / "disc.geo"
    model.write_text(
        "Point(1) = {0, 0, 0, .3}; Point(2) = {1, 0, 0, .3}; Point(3) = {-1, 0, 0, .3};\n"
        "Circle(1) = {2, 1, 3}; Circle(2) = {3, 1, 2};\n"
        "Curve Loop(1) = {1, 2}; Plane Surface(1) = {1};\n"
    )
    with gmsh_session() as gmsh:
        gmsh.open(str(model))
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setNode(gmsh.model.mesh.getNodes(1, 1)[0][2], [0.7, 0.713, 0.0], [])
        gmsh.write(str(tmp_path / "disc.msh"))
    run = (
        "smooth",
        tmp_path / "disc.msh",
        tmp_path / "out.msh",
        "--geometry",
        model,
        "--boundary",
        "project",
    )
    done = dvr(*run, "--max-deviation", 0.05, "--feature-angle", 60, *QUICK)
    assert done.code == 0, done.err
    with gmsh_session() as gmsh:
        gmsh.open(str(tmp_path / "out.msh"))
        radii = []
        for curve in (1, 2):
            radii.append(np.linalg.norm(gmsh.model.mesh.getNodes(1, curve)[1].reshape(-1, 3), axis=1))
    assert np.concatenate(radii) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("mesh", "model", "more", "message"),
    [
        (
            "mesh00",
            "other.brep",
            (),
            r"other\.brep: is it the model that the mesh was made of\? Vertex \d+ is",
        ),
        ("mesh00", "box.brep", (), r"box\.brep: it has no (curve|surface) \d+, on which vertices"),
        ("mesh00", "rubbish.brep", (), r"rubbish\.brep: Gmsh finds no model in it"),
        ("mesh00", "none.brep", (), r"none\.brep: no such file"),
        ("mesh00", "model.stl", (), r"unknown suffix '\.stl'; known: \.brep, \.geo, \.step, \.stp"),
        ("old", "block.brep", (), "only Gmsh files of version 4"),
        ("second", "block.brep", (), "of second order"),
        ("mesh00", "block.brep", ("--boundary", "fixed"), "no vertex of the boundary moves"),
    ],
)
def test_one_line_says_what_is_wrong(dvr, folder, tmp_path, mesh, model, more, message):
    with gmsh_session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "box.brep"))
        gmsh.clear()
        block_with_hole(gmsh)
        gmsh.model.occ.dilate(gmsh.model.getEntities(3), 0, 0, 0, 1.1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "other.brep"))
    (tmp_path / "rubbish.brep").write_text("no model\n")
    there = folder / model if model == "block.brep" else tmp_path / model
    options = ("--geometry", there, *(more or ("--boundary", "project")), *QUICK)
    done = dvr("smooth", folder / f"{mesh}.msh", tmp_path / "out.msh", *options)
    assert done.code != 0
    assert len(done.err.strip().splitlines()) == 1
    assert re.search(message, done.err), done.err
    assert not (tmp_path / "out.msh").exists()


@pytest.mark.long
def test_words_of_the_kernel_do_not_get_into_a_piped_mesh(folder, tmp_path):
    (tmp_path / "rubbish.brep").write_text("no model\n")
    arguments = ["smooth", folder / "mesh00.msh", "-", "--boundary", "project"]
    for model, code in ((folder / "block.brep", 0), (tmp_path / "rubbish.brep", 3)):
        done = subprocess.run(
            [DVR, *arguments, "--geometry", model, "-n", "0"], capture_output=True, check=False
        )
        assert done.returncode == code, done.stderr
        assert done.stdout[:11] == (b"$MeshFormat" if code == 0 else b"")


def test_a_closed_stdout_is_no_hindrance(folder, tmp_path):
    arguments = ["smooth", folder / "mesh00.msh", tmp_path / "out.msh", "--boundary", "project", "-n", "0"]
    words = [str(word) for word in (DVR, *arguments, "--geometry", folder / "block.brep")]
    done = subprocess.run(["sh", "-c", '"$@" >&-', "sh", *words], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out.msh").exists()


def test_without_gmsh_the_message_says_what_to_install(dvr, folder, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    options = ("--boundary", "project", "--geometry", folder / "block.brep")
    done = dvr("smooth", folder / "mesh00.msh", tmp_path / "out.msh", *options)
    assert done.code != 0
    assert "pip install 'dvr-cli[cad]'" in done.err
