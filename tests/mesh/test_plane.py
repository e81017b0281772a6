"""Planar meshes, wherever they lie in space: recognised, and never left by any vertex."""

import numpy as np
import pytest

import dvr_cli
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.plane import plane_of
from meshes import random_mesh

PLANAR = ("triangle", "quad", "mixed2d")
CONSTANT = [0, 1, 2]
EPS = np.finfo(float).eps


def spread(n=50, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (n, 2))


def aligned(flat, constant, height):
    """(N, 3) points with one constant coordinate; the two others, in right-handed order, are ``flat``."""
    points = np.full((len(flat), 3), height)
    points[:, [(constant + 1) % 3, (constant + 2) % 3]] = flat
    return points


def tilt(seed):
    """(3, 3) a random rotation; its last row is the normal of the plane that the first two span."""
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return axes * np.sign(np.linalg.det(axes))


def test_planar_points_are_their_own_coordinates():
    points = spread()
    plane = plane_of(points)
    assert plane.flatten(points).tobytes() == points.tobytes()
    assert plane.lift(points, points + 1).tobytes() == (points + 1).tobytes()


@pytest.mark.parametrize("height", [0.0, -0.0, 0.1, -1e5])
@pytest.mark.parametrize("constant", CONSTANT)
def test_plane_across_a_coordinate_axis(constant, height):
    flat = spread()
    points = aligned(flat, constant, height)
    plane = plane_of(points)
    assert plane.flatten(points).tobytes() == flat.tobytes()
    assert np.cross(*plane.axes).tolist() == np.eye(3)[constant].tolist()
    assert plane.lift(points, flat + 1).tobytes() == aligned(flat + 1, constant, height).tobytes()


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("seed", range(5))
def test_tilted_plane(seed, scale):
    axes, flat = tilt(seed), scale * spread()
    points = flat @ axes[:2] + scale * seed * axes[2]
    plane = plane_of(points)
    np.testing.assert_allclose(plane.axes @ plane.axes.T, np.eye(2), atol=4 * EPS)
    np.testing.assert_allclose(plane.axes @ axes[2], 0, atol=1e-14)
    taken = plane.flatten(points)  # the same figure, turned or mirrored in its plane
    distances = np.linalg.norm(points[:, None] - points, axis=2)
    np.testing.assert_allclose(np.linalg.norm(taken[:, None] - taken, axis=2), distances, atol=1e-14 * scale)


@pytest.mark.parametrize("seed", range(5))
def test_lifted_points_lie_in_the_plane_and_unmoved_ones_keep_their_bits(seed):
    axes, flat = tilt(seed), spread()
    points = flat @ axes[:2] + seed * axes[2]
    plane = plane_of(points)
    moved = np.random.default_rng(seed).random(len(points)) < 0.5
    target = plane.flatten(points)
    target[moved] += spread(moved.sum(), seed + 1)
    lifted = plane.lift(points, target)
    assert lifted[~moved].tobytes() == points[~moved].tobytes()
    np.testing.assert_allclose(plane.flatten(lifted), target, atol=1e-14)
    np.testing.assert_allclose(lifted @ axes[2], seed, atol=1e-14)


def test_unmoved_points_keep_the_signs_of_their_zeros():
    axes = tilt(0)
    points = np.vstack([spread() @ axes[:2], [[-0.0, -0.0, -0.0]]])
    plane = plane_of(points)
    target = plane.flatten(points)
    target[0] += 1
    lifted = plane.lift(points, target)
    assert lifted[1:].tobytes() == points[1:].tobytes()
    assert (lifted[0] != points[0]).any()


@pytest.mark.parametrize("constant", CONSTANT)
def test_coordinate_that_is_constant_but_for_rounding_keeps_its_bits(constant):
    flat = spread()
    points = aligned(flat, constant, 0.3)
    points[:, constant] += 1e-10 * np.random.default_rng(1).uniform(-1, 1, len(points))
    plane = plane_of(points)
    lifted = plane.lift(points, flat + 1)
    assert lifted[:, constant].tobytes() == points[:, constant].tobytes()
    assert plane.flatten(lifted).tobytes() == (flat + 1).tobytes()


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("axes", [np.eye(3), np.eye(3)[[1, 2, 0]], tilt(3)], ids=["z", "x", "tilted"])
def test_nearly_planar_is_not_planar(axes, scale):
    rng = np.random.default_rng(0)
    points = np.column_stack([spread(), 1e-6 * rng.uniform(-1, 1, 50)]) @ axes
    assert plane_of(scale * points) is None


@pytest.mark.parametrize("points", [np.ones((3, 3)), np.outer([0, 1, 2, 5], [1.0, 2.0, -1.0])])
def test_points_that_span_no_plane_lie_in_one_all_the_same(points):
    plane = plane_of(points)
    np.testing.assert_allclose(plane.lift(points, plane.flatten(points)), points)
    np.testing.assert_allclose(plane.axes @ plane.axes.T, np.eye(2), atol=4 * EPS)


@pytest.mark.parametrize("height", [-0.0, pytest.param(0.1, marks=pytest.mark.long), 1e5])
@pytest.mark.parametrize("constant", CONSTANT)
@pytest.mark.parametrize("kind", PLANAR)
def test_smoothing_keeps_the_constant_coordinate_bit_by_bit(kind, constant, height):
    mesh = random_mesh(kind, 1)
    cells = [(block.type, block.vertices) for block in mesh.cells]
    expected, _ = dvr_cli.smooth(mesh.points, cells, max_iterations=5)
    points, report = dvr_cli.smooth(aligned(mesh.points, constant, height), cells, max_iterations=5)
    assert points.tobytes() == aligned(expected, constant, height).tobytes()
    assert report.after.q1 > report.before.q1


@pytest.mark.parametrize("offset", [0.0, 1e6])
@pytest.mark.parametrize("kind", PLANAR)
def test_smoothing_stays_in_a_tilted_plane(kind, offset):
    mesh = random_mesh(kind, 1)
    axes = tilt(7)
    points = mesh.points @ axes[:2] + offset * axes[0] / 3 - offset * axes[2]
    smoothed, report = dvr_cli.smooth(points, [(block.type, block.vertices) for block in mesh.cells])
    moved = (smoothed != points).any(axis=1)
    assert report.after.q1 > report.before.q1
    assert moved.any()
    off_plane = (smoothed - points)[moved] @ axes[2]
    assert np.abs(off_plane).max() <= 4 * EPS * max(1, offset)
    interior = domain_of(mesh).interior
    assert smoothed[~interior].tobytes() == points[~interior].tobytes()


def test_orphan_nodes_need_not_lie_in_the_plane():
    mesh = random_mesh("triangle", 1)
    points = np.vstack([aligned(mesh.points, 2, 1.0), [[0.3, 0.3, 9.0]]])
    smoothed, report = dvr_cli.smooth(points, {"triangle": mesh.cells[0].vertices})
    assert smoothed[-1].tolist() == [0.3, 0.3, 9.0]
    assert (smoothed[:-1, 2] == 1.0).all()
    assert report.mesh.dimension == 2


def test_curved_surface_is_no_planar_mesh():
    mesh = random_mesh("triangle", 1)
    for height in (0.2 * mesh.points[:, 0] ** 2, 1e-6 * mesh.points[:, 0] ** 2):
        domain = domain_of(Mesh(np.column_stack([mesh.points, height]), mesh.cells))
        assert domain.plane is None
        assert domain.is_surface
        assert domain.dimension == 2
    assert not domain_of(mesh).is_surface


def test_faces_of_a_volume_are_no_surface():
    """Triangles next to tetrahedra mark its boundary; the mesh is three-dimensional."""
    mesh = random_mesh("tetra", 1)
    faces = Cells("triangle", mesh.cells[0].vertices[:, :3])
    assert domain_of(Mesh(mesh.points, [faces, *mesh.cells])).plane is None


@pytest.mark.parametrize("turns", [5, pytest.param(20, marks=pytest.mark.long)])
@pytest.mark.parametrize("offset", [0.0, 1e6])
@pytest.mark.parametrize(("kind", "seed"), [("triangle", 2), ("quad", 1), ("mixed2d", 4)])
def test_quality_never_decreases_in_a_tilted_plane(kind, seed, offset, turns):
    """Also when nothing is left to gain, and the three coordinates of a moved vertex are rounded."""
    mesh = random_mesh(kind, seed)
    cells = [(block.type, block.vertices) for block in mesh.cells]
    axes = tilt(7)
    points = mesh.points @ axes[:2] + offset * axes[0] / 3 + offset * axes[2]
    points, _ = dvr_cli.smooth(points, cells, max_iterations=60, tol=0)
    for turn in range(turns):
        points, report = dvr_cli.smooth(points, cells, seed=turn, max_iterations=1)
        assert report.after.q1 >= report.before.q1
