"""Metrics: the same problem in another space gives the same figures; what is no metric is refused."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

import dvr_cli
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.errors import InputError, UsageError
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.vector import at_least
from dvr_cli.relax.stopping import Stopping
from meshes import KINDS, random_mesh, random_tensors, stretched, tangled


def assert_same_figures(got, expected, tolerance):
    for one, other in ((got.before, expected.before), (got.after, expected.after)):
        assert one.q1 == pytest.approx(other.q1, abs=tolerance)
        assert one.mean == pytest.approx(other.mean, abs=tolerance)
        assert one.vector == pytest.approx(other.vector, abs=tolerance)
        assert one.elements == pytest.approx(other.elements, abs=tolerance)
        assert (one.inverted, one.degenerate) == (other.inverted, other.degenerate)


@pytest.mark.parametrize("kind", KINDS)
def test_a_stretched_mesh_in_its_metric_gives_the_figures_of_the_mesh(kind):
    """Along the same directions in the same order every step is the same, to rounding."""
    mesh = random_mesh(kind, 3)
    far, by, tensors = stretched(mesh)
    directions = np.random.default_rng(1).normal(size=(3, *mesh.points.shape))
    options = {"max_iterations": 6, "tol": 0.0, "order": "natural"}
    plain = {**options, "directions": directions, "shape": "ideal"}
    points, expected = smooth_mesh(mesh, SmoothOptions.of(plain))
    moved, report = smooth_mesh(
        far, SmoothOptions.of({**options, "directions": directions @ by.T, "metric": tensors})
    )
    assert_same_figures(report, expected, 1e-7)
    assert moved == pytest.approx(points @ by.T, abs=1e-6)
    assert report.after.q1 > report.before.q1 + 0.01
    assert report.plain is not None
    assert report.plain[0].mean < report.before.mean
    assert report.shape.mode == "metric"
    assert report.shape.max_aspect == pytest.approx(np.linalg.cond(by))


@pytest.mark.parametrize(("kind", "n"), [("triangle", 5), ("tetra", 3), ("hexahedron", 3)])
def test_untangling_in_a_metric(kind, n):
    far, _, tensors = stretched(tangled(kind, n, 0.9, 1))
    _, report = smooth_mesh(far, SmoothOptions(untangle=True, metric=tensors))
    assert report.before.inverted > 0
    assert report.after.inverted == 0


@pytest.mark.parametrize(
    ("kind", "sweeps"),
    [*((kind, 6) for kind in KINDS), *(pytest.param(k, 100, marks=pytest.mark.long) for k in KINDS[:3])],
)
def test_a_metric_that_changes_from_vertex_to_vertex_keeps_the_guarantee(kind, sweeps):
    """In all phases, polishing included."""
    mesh = random_mesh(kind, 5)
    tensors = random_tensors(len(mesh.points), mesh.points.shape[1], 4)
    options = SmoothOptions(metric=tensors, patches=True, polish=True, stopping=Stopping(sweeps))
    points, report = smooth_mesh(mesh, options)
    assert {sweep["phase"] for sweep in report.sweeps} == {"descent", "relax", "patches", "polish"}
    assert at_least(report.after.vector, report.before.vector)
    assert report.after.q1 > report.before.q1
    told = dvr_cli.quality_report(points, {b.type: b.vertices for b in mesh.cells}, metric=tensors)
    assert told.quality.vector.tobytes() == report.after.vector.tobytes()
    assert told.quality.mean == report.after.mean


def test_a_metric_of_one_mesh_says_nothing_about_another():
    one, other = (
        meshio.Mesh(mesh.points, [(block.type, block.vertices) for block in mesh.cells])
        for mesh in (random_mesh("triangle", 1), random_mesh("triangle", 2))
    )
    tensors = np.tile(np.eye(2), (len(one.points), 1, 1))
    assert dvr_cli.compare(one, one, metric=tensors).component is None
    with pytest.raises(InputError, match="cells differ"):
        dvr_cli.compare(one, other, metric=tensors)


@pytest.mark.parametrize("kind", ["triangle", "tetra", "hexahedron"])
def test_curved_boundaries_move_in_a_metric(kind):
    """Of a bent mesh, in all phases; the vector of the quality in the metric does not decrease."""
    mesh = random_mesh(kind, 3, n=3)
    points = mesh.points.copy()
    points[:, -1] += 0.2 * np.sin(2.0 * points[:, 0])
    bent, d = Mesh(points, mesh.cells), points.shape[1]
    tensors = np.diag([4.0, 1.0, 2.0][:d]) + 0.1 * random_tensors(len(points), d, 1)
    options = SmoothOptions(
        metric=tensors, boundary="project", patches=True, polish=True, stopping=Stopping(6)
    )
    _, report = smooth_mesh(bent, options)
    _, held = smooth_mesh(bent, SmoothOptions(metric=tensors, stopping=Stopping(0)))
    assert report.relaxed > held.relaxed
    assert at_least(report.after.vector, report.before.vector)
    assert report.after.q1 > report.before.q1


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        (np.ones(30), "metric m: scalars are sizes"),
        (np.ones((30, 2)), "metric m: 2 components"),
        (np.full((30, 3), [1.0, 1.0, 2.0]), "not positive definite"),
        (np.full((30, 3), [1.0, np.nan, 0.0]), "not finite"),
    ],
)
def test_fields_that_are_no_metric(values, fault):
    mesh = random_mesh("triangle", 1)
    given = meshio.Mesh(mesh.points, [("triangle", mesh.cells[0].vertices)], {"m": values})
    with pytest.raises(InputError, match=fault):
        dvr_cli.smooth(given, metric="m")


def test_what_a_metric_excludes():
    tensors = np.tile(np.eye(2), (30, 1, 1))
    with pytest.raises(UsageError, match="shape input"):
        SmoothOptions(metric=tensors, shape="input")
    with pytest.raises(UsageError, match="metric"):
        dvr_cli.Relaxer(np.zeros((3, 2)), {"triangle": np.array([[0, 1, 2]])}, metric=tensors)
    assert SmoothOptions(metric=tensors, preset="paper").record()["metric"] == "array(30, 2, 2)"
