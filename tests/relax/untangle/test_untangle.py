"""Untangling: every mesh that can be valid becomes valid, and where that cannot be nothing gets worse."""

import numpy as np
import pytest

import dvr_cli
import oracle
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.boundary.freedom import Freedom, interior_freedom
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.mean_ratio import corner_qualities, element_qualities
from dvr_cli.relax.stopping import Stopping
from dvr_cli.relax.untangle.energy import Energy
from dvr_cli.relax.untangle.phase import inverted_by_held, untangle
from dvr_cli.report.text.summary import smooth_text
from meshes import KINDS, boxes_of, bump, delaunay, random_mesh, tangled, turned_hexagon


def cells_of(mesh):
    return [(block.type, block.vertices) for block in mesh.cells]


def untangled(mesh):
    """The points after untangling; checks what holds for every mesh."""
    points, report = dvr_cli.untangle(mesh.points, cells_of(mesh))
    domain = domain_of(mesh)
    assert np.isfinite(points).all()
    assert points[~domain.interior].tobytes() == mesh.points[~domain.interior].tobytes()
    diagonal = np.linalg.norm(np.ptp(mesh.points, axis=0))
    assert (points >= mesh.points.min(axis=0) - diagonal).all()
    assert (points <= mesh.points.max(axis=0) + diagonal).all()
    assert report.after.inverted <= report.before.inverted
    qualities = [oracle.element_quality(name, points[v]) for name, block in cells_of(mesh) for v in block]
    assert min(qualities) == pytest.approx(report.after.minimum, rel=1e-9, abs=1e-12)
    return points, report


# ----------------------------------------------------------------------------------------------------- energy


@pytest.mark.parametrize("kind", KINDS)
def test_the_gradient_is_that_of_the_energy(kind):
    mesh = random_mesh(kind, 1, noise=1.0)
    domain = domain_of(mesh)
    energy = Energy(domain.points, domain.corners, interior_freedom(domain.interior, domain.dimension))
    rng = np.random.default_rng(0)
    here = 0.3 * rng.normal(size=domain.interior.sum() * domain.dimension)
    way, h = rng.normal(size=here.size), 1e-6
    _, gradient = energy.regularised(here, 0.1)
    ends = [energy.regularised(here + side * h * way, 0.1)[0] for side in (-1, 1)]
    assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(gradient @ way, rel=1e-6)


@pytest.mark.parametrize("kind", ["quad", "hexahedron", "mixed3d"])
@pytest.mark.parametrize("axes", ["parallel", "oblique"])
def test_the_gradient_on_lines_and_in_planes_is_that_of_the_energy(kind, axes):
    """Vertices on lines, in planes and free ones at once; the derivative is taken along a way they can go."""
    mesh = random_mesh(kind, 1, noise=1.0)
    domain = domain_of(mesh)
    d, moving = domain.dimension, np.flatnonzero(domain.interior)
    rng = np.random.default_rng(5)
    dimension = np.where(domain.interior, d, 0).astype(np.uint8)
    dimension[moving] = rng.integers(1, d + 1, len(moving))
    axis = np.zeros((len(domain.points), d))
    held = moving[dimension[moving] < d]
    axis[held] = (
        np.eye(d)[rng.integers(d, size=len(held))] if axes == "parallel" else rng.normal(size=(len(held), d))
    )
    axis[held] /= np.linalg.norm(axis[held], axis=1, keepdims=True)
    energy = Energy(domain.points, domain.corners, Freedom(dimension, axis))
    # a way along each line and in each plane, found without the code under test
    way = rng.normal(size=(len(moving), d))
    for row, vertex in enumerate(moving):
        across = (way[row] @ axis[vertex]) * axis[vertex]
        way[row] = across if dimension[vertex] == 1 else way[row] - across
    here, way, h = 0.2 * way.ravel(), way.ravel(), 1e-6
    _, gradient = energy.regularised(here, 0.1)
    ends = [energy.regularised(here + side * h * way, 0.1)[0] for side in (-1, 1)]
    assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(gradient @ way, rel=1e-6)
    steps = gradient.reshape(-1, d)
    for row, vertex in enumerate(moving):
        across = steps[row] @ axis[vertex]
        outside = steps[row] - across * axis[vertex] if dimension[vertex] == 1 else across
        assert np.abs(outside).max(initial=0.0) <= 1e-12 * max(1.0, np.abs(steps).max())


@pytest.mark.parametrize("kind", KINDS)
def test_without_regularisation_the_energy_is_the_sum_of_the_inverse_qualities(kind):
    mesh = random_mesh(kind, 2, noise=0.1)
    domain = domain_of(mesh)
    free = interior_freedom(domain.interior, domain.dimension)
    nowhere = np.zeros(domain.interior.sum() * domain.dimension)
    value, _ = Energy(domain.points, domain.corners, free).regularised(nowhere, 0.0)
    touched = domain.interior[domain.corners.vertices].any(axis=1)
    assert value == pytest.approx((1 / corner_qualities(domain.points, domain.corners)[touched]).sum())


# ----------------------------------------------------------------------------------- meshes that can be valid


@pytest.mark.parametrize("directions", ["axis", "circumferential"])
@pytest.mark.parametrize("rings", [8, 12, pytest.param(20, marks=pytest.mark.long)])
@pytest.mark.parametrize("degrees", [18, 40])
def test_hexagon_with_turned_boundary(rings, degrees, directions):
    """Paper, section 5.3, and further: all positive, and nearly equilateral after relaxation."""
    mesh = turned_hexagon(rings, degrees)
    points, report = dvr_cli.smooth(
        mesh.points, cells_of(mesh), directions=directions, center=(0, 0), untangle=True, shape="ideal"
    )
    assert report.before.inverted > 0
    assert report.after.inverted == 0
    assert report.after.q1 > 0.95
    qualities = [oracle.element_quality("triangle", points[v]) for v in mesh.cells[0].vertices]
    assert min(qualities) == pytest.approx(report.after.minimum)


@pytest.mark.parametrize(
    ("rings", "mild"), [(8, True), pytest.param(12, True, marks=pytest.mark.long), (20, False)]
)
def test_relaxation_alone_repairs_the_hexagon_only_while_the_tangling_is_mild(rings, mild):
    """As in the paper, along the axes; with 20 rings 18 degrees are too much for any vertex to be first."""
    mesh = turned_hexagon(rings, 18)
    _, report = dvr_cli.smooth(
        mesh.points,
        cells_of(mesh),
        directions="axis",
        target=0.951,
        tol=0,
        max_iterations=150,
        shape="ideal",  # what is sheared all alike looks deliberate
    )
    assert (report.after.inverted == 0) == mild
    assert (report.after.q1 > 0.95) == mild


@pytest.mark.parametrize("trials", [10, pytest.param(50, marks=pytest.mark.long)])
@pytest.mark.parametrize("lengths", [1, 2])
@pytest.mark.parametrize(("kind", "n"), [("triangle", 8), ("quad", 8), ("tetra", 4), ("hexahedron", 5)])
def test_random_tangles(kind, n, lengths, trials):
    for seed in range(trials):
        mesh = tangled(kind, n, lengths, seed)
        domain = domain_of(mesh)
        assert domain.mirrored == 0
        result = untangle(domain.points, domain.corners, interior_freedom(domain.interior, domain.dimension))
        assert element_qualities(mesh.points, domain.corners).min() < 0
        assert element_qualities(result.points, domain.corners).min() > 0, seed
        assert result.stopped_because == "untangled"


@pytest.mark.parametrize(
    ("kind", "n"), [("triangle", 20), ("triangle", 40), ("quad", 40), ("tetra", 10), ("hexahedron", 10)]
)
def test_bumps(kind, n):
    mesh = bump(kind, n)
    assert dvr_cli.quality_report(mesh.points, cells_of(mesh)).quality.inverted >= 22
    _, report = untangled(mesh)
    assert report.after.inverted == report.after.degenerate == 0
    assert report.untangling.left["elements"] == 0


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_element(kind):
    mesh = random_mesh(kind, 3, noise=0.0)
    domain = domain_of(mesh)
    rng = np.random.default_rng(3)
    mesh.points[domain.interior] += rng.uniform(-0.4, 0.4, (domain.interior.sum(), domain.dimension))
    _, report = untangled(mesh)
    assert report.before.inverted > 0
    assert report.after.inverted == report.after.degenerate == 0


def test_elements_that_are_points_are_unfolded():
    mesh = boxes_of("tetra", 3)
    inner = domain_of(mesh).interior
    mesh.points[inner] = mesh.points[inner][0]
    _, report = untangled(mesh)
    assert report.before.degenerate > 0
    assert report.after.minimum > 0.1


@pytest.mark.parametrize(("scale", "shift"), [(1e-30, 0.0), (1e30, 0.0), (1.0, 1e6)])
def test_any_unit_of_length_will_do(scale, shift):
    mesh = tangled("quad", 6, 1, 0)
    mesh.points = mesh.points * scale + shift
    _, report = untangled(mesh)
    assert report.after.inverted == 0


# ------------------------------------------------------------------------------------- what is left as it was


def test_a_valid_mesh_is_left_alone():
    mesh = random_mesh("mixed3d", 1)
    points, report = untangled(mesh)
    assert points.tobytes() == mesh.points.tobytes()
    assert report.untangling.stopped_because == "nothing-to-untangle"


def test_vertices_far_from_inverted_elements_stay():
    mesh = boxes_of("quad", 30)
    moved = np.flatnonzero(np.linalg.norm(mesh.points - 0.5, axis=1) < 1e-9)
    mesh.points[moved] += 0.05
    points, report = untangled(mesh)
    assert report.after.inverted == 0 < report.before.inverted
    far = np.linalg.norm(mesh.points - 0.5, axis=1) > 0.35
    assert points[far].tobytes() == mesh.points[far].tobytes()


@pytest.mark.parametrize("kind", ["quad", "tetra"])
def test_boundary_vertices_take_part_where_they_may_slide(kind):
    mesh = tangled(kind, 4, 2, 0)
    points, report = dvr_cli.untangle(mesh.points, cells_of(mesh), boundary="slide")
    assert report.before.inverted > 0 == report.after.inverted == report.after.degenerate
    assert (points != mesh.points)[~domain_of(mesh).interior].any()
    for side in (0, 1):
        assert ((points == side) == (mesh.points == side)).all()


def test_vertices_keep_to_their_lines_and_planes():
    """The top and right sides of a square may slide; the input has a side vertex beyond its neighbour."""
    mesh = boxes_of("quad", 4)
    right = (mesh.points[:, 0] == 1) & (mesh.points[:, 1] > 0) & (mesh.points[:, 1] < 1)
    domain = domain_of(mesh)
    dimension = np.where(domain.interior, 2, np.where(right, 1, 0)).astype(np.uint8)
    axis = np.where(right[:, None], [0.0, 1.0], 0.0)
    points = mesh.points.copy()
    points[right] = points[right][[1, 0, 2]]
    assert element_qualities(points, domain.corners).min() < 0
    fixed = untangle(points, domain.corners, interior_freedom(domain.interior, 2))
    assert element_qualities(fixed.points, domain.corners).min() < 0
    result = untangle(points, domain.corners, Freedom(dimension, axis))
    assert element_qualities(result.points, domain.corners).min() > 0
    assert (result.points[right, 0] == 1).all()
    held = dimension == 0
    assert result.points[held].tobytes() == points[held].tobytes()


# ---------------------------------------------------------------------------- boundaries that forbid validity


def test_a_boundary_that_crosses_itself():
    mesh = boxes_of("triangle", 6)
    pushed = np.flatnonzero((mesh.points[:, 1] == 0) & (np.abs(mesh.points[:, 0] - 0.5) < 1e-9))
    mesh.points[pushed] = [0.5, 1.05]
    _, report = untangled(mesh)
    left = report.untangling.left
    assert report.untangling.stopped_because == "stuck"
    assert left["elements"] == left["crossing"] == report.after.inverted > 0
    assert report.after.worst[0].quality == report.after.minimum < 0
    assert 0.0 < report.after.worst[0].centroid[0] < 1.0
    _, smoothed = dvr_cli.smooth(mesh.points, cells_of(mesh), untangle=True, shape="ideal")
    assert 0 < smoothed.after.inverted <= report.after.inverted


def test_an_element_whose_vertices_are_all_held():
    """A corner of the square is folded over, and with it a triangle without inner vertex; the rest can be."""
    mesh = boxes_of("triangle", 6)
    corner = np.flatnonzero((mesh.points == [1, 0]).all(axis=1))
    mesh.points[corner] = [0.7, 0.3]
    mesh.points[domain_of(mesh).interior] += 0.3
    domain = domain_of(mesh)
    assert inverted_by_held(domain.points, domain.corners, interior_freedom(domain.interior, 2)).sum() == 1
    _, report = untangled(mesh)
    assert report.before.inverted > 1
    assert report.after.inverted == 1
    assert report.untangling.left == {"elements": 1, "hopeless": 1, "crossing": 0}


def test_nothing_can_move():
    points = np.array([[0.0, 0], [1, 0], [0.2, 0.2], [0, 1]])
    moved, report = untangled(Mesh(points, [Cells("quad", np.array([[0, 1, 2, 3]]))]))
    assert moved.tobytes() == points.tobytes()
    assert report.untangling.left["hopeless"] == 1


@pytest.mark.parametrize("seed", range(5))
def test_scrambled_meshes_never_get_more_inverted_elements(seed):
    """All vertices at random, the boundary as well: hardly anything can be done, and nothing may go wrong."""
    mesh = delaunay(60, 2 + seed % 2, seed)
    mesh.points = np.random.default_rng(seed).random(mesh.points.shape)
    untangled(mesh)


# --------------------------------------------------------------------------------------- ending and repeating


@pytest.mark.parametrize("after", [0, 1, 40, 200])
def test_interrupting_leaves_the_best_mesh_reached(after):
    mesh = bump("triangle", 20)
    domain = domain_of(mesh)
    asked = 0

    def interrupted():
        nonlocal asked
        asked += 1
        return asked > after

    free = interior_freedom(domain.interior, 2)
    result = untangle(domain.points, domain.corners, free, interrupted)
    assert result.stopped_because == "interrupted"
    assert asked <= after + 5
    before, reached = (element_qualities(points, domain.corners) for points in (mesh.points, result.points))
    assert (reached < 0).sum() <= (before < 0).sum()


def test_the_time_limit_counts_for_both_stages():
    mesh = bump("quad", 40)
    _, report = dvr_cli.smooth(mesh.points, cells_of(mesh), untangle=True, shape="ideal", time_limit=0)
    assert report.untangling.stopped_because == "interrupted"
    assert report.stopped_because == "time-limit"
    assert report.sweeps == []


def test_untangling_alone_says_why_it_ended_early():
    mesh, options = (
        bump("triangle", 20),
        SmoothOptions(untangle=True, shape="ideal", stopping=Stopping(max_iterations=0)),
    )
    _, report = smooth_mesh(mesh, options, interrupted=lambda: True)
    assert report.stopped_because == "interrupted"
    assert "interrupted: the mesh reached by then was written" in smooth_text(report, "in", "out")
    _, report = dvr_cli.untangle(mesh.points, cells_of(mesh), time_limit=0)
    assert report.stopped_because == "time-limit"
    assert "stopped: the time limit" in smooth_text(report, "in", "out")


def test_results_repeat_on_either_engine():
    mesh = tangled("hexahedron", 4, 2, 5)
    results = [
        dvr_cli.smooth(
            mesh.points, cells_of(mesh), untangle=True, shape="ideal", engine=engine, threads=threads
        )[0].tobytes()
        for engine, threads in (("numpy", 1), ("numpy", 1), ("numba", 2))
    ]
    assert results[0] == results[1] == results[2]


def test_a_tilted_plane_is_kept():
    mesh = tangled("quad", 6, 1, 1)
    axes = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0][:2]
    mesh.points = mesh.points @ axes + 3.0
    points, report = dvr_cli.untangle(mesh.points, cells_of(mesh))
    assert report.after.inverted == 0 < report.before.inverted
    assert np.abs((points - points.mean(axis=0)) @ np.cross(*axes)).max() < 1e-14
