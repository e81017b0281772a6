"""The altitude rule: no move takes an element below the bound, and none is cut shorter than that."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dvr_cli
import oracle
from curved_parts import scanned
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.backend import COMPILED, NUMPY
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.relax.altitudes import hold_altitudes
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.patches.phase import relax_patches
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.problem import build_problem, ring_arrays
from dvr_cli.relax.steepest import NARROWING, OPTIMAL, STEEPEST
from dvr_cli.relax.stopping import Stopping
from meshes import KINDS, delaunay, random_mesh
from needs import require


def altitudes(simplices):
    """(n,) the smallest altitude of simplices (n, d+1, k), by the gradients of their shape functions."""
    edges = simplices[:, 1:] - simplices[:, :1]
    gradients = np.linalg.pinv(edges).transpose(0, 2, 1)
    own = gradients.sum(axis=1, keepdims=True)
    sharpest = np.linalg.norm(np.concatenate([gradients, own], axis=1), axis=2).max(axis=1)
    square = edges.shape[1] == edges.shape[2]
    return (np.sign(np.linalg.det(edges)) if square else 1.0) / sharpest


def smallest(mesh, points=None):
    """The smallest altitude of all corners as the oracle counts them."""
    points = mesh.points if points is None else points
    corners = [b.vertices[:, local] for b in mesh.cells for local, _ in oracle.corners(b.type)]
    return float(altitudes(points[np.concatenate(corners)]).min())


def engine_of(mesh, altitude):
    domain = domain_of(mesh)
    engine = NumpyEngine(build_problem(domain.corners, np.flatnonzero(domain.interior), domain.points))
    engine.load(domain.points)
    engine.keep_altitude(altitude)
    return engine


def moves(engine, generator):
    """One batch after the other, moved in all ways that there are; yields after each."""
    aims = Aim(0.0, False), Aim(0.4, True), Aim(0.4, True, by_ring=True)
    for batch in range(engine.batches):
        directions = generator.normal(size=engine.relaxed_points.shape)
        for way in (directions, STEEPEST, NARROWING, OPTIMAL):
            engine.move_batch(batch, way)
            yield
        for aim in aims:
            engine.polish_batch(batch, 1e4, aim)
            yield


def holds(kind, seed, noise):
    """Hold the smallest altitude of a mesh after every batch; returns whether the rule changed anything."""
    mesh = random_mesh(kind, seed, noise=noise)
    bound = smallest(mesh) * (1 + 1e-9)
    if not bound > 0:
        return False
    engine, free = engine_of(mesh, bound), engine_of(mesh, 0.0)
    for _ in moves(engine, np.random.default_rng(seed)):
        assert smallest(mesh, engine.points) >= smallest(mesh)
    for _ in moves(free, np.random.default_rng(seed)):
        pass
    return (engine.points != free.points).any()


@settings(max_examples=4, deadline=None)
@given(st.sampled_from(KINDS), st.integers(0, 10**6), st.floats(0, 0.5))
def test_the_smallest_altitude_never_falls_after_any_batch(kind, seed, noise):
    holds(kind, seed, noise)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.floats(0, 0.5))
def test_the_smallest_altitude_never_falls_in_large_numbers(kind, seed, noise):
    holds(kind, seed, noise)


def test_there_are_moves_that_the_rule_cuts_short():
    assert holds("quad", 0, 0.05)
    assert holds("tetra", 2, 0.05)


def held(backend, points, cells, vertex, reached, bound):
    """Where the rule leaves a vertex that has moved, and whether it says that the move was undone."""
    corners = domain_of(Mesh(points, [cells])).corners
    problem = build_problem(corners, np.array([vertex]), points)
    here = np.flatnonzero(problem.order == vertex)[0]
    after = points[problem.order]
    after[here] = reached
    rings = ring_arrays(problem)
    kernel = backend.twin(hold_altitudes)
    undone = kernel(after, points[[vertex]], 0, 1, rings, bound, np.inf, False)
    assert (np.delete(after, here, axis=0) == points[np.delete(problem.order, here)]).all()
    return after[here], undone


@pytest.mark.parametrize("kind", ["triangle", "quad", "tetra", "hexahedron", "wedge", "pyramid"])
def test_a_move_ends_where_an_altitude_would_fall_below_the_bound(kind):
    """Compared with a search along the way; the twin gives the same bits."""
    generator, cut = np.random.default_rng(7), 0
    for seed in range(12):
        mesh = random_mesh(kind, seed, noise=0.2)
        block = mesh.cells[0]
        around = {v: corners_at(block, v) for v in np.flatnonzero(domain_of(mesh).interior)}
        vertex = list(around)[seed % len(around)]
        start = altitudes(mesh.points[around[vertex]]).min()
        size = np.ptp(mesh.points, axis=0).max() / 3
        reached = mesh.points[vertex] + size * generator.normal(size=mesh.points.shape[1])
        bound = start * generator.uniform(0.2, 0.99)

        def low(part, mesh=mesh, vertex=vertex, reached=reached, bound=bound, corners=around):
            points = mesh.points.copy()
            points[vertex] += part * (reached - points[vertex])
            return altitudes(points[corners[vertex]]).min() < bound

        found, undone = held(NUMPY, mesh.points, block, vertex, reached, bound)
        if not low(1.0):
            np.testing.assert_array_equal(found, reached)
            continue
        inside, outside = 0.0, 1.0
        while outside - inside > 1e-13:
            middle = 0.5 * (inside + outside)
            inside, outside = (inside, middle) if low(middle) else (middle, outside)
        cut += 1
        assert not undone
        way = mesh.points[vertex] + inside * (reached - mesh.points[vertex])
        np.testing.assert_allclose(found, way, atol=3e-6 * np.linalg.norm(reached - mesh.points[vertex]))
        try:
            twin = held(COMPILED, mesh.points, block, vertex, reached, bound)
        except ImportError:
            continue
        assert (twin[0] == found).all()
        assert twin[1] == undone
    assert cut > 4


def corners_at(block, vertex):
    """(n, d+1) the corners of the cells that contain a vertex."""
    corners = np.concatenate([block.vertices[:, local] for local, _ in oracle.corners(block.type)])
    return corners[(corners == vertex).any(axis=1)]


def test_a_move_that_has_no_room_is_undone():
    """From the middle of a regular triangle, cut into three, each move lowers an altitude."""
    angle = 2 * np.pi / 3 * np.arange(3)
    points = np.vstack([np.column_stack([np.cos(angle), np.sin(angle)]), np.zeros(2)])
    cells = Cells("triangle", np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    bound = altitudes(points[cells.vertices]).min()
    for angle in np.arange(0.0, 6.0, 0.5):
        reached = 0.2 * np.array([np.cos(angle), np.sin(angle)])
        found, undone = held(NUMPY, points, cells, 3, reached, bound * (1 + 1e-9))
        assert undone == 1
        np.testing.assert_array_equal(found, points[3])


@pytest.mark.parametrize("kind", ["triangle", "tetra", "hexahedron"])
def test_patches_keep_to_the_bound(kind):
    mesh = random_mesh(kind, 5, noise=0.1)
    bound = smallest(mesh) * (1 + 1e-9)
    engine = engine_of(mesh, bound)
    relax_patches(engine, Stopping(max_iterations=3))
    assert smallest(mesh, engine.points) >= smallest(mesh)
    assert (engine.points != mesh.points).any()


OPTIONS = (
    {},
    {"directions": "random,x,radial", "keep_height": True},
    {"directions": "optimal", "patches": True, "polish": True, "floor": 0.9, "keep_height": True},
    {"target": 0.5},
)


@settings(max_examples=3, deadline=None)
@given(
    st.sampled_from(KINDS),
    st.sampled_from(("fixed", "slide", "project")),
    st.integers(0, 10**6),
    st.sampled_from((0.02, 0.1, 0.3)),
    st.sampled_from(OPTIONS),
)
def test_the_smallest_altitude_never_falls_in_a_run(kind, boundary, seed, noise, options):
    run_holds(kind, boundary, seed, noise, options)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=20, deadline=None)
@given(
    st.sampled_from(("fixed", "slide", "project")),
    st.integers(0, 10**6),
    st.floats(0, 0.5),
    st.sampled_from(OPTIONS),
)
def test_the_smallest_altitude_never_falls_in_many_runs(kind, boundary, seed, noise, options):
    run_holds(kind, boundary, seed, noise, options)


def run_holds(kind, boundary, seed, noise, options):
    mesh = random_mesh(kind, seed, noise=noise)
    chosen = SmoothOptions.of({"engine": "numpy", "boundary": boundary, "max_iterations": 4, **options})
    points, report = smooth_mesh(mesh, chosen)
    before, after = smallest(mesh), smallest(mesh, points)
    if before > 0:
        assert after >= before
    found = report.before.measures["min_altitude"], report.after.measures["min_altitude"]
    assert found == pytest.approx((before, after), rel=1e-9)


def test_a_surface_keeps_its_smallest_altitude():
    mesh = scanned(6)
    for engine in ("numpy", "numba"):
        if engine == "numba":
            require("numba")
        points, _ = dvr_cli.smooth(mesh.points, mesh.cells[0].vertices, engine=engine, max_iterations=3)
        assert (points != mesh.points).any()
        assert smallest(mesh, points) >= smallest(mesh)


@pytest.mark.parametrize("boundary", ["fixed", "slide"])
@pytest.mark.parametrize("kind", ["triangle", "mixed3d"])
def test_both_engines_cut_alike(kind, boundary):
    require("numba")
    mesh = random_mesh(kind, 11, noise=0.03)
    options = {"boundary": boundary, "stopping": Stopping(4)}
    results = [
        smooth_mesh(mesh, SmoothOptions(engine=engine, threads=threads, **options))[0].tobytes()
        for engine, threads in (("numpy", 1), ("numba", 1), ("numba", 2))
    ]
    assert results[0] == results[1] == results[2]


def shrinking():
    """A mesh whose smallest altitude falls without the rule: a large element gives way to a small one."""
    for seed in range(50):
        mesh = delaunay(20, 2, seed)
        _, report = dvr_cli.smooth(mesh.points, mesh.cells[0].vertices, preset="paper", max_iterations=5)
        if report.after.measures["min_altitude"] < 0.9 * report.before.measures["min_altitude"]:
            return mesh
    raise AssertionError("none of the meshes loses altitude")


def test_the_rule_holds_by_default_and_on_request():
    mesh = shrinking()
    given = {"directions": "random", "order": "natural", "tol": 0.0, "max_iterations": 5}

    def fell(**options):
        points, report = dvr_cli.smooth(mesh.points, mesh.cells[0].vertices, **options)
        assert report.options["keep_height"] == (smallest(mesh, points) >= smallest(mesh))
        return smallest(mesh, points) < smallest(mesh)

    assert fell(**given)
    assert not fell(**given, keep_height=True)
    assert not fell()


def test_who_wants_the_best_quality_lifts_the_rule():
    mesh = random_mesh("tetra", 1, noise=0.02)
    q1 = {}
    for keep in (True, False):
        options = SmoothOptions(engine="numpy", boundary="slide", keep_height=keep, patches=False)
        points, report = smooth_mesh(mesh, options)
        q1[keep] = report.after.q1
        assert (smallest(mesh, points) >= smallest(mesh)) == keep
    assert q1[False] > q1[True]


class Coarse:
    """A place that keeps three decimals."""

    def stored(self, points):
        return points.round(3)

    def rounding(self, points):
        return float(np.abs(self.stored(points) - points).max())

    def widen(self):
        return False


@pytest.mark.parametrize("seed", range(4))
def test_the_smallest_altitude_does_not_fall_as_coordinates_are_rounded(seed):
    mesh = random_mesh("quad", seed, noise=0.1)
    mesh = Mesh(mesh.points.round(3), mesh.cells)
    points, _ = smooth_mesh(mesh, SmoothOptions(engine="numpy", boundary="slide"), Coarse())
    assert (points != mesh.points).any()
    assert smallest(mesh, points) >= smallest(mesh)


@pytest.mark.parametrize("kind", ["quad", "tetra"])
def test_a_step_of_a_relaxer_lowers_no_altitude_below_the_smallest_it_begins_with(kind):
    mesh = random_mesh(kind, 2, noise=0.05)
    relaxer = dvr_cli.Relaxer(mesh.points, {kind: mesh.cells[0].vertices}, max_iterations=3, keep_height=True)
    shift = np.zeros_like(mesh.points)
    shift[mesh.points[:, 0] > 1 - 1e-9, 0] = 0.1
    begins = relaxer.spread(mesh.points, relaxer.displace(mesh.points, mesh.points + shift))
    points, _ = relaxer.relax(displacement=shift)
    assert smallest(mesh, points) >= smallest(mesh, begins)
