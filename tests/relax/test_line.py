"""The line problem against the paper's Algorithm 2 by polynomial roots, on random rings."""

from itertools import pairwise

import numpy as np
import pytest

import oracle
from dvr_cli.mesh.corners import ORIGIN_FIRST, target_matrix
from dvr_cli.mesh.domain import domain_of
from dvr_cli.quality.badness import badness
from dvr_cli.relax.directions import random_field
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.line import Lines, coefficients, improves, maximise_minimum
from dvr_cli.relax.problem import build_problem
from meshes import delaunay

KINDS = [
    "2d",
    "3d",
    "quad",
    "hex",
    "wedge",
    "pyramid",
    "nearly_flat",
    "tie",
    "parallel",
    "unbounded",
    "tangled_solvable",
]
TRIALS = pytest.mark.parametrize("trials", [15, pytest.param(200, marks=pytest.mark.long)])
GOLDEN = (5**0.5 - 1) / 2


def lines_of(ring, x, direction):
    """The coefficients of one ring, as the engine would compute them from the ring's points."""
    d = len(x)
    ends = np.empty((d, d, len(ring), 1))  # edge end, component, corner, vertex
    norm = np.empty((d * (d + 1) // 2, len(ring), 1))
    slope = np.empty((d, len(ring), 1))
    curvature = np.empty((len(ring), 1))
    for c, (points, k, target) in enumerate(ring):
        order = ORIGIN_FIRST[d][k]
        ends[:, :, c, 0] = points[order[1:]]
        m = target_matrix((oracle.REGULAR_SIMPLEX[d] if target is None else target)[order])
        norm[:, c, 0] = [*np.diag(m), *(2 * m[np.triu_indices(d, 1)])]
        slope[:, c, 0] = m.sum(axis=1)
        curvature[c, 0] = m.sum()
    return coefficients(
        [np.array([xi]) for xi in x], [np.array([di]) for di in direction], ends, norm, slope, curvature
    )


def minimum(ring, x, direction, step):
    return oracle.ring_qualities(ring, x, direction, np.array([step])).min()


@TRIALS
@pytest.mark.parametrize("kind", KINDS)
def test_solution_is_that_of_algorithm_2(kind, trials):
    rng = np.random.default_rng(KINDS.index(kind))
    solved = located = 0
    for _ in range(trials):
        ring, x, direction = oracle.random_ring(rng, kind)
        best = oracle.line_problem(ring, x, direction)
        step, _ = maximise_minimum(lines_of(ring, x, direction))
        ours = minimum(ring, x, direction, step[0])
        assert best is not None
        there, quality = best
        assert ours >= quality - 1e-9
        solved += 1
        size = np.linalg.norm(ring[0][0] - x, axis=1).max() / np.linalg.norm(direction)
        for reach in (1e-7, 1e-6, 1e-5, 1e-4, 1e-3):  # how far off a solution with that quality can be
            around = [minimum(ring, x, direction, there + side * reach * size) for side in (-1, 1)]
            if quality - max(around) > 2e-9:
                assert abs(step[0] - there) <= reach * size
                located += 1
                break
    assert solved == trials
    assert located > 0.95 * trials


@TRIALS
def test_vertices_are_left_where_no_step_makes_their_ring_positive(trials):
    rng = np.random.default_rng(5)
    for _ in range(trials):
        ring, x, direction = oracle.random_ring(rng, "tangled_hopeless")
        assert oracle.line_problem(ring, x, direction) is None
        step, _ = maximise_minimum(lines_of(ring, x, direction))
        assert step[0] == 0.0


def test_a_ring_gets_the_same_step_in_any_company():
    """Vertices are solved side by side, and none must feel its neighbours in the arrays."""
    rng = np.random.default_rng(11)
    rings = [oracle.random_ring(rng, "3d") for _ in range(64)]
    lines = [lines_of(*ring) for ring in rings]
    size = max(len(one.v0) for one in lines)
    padded = [[(0, 0), (0, size - len(one.v0)), (0, 0)] for one in lines]
    terms = [np.pad(one.terms, width, mode="edge") for one, width in zip(lines, padded, strict=True)]
    s2 = [np.pad(one.s2, width[1:], mode="edge") for one, width in zip(lines, padded, strict=True)]
    together = Lines(np.concatenate(terms, axis=2), np.concatenate(s2, axis=1), 3)
    alone = [maximise_minimum(lines_of(*ring))[0][0] for ring in rings]
    assert maximise_minimum(together)[0].tolist() == alone


@pytest.mark.parametrize("dimension", [2, 3])
def test_badness_orders_corners_as_the_mean_ratio_does(dimension):
    rng = np.random.default_rng(dimension)
    simplices = rng.random((500, dimension + 1, dimension))
    quality = oracle.mean_ratio(simplices)
    edges = simplices[:, 1:] - simplices[:, :1]
    v = np.linalg.det(edges)
    target = oracle.REGULAR_SIMPLEX[dimension]
    s = np.einsum("nji,jk,nki->n", edges, target_matrix(target), edges)
    positive = quality > 0
    with np.errstate(divide="ignore"):
        b = badness(v, s, dimension)
    power = 1 if dimension == 2 else 3
    np.testing.assert_allclose(b[positive], quality[positive] ** -float(power), rtol=1e-9)
    assert np.isinf(b[~positive]).all()


def test_a_gain_within_rounding_is_no_gain():
    before = np.array([8.0, 8.0, 8.0, np.inf, np.inf, np.inf, 1e24])
    after = np.array([8.0, 8.0 * (1 - 1e-12), 8.0 * (1 - 1e-11), 8.0, np.inf, 1e26, 0.99e24])
    expected = [False, False, True, True, False, False, False]
    assert improves(before, after, 3).tolist() == expected


@pytest.mark.parametrize("n", [1000, pytest.param(3000, marks=pytest.mark.long)])
def test_no_point_of_its_line_is_better_for_any_vertex_of_a_triangulation(n):
    # in one update of a thousand the corners that decide cross three times, and the middle crossing counts
    mesh = delaunay(n, 2, 3)
    domain = domain_of(mesh)
    problem = build_problem(domain.corners, np.flatnonzero(domain.interior), domain.points)
    engine = NumpyEngine(problem)
    engine.load(domain.points)
    triangles = mesh.cells[0].vertices
    around = [np.flatnonzero((triangles == vertex).any(axis=1)) for vertex in problem.relaxed]
    most = max(map(len, around))
    around = triangles[[np.resize(ring, most) for ring in around]]  # short rings repeat their triangles
    updates = 0
    for sweep in range(4):
        directions = random_field(2, 0)(sweep, engine.relaxed_points, problem.relaxed)
        for batch, (lo, hi) in enumerate(pairwise(problem.batch_start)):
            ring, vertices = around[lo:hi], problem.relaxed[lo:hi]
            best = highest_minima(engine.points[ring], ring == vertices[:, None, None], directions[lo:hi])
            engine.relax_batch(batch, directions)
            reached = triangle_qualities(engine.points[ring]).min(axis=1)
            assert (reached >= best - 1e-9).all()
            updates += hi - lo
    assert updates > 10 / 3 * n


def highest_minima(corners, own, directions):
    """The best minimum quality of each ring as its vertex moves along its line, by golden section search.

    corners: (n, K, 3, 2); own: (n, K, 3) bool, which of them is the ring's vertex; directions: (n, 2).
    """

    def moved(step):
        return corners + own[..., None] * (step[:, None] * directions)[:, None, None, :]

    none = np.zeros(len(corners))
    v0 = areas(moved(none))
    v1 = areas(moved(none + 1)) - v0
    low = np.where(v1 > 0, -v0 / v1, -np.inf).max(axis=1)
    high = np.where(v1 < 0, -v0 / v1, np.inf).min(axis=1)
    for _ in range(70):
        a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        left = triangle_qualities(moved(a)).min(axis=1) > triangle_qualities(moved(b)).min(axis=1)
        low, high = np.where(left, low, a), np.where(left, b, high)
    return triangle_qualities(moved(0.5 * (low + high))).min(axis=1)


def areas(triangles):
    """Twice the signed areas of triangles (..., 3, 2)."""
    p, q = triangles[..., 1, :] - triangles[..., 0, :], triangles[..., 2, :] - triangles[..., 0, :]
    return p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]


def triangle_qualities(triangles):
    """Mean ratios: 2 sqrt(3) times twice the area over the sum of the squared edges."""
    edges = triangles - np.roll(triangles, 1, axis=-2)
    return 2 * np.sqrt(3) * areas(triangles) / (edges**2).sum(axis=(-1, -2))
