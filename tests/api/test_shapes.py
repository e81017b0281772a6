"""Boundary layers made by Gmsh keep their heights while the rest improves, and when the wall moves."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache

import meshio
import numpy as np
import pytest

import dvr_cli
from dvr_cli.api.away_from_layers import weighted, weights_needed
from dvr_cli.api.measuring import compare_meshes, mesh_quality
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.measure import measure
from dvr_cli.quality.vector import at_least
from meshes import KINDS, delaunay, random_mesh
from needs import require

require("gmsh")
import gmsh_layers  # noqa: E402

LAYERED = {
    "cylinder, quads": lambda: gmsh_layers.around_cylinder(quads=True),
    "cylinder, triangles": lambda: gmsh_layers.around_cylinder(quads=False),
    "aerofoil, quads": lambda: gmsh_layers.around_aerofoil(quads=True),
    "aerofoil, triangles": lambda: gmsh_layers.around_aerofoil(quads=False),
    **{
        f"box, {kind}{', bump' * bump}": lambda kind=kind, bump=bump: gmsh_layers.extruded(kind, bump=bump)
        for kind in ("wedge", "hexahedron", "tetra")
        for bump in (False, True)
    },
}


@cache
def layered(name: str) -> Mesh:
    return LAYERED[name]()


def wall_of(name: str) -> np.ndarray:
    """(N,) bool: the vertices on the wall that carries the layers."""
    if name.startswith("box"):
        return gmsh_layers.extruded(name.split(", ")[1]).points[:, 2] < 1e-9
    mesh = layered(name)
    edges = Counter(
        frozenset((int(row[i - 1]), int(row[i])))
        for block in mesh.cells
        for row in block.vertices
        for i in range(len(row))
    )
    wall = np.zeros(len(mesh.points), dtype=bool)
    wall[[v for edge, n in edges.items() if n == 1 for v in edge]] = True
    return wall & (np.abs(mesh.points).max(axis=1) < 1.5)


def first_off_the_wall(mesh: Mesh, wall: np.ndarray) -> dict[int, int]:
    """For each vertex of the wall the nearest other vertex of its cells."""
    nearest: dict[int, tuple[float, int]] = {}
    for block in mesh.cells:
        for row in block.vertices[wall[block.vertices].any(axis=1)]:
            for v in row[wall[row]]:
                for u in row[~wall[row]]:
                    distance = float(np.linalg.norm(mesh.points[v] - mesh.points[u]))
                    nearest[v] = min(nearest.get(v, (np.inf, 0)), (distance, u))
    return {v: u for v, (_, u) in nearest.items()}


@pytest.mark.parametrize("name", LAYERED)
def test_layers_keep_their_height_and_direction(name):
    mesh = layered(name)
    points, report = smooth_mesh(mesh, SmoothOptions())
    assert report.shape.kept > 50
    assert report.shape.max_aspect > 15
    pairs = first_off_the_wall(mesh, wall_of(name))
    one, other = np.array(list(pairs)), np.array(list(pairs.values()))
    before, after = mesh.points[other] - mesh.points[one], points[other] - points[one]
    ratio = np.linalg.norm(after, axis=1) / np.linalg.norm(before, axis=1)
    assert 0.97 <= np.median(ratio) <= 1.03
    assert ratio.min() >= 0.9
    assert ratio.max() <= 1.1
    cosine = (before * after).sum(axis=1) / np.linalg.norm(before, axis=1) / np.linalg.norm(after, axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() <= 1.0
    assert report.plain is not None
    kept = report.kept
    assert kept is not None
    inside = np.zeros(len(points), dtype=bool)
    at = 0
    for block in mesh.cells:
        inside[block.vertices[kept[at : at + len(block.vertices)]]] = True
        at += len(block.vertices)
    assert points[inside].tobytes() == mesh.points[inside].tobytes()
    rest = ~kept
    old, new = (quality.elements for quality in report.plain)
    if report.relaxed:
        assert new[rest].min() >= old[rest].min()
        assert new[rest].mean() >= old[rest].mean()
        assert report.after.q1 >= report.before.q1
        assert report.after.elements[rest].mean() >= report.before.elements[rest].mean()
    assert at_least(report.after.vector, report.before.vector)
    for away in away_from(mesh, kept):
        assert new[away].min(initial=1.0) >= old[away].min(initial=1.0)


def away_from(mesh: Mesh, kept: np.ndarray) -> list[np.ndarray]:
    """Two sets (n,) bool: cells without a vertex of ``kept`` ones, and those without one of all others."""
    cells = [set(row.tolist()) for block in mesh.cells for row in block.vertices]
    near = set().union(*(cell for cell, keeps in zip(cells, kept.tolist(), strict=True) if keeps))
    first = np.array([not cell & near for cell in cells])
    beside = set().union(*(cell for cell, away in zip(cells, first.tolist(), strict=True) if not away))
    return [first, np.array([not cell & beside for cell in cells])]


@pytest.mark.parametrize("make", [gmsh_layers.behind_step, LAYERED["box, wedge"]])
def test_the_worst_cell_away_from_layers_is_no_worse(make, monkeypatch):
    """Here it would be, were the run not made again."""
    mesh = make()
    for rule in (True, False):
        if not rule:
            monkeypatch.setattr("dvr_cli.api.away_from_layers.weights_needed", lambda *_: None)
        _, report = smooth_mesh(mesh, SmoothOptions())
        assert report.plain is not None
        old, new = (quality.elements for quality in report.plain)
        fell = [new[away].min() < old[away].min() for away in away_from(mesh, report.kept)]
        assert any(fell) == (not rule)
        assert at_least(report.after.vector, report.before.vector)
        assert report.after.q1 > report.before.q1
        assert new[~report.kept].mean() >= old[~report.kept].mean()


def test_weights_divide_qualities():
    domain = domain_of(random_mesh("wedge", 3, n=3))
    weight = np.random.default_rng(0).uniform(1.0, 2.0, len(domain.cell_ids))
    weight[::3] = 1.0
    plain, heavier = domain.corners, weighted(domain.corners, weight)
    quality = corner_qualities(domain.points, plain) / np.repeat(weight, np.diff(plain.start))
    np.testing.assert_allclose(corner_qualities(domain.points, heavier), quality, rtol=1e-12)
    for place in range(4):  # whichever vertex of a corner is the origin of its edges
        ratio = (
            heavier.table.curvature[heavier.shapes[:, place]] / plain.table.curvature[plain.shapes[:, place]]
        )
        np.testing.assert_allclose(ratio, np.repeat(weight, np.diff(plain.start)), rtol=1e-12)


def test_a_run_with_weights_that_lowers_the_vector_is_made_without():
    domain = domain_of(random_mesh("triangle", 3, n=8))
    kept = np.arange(len(domain.cell_ids)) == 0
    before = measure(domain, domain.points, np.flatnonzero(domain.interior))
    assert weights_needed(domain, kept, before, before, None) is None
    points = domain.points.copy()
    points[before.vertices[-1]] += 0.2
    after = measure(domain, points, np.flatnonzero(domain.interior))
    weight = weights_needed(domain, kept, before, after, None)
    assert weight is not None
    assert weight.min() == 1.0
    assert weight.max() > 1.0
    assert weights_needed(domain, kept, before, before, weight) is None
    better = replace(after, vector=before.vector)  # but for cells away from layers
    more = weights_needed(domain, kept, before, better, weight)
    assert more is not None
    assert (before.elements / more)[more > 1.0].min() == pytest.approx(before.q1)
    assert weights_needed(domain, kept, before, better, more) is None
    again = weights_needed(domain, kept, before, after, weight)
    assert again is not None
    assert (again == 1.0).all()
    assert weights_needed(domain, kept, before, after, again) is None
    tangled = replace(before, q1=-0.5)
    assert weights_needed(domain, kept, tangled, after, None) is None


def test_the_mean_of_the_others_is_not_paid_for_their_worst(monkeypatch):
    """Here sweeps and patches cost more than polishing down to the first level of care brings back."""
    mesh = gmsh_layers.behind_step()
    points, report = smooth_mesh(mesh, SmoothOptions())
    kept, plain = report.kept, report.plain
    assert kept is not None
    assert plain is not None
    before, after = (quality.elements[~kept] for quality in plain)
    assert after.mean() >= before.mean()
    assert after.min() >= before.min()
    assert report.after.q1 > report.before.q1 + 0.1
    for block in mesh.cells:
        inner = np.unique(block.vertices[kept[: len(block.vertices)]])
        assert points[inner].tobytes() == mesh.points[inner].tobytes()
    monkeypatch.setattr("dvr_cli.api.phases.Run._costs_mean", lambda self, outcome: False)
    monkeypatch.setattr("dvr_cli.api.away_from_layers.weights_needed", lambda *_: None)
    _, report = smooth_mesh(mesh, SmoothOptions())
    assert report.plain is not None
    assert report.plain[1].elements[~kept].mean() < before.mean()


def test_with_ideal_targets_the_first_layer_is_lost():
    """What the default prevents; and the record says which was asked for."""
    name = "cylinder, quads"
    points, report = smooth_mesh(layered(name), SmoothOptions(shape="ideal"))
    pairs = first_off_the_wall(layered(name), wall_of(name))
    one, other = np.array(list(pairs)), np.array(list(pairs.values()))
    height = np.linalg.norm(points[other] - points[one], axis=1)
    assert np.median(height) > 3 * 0.003
    assert report.record()["shape"] == {"mode": "ideal", "kept": 0, "max_aspect": 1.0}
    assert report.record()["options"]["shape"] == "ideal"
    assert report.record()["plain"] is None


@pytest.mark.parametrize("boundary", ["slide", "project"])
def test_layers_stay_where_the_boundary_moves(boundary):
    mesh = layered("box, wedge")
    points, report = smooth_mesh(mesh, SmoothOptions(boundary=boundary, max_deviation=0.01))
    low = mesh.points[:, 2] < 0.01
    assert points[low].tobytes() == mesh.points[low].tobytes()
    assert report.shape.kept


ISOTROPIC = {
    **{kind: lambda kind=kind: random_mesh(kind, 7) for kind in KINDS},
    "graded 1 : 100": gmsh_layers.graded,
    "points in the plane": lambda: delaunay(300, 2, 0),
    "points in space": lambda: delaunay(150, 3, 0),
}


@pytest.mark.parametrize("name", ISOTROPIC)
def test_nothing_kept_gives_the_bits_of_ideal(name):
    mesh = ISOTROPIC[name]()
    one, report = smooth_mesh(mesh, SmoothOptions(patches=False))
    two, _ = smooth_mesh(mesh, SmoothOptions(patches=False, shape="ideal"))
    assert one.tobytes() == two.tobytes()
    assert report.shape.kept == 0
    assert report.plain is None


@pytest.mark.parametrize(
    "name",
    [
        "cylinder, quads",
        *(pytest.param(n, marks=pytest.mark.long) for n in ("aerofoil, triangles", "box, tetra, bump")),
    ],
)
def test_engines_and_threads_give_the_same_bits(name):
    require("numba")
    options = {"directions": "steepest,random,optimal", "max_iterations": 3, "polish": True, "patches": True}
    results = [
        smooth_mesh(layered(name), SmoothOptions.of({**options, "engine": engine, "threads": threads}))[0]
        for engine, threads in (("numpy", 1), ("numba", 1), ("numba", 2))
    ]
    assert results[0].tobytes() == results[1].tobytes() == results[2].tobytes()


@pytest.mark.parametrize("name", ["cylinder, triangles", "box, hexahedron, bump"])
def test_the_vector_relative_to_the_targets_never_decreases(name):
    """After every sweep, measured from outside the engine."""
    from dvr_cli.api.shapes import shaped
    from dvr_cli.relax.directions import random_field
    from dvr_cli.relax.engines.choice import KINDS as ENGINES
    from dvr_cli.relax.problem import build_problem

    plain = domain_of(layered(name))
    shapes = shaped(plain, "auto")
    domain = shapes.domain
    relaxed = np.flatnonzero(domain.interior & ~shapes.held)
    if not len(relaxed):
        pytest.fail("the mesh should have vertices to relax")
    engine = ENGINES["numpy"].make(build_problem(domain.corners, relaxed, domain.points), 1)
    engine.load(domain.points)
    field = random_field(domain.dimension, 0)
    before = measure(domain, domain.points, relaxed).vector
    for sweep in range(4):
        directions = field(sweep, engine.relaxed_points, engine.problem.relaxed)
        for batch in range(engine.batches):
            engine.relax_batch(batch, directions)
        after = measure(domain, engine.points, relaxed).vector
        assert at_least(after, before)
        before = after


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", ["ideal", "auto", "input"])
def test_qualities_found_with_the_targets_are_those_that_reports_measure(kind, shape):
    from dvr_cli.api.shapes import shaped

    mesh = random_mesh(kind, 3, noise=0.4)
    shapes = shaped(domain_of(mesh), shape)
    for domain, known in ((shapes.domain, shapes.own_quality), (shapes.plain, shapes.quality)):
        expected = corner_qualities(mesh.points, domain.corners)
        assert known is None or known.tobytes() == expected.tobytes()
    assert (shapes.own_quality is None) == (shape != "auto")


def test_qualities_of_a_surface_have_no_sign_to_hand_on():
    from dvr_cli.api.shapes import shaped

    mesh = random_mesh("triangle", 3)
    bent = Mesh(np.column_stack([mesh.points, mesh.points[:, 0] ** 2]), mesh.cells)
    assert shaped(domain_of(bent), "auto").quality is None


def test_reports_name_what_is_stretched():
    mesh = layered("cylinder, quads")
    report = mesh_quality(mesh)
    assert report.stretched is not None
    assert report.stretched.kept > 100
    assert report.record()["stretched"]["kept"] == report.stretched.kept
    assert mesh_quality(random_mesh("triangle", 0)).stretched is None


def test_a_comparison_takes_the_targets_of_the_first_mesh():
    mesh = layered("cylinder, quads")
    kept, _ = smooth_mesh(mesh, SmoothOptions())
    blown, _ = smooth_mesh(mesh, SmoothOptions(shape="ideal"))
    assert compare_meshes([mesh, Mesh(kept, mesh.cells)]).better == "after"
    assert compare_meshes([mesh, Mesh(blown, mesh.cells)]).better == "before"


def moved_body(name: str, move, shape="input") -> tuple[np.ndarray, np.ndarray, Mesh, np.ndarray]:
    """A morphed mesh: points, ratios of first heights, the mesh, its new minimum over corners."""
    mesh = layered(name)
    wall = wall_of(name)
    shift = np.zeros_like(mesh.points)
    shift[wall] = move(mesh.points[wall]) - mesh.points[wall]
    from dvr_cli.api.morphing import morph_mesh

    options = SmoothOptions.of({"directions": "random", "shape": shape}, patches=False, polish=False)
    points, _ = morph_mesh(mesh, shift, options)
    pairs = first_off_the_wall(mesh, wall)
    one, other = np.array(list(pairs)), np.array(list(pairs.values()))
    before = np.linalg.norm(mesh.points[other] - mesh.points[one], axis=1)
    after = np.linalg.norm(points[other] - points[one], axis=1)
    domain = domain_of(mesh)
    return points, after / before, mesh, corner_qualities(points, domain.corners)


@pytest.mark.parametrize("name", ["cylinder, quads", "cylinder, triangles"])
def test_a_cylinder_moved_by_half_its_diameter_keeps_its_layers(name):
    _, ratio, _, quality = moved_body(name, lambda x: x + np.array([0.5, 0.0]))
    assert quality.min() > 0
    assert np.abs(ratio - 1).max() <= 0.05


def test_layers_go_along_where_only_they_are_kept():
    """With auto no cell of a layer is measured, as none moves in a smoothing; in a morph they do move."""
    _, ratio, _, quality = moved_body("cylinder, quads", lambda x: x + np.array([0.5, 0.0]), "auto")
    assert quality.min() > 0
    assert np.abs(ratio - 1).max() <= 0.05


@pytest.mark.parametrize("name", ["aerofoil, quads", "aerofoil, triangles"])
def test_an_aerofoil_turned_by_ten_degrees_keeps_its_layers(name):
    c, s = np.cos(np.radians(10)), np.sin(np.radians(10))
    _, ratio, _, quality = moved_body(name, lambda x: x @ np.array([[c, s], [-s, c]]))
    assert quality.min() > 0
    assert np.abs(ratio - 1).max() <= 0.05


def test_a_relaxer_keeps_the_shapes_of_its_first_mesh_when_displaced():
    mesh = layered("cylinder, quads")
    wall = wall_of("cylinder, quads")
    shift = np.where(wall[:, None], [0.02, 0.0], 0.0)
    cells = [(block.type, block.vertices) for block in mesh.cells]
    relaxer = dvr_cli.Relaxer(meshio.Mesh(mesh.points, cells))
    for _ in range(3):
        points, report = relaxer.relax(displacement=shift)
    assert report.q1_after > 0.7
    pairs = first_off_the_wall(mesh, wall)
    one, other = np.array(list(pairs)), np.array(list(pairs.values()))
    ratio = np.linalg.norm(points[other] - points[one], axis=1) / np.linalg.norm(
        mesh.points[other] - mesh.points[one], axis=1
    )
    assert np.abs(ratio - 1).max() < 0.05


def test_the_presets_of_the_paper_have_ideal_shapes():
    assert SmoothOptions(preset="paper").shape == "ideal"
    with pytest.raises(dvr_cli.errors.UsageError, match="shape"):
        SmoothOptions(preset="paper", shape="input")
