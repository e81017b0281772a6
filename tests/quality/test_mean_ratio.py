"""The mean ratio of elements: against the oracle, at its landmarks 1, 0 and below, and its invariances."""

import warnings

import numpy as np
import pytest

import oracle
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.corners import corners_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells
from dvr_cli.mesh.simplex import determinants
from dvr_cli.quality.mean_ratio import corner_qualities, element_qualities
from meshes import KINDS, random_mesh

TYPES = list(oracle.IDEAL)


def quality(cell_type, elements):
    """Qualities of elements given as points (n, nodes, d)."""
    n, nodes, d = elements.shape
    cells = [Cells(cell_type, np.arange(n * nodes).reshape(n, nodes))]
    return element_qualities(elements.reshape(-1, d), corners_of(cells, d))


def ideal(cell_type):
    return np.array(oracle.IDEAL[cell_type], dtype=float)


def distorted(cell_type, n, seed=0):
    """Ideal elements with random noise, weak to strong, so that a good part of them is inverted."""
    rng = np.random.default_rng(seed)
    element = ideal(cell_type)
    return element + rng.uniform(0, 1, (n, 1, 1)) * rng.normal(size=(n, *element.shape))


def motion(d, seed):
    """A random rotation, scale and shift, as a function of points (..., d)."""
    rng = np.random.default_rng(seed)
    rotation = np.linalg.qr(rng.normal(size=(d, d)))[0]
    rotation[0] *= np.linalg.det(rotation)
    scale, shift = 10 ** rng.uniform(-3, 3), rng.normal(size=d)
    return lambda points: scale * (points @ rotation.T + shift)


@pytest.mark.parametrize("cell_type", TYPES)
def test_elements_have_the_quality_the_oracle_gives_them(cell_type):
    elements = distorted(cell_type, 500)
    expected = np.array([oracle.element_quality(cell_type, points) for points in elements])
    np.testing.assert_allclose(quality(cell_type, elements), expected, rtol=1e-9, atol=1e-14)
    assert (expected < 0).sum() > 50
    assert (expected > 0).sum() > 50


@pytest.mark.parametrize("kind", KINDS)
def test_meshes_have_the_qualities_the_oracle_gives_them(kind):
    mesh = random_mesh(kind, 3, noise=0.45)
    domain = domain_of(mesh)
    cells = [(block.type, vertices) for block in domain.cells for vertices in block.vertices]
    expected = [oracle.element_quality(name, mesh.points[vertices]) for name, vertices in cells]
    np.testing.assert_allclose(
        element_qualities(mesh.points, domain.corners), expected, rtol=1e-9, atol=1e-14
    )


@pytest.mark.parametrize("cell_type", TYPES)
def test_ideal_elements_are_1_and_their_mirror_images_minus_1(cell_type):
    element = ideal(cell_type)
    assert abs(quality(cell_type, element[None])[0] - 1) <= 1e-14
    assert abs(quality(cell_type, element[None, oracle.MIRRORED[cell_type]])[0] + 1) <= 1e-14
    moved = np.array([motion(element.shape[1], seed)(element) for seed in range(50)])
    np.testing.assert_allclose(quality(cell_type, moved), 1, atol=1e-12)


@pytest.mark.parametrize("cell_type", TYPES)
def test_flat_elements_are_0(cell_type):
    flat = ideal(cell_type)
    flat[:, -1] = 0
    assert quality(cell_type, flat[None]).tolist() == [0]
    moved = np.array([motion(flat.shape[1], seed)(flat) for seed in range(50)])
    assert np.abs(quality(cell_type, moved)).max() < 1e-9


@pytest.mark.parametrize("place", [0.0, 0.1, 1e150, 1e-200])
@pytest.mark.parametrize("cell_type", TYPES)
def test_elements_without_extent_are_0_without_a_warning(cell_type, place):
    point = np.full((1, *ideal(cell_type).shape), place)
    with warnings.catch_warnings(), np.errstate(all="raise", under="ignore"):
        warnings.simplefilter("error")
        assert quality(cell_type, point).tolist() == [0]


@pytest.mark.parametrize("cell_type", TYPES)
def test_an_edge_without_length_makes_an_element_0_or_worse(cell_type):
    """An element is as good as the worst of its corners, and both ends of the edge are in flat corners."""
    for local, _ in oracle.corners(cell_type):
        for end in local[1:]:
            element = ideal(cell_type)
            element[end] = element[local[0]]
            assert quality(cell_type, element[None])[0] <= 0


@pytest.mark.parametrize("cell_type", TYPES)
def test_a_vertex_pushed_through_the_element_inverts_it(cell_type):
    element = ideal(cell_type)
    element[0] += 3 * (element.mean(axis=0) - element[0])
    assert quality(cell_type, element[None])[0] < 0


@pytest.mark.parametrize("cell_type", TYPES)
def test_quality_does_not_depend_on_place_size_or_attitude(cell_type):
    elements = distorted(cell_type, 200)
    for seed in range(5):
        moved = motion(elements.shape[2], seed)(elements)
        np.testing.assert_allclose(
            quality(cell_type, moved), quality(cell_type, elements), rtol=1e-8, atol=1e-12
        )


@pytest.mark.parametrize("cell_type", TYPES)
def test_quality_does_not_depend_on_how_the_element_is_turned(cell_type):
    """Renumberings that turn the ideal element onto itself; all others are repetitions of these."""
    turns = {
        "triangle": [[1, 2, 0]],
        "quad": [[1, 2, 3, 0]],
        "tetra": [[1, 2, 0, 3], [0, 2, 3, 1]],
        "hexahedron": [[1, 2, 3, 0, 5, 6, 7, 4], [1, 5, 6, 2, 0, 4, 7, 3]],
        "wedge": [[1, 2, 0, 4, 5, 3], [3, 5, 4, 0, 2, 1]],
        "pyramid": [[1, 2, 3, 0, 4]],
    }[cell_type]
    elements = distorted(cell_type, 200)
    for turn in turns:
        assert oracle.element_quality(cell_type, ideal(cell_type)[turn]) == pytest.approx(1)
        np.testing.assert_allclose(
            quality(cell_type, elements[:, turn]), quality(cell_type, elements), rtol=1e-9, atol=1e-13
        )


@pytest.mark.parametrize("cell_type", TYPES)
def test_quality_is_between_minus_1_and_1(cell_type):
    elements = np.concatenate(
        [distorted(cell_type, 500), np.random.default_rng(1).normal(size=(500, *ideal(cell_type).shape))]
    )
    assert np.abs(quality(cell_type, elements)).max() <= 1 + 1e-14


@pytest.mark.parametrize("dimension", [2, 3])
def test_simplices_have_the_quality_of_equation_4(dimension):
    """The paper's own formula, from the lengths of the edges and the signed measure."""
    cell_type = {2: "triangle", 3: "tetra"}[dimension]
    elements = distorted(cell_type, 300)
    i, j = np.triu_indices(dimension + 1, 1)
    squares = ((elements[:, i] - elements[:, j]) ** 2).sum(axis=(1, 2))
    measure = np.linalg.det(elements[:, 1:] - elements[:, :1]) / {2: 2, 3: 6}[dimension]
    if dimension == 2:
        expected = 4 * np.sqrt(3) * measure / squares
    else:
        expected = 12 * np.sign(measure) * np.abs(3 * measure) ** (2 / 3) / squares
    np.testing.assert_allclose(quality(cell_type, elements), expected, rtol=1e-9, atol=1e-13)


def _measures(points, corners):
    return determinants(points, corners.vertices)


@pytest.mark.parametrize("cell_type", TYPES)
def test_corners_are_evaluated_alike_in_any_number(cell_type):
    """Many corners are evaluated piece by piece; no bit may depend on where a piece ends."""
    d = CELL_TYPES[cell_type].dimension
    elements = distorted(cell_type, 7)
    points = elements.reshape(-1, d)
    cells = np.arange(len(points)).reshape(7, -1)
    few = corners_of([Cells(cell_type, cells)], d)
    many = corners_of([Cells(cell_type, np.tile(cells, (20_000, 1)))], d)
    for of in (corner_qualities, _measures, element_qualities):
        assert of(points, many).tobytes() == np.tile(of(points, few), 20_000).tobytes()


def test_no_cells_have_no_qualities():
    for of in (corner_qualities, element_qualities):
        assert of(np.empty((0, 3)), corners_of([], 3)).shape == (0,)


def test_blocks_of_different_types_do_not_mix():
    mesh = random_mesh("mixed3d", 2)
    together = element_qualities(mesh.points, corners_of(mesh.cells, 3))
    apart = [element_qualities(mesh.points, corners_of([block], 3)) for block in mesh.cells]
    assert together.tobytes() == np.concatenate(apart).tobytes()
