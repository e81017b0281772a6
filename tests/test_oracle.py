"""The oracle, before anything is compared with it: against closed forms, and against brute force."""

from __future__ import annotations

import numpy as np
import pytest

import oracle

RNG_SEED = 2017


def rng_for(name: str) -> np.random.Generator:
    return np.random.default_rng([RNG_SEED, *name.encode()])


def random_rotation(rng: np.random.Generator, d: int) -> np.ndarray:
    rotation = np.linalg.qr(rng.normal(size=(d, d)))[0]
    rotation[0] *= np.linalg.det(rotation)
    return rotation


def worst_quality(ring: oracle.Ring, x: np.ndarray, direction: np.ndarray, steps: np.ndarray) -> np.ndarray:
    return oracle.ring_qualities(ring, x, direction, steps).min(axis=-1)


# ----------------------------------------------------------------------------------------------- quality

EDGES = {"triangle": 3, "quad": 4, "tetra": 6, "hexahedron": 12, "wedge": 9, "pyramid": 8}
CORNERS = {"triangle": 1, "quad": 4, "tetra": 1, "hexahedron": 8, "wedge": 6, "pyramid": 4}


@pytest.mark.parametrize("cell_type", oracle.IDEAL)
def test_ideal_elements_have_edges_of_one_length_and_quality_one(cell_type: str) -> None:
    points = np.array(oracle.IDEAL[cell_type], dtype=float)
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    edges = distances[np.triu_indices(len(points), 1)]
    assert np.isclose(edges, 1).sum() == EDGES[cell_type]
    assert edges.min() == pytest.approx(1)
    assert oracle.element_quality(cell_type, points) == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize("cell_type", oracle.IDEAL)
def test_corners_are_positively_oriented_and_cover_the_element(cell_type: str) -> None:
    corners = oracle.corners(cell_type)
    assert len(corners) == CORNERS[cell_type]
    assert {i for local, _ in corners for i in local} == set(range(len(oracle.IDEAL[cell_type])))
    for _, target in corners:
        assert np.linalg.det(target[1:] - target[0]) > 0


@pytest.mark.parametrize("cell_type", oracle.IDEAL)
def test_a_mirrored_element_is_inverted_until_its_nodes_are_reordered(cell_type: str) -> None:
    mirrored = np.array(oracle.IDEAL[cell_type], dtype=float)
    mirrored[:, 0] *= -1
    assert oracle.element_quality(cell_type, mirrored) == pytest.approx(-1)
    assert oracle.element_quality(cell_type, mirrored[oracle.MIRRORED[cell_type]]) == pytest.approx(1)


def test_simplices_follow_equation_4_of_the_paper() -> None:
    rng = rng_for("equation 4")
    for d, constant, factorial in ((2, 4 * np.sqrt(3), 2), (3, 12 * 9 ** (1 / 3), 6)):
        for points in rng.normal(size=(200, d + 1, d)):
            measure = np.linalg.det(points[1:] - points[0]) / factorial
            squares = sum(np.sum((points[p] - points[q]) ** 2) for p in range(d + 1) for q in range(p))
            expected = constant * np.sign(measure) * abs(measure) ** (2 / d) / squares
            assert oracle.mean_ratio(points) == pytest.approx(expected, rel=1e-10, abs=1e-14)


def test_degenerate_corners_have_quality_zero() -> None:
    assert oracle.mean_ratio([[0, 0], [1, 1], [3, 3]]) == 0
    assert oracle.mean_ratio([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]) == 0
    assert oracle.mean_ratio(np.ones((4, 3))) == 0


def test_quality_does_not_depend_on_size_place_or_orientation() -> None:
    rng = rng_for("invariance")
    for cell_type, ideal in oracle.IDEAL.items():
        points = np.array(ideal) + rng.uniform(-0.2, 0.2, np.shape(ideal))
        d = points.shape[1]
        moved = 10 ** rng.uniform(-6, 6) * (points @ random_rotation(rng, d).T + rng.normal(size=d))
        quality = oracle.element_quality(cell_type, points)
        assert 0 < quality < 1
        assert oracle.element_quality(cell_type, moved) == pytest.approx(quality, rel=1e-12)


def test_stretched_elements_have_the_quality_of_their_diagonal_map() -> None:
    # stretching the ideal element by (a, b[, c]) makes A that diagonal matrix in every corner
    for cell_type, ideal in oracle.IDEAL.items():
        stretch = np.array([0.5, 2.0, 3.0])[: len(ideal[0])]
        d = len(stretch)
        expected = d * np.prod(stretch) ** (2 / d) / np.sum(stretch**2)
        assert oracle.element_quality(cell_type, np.array(ideal) * stretch) == pytest.approx(expected)


def test_a_quad_is_as_good_as_its_worst_corner() -> None:
    rhombus = np.array([[0, 0], [1, 0], [1.5, 3**0.5 / 2], [0.5, 3**0.5 / 2]])
    assert oracle.element_quality("quad", rhombus) == pytest.approx(np.sin(np.pi / 3))
    # pulling one vertex of the square along the diagonal to (t, t) leaves the worst corner there:
    # its edges are (1-t, -t) and (-t, 1-t), of determinant 1 - 2t and summed squares 2 (t² + (1-t)²)
    for t in (0.2, 0.4, 0.6):
        dented = np.array([[t, t], [1, 0], [1, 1], [0, 1]])
        expected = (1 - 2 * t) / (t**2 + (1 - t) ** 2)
        assert oracle.element_quality("quad", dented) == pytest.approx(expected)


# ------------------------------------------------------------------------------------------ line problem


def test_roots_finds_roots_of_every_degree() -> None:
    polynomials = np.array([[1, 0, -1], [0, 2, -4], [1, -6, 9], [0, 0, 0]], dtype=float)
    assert sorted(oracle.roots(polynomials)) == pytest.approx([-1, 1, 2, 3, 3], abs=1e-7)


@pytest.mark.parametrize("kind", oracle.KINDS)
def test_polynomials_are_those_of_the_moved_ring(kind: str) -> None:
    rng = rng_for(kind)
    for _ in range(5):
        ring, x, direction = oracle.random_ring(rng, kind)
        size = max(np.ptp(points, axis=0).max() for points, _, _ in ring)
        step = rng.uniform(-1, 1) * size / np.linalg.norm(direction)
        a = oracle.jacobian(*oracle.with_vertex_at(ring, x + step * direction))
        det = oracle.determinants(ring, x, direction) @ [step, 1]
        norm2 = oracle.squared_norms(ring, x, direction) @ [step**2, step, 1]
        d = len(x)
        assert det == pytest.approx(np.linalg.det(a), rel=1e-8, abs=1e-10 * size**d)
        assert norm2 == pytest.approx(np.sum(a**2, axis=(1, 2)), rel=1e-10)


@pytest.mark.parametrize("kind", oracle.KINDS)
def test_the_positive_interval_is_where_all_qualities_are_positive(kind: str) -> None:
    rng = rng_for(kind)
    for _ in range(10):
        ring, x, direction = oracle.random_ring(rng, kind)
        size = max(np.linalg.norm(points - x, axis=1).max() for points, _, _ in ring)
        steps = rng.uniform(-2, 2, 200) * size / np.linalg.norm(direction)
        positive = worst_quality(ring, x, direction, steps) > 0
        low, high = oracle.positive_interval(ring, x, direction) or (np.inf, np.inf)
        margin = 1e-6 * size / np.linalg.norm(direction)
        assert positive[(steps > low + margin) & (steps < high - margin)].all()
        assert not positive[(steps < low - margin) | (steps > high + margin)].any()


def test_kinds_are_what_their_names_promise() -> None:
    rng = rng_for("kinds")
    for _ in range(10):
        for kind in oracle.BASES:
            assert worst_quality(*oracle.random_ring(rng, kind), 0) > 0
        ring, x, direction = oracle.random_ring(rng, "nearly_flat")
        corners = oracle.ring_qualities(ring, x, direction, 0)
        assert 0 < corners.min() < 0.02
        ring, x, direction = oracle.random_ring(rng, "tie")
        corners = np.sort(oracle.ring_qualities(ring, x, direction, 0))
        assert corners[::2] == pytest.approx(corners[1::2], rel=1e-9)
        ring, x, direction = oracle.random_ring(rng, "parallel")
        slope, _ = oracle.determinants(ring, x, direction).T
        assert np.abs(slope).min() < 1e-10 * np.abs(slope).max()
        ring, x, direction = oracle.random_ring(rng, "unbounded")
        assert np.isinf(oracle.positive_interval(ring, x, direction)).sum() == 1
        ring, x, direction = oracle.random_ring(rng, "tangled_solvable")
        low, high = oracle.positive_interval(ring, x, direction)
        assert not low < 0 < high
        assert oracle.positive_interval(*oracle.random_ring(rng, "tangled_hopeless")) is None


COUNT = {"2d": 200, "quad": 100, "3d": 60, "unbounded": 60, "tangled_hopeless": 60}


@pytest.mark.parametrize("share", [5, pytest.param(1, marks=pytest.mark.long)])
@pytest.mark.parametrize("kind", oracle.KINDS)
def test_polynomial_roots_and_brute_force_agree(kind: str, share: int) -> None:
    rng = rng_for(kind)
    for _ in range(COUNT.get(kind, 25) // share):
        ring, x, direction = oracle.random_ring(rng, kind)
        by_roots, by_force = oracle.line_problem(ring, x, direction), oracle.brute_force(ring, x, direction)
        if kind == "tangled_hopeless":
            assert by_roots is None
            assert by_force is None
            continue
        low, high = oracle.search_interval(ring, x, direction)
        assert low < by_roots[0] < high
        assert by_roots[1] == pytest.approx(by_force[1], rel=1e-9)
        # a smooth maximum fixes λ only to the square root of the accuracy of Q
        assert by_roots[0] == pytest.approx(by_force[0], abs=1e-6 * (high - low))
        assert by_roots[1] == worst_quality(ring, x, direction, by_roots[0])


def test_the_cut_of_an_unbounded_interval_hides_no_maximum() -> None:
    rng = rng_for("cut")
    for _ in range(25):
        ring, x, direction = oracle.random_ring(rng, "unbounded")
        _, high = oracle.positive_interval(ring, x, direction)
        _, quality = oracle.line_problem(ring, x, direction)
        cut = np.abs(oracle.search_interval(ring, x, direction)).max()
        beyond = np.geomspace(cut, 1e6 * cut, 100) * (1 if high == np.inf else -1)
        assert worst_quality(ring, x, direction, beyond).max() < quality


def test_one_triangle_moves_to_the_closed_form() -> None:
    # apex over the base (c±a, 0) at height y: Q = 2√3 a y / (3a² + c² + y²), greatest at y² = 3a² + c²
    a, c, y = 0.7, 0.4, 0.2
    triangle = np.array([[0, y], [c - a, 0], [c + a, 0]])
    best = np.sqrt(3 * a**2 + c**2)
    for k, order in enumerate(([0, 1, 2], [2, 0, 1], [1, 2, 0])):
        ring = [(triangle[order], k, oracle.REGULAR_SIMPLEX[2])]
        optimum, quality = oracle.line_problem(ring, triangle[0], np.array([0.0, 2.0]))
        assert optimum == pytest.approx((best - y) / 2)
        assert quality == pytest.approx(np.sqrt(3) * a / best)


def test_one_tetrahedron_moves_to_the_regular_one() -> None:
    points = oracle.REGULAR_SIMPLEX[3].copy()
    points[3, 2] = 0.1
    ring = [(points, 3, oracle.REGULAR_SIMPLEX[3])]
    optimum, quality = oracle.line_problem(ring, points[3], np.array([0.0, 0.0, 1.0]))
    assert optimum == pytest.approx(np.sqrt(2 / 3) - 0.1)
    assert quality == pytest.approx(1)


def test_a_pyramid_grows_to_the_one_with_equal_edges() -> None:
    points = np.array(oracle.IDEAL["pyramid"])
    points[4, 2] = -0.3  # tangled to begin with
    ring = oracle.ring_of(points, [("pyramid", np.arange(5)[None])], 4)
    optimum, quality = oracle.line_problem(ring, points[4], np.array([0.0, 0.0, 1.0]))
    assert optimum == pytest.approx(0.3 + np.sqrt(0.5))
    assert quality == pytest.approx(1)


def test_two_triangles_as_in_section_3_3() -> None:
    """Figure 4: up, the optimum is the maximum of the first curve; at 30° it is where the curves cross."""
    # fitted to the figures the paper gives: Q = 0.65 and 0.90, λ = 0.25 upwards, 0.125 and Q = 0.8 at 30°
    a, c, h = 0.267585, 0.428221, 0.381014
    v1 = np.zeros(2)
    first = np.array([v1, [c - a, -h], [c + a, -h]])
    second = np.array([v1, [0.2998, 0.3136], [-0.0565, 0.6003]])
    ring = [(first, 0, oracle.REGULAR_SIMPLEX[2]), (second, 0, oracle.REGULAR_SIMPLEX[2])]
    assert oracle.ring_qualities(ring, v1, v1, 0) == pytest.approx([0.65, 0.90], abs=1e-3)

    up = np.array([0.0, 1.0])
    optimum, quality = oracle.line_problem(ring, v1, up)
    assert optimum == pytest.approx(np.sqrt(3 * a**2 + c**2) - h)
    assert optimum == pytest.approx(0.25, abs=1e-3)
    curves = oracle.ring_qualities(ring, v1, up, optimum)
    assert quality == curves[0] < curves[1] - 0.1

    inclined = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6)])
    optimum, quality = oracle.line_problem(ring, v1, inclined)
    curves = oracle.ring_qualities(ring, v1, inclined, optimum)
    assert curves[0] == pytest.approx(curves[1], rel=1e-12)
    assert [optimum, quality] == pytest.approx([0.125, 0.8], abs=1e-3)


# ------------------------------------------------------------------------------------------------- sweep


def hexagon(centre: tuple[float, float]) -> tuple[np.ndarray, oracle.Cells]:
    angles = np.arange(6) * np.pi / 3
    rim = np.column_stack([np.cos(angles), np.sin(angles)])
    cell = np.column_stack([np.full(6, 6), np.arange(6), (np.arange(6) + 1) % 6])
    return np.vstack([rim, centre]), [("triangle", cell)]


def test_a_sweep_moves_only_relaxed_vertices_and_puts_the_centre_of_a_hexagon_right() -> None:
    points, cells = hexagon((0.3, 0.0))
    after = oracle.gauss_seidel_sweep(points, cells, np.array([6]), np.array([[2.0, 0.0]]))
    assert after[:6].tolist() == points[:6].tolist()
    assert after[6] == pytest.approx([0, 0], abs=1e-9)
    assert points[6].tolist() == [0.3, 0.0]  # the caller's points are left alone


def test_a_vertex_with_zero_direction_or_without_hope_stays() -> None:
    points, cells = hexagon((0.3, 0.0))
    still = oracle.gauss_seidel_sweep(points, cells, np.array([6]), np.zeros((1, 2)))
    assert still.tolist() == points.tolist()
    points, cells = hexagon((0.0, 3.0))
    still = oracle.gauss_seidel_sweep(points, cells, np.array([6]), np.array([[1.0, 0.0]]))
    assert still.tolist() == points.tolist()


def test_a_sweep_takes_the_vertices_one_after_the_other() -> None:
    # two hexagons' worth of triangles sharing an edge: vertices 0 and 1 are neighbours
    points = np.array([[0.2, 0.1], [1.1, -0.1], [0, -1], [1.2, -1], [2, 0], [1, 1], [0, 1], [-1, 0.0]])
    cell = np.array([[0, 2, 1], [1, 2, 3], [1, 3, 4], [1, 4, 5], [0, 1, 5], [0, 5, 6], [0, 6, 7], [0, 7, 2]])
    cells = [("triangle", cell)]
    directions = np.array([[1.0, 0.3], [0.2, 1.0]])
    for relaxed in (np.array([0, 1]), np.array([1, 0])):
        expected = points.copy()
        worst = [min(oracle.element_quality("triangle", expected[tri]) for tri in cell)]
        for vertex, direction in zip(relaxed, directions, strict=True):
            ring = oracle.ring_of(expected, cells, vertex)
            expected[vertex] += oracle.line_problem(ring, expected[vertex], direction)[0] * direction
            worst.append(min(oracle.element_quality("triangle", expected[tri]) for tri in cell))
        assert worst[0] > 0
        assert np.diff(worst).min() >= -1e-12
        assert oracle.gauss_seidel_sweep(points, cells, relaxed, directions).tolist() == expected.tolist()
    one = oracle.gauss_seidel_sweep(points, cells, np.array([0, 1]), directions)
    other = oracle.gauss_seidel_sweep(points, cells, np.array([1, 0]), directions[::-1])
    assert np.abs(one - other).max() > 1e-3
