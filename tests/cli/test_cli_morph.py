"""``dvr morph``: a mesh follows its displaced boundary and stays valid, or it says why not."""

from __future__ import annotations

import numpy as np
import pytest

import dvr_cli
from cli_support import CORNERS, assert_one_line, fan, listing, points_of, read_json, write
from dvr_cli.api.morphing import morph_mesh
from dvr_cli.api.options import SmoothOptions
from dvr_cli.mesh.domain import domain_of
from meshes import hexagon, random_mesh


def saved(path, array):
    """Write an array as the suffix of ``path`` says."""
    if path.suffix == ".npy":
        np.save(path, array)
    else:
        np.savetxt(path, array, delimiter="," if path.suffix == ".csv" else " ", fmt="%.17g")
    return path


def turning(points, degrees):
    """The displacement (N, 3) that turns the points (N, 2) about the origin."""
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return np.pad(points @ turn - points, ((0, 0), (0, 1)))


@pytest.fixture
def turned(tmp_path):
    """A hexagonal mesh in a file, and its points."""
    mesh = hexagon(4)
    return write(tmp_path / "in.vtk", mesh.points, {"triangle": mesh.cells[0].vertices}), mesh


def test_a_small_displacement_is_one_step_of_the_relaxer(dvr, tmp_path):
    mesh = random_mesh("tetra", 1)
    source = write(tmp_path / "in.vtk", mesh.points, {"tetra": mesh.cells[0].vertices})
    shift = 0.05 * mesh.points**2
    file = saved(tmp_path / "d.npy", shift)
    result = dvr("morph", source, tmp_path / "out.vtk", "--displacement", file, "-d", "axis")
    assert (result.code, result.out) == (0, "")
    assert "100 % of the displacement made in 1 substep\n" in result.err
    relaxer = dvr_cli.Relaxer(points_of(source), {"tetra": mesh.cells[0].vertices}, directions="axis")
    expected, _ = relaxer.relax(displacement=shift)
    assert points_of(tmp_path / "out.vtk").tobytes() == expected.tobytes()


def test_a_large_displacement_is_made_in_substeps(dvr, turned, tmp_path):
    """Turned by 100 degrees, on straight paths, the mesh cannot follow at once."""
    source, mesh = turned
    file = saved(tmp_path / "d.npy", turning(mesh.points, 100))
    given = "morph", source, tmp_path / "out.vtk", "--displacement", file, "-d", "axis"
    assert dvr(*given, "--shape", "ideal").code == 0
    points = points_of(tmp_path / "out.vtk")
    boundary = ~domain_of(mesh).interior
    expected = np.pad(mesh.points, ((0, 0), (0, 1))) + turning(mesh.points, 100)
    assert points[boundary].tobytes() == expected[boundary].tobytes()
    report = read_json((tmp_path / "out.quality.json").read_text())
    (morph,) = report["phases"]
    assert morph["phase"] == "morph"
    fractions = [substep["fraction"] for substep in morph["substeps"]]
    assert morph["fraction"] == fractions[-1] == 1
    assert len(fractions) > 1
    assert fractions == sorted(set(fractions))
    assert all(substep["q1"] > 0 for substep in morph["substeps"])
    assert any(substep["q1_before"] < 0 for substep in morph["substeps"])
    assert [sweep["sweep"] for sweep in report["sweeps"]] == list(range(1, len(report["sweeps"]) + 1))
    assert sum(substep["sweeps"] for substep in morph["substeps"]) == len(report["sweeps"])
    measured = read_json(dvr("report", "quality", tmp_path / "out.vtk", "--json").out)["quality"]
    assert measured == report["after"]
    assert measured["inverted"] == 0
    assert measured["q1"] == morph["substeps"][-1]["q1"] > 0.7


@pytest.mark.parametrize("suffix", [".npy", ".csv", ".txt"])
@pytest.mark.parametrize("columns", [2, 3])
def test_kinds_of_displacement_files(dvr, tmp_path, suffix, columns):
    shift = np.array([[0, 0, 0], [0.5, 0, 0], [0.5, 0, 0], [0, 0, 0], [np.nan] * 3])[:, :columns]
    file = saved(tmp_path / f"d{suffix}", shift)
    result = dvr(
        *("morph", fan(tmp_path / "in.msh"), tmp_path / "out.msh", "--displacement", file),
        *("-d", "axis", "--shape", "ideal"),
    )
    assert result.code == 0, result.err
    points = points_of(tmp_path / "out.msh")
    assert points[:4].tolist() == [[0, 0, 0], [1.5, 0, 0], [1.5, 1, 0], [0, 1, 0]]
    assert points[4] == pytest.approx([0.75, 0.5, 0], abs=2e-3)


def test_only_vertices_near_displaced_ones_are_relaxed_if_asked(dvr, turned, tmp_path):
    source, mesh = turned
    shift = np.zeros_like(mesh.points)
    corner = int(mesh.points[:, 0].argmax())
    shift[corner, 0] = 0.1
    file = saved(tmp_path / "d.npy", shift)
    result = dvr("morph", source, tmp_path / "out.vtk", "--displacement", file, "--near", 2)
    assert result.code == 0
    moved = (points_of(tmp_path / "out.vtk") != points_of(source)).any(axis=1)
    distance = np.linalg.norm(mesh.points - mesh.points[corner], axis=1)
    assert moved[corner]
    assert distance[moved].max() < 0.51  # two rings of triangles of edge 1/4
    report = read_json((tmp_path / "out.quality.json").read_text())
    assert 0 < report["relaxed"] < 10
    assert report["options"]["near"] == 2


@pytest.mark.parametrize("after", [1, 20, 60, 400])
def test_interrupted_it_ends_with_the_last_valid_mesh(after):
    mesh = hexagon(4)
    shift = turning(mesh.points, 100)[:, :2]
    asked = 0

    def interrupted():
        nonlocal asked
        asked += 1
        return asked > after

    options = SmoothOptions(directions="axis", shape="ideal")
    points, report = morph_mesh(mesh, shift, options, interrupted=interrupted)
    (phase,) = report.phases
    assert 0 <= phase.fraction < 1
    assert report.stopped_because == phase.stopped_because == "interrupted"
    assert (phase.fraction > 0) == (after >= 60) == bool(phase.substeps)
    boundary = ~domain_of(mesh).interior
    expected = mesh.points + phase.fraction * shift
    assert np.array_equal(points[boundary], expected[boundary])
    assert report.after.minimum > 0


# --------------------------------------------------------------------------------------------- what cannot be


def test_what_relaxation_cannot_follow_is_refused(dvr, tmp_path):
    """The boundary of a square, folded: its left side passes its right one."""
    source = fan(tmp_path / "in.msh", 0.5, 0.5)
    file = saved(tmp_path / "d.npy", np.array([[1.5, 0, 0], [0, 0, 0], [0, 0, 0], [1.5, 0, 0], [0, 0, 0]]))
    before = listing(tmp_path)
    result = dvr("morph", source, tmp_path / "out.msh", "--displacement", file)
    assert_one_line(result, 3, "in.msh", "% of the displacement only", "triangle")
    share = float(result.err.split("valid for ")[1].split(" %")[0])
    assert 60 < share < 100 * 2 / 3  # they meet after two thirds
    assert listing(tmp_path) == before


def test_elements_without_a_vertex_to_relax(dvr, tmp_path):
    source = write(tmp_path / "in.msh", CORNERS, {"triangle": [[0, 1, 2], [0, 2, 3]]})
    file = saved(tmp_path / "d.npy", np.array([[0, 0, 0], [-0.9, 0.9, 0], [0, 0, 0], [0, 0, 0]]))
    result = dvr("morph", source, tmp_path / "out.msh", "--displacement", file)
    assert_one_line(result, 3, "in.msh", "without a vertex to relax")


def test_a_mesh_that_is_not_valid(dvr, tmp_path):
    source = fan(tmp_path / "in.msh", 1.5, 0.5)
    file = saved(tmp_path / "d.npy", np.zeros((5, 3)))
    before = listing(tmp_path)
    assert_one_line(
        dvr("morph", source, tmp_path / "out.msh", "--displacement", file), 3, "in.msh", "1 inverted"
    )
    assert listing(tmp_path) == before


@pytest.mark.parametrize(
    ("name", "array", "code", "named"),
    [
        ("d.npy", np.zeros((4, 3)), 2, "(4, 3)"),
        ("d.npy", np.zeros((5, 4)), 2, "(5, 4)"),
        ("d.npy", np.full((5, 2), "up"), 2, "displacement"),
        ("d.npy", np.full((5, 3), np.nan), 3, "displacement of vertex 0"),
        ("d.npy", np.eye(5, 3), 3, "plane"),
        ("d.bin", None, 2, "d.bin"),
        ("none.npy", None, 3, "none.npy"),
    ],
)
def test_wrong_displacements(dvr, tmp_path, name, array, code, named):
    source = fan(tmp_path / "in.msh")
    if array is not None:
        saved(tmp_path / name, array)
    before = listing(tmp_path)
    result = dvr("morph", source, tmp_path / "out.msh", "--displacement", tmp_path / name)
    assert_one_line(result, code, named)
    assert listing(tmp_path) == before


# -------------------------------------------------------------------------------------------------- as smooth


def test_nothing_but_errors_when_quiet_and_no_report_when_not_wanted(dvr, tmp_path):
    file = saved(tmp_path / "d.npy", np.zeros((5, 3)))
    arguments = ["morph", fan(tmp_path / "in.msh"), tmp_path / "out.msh", "--displacement", file]
    result = dvr(*arguments, "-q", "--no-report")
    assert (result.code, result.out, result.err) == (0, "", "")
    assert {path.name for path in tmp_path.iterdir()} == {"in.msh", "out.msh", "d.npy"}
    assert dvr(*arguments, "--fail-below", "0.99").code == 1
    assert dvr(*arguments, "-v").err.startswith("sweep   1 ")


def test_coordinates_are_widened_where_rounding_would_flatten_elements(dvr, tmp_path):
    """Squeezed to a height of 1e-9, in the middle of which single precision knows no number."""
    source = tmp_path / "in.vtk"
    source.write_text(
        "# vtk DataFile Version 3.0\nsquare\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        "POINTS 5 float\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 0.5 0\n"
        "CELLS 4 16\n3 0 1 4\n3 1 2 4\n3 2 3 4\n3 3 0 4\nCELL_TYPES 4\n5\n5\n5\n5\n"
    )
    height = np.array([1, 1, 1e-9, 1e-9, 0])
    file = saved(tmp_path / "d.csv", np.outer(height, [0, 1, 0]))
    result = dvr("morph", source, tmp_path / "out.vtk", "--displacement", file, "-d", "y")
    assert result.code == 0, result.err
    assert " double\n" in (tmp_path / "out.vtk").read_text()
    assert dvr("report", "quality", tmp_path / "out.vtk", "--fail-below", "1e-10").code == 0
