"""``--metric`` of commands: fields and files of every kind, reports, and one line for what is no metric."""

from __future__ import annotations

import json

import meshio
import numpy as np
import pytest

from cli_support import assert_one_line
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.relax.stopping import Stopping
from meshes import random_mesh, stretched


@pytest.mark.parametrize(
    ("suffix", "components"),
    [(".vtu", 6), (".vtu", 9), (".vtk", 6), (".vtk", 9), (".msh", 9), (".vtu", 3), (".vtk", 4)],
)
def test_fields_of_files(dvr, tmp_path, suffix, components):
    """The same tensors in every way to write them give the same mesh as those of an array."""
    flat = components < 5
    mesh = random_mesh("triangle" if flat else "tetra", 2)
    d = mesh.points.shape[1]
    _, _, tensors = stretched(mesh)
    symmetric = {3: (0, 3, 1), 6: (0, 4, 8, 1, 5, 2)}
    values = tensors.reshape(len(tensors), -1)[:, symmetric.get(components, slice(None))]
    points = np.pad(mesh.points, ((0, 0), (0, 3 - d)))
    cells = [(block.type, block.vertices) for block in mesh.cells]
    source, output = tmp_path / f"in{suffix}", tmp_path / f"out{suffix}"
    written = {".vtu": "vtu", ".vtk": "vtk42", ".msh": "gmsh22"}[suffix]
    meshio.write(source, meshio.Mesh(points, cells, {"wanted": values}), file_format=written)
    result = dvr("smooth", source, output, "--metric", "wanted", "-n", "2", "--no-report")
    assert result.code == 0
    assert "in the metric, which asks for aspects of up to" in " ".join(result.err.split())
    options = SmoothOptions(metric=tensors, stopping=Stopping(2))
    expected, _ = smooth_mesh(Mesh(points, mesh.cells), options)
    assert (abs(expected - points) > 0.01).any()
    read = meshio.read(output, file_format={".msh": "gmsh"}.get(suffix, suffix[1:]))
    assert read.points == pytest.approx(expected, abs=1e-12)


def test_reports_in_a_metric(dvr, tmp_path):
    mesh = random_mesh("triangle", 2)
    far, _, tensors = stretched(mesh)
    source, output, metric = tmp_path / "in.vtk", tmp_path / "out.vtk", tmp_path / "m.sol"
    points = np.pad(far.points, ((0, 0), (0, 1)))
    cells = [(block.type, block.vertices) for block in mesh.cells]
    meshio.write(source, meshio.Mesh(points, cells), file_format="vtk42")
    lower = tensors[:, *np.tril_indices(2)]
    rows = "\n".join(" ".join(map(repr, row)) for row in lower.tolist())
    metric.write_text(
        f"MeshVersionFormatted 2\nDimension 2\nSolAtVertices\n{len(points)}\n1 3\n{rows}\nEnd\n"
    )
    assert dvr("smooth", source, output, "--metric", metric, "-d", "random").code == 0
    record = json.loads((tmp_path / "out.quality.json").read_text())
    assert record["shape"]["mode"] == "metric"
    assert record["options"]["metric"] == str(metric)
    assert record["plain"]["after"]["min"] < record["after"]["min"]
    told = json.loads(dvr("report", "quality", output, "--json", "--metric", metric).out)
    assert told["quality"]["q1"] == pytest.approx(record["after"]["q1"], abs=1e-12)
    assert told["stretched"]["mode"] == "metric"
    assert "in the metric" in dvr("report", "quality", output, "--metric", metric).out
    better = json.loads(dvr("report", "compare", source, output, "--json", "--metric", metric).out)
    assert better["better"] == "after"
    assert dvr("report", "compare", output, source, "--metric", metric).code == 1


@pytest.mark.parametrize("content", [None, "nothing", "wrong length"])
def test_files_that_are_no_metric(dvr, tmp_path, content):
    mesh = random_mesh("triangle", 1)
    source, output, metric = tmp_path / "in.vtk", tmp_path / "out.vtk", tmp_path / "m.sol"
    points = np.pad(mesh.points, ((0, 0), (0, 1)))
    meshio.write(source, meshio.Mesh(points, [("triangle", mesh.cells[0].vertices)]), file_format="vtk42")
    if content == "wrong length":
        metric.write_text("MeshVersionFormatted 2 Dimension 2 SolAtVertices 1 1 3 1 0 1 End")
    elif content:
        metric.write_text(content)
    for command in (["smooth", source, output], ["report", "quality", source]):
        result = dvr(*command, "--metric", metric)
        assert_one_line(result, 3, "m.sol")
        assert not output.exists()


def test_a_surface_in_space_has_no_metric(dvr, tmp_path):
    """Nor has a morph, which keeps the shapes that are there."""
    mesh = random_mesh("triangle", 2)
    points = np.column_stack([mesh.points, 0.1 * np.sin(3 * mesh.points[:, 0])])
    tensors = np.tile([1.0, 2.0, 3.0, 0.0, 0.0, 0.0], (len(points), 1))
    source, output = tmp_path / "in.vtu", tmp_path / "out.vtu"
    cells = [(block.type, block.vertices) for block in mesh.cells]
    meshio.write(source, meshio.Mesh(points, cells, {"wanted": tensors}))
    for command in (["smooth", source, output], ["report", "quality", source]):
        assert_one_line(dvr(*command, "--metric", "wanted"), 3, "the planes of its cells turn")
    morph = dvr("morph", source, output, "--displacement", "wanted", "--metric", "wanted")
    assert_one_line(morph, 2, "--metric")
    assert not output.exists()
