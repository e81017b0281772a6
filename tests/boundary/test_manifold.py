"""Nearest points found by walking, against looking at all segments and triangles."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from curved_parts import distances, scanned
from dvr_cli.boundary.manifold import Manifold


def sphere(scale=1.0):
    ball = trimesh.creation.icosphere(subdivisions=2)
    return scale * np.array(ball.vertices), np.array(ball.faces)


def on_one(points, simplices):
    return Manifold(points, simplices, np.zeros(len(simplices), dtype=np.int64))


def distance_to(queries, corners):
    """Distance of each query to its own simplex."""
    one = np.arange(corners.shape[1])[None]
    return np.array([distances(q[None], c, one)[0] for q, c in zip(queries, corners, strict=True)])


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_a_walk_on_the_near_side_of_a_sphere_finds_the_nearest_point(scale):
    points, triangles = sphere(scale)
    rng = np.random.default_rng(0)
    queries = rng.standard_normal((200, 3))
    queries *= scale * rng.uniform(1.05, 1.5, 200)[:, None] / np.linalg.norm(queries, axis=1)[:, None]
    manifold = on_one(points, triangles)
    a, b, c = (points[column] for column in triangles.T)
    facing = np.einsum("qfd,fd->qf", queries[:, None] - a, np.cross(b - a, c - a)) > 0
    starts = np.array([rng.choice(np.flatnonzero(row)) for row in facing])
    foot, at, distance = manifold.nearest(queries, starts)
    np.testing.assert_allclose(distance, distances(queries, points, triangles), rtol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(queries - foot, axis=1), distance, rtol=1e-9)
    assert distance_to(foot, points[triangles[at]]).max() < 1e-13 * scale
    assert (at != starts).mean() > 0.5


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_foot_lies_on_its_triangle_and_none_around_it_is_nearer(seed):
    mesh = scanned(6, noise=0.05)
    triangles = mesh.cells[0].vertices
    rng = np.random.default_rng(seed)
    starts = rng.integers(0, len(triangles), 5)
    queries = mesh.points[triangles[starts, 0]] + 0.2 * rng.standard_normal((5, 3))
    foot, at, distance = on_one(mesh.points, triangles).nearest(queries, starts)
    assert distance_to(foot, mesh.points[triangles[at]]).max() < 1e-14
    assert (distance >= distances(queries, mesh.points, triangles) - 1e-14).all()
    for query, x, near in zip(queries, foot, distance, strict=True):
        holds = distance_to(np.repeat(x[None], len(triangles), axis=0), mesh.points[triangles]) < 1e-12
        assert holds.any()
        assert distances(query[None], mesh.points, triangles[holds])[0] >= near - 1e-12


@pytest.mark.parametrize("d", [2, 3])
def test_a_walk_along_a_curve(d):
    t = np.sort(np.random.default_rng(1).uniform(0, 1.5, 30))
    points = np.stack([t, np.sin(t), t * t][:d], axis=1)
    segments = np.stack([np.arange(29), np.arange(1, 30)], axis=1)[:, ::-1]
    queries = points[::3] + 0.01
    foot, at, distance = on_one(points, segments).nearest(queries, np.zeros(10, dtype=np.int64))
    np.testing.assert_allclose(distance, distances(queries, points, segments), rtol=1e-12)
    assert distance_to(foot, points[segments[at]]).max() < 1e-14


def test_walks_do_not_leave_their_patch():
    points, triangles = sphere()
    patch = (points[triangles].mean(axis=1)[:, 0] > 0).astype(np.int64)
    starts = np.flatnonzero(np.abs(points[triangles].mean(axis=1)[:, 0]) < 0.2)
    query = np.tile([1.2, 0.3, 0.1], (len(starts), 1))
    _, at, distance = Manifold(points, triangles, patch).nearest(query, starts)
    assert (patch[at] == patch[starts]).all()
    assert (at != starts).any()
    for part in (0, 1):
        least = distances(query[:1], points, triangles[patch == part])[0]
        assert distance[patch[starts] == part].min() == pytest.approx(least)


def test_degenerate_triangles_are_passed_over():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]])
    triangles = np.array([[0, 4, 2], [0, 1, 4], [1, 2, 4], [0, 4, 3], [4, 2, 3], [0, 0, 4]])
    foot, at, distance = on_one(points, triangles).nearest(np.array([[0.8, 0.5, 0.1]] * 2), np.array([0, 5]))
    np.testing.assert_allclose(foot, [[0.8, 0.5, 0]] * 2, atol=1e-12)
    np.testing.assert_allclose(distance, 0.1)
    assert at.tolist() == [2, 2]
