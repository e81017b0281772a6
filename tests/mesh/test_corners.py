"""Corners, shape tables and rings against the oracle's, which it derives from the ideal elements alone."""

from itertools import permutations

import numpy as np
import pytest

import oracle
from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES, relaxed_dimension
from dvr_cli.mesh.corners import ORIGIN_FIRST, SHAPES, corners_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells
from dvr_cli.mesh.rings import incidence_of
from dvr_cli.quality.mean_ratio import corner_qualities
from meshes import KINDS, random_mesh

TYPES = list(oracle.IDEAL)


def one_cell(cell_type):
    """The corners of a single cell whose vertices are 0, 1, 2, ..."""
    cells = Cells(cell_type, np.arange(len(oracle.IDEAL[cell_type]))[None])
    return corners_of([cells], relaxed_dimension(cell_type))


def random_elements(cell_type, n, seed=0):
    """Points (n, nodes, d) of distorted ideal elements, some of them inverted."""
    rng = np.random.default_rng(seed)
    ideal = np.array(oracle.IDEAL[cell_type])
    return ideal + rng.uniform(0, 1, (n, 1, 1)) * rng.normal(size=(n, *ideal.shape))


def is_even(order):
    return np.linalg.det(np.eye(len(order))[list(order)]) > 0


def test_every_type_the_oracle_knows_is_known():
    dimensions = {name: relaxed_dimension(name) for name in CELL_TYPES}
    expected = {name: np.array(ideal).shape[1] for name, ideal in oracle.IDEAL.items()}
    assert {name: d for name, d in dimensions.items() if d is not None} == expected


@pytest.mark.parametrize("cell_type", TYPES)
def test_corners_join_the_vertices_the_oracle_joins(cell_type):
    ours = {vertices[0]: vertices for vertices in one_cell(cell_type).vertices.tolist()}
    theirs = {local[0]: local for local, _ in oracle.corners(cell_type)}
    assert ours.keys() == theirs.keys()
    for vertex, local in theirs.items():
        assert sorted(ours[vertex]) == sorted(local)
        assert is_even([local.index(v) for v in ours[vertex]])


@pytest.mark.parametrize("cell_type", TYPES)
def test_each_corner_has_the_quality_the_oracle_gives_it(cell_type):
    corners = one_cell(cell_type)
    targets = {local[0]: (local, target) for local, target in oracle.corners(cell_type)}
    inverted = 0
    for points in random_elements(cell_type, 200):
        expected = []
        for vertex in corners.vertices[:, 0]:
            local, target = targets[vertex]
            expected.append(oracle.mean_ratio(points[local], target))
        inverted += min(expected) < 0
        np.testing.assert_allclose(corner_qualities(points, corners), expected, rtol=1e-9, atol=1e-14)
    assert 20 < inverted < 180


@pytest.mark.parametrize("cell_type", TYPES)
def test_a_corner_is_the_same_seen_from_any_of_its_vertices(cell_type):
    corners = one_cell(cell_type)
    d = corners.dimension
    j, k = np.triu_indices(d, 1)
    for points in random_elements(cell_type, 20):
        for vertices, shapes in zip(corners.vertices, corners.shapes, strict=True):
            v, s = [], []
            for order, shape in zip(ORIGIN_FIRST[d], shapes, strict=True):
                simplex = points[vertices[order]]
                edges = simplex[1:] - simplex[0]
                gram = edges @ edges.T
                v.append(np.linalg.det(edges))
                s.append(SHAPES[d].norm[shape] @ [*np.diag(gram), *gram[j, k]])
            np.testing.assert_allclose(v, v[0], rtol=1e-9, atol=1e-13)
            np.testing.assert_allclose(s, s[0], rtol=1e-10)


@pytest.mark.parametrize("d", [2, 3])
def test_origins_are_even_permutations(d):
    for first, order in enumerate(ORIGIN_FIRST[d].tolist()):
        assert order[0] == first
        assert sorted(order) == list(range(d + 1))
        assert is_even(order)


@pytest.mark.parametrize("d", [2, 3])
def test_slope_and_curvature_are_the_derivatives_of_the_norm(d):
    rng = np.random.default_rng(d)
    table = SHAPES[d]
    j, k = np.triu_indices(d, 1)
    for shape in range(len(table.norm)):
        ends, x, u = rng.normal(size=(d, d)), rng.normal(size=d), rng.normal(size=d)

        def s(step, ends=ends, x=x, u=u, shape=shape):
            edges = ends - (x + step * u)
            gram = edges @ edges.T
            return table.norm[shape] @ [*np.diag(gram), *gram[j, k]]

        # s is quadratic in the step, so that its differences over any step are its derivatives
        slope, curvature = (s(1) - s(-1)) / 2, (s(1) - 2 * s(0) + s(-1)) / 2
        np.testing.assert_allclose(-2 * table.slope[shape] @ ((ends - x) @ u), slope, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(table.curvature[shape] * (u @ u), curvature, rtol=1e-10)


@pytest.mark.parametrize("cell_type", TYPES)
def test_mirror_turns_every_corner_inside_out(cell_type):
    mirror = list(CELL_TYPES[cell_type].mirror)
    corners = one_cell(cell_type)
    for points in random_elements(cell_type, 20):
        as_is, mirrored = corner_qualities(points, corners), corner_qualities(points[mirror], corners)
        np.testing.assert_allclose(np.sort(mirrored), np.sort(-as_is), rtol=1e-9, atol=1e-14)
    assert [mirror[i] for i in mirror] == list(range(len(mirror)))


def test_corners_follow_the_blocks_in_order():
    quads = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
    triangles = np.array([[3, 2, 6]])
    corners = corners_of([Cells("quad", quads), Cells("triangle", triangles)], 2)
    assert corners.start.tolist() == [0, 4, 8, 9]
    for cell, vertices in enumerate([*quads, *triangles]):
        own = corners.vertices[corners.start[cell] : corners.start[cell + 1]]
        assert set(own.ravel().tolist()) == set(vertices.tolist())
    assert corners.vertices.dtype == np.int32
    assert corners.dimension == 2


def test_no_cells_have_no_corners():
    corners = corners_of([], 3)
    assert corners.vertices.shape == corners.shapes.shape == (0, 4)
    assert corners.start.tolist() == [0]


@pytest.mark.parametrize(("cell_type", "dimension"), [("triangle", 3), ("tetra", 2), ("polygon", 2)])
def test_cells_of_another_dimension_are_refused(cell_type, dimension):
    with pytest.raises(InputError, match=f"'{cell_type}' cannot be relaxed in {dimension}D"):
        corners_of([Cells(cell_type, np.array([[0, 1, 2]]))], dimension)


@pytest.mark.parametrize("kind", KINDS)
def test_rings_are_all_corners_that_contain_the_vertex(kind):
    """In any order of the relaxed vertices; each corner re-expressed with that vertex as its origin."""
    mesh = random_mesh(kind, 2)
    domain = domain_of(mesh)
    corners = domain.corners
    relaxed = np.random.default_rng(0).permutation(np.flatnonzero(domain.interior))
    incidence = incidence_of(corners, np.sort(relaxed), len(mesh.points))
    rings = incidence.rings(corners, np.searchsorted(np.sort(relaxed), relaxed))
    assert rings.vertices.tolist() == relaxed.tolist()
    for i, vertex in enumerate(relaxed):
        around = [c for c, vertices in enumerate(corners.vertices.tolist()) if vertex in vertices]
        assert rings.sizes[i] == len(around)
        for entry, c in enumerate(around, start=rings.start[i]):
            simplex = [vertex, *rings.others[entry].tolist()]
            stored = corners.vertices[c].tolist()
            assert any(
                is_even(order) and [stored[p] for p in order] == simplex
                for order in permutations(range(len(stored)))
            )
            assert rings.shapes[entry] == corners.shapes[c, stored.index(vertex)]
