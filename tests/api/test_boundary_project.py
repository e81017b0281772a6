"""``--boundary project`` and surfaces: vertices stay on the input's shape, the shape stays near it."""

import numpy as np
import pytest

import dvr_cli
from curved_parts import PARTS, apart, distances, scanned, skin, solid, surface
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.vector import at_least
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.stopping import Stopping
from meshes import grid
from needs import require

require("gmsh")

MESHES = {
    **{f"{name}-solid": lambda name=name: solid(name) for name in PARTS},
    **{f"{name}-surface": lambda name=name: surface(name) for name in PARTS},
    "scanned": scanned,
}
BOUND = 0.02  # of the diagonal; the meshes are coarse


def projected(mesh, sweeps=4, share=BOUND, **options):
    """Points and report after some sweeps; share: the bound on the deviation, of the diagonal.

    The meshes are so coarse that their facets turn by more than the usual feature angle.
    """
    bound = share * float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    stopping = Stopping(max_iterations=sweeps, tol=0)
    options = {"feature_angle": 60.0, **options}
    return smooth_mesh(
        mesh, SmoothOptions(boundary="project", max_deviation=bound, stopping=stopping, **options)
    )


def disc():
    """A disc of quadrilaterals whose inner vertices are astray, and which these are."""
    points, quads = grid(8, 2)
    u, v = 2 * points.T - 1
    around = np.column_stack([u * np.sqrt(1 - v * v / 2), v * np.sqrt(1 - u * u / 2)])
    inner = ((points > 0) & (points < 1)).all(axis=1)
    rng = np.random.default_rng(1)
    around[inner] += 0.03 * rng.uniform(-1, 1, (inner.sum(), 2))
    return Mesh(around, [Cells("quad", quads)]), inner


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.long] * name.startswith("torus")) for name in MESHES]
)
def test_vertices_stay_on_the_shape_and_the_shape_near_the_input(name):
    mesh = MESHES[name]()
    facets = skin(mesh)
    points, report = projected(mesh)
    on_skin = np.unique(facets)
    moved = (points != mesh.points).any(axis=1)[on_skin]
    assert moved.mean() > 0.5
    off = distances(points[on_skin[moved]], mesh.points, facets)
    near_folds = 0 if report.unfolding is None else report.unfolding.deviation
    assert off.max() <= max(1e-12, near_folds)
    assert (off < 1e-12).mean() > 0.9
    assert report.after.q1 > report.before.q1
    assert report.after.inverted <= report.before.inverted
    change = report.boundary
    assert 0 < change.deviation <= change.max_deviation
    assert apart(mesh.points, points, facets) <= change.max_deviation


@pytest.mark.parametrize("name", MESHES)
def test_the_quality_vector_never_decreases(name):
    mesh = MESHES[name]()
    last: dict[bool, np.ndarray] = {}
    for sweeps in (0, 1, 2):
        # polishing trades the vector for the mean, and after other sweeps patches are other ones
        _, report = projected(mesh, sweeps, polish=False, patches=False)
        assert at_least(report.after.vector, report.before.vector)
        # what is unfolded frees vertices: such runs are compared with each other
        unfolded = any(phase.phase == "unfold" for phase in report.phases)
        assert unfolded not in last or at_least(report.after.vector, last[unfolded])
        last[unfolded] = report.after.vector


@pytest.mark.parametrize(
    "name", ["sphere-surface", "cylinder-surface", pytest.param("torus-solid", marks=pytest.mark.long)]
)
def test_a_tight_bound_is_kept_and_a_bound_of_nothing_moves_nothing(name):
    mesh = MESHES[name]()
    points, report = projected(mesh, 3, share=2e-3)
    assert 0 < apart(mesh.points, points, skin(mesh)) <= report.boundary.max_deviation
    points, report = projected(mesh, 2, share=0.0)
    assert report.boundary.deviation == 0.0
    assert apart(mesh.points, points, skin(mesh)) < 1e-15


def test_what_is_measured_decides_and_not_what_the_moves_were_allowed(monkeypatch):
    """Too far at first: again, with shorter moves; too far whatever is tried: the input as it was."""
    mesh = surface("sphere")
    bound = BOUND * float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    measured = Engine.deviation
    found = []

    def twice_as_far(engine):
        found.append(measured(engine))
        return 2 * found[-1]

    monkeypatch.setattr(Engine, "deviation", twice_as_far)
    points, report = projected(mesh, 3)
    assert len(found) == 2
    assert found[0] > bound / 2 >= found[1] > 0
    assert apart(mesh.points, points, skin(mesh)) <= bound / 2
    monkeypatch.setattr(Engine, "deviation", lambda engine: 2 * bound)
    points, report = projected(mesh, 3)
    assert report.stopped_because == "deviation"
    assert (points == mesh.points).all()
    assert report.boundary.deviation == 0.0
    assert (report.after.vector == report.before.vector).all()


def test_the_change_of_volume_and_area_is_that_of_the_triangles():
    for mesh in (solid("sphere"), surface("torus")):
        points, report = projected(mesh)
        sizes = []
        for at in (mesh.points, points):
            a, b, c = at[skin(mesh)].swapaxes(0, 1)
            normal = np.cross(b - a, c - a)
            sizes.append(((a * normal).sum() / 6, np.linalg.norm(normal, axis=1).sum() / 2))
        volume, area = np.array(sizes[1]) / sizes[0] - 1
        assert report.boundary.volume_change == pytest.approx(volume, abs=1e-12)
        assert report.boundary.area_change == pytest.approx(area, abs=1e-12)
        assert volume != 0 != area


@pytest.mark.parametrize("make", [solid, surface])
def test_features_of_a_cylinder_are_kept(make):
    """Its two rims: their vertices stay on the input's polygons, the lids in their planes."""
    mesh = make("cylinder")
    points, _ = projected(mesh)
    radius = np.linalg.norm(mesh.points[:, :2], axis=1)
    for height in (0.0, 2.0):
        lid = np.abs(mesh.points[:, 2] - height) < 1e-9
        np.testing.assert_allclose(points[lid, 2], height, rtol=0, atol=1e-14)
        rim = np.flatnonzero(lid & (radius > 1 - 1e-9))
        rim = rim[np.argsort(np.arctan2(mesh.points[rim, 1], mesh.points[rim, 0]))]
        edges = np.stack([rim, np.roll(rim, 1)], axis=1)
        assert (points[rim] != mesh.points[rim]).any()
        assert distances(points[rim], mesh.points, edges).max() < 1e-14


def test_features_of_a_box_are_kept_exactly():
    """A surface with flat faces and straight edges keeps every face and edge, to the last bit."""
    rng = np.random.default_rng(0)
    square, quads = grid(4, 2)
    points, cells = [], []
    for axis in range(3):
        for side in (0.0, 1.0):
            cells.append(quads + len(square) * len(cells))
            points.append(np.insert(square, axis, side, axis=1))
    points, same = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    quads = same.ravel()[np.concatenate(cells)]
    inner = (points > 0) & (points < 1)
    points[inner] += 0.08 * rng.uniform(-1, 1, inner.sum())
    quads = quads[rng.permutation(len(quads))]
    result, report = projected(Mesh(points, [Cells("quad", quads)]), 6)
    assert report.mesh.surface
    assert report.relaxed == len(points) - 8
    assert report.after.q1 > report.before.q1 + 0.05
    assert (result[~inner] == points[~inner]).all()
    assert (result[inner] != points[inner]).mean() > 0.5
    assert report.boundary.deviation < 1e-15
    assert report.boundary.volume_change == pytest.approx(0, abs=1e-14)


def test_nothing_folds_over():
    """Each triangle of a smoothed surface faces the way the smooth surface does where it now lies."""
    for name in ("sphere", "torus"):
        mesh = surface(name)
        for points in (mesh.points, projected(mesh, 8, share=0.1)[0]):
            a, b, c = points[mesh.cells[0].vertices].swapaxes(0, 1)
            outward = (a + b + c) / 3
            if name == "torus":
                outward[:, :2] *= 1 - 1 / np.linalg.norm(outward[:, :2], axis=1)[:, None]
            assert ((np.cross(b - a, c - a) * outward).sum(axis=1) > 0).all()


def test_mirrored_triangles_of_a_surface_make_no_difference():
    mesh = surface("sphere")
    triangles = mesh.cells[0].vertices.copy()
    triangles[::3] = triangles[::3, [0, 2, 1]]
    points, report = projected(Mesh(mesh.points, [Cells("triangle", triangles)]), 2)
    assert report.mesh.mirrored == len(triangles[::3])
    np.testing.assert_allclose(points, projected(mesh, 2)[0], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "name", ["cylinder-solid", "sphere-surface", pytest.param("disc", marks=pytest.mark.long)]
)
@pytest.mark.parametrize("order", ["coloured", pytest.param("natural", marks=pytest.mark.long)])
def test_engines_and_threads_agree_to_the_bit(name, order):
    require("numba")
    mesh = disc()[0] if name == "disc" else MESHES[name]()
    runs = [("numpy", 1), ("numba", 1), ("numba", 2)]
    results = [projected(mesh, 2, order=order, engine=e, threads=t)[0] for e, t in runs]
    assert results[0].tobytes() == results[1].tobytes() == results[2].tobytes()


def test_a_thin_wall_keeps_its_sides():
    """Two shells nearer to each other than either is to its own chords: no vertex changes sides."""
    outer = surface("sphere")
    n, triangles = len(outer.points), outer.cells[0].vertices
    points = np.concatenate([outer.points, 0.999 * outer.points])
    both = Mesh(points, [Cells("triangle", np.concatenate([triangles, triangles[:, ::-1] + n]))])
    result, _ = projected(both)
    assert (result != points).any(axis=1).mean() > 0.4  # chords may come by a third of the wall
    assert distances(result[:n], points, triangles).max() < 1e-14
    assert distances(result[n:], points, triangles + n).max() < 1e-14


def test_the_lips_of_a_curved_slit_stay():
    """A plate with a curved slit along its middle, whose lips coincide: neither moves."""
    points, quads = grid(8, 2)
    rng = np.random.default_rng(3)
    inner = ((points > 0) & (points < 1)).all(axis=1) & (points[:, 1] != 0.5)
    points[inner] += 0.04 * rng.uniform(-1, 1, (inner.sum(), 2))
    points[:, 1] += 0.1 * np.sin(np.pi * points[:, 0])
    on_slit = np.flatnonzero(grid(8, 2)[0][:, 1] == 0.5)[:-2]
    copies = dict(zip(on_slit.tolist(), range(len(points), len(points) + len(on_slit)), strict=True))
    above = grid(8, 2)[0][quads].mean(axis=1)[:, 1] > 0.5
    quads[above] = [[copies.get(v, v) for v in quad] for quad in quads[above].tolist()]
    mesh = Mesh(np.concatenate([points, points[on_slit]]), [Cells("quad", quads)])
    result, report = projected(mesh)
    lips = [*copies, *copies.values()]
    assert (result[lips] == mesh.points[lips]).all()
    assert report.relaxed > inner.sum()  # the curved border above and below takes part
    assert report.after.q1 >= report.before.q1


def test_a_curved_planar_boundary():
    """Vertices stay on the input's polygon, which the new one stays near; a bend is a corner."""
    mesh, inner = disc()
    points = mesh.points
    rim = np.flatnonzero(~inner)
    rim = rim[np.argsort(np.arctan2(points[rim, 1], points[rim, 0]))]
    edges = np.stack([rim, np.roll(rim, -1)], axis=1)
    result, report = projected(mesh, 8)
    assert report.relaxed == len(points)
    assert (result[rim] != points[rim]).any()
    assert distances(result[rim], points, edges).max() < 1e-14
    assert apart(points, result, edges) <= report.boundary.max_deviation
    assert report.boundary.volume_change is None
    sharp, report = projected(mesh, 2, feature_angle=1.0)
    assert report.relaxed == inner.sum()
    assert (sharp[rim] == points[rim]).all()


def test_a_mesh_with_flat_faces_slides_as_exactly_as_with_slide():
    points, boxes = grid(3, 3)
    points = points + 0.05 * np.sin(40 * points[:, ::-1]) * (points > 0) * (points < 1)
    cells = {"hexahedron": boxes}
    options = {"max_iterations": 3, "tol": 0.0}
    slid, _ = dvr_cli.smooth(points, cells, boundary="slide", **options)
    result, report = dvr_cli.smooth(points, cells, boundary="project", **options)
    assert (slid == result).all()
    assert (slid != points).any()
    assert report.boundary is None


@pytest.mark.parametrize("options", [{"directions": "steepest"}, {"directions": "optimal"}, {"polish": True}])
@pytest.mark.parametrize("name", ["cylinder-solid", "sphere-surface"])
def test_other_ways_of_relaxing_keep_the_shape_too(name, options):
    mesh = MESHES[name]()
    points, report = projected(mesh, 2, **options)
    on_skin = np.unique(skin(mesh))
    assert report.after.q1 > report.before.q1
    assert distances(points[on_skin], mesh.points, skin(mesh)).max() < 1e-12
    assert apart(mesh.points, points, skin(mesh)) <= report.boundary.max_deviation
