"""Directions of steepest ascent, and the optimum over the whole space that following them leads to."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

import oracle
from dvr_cli.boundary.freedom import Freedom
from dvr_cli.mesh.corners import SHAPES
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.vector import at_least, ring_minima
from dvr_cli.relax.directions import direction_field, restrict_field
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.steepest import OPTIMAL, SHORTEST, STEEPEST, Ascent, _shortest_in_hull, gradient
from meshes import KINDS, outside, random_freedom, random_mesh


def loaded(mesh, freedom=None) -> tuple[Engine, object]:
    """An engine with the mesh's coordinates, and its domain."""
    domain = domain_of(mesh)
    relaxed = np.flatnonzero(domain.interior) if freedom is None else freedom.relaxed
    problem = build_problem(domain.corners, relaxed, domain.points, freedom=freedom)
    engine = NumpyEngine(problem)
    engine.load(domain.points)
    return engine, domain


def vector(domain, points, relaxed):
    """The quality vector (paper eq. 8)."""
    minima = ring_minima(corner_qualities(points, domain.corners), domain.corners, len(points))
    return np.sort(minima[relaxed])


def ring_inverses(mesh, vertex):
    """The function that gives 1/Q of all corners around a vertex, by the oracle's ring."""
    cells = [(block.type, np.asarray(block.vertices)) for block in mesh.cells]
    ring = oracle.ring_of(mesh.points, cells, vertex)

    def inverses(x):
        qualities = oracle.ring_qualities(ring, np.asarray(x), np.zeros(len(x)), 0.0)
        return np.where(qualities > 0, 1.0 / np.where(qualities > 0, qualities, 1.0), 1e9)

    return inverses


# -------------------------------------------------------------------------- the shortest vector in a hull


def shortest_by_brute_force(vectors):
    """The shortest vector in the hull of a few: the best over the affine hulls of all their subsets."""
    best = vectors[np.linalg.norm(vectors, axis=1).argmin()]
    for size in range(2, vectors.shape[1] + 2):
        for rows in combinations(vectors, size):
            chosen = np.array(rows)
            system = np.block([[chosen @ chosen.T, np.ones((size, 1))], [np.ones(size), 0.0]])
            weight = np.linalg.lstsq(system, np.append(np.zeros(size), 1.0), rcond=None)[0][:-1]
            if weight.min() >= -1e-12 and np.linalg.norm(weight @ chosen) < np.linalg.norm(best):
                best = weight @ chosen
    return best


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([2, 3]), st.integers(1, 7), st.floats(0, 3))
def test_all_vectors_of_the_hull_shorten_along_what_is_found(seed, d, k, shift):
    """Nearly as fast as along the shortest vector; nothing is found only where that is short."""
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(k, d)) + shift * np.eye(d)[0]
    found = _shortest_in_hull(
        list(vectors.T[:, :, None]), np.ones((k, 1), dtype=bool), np.array([int(rng.integers(k))])
    )
    direction = np.concatenate(found)
    shortest = np.linalg.norm(shortest_by_brute_force(vectors))
    if direction.any():
        assert np.linalg.norm(direction) == pytest.approx(1, rel=1e-14)
        assert (vectors @ direction).max() <= -SHORTEST * shortest * (1 - 1e-9)
    else:
        assert shortest < 0.1 * np.linalg.norm(vectors, axis=1).max()


def test_vectors_that_are_not_active_do_not_count():
    vectors = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]])
    active = np.array([[True], [False], [True]])
    found = np.concatenate(_shortest_in_hull(list(vectors.T[:, :, None]), active, np.array([0])))
    np.testing.assert_allclose(found, -np.sqrt([0.5, 0.5]))


# ------------------------------------------------------------------------------------------ the gradients


@pytest.mark.parametrize("d", [2, 3])
def test_the_gradient_is_that_of_the_logarithm(d):
    """By central differences, for every shape of the table."""
    rng = np.random.default_rng(0)
    table = SHAPES[d]

    def log_inverse(x, ends, k):
        edges = ends - x
        s = sum(
            (table.norm[k, j] * edges[j] @ edges[j] for j in range(d)),
            sum(
                table.norm[k, d + i] * edges[a] @ edges[b]
                for i, (a, b) in enumerate(combinations(range(d), 2))
            ),
        )
        return np.log(s) - 2 / d * np.log(np.linalg.det(edges))

    for k in range(len(table.curvature)):
        ends = np.eye(d) + 0.2 * rng.normal(size=(d, d))
        x = 0.2 * rng.normal(size=d) - 0.5
        edges = [list((end - x)[:, None, None]) for end in ends]
        det = np.linalg.det(ends - x)
        normal = list(np.linalg.solve(ends - x, np.full(d, det))[:, None, None])
        s = np.exp(log_inverse(x, ends, k)) * det ** (2 / d)
        ours = gradient(edges, normal, np.array([[det]]), np.array([[s]]), table.slope[k])
        h = 1e-6
        steps = [log_inverse(x + h * e, ends, k) - log_inverse(x - h * e, ends, k) for e in np.eye(d)]
        expected = d / 2 * np.array(steps) / (2 * h)
        np.testing.assert_allclose(np.ravel(ours), expected, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("kind", KINDS)
def test_the_worst_gets_better_along_every_direction_found(kind):
    mesh = random_mesh(kind, 4)
    engine, domain = loaded(mesh)
    relaxed = engine.problem.relaxed
    found = 0
    for batch in range(engine.batches):
        lo, hi = engine.problem.batch_start[batch : batch + 2]
        directions = engine.steepest(batch, 0.02)[lo:hi]
        for vertex, direction in zip(relaxed[lo:hi], directions, strict=True):
            if direction.any():
                inverses = ring_inverses(mesh, vertex)
                x = domain.points[vertex]
                assert inverses(x + 1e-7 * direction).max() < inverses(x).max()
                found += 1
    assert found >= len(relaxed) / 2


def test_a_tangled_ring_is_led_back():
    """A vertex outside the polygon of its ring: determinants grow towards the inside."""
    angles = np.arange(6) * np.pi / 3
    points = np.vstack([np.column_stack([np.cos(angles), np.sin(angles)]), [[3.0, 0.2]]])
    mesh = Mesh(points, [Cells("triangle", np.array([[i, (i + 1) % 6, 6] for i in range(6)]))])
    engine, domain = loaded(mesh)
    assert vector(domain, points, [6])[0] < 0
    for _ in range(5):
        engine.move_batch(0, STEEPEST)
    assert vector(domain, engine.points, [6])[0] > 0.9


# ------------------------------------------------------------------------------------------ the guarantee


@settings(max_examples=12, deadline=None)
@given(
    st.sampled_from(KINDS),
    st.integers(0, 10**6),
    st.sampled_from([STEEPEST, OPTIMAL]),
    st.booleans(),
    st.floats(0, 0.5),
)
def test_quality_never_decreases_and_freedom_is_kept(kind, seed, ascent, whole, noise):
    mesh = random_mesh(kind, seed, n=2 if ascent is OPTIMAL else 3, noise=noise)
    freedom = None if whole else random_freedom(domain_of(mesh), seed)
    engine, domain = loaded(mesh, freedom)
    relaxed = engine.problem.relaxed
    last = vector(domain, domain.points, relaxed)
    for batch in range(engine.batches):
        before = engine.points
        moved = engine.move_batch(batch, ascent)
        assert moved == (engine.points != before).any(axis=1).sum()
        now = vector(domain, engine.points, relaxed)
        assert at_least(now, last)  # no tolerance
        last = now
    if freedom is not None:
        shift = engine.points - domain.points
        np.testing.assert_allclose(outside(freedom, shift), 0.0, atol=1e-14)


def test_a_plane_along_the_axes_is_kept_to_the_bit():
    mesh = random_mesh("tetra", 3)
    interior = domain_of(mesh).interior
    axis = np.where(interior[:, None], [0.0, 0.0, 1.0], 0.0)
    engine, domain = loaded(mesh, Freedom(np.where(interior, 2, 0).astype(np.uint8), axis))
    for batch in range(engine.batches):
        assert engine.move_batch(batch, OPTIMAL)
    assert engine.points[:, 2].tobytes() == domain.points[:, 2].tobytes()
    assert (engine.points[:, :2] != domain.points[:, :2]).any()


def test_the_field_hands_an_ascent_on():
    mesh = random_mesh("tetra", 3)
    domain = domain_of(mesh)
    field = direction_field(["steepest", "x", "optimal"], domain, {})
    for way in (field, restrict_field(field, random_freedom(domain, 0))):
        sweeps = [way(k, domain.points[:2], np.arange(2)) for k in range(4)]
        assert [sweeps[k] for k in (0, 2, 3)] == [STEEPEST, OPTIMAL, STEEPEST]
        assert sweeps[1].shape == (2, 3)


# ------------------------------------------------------------------------------------------- the optimum


@pytest.mark.parametrize("kind", KINDS)
def test_the_optimum_is_that_of_a_general_convex_solver(kind):
    """Minimise t with 1/Q <= t for all corners of a ring (Remark 4.8), to the accuracy of the last band."""
    mesh = random_mesh(kind, 1, n=2 if kind != "triangle" else 3)
    vertex = int(np.flatnonzero(domain_of(mesh).interior)[0])
    d = mesh.points.shape[1]
    freedom = np.zeros(len(mesh.points), dtype=np.uint8)
    freedom[vertex] = d
    engine, _ = loaded(mesh, Freedom(freedom, np.zeros((len(freedom), d))))
    engine.move_batch(0, OPTIMAL)
    inverses = ring_inverses(mesh, vertex)
    start = mesh.points[vertex]
    for _ in range(2):
        found = minimize(
            lambda z: z[-1],
            np.append(start, inverses(start).max()),
            constraints={"type": "ineq", "fun": lambda z: z[-1] - inverses(z[:-1])},
            method="SLSQP",
            options={"ftol": 1e-13, "maxiter": 200},
        )
        start = found.x[:-1]
    theirs = inverses(start).max()
    ours = inverses(engine.points[vertex]).max()
    assert ours <= theirs / (1 - OPTIMAL.bands[-1])
    assert inverses(mesh.points[vertex]).max() > theirs


def test_one_search_at_a_time_gets_there_too():
    """What OPTIMAL does in one sweep of a single vertex, bands of steepest ascent do one after the other."""
    mesh = random_mesh("tetra", 0, n=2)
    together, _ = loaded(mesh)
    together.move_batch(0, OPTIMAL)
    single, _ = loaded(mesh)
    for band in OPTIMAL.bands:
        for _ in range(OPTIMAL.searches):
            single.move_batch(0, Ascent((band,), 1))
    assert single.points.tobytes() == together.points.tobytes()
