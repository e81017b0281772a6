"""What n elements around a vertex or an edge can be at best: closed forms against elements and searches."""

from itertools import combinations
from math import pi

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dvr_cli.mesh.mesh import Cells
from dvr_cli.quality.fans import best_quad, best_tetra_at_edge, best_tetra_at_vertex, best_triangle, fans
from meshes import delaunay, hexagon, random_mesh
from oracle import element_quality, mean_ratio

COORDINATE = st.floats(-1, 1)


def angle(a, b):
    return np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1, 1))


def dihedral_angle(p, i, j):
    """Between the parts of the edges to the two other vertices perpendicular to the edge from i to j."""
    along = (p[j] - p[i]) / np.linalg.norm(p[j] - p[i])
    k, m = set(range(4)) - {i, j}
    return angle(*(e - (e @ along) * along for e in (p[k] - p[i], p[m] - p[i])))


def solid_angle(p, i):
    """Girard: what the dihedral angles at the edges of vertex i have beyond π."""
    return sum(dihedral_angle(p, i, j) for j in range(4) if j != i) - pi


def positive(p):
    p = p if np.linalg.det(p[1:] - p[0]) > 0 else p[[1, 0, *range(2, len(p))]]
    assume(np.linalg.det(p[1:] - p[0]) > 1e-6)
    return p


@given(arrays(float, (3, 2), elements=COORDINATE))
def test_no_triangle_is_better_than_its_angles_allow(p):
    p = positive(p)
    for i in range(3):
        a = angle(p[i - 1] - p[i], p[i - 2] - p[i])
        assert mean_ratio(p) <= best_triangle(a) + 1e-9


@given(arrays(float, (4, 3), elements=COORDINATE))
def test_no_tetrahedron_is_better_than_its_angles_allow(p):
    p = positive(p)
    for i, j in combinations(range(4), 2):
        assert mean_ratio(p) <= best_tetra_at_edge(dihedral_angle(p, i, j)) + 1e-9
    for i in range(4):
        assert mean_ratio(p) <= best_tetra_at_vertex(solid_angle(p, i)) + 1e-9


@pytest.mark.parametrize("a", np.linspace(0.05, 3.1, 9))
def test_what_an_angle_allows_is_reached(a):
    """By a triangle with equal sides, a rhombus, and two tetrahedra found by searching one parameter."""
    c, s = np.cos(a), np.sin(a)
    assert best_triangle(a) == pytest.approx(mean_ratio(np.array([[0, 0], [1, 0], [c, s]])))
    assert best_quad(a) == pytest.approx(
        element_quality("quad", np.array([[0, 0], [1, 0], [1 + c, s], [c, s]], dtype=float))
    )
    c, s = np.cos(a / 2), np.sin(a / 2)
    found = [
        mean_ratio(np.array([[h, 0, 0], [0, c, s], [0, c, -s], [-h, 0, 0]]))
        for h in np.geomspace(0.02, 20, 4001)
    ]
    assert best_tetra_at_edge(a) == pytest.approx(np.abs(found).max(), rel=1e-5)
    turns = np.arange(3) * 2 * pi / 3
    for flare in (0.1, 0.8, 3.0):  # three equal edges, more or less apart
        p = np.array(
            [[0, 0, 0], *np.stack([flare * np.cos(turns), flare * np.sin(turns), np.ones(3)], axis=1)]
        )
        assert best_tetra_at_vertex(solid_angle(p, 0)) == pytest.approx(abs(float(mean_ratio(p))))


@pytest.mark.parametrize(
    ("best", "ideal", "end"),
    [
        (best_triangle, pi / 3, pi),
        (best_quad, pi / 2, pi),
        (best_tetra_at_edge, np.arccos(1 / 3), pi),
        (best_tetra_at_vertex, 3 * np.arccos(1 / 3) - pi, 2 * pi),
    ],
)
def test_the_best_grows_up_to_the_ideal_angle_and_falls_beyond(best, ideal, end):
    """Without that, the nth part of an angle would not be what n elements can do with it."""
    assert best(ideal) == pytest.approx(1)
    below = [best(a) for a in np.linspace(1e-6, ideal, 300)]
    beyond = [best(a) for a in np.linspace(ideal, end - 1e-6, 300)]
    assert (np.diff(below) > 0).all()
    assert (np.diff(beyond) < 0).all()


def test_fans_of_triangles():
    mesh = hexagon(3)
    centre = int(np.linalg.norm(mesh.points, axis=1).argmin())
    corner = int(mesh.points[:, 0].argmax())  # 120 degrees
    six, two = fans(mesh.points, mesh.cells, np.array([centre, corner]))
    assert (six.vertices, six.n, two.vertices, two.n) == ((centre,), 6, (corner,), 2)
    assert (six.best, two.best) == (pytest.approx(1), pytest.approx(1))


def test_fans_of_tetrahedra():
    """An octahedron of eight tetrahedra around its centre, four of them at each edge there."""
    axes = np.eye(3)
    points = np.array([[0, 0, 0], *axes, *-axes])
    cells = np.array([[0, x, y, z] for x in (1, 4) for y in (2, 5) for z in (3, 6)])
    all_fans = {fan.vertices: fan for fan in fans(points, [Cells("tetra", cells)], np.array([0, 1, 4]))}
    assert {where: fan.n for where, fan in all_fans.items()} == {
        (0,): 8,
        (1,): 4,
        (4,): 4,
        (0, 1): 4,
        (0, 4): 4,
    }
    reached = abs(float(mean_ratio(points[cells[0]])))
    assert all_fans[0,].best == pytest.approx(reached)
    assert all_fans[0, 1].best == pytest.approx(best_tetra_at_edge(pi / 2))


@pytest.mark.parametrize("kind", ["triangle", "quad", "tetra"])
@pytest.mark.parametrize("seed", range(3))
def test_no_mesh_is_better_than_its_fans(kind, seed):
    mesh = delaunay(40, 3, seed) if kind == "tetra" else random_mesh(kind, seed, noise=0.2)
    (block,) = mesh.cells
    qualities = [element_quality(kind, mesh.points[cell]) for cell in block.vertices]
    assert min(qualities) > 0
    found = list(fans(mesh.points, mesh.cells, np.arange(len(mesh.points))))
    assert len(found) >= len(mesh.points)
    for fan in found:
        around = np.isin(block.vertices, fan.vertices).sum(axis=1) == len(fan.vertices)
        assert fan.n == around.sum()
        assert min(np.array(qualities)[around]) <= fan.best + 1e-9


def test_mixed_fans_are_left_out():
    mesh = random_mesh("mixed2d", 1)
    types = {v: set() for v in range(len(mesh.points))}
    for block in mesh.cells:
        for cell in block.vertices:
            for v in cell:
                types[v].add(block.type)
    found = [fan.vertices[0] for fan in fans(mesh.points, mesh.cells, np.arange(len(mesh.points)))]
    assert found == [v for v, around in types.items() if len(around) == 1]
    assert list(fans(random_mesh("wedge", 1).points, random_mesh("wedge", 1).cells, np.arange(5))) == []
