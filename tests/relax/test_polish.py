"""Polishing: the sum of 1/Q along lines above a floor, and what holds of it sweep after sweep."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

import dvr_cli
import oracle
from dvr_cli.mesh.domain import domain_of
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.polish import inverse_power
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.stopping import Stopping
from dvr_cli.relax.sweeps import polish
from meshes import KINDS, delaunay, outside, random_freedom, random_mesh


def loaded(mesh, freedom=None):
    """An engine with the mesh's coordinates, and its domain."""
    domain = domain_of(mesh)
    relaxed = np.flatnonzero(domain.interior) if freedom is None else freedom.relaxed
    engine = NumpyEngine(build_problem(domain.corners, relaxed, domain.points, freedom=freedom))
    engine.load(domain.points)
    return engine, domain


def limit_of(floor, d):
    """The badness at a floor: 1/Q in 2D, 1/Q³ in 3D."""
    return 1 / floor if d == 2 else 1 / floor**3


@given(st.floats(1e-290, 1e290))
def test_the_power_without_a_power_function(v):
    assert inverse_power(np.array([v]))[0] == pytest.approx(1 / np.cbrt(v) ** 2, rel=2e-15)


@pytest.mark.parametrize("fraction", [0.999, 1.0, 0.0])
@pytest.mark.parametrize("kind", KINDS)
def test_each_vertex_moves_to_the_lowest_sum_above_the_floor_on_its_line(kind, fraction, monkeypatch):
    """Where no whole step is good enough; by SciPy on the interval that bisection finds above the floor."""
    monkeypatch.setattr("dvr_cli.relax.engines.numpy_engine.FALL", np.inf)
    mesh = random_mesh(kind, 2, n=2 if kind != "triangle" else 3)
    engine, domain = loaded(mesh)
    d = domain.dimension
    cells = [(block.type, np.asarray(block.vertices)) for block in mesh.cells]
    lo, hi = engine.problem.batch_start[:2]
    moved = 0
    for vertex in engine.problem.relaxed[lo:hi]:
        ring, x = oracle.ring_of(mesh.points, cells, vertex), domain.points[vertex]
        worst = oracle.ring_qualities(ring, x, np.zeros(d), 0.0).min()
        engine.load(domain.points)
        engine.polish_batch(0, limit_of(fraction * worst, d) if fraction * worst > 0 else np.inf)
        along = engine.points[vertex] - x
        if not along.any():
            continue
        moved += 1

        def qualities(step, ring=ring, x=x, along=along):
            return oracle.ring_qualities(ring, x, along, step)

        floor = fraction * worst
        low, high = oracle.positive_interval(ring, x, along)
        ends = []
        for end in (low, high):
            good, bad = 0.0, end
            for _ in range(100):
                middle = 0.5 * (good + bad)
                good, bad = (middle, bad) if qualities(middle).min() >= floor else (good, middle)
            ends.append(good)
        best = minimize_scalar(
            lambda step, qualities=qualities: (1 / qualities(step)).sum(),
            bounds=ends,
            method="bounded",
            options={"xatol": 1e-10},
        )
        now = oracle.ring_qualities(ring, engine.points[vertex], along, 0.0)
        assert now.min() >= floor
        at_start = (1 / qualities(0.0)).sum()
        assert (1 / now).sum() <= min(best.fun, at_start) * (1 + 1e-6)
    assert moved


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(KINDS),
    st.integers(0, 10**6),
    st.floats(0, 0.5),
    st.sampled_from([0.5, 0.999, 1.0]),
    st.booleans(),
)
def test_the_floor_holds_and_the_sum_falls_after_every_batch(kind, seed, noise, fraction, whole):
    mesh = random_mesh(kind, seed, noise=noise)
    freedom = None if whole else random_freedom(domain_of(mesh), seed)
    engine, domain = loaded(mesh, freedom)
    q1 = engine.q1()
    floor = fraction * q1
    limit = limit_of(floor, domain.dimension) if q1 > 0 else np.inf
    for _ in range(2):
        for batch in range(engine.batches):
            before, points = engine.qualities(), engine.points
            moved = engine.polish_batch(batch, limit)
            assert moved == (engine.points != points).any(axis=1).sum()
            after = engine.qualities()
            assert after.min() >= min(floor, q1)  # no tolerance
            if q1 > 0:
                assert (1 / after).sum() <= (1 / before).sum()
            else:
                assert after.min() == q1
    if freedom is not None:
        shift = engine.points - domain.points
        np.testing.assert_allclose(outside(freedom, shift), 0.0, atol=1e-14)


@pytest.mark.parametrize("shift", [1e6, -3e7])
def test_the_floor_holds_far_from_the_origin(shift):
    mesh = random_mesh("tetra", 7)
    mesh.points[:] += shift / 3
    engine, domain = loaded(mesh)
    q1 = engine.q1()
    for batch in range(engine.batches):
        engine.polish_batch(batch, limit_of(q1, 3))
        assert corner_qualities(engine.points, domain.corners).min() >= q1


def test_polishing_stops_when_the_mean_has_converged():
    engine, _ = loaded(delaunay(300, 3, 0))
    mean = engine.qualities().mean()
    outcome = polish(engine, 0.9 * engine.q1(), Stopping(tol=1e-3), done=7)
    assert outcome.stopped_because == "converged"
    assert [sweep.sweep for sweep in outcome.sweeps] == list(range(8, 8 + len(outcome.sweeps)))
    growth = np.diff([mean, *(sweep.mean for sweep in outcome.sweeps)])
    assert (growth[:-1] >= 1e-3).all()
    assert growth[-1] < 1e-3
    assert polish(engine, 0.0, Stopping(max_iterations=2, tol=0.0)).stopped_because == "max-iterations"
    assert polish(engine, 0.0, Stopping(time_limit=0.0)).stopped_because == "time-limit"
    assert polish(engine, 0.0, Stopping(), interrupted=lambda: True).stopped_because == "interrupted"


@pytest.mark.parametrize("kind", KINDS)
def test_the_report_tells_the_phases_apart(kind):
    mesh = random_mesh(kind, 3)
    cells = [(block.type, block.vertices) for block in mesh.cells]
    _, relaxed = dvr_cli.smooth(mesh.points, cells, patches=False, polish=False)
    _, report = dvr_cli.smooth(mesh.points, cells, patches=False, polish=True, floor=0.9)
    first, second = report.phases
    assert (first.phase, second.phase) == ("relax", "polish")
    assert first.record()["guarantee"] != second.record()["guarantee"]
    assert first.sweeps == len(relaxed.sweeps)
    assert [sweep["phase"] for sweep in report.sweeps] == ["relax"] * first.sweeps + [
        "polish"
    ] * second.sweeps
    reached = relaxed.after.q1
    # of two corners that are equally bad but for rounding, engine and report may each take the other one
    assert second.floor == pytest.approx(max(0.9 * reached, report.before.q1), rel=1e-14, abs=0)
    assert report.after.q1 >= second.floor
    assert report.after.mean > relaxed.after.mean
    assert (report.after.q1, report.after.mean) == pytest.approx(
        (report.sweeps[-1]["q1"], report.after.mean), rel=1e-12
    )


def test_the_input_is_a_floor_too():
    """However low the floor, Q1 never falls below that of the input."""
    mesh = random_mesh("tetra", 3)
    tetra = {"tetra": mesh.cells[0].vertices}
    _, report = dvr_cli.smooth(mesh.points, tetra, max_iterations=1, patches=False, polish=True, floor=0.0)
    assert report.phases[1].floor == report.before.q1
    assert report.after.q1 >= report.before.q1


def test_nothing_is_polished_after_an_interruption():
    mesh = random_mesh("tetra", 3)
    tetra = {"tetra": mesh.cells[0].vertices}
    _, report = dvr_cli.smooth(mesh.points, tetra, polish=True, time_limit=0)
    assert [phase.phase for phase in report.phases] == ["descent"]
    assert report.stopped_because == "time-limit"
