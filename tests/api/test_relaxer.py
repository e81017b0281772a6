"""A mesh relaxed again and again while its boundary moves: as ``smooth`` would, but set up only once."""

import doctest
from functools import partial

import meshio
import numpy as np
import pytest

import dvr_cli
import dvr_cli.api.options as options_module
import dvr_cli.api.relaxer as relaxer_module
from dvr_cli.errors import InputError, UsageError
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.measure import measure
from dvr_cli.relax.engines.choice import EngineKind
from meshes import KINDS, hexagon, random_mesh
from needs import require

ENGINES = ("numpy", "numba")


smooth = partial(dvr_cli.smooth, patches=False, polish=False)  # nothing but the sweeps


def pairs(mesh):
    return [(block.type, block.vertices) for block in mesh.cells]


def stretched(mesh, factor):
    """The points with the boundary, and only it, stretched along x."""
    boundary = ~domain_of(mesh).interior
    points = mesh.points.copy()
    points[boundary, 0] *= factor
    return points


def need(engine):
    if engine == "numba":
        require("numba")


# ------------------------------------------------------------------------------------------ as smooth does it


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_bytes_are_those_of_smooth_at_every_instant(kind, engine):
    """In natural order also at later instants, as it does not depend on where the points are."""
    need(engine)
    mesh = random_mesh(kind, 1)
    options = {"order": "natural", "directions": "random,radial", "max_iterations": 4, "engine": engine}
    relaxer = dvr_cli.Relaxer(mesh.points, pairs(mesh), **options)
    for points in (mesh.points, stretched(mesh, 1.1), stretched(mesh, 0.9), mesh.points):
        relaxed, report = relaxer.relax(points)
        expected, smoothed = smooth(points, pairs(mesh), **options)
        assert relaxed.tobytes() == expected.tobytes()
        # of two corners that are equally bad but for rounding, engine and report may each take the other one
        expected_q1 = pytest.approx((smoothed.before.q1, smoothed.after.q1), rel=1e-14, abs=0)
        assert (report.q1_before, report.q1_after) == expected_q1
        assert (report.relaxed, report.stopped_because) == (smoothed.relaxed, smoothed.stopped_because)
        assert [sweep.q1 for sweep in report.sweeps] == [sweep["q1"] for sweep in smoothed.sweeps]
        assert (relaxed != points).any()


@pytest.mark.parametrize(
    ("order", "directions"),
    [("coloured", "axis"), ("shuffled", "axis"), ("coloured", "steepest"), ("natural", "optimal")],
)
def test_the_bytes_are_those_of_smooth_from_the_first_points(order, directions):
    mesh = random_mesh("tetra", 1, n=3)
    options = {"order": order, "seed": 5, "directions": directions, "tol": 1e-2}
    expected, _ = smooth(mesh.points, pairs(mesh), **options)
    relaxer = dvr_cli.Relaxer(mesh.points, pairs(mesh), **options)
    assert relaxer.relax()[0].tobytes() == expected.tobytes()
    assert relaxer.relax(mesh.points)[0].tobytes() == expected.tobytes()


def test_engines_and_threads_agree():
    require("numba")
    mesh = random_mesh("mixed3d", 1)
    results = [
        dvr_cli.Relaxer(mesh.points, pairs(mesh), engine=engine, threads=threads).relax(stretched(mesh, 1.2))
        for engine, threads in (("numpy", 1), ("numba", 1), ("numba", 2))
    ]
    assert len({points.tobytes() for points, _ in results}) == 1
    assert len({report.q1_after for _, report in results}) == 1


@pytest.mark.parametrize(
    "directions",
    [
        "circumferential",
        "field:wind",
        np.array([[[1.0, 0.0]], [[1.0, 1.0]]]).repeat(217, axis=1),
    ],
)
def test_directions_are_those_of_the_instant(directions):
    """The centre is by default the centroid of the points, wherever they have gone."""
    mesh = hexagon(8)
    wind = {"wind": np.random.default_rng(0).normal(size=mesh.points.shape)}
    start = meshio.Mesh(mesh.points, pairs(mesh), point_data=wind)
    points = mesh.points + np.random.default_rng(1).uniform(-0.02, 0.02, mesh.points.shape) + [3, 1]
    options = {"directions": directions, "order": "natural", "max_iterations": 3}
    relaxed, _ = dvr_cli.Relaxer(start, **options).relax(points)
    expected, _ = smooth(meshio.Mesh(points, pairs(mesh), point_data=wind), **options)
    assert relaxed.tobytes() == expected.points.tobytes()


def test_planar_meshes_in_space_stay_in_their_plane():
    flat = random_mesh("mixed2d", 1)
    axes = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    for plane in (np.eye(3)[:2], np.eye(3)[1:], axes[:2]):
        mesh = Mesh(flat.points @ plane, flat.cells)
        options = {"order": "natural", "max_iterations": 5, "directions": "random"}
        relaxer = dvr_cli.Relaxer(mesh.points, pairs(mesh), **options)
        relaxed, report = relaxer.relax(mesh.points)
        assert relaxed.tobytes() == smooth(mesh.points, pairs(mesh), **options)[0].tobytes()
        assert report.q1_after > report.q1_before
        normal = np.cross(*plane)
        assert np.abs(relaxed @ normal).max() < 1e-14
        lifted, _ = relaxer.relax(stretched(mesh, 1.1) * [1, 1, 1] + 2 * normal if plane[0, 0] == 1 else None)
        assert np.ptp(lifted @ normal) < 1e-14
        bent = mesh.points + np.outer(flat.points[:, 0], normal)
        with pytest.raises(InputError, match="left the plane"):
            relaxer.relax(bent)


def test_cells_keep_the_orientation_they_had_at_first():
    """A mesh turned inside out by its motion is not taken for one stored as the mirror image."""
    mesh = random_mesh("triangle", 1)
    relaxer = dvr_cli.Relaxer(mesh.points, pairs(mesh))
    mirrored = mesh.points * [-1, 1]
    assert relaxer.relax(mirrored)[1].q1_after < 0
    assert smooth(mirrored, pairs(mesh))[1].after.q1 > 0


# ------------------------------------------------------------------------------------------- set up only once


def test_nothing_is_set_up_again(monkeypatch):
    mesh = random_mesh("tetra", 1)
    calls = []

    def counted(owner, name):
        original = getattr(owner, name)

        def call(*arguments, **keywords):
            calls.append(name)
            return original(*arguments, **keywords)

        monkeypatch.setattr(owner, name, call)

    counted(options_module, "domain_of")
    counted(relaxer_module, "build_problem")
    counted(EngineKind, "make")
    relaxer = dvr_cli.Relaxer(mesh.points, pairs(mesh), max_iterations=2)
    for factor in (1.0, 1.1, 1.2):
        relaxer.relax(stretched(mesh, factor))
    assert calls == ["domain_of", "build_problem", "make"]
    far = np.zeros_like(mesh.points)
    far[0] = -0.1
    for _ in range(3):
        relaxer.relax(displacement=far, near=1)
    assert calls == ["domain_of", "build_problem", "make", "build_problem", "make"]


def test_what_the_caller_does_to_its_arrays_does_not_matter():
    mesh = random_mesh("tetra", 1, n=4)
    expected = smooth(mesh.points, pairs(mesh), directions="random")[0].tobytes()
    points = mesh.points.copy()
    relaxer = dvr_cli.Relaxer(meshio.Mesh(points, pairs(mesh)))
    points *= 7
    relaxed, _ = relaxer.relax(mesh.points)
    assert relaxed.tobytes() == expected
    relaxed[:] = 0
    assert relaxer.points.tobytes() == expected
    points = mesh.points.copy()
    points.setflags(write=False)
    assert not np.shares_memory(relaxer.relax(points)[0], points)


# ---------------------------------------------------------------------------------------------- displacements


def test_only_the_held_vertices_are_displaced():
    mesh = random_mesh("quad", 1)
    interior = domain_of(mesh).interior
    displacement = np.full_like(mesh.points, np.nan)  # rows of relaxed vertices are not looked at
    displacement[~interior] = [0.1, 0.0]
    relaxer = dvr_cli.Relaxer(mesh.points, pairs(mesh), order="natural", shape="ideal")
    assert np.array_equal(relaxer.held, ~interior)
    for step in (1, 2):
        start = relaxer.points
        expected = start.copy()
        expected[~interior] += [0.1, 0.0]
        relaxed, _ = relaxer.relax(displacement=displacement)
        assert relaxed[~interior].tobytes() == expected[~interior].tobytes()
        assert (
            relaxed.tobytes()
            == smooth(expected, pairs(mesh), order="natural", directions="random")[0].tobytes()
        )
        assert np.allclose(relaxed[~interior], mesh.points[~interior] + [0.1 * step, 0])
    jump, _ = relaxer.relax(mesh.points, displacement=displacement)
    assert np.allclose(jump[~interior], mesh.points[~interior] + [0.1, 0])


def test_a_planar_mesh_in_space_takes_displacements_in_the_plane():
    flat = random_mesh("triangle", 1)
    mesh = Mesh(np.pad(flat.points, ((0, 0), (0, 1)), constant_values=2.5), flat.cells)
    shift = 0.1 * flat.points
    two, _ = dvr_cli.Relaxer(mesh.points, pairs(mesh)).relax(displacement=shift)
    three, _ = dvr_cli.Relaxer(mesh.points, pairs(mesh)).relax(displacement=np.pad(shift, ((0, 0), (0, 1))))
    alone, _ = dvr_cli.Relaxer(flat.points, pairs(flat)).relax(displacement=shift)
    assert two.tobytes() == three.tobytes()
    assert two[:, :2].tobytes() == alone.tobytes()
    assert (two[:, 2] == 2.5).all()


def test_nodes_of_second_order_cells_follow_their_corners():
    linear = random_mesh("triangle", 1)
    triangles = linear.cells[0].vertices
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    unique, middle = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    points = np.vstack([linear.points, linear.points[unique].mean(axis=1)])
    cells = {"triangle6": np.column_stack([triangles, middle.reshape(-1, 3) + len(linear.points)])}
    shift = np.zeros_like(points)
    shift[:, 0] = 0.2 * points[:, 0]
    shift[len(linear.points) :] = np.nan
    relaxed, _ = dvr_cli.Relaxer(points, cells, order="natural", shape="ideal").relax(displacement=shift)
    corners, _ = dvr_cli.Relaxer(linear.points, pairs(linear), order="natural", shape="ideal").relax(
        displacement=shift[: len(linear.points)]
    )
    assert relaxed[: len(corners)].tobytes() == corners.tobytes()
    np.testing.assert_allclose(relaxed[len(corners) :], relaxed[unique].mean(axis=1), atol=1e-15)


def test_a_boundary_turned_step_by_step_takes_the_mesh_along():
    """Half a turn of the hexagon in 10 steps of 18 degrees, each of which shears the outermost triangles."""
    mesh = hexagon(4)
    angle = np.pi / 10
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    relaxer = dvr_cli.Relaxer(mesh.points, pairs(mesh), directions="axis", target=0.9, tol=0)
    boundary = mesh.points.copy()
    for _ in range(10):
        boundary = boundary @ turn
        points = np.where(relaxer.held[:, None], boundary, relaxer.points)
        relaxed, report = relaxer.relax(points)
        assert report.q1_before < 0.4
        assert report.q1_after == dvr_cli.quality_report(relaxed, pairs(mesh)).quality.q1 >= 0.9
        assert relaxed[relaxer.held].tobytes() == boundary[relaxer.held].tobytes()
    assert np.abs(relaxed + mesh.points).max() < 0.1


# ------------------------------------------------------------------------------------------------------- near


@pytest.mark.parametrize("kind", ["triangle", "hexahedron"])
@pytest.mark.parametrize("rings", [0, 1, 2])
def test_only_vertices_near_what_moved_are_relaxed(kind, rings):
    mesh = random_mesh(kind, 1, n=5)
    neighbours = [set() for _ in mesh.points]
    for block in mesh.cells:
        for cell in block.vertices.tolist():
            for vertex in cell:
                neighbours[vertex] |= set(cell)
    domain = domain_of(mesh)
    pushed = int(np.flatnonzero(~domain.interior)[0])
    near = {pushed}
    for _ in range(rings):
        near = set().union(*(neighbours[vertex] for vertex in near))
    free = near & set(np.flatnonzero(domain.interior).tolist())
    start, _ = smooth(mesh.points, pairs(mesh), max_iterations=1)
    relaxer = dvr_cli.Relaxer(start, pairs(mesh), directions="axis", shape="ideal")
    shift = np.zeros_like(start)
    shift[pushed] = 0.5 * (start[pushed] - start.mean(axis=0))
    relaxed, report = relaxer.relax(displacement=shift, near=rings)
    moved = set(np.flatnonzero((relaxed != start).any(axis=1)).tolist())
    assert moved == {pushed} | free
    assert report.relaxed == len(free)
    assert report.q1_after == measure(domain, relaxed, np.array(sorted(free), dtype=int)).q1
    assert (report.q1_after is None) == (rings == 0)


def test_near_counts_from_the_last_step():
    mesh = random_mesh("triangle", 1)
    relaxer = dvr_cli.Relaxer(mesh.points, pairs(mesh))
    relaxed, _ = relaxer.relax()
    again, report = relaxer.relax(relaxed, near=3)
    assert again.tobytes() == relaxed.tobytes()
    assert report.relaxed == 0
    everything, report = relaxer.relax(relaxed + 1.0, near=0)
    assert report.relaxed == domain_of(mesh).interior.sum()
    assert everything.shape == relaxed.shape


# ------------------------------------------------------------------------------------------- what is refused


def test_wrong_arrays_are_refused():
    mesh = random_mesh("triangle", 1)
    relaxer = dvr_cli.Relaxer(mesh.points, pairs(mesh))
    before = relaxer.points.tobytes()
    for points in (mesh.points[1:], mesh.points[:, :1], mesh.points.ravel(), mesh.points.astype(str)):
        with pytest.raises(UsageError, match="points"):
            relaxer.relax(points)
        with pytest.raises(UsageError, match="displacement"):
            relaxer.relax(displacement=points)
    spoilt = np.where(relaxer.held[:, None], np.nan, mesh.points)
    with pytest.raises(InputError, match="not finite"):
        relaxer.relax(spoilt)
    with pytest.raises(InputError, match="not finite"):
        relaxer.relax(displacement=spoilt)
    with pytest.raises(UsageError, match="near"):
        relaxer.relax(near=-1)
    assert relaxer.points.tobytes() == before


def test_wrong_options_and_meshes_are_refused_at_once():
    mesh = random_mesh("triangle", 1)
    with pytest.raises(UsageError, match="order"):
        dvr_cli.Relaxer(mesh.points, pairs(mesh), order="random")
    with pytest.raises(UsageError, match="cells"):
        dvr_cli.Relaxer(mesh.points)
    with pytest.raises(InputError, match="does not exist"):
        dvr_cli.Relaxer(mesh.points[:5], pairs(mesh))


def test_surfaces_in_space_are_refused():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]])
    with pytest.raises(InputError, match="surface"):
        dvr_cli.Relaxer(points, {"triangle": np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])})


def test_a_mesh_without_interior_vertices():
    points = np.array([[0, 0], [1, 0], [0, 1.0]])
    relaxer = dvr_cli.Relaxer(points, {"triangle": np.array([[0, 1, 2]])})
    relaxed, report = relaxer.relax(displacement=points)
    assert np.array_equal(relaxed, 2 * points)
    assert report.stopped_because == "nothing-to-relax"


def test_the_example_in_the_documentation_works():
    results = doctest.testmod(relaxer_module)
    assert results.attempted > 0
    assert results.failed == 0
