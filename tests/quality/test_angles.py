"""Angles of planar cells and dihedral angles of volume cells, against closed forms and other formulas."""

import warnings
from itertools import combinations

import numpy as np
import pytest

import oracle
from dvr_cli.backend import COMPILED
from dvr_cli.mesh.mesh import Cells
from dvr_cli.quality.angles import extreme_angles
from meshes import random_mesh
from needs import require

IDEAL_ANGLES = {
    "triangle": (60, 60),
    "quad": (90, 90),
    "tetra": (np.degrees(np.arccos(1 / 3)),) * 2,
    "hexahedron": (90, 90),
    "wedge": (60, 90),
    "pyramid": (np.degrees(np.arctan(np.sqrt(2))), np.degrees(np.arccos(-1 / 3))),
}


def of_one(cell_type, points):
    points = np.asarray(points, dtype=float)
    return extreme_angles(points, [Cells(cell_type, np.arange(len(points))[None])])


@pytest.mark.parametrize("cell_type", oracle.IDEAL)
def test_angles_of_ideal_elements(cell_type):
    np.testing.assert_allclose(
        of_one(cell_type, oracle.IDEAL[cell_type]), IDEAL_ANGLES[cell_type], rtol=1e-13
    )


def test_angles_of_triangles_by_the_law_of_cosines():
    mesh = random_mesh("triangle", 1)
    angles = []
    for p in mesh.points[mesh.cells[0].vertices]:
        a, b, c = (np.linalg.norm(p[i] - p[i - 1]) for i in range(3))
        angles += [
            np.arccos((x * x + y * y - z * z) / (2 * x * y)) for x, y, z in ((a, b, c), (b, c, a), (c, a, b))
        ]
    np.testing.assert_allclose(
        extreme_angles(mesh.points, mesh.cells), np.degrees([min(angles), max(angles)]), rtol=1e-9
    )


def test_angles_of_quadrilaterals_turn_beyond_180_degrees():
    """An arrowhead: 270 degrees in its notch, 45 at its tip, 22.5 at either barb."""
    t = np.tan(np.radians(22.5))
    arrow = [(0, 0), (1, -1), (0, 1 / t - 1), (-1, -1)]
    assert of_one("quad", arrow) == pytest.approx((22.5, 270))
    assert of_one("quad", [(0, 0), (2, 0), (2, 1), (0, 1)]) == (90, 90)


def test_angles_of_an_inverted_triangle_are_those_outside():
    assert of_one("triangle", [(0, 0), (0.5, np.sqrt(0.75)), (1, 0)]) == pytest.approx((300, 300))


def dihedral(p, i, j, k, m):
    """The angle at edge ij between its triangles with k and m, seen along the edge."""
    u = (p[j] - p[i]) / np.linalg.norm(p[j] - p[i])
    a, b = (p[x] - p[i] - (p[x] - p[i]) @ u * u for x in (k, m))
    return np.degrees(np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b)))


@pytest.mark.parametrize("seed", range(5))
def test_dihedral_angles_of_tetrahedra(seed):
    mesh = random_mesh("tetra", seed)
    angles = []
    for p in mesh.points[mesh.cells[0].vertices]:
        for i, j in combinations(range(4), 2):
            k, m = sorted({0, 1, 2, 3} - {i, j})
            angles.append(dihedral(p, i, j, k, m))
    assert extreme_angles(mesh.points, mesh.cells) == pytest.approx((min(angles), max(angles)), rel=1e-9)


@pytest.mark.parametrize("cell_type", ["hexahedron", "wedge", "pyramid"])
def test_dihedral_angles_of_elements_with_plane_faces(cell_type):
    """An affine image of the ideal element; at each edge, two more vertices span its two faces."""
    edges = {  # edge, then a vertex of either face
        "hexahedron": [(0, 1, 2, 4), (0, 3, 1, 4), (0, 4, 1, 3)],  # the others are parallel to these ...
        "wedge": [(0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (0, 3, 1, 2), (1, 4, 0, 2), (2, 5, 0, 1)],
        "pyramid": [(0, 1, 2, 4), (1, 2, 3, 4), (2, 3, 0, 4), (3, 0, 1, 4)]
        + [(i, 4, (i + 1) % 4, (i + 3) % 4) for i in range(4)],
    }[cell_type]
    for seed in range(10):
        rng = np.random.default_rng(seed)
        p = np.array(oracle.IDEAL[cell_type]) @ (np.eye(3) + 0.4 * rng.uniform(-1, 1, (3, 3)))
        angles = [dihedral(p, *edge) for edge in edges]
        if cell_type != "pyramid":  # ... or meet the same face from its other side
            angles += [180 - angle for angle in angles[: 3 if cell_type == "wedge" else None]]
        assert of_one(cell_type, p) == pytest.approx((min(angles), max(angles)), rel=1e-9)


def test_extremes_are_over_all_blocks():
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [1.5, 0.5]])
    quad, triangle = Cells("quad", np.array([[0, 1, 2, 3]])), Cells("triangle", np.array([[1, 4, 2]]))
    for blocks in (
        [quad, triangle],
        [triangle, quad],
        [Cells("quad", np.empty((0, 4), int)), triangle, quad],
    ):
        assert extreme_angles(points, blocks) == pytest.approx((45, 90))


@pytest.mark.parametrize("cell_type", oracle.IDEAL)
def test_elements_without_extent_have_no_angles(cell_type):
    points = np.ones_like(np.array(oracle.IDEAL[cell_type], dtype=float))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isnan(of_one(cell_type, points)).all()


def test_angles_next_to_an_edge_without_length_are_left_out():
    """Vertices 0 and 1 coincide; of the square a triangle is left, with angles at 2 and 3."""
    assert of_one("quad", [(0, 0), (0, 0), (1, 1), (0, 1)]) == pytest.approx((45, 90))


def test_angles_next_to_a_face_without_area_are_left_out():
    """Face 0-1-2 lies on a line: the three edges of the tetrahedron in it have no dihedral angle."""
    p = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0), (0.3, 1, 0.2)])
    assert of_one("tetra", p) == pytest.approx((0, 180))


def test_no_cells_have_no_angles():
    assert np.isnan(extreme_angles(np.empty((0, 2)), [])).all()


@pytest.mark.parametrize("kind", ["triangle", "quad"])
@pytest.mark.parametrize("in_space", [False, True])
def test_the_compiled_search_finds_the_same_extremes(kind, in_space):
    """Of random cells, inside out ones among them, some without an edge or so small that products vanish."""
    require("numba")
    rng = np.random.default_rng(2)
    points = rng.normal(size=(400, 3 if in_space else 2))
    points[:8] *= 1e-170
    cells = rng.integers(400, size=(300, 3 if kind == "triangle" else 4)).astype(np.int32)
    for part in (cells, cells[:40], cells[:1], np.arange(8, dtype=np.int32)[None, : cells.shape[1]]):
        blocks = [Cells(kind, part)]
        assert extreme_angles(points, blocks, COMPILED) == extreme_angles(points, blocks)
