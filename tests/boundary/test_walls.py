"""Walls: their thickness by a ray's hits one by one, and thin ones that stay apart."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from curved_parts import apart, distances
from dvr_cli.api.boundary import moves_of
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.boundary import walls
from dvr_cli.boundary.self_intersection import crossing_facets
from dvr_cli.boundary.walls import thickness, width
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.surface.carriers import across_of


def shell(subdivisions: int, inner: float, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Two balls one in the other, which look away from each other, with vertices shaken along them."""
    ball = trimesh.creation.icosphere(subdivisions)
    turn = trimesh.transformations.rotation_matrix(0.3, [1.0, 2.0, 3.0])[:3, :3]
    rng = np.random.default_rng(1)
    spheres = []
    for radius, frame in ((1.0, np.eye(3)), (inner, turn)):
        points = ball.vertices + rng.normal(scale=noise, size=ball.vertices.shape)
        spheres.append(radius * (points / np.linalg.norm(points, axis=1)[:, None]) @ frame.T)
    return np.concatenate(spheres), np.concatenate([ball.faces, ball.faces[:, ::-1] + len(ball.vertices)])


def hits(points: np.ndarray, triangles: np.ndarray, reach: float) -> np.ndarray:
    """(T,) the nearest hit of rays from the middle of each triangle, solved for each pair by itself."""
    result = np.full(len(triangles), np.inf)
    for i, own in enumerate(points[triangles]):
        area = np.cross(own[1] - own[0], own[2] - own[0])
        normal = area / np.linalg.norm(area)
        for j, (a, b, c) in enumerate(points[triangles]):
            if set(triangles[i]) & set(triangles[j]):
                continue
            matrix = np.stack([b - a, c - a, -normal], axis=1)
            if abs(np.linalg.det(matrix)) < 1e-12:
                continue
            u, w, way = np.linalg.solve(matrix, own.mean(axis=0) - a)
            if u >= 0 and w >= 0 and u + w <= 1 and abs(way) <= reach:
                result[[i, j]] = np.minimum(result[[i, j]], abs(way))
    return result


def curved(triangles: np.ndarray) -> np.ndarray:
    """(T,) bool, none of the triangles is in a plane that stays as it is."""
    return np.zeros(len(triangles), dtype=bool)


@pytest.mark.parametrize("reach", [0.02, 0.25, 1.0])
def test_the_thickness_is_at_most_what_one_ray_finds(reach):
    """And not much less: other rays of a triangle hit a little nearer to the bend between facets."""
    points, triangles = shell(1, 0.85)
    patch = np.repeat([0, 1], len(triangles) // 2)
    found, one_ray = (
        thickness(points, triangles, patch, curved(triangles), reach),
        hits(points, triangles, reach),
    )
    assert (found <= one_ray + 1e-12).all()
    assert np.isinf(found).all() == (reach < 0.1)
    if reach > 0.1:
        assert found.min() > 0.1
        assert found.max() < 0.21


def test_the_thickness_of_a_slab_and_a_slot():
    """Two plates, 0.01 apart, of which one covers a part of the other; a wall far away has no part in it."""
    side = np.linspace(0.0, 1.0, 9)
    x, y = (each.ravel() for each in np.meshgrid(side, side, indexing="ij"))
    number = np.arange(81).reshape(9, 9)
    corner = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    a, b, c, d = (each.ravel() for each in corner)
    plate = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    heights = np.repeat([0.0, 0.01, 0.5], 81)
    points = np.stack([np.tile(x, 3), np.tile(y, 3), heights], axis=1)
    points[81:162, 0] *= 0.5
    triangles = np.concatenate([plate, plate[:, ::-1] + 81, plate + 162])
    patch = np.repeat([0, 1, 2], len(plate))
    found = thickness(points, triangles, patch, curved(triangles), 0.1)
    middle = points[triangles].mean(axis=1)
    below = (middle[:, 2] < 0.1) & (middle[:, 0] < 0.5)
    assert found[below] == pytest.approx(0.01)
    assert np.isinf(found[middle[:, 0] > 0.51]).all()
    assert np.isinf(found[middle[:, 2] > 0.4]).all()
    assert np.array_equal(thickness(points, triangles, patch, patch == 0, 0.1), found)
    assert np.isinf(thickness(points, triangles, patch, patch < 2, 0.1)).all()  # neither of the two moves


def test_a_ball_has_no_walls():
    ball = trimesh.creation.icosphere(3)
    patch = np.zeros(len(ball.faces), dtype=int)
    assert np.isinf(thickness(ball.vertices, ball.faces, patch, curved(ball.faces), 0.05)).all()


@pytest.mark.parametrize("reach", [0.05, 0.3])
def test_what_large_cells_tell_takes_no_wall_away(reach, monkeypatch):
    """A ball that nearly touches a far larger one from within: most of the two has no wall."""
    small, large = trimesh.creation.icosphere(2, 0.4), trimesh.creation.icosphere(3, 1.0)
    points = np.concatenate([small.vertices + np.array([0.57, 0.0, 0.0]), large.vertices])
    triangles = np.concatenate([small.faces, large.faces[:, ::-1] + len(small.vertices)])
    given = points, triangles, np.repeat([0, 1], [len(small.faces), len(large.faces)]), curved(triangles)
    found = thickness(*given, reach)
    monkeypatch.setattr(walls, "_near_others", lambda corners, *_: np.arange(len(corners)))
    everywhere = thickness(*given, reach)
    assert 0 < np.isfinite(everywhere).sum() < len(triangles) // 2
    assert np.array_equal(found, everywhere)


@pytest.mark.parametrize("shape", ["shell", "ring"])
def test_walls_sought_before_there_is_a_problem_are_those_of_the_problem(shape):
    if shape == "shell":
        points, triangles = shell(2, 0.94, noise=0.04)
    else:
        points, triangles = ring(40, 0.05)
    mesh = Mesh(points, [Cells("triangle", triangles)])
    domain = domain_of(mesh)
    moves = moves_of(mesh, domain, "project", np.ones(len(points), dtype=bool), 60.0)
    how = {"freedom": moves.within, "parts": moves.parts}
    carriers = build_problem(domain.corners, moves.relaxed, domain.points, **how).carriers
    found = across_of(domain.points, moves.parts, 0.1)
    assert np.isfinite(found).any()
    assert np.array_equal(carriers.within(0.1).across, found)
    assert np.array_equal(carriers.within(0.1, found).ground.weight_at, carriers.within(0.1).ground.weight_at)


def test_thin_walls_stay_apart():
    """Where the bound is far beyond the wall's thickness, the wall comes by a third of it at most."""
    points, triangles = shell(2, 0.94, noise=0.04)
    options = SmoothOptions.of({"directions": "random", "max_deviation": 0.2, "max_iterations": 3})
    assert not crossing_facets(points, triangles).any()
    outer = len(triangles) // 2
    alone, _ = smooth_mesh(Mesh(points[: len(points) // 2], [Cells("triangle", triangles[:outer])]), options)
    after, report = smooth_mesh(Mesh(points, [Cells("triangle", triangles)]), options)
    assert (after != points).any(axis=1).mean() > 0.5

    n = len(points) // 2
    third = thickness(points, triangles, np.repeat([0, 1], outer), curved(triangles), 0.2).max() / 3.0
    assert apart(points[:n], alone, triangles[:outer]) > 1.2 * third
    assert apart(points[:n], after[:n], triangles[:outer]) < third
    assert not crossing_facets(after, triangles).any()
    assert report.boundary.deviation < third


def ring(n: int, gap: float) -> tuple[np.ndarray, np.ndarray]:
    """Points, first those of the inner of two circles in the plane, shaken along these; triangles between."""
    rng, k = np.random.default_rng(5), np.arange(n)
    angle = 2.0 * np.pi * (k + rng.uniform(-0.3, 0.3, (2, n))) / n
    radius = np.array([[1.0], [1.0 + gap]])
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=2).reshape(-1, 2)
    after = (k + 1) % n
    return points, np.concatenate([np.stack([k, k + n, after + n], 1), np.stack([k, after + n, after], 1)])


def test_the_width_of_a_channel_is_that_between_two_circles():
    points, _ = ring(200, 0.05)
    places = np.column_stack([points, np.zeros(400)])
    k = np.arange(200)
    sides = np.stack([k, (k + 1) % 200], axis=1)
    segments, curve = np.concatenate([sides, sides[:, ::-1] + 200]), np.repeat([0, 1], 200)
    assert width(places, segments, curve, 0.2) == pytest.approx(0.05, rel=0.03)
    assert np.isinf(width(places, segments, curve, 0.04)).all()


def test_the_sides_of_a_channel_in_a_plane_stay_apart(monkeypatch):
    """Each comes from the input by a third of the width at most; without the rule it would come farther."""
    points, cells = ring(24, 0.012)
    k = np.arange(24)
    sides = [np.stack([k, (k + 1) % 24], axis=1) + first for first in (0, 24)]
    mesh = Mesh(points, [Cells("triangle", cells)])
    options = SmoothOptions(boundary="project", max_deviation=0.5, engine="numpy", keep_height=False)

    def farthest() -> float:
        moved, report = smooth_mesh(mesh, options)
        assert (moved != points).any(axis=1).sum() > 12
        assert report.after.q1 >= report.before.q1
        along = np.linspace(0.0, 1.0, 41)[:, None, None]
        found = 0.0
        for here, there in ((points, moved), (moved, points)):
            for side in sides:
                a, b = here[side].swapaxes(0, 1)
                found = max(found, distances((a + along * (b - a)).reshape(-1, 2), there, side).max())
        return found

    assert 0.0 < farthest() <= 0.012 / 3.0
    monkeypatch.setattr("dvr_cli.relax.surface.carriers.width", lambda *_: np.full(48, np.inf))
    assert farthest() > 0.012 / 3.0
