"""``report quality`` and ``smooth`` agree on what is relaxed, and so on Q1 and fixed cap."""

from pathlib import Path

import numpy as np
import pytest

import dvr_cli
from curved_parts import PARTS, scanned, solid, surface
from dvr_cli.api.measuring import compare_meshes, mesh_quality
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.files.reading import open_mesh
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.relax.stopping import Stopping
from meshes import KINDS, delaunay, grid, random_mesh

SAMPLES = sorted(
    path
    for path in (Path(__file__).parents[2] / "sample_meshes").iterdir()
    if path.suffix not in (".py", ".md", ".png")
)
UNMOVED = SmoothOptions(stopping=Stopping(max_iterations=0), patches=False, polish=False)


def bent_sheet(angle):
    """A square in space, divided into triangles and folded along its middle by an angle in degrees."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-1, 1, 7), np.linspace(0, 1, 5), indexing="ij"))
    i, j = (a.ravel() for a in np.meshgrid(np.arange(6), np.arange(4), indexing="ij"))
    first = 5 * i + j
    cells = np.concatenate(
        [np.stack([first, first + 5, first + 6], 1), np.stack([first, first + 6, first + 1], 1)]
    )
    right = np.maximum(x, 0)
    turn = np.radians(angle)
    points = np.stack([np.minimum(x, 0) + right * np.cos(turn), y, right * np.sin(turn)], 1)
    points[1:-1, 1] += 0.01 * np.sin(np.arange(len(points) - 2))
    return Mesh(points, [Cells("triangle", cells)])


def assert_agreement(mesh):
    report, smoothed = mesh_quality(mesh), smooth_mesh(mesh, UNMOVED)[1]
    assert report.relaxed == smoothed.relaxed
    before = smoothed.before if smoothed.plain is None else smoothed.plain[0]
    for name in ("q1", "fixed_cap", "minimum", "mean", "inverted", "uncertain", "degenerate"):
        assert getattr(report.quality, name) == getattr(before, name), name
    assert np.array_equal(report.quality.vertices, before.vertices)
    assert np.array_equal(report.quality.vector, before.vector)
    assert report.mesh == smoothed.mesh
    if smoothed.plain is not None:
        assert report.relative.q1 == smoothed.before.q1
        assert report.relative.fixed_cap == smoothed.before.fixed_cap
    else:
        assert report.relative is None
    return report


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.name)
def test_on_the_sample_meshes(path):
    assert_agreement(open_mesh(path).mesh)


@pytest.mark.parametrize("name", PARTS)
def test_on_curved_parts(name):
    assert assert_agreement(surface(name)).relaxed
    assert_agreement(solid(name))


def test_on_a_scanned_surface():
    assert_agreement(scanned())


@pytest.mark.parametrize("angle", [0, 1, 20, 29, 31, 60, 120])
def test_on_a_folded_sheet(angle):
    """The fold counts as a feature, along which vertices slide, or is too weak for one."""
    mesh = bent_sheet(angle)
    assert_agreement(Mesh(mesh.points, mesh.cells))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", KINDS)
def test_on_random_meshes(kind, seed):
    assert_agreement(random_mesh(kind, seed))


def test_on_a_stretched_layer():
    """Vertices among cells that are stretched on purpose stay, so they are not relaxed."""
    points, cells = grid(12, 2)
    points[:, 1] = 0.002 * (1.5 ** (12 * points[:, 1] / points[:, 1].max()) - 1)
    report = assert_agreement(Mesh(points, [Cells("quad", cells)]))
    assert report.stretched is not None
    assert report.relaxed < 11 * 11
    assert report.relative.q1 == report.quality.q1  # no cell around these is kept
    assert report.relative.minimum > report.quality.minimum + 0.1
    assert report.record()["relative"]["q1"] == report.relative.q1


@pytest.mark.parametrize("seed", range(4))
def test_on_random_surfaces(seed):
    flat = delaunay(60, 2, seed)
    height = 0.3 * np.random.default_rng(seed).standard_normal(len(flat.points))
    assert_agreement(Mesh(np.column_stack([flat.points, height]), flat.cells))


def test_a_smoothed_surface_compares_with_its_input():
    """Relaxed are in both those vertices that could move in the input, whatever became of its features."""
    mesh = surface("sphere")
    points, report = smooth_mesh(mesh, SmoothOptions(stopping=Stopping(max_iterations=3)))
    comparison = compare_meshes([mesh, Mesh(points, mesh.cells)])
    assert comparison.before.relaxed == comparison.after.relaxed == report.relaxed
    assert comparison.better == "after"
    assert comparison.after.quality.q1 == pytest.approx(report.after.q1, abs=1e-12)


def test_through_the_python_interface():
    mesh = bent_sheet(60)
    cells = {"triangle": mesh.cells[0].vertices}
    report = dvr_cli.quality_report(mesh.points, cells)
    _, smoothed = dvr_cli.smooth(mesh.points, cells, max_iterations=0)
    assert (report.quality.q1, report.quality.fixed_cap) == (smoothed.before.q1, smoothed.before.fixed_cap)
