"""Relaxing in a metric: the guarantee, derivatives against differences, the same bytes on both engines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dvr_cli.boundary.freedom import interior_freedom
from dvr_cli.mesh.domain import domain_of
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
from meshes import KINDS, random_freedom, random_mesh, random_tensors
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
        yield engine.polish_batch(batch, engine.mean_ascent(batch), limit)


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


@settings(max_examples=20, deadline=None)
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
        0.0,
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


def test_rows_of_the_table_stand_in_the_order_in_which_corners_name_them():
    """A problem with many rows of its own has those that are named, and each corner the numbers it had."""
    domain = in_metric(random_mesh("tetra", 1, n=6), 1)
    relaxed = np.flatnonzero(domain.interior)[::2]
    problem = build_problem(domain.corners, relaxed, domain.points)
    touched, corners = problem.touched, domain.corners
    assert len(touched.table.norm) < len(corners.table.norm)
    named = touched.shapes.ravel()
    _, first = np.unique(named, return_index=True)
    assert (np.diff(first) > 0).all()
    for name in ("matrices", "norm", "slope", "curvature", "factor"):
        rows = getattr(corners.table, name)[corners.shapes[problem.touched_ids]]
        assert (getattr(touched.table, name)[touched.shapes] == rows).all()
