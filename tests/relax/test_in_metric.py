"""Relaxing in a metric: the guarantee, derivatives against differences, the same bytes on both engines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dvr_cli.boundary.freedom import Freedom, interior_freedom, unit
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.metric import metric_on
from dvr_cli.quality.vector import at_least, ring_minima
from dvr_cli.relax.engines.choice import KINDS as ENGINES
from dvr_cli.relax.patches.phase import relax_patches
from dvr_cli.relax.patches.solver import Patch, PatchEnergy
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.steepest import OPTIMAL, STEEPEST
from dvr_cli.relax.stopping import Stopping
from dvr_cli.relax.untangle.energy import Energy
from meshes import KINDS, outside, random_freedom, random_mesh, random_tensors
from needs import require


def in_metric(mesh, seed):
    """The domain of a mesh, measured in tensors that have nothing to do with each other."""
    domain = domain_of(mesh)
    tensors = random_tensors(len(domain.points), domain.dimension, seed)
    return replace(domain, corners=metric_on(domain, tensors).corners)


def vector(domain, points, relaxed):
    """The quality vector (paper eq. 8)."""
    minima = ring_minima(corner_qualities(points, domain.corners), domain.corners, len(points))
    return np.sort(minima[relaxed])


def all_phases(domain, engine, seed):
    """Run every way to move a vertex; yields what happened after each batch or phase."""
    d, problem = domain.dimension, engine.problem
    engine.load(domain.points)
    directions = np.random.default_rng(seed).normal(size=(len(problem.rings.vertices), d))
    if problem.freedom is not None:
        directions = problem.freedom.directions(directions, np.arange(len(directions)))
    for how in (directions, STEEPEST, OPTIMAL):
        for batch in range(engine.batches):
            yield engine.move_batch(batch, how)
    outcome = relax_patches(engine, Stopping(max_iterations=4))
    yield from ((sweep.q1, sweep.moved) for sweep in outcome.sweeps)
    q1 = engine.q1()
    limit = q1 ** (-1 if d == 2 else -3) if q1 > 0 else np.inf
    for batch in range(engine.batches):
        yield engine.polish_batch(batch, limit)


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(KINDS), st.integers(0, 10**6), st.booleans(), st.sampled_from([0.0, 1e6]))
def test_quality_in_the_metric_never_decreases(kind, seed, whole, shift):
    """After every batch of sweeps and after patches, on lines and in planes, far from the origin too.

    Polishing keeps Q1, not the vector.
    """
    domain = in_metric(random_mesh(kind, seed, n=2), seed)
    domain = replace(domain, points=domain.points + shift)
    freedom = None if whole else random_freedom(domain, seed)
    relaxed = np.flatnonzero(domain.interior)
    engine = ENGINES["numpy"].make(build_problem(domain.corners, relaxed, domain.points, freedom=freedom), 1)
    before = vector(domain, domain.points, relaxed)
    sweeps = 3 * engine.batches
    for done, happened in enumerate(all_phases(domain, engine, seed)):
        after = vector(domain, engine.points, relaxed)
        if done < sweeps or isinstance(happened, tuple):
            assert at_least(after, before)
            before = after
        elif len(after):  # polishing, with the minimum reached before it for its floor
            assert after[0] >= before[0]


@pytest.mark.long  # to compile all kernels for metrics takes as long as many tests
@settings(max_examples=60, deadline=None)
@example("tetra", 1, 0.3, False, 1)
@example("hexahedron", 2, 0.3, False, 3)
@example("triangle", 1, 0.3, False, 1)
@given(
    st.sampled_from(KINDS),
    st.integers(0, 10**6),
    st.floats(0, 0.9),
    st.booleans(),
    st.sampled_from([1, 3]),
)
def test_same_bytes_on_both_engines(kind, seed, noise, whole, threads):
    require("numba")
    domain = in_metric(random_mesh(kind, seed, n=3, noise=noise), seed)
    freedom = None if whole else random_freedom(domain, seed)
    relaxed = np.flatnonzero(domain.interior)
    problem = build_problem(domain.corners, relaxed, domain.points, freedom=freedom)
    reached = []
    for engine in (ENGINES["numpy"].make(problem, 1), ENGINES["numba"].make(problem, threads)):
        happened = list(all_phases(domain, engine, seed))
        reached.append((engine.points.tobytes(), happened, engine.q1()))
    assert reached[0] == reached[1]


def test_compiled_qualities_have_the_same_bytes():
    require("numba")
    from dvr_cli.backend import COMPILED

    for kind in KINDS:
        domain = in_metric(random_mesh(kind, 1, noise=0.9), 1)
        plain = corner_qualities(domain.points, domain.corners)
        assert corner_qualities(domain.points, domain.corners, COMPILED).tobytes() == plain.tobytes()


@pytest.mark.parametrize("kind", KINDS)
def test_ascents_make_the_worst_corner_better(kind):
    """Along their directions the minimum of each ring grows a little further on."""
    domain = in_metric(random_mesh(kind, 2), 3)
    relaxed = np.flatnonzero(domain.interior)
    engine = ENGINES["numpy"].make(build_problem(domain.corners, relaxed, domain.points), 1)
    engine.load(domain.points)
    problem, raised = engine.problem, 0
    for batch in range(engine.batches):
        directions = engine.steepest(batch, 1e-9)
        for ring in range(*problem.batch_start[batch : batch + 2].tolist()):
            vertex = problem.order[problem.rings.vertices[ring]]
            touched = domain.corners.part((domain.corners.vertices == vertex).any(axis=1))
            now, moved = corner_qualities(domain.points, touched).min(), domain.points.copy()
            moved[vertex] += 1e-7 * directions[ring]
            if now > 0 and directions[ring].any():
                assert corner_qualities(moved, touched).min() > now
                raised += 1
    assert raised > 0


@pytest.mark.parametrize("kind", KINDS)
def test_the_gradient_of_patches_against_differences(kind):
    domain = in_metric(random_mesh(kind, 4), 6)
    quality = corner_qualities(domain.points, domain.corners)
    d, points = domain.dimension, domain.points.copy()
    moving = np.flatnonzero(domain.interior)[:3]
    corners = domain.corners.part(np.isin(domain.corners.vertices, moving).any(axis=1) & (quality > 0))
    slot = np.full(len(points), -1)
    slot[moving] = np.arange(len(moving))
    free = np.full(len(points), d, dtype=np.uint8), np.zeros_like(points)
    table = corners.table
    patch = Patch(
        moving,
        corners.vertices,
        np.ascontiguousarray(corners.shapes[:, 0]),
        slot,
        table.norm,
        table.factor,
        *free,
        enough=0.0,
        bearable=np.inf,
        altitude=0.0,
    )
    energy = PatchEnergy(points, patch)
    reference = energy.badness().max()
    f, share = energy.norm(reference, 3)
    gradient, h = energy.gradient(f, share), 1e-6 * energy.size
    for row, vertex in enumerate(moving):
        for i in range(d):
            at, values = points[vertex, i], []
            for step in (-h, h):
                points[vertex, i] = at + step
                values.append(energy.norm(reference, 3)[0])
            points[vertex, i] = at
            difference = (values[1] - values[0]) / (2 * h)
            assert gradient[row, i] == pytest.approx(difference, rel=1e-4, abs=1e-5 * f / energy.size)


@pytest.mark.parametrize("kind", KINDS)
def test_the_gradient_of_the_energy_of_untangling_against_differences(kind):
    domain = in_metric(random_mesh(kind, 1, noise=0.9), 8)
    energy = Energy(domain.points, domain.corners, interior_freedom(domain.interior, domain.dimension))
    x = 0.05 * np.random.default_rng(0).normal(size=domain.dimension * domain.interior.sum())
    value, gradient = energy.regularised(x, 0.1)
    for i in range(len(x)):
        values = []
        for step in (-1e-6, 1e-6):
            moved = x.copy()
            moved[i] += step
            values.append(energy.regularised(moved, 0.1)[0])
        assert gradient[i] == pytest.approx((values[1] - values[0]) / 2e-6, rel=1e-4, abs=1e-6 * value)


def test_without_regularisation_the_energy_is_the_sum_of_the_inverse_qualities_in_the_metric():
    domain = in_metric(random_mesh("tetra", 1, noise=0.1), 2)
    free = interior_freedom(domain.interior, 3)
    nowhere = np.zeros(3 * len(free.relaxed))
    value, _ = Energy(domain.points, domain.corners, free).regularised(nowhere, 0.0)
    touched = domain.interior[domain.corners.vertices].any(axis=1)
    quality = corner_qualities(domain.points, domain.corners)[touched]
    assert quality.min() > 0
    assert value == pytest.approx((1 / quality).sum())


def test_rows_of_several_rings_stand_in_the_order_in_which_corners_name_them():
    """A problem with many rows of its own has those that are named, and each corner the numbers it had."""
    domain = in_metric(random_mesh("tetra", 1, n=6), 1)
    relaxed = np.flatnonzero(domain.interior)[::2]
    problem = build_problem(domain.corners, relaxed, domain.points)
    touched, corners = problem.touched, domain.corners
    assert len(touched.table.norm) < len(corners.table.norm)
    shared = np.bincount(problem.rings.shapes, minlength=len(touched.table.norm)) > 1
    assert shared.any()
    named = touched.shapes[shared[touched.shapes]]
    _, first = np.unique(named, return_index=True)
    assert (np.diff(first) > 0).all()
    for name in ("matrices", "norm", "slope", "curvature", "factor"):
        rows = getattr(corners.table, name)[corners.shapes[problem.touched_ids]]
        assert (getattr(touched.table, name)[touched.shapes] == rows).all()


SHEAR = np.array([[3.0, 0.8, -0.4], [0.0, 0.5, 0.3], [0.0, 0.0, 1.1]])  # triangular, as L is: the same axes


def sheared(mesh, freedom):
    """The domain and the freedom of a mesh in a sheared space, in the metric that undoes it; the map."""
    d = mesh.points.shape[1]
    by = SHEAR[:d, :d]
    back = np.linalg.inv(by)
    domain = domain_of(Mesh(mesh.points @ by.T, mesh.cells))
    corners = metric_on(domain, np.tile(back.T @ back, (len(mesh.points), 1, 1))).corners
    lines = (freedom.dimension == 1)[:, None]
    axis = unit(np.where(lines, freedom.axis @ by.T, freedom.axis @ back))
    return replace(domain, corners=corners), Freedom(freedom.dimension, axis), by


def engines_of(kind):
    """Engines for a mesh with vertices on lines, in planes and free, and for the same sheared; the map."""
    mesh = random_mesh(kind, 3, n=4, noise=0.3)
    plain = domain_of(mesh)
    assert corner_qualities(plain.points, plain.corners).min() > 0
    freedom = random_freedom(plain, 3)
    domain, held, by = sheared(mesh, freedom)
    engines = []
    for one, free in ((plain, freedom), (domain, held)):
        problem = build_problem(one.corners, free.relaxed, one.points, order="natural", freedom=free)
        engines.append(ENGINES["numpy"].make(problem, 1))
        engines[-1].load(one.points)
    return *engines, by


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("band", [0.002, 1e-9, None])
def test_a_sheared_mesh_has_the_directions_of_the_unsheared_on_lines_and_in_planes(kind, band):
    """In its metric; of steepest ascent, and, without a band, of the mean.

    With a wide band the order of exchanges between many gradients is a matter of rounding.
    """
    plain, far, by = engines_of(kind)
    pairs = []
    for engine, through in ((plain, by), (far, np.eye(len(by)))):
        found = np.zeros((len(engine.coordinates), len(by)))
        for batch in range(engine.batches):
            rows = slice(*engine.problem.batch_start[batch : batch + 2].tolist())
            if band is None:
                start = engine.relaxed_points
                engine.polish_batch(batch, np.inf)
                ascent = engine.relaxed_points - start
            else:
                ascent = engine.steepest(batch, band)
            found[engine.problem.relaxed[rows]] = ascent[rows] @ through.T
        pairs.append(unit(found))
    assert np.count_nonzero(pairs[0].any(axis=1)) > len(plain.problem.relaxed) / 5
    np.testing.assert_allclose(pairs[1], pairs[0], atol=1e-7)


@pytest.mark.parametrize("kind", ["tetra", "hexahedron", "mixed3d"])
def test_patches_of_a_sheared_mesh_move_as_those_of_the_unsheared_on_lines_and_in_planes(kind):
    plain, far, by = engines_of(kind)
    before = plain.points
    for engine in (plain, far):
        relax_patches(engine, Stopping(max_iterations=1))
    assert np.abs(plain.points - before).max() > 1e-3
    np.testing.assert_allclose(far.points, plain.points @ by.T, atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_untangling_measures_a_sheared_mesh_as_the_unsheared(kind):
    """Energy and gradient are the same functions of the displacements, so all steps are the same."""
    mesh = random_mesh(kind, 3, noise=0.9)
    plain = domain_of(mesh)
    freedom = random_freedom(plain, 3)
    domain, held, by = sheared(mesh, freedom)
    one = Energy(plain.points, plain.corners, freedom)
    other = Energy(domain.points, domain.corners, held)
    x = np.zeros(domain.dimension * len(freedom.relaxed))
    for _ in range(3):
        (value, gradient), (far, far_gradient) = one.regularised(x, 0.1), other.regularised(x, 0.1)
        assert far == pytest.approx(value, rel=1e-9)
        np.testing.assert_allclose(far_gradient, gradient, atol=1e-9 * np.abs(gradient).max())
        np.testing.assert_allclose(other.points_after(x), one.points_after(x) @ by.T, atol=1e-9)
        x -= 0.1 / np.abs(gradient).max() * gradient


@pytest.mark.parametrize("kind", ["triangle", "tetra", "hexahedron"])
def test_untangling_in_a_metric_keeps_lines_and_planes_and_descends_in_them(kind):
    domain = in_metric(random_mesh(kind, 1, noise=0.9), 8)
    freedom = random_freedom(domain, 2)
    energy = Energy(domain.points, domain.corners, freedom)
    x = np.zeros(domain.dimension * len(freedom.relaxed))
    _, gradient = energy.regularised(x, 0.1)
    shift = np.zeros_like(domain.points)
    shift[freedom.relaxed] = energy.points_after(-1e-3 * gradient) - domain.points[freedom.relaxed]
    assert np.abs(outside(freedom, shift)).max() <= 1e-12 * max(1.0, np.abs(shift).max())
    step = 1e-6 * gradient / np.linalg.norm(gradient)
    ends = [energy.regularised(side * step, 0.1)[0] for side in (-1, 1)]
    assert (ends[1] - ends[0]) / 2e-6 == pytest.approx(np.linalg.norm(gradient), rel=1e-4)
