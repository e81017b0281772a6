"""What ``import dvr_cli`` offers: meshes and arrays in, improved ones out, and figures that agree."""

import doctest

import meshio
import numpy as np
import pytest

import dvr_cli
import dvr_cli.api.public
import oracle
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.errors import DvrError, InputError, UsageError
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.vector import at_least
from dvr_cli.relax.engines.choice import has_numba
from meshes import KINDS, delaunay, random_mesh


def as_meshio(mesh, **data):
    return meshio.Mesh(mesh.points, [(block.type, block.vertices) for block in mesh.cells], **data)


def rich(kind="tetra"):
    """A meshio.Mesh with lines on its boundary, and with every kind of data meshio knows."""
    mesh = random_mesh(kind, 1)
    outside = np.flatnonzero(~domain_of(mesh).interior)
    lines = np.column_stack([outside[:-1], outside[1:]])
    cells = [("line", lines), *((block.type, block.vertices) for block in mesh.cells)]
    rng = np.random.default_rng(0)
    return meshio.Mesh(
        mesh.points.copy(),
        cells,
        point_data={"u": rng.normal(size=mesh.points.shape), "id": np.arange(len(mesh.points))},
        cell_data={
            "gmsh:physical": [np.full(len(data), 3, dtype=np.int32) for _, data in cells],
            "load": [rng.normal(size=(len(data), 2)) for _, data in cells],
        },
        field_data={"steel": np.array([3, 3])},
        point_sets={"clamped": np.array([0, 1, 2])},
        cell_sets={"some": [np.array([0]), np.array([1, 2]), *([np.empty(0, dtype=int)] * (len(cells) - 2))]},
        gmsh_periodic=[(1, (1, 2), None, np.array([[0, 1]]))],
        info={"comment": "kept"},
    )


def contents(value):
    """Everything in a value, bit by bit, in a form that compares."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, dict):
        return {name: contents(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [contents(entry) for entry in value]
    return value


def all_but_points(mesh):
    cells = [(block.type, contents(block.data)) for block in mesh.cells]
    names = ("point_data", "cell_data", "field_data", "point_sets", "cell_sets", "gmsh_periodic", "info")
    return {"cells": cells} | {name: contents(getattr(mesh, name)) for name in names}


# -------------------------------------------------------------------------------------------------- smooth


@pytest.mark.parametrize("kind", KINDS)
def test_smooth_improves_meshes_and_arrays_alike(kind):
    mesh = random_mesh(kind, 1)
    pairs = [(block.type, block.vertices) for block in mesh.cells]
    improved, report = dvr_cli.smooth(as_meshio(mesh), max_iterations=10)
    points, _ = dvr_cli.smooth(mesh.points, pairs, max_iterations=10)
    from_dict, _ = dvr_cli.smooth(mesh.points, dict(pairs), max_iterations=10)
    assert isinstance(improved, meshio.Mesh)
    assert isinstance(points, np.ndarray)
    assert improved.points.tobytes() == points.tobytes() == from_dict.tobytes()
    assert points.shape == mesh.points.shape
    assert report.after.q1 > report.before.q1
    qualities = [oracle.element_quality(name, points[v]) for name, vertices in pairs for v in vertices]
    assert min(qualities) == pytest.approx(report.after.minimum, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_the_input_is_not_altered(kind):
    mesh = rich(kind)
    before = contents(mesh.points), all_but_points(mesh)
    mesh.points.setflags(write=False)
    dvr_cli.smooth(mesh, max_iterations=3)
    dvr_cli.smooth(mesh.points, [(block.type, block.data) for block in mesh.cells], max_iterations=3)
    dvr_cli.quality_report(mesh)
    assert (contents(mesh.points), all_but_points(mesh)) == before


@pytest.fixture(scope="module")
def before_and_after():
    """A mesh with all kinds of data, and what it became."""
    mesh = rich()
    improved, _ = dvr_cli.smooth(mesh)
    return mesh, improved


@pytest.mark.parametrize("name", ["cells", "point_data", "cell_data", "field_data"])
def test_cells_and_data_are_kept(name, before_and_after):
    mesh, improved = before_and_after
    assert all_but_points(improved)[name] == all_but_points(mesh)[name]
    assert (improved.points != mesh.points).any()


@pytest.mark.parametrize("name", ["point_sets", "cell_sets", "gmsh_periodic", "info"])
def test_sets_and_periodic_links_are_kept(name, before_and_after):
    mesh, improved = before_and_after
    assert all_but_points(improved)[name] == all_but_points(mesh)[name]


def test_the_result_does_not_share_its_points_with_the_input():
    """Also when no vertex moved."""
    mesh = rich()
    for options in ({"max_iterations": 0}, {}):
        improved, _ = dvr_cli.smooth(mesh, **options)
        assert not np.shares_memory(improved.points, mesh.points)
        points, _ = dvr_cli.smooth(mesh.points, [(block.type, block.data) for block in mesh.cells], **options)
        assert not np.shares_memory(points, mesh.points)


def test_single_precision_points_are_improved_in_double():
    mesh = random_mesh("tetra", 1)
    single = meshio.Mesh(mesh.points.astype(np.float32), [("tetra", mesh.cells[0].vertices)])
    improved, report = dvr_cli.smooth(single)
    assert improved.points.dtype == np.float64
    assert dvr_cli.quality_report(improved).quality.q1 == report.after.q1


@pytest.mark.parametrize("kind", KINDS)
def test_figures_of_the_report_are_those_of_the_result(kind):
    mesh = as_meshio(random_mesh(kind, 1))
    improved, report = dvr_cli.smooth(mesh, max_iterations=8)
    for name, quality, measured in (("before", report.before, mesh), ("after", report.after, improved)):
        again = dvr_cli.quality_report(measured)
        assert again.record()["quality"] == report.record()[name]
        assert again.quality.elements.tobytes() == quality.elements.tobytes()
        assert again.quality.vector.tobytes() == quality.vector.tobytes()
        assert again.mesh == report.mesh
    assert at_least(report.after.vector, report.before.vector)


def test_figures_of_a_mesh_in_a_tilted_plane_are_those_of_the_result_but_for_rounding():
    """The plane is found anew in the result, and its axes differ in the last digits."""
    mesh = as_meshio(random_mesh("triangle", 1))
    mesh.points = mesh.points @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0][:2]
    improved, report = dvr_cli.smooth(mesh)
    again = dvr_cli.quality_report(improved)
    np.testing.assert_allclose(report.after.elements, again.quality.elements, rtol=1e-12)
    np.testing.assert_allclose(report.after.vector, again.quality.vector, rtol=1e-12)


@pytest.mark.parametrize("order", ["coloured", "natural", "shuffled"])
def test_the_same_call_gives_the_same_bytes(order):
    mesh = as_meshio(delaunay(150, 3, 0))
    options = {"order": order, "seed": 3, "directions": "random,axis,radial", "max_iterations": 10}
    one, other = (dvr_cli.smooth(mesh, **options) for _ in range(2))
    assert one[0].points.tobytes() == other[0].points.tobytes()
    first, second = (
        {k: v for k, v in run[1].record().items() if k not in ("seconds", "sweeps")} for run in (one, other)
    )
    assert first == second
    different, _ = dvr_cli.smooth(mesh, **options | {"seed": 4})
    assert different.points.tobytes() != one[0].points.tobytes()


def test_options_reach_the_relaxation():
    mesh = as_meshio(random_mesh("triangle", 1, n=6))
    given = {"directions": "random"}
    _, report = dvr_cli.smooth(mesh, **given, max_iterations=2, tol=0)
    assert (report.stopped_because, len(report.sweeps)) == ("max-iterations", 2)
    _, report = dvr_cli.smooth(mesh, **given, tol=1, patience=4)
    assert (report.stopped_because, len(report.sweeps)) == ("converged", 4)
    _, report = dvr_cli.smooth(mesh, **given, target=-1)
    assert (report.stopped_because, len(report.sweeps)) == ("target", 0)
    _, report = dvr_cli.smooth(mesh, **given, time_limit=0)
    assert (report.stopped_because, len(report.sweeps)) == ("time-limit", 0)
    improved, _ = dvr_cli.smooth(mesh, directions="y")
    assert improved.points[:, 0].tobytes() == mesh.points[:, 0].tobytes()
    assert improved.points[:, 1].tobytes() != mesh.points[:, 1].tobytes()
    center = mesh.points[np.flatnonzero(domain_of(random_mesh("triangle", 1, n=6)).interior)[0]] + 1e-3
    runs = [dvr_cli.smooth(mesh, directions="radial", center=c)[0].points for c in (None, center)]
    assert runs[0].tobytes() != runs[1].tobytes()


def test_the_paper_is_its_algorithm_1_with_that_many_sweeps():
    """Random directions, natural order, no criterion but the number of sweeps."""
    mesh = as_meshio(random_mesh("triangle", 1, n=6))
    by_name, report = dvr_cli.smooth(mesh, preset="paper", max_iterations=40)
    assert (report.stopped_because, len(report.sweeps)) == ("max-iterations", 40)
    spelt_out, _ = dvr_cli.smooth(mesh, directions="random", order="natural", tol=0, max_iterations=40)
    assert by_name.points.tobytes() == spelt_out.points.tobytes()
    assert report.options["preset"] == "paper"
    assert (report.options["order"], report.options["tol"]) == ("natural", 0)


def test_fields_of_the_mesh_are_directions():
    mesh = random_mesh("tetra", 1)
    vectors = np.random.default_rng(0).normal(size=mesh.points.shape)
    by_name, _ = dvr_cli.smooth(as_meshio(mesh, point_data={"wind": vectors}), directions="field:wind")
    by_array, _ = dvr_cli.smooth(as_meshio(mesh), directions=vectors)
    assert by_name.points.tobytes() == by_array.points.tobytes()


def test_inverted_cells_are_counted_before_and_after():
    """A vertex far outside its ring, on a line that leads back into it."""
    mesh = random_mesh("triangle", 1, n=6)
    mesh.points[np.flatnonzero(domain_of(mesh).interior)[0], 0] += 3
    _, report = dvr_cli.smooth(as_meshio(mesh), directions="x")
    assert report.before.inverted > 0
    assert report.before.q1 < 0
    assert report.after.inverted == 0
    assert report.after.q1 > 0


def test_the_example_in_the_documentation_works():
    results = doctest.testmod(dvr_cli.api.public)
    assert results.attempted > 0
    assert results.failed == 0


# ------------------------------------------------------------------------------------------- what is refused

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
TRIANGLES = {"triangle": np.array([[0, 1, 2], [0, 2, 3]])}


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"order": "random"}, "order"),
        ({"seed": -1}, "seed"),
        ({"floor": 1.5}, "floor"),
        ({"preset": "book"}, "preset"),
        ({"preset": "paper", "directions": np.ones((4, 2))}, "directions"),
        ({"preset": "paper", "tol": 0.5}, "tol"),
        ({"seed": 2**64}, "seed"),
        ({"directions": "up"}, "directions"),
        ({"directions": "file:nowhere.npy"}, "nowhere.npy"),
        ({"directions": "field:none"}, "field:none"),
        ({"directions": np.ones((3, 2))}, "directions"),
        ({"directions": "radial", "center": (1, 2, 3)}, "center"),
        ({"max_iterations": -1}, "max-iterations"),
        ({"tol": -1}, "tol"),
        ({"patience": 0}, "patience"),
        ({"time_limit": -1}, "time-limit"),
    ],
)
def test_wrong_options_are_refused_by_name(options, name):
    with pytest.raises(DvrError, match=name) as caught:
        dvr_cli.smooth(SQUARE, TRIANGLES, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("call", [dvr_cli.smooth, dvr_cli.quality_report])
def test_wrong_meshes_are_refused(call):
    with pytest.raises(UsageError, match="cells"):
        call(SQUARE)
    for points in (np.ones(4), np.ones((4, 1)), np.ones((4, 4)), np.ones((4, 2, 2))):
        with pytest.raises(UsageError, match="points: shape"):
            call(points, TRIANGLES)
    for cells in ({}, {"line": np.array([[0, 1]])}, {"triangle": np.array([[0, 1, 4]])}):
        with pytest.raises(InputError):
            call(SQUARE, cells)
    with pytest.raises(InputError, match="vertex 0"):
        call(SQUARE * np.nan, TRIANGLES)


# ------------------------------------------------------------------------------------- reports, comparing


@pytest.mark.parametrize("kind", KINDS)
def test_quality_report_of_meshes_and_arrays(kind):
    mesh = random_mesh(kind, 1)
    pairs = [(block.type, block.vertices) for block in mesh.cells]
    expected = [oracle.element_quality(name, mesh.points[v]) for name, vertices in pairs for v in vertices]
    for report in (
        dvr_cli.quality_report(as_meshio(mesh), worst=3),
        dvr_cli.quality_report(mesh.points, pairs, worst=3),
    ):
        np.testing.assert_allclose(report.quality.elements, expected, rtol=1e-9)
        assert len(report.quality.worst) == 3
        assert report.relaxed == domain_of(mesh).interior.sum()


def test_compare_says_which_mesh_is_better():
    before = as_meshio(random_mesh("tetra", 1))
    after, report = dvr_cli.smooth(before)
    comparison = dvr_cli.compare(before, after)
    assert comparison.better == "after"
    assert comparison.component == 1
    assert comparison.before.quality.q1 == report.before.q1
    assert comparison.after.quality.q1 == report.after.q1
    assert dvr_cli.compare(after, before).better == "before"
    assert dvr_cli.compare(after, after).better == "equal"
    assert dvr_cli.compare(after, after).component is None
    assert dvr_cli.compare(before, after, before, after).ranks == [3, 1, 3, 1]
    with pytest.raises(UsageError, match="two or more"):
        dvr_cli.compare(before)


def test_meshes_of_different_connectivity_cannot_be_compared():
    one = as_meshio(random_mesh("tetra", 1))
    cells = one.cells[0].data
    for points, other in (
        (one.points, [("tetra", cells[::-1])]),
        (one.points, [("tetra", cells[:10]), ("tetra", cells[10:])]),
        (np.vstack([one.points, [[2, 2, 2]]]), [("tetra", cells)]),
        (one.points, [("tetra", cells), ("vertex", np.array([[0]]))]),
    ):
        with pytest.raises(InputError, match="different cells"):
            dvr_cli.compare(one, meshio.Mesh(points, other))


def test_unknown_names_are_missing_as_in_any_module():
    with pytest.raises(AttributeError, match="no attribute 'untangled'"):
        _ = dvr_cli.untangled


# ------------------------------------------------------------------------------------------- the default


def phases(report):
    return [phase.phase for phase in report.phases]


def test_all_phases_are_run_unless_directions_are_prescribed():
    mesh = as_meshio(random_mesh("tetra", 1))
    compiled = ["patches"] if has_numba() else []
    _, report = dvr_cli.smooth(mesh)
    assert phases(report) == ["descent", "relax", *compiled, "polish"]
    assert report.options["directions"] == "steepest,random"
    assert phases(dvr_cli.smooth(mesh, polish=False, patches=False)[1]) == ["relax"]
    assert phases(dvr_cli.smooth(mesh, target=0.1)[1]) == ["relax"]
    assert phases(dvr_cli.smooth(mesh, floor=0.9)[1]) == ["relax", *compiled, "polish"]
    assert phases(dvr_cli.smooth(mesh, directions="x")[1]) == ["relax"]
    assert phases(dvr_cli.smooth(mesh, directions="x", patches=True, polish=True)[1]) == [
        "relax",
        "patches",
        "polish",
    ]
    assert phases(dvr_cli.smooth(mesh, preset="paper")[1]) == ["relax"]


def test_without_numba_patches_wait_to_be_asked_for(monkeypatch):
    monkeypatch.setattr("dvr_cli.api.options.has_numba", lambda: False)
    mesh = as_meshio(random_mesh("triangle", 1))
    assert phases(dvr_cli.smooth(mesh)[1]) == ["descent", "relax", "polish"]
    assert phases(dvr_cli.smooth(mesh, patches=True)[1]) == ["descent", "relax", "patches", "polish"]


@pytest.mark.parametrize("kind", KINDS)
def test_the_default_raises_q1_and_the_mean(kind):
    mesh = as_meshio(random_mesh(kind, 2))
    _, report = dvr_cli.smooth(mesh)
    assert report.after.q1 > report.before.q1
    assert report.after.mean > report.before.mean
    assert at_least(report.after.vector, report.before.vector)


def test_polishing_that_would_lower_the_quality_vector_is_undone():
    """Beside a flat fan that is as good as it gets, the rest of the mesh would pay for a better mean."""
    mesh = random_mesh("triangle", 3, n=6)
    triangles = mesh.cells[0].vertices
    best, _ = dvr_cli.smooth(mesh.points, {"triangle": triangles}, directions="random", patches=True)
    fan = np.array([[5, 0], [25, 0], [25, 1], [5, 1], [15, 0.5]])
    around = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]) + len(best)
    points, cells = np.concatenate([best, fan]), {"triangle": np.concatenate([triangles, around])}
    _, usual = dvr_cli.smooth(points, cells, shape="ideal")
    assert at_least(usual.after.vector, usual.before.vector)
    _, report = dvr_cli.smooth(points, cells, shape="ideal", floor=0.999)
    assert report.after.q1 == report.before.q1
    assert report.phases[-1].phase == "polish"
    assert report.phases[-1].stopped_because == "undone"
    assert not [sweep for sweep in report.sweeps if sweep["phase"] == "polish"]
    assert at_least(report.after.vector, report.before.vector)
    _, forced = dvr_cli.smooth(points, cells, shape="ideal", floor=0.999, polish=True)
    assert not at_least(forced.after.vector, forced.before.vector)
    assert forced.after.q1 >= forced.before.q1
    assert forced.after.mean > report.after.mean


@pytest.mark.parametrize("what", ["part.msh", [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], None])
def test_what_is_no_mesh_is_refused(what):
    with pytest.raises(UsageError, match=f"mesh: .* is needed, not a {type(what).__name__}"):
        dvr_cli.smooth(what, {"triangle": np.array([[0, 1, 2]])})


class Rounding:
    """A place that keeps coordinates in 32 bits until it is asked for more."""

    wide = False

    def stored(self, points):
        return points if self.wide else points.astype(np.float32).astype(float)

    def rounding(self, points):
        return float(np.abs(self.stored(points) - points).max())

    def widen(self):
        asked, self.wide = not self.wide, True
        return asked


def test_rounding_may_not_lower_the_worst_element_even_where_nothing_moves():
    fan = [[0, 0], [1, 0], [1, 1], [0, 1], [0.75, 0.75]]
    flat = [[1e4 + 0.0003, 0], [1e4 + 1, 0], [1e4 + 0.5, 0.01]]  # in 32 bits its base is longer
    cells = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [5, 6, 7]])
    mesh = Mesh(np.array(fan + flat, dtype=float), [Cells("triangle", cells)])
    storage = Rounding()
    _, report = smooth_mesh(mesh, SmoothOptions(engine="numpy", shape="ideal"), storage)
    assert storage.wide
    assert report.before.minimum == report.after.minimum < report.after.q1
