"""Patches: the guarantee, the joint optimum against other solvers, and equal bytes however it is computed."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.backend import COMPILED, NUMPY
from dvr_cli.boundary.freedom import Freedom
from dvr_cli.errors import UsageError
from dvr_cli.mesh.corners import SHAPES, Simplices
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.vector import at_least, ring_minima
from dvr_cli.relax.directions import random_field
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.patches import phase as module
from dvr_cli.relax.patches.neighbourhoods import Neighbourhoods
from dvr_cli.relax.patches.phase import relax_patches
from dvr_cli.relax.patches.solver import Patch, PatchEnergy, solve_patch
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.stopping import Stopping
from dvr_cli.relax.sweeps import relax
from meshes import KINDS, random_mesh
from needs import require

require("numba")

from dvr_cli.relax.engines.numba_engine import NumbaEngine  # noqa: E402


class Run:
    """A mesh after some sweeps of random directions, ready to have its patches relaxed."""

    def __init__(self, kind, seed=1, sweeps=5, **options):
        domain = domain_of(random_mesh(kind, seed, **options))
        self.corners = domain.corners
        self.relaxed = np.flatnonzero(domain.interior)
        self.problem = build_problem(self.corners, self.relaxed, domain.points)
        field = random_field(domain.dimension, seed)
        engine, stopping = NumbaEngine(self.problem), Stopping(sweeps, 0.0)
        self.points = relax(engine, domain.points, field, stopping).points

    def patches(self, engine=NumbaEngine, threads=1, on_sweep=None, interrupted=lambda: False, **stopping):
        self.engine = engine(self.problem, threads) if engine is NumbaEngine else engine(self.problem)
        self.engine.load(self.points)
        return relax_patches(self.engine, Stopping(**stopping), 0, on_sweep, interrupted)

    def vector(self, points):
        minima = ring_minima(corner_qualities(points, self.corners), self.corners, len(points))
        return np.sort(minima[self.relaxed])


def patch_of(run, layers=1, seed=None):
    """Coordinates, and the patch around a corner, by default the worst."""
    touched, d = run.problem.touched, run.problem.dimension
    points = run.points[run.problem.order]
    corner = corner_qualities(points, touched).argmin() if seed is None else seed
    around = np.full(len(touched.vertices), layers)
    moving, vertices, shapes = Neighbourhoods(run.problem, NUMPY).choose(np.array([corner]), around).of(0)
    slot = np.full(len(points), -1)
    slot[moving] = np.arange(len(moving))
    dimension, axis = np.full(len(points), d, dtype=np.uint8), np.zeros_like(points)
    table = SHAPES[d].norm, SHAPES[d].factor
    return points, Patch(moving, vertices, shapes, slot, *table, dimension, axis, 0.0, np.inf, 0.0)


# ------------------------------------------------------------------------------------------- the guarantee


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(KINDS), st.integers(0, 10**6), st.integers(0, 5), st.sampled_from([0.0, 1e6]))
def test_the_vector_grows_in_every_round(kind, seed, sweeps, shift):
    """Without a tolerance, also for a mesh far from the origin, whatever the element type."""
    run = Run(kind, seed, sweeps)
    run.points = run.points + shift
    before = run.vector(run.points)
    outcome = run.patches()
    after = run.vector(outcome.points)
    assert at_least(after, before)
    assert (corner_qualities(outcome.points, run.corners) > 0).sum() >= (
        corner_qualities(run.points, run.corners) > 0
    ).sum()
    q1 = [before[0], *(round.q1 for round in outcome.sweeps)]
    assert (np.diff(q1) >= 0).all()
    assert q1[-1] == after[0]
    fixed = np.setdiff1d(np.arange(len(run.points)), run.relaxed)
    assert (outcome.points[fixed] == run.points[fixed]).all()


@pytest.mark.parametrize(("kind", "n"), [("triangle", 100), ("tetra", 8)])
def test_patches_gain_more_than_sweeps_can(kind, n):
    sweeps = Run(kind, 3, sweeps=300, n=n)
    assert Run(kind, 3, sweeps=10, n=n).patches().sweeps[-1].q1 > sweeps.vector(sweeps.points)[0] + 1e-3


def test_patches_of_a_round_share_no_corner():
    run = Run("tetra", 2, n=5)
    touched = run.problem.touched
    seeds = np.argsort(corner_qualities(run.points[run.problem.order], touched))
    for layers in (0, 1, 2):
        around = np.full(len(seeds), layers)
        plain = Neighbourhoods(run.problem, NUMPY).choose(seeds, around)
        fast = Neighbourhoods(run.problem, COMPILED).choose(seeds, around)
        for name in ("seeds", "freed_start", "freed", "corner_start", "corners", "vertices", "shapes"):
            np.testing.assert_array_equal(getattr(fast, name), getattr(plain, name))
        assert len(set(plain.corners)) == len(plain.corners)
        moves = np.isin(touched.vertices, run.problem.rings.vertices)
        for patch in range(len(plain)):
            freed = set(touched.vertices[plain.seeds[patch]][moves[plain.seeds[patch]]])
            for _ in range(layers):
                near = np.isin(touched.vertices, list(freed)).any(axis=1)
                freed = set(touched.vertices[near][moves[near]])
            assert set(plain.of(patch)[0]) == freed
            assert len(plain.of(patch)[1]) == np.isin(touched.vertices, list(freed)).any(axis=1).sum()
    assert len(plain) < len(Neighbourhoods(run.problem, NUMPY).choose(seeds, 0 * around))


# ---------------------------------------------------------------------------------------- the joint optimum


@pytest.mark.parametrize("squarings", [1, 3, 6])
@pytest.mark.parametrize("kind", KINDS)
def test_gradient_against_differences(kind, squarings):
    run = Run(kind, 4)
    points, patch = patch_of(run)
    energy = PatchEnergy(points, patch)
    reference = energy.badness().max()
    f, share = energy.norm(reference, squarings)
    gradient = energy.gradient(f, share)
    h = 1e-6 * energy.size
    for slot, vertex in enumerate(patch.moving):
        for i in range(points.shape[1]):
            at, values = points[vertex, i], []
            for step in (-h, h):
                points[vertex, i] = at + step
                values.append(energy.norm(reference, squarings)[0])
            points[vertex, i] = at
            difference = (values[1] - values[0]) / (2 * h)
            assert gradient[slot, i] == pytest.approx(difference, rel=1e-4, abs=1e-5 * f / energy.size)


@pytest.mark.parametrize("kind", ["triangle", "quad", "tetra", "wedge"])
def test_optimum_against_scipy(kind):
    """Maximise t subject to Q_c >= t, by SLSQP from where the solver ends: it finds hardly anything more."""
    run = Run(kind, 5)
    points, patch = patch_of(run, layers=0)
    moving, vertices = patch.moving, patch.vertices
    corners = Simplices(vertices, patch.shapes[:, None], SHAPES[vertices.shape[1] - 1])
    before = corner_qualities(points, corners).min()
    solve_patch(points, patch)
    reached = corner_qualities(points, corners).min()

    def qualities(y):
        moved = points.copy()
        moved[moving] = y[:-1].reshape(len(moving), -1)
        return corner_qualities(moved, corners)

    best = minimize(
        lambda y: -y[-1],
        np.append(points[moving].ravel(), reached),
        constraints={"type": "ineq", "fun": lambda y: qualities(y) - y[-1]},
        method="SLSQP",
        options={"maxiter": 100, "ftol": 1e-10},
    )
    assert reached > before
    assert reached >= qualities(best.x).min() - 2e-3


# ------------------------------------------------------------------------------------ however it is computed


def timeless(outcome):
    return [replace(sweep, seconds=0.0) for sweep in outcome.sweeps]


@pytest.mark.parametrize("kind", KINDS)
def test_same_bytes_in_both_engines_on_any_number_of_threads(kind):
    run = Run(kind, 6)
    outcome = run.patches(NumpyEngine, max_iterations=6)
    assert outcome.sweeps
    assert run.engine.points.tobytes() == outcome.points.tobytes()
    for threads in (1, 2, 3):
        other = run.patches(NumbaEngine, threads, max_iterations=6)
        assert other.points.tobytes() == outcome.points.tobytes()
        assert [replace(s, seconds=0) for s in other.sweeps] == [
            replace(s, seconds=0) for s in outcome.sweeps
        ]


def test_threads_however_many_patches():
    run = Run("tetra", 7, n=8)
    one = run.patches(threads=1)
    assert len(one.sweeps) > 3
    assert run.patches(threads=4).points.tobytes() == one.points.tobytes()


# ---------------------------------------------------------------------------------------- freedom, stopping


def sliding(points, d):
    """The freedom in which vertices on the boundary of the unit box keep to its faces and edges."""
    held = (points < 1e-9) | (points > 1 - 1e-9)
    dimension = (d - held.sum(axis=1)).astype(np.uint8)
    axis = np.zeros_like(points)
    axis[dimension == 2] = held[dimension == 2]
    axis[dimension == 1] = ~held[dimension == 1]
    if d == 2:
        axis[dimension == 2] = 0.0
    return Freedom(dimension, axis)


def inside(freedom, vectors):
    """The part of each vector that its vertex is free to follow."""
    along = (vectors * freedom.axis).sum(axis=1, keepdims=True) * freedom.axis
    held = freedom.dimension[:, None]
    return np.where(held == 0, 0.0, np.where(held == 1, along, vectors - along))


@pytest.mark.parametrize("kind", ["quad", "tetra", "hexahedron"])
@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_vertices_keep_to_their_planes_and_lines(kind, angle):
    """Of the unit box, parallel to the axes or turned about z; its boundary vertices are shifted within."""
    mesh = random_mesh(kind, 8)
    d = mesh.points.shape[1]
    freedom = sliding(mesh.points, d)
    within = inside(freedom, np.random.default_rng(8).uniform(-0.05, 0.05, mesh.points.shape))
    shifted = np.where(freedom.dimension[:, None] < d, mesh.points + within, mesh.points)
    turn = np.eye(d)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    domain = domain_of(Mesh(shifted @ turn.T, mesh.cells))
    freedom = Freedom(freedom.dimension, freedom.axis @ turn.T)
    problem = build_problem(domain.corners, freedom.relaxed, domain.points, freedom=freedom)
    reached = []
    for engine in (NumpyEngine(problem), NumbaEngine(problem, 2)):
        engine.load(domain.points)
        before = engine.q1()
        outcome = relax_patches(engine, Stopping(6))
        assert engine.q1() > before
        reached.append(outcome.points)
    assert reached[0].tobytes() == reached[1].tobytes()
    step = reached[0] - domain.points
    assert (step[freedom.dimension == 0] == 0).all()
    out = step - inside(freedom, step)
    # exactly where the boundary is parallel to the axes, else up to the rounding of some hundred steps
    assert np.abs(out).max() <= (0.0 if angle == 0 else 500 * np.finfo(float).eps)
    on_boundary = (freedom.dimension > 0) & (freedom.dimension < d)
    assert np.abs(step[on_boundary]).max() > 1e-3


@pytest.mark.parametrize("after", [0, 1, 5, 20])
def test_interrupted_anywhere_the_mesh_is_valid_and_no_worse(after):
    run = Run("tetra", 9, n=4)
    lock, asked = threading.Lock(), [0]

    def interrupted():
        with lock:
            asked[0] += 1
            return asked[0] > after

    outcome = run.patches(threads=2, interrupted=interrupted)
    assert outcome.stopped_because == "interrupted"
    assert at_least(run.vector(outcome.points), run.vector(run.points))
    assert (outcome.points == run.points).all() or after > 0


def test_target_and_time_limit():
    run = Run("tetra", 10, n=4)
    full = run.patches()
    assert full.stopped_because == "converged"
    target = full.sweeps[0].q1
    outcome = run.patches(target=target)
    assert (outcome.stopped_because, len(outcome.sweeps)) == ("target", 1)
    outcome = run.patches(time_limit=0)
    assert (outcome.stopped_because, outcome.sweeps) == ("time-limit", [])
    assert outcome.points.tobytes() == run.points.tobytes()


def test_tried_with_every_layer_before_giving_up(monkeypatch):
    run = Run("tetra", 11)
    asked = []
    choose = Neighbourhoods.choose

    def spy(self, seeds, layers, most):
        asked.append(int(layers[seeds[0]]))
        return choose(self, seeds, layers, most)

    monkeypatch.setattr(Neighbourhoods, "choose", spy)
    assert run.patches().stopped_because == "converged"
    assert asked[-1] == module.LAYERS


def test_a_round_has_an_eighth_of_many_patches_that_can_be_paid_for(monkeypatch):
    run, asked = Run("tetra", 2, n=5), []
    choose = Neighbourhoods.choose

    def spy(self, seeds, layers, most):
        asked.append(most)
        return choose(self, seeds, layers, most)

    monkeypatch.setattr(Neighbourhoods, "choose", spy)
    monkeypatch.setattr(module, "_SHARE", 0.25)
    for least in 4, 32:
        monkeypatch.setattr(module, "ROUND", least)
        engine = NumpyEngine(run.problem)
        engine.load(run.points)
        relax_patches(engine, Stopping(1), level=0.9)
    few = len(run.problem.touched.vertices) // 4 // 8
    assert 4 < few < 32
    assert asked == [few, 32]


def test_a_tangled_patch_is_left_alone():
    mesh = random_mesh("tetra", 12)
    domain = domain_of(mesh)
    run = Run("tetra", 12, sweeps=0)
    inner = np.flatnonzero(domain.interior)[0]
    run.points[inner] += 0.7
    assert (corner_qualities(run.points, run.corners) < 0).any()
    before = run.points.copy()
    outcome = run.patches()
    assert at_least(run.vector(outcome.points), run.vector(before))
    assert outcome.points[inner].tobytes() == before[inner].tobytes()


@pytest.mark.parametrize("backend", [NUMPY, COMPILED])
@pytest.mark.parametrize("kind", ["triangle", "tetra"])
def test_a_patch_that_stays_worse_than_is_bearable_is_left_alone(kind, backend):
    solve = backend.twin(solve_patch)
    points, patch = patch_of(Run(kind, 3))
    moved = points.copy()
    before, after = solve(moved, patch)
    assert after < before
    for bearable, stays in ((0.99 * after, True), (1.01 * after, False)):
        again = points.copy()
        badness = solve(again, patch._replace(bearable=bearable))
        assert badness == ((before, before) if stays else (before, after))
        assert again.tobytes() == (points if stays else moved).tobytes()


@pytest.mark.parametrize("engine", [NumpyEngine, NumbaEngine])
def test_what_stays_below_half_the_level_is_helped_around_the_worst_corner_alone(engine):
    run, ends = Run("tetra", 3, n=5), []
    for level in (None, 1.9):  # no element is ever as good as half of that
        run.engine = engine(run.problem)
        run.engine.load(run.points)
        ends.append(relax_patches(run.engine, Stopping(max_iterations=1), level=level))
    every, one = [(end.points != run.points).any(axis=1) for end in ends]
    assert one.any()
    assert one.sum() < every.sum()
    around = run.problem.order[patch_of(run)[1].moving]
    assert set(np.flatnonzero(one)) <= set(around)
    assert at_least(run.vector(ends[1].points), run.vector(run.points))


def test_nothing_to_relax():
    assert Run("quad", n=1).patches().stopped_because == "nothing-to-relax"


# ------------------------------------------------------------------------------------------------ as option


def test_option_adds_a_phase():
    mesh = random_mesh("tetra", 13)
    stopping = Stopping(max_iterations=5, tol=0.0)
    points, plain = smooth_mesh(mesh, SmoothOptions("random", stopping=stopping))
    moved, report = smooth_mesh(mesh, SmoothOptions("random", patches=True, stopping=stopping))
    assert [phase.phase for phase in report.phases] == ["relax", "patches"]
    assert [sweep["phase"] for sweep in report.sweeps[:6]] == ["relax"] * 5 + ["patches"]
    assert [sweep["sweep"] for sweep in report.sweeps] == list(range(1, len(report.sweeps) + 1))
    assert report.after.q1 > plain.after.q1
    assert report.after.q1 == report.sweeps[-1]["q1"]
    assert report.record()["options"]["patches"] is True
    assert not np.array_equal(moved, points)


def test_the_papers_preset_has_no_patches():
    with pytest.raises(UsageError, match="patches"):
        SmoothOptions(preset="paper", patches=True)


@pytest.mark.parametrize("engine", ["numpy", "numba"])
def test_whoever_is_told_of_a_round_finds_the_mesh_it_reached(engine):
    if engine == "numba":
        require("numba")
    mesh = random_mesh("tetra", 13)
    stopping = Stopping(max_iterations=5, tol=0.0)
    options = SmoothOptions("random", patches=True, stopping=stopping, engine=engine)
    _, report = smooth_mesh(mesh, options, means=True)
    sweeps, rounds = ([s for s in report.sweeps if s["phase"] == name] for name in ("relax", "patches"))
    assert rounds[-1]["elements_mean"] == pytest.approx(report.after.mean, rel=1e-12)
    assert rounds[-1]["elements_mean"] != sweeps[-1]["elements_mean"]
