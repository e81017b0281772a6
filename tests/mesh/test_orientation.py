"""Cells stored inside out are told apart from inverted ones, whatever the element type."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

import oracle
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.orientation import connected_parts, mirrored_cells
from dvr_cli.quality.mean_ratio import element_qualities
from meshes import KINDS, delaunay, random_mesh

SEEDS = [0, 1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3, 4))]


def qualities(mesh):
    """Quality of each cell by the oracle, as the cell is stored."""
    cells = [(block.type, vertices) for block in mesh.cells for vertices in block.vertices]
    return np.array([oracle.element_quality(name, mesh.points[vertices]) for name, vertices in cells])


def turned(mesh, which):
    """The mesh with the cells marked in ``which`` ((n,) bool through all blocks) stored inside out."""
    blocks, first = [], 0
    for block in mesh.cells:
        here = which[first : first + len(block.vertices)]
        first += len(block.vertices)
        mirror_image = block.vertices[:, oracle.MIRRORED[block.type]]
        blocks.append(Cells(block.type, np.where(here[:, None], mirror_image, block.vertices)))
    return Mesh(mesh.points, blocks)


def tangled(kind, seed):
    """A mesh with inverted cells: some interior vertices sent through one of their cells and beyond it."""
    mesh = random_mesh(kind, seed, noise=0.1)
    rng = np.random.default_rng(seed)
    points = mesh.points.copy()
    for vertex in rng.permutation(np.flatnonzero(domain_of(mesh).interior))[:2]:
        cells = [row for block in mesh.cells for row in block.vertices if vertex in row]
        opposite = [other for other in cells[rng.integers(len(cells))] if other != vertex]
        points[vertex] = 2 * points[opposite].mean(axis=0) - points[vertex]
    result = Mesh(points, mesh.cells)
    assert (qualities(result) < 0).any()
    return result


def coin(mesh, seed):
    n = sum(len(block.vertices) for block in mesh.cells)
    return np.random.default_rng(seed).random(n) < 0.5


def assert_oriented_as(domain, mesh, which):
    """The domain of turned(mesh, which) is oriented as ``mesh``, and so its cells have the same qualities."""
    assert domain.mirrored == which.sum()
    np.testing.assert_allclose(
        element_qualities(domain.points, domain.corners), qualities(mesh), rtol=1e-9, atol=1e-13
    )


@pytest.mark.parametrize("kind", KINDS)
def test_positive_cells_stay_as_they_are(kind):
    mesh = random_mesh(kind, 1)
    domain = domain_of(mesh)
    assert domain.mirrored == 0
    for block, stored in zip(domain.cells, mesh.cells, strict=True):
        np.testing.assert_array_equal(block.vertices, stored.vertices)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", KINDS)
def test_all_cells_inside_out(kind, seed):
    for mesh in (random_mesh(kind, seed), tangled(kind, seed)):
        everything = np.ones_like(coin(mesh, seed))
        assert_oriented_as(domain_of(turned(mesh, everything)), mesh, everything)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", KINDS)
def test_half_of_the_cells_inside_out(kind, seed):
    mesh = random_mesh(kind, seed)
    which = coin(mesh, seed)
    assert_oriented_as(domain_of(turned(mesh, which)), mesh, which)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", KINDS)
def test_inverted_cells_stay_inverted(kind, seed):
    """With none or half of the cells inside out as well; an inverted one may then look positive as stored."""
    mesh = tangled(kind, seed)
    for which in (np.zeros_like(coin(mesh, seed)), coin(mesh, seed)):
        assert_oriented_as(domain_of(turned(mesh, which)), mesh, which)


@pytest.mark.parametrize("kind", KINDS)
def test_separate_parts_may_differ(kind):
    one, other = random_mesh(kind, 1), tangled(kind, 2)
    n = len(one.points)
    both = Mesh(
        np.vstack([one.points, other.points + 10]),
        [*one.cells, *(Cells(block.type, block.vertices + n) for block in other.cells)],
    )
    first = np.concatenate([np.ones_like(coin(one, 0)), np.zeros_like(coin(other, 0))])
    for which in (first, ~first):
        assert_oriented_as(domain_of(turned(both, which)), both, which)


def test_parts_that_touch_in_a_vertex_only_are_separate():
    points = np.array([[0, 0], [1, 0], [0.5, 1], [1, 2], [0, 2]])
    mesh = Mesh(points, [Cells("triangle", np.array([[0, 1, 2], [2, 3, 4]]))])
    which = np.array([False, True])
    assert_oriented_as(domain_of(turned(mesh, which)), mesh, which)


def test_flat_cells_follow_their_neighbours():
    """A degenerate cell has no sign of its own, yet it is oriented, and a negative neighbour recognised."""
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
    mesh = Mesh(points, [Cells("triangle", np.array([[0, 1, 4], [1, 2, 4], [0, 4, 2], [0, 2, 3]]))])
    for number in range(16):
        which = np.array([bool(number >> bit & 1) for bit in range(4)])
        assert_oriented_as(domain_of(turned(mesh, which)), mesh, which)


@pytest.mark.parametrize("kind", KINDS)
def test_given_cells_are_never_altered(kind):
    mesh = tangled(kind, 3)
    given = turned(mesh, coin(mesh, 3))
    for block in given.cells:
        block.vertices.setflags(write=False)
    given.points.setflags(write=False)
    before = [block.vertices.tobytes() for block in given.cells], given.points.tobytes()
    assert domain_of(given).mirrored > 0
    assert ([block.vertices.tobytes() for block in given.cells], given.points.tobytes()) == before


def test_a_part_without_orientation_stays_as_stored():
    """A Möbius strip of five triangles."""
    strip = (np.arange(5)[:, None] + np.arange(3)) % 5
    blocks = [Cells("triangle", strip)]
    for number in range(32):
        signs = np.array([1.0 if number >> bit & 1 else -1.0 for bit in range(5)])
        if len(set(signs)) == 2:
            assert not mirrored_cells(signs, blocks).any()


def test_the_sign_of_a_part_is_that_of_its_measure():
    """Two triangles stored alike, of different sign: the larger one says which way is positive."""
    blocks = [Cells("triangle", np.array([[0, 1, 2], [2, 1, 3]]))]
    assert mirrored_cells(np.array([2.0, -1.0]), blocks).tolist() == [False, False]
    assert mirrored_cells(np.array([1.0, -2.0]), blocks).tolist() == [True, True]


@pytest.mark.parametrize("edges", [0, 30, 100, 300])
def test_connected_parts_are_named_after_their_smallest_node(edges):
    rng = np.random.default_rng(edges)
    left, right = rng.integers(0, 200, (2, edges))
    graph = coo_array((np.ones(edges), (left, right)), shape=(200, 200))
    _, part = connected_components(graph, directed=False)
    smallest = [int(np.flatnonzero(part == p)[0]) for p in part]
    assert connected_parts(200, left, right).tolist() == smallest


def test_connected_parts_of_a_long_chain():
    nodes = np.random.default_rng(0).permutation(5000)
    assert not connected_parts(5000, nodes[1:], nodes[:-1]).any()


def test_a_large_mesh_with_random_orientation():
    mesh = delaunay(2000, 2, 0)
    which = coin(mesh, 0)
    assert_oriented_as(domain_of(turned(mesh, which)), mesh, which)
