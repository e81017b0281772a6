"""Surfaces in space as files and in reports: ``dvr smooth bunny.obj out.obj``, ``dvr report quality``."""

import json
from dataclasses import replace

import meshio
import numpy as np
import pytest
import trimesh

import dvr_cli
from curved_parts import distances, scanned
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.cli.main import main
from dvr_cli.files.reading import open_mesh
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.relax.stopping import Stopping
from meshes import random_mesh


def written(path, mesh):
    meshio.write_points_cells(path, mesh.points, [("triangle", mesh.cells[0].vertices)])
    return path


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".vtk", ".off", ".vtu"])
def test_surface_files(tmp_path, capsys, suffix):
    mesh = scanned(6, noise=0.002)  # with more, facets lie folded, and are unfolded first
    source, output = written(tmp_path / f"in{suffix}", mesh), tmp_path / f"out{suffix}"
    capsys.readouterr()
    assert main(["smooth", str(source), str(output), "-n", "3", "--max-deviation", "0.02"]) == 0
    text = capsys.readouterr().err
    assert "surface, " in text
    assert "from the input's at most (bound 0.02)" in text
    before, after = open_mesh(source).mesh, open_mesh(output).mesh
    triangles = before.cells[0].vertices
    assert (before.points != after.points).any()
    report = json.loads((tmp_path / "out.quality.json").read_text())
    assert report["mesh"]["surface"] is True
    assert report["boundary"]["deviation"] <= report["boundary"]["max_deviation"] == 0.02
    assert report["boundary"]["volume_change"] is None  # it has a border
    # STL files hold 32-bit coordinates
    assert distances(after.points, before.points, triangles).max() < (1e-6 if suffix == ".stl" else 1e-12)
    assert report["after"]["q1"] > report["before"]["q1"]


def test_an_obj_file_keeps_all_but_its_vertices(tmp_path):
    mesh = scanned(6)
    triangles = mesh.cells[0].vertices + 1
    lines = ["# a scan", "mtllib scan.mtl"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.points.tolist()]
    lines += [f"vt {x!r} {y!r}" for x, y, _ in mesh.points.tolist()]
    lines += ["g left", "usemtl red"]
    for n, (a, b, c) in enumerate(triangles.tolist()):
        lines += ["g right"] if n == len(triangles) // 2 else []
        lines += [f"f {a}/{a} {b}/{b} {c}/{c}"]
    source, output = tmp_path / "in.obj", tmp_path / "out.obj"
    source.write_text("\n".join(lines) + "\n")
    options = ["--max-deviation", "0.02", "-n", "3", "--quiet"]
    assert main(["smooth", str(source), str(output), *options]) == 0
    after = output.read_text().splitlines()
    assert [line for line in after if not line.startswith("v ")] == [
        line for line in lines if not line.startswith("v ")
    ]
    old, new = open_mesh(source).mesh, open_mesh(output).mesh
    moved = (old.points != new.points).any(axis=1)
    assert moved.any()
    # vertices between the groups stay on the curve between them, those of the border on the border
    half = len(triangles) // 2
    left, right = (set(part.ravel().tolist()) for part in (triangles[:half] - 1, triangles[half:] - 1))
    edges = np.sort(old.cells[0].vertices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    between = np.array([e for e in np.unique(edges, axis=0).tolist() if {*e} <= left & right])
    shared = sorted(left & right)
    assert distances(new.points[shared], old.points, between).max() < 1e-12


def test_the_quality_of_a_surface_is_that_of_its_triangles_in_their_own_planes(capsys, tmp_path):
    mesh = scanned(6)
    a, b, c = mesh.points[mesh.cells[0].vertices].swapaxes(0, 1)
    sides = sum(((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a)))
    expected = 2 * np.sqrt(3) * np.linalg.norm(np.cross(b - a, c - a), axis=1) / sides
    report = dvr_cli.quality_report(mesh.points, {"triangle": mesh.cells[0].vertices})
    np.testing.assert_allclose(report.quality.elements, expected, rtol=1e-12)
    assert report.mesh.surface
    assert report.quality.inverted == 0
    # the same angles as in the plane each lies in
    cosine = ((b - a) * (c - a)).sum(axis=1) / np.linalg.norm(b - a, axis=1) / np.linalg.norm(c - a, axis=1)
    assert report.quality.measures["min_angle"] <= np.degrees(np.arccos(cosine)).min() + 1e-9
    assert main(["report", "quality", str(written(tmp_path / "s.ply", mesh))]) == 0
    assert "surface\tyes\n" in capsys.readouterr().out


def test_a_quadrilateral_of_a_surface_counts_as_in_its_plane():
    """Its corners have the sign they have against the rest of it, as it has no upper side of its own."""
    mesh = random_mesh("quad", 2, n=4)
    mesh.points[[7, 12]] += 0.2
    flat = domain_of(mesh)
    quads = flat.cells[0].vertices
    diagonal, other = (mesh.points[quads[:, k + 2]] - mesh.points[quads[:, k]] for k in (0, 1))
    area = diagonal[:, 0] * other[:, 1] - diagonal[:, 1] * other[:, 0]
    corners = corner_qualities(flat.points, flat.corners).reshape(-1, 4)
    expected = (corners * np.sign(area)[:, None]).min(axis=1)
    assert expected.min() < 0 < expected.max()
    apart = np.column_stack([mesh.points, np.zeros(len(mesh.points))])[quads].reshape(-1, 3)
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    both = np.concatenate([apart, apart @ turn + 5])
    report = dvr_cli.quality_report(both, {"quad": np.arange(len(both)).reshape(-1, 4)})
    assert report.mesh.surface
    np.testing.assert_allclose(report.quality.elements, np.tile(expected, 2), atol=1e-12)


def squashed_ball() -> Mesh:
    """A coarse ball one of whose vertices was pushed nearly onto the edge opposite to it."""
    ball = trimesh.creation.icosphere(subdivisions=2)
    points, triangles = np.array(ball.vertices), np.array(ball.faces)
    a, b, c = triangles[2]
    points[a] = 0.48 * (points[b] + points[c]) + 0.04 * points[a]
    points[a] /= np.linalg.norm(points[a])
    return Mesh(points, [Cells("triangle", triangles)])


def test_what_holds_the_worst_triangle_of_a_surface_is_said_with_the_options_that_help():
    """A flat triangle looks like a feature, and coarse facets leave the bound at once: both are named."""
    mesh, stopping = squashed_ball(), Stopping(max_iterations=12)
    options = SmoothOptions(directions="random", stopping=stopping)
    _, report = smooth_mesh(mesh, options)
    assert report.after.q1 < 0.2
    assert report.limited_by.kind == "shape"
    assert "features" in report.limited_by.text
    advice = report.limited_by.advice.split()
    angle, bound = (float(advice[advice.index(name) + 1]) for name in ("--feature-angle", "--max-deviation"))
    _, half = smooth_mesh(mesh, replace(options, feature_angle=angle))
    assert half.limited_by.kind == "shape"
    assert "features" not in half.limited_by.text
    assert f"--max-deviation {bound:g} " in half.limited_by.advice
    _, freed = smooth_mesh(mesh, replace(options, feature_angle=angle, max_deviation=bound))
    assert freed.after.q1 > 0.9
