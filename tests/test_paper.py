"""The experiments of the paper, repeated on generated meshes, as those of the paper are not available."""

import numpy as np
import pytest

import dvr_cli
import oracle
from dvr_cli.api.measuring import mesh_quality
from dvr_cli.mesh.corners import corners_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.vector import at_least
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.problem import build_problem
from meshes import delaunay, hexagon

# ------------------------------------------------------------------- 3.3: two triangles with a common vertex

# The paper gives no coordinates, but λ and qualities to two or three digits (Fig. 4). These fulfil them all.
V1, V2, V3 = (0.0, 0.0), (-0.3398, -0.1291), (0.2407, -0.7976)
V4, V5 = (0.4719, -0.8126), (0.6291, 0.1129)
TWO = Mesh(np.array([V1, V2, V3, V4, V5]), [Cells("triangle", np.array([[0, 1, 2], [0, 3, 4]]))])
VERTICAL = np.array([0.0, 1.0])
INCLINED = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6)])


def two_triangles(direction):
    """λ, the qualities of both triangles there, and the best λ of each triangle alone (by the oracle)."""
    problem = build_problem(corners_of(TWO.cells, 2), np.array([0]), TWO.points)
    engine = NumpyEngine(problem)
    engine.load(TWO.points)
    assert engine.relax_batch(0, direction[None]) == 1
    step = (engine.points[0] - TWO.points[0]) @ direction
    np.testing.assert_allclose(engine.points[0], step * direction, atol=1e-15)
    assert engine.points[1:].tobytes() == TWO.points[1:].tobytes()
    ring = oracle.ring_of(TWO.points, [("triangle", TWO.cells[0].vertices)], 0)
    best, quality = oracle.line_problem(ring, TWO.points[0], direction)
    qualities = oracle.ring_qualities(ring, TWO.points[0], direction, step)
    assert step == pytest.approx(best, abs=1e-7)
    assert min(qualities) == pytest.approx(quality, abs=1e-12)
    return step, qualities, [oracle.line_problem([corner], TWO.points[0], direction)[0] for corner in ring]


def test_two_triangles_before():
    qualities = [oracle.element_quality("triangle", TWO.points[v]) for v in TWO.cells[0].vertices]
    assert qualities == pytest.approx([0.65, 0.90], abs=5e-4)


def test_optimum_at_the_maximum_of_one_curve():
    """Fig. 4a: moved vertically, the vertex stops where the first triangle is best, below the second."""
    step, (first, second), (best_of_first, _) = two_triangles(VERTICAL)
    assert step == pytest.approx(0.25, abs=5e-4)
    assert step == pytest.approx(best_of_first, abs=1e-7)
    assert first < second - 0.01


def test_optimum_at_the_crossing_of_two_curves():
    """Fig. 4b: inclined by 30 degrees, 0.65 and 0.90 become 0.80 both; alone they would end elsewhere."""
    step, (first, second), (best_of_first, best_of_second) = two_triangles(INCLINED)
    assert step == pytest.approx(0.125, abs=5e-4)
    assert first == pytest.approx(0.80, abs=5e-4)
    assert first == pytest.approx(second, rel=1e-12)
    assert best_of_second < step - 0.01 < step + 0.01 < best_of_first


# --------------------------------------------------------------------------- 3.5: random points in the square


@pytest.mark.parametrize("trials", [5, pytest.param(20, marks=pytest.mark.long)])
def test_q1_of_a_delaunay_mesh_grows_by_a_factor_over_50_in_each_trial(trials):
    """99 points, 86 of them interior. The paper's Q1 grows by factors exceeding 80, with these points too.

    The paper makes 20 trials.
    Their seed is the first of 0, 1, 2, ... with 86 interior points and a Q1 between 0.004 and 0.006: as poor
    as the paper's mesh must be for Q1 to grow about a hundredfold. The outcome had no say in the choice.
    """
    mesh = delaunay(99, 2, seed=6)
    report = mesh_quality(mesh)
    assert report.relaxed == 86
    assert 0.004 < report.quality.q1 < 0.006
    for trial in range(trials):
        _, report = dvr_cli.smooth(
            mesh.points,
            {"triangle": mesh.cells[0].vertices},
            preset="paper",
            seed=trial,
            max_iterations=50,
        )
        q1 = [report.before.q1, *(sweep["q1"] for sweep in report.sweeps)]
        assert len(q1) == 51
        assert (np.diff(q1) >= 0).all()
        assert report.after.q1 > 50 * report.before.q1


# --------------------------------------------------------------------------------- 3.6: a tetrahedral mesh


def laplacian(mesh, sweeps):
    """The points after moving all interior vertices to the mean of their neighbours a number of times."""
    tetrahedra, n = mesh.cells[0].vertices, len(mesh.points)
    neighbours = np.zeros((n, n), dtype=bool)
    for i in range(4):
        for j in set(range(4)) - {i}:
            neighbours[tetrahedra[:, i], tetrahedra[:, j]] = True
    interior = domain_of(mesh).interior
    points = mesh.points.copy()
    for _ in range(sweeps):
        means = neighbours @ points / neighbours.sum(axis=1, keepdims=True)
        points[interior] = means[interior]
    return points


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_laplacian_smoothing_can_lower_what_relaxation_raises(seed):
    """295 random points in the unit cube, as many as in the paper, and 50 sweeps of either method."""
    mesh = delaunay(295, 3, seed)
    before = mesh_quality(mesh).quality
    smoothed = mesh_quality(Mesh(laplacian(mesh, 50), mesh.cells)).quality
    assert before.q1 > 0
    assert smoothed.q1 < before.q1
    assert not at_least(smoothed.vector, before.vector)
    _, report = dvr_cli.smooth(mesh.points, {"tetra": mesh.cells[0].vertices}, max_iterations=50, tol=0)
    assert report.after.q1 > before.q1
    assert report.after.inverted == 0


# ------------------------------------------------------------------- 5.2, 5.3: a hexagon, deformed by turning


def turned(points, angles):
    """The points (N, 2), each turned about the origin by its angle."""
    x, y = points.T
    return np.column_stack([np.cos(angles) * x - np.sin(angles) * y, np.sin(angles) * x + np.cos(angles) * y])


def distance_from_centre(points):
    """0 in the centre of the hexagon, 1 on its boundary, the same on each ring of triangles between them."""
    normals = np.pi / 6 + np.pi / 3 * np.arange(3)
    along = points @ np.array([np.cos(normals), np.sin(normals)])
    return np.abs(along).max(axis=1) / np.sqrt(0.75)


def relaxed_hexagon(points, directions, max_iterations=200):
    """Points and report of relaxing the deformed hexagon, its centre held, until Q1 reaches 0.95."""
    mesh = hexagon(8)
    centre = np.flatnonzero(~mesh.points.any(axis=1))
    assert len(centre) == 1
    cells = [("triangle", mesh.cells[0].vertices), ("vertex", centre[:, None])]
    options = {"center": (0, 0), "target": 0.95, "tol": 0, "max_iterations": max_iterations}
    result, report = dvr_cli.smooth(points, cells, directions=directions, **options)
    held = distance_from_centre(mesh.points) > 1 - 1e-9
    held[centre] = True
    assert report.relaxed == (~held).sum()
    assert result[held].tobytes() == points[held].tobytes()
    return result, report


def test_hexagon_consists_of_equilateral_triangles():
    mesh = hexagon(8)
    assert len(mesh.points) == 217
    assert mesh_quality(mesh).quality.minimum == pytest.approx(1)


def test_twisted_hexagon_is_straightened_by_circumferential_directions_in_far_fewer_sweeps():
    """Section 5.2: inner vertices turned by up to 29 degrees, most halfway between centre and boundary."""
    mesh = hexagon(8)
    points = turned(mesh.points, 0.5 * np.sin(np.pi * distance_from_centre(mesh.points)))
    boundary = distance_from_centre(mesh.points) > 1 - 1e-9
    points[boundary] = mesh.points[boundary]
    reports = {name: relaxed_hexagon(points, name)[1] for name in ("axis", "circumferential")}
    for report in reports.values():
        assert 0 < report.before.q1 < 0.2
        assert report.after.q1 > 0.95
    assert len(reports["axis"].sweeps) > 3 * len(reports["circumferential"].sweeps)


@pytest.mark.parametrize("directions", ["axis", "circumferential,radial"])
def test_hexagon_with_turned_boundary_is_untangled_and_straightened(directions):
    """Section 5.3: 18 degrees invert the outermost triangles, which relaxation alone makes positive again.

    Circumferential directions alone end at 0.82 on this mesh: along its tangent no vertex comes closer to
    the centre than it is. With radial ones between them they do it in fewer sweeps than the axes.
    """
    mesh = hexagon(8)
    boundary = distance_from_centre(mesh.points) > 1 - 1e-9
    points = turned(mesh.points, np.where(boundary, np.pi / 10, 0))
    result, report = relaxed_hexagon(points, directions)
    assert report.before.q1 < 0 < report.before.inverted
    assert report.after.inverted == 0
    assert report.after.q1 > 0.95
    ideal = turned(mesh.points, np.pi / 10)
    assert np.abs(result - ideal).max() < np.abs(points - ideal).max() / 3


def test_circumferential_directions_alone_untangle_the_hexagon_with_turned_boundary():
    mesh = hexagon(8)
    boundary = distance_from_centre(mesh.points) > 1 - 1e-9
    points = turned(mesh.points, np.where(boundary, np.pi / 10, 0))
    result, report = relaxed_hexagon(points, "circumferential", max_iterations=30)
    assert report.before.q1 < 0 < report.after.q1
    radius = np.linalg.norm(result, axis=1) - np.linalg.norm(points, axis=1)
    assert radius.min() > -1e-15
