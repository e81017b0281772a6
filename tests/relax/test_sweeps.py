"""The sweep loop: why it ends, what it reports, and that whatever ends it leaves a valid mesh no worse."""

from types import SimpleNamespace

import numpy as np
import pytest

import oracle
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.vector import at_least, ring_minima
from dvr_cli.relax.directions import direction_field
from dvr_cli.relax.engines import engine
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.stopping import Stopping
from dvr_cli.relax.sweeps import relax
from meshes import KINDS, random_mesh

FOREVER = {"max_iterations": 10**6, "tol": 0}


class Run:
    """A mesh with its problem and random directions, ready to be relaxed."""

    def __init__(self, kind="tetra", seed=1, **options):
        self.mesh = random_mesh(kind, seed, **options)
        self.domain = domain_of(self.mesh)
        relaxed = np.flatnonzero(self.domain.interior)
        self.corners = self.domain.corners
        self.problem = build_problem(self.corners, relaxed, self.domain.points)
        self.field = direction_field(["random"], self.domain, {})

    def relax(self, on_sweep=None, interrupted=lambda: False, **stopping):
        engine = NumpyEngine(self.problem)
        return relax(engine, self.domain.points, self.field, Stopping(**stopping), on_sweep, interrupted)

    def vector(self, points):
        """The quality vector."""
        minima = ring_minima(corner_qualities(points, self.corners), self.corners, len(points))
        return np.sort(minima[self.domain.interior])

    def after_batches(self, n):
        """The coordinates after n batches, driven by hand."""
        engine = NumpyEngine(self.problem)
        engine.load(self.domain.points)
        for count in range(n):
            sweep, batch = divmod(count, engine.batches)
            if batch == 0:
                directions = self.field(sweep, engine.relaxed_points, self.problem.relaxed)
            engine.relax_batch(batch, directions)
        return engine.points

    @property
    def batches(self):
        return len(self.problem.batch_start) - 1


def whole_sweeps(done, batches):
    """How many sweeps have been reported after some batches; one that just ended may be or not."""
    return (done // batches, (done - 1) // batches)


class Clock:
    """A stand-in for the clock, that goes on by one second whenever it is asked."""

    def __init__(self):
        self.now = 0.0

    def perf_counter(self):
        self.now += 1
        return self.now


# --------------------------------------------------------------------------------------------- the reasons


def test_max_iterations():
    outcome = Run().relax(max_iterations=4, tol=0)
    assert outcome.stopped_because == "max-iterations"
    assert [sweep.sweep for sweep in outcome.sweeps] == [1, 2, 3, 4]


def test_converged():
    run = Run()
    outcome = run.relax(tol=1e-3, patience=2)
    assert outcome.stopped_because == "converged"
    q1 = [run.vector(run.mesh.points)[0], *(sweep.q1 for sweep in outcome.sweeps)]
    assert (np.diff(q1)[-2:] < 1e-3).all()
    assert not any((np.diff(q1)[k : k + 2] < 1e-3).all() for k in range(len(q1) - 3))


def test_target():
    run = Run()
    reached = [sweep.q1 for sweep in run.relax(max_iterations=5, tol=0).sweeps]
    outcome = run.relax(target=reached[2], **FOREVER)
    assert outcome.stopped_because == "target"
    assert [sweep.q1 for sweep in outcome.sweeps] == reached[:3]
    assert reached[1] < reached[2]


def test_target_that_is_met_already_leaves_the_mesh_as_it_is():
    run = Run(noise=0)
    outcome = run.relax(target=run.vector(run.mesh.points)[0])
    assert (outcome.stopped_because, outcome.sweeps) == ("target", [])
    assert outcome.points.tobytes() == run.mesh.points.tobytes()


@pytest.mark.parametrize(
    ("option", "reason"), [("max_iterations", "max-iterations"), ("time_limit", "time-limit")]
)
@pytest.mark.parametrize("kind", KINDS)
def test_no_sweep_leaves_the_mesh_bit_by_bit(kind, option, reason):
    run = Run(kind)
    outcome = run.relax(**{option: 0})
    assert (outcome.stopped_because, outcome.sweeps) == (reason, [])
    assert outcome.points.tobytes() == run.mesh.points.tobytes()


def test_nothing_to_relax():
    points = np.array(oracle.IDEAL["tetra"])
    domain = domain_of(Mesh(points, [Cells("tetra", np.array([[0, 1, 2, 3]]))]))
    problem = build_problem(domain.corners, np.flatnonzero(domain.interior), domain.points)
    outcome = relax(NumpyEngine(problem), points, direction_field(["x"], domain, {}), Stopping())
    assert (outcome.stopped_because, outcome.sweeps) == ("nothing-to-relax", [])
    assert outcome.points.tobytes() == points.tobytes()


@pytest.mark.parametrize("limit", [5, 12, 30])
def test_time_limit_ends_a_sweep_after_the_batch_at_hand(monkeypatch, limit):
    monkeypatch.setattr(engine, "time", Clock())
    run = Run()
    outcome = run.relax(time_limit=limit, **FOREVER)
    assert outcome.stopped_because == "time-limit"
    done = [n for n in range(limit + 1) if run.after_batches(n).tobytes() == outcome.points.tobytes()]
    assert done
    assert len(outcome.sweeps) in whole_sweeps(max(done), run.batches)
    assert at_least(run.vector(outcome.points), run.vector(run.mesh.points))


def test_time_limit_is_not_met_while_the_clock_stands_still(monkeypatch):
    monkeypatch.setattr(engine, "time", SimpleNamespace(perf_counter=lambda: 7.0))
    outcome = Run().relax(time_limit=1e-9, max_iterations=3, tol=0)
    assert outcome.stopped_because == "max-iterations"
    assert [sweep.seconds for sweep in outcome.sweeps] == [0, 0, 0]


# ---------------------------------------------------------------------------------------- interruptions


@pytest.mark.parametrize("kind", KINDS)
def test_interruption_finishes_the_batch_and_leaves_a_mesh_no_worse(kind):
    run = Run(kind)
    last = run.vector(run.mesh.points)
    assert last[0] > 0
    for stop_after in range(1, 2 * run.batches + 2):
        asked = []

        def interrupted(asked=asked, stop_after=stop_after):
            asked.append(True)
            return len(asked) == stop_after

        outcome = run.relax(interrupted=interrupted, **FOREVER)
        assert outcome.stopped_because == "interrupted"
        assert len(asked) == stop_after
        assert outcome.points.tobytes() == run.after_batches(stop_after).tobytes()
        assert len(outcome.sweeps) in whole_sweeps(stop_after, run.batches)
        now = run.vector(outcome.points)
        assert at_least(now, last)
        last = now
    fixed = ~run.domain.interior
    assert outcome.points[fixed].tobytes() == run.mesh.points[fixed].tobytes()
    qualities = [
        oracle.element_quality(block.type, outcome.points[vertices])
        for block in run.mesh.cells
        for vertices in block.vertices
    ]
    assert min(qualities) > 0


def test_exceptions_of_the_caller_are_not_swallowed():
    def fails(sweep):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Run().relax(fails)


# ------------------------------------------------------------------------------------- what it reports


def test_each_sweep_is_reported_as_it_ends():
    run = Run()
    seen = []
    outcome = run.relax(lambda sweep: seen.append(sweep), max_iterations=6, tol=0)
    assert seen == outcome.sweeps
    assert [sweep.sweep for sweep in seen] == [1, 2, 3, 4, 5, 6]
    assert all(sweep.seconds >= 0 for sweep in seen)
    before = run.mesh.points
    for sweep in seen:
        after = run.after_batches(sweep.sweep * run.batches)
        assert sweep.q1 == run.vector(after)[0]
        assert sweep.moved == (after != before).any(axis=1).sum() > 0
        before = after


def test_the_given_coordinates_are_not_altered():
    run = Run()
    run.domain.points.setflags(write=False)
    before = run.domain.points.tobytes()
    outcome = run.relax(max_iterations=3)
    assert run.domain.points.tobytes() == before != outcome.points.tobytes()


def test_the_same_run_gives_the_same_bytes():
    for kind in KINDS:
        one, other = (Run(kind).relax(max_iterations=5) for _ in range(2))
        assert one.points.tobytes() == other.points.tobytes()
