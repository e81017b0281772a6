"""Unfolding: what lies folded is found and laid beside, near the input, and no feature is worn down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from curved_parts import apart, distances, wavy
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.boundary import unfolding
from dvr_cli.boundary.constraints import constraints_of, surface_constraints
from dvr_cli.boundary.gaps import frames, gaps, samples
from dvr_cli.boundary.unfolding import Unfolding, _roomiest, unfold
from dvr_cli.mesh.corners import corners_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.vector import at_least
from dvr_cli.relax.stopping import Stopping
from dvr_cli.report.text.summary import smooth_text

ANGLE = np.radians(30.0)


def unfolded(mesh: Mesh, bound: float = np.inf, held: tuple[int, ...] = ()) -> Unfolding:
    """A surface, unfolded within a bound."""
    movable = np.ones(len(mesh.points), dtype=bool)
    movable[list(held)] = False
    return unfold(mesh.points, surface_constraints(mesh, domain_of(mesh)), movable, ANGLE, bound)


def sheet(n: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """The places (2 coordinates) and triangles of a square of n by n squares of size 1."""
    side = np.arange(n + 1.0)
    places = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(places)).reshape(n + 1, n + 1)
    a, b, c, d = (x.ravel() for x in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    return places, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def signed(places: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Twice the signed areas of triangles in a plane."""
    a, b, c = places[triangles].swapaxes(0, 1)
    return (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]


def lifted(places: np.ndarray, triangles: np.ndarray) -> Mesh:
    """A planar mesh as a surface, in a plane in space in general position."""
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    turn[:, 2] = np.cross(turn[:, 0], turn[:, 1])
    # a corner pulled out of the plane makes it a surface in space
    z = np.where((places == 0).all(axis=1), 0.2, 0.0)
    return Mesh(np.column_stack([places, z]) @ turn.T, [Cells("triangle", triangles)])


def shaken_ball(seed: int, noise: float = 0.3, subdivisions: int = 2) -> Mesh:
    """A sphere whose vertices were shaken along it, by so much of an edge."""
    ball = trimesh.creation.icosphere(subdivisions)
    points = np.array(ball.vertices)
    edge = ball.edges_unique_length.mean()
    points += noise * edge * np.random.default_rng(seed).standard_normal(points.shape)
    points /= np.linalg.norm(points, axis=1)[:, None]
    return Mesh(points, [Cells("triangle", np.array(ball.faces))])


def inward(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T,) bool, the triangles of a sphere around the origin whose normals point to its middle."""
    a, b, c = points[triangles].swapaxes(0, 1)
    return (np.cross(b - a, c - a) * (a + b + c)).sum(axis=1) < 0


def test_only_what_is_near_a_vertex_that_moved_is_looked_at_again(monkeypatch):
    ball = trimesh.creation.icosphere(3)
    noise = 0.4 * ball.edges_unique_length.mean() * np.random.default_rng(5).normal(size=ball.vertices.shape)
    mesh = Mesh(ball.vertices + noise, [Cells("triangle", np.array(ball.faces))])
    near = unfolded(mesh)
    assert len(near.folded) > len(near.left) > 0
    assert (near.points != mesh.points).any(axis=1).sum() > 10
    monkeypatch.setattr(unfolding, "_REACH", 100)  # all of it
    everywhere = unfolded(mesh)
    assert near.points.tobytes() == everywhere.points.tobytes()
    assert near.left.tolist() == everywhere.left.tolist()


def test_a_vertex_pushed_over_an_edge_comes_back():
    places, triangles = sheet()
    places[14] += [1.3, 0.2]
    over = signed(places, triangles) < 0
    assert over.sum() >= 1
    mesh = lifted(places, triangles)
    result = unfolded(mesh)
    assert {frozenset(t) for t in result.folded.tolist()} == {frozenset(t) for t in triangles[over].tolist()}
    assert not len(result.left)
    assert result.off.max() < 1e-12
    normal = np.cross(mesh.points[8] - mesh.points[7], mesh.points[13] - mesh.points[7])
    a, b, c = result.points[triangles].swapaxes(0, 1)
    side = (np.cross(b - a, c - a) * normal).sum(axis=1)
    assert (side * np.sign(np.median(side)) > 0).all()


@settings(max_examples=30, deadline=None)
@given(st.integers(3, 8), st.integers(0, 10_000))
def test_the_roomiest_place_is_that_of_a_linear_programme(k, seed):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, k))
    if np.diff(angle, append=angle[0] + 2 * np.pi).max() > 3.0:
        angle = np.linspace(0, 2 * np.pi, k, endpoint=False)
    ends = rng.uniform(0.3, 2.0, k)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    ends += rng.uniform(-2, 2, 2)
    p, q = ends, np.roll(ends, -1, axis=0)
    place, room, now = _roomiest(p[None], q[None])
    along = (q - p) / np.linalg.norm(q - p, axis=1)[:, None]
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    offset = (normal * p).sum(axis=1)
    best = linprog([0, 0, -1], np.column_stack([-normal, np.ones(k)]), -offset, bounds=[(None, None)] * 3)
    assert room[0] == pytest.approx(best.x[2], abs=1e-8)
    assert (normal @ place[0] - offset).min() == pytest.approx(room[0], abs=1e-9)
    assert now[0] == pytest.approx((-offset).min())


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 10_000))
def test_a_ball_is_unfolded_within_the_bound(seed):
    mesh = shaken_ball(seed, 0.3, 1)
    triangles = mesh.cells[0].vertices
    result = unfolded(mesh, bound=0.2)
    assert result.off.max() <= 0.2
    assert apart(mesh.points, result.points, triangles) <= result.off.max() + 1e-12
    still = {frozenset(t) for t in result.left.tolist()}
    assert (mesh.points != result.points).any() or len(still) == len(result.folded)


def test_folds_of_shaken_balls_are_unfolded():
    found = 0
    for seed in range(8):
        mesh = shaken_ball(seed, 0.25)
        found += inward(mesh.points, mesh.cells[0].vertices).sum()
        assert not inward(unfolded(mesh).points, mesh.cells[0].vertices).any()
    assert found > 10


def test_gaps_are_distances_straight_up_and_down_and_bound_the_nearest():
    rng = np.random.default_rng(2)
    places, triangles = sheet(3)
    low = np.column_stack([places, 0.1 * rng.standard_normal(len(places))])
    high = low + np.array([0, 0, 0.25])
    frame = frames(np.array([[0.0, 0.0, 1.0]]))
    points = samples(high[triangles]).reshape(-1, 3)
    zero = np.zeros(len(points), dtype=np.int64)
    found = gaps(points, zero, low[triangles], np.zeros(len(triangles), dtype=np.int64), frame)
    np.testing.assert_allclose(found, 0.25, atol=1e-12)
    assert (found >= distances(points, low, triangles) - 1e-12).all()
    far = gaps(points[:1] + 50.0, zero[:1], low[triangles], zero[: len(triangles)], frame)
    assert np.isinf(far).all()


def test_beyond_the_bound_nothing_moves_and_what_is_left_is_named():
    mesh = shaken_ball(3)
    assert inward(mesh.points, mesh.cells[0].vertices).any()
    result = unfolded(mesh, bound=1e-9)
    assert np.array_equal(result.points, mesh.points)
    assert np.array_equal(result.left, result.folded)
    assert result.off.max() == 0


@pytest.mark.parametrize("shape", ["cube", "crease", "step"])
def test_features_lie_not_folded(shape):
    if shape == "cube":
        box = trimesh.creation.box().subdivide().subdivide()
        mesh = Mesh(np.array(box.vertices), [Cells("triangle", np.array(box.faces))])
    elif shape == "crease":
        mesh = wavy(4, 1, crease=True)
    else:  # a riser between two terraces, lower than it is long
        places, triangles = sheet(6)
        x = places[:, 0]
        points = np.column_stack([np.where(x > 3, x - 0.999, x), places[:, 1], 0.05 * (x > 3)])
        mesh = Mesh(points, [Cells("triangle", triangles)])
    result = unfolded(mesh)
    assert not len(result.folded)
    assert np.array_equal(result.points, mesh.points)


def test_vertices_on_a_crease_stay():
    mesh = wavy(3, 1, crease=True)
    on_crease = np.flatnonzero(np.isclose(mesh.points[:, 0], 0.5))
    n = 7
    inner = 4 * n + 3  # beside the crease: push it over the next one
    points = mesh.points.copy()
    points[inner] += 1.4 * (points[inner + n] - points[inner])
    result = unfolded(Mesh(points, mesh.cells))
    assert len(result.folded)
    assert np.array_equal(result.points[on_crease], points[on_crease])
    assert not len(result.left)


def test_a_held_vertex_stays():
    places, triangles = sheet()
    places[14] += [1.3, 0.2]
    mesh = lifted(places, triangles)
    result = unfolded(mesh, held=tuple(range(len(places))))
    assert np.array_equal(result.points, mesh.points)
    assert len(result.left) == len(result.folded) > 0


def fan_of_tetrahedra(points: np.ndarray, triangles: np.ndarray) -> Mesh:
    """The ball within a surface around the origin, each triangle with the middle."""
    middle = np.full((len(triangles), 1), len(points))
    cells = np.concatenate([triangles, middle], axis=1)
    return Mesh(np.concatenate([points, np.zeros((1, 3))]), [Cells("tetra", cells)])


def test_in_a_volume_a_fold_is_undone_if_a_cell_gets_worse():
    ball = shaken_ball(0, 0.0, 1)
    points, triangles = ball.points.copy(), ball.cells[0].vertices
    a, b, c = triangles[3]
    points[a] = 0.6 * (points[b] + points[c]) - 0.2 * points[a]
    points[a] /= np.linalg.norm(points[a])
    assert inward(points, triangles).any()
    mesh = fan_of_tetrahedra(points, triangles)
    domain = domain_of(mesh)
    everything = np.ones(len(mesh.points), dtype=bool)
    how = constraints_of(mesh, domain), everything, ANGLE, 1.0
    result = unfold(domain.points, *how, domain.corners)
    assert not len(result.left)
    assert not inward(result.points, triangles).any()
    # one more cell, on the near side of a plane between the places where the vertex was and where it is now
    way = result.points[a] - points[a]
    across = np.linalg.svd(way[None])[2][1:]
    base = points[a] + 0.3 * way + np.array([[1.0, 0.0], [-0.5, 0.8], [-0.5, -0.8]]) @ across
    more = np.concatenate([domain.points, base])
    cell = np.array([[a, *range(len(domain.points), len(more))]])
    for order in ([0, 1, 2, 3], [0, 2, 1, 3]):
        corners = corners_of([Cells("tetra", cell[:, order])], 3)
        if corner_qualities(more, corners)[0] > 0:
            fixed = np.ones(len(more), dtype=bool)
            fixed[: len(domain.points)] = how[0].fixed
            undone = unfold(
                more, replace(how[0], fixed=fixed), np.ones(len(more), dtype=bool), *how[2:], corners
            )
            assert np.array_equal(undone.points, more)
            assert len(undone.left) == len(undone.folded) > 0
            break
    else:
        pytest.fail("neither cell is positive")


def test_a_run_unfolds_first_and_says_so():
    mesh = shaken_ball(11, 0.3, 1)
    triangles = mesh.cells[0].vertices
    options = SmoothOptions(max_deviation=0.3, feature_angle=60.0, stopping=Stopping(max_iterations=2))
    points, report = smooth_mesh(mesh, options)
    assert report.phases[0].record()["phase"] == "unfold"
    assert report.unfolding.found >= inward(mesh.points, triangles).sum() > 0
    assert not inward(points, triangles).any()
    assert at_least(report.after.vector, report.before.vector)
    assert apart(mesh.points, points, triangles) <= report.boundary.deviation <= 0.3
    assert f"unfolded {report.unfolding.found} folded triangle" in smooth_text(report, "a", "b")
