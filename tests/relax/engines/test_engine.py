"""What must hold of every sweep: the guarantee, the sequence of the paper, and what stays untouched."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oracle
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.rings import incidence_of
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.vector import at_least, ring_minima
from dvr_cli.relax.directions import direction_field
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.schedule import ORDERS
from meshes import KINDS, delaunay, random_mesh

EXAMPLES = 40


def vector(domain, points):
    """The quality vector (paper eq. 8)."""
    minima = ring_minima(corner_qualities(points, domain.corners), domain.corners, len(points))
    return np.sort(minima[domain.interior])


def batches_of(mesh, sweeps, order="coloured", seed=0, directions=("random",)):
    """The domain, and the coordinates before the first and after each batch of some sweeps."""
    domain = domain_of(mesh)
    assert domain.interior.any()
    problem = build_problem(domain.corners, np.flatnonzero(domain.interior), domain.points, order, seed)
    field = direction_field(directions, domain, {}, seed)
    engine = NumpyEngine(problem)
    engine.load(domain.points)

    def states():
        yield engine.points
        for sweep in range(sweeps):
            directions = field(sweep, engine.relaxed_points, problem.relaxed)
            for batch in range(engine.batches):
                engine.relax_batch(batch, directions)
                yield engine.points

    return domain, states()


@settings(max_examples=EXAMPLES, deadline=None)
@given(st.sampled_from(KINDS), st.integers(0, 10**6), st.sampled_from(ORDERS), st.floats(0, 0.45))
def test_quality_never_decreases_after_any_batch(kind, seed, order, noise):
    mesh = random_mesh(kind, seed, noise=noise)
    domain, states = batches_of(mesh, 3, order, seed)
    last = None
    for points in states:
        now = vector(domain, points)
        if last is not None:
            assert at_least(now, last)  # no tolerance
            if last[0] > 0:
                assert now[0] > 0
        last = now


@pytest.mark.parametrize("shift", [1e6, -3e7])
@pytest.mark.parametrize("kind", KINDS)
def test_quality_never_decreases_far_from_the_origin(kind, shift):
    mesh = random_mesh(kind, 7)
    moved = Mesh(mesh.points + shift / 3, mesh.cells)
    domain, states = batches_of(moved, 5)
    first = last = vector(domain, next(states))
    for points in states:
        now = vector(domain, points)
        assert at_least(now, last)
        last = now
    assert last[0] > first[0]


@settings(max_examples=EXAMPLES, deadline=None)
@given(st.integers(0, 10**6), st.integers(-9, 9), st.floats(1e-9, 1))
def test_badly_scaled_meshes_never_get_worse(seed, scale, flatness):
    mesh = delaunay(40, 3, seed)
    squeezed = Mesh(mesh.points * [1, 1, flatness] * 10.0**scale, mesh.cells)
    domain, states = batches_of(squeezed, 2)
    last = vector(domain, next(states))
    for points in states:
        now = vector(domain, points)
        assert at_least(now, last)
        last = now


@pytest.mark.parametrize("kind", KINDS)
def test_natural_order_is_the_sequence_of_algorithm_1_bit_for_bit(kind):
    """Level sets give what updating one vertex after the other in index order gives."""
    mesh = random_mesh(kind, 3)
    domain, states = batches_of(mesh, 2, "natural")
    *_, together = states
    relaxed = np.flatnonzero(domain.interior)
    problem = build_problem(domain.corners, relaxed, domain.points, "natural")
    vertices = problem.rings.vertices[np.argsort(problem.relaxed)]
    incidence = incidence_of(problem.touched, vertices, len(mesh.points))
    rings = incidence.rings(problem.touched, np.arange(len(relaxed)))
    one_by_one = replace(problem, rings=rings, batch_start=np.arange(len(relaxed) + 1))
    assert one_by_one.relaxed.tolist() == relaxed.tolist()
    engine = NumpyEngine(one_by_one)
    engine.load(domain.points)
    field = direction_field(["random"], domain, {}, 0)
    for sweep in range(2):
        directions = field(sweep, engine.relaxed_points, relaxed)
        for vertex in range(len(relaxed)):
            engine.relax_batch(vertex, directions)
    assert engine.points.tobytes() == together.tobytes()


@pytest.mark.parametrize("kind", KINDS)
def test_a_sweep_is_that_of_the_oracle(kind):
    """The paper's Algorithm 1 with Algorithm 2, vertex by vertex in plain loops."""
    mesh = random_mesh(kind, 5, n=3 if kind != "triangle" else 4)
    domain, states = batches_of(mesh, 1, "natural")
    *_, ours = states
    relaxed = np.flatnonzero(domain.interior)
    directions = direction_field(["random"], domain, {}, 0)(0, mesh.points[relaxed], relaxed)
    cells = [(block.type, np.asarray(block.vertices)) for block in mesh.cells]
    theirs = oracle.gauss_seidel_sweep(mesh.points, cells, relaxed, directions)
    np.testing.assert_allclose(ours, theirs, atol=1e-6)
    np.testing.assert_allclose(vector(domain, ours), vector(domain, theirs), atol=1e-8)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("kind", KINDS)
def test_only_relaxed_vertices_move(kind, order):
    mesh = random_mesh(kind, 11)
    domain, states = batches_of(mesh, 3, order)
    *_, points = states
    assert points[~domain.interior].tobytes() == mesh.points[~domain.interior].tobytes()
    assert (points[domain.interior] != mesh.points[domain.interior]).any()


def test_ring_that_can_be_made_positive_is_solved_there():
    """A vertex outside the polygon of its ring comes back in: the best point of the line, not 0."""
    angles = np.arange(6) * np.pi / 3
    points = np.vstack([np.column_stack([np.cos(angles), np.sin(angles)]), [[3.0, 0.0]]])
    triangles = np.array([[i, (i + 1) % 6, 6] for i in range(6)])
    domain, states = batches_of(Mesh(points, [Cells("triangle", triangles)]), 1, directions=("x",))
    before = next(states)
    assert vector(domain, before)[0] < 0
    *_, after = states
    np.testing.assert_allclose(after[6], [0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(vector(domain, after), [1.0], rtol=1e-12)


def test_hopeless_ring_is_left_alone():
    """A boundary that crosses itself admits no valid position; the vertex must not move at all."""
    points = np.array([[0, 0], [2, 1], [2, 0], [0, 1], [0.9, 0.4]])
    triangles = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    domain, states = batches_of(Mesh(points, [Cells("triangle", triangles)]), 4)
    assert domain.interior.tolist() == [False] * 4 + [True]
    *_, after = states
    assert after.tobytes() == points.tobytes()


def test_zero_directions_leave_vertices_where_they_are():
    mesh = random_mesh("tetra", 1)
    directions = np.random.default_rng(0).normal(size=mesh.points.shape)
    directions[::2] = 0
    _, states = batches_of(mesh, 2, directions=(directions,))
    *_, points = states
    moved = (points != mesh.points).any(axis=1)
    assert not moved[::2].any()
    assert moved[1::2].any()
