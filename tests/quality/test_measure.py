"""The quality report as data, against plain computing with the oracle, and its JSON and CSV."""

import json
import math

import numpy as np
import pytest

import dvr_cli
import oracle
from dvr_cli.api.measuring import mesh_quality
from dvr_cli.errors import InputError, UsageError
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.angles import extreme_angles
from dvr_cli.quality.measure import HISTOGRAM_BINS, measure
from dvr_cli.report.compare import compare_qualities
from dvr_cli.report.export import as_csv, as_json
from meshes import KINDS, grid, random_mesh


def with_lower_cells(mesh):
    """The mesh with cells of lower dimension before, between and after its own, all on its boundary."""
    d = mesh.points.shape[1]
    outside = np.flatnonzero(~domain_of(mesh).interior)
    lower = Cells("vertex", outside[:3, None]), Cells("line", outside[[0, 1]][None])
    blocks = [lower[0], *(block for own in mesh.cells for block in (own, lower[1])), lower[0]]
    return Mesh(mesh.points.reshape(-1, d), blocks)


def elements_of(mesh):
    """Id, type and vertices of each cell of the highest dimension, counted through all blocks."""
    through = [(block.type, vertices) for block in mesh.cells for vertices in block.vertices]
    return [(i, name, vertices) for i, (name, vertices) in enumerate(through) if name in oracle.IDEAL]


def corners_of_elements(mesh):
    """Vertices and quality of each corner."""
    return [
        (vertices[local], float(oracle.mean_ratio(mesh.points[vertices[local]], target)))
        for _, name, vertices in elements_of(mesh)
        for local, target in oracle.corners(name)
    ]


def spoilt(kind, seed=3):
    """A mesh with inverted and degenerate cells too, and with a part of its interior vertices relaxed."""
    mesh = with_lower_cells(random_mesh(kind, seed, noise=0.2))
    relaxed = np.flatnonzero(domain_of(mesh).interior)
    _, _, last = elements_of(mesh)[-1]
    mesh.points[last] = mesh.points[last].mean(axis=0)  # a cell without extent, flat ones beside it
    rng = np.random.default_rng(seed)
    mesh.points[relaxed[0]] += 1.5 * rng.normal(size=mesh.points.shape[1])
    return mesh, rng.permutation(relaxed)[: max(1, len(relaxed) // 2)]


def close(expected):
    """Equal but for rounding, which of a flat tetrahedron's volume, 1e-17, makes 5e-12 of quality."""
    return pytest.approx(expected, rel=1e-9, abs=5e-11)


# --------------------------------------------------------------------------------------------- the figures


@pytest.mark.parametrize("worst", [0, 1, 10, 10**6])
@pytest.mark.parametrize("kind", KINDS)
def test_figures_are_those_of_plain_computing(kind, worst):
    mesh, relaxed = spoilt(kind)
    domain = domain_of(mesh)
    quality = measure(domain, mesh.points, relaxed, worst)
    elements = elements_of(mesh)
    expected = np.array([oracle.element_quality(name, mesh.points[v]) for _, name, v in elements])
    corners = corners_of_elements(mesh)
    touched = [q for v, q in corners if not set(relaxed).isdisjoint(v)]
    untouched = [q for v, q in corners if set(relaxed).isdisjoint(v)]

    assert quality.elements == close(expected)
    assert quality.q1 == close(min(touched))
    assert quality.fixed_cap == close(min(untouched))
    assert quality.minimum == min(quality.q1, quality.fixed_cap)
    (at_q1,) = (i for i, (number, _, _) in enumerate(elements) if number == quality.q1_element.cell)
    of_q1 = corners_of_elements(Mesh(mesh.points, [Cells(elements[at_q1][1], elements[at_q1][2][None])]))
    assert min(q for v, q in of_q1 if not set(relaxed).isdisjoint(v)) == close(quality.q1)
    assert quality.q1_element.quality == quality.elements[at_q1]
    assert quality.mean == close(expected.mean())
    assert {q: close(np.quantile(expected, q)) for q in (0.01, 0.1, 0.5)} == quality.quantiles
    assert quality.inverted == (expected < -1e-10).sum() > 0
    assert quality.degenerate == (np.abs(expected) <= 1e-10).sum() > 0
    angles = quality.measures["min_angle"], quality.measures["max_angle"]
    assert angles == extreme_angles(mesh.points, domain.cells)

    bins = [min(max(0, math.floor(q * HISTOGRAM_BINS)), HISTOGRAM_BINS - 1) for q in quality.elements]
    assert quality.histogram.tolist() == [bins.count(b) for b in range(HISTOGRAM_BINS)]
    assert quality.histogram.sum() == len(elements)

    minima = {v: min(q for corner, q in corners if v in corner) for v in relaxed.tolist()}
    assert sorted(quality.vertices.tolist()) == sorted(minima)
    assert quality.vector == close(np.array([minima[v] for v in quality.vertices.tolist()]))
    assert (np.diff(quality.vector) >= 0).all()
    assert quality.vector[0] == quality.q1

    own = quality.elements.tolist()
    order = sorted(range(len(own)), key=lambda i: (own[i], elements[i][0]))[:worst]
    assert [w.cell for w in quality.worst] == [elements[i][0] for i in order]
    assert [w.cell_type for w in quality.worst] == [elements[i][1] for i in order]
    assert [w.quality for w in quality.worst] == [own[i] for i in order]
    for w, i in zip(quality.worst, order, strict=True):
        assert w.centroid == close(mesh.points[elements[i][2]].mean(axis=0).tolist())


@pytest.mark.parametrize("kind", KINDS)
def test_all_interior_vertices_are_relaxed_in_a_report(kind):
    mesh = random_mesh(kind, 1)
    report = mesh_quality(mesh)
    interior = np.flatnonzero(domain_of(mesh).interior)
    assert report.relaxed == len(interior)
    assert sorted(report.quality.vertices.tolist()) == interior.tolist()


def test_equal_qualities_are_listed_by_id():
    points, boxes = grid(4, 2)
    quality = mesh_quality(Mesh(points, [Cells("quad", boxes)]), worst=7).quality
    assert [w.cell for w in quality.worst] == list(range(7))
    assert {w.quality for w in quality.worst} == {1.0}
    assert quality.vertices.tolist() == sorted(quality.vertices.tolist())


def test_ideal_elements_are_in_the_last_bin_and_inverted_ones_in_the_first():
    points, boxes = grid(4, 2)
    quality = mesh_quality(Mesh(points, [Cells("quad", boxes)])).quality
    assert quality.histogram.tolist() == [0] * 19 + [16]
    points[6] += 0.6  # one of its four quads becomes a kite
    quality = mesh_quality(Mesh(points, [Cells("quad", boxes)])).quality
    assert quality.inverted == quality.histogram[0] == 3


def test_mesh_without_relaxed_vertices_has_no_q1_but_a_fixed_cap():
    quality = mesh_quality(
        Mesh(np.array(oracle.IDEAL["tetra"]), [Cells("tetra", np.arange(4)[None])])
    ).quality
    assert quality.q1 is None
    assert quality.q1_element is None
    assert quality.fixed_cap == quality.minimum == pytest.approx(1)
    assert len(quality.vector) == 0


def test_mesh_whose_corners_all_have_a_relaxed_vertex_has_no_fixed_cap():
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.8, 0.9]])
    triangles = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    quality = mesh_quality(Mesh(points, [Cells("triangle", triangles)])).quality
    assert quality.fixed_cap is None
    assert quality.q1 == quality.minimum


def test_centroids_are_in_the_coordinates_of_the_file():
    mesh = random_mesh("triangle", 1)
    in_space = Mesh(np.column_stack([np.full(len(mesh.points), 7.0), mesh.points]), mesh.cells)
    for flat, lifted in zip(
        mesh_quality(mesh).quality.worst, mesh_quality(in_space).quality.worst, strict=True
    ):
        assert lifted.centroid == [7.0, *flat.centroid]


def test_cells_stored_inside_out_are_counted_and_otherwise_as_good():
    mesh = random_mesh("tetra", 1)
    turned = [Cells("tetra", mesh.cells[0].vertices[:, oracle.MIRRORED["tetra"]])]
    report = mesh_quality(Mesh(mesh.points, turned))
    assert report.mesh.mirrored == len(turned[0].vertices)
    assert report.quality.elements == close(mesh_quality(mesh).quality.elements)
    assert report.quality.inverted == 0


def test_the_mesh_itself_is_summarised():
    mesh = random_mesh("mixed3d", 1)
    first, *others = mesh.cells
    half = len(first.vertices) // 2
    blocks = [Cells(first.type, first.vertices[:half]), Cells("triangle", np.array([[0, 1, 5]])), *others]
    blocks.append(Cells(first.type, first.vertices[half:]))
    tags = [np.full(len(block.vertices), tag) for tag, block in enumerate(blocks)]
    summary = mesh_quality(Mesh(mesh.points, blocks, {"region": tags})).mesh
    assert summary.points == len(mesh.points)
    assert summary.cells == {"triangle": 1} | {block.type: len(block.vertices) for block in mesh.cells}
    assert (summary.dimension, summary.mirrored, summary.regions) == (3, 0, 4)


# -------------------------------------------------------------------------------------------- JSON and CSV

QUALITY_KEYS = {"q1", "fixed_cap", "min", "mean", "quantiles", "inverted", "degenerate", "worst"}


def valid(record):
    """The record after a passage through strict JSON, as the package writes it and as Python does."""
    through = json.loads(json.dumps(record, allow_nan=False))
    assert json.loads(as_json(record)) == through
    return through


@pytest.mark.parametrize("vector", [[], [0.5], [0.1, 0.1, 0.25, 0.25, 1e-300], [-0.0, 0.0], [1.0, 2]])
def test_vectors_are_written_as_python_does(vector):
    assert as_json({"quality_vector": vector}) == '{\n  "quality_vector": ' + json.dumps(vector) + "\n}"


def test_a_vector_with_what_json_lacks_is_refused():
    with pytest.raises(ValueError, match="JSON"):
        as_json({"quality_vector": [0.5, float("nan")]})


@pytest.mark.parametrize("kind", KINDS)
def test_quality_record_has_the_promised_keys(kind):
    mesh, _ = spoilt(kind)
    report = mesh_quality(mesh)
    record = valid(report.record("some/path.vtk"))
    assert record["schema"] == "dvr.quality/1"
    assert record["dvr_version"] == dvr_cli.__version__
    assert record["mesh"]["path"] == "some/path.vtk"
    assert record["mesh"]["points"] == len(mesh.points)
    assert sum(record["mesh"]["cells"].values()) == sum(len(block.vertices) for block in mesh.cells)
    assert record["mesh"]["dimension"] == mesh.points.shape[1]
    assert record["relaxed"] == len(record["quality_vector"]) == report.relaxed
    assert record["quality_vector"] == report.quality.vector.tolist()
    assert record["quality"].keys() >= QUALITY_KEYS
    assert record["quality"]["quantiles"].keys() == {"0.01", "0.1", "0.5"}
    assert record["quality"]["q1"] == report.quality.q1
    assert record["quality"]["min"] == report.quality.minimum
    worst = record["quality"]["worst"]
    assert len(worst) == min(10, len(report.quality.elements))
    assert all(w.keys() == {"cell_type", "cell", "quality", "centroid"} for w in worst)
    assert record["units"]


def test_smooth_record_has_the_promised_keys():
    mesh = random_mesh("tetra", 1)
    _, report = dvr_cli.smooth(
        mesh.points, {"tetra": mesh.cells[0].vertices}, directions="random", seed=7, max_iterations=4, tol=0
    )
    record = valid(report.record())
    assert record["schema"] == "dvr.smooth/1"
    assert record["before"].keys() == record["after"].keys() >= QUALITY_KEYS
    assert record["quality"] == record["after"]
    assert record["after"]["q1"] > record["before"]["q1"]
    assert [sweep["sweep"] for sweep in record["sweeps"]] == [1, 2, 3, 4]
    keys = {"sweep", "phase", "q1", "moved", "seconds", "mean", "below"}
    assert all(sweep.keys() == keys for sweep in record["sweeps"])
    assert record["stopped_because"] == "max-iterations"
    assert record["seed"] == record["options"]["seed"] == 7
    assert record["options"]["max_iterations"] == 4
    assert record["quality_vector"] == report.after.vector.tolist()
    assert record.keys() >= {"engine", "threads", "relaxed", "mesh", "dvr_version"}


@pytest.mark.parametrize("cell_type", oracle.IDEAL)
def test_records_of_the_poorest_meshes_are_valid(cell_type):
    """One cell: ideal, flat, or without any extent; nothing to relax, no angle to measure."""
    for shape in (1.0, [1.0, 0.0, 1.0][: len(oracle.IDEAL[cell_type][0])], 0.0):
        points = np.array(oracle.IDEAL[cell_type]) * shape
        cells = {cell_type: np.arange(len(points))[None]}
        record = valid(dvr_cli.quality_report(points, cells).record())
        assert record["quality"]["q1"] is None
        points, report = dvr_cli.smooth(points, cells)
        assert valid(report.record())["stopped_because"] == "nothing-to-relax"


@pytest.mark.parametrize(
    "options",
    [
        *({name: np.int64(2)} for name in ("seed", "max_iterations", "patience")),
        {"directions": np.ones((30, 2)), "center": np.zeros(2), "axis": np.ones(3)},
        {"directions": ["x", np.ones((3, 30, 2))], "center": (0, 1)},
    ],
)
def test_whatever_options_are_accepted_can_be_recorded(options):
    mesh = random_mesh("triangle", 1)
    assert len(mesh.points) == 30
    options = {"max_iterations": 3} | options
    _, report = dvr_cli.smooth(mesh.points, {"triangle": mesh.cells[0].vertices}, **options)
    assert valid(report.record())["options"].keys() >= options.keys()


@pytest.mark.parametrize("name", ["tol", "target", "time_limit"])
@pytest.mark.parametrize("value", [math.inf, math.nan])
def test_what_cannot_be_recorded_is_refused(name, value):
    """JSON knows no infinity."""
    mesh = random_mesh("triangle", 1)
    with pytest.raises(UsageError, match=name.replace("_", "-")):
        dvr_cli.smooth(mesh.points, {"triangle": mesh.cells[0].vertices}, **{name: value})


def test_csv_is_the_quality_vector_to_the_last_bit():
    quality = mesh_quality(random_mesh("tetra", 1)).quality
    header, *rows = as_csv(quality).splitlines()
    assert header == "rank,vertex,quality"
    table = [row.split(",") for row in rows]
    assert [int(rank) for rank, _, _ in table] == list(range(1, len(quality.vector) + 1))
    assert [int(vertex) for _, vertex, _ in table] == quality.vertices.tolist()
    assert [float(value) for _, _, value in table] == quality.vector.tolist()


# --------------------------------------------------------------------------------------------- comparing


def test_comparison_names_the_better_and_the_first_component_that_differs():
    mesh = random_mesh("tetra", 1)
    points, _ = dvr_cli.smooth(mesh.points, {"tetra": mesh.cells[0].vertices}, max_iterations=2)
    before, after = mesh_quality(mesh), mesh_quality(Mesh(points, mesh.cells))
    for one, other, better in ((before, after, "after"), (after, before, "before"), (after, after, "equal")):
        comparison = compare_qualities([one, other], same_connectivity=True)
        assert comparison.better == better
        assert comparison.component == (None if better == "equal" else 1)
        record = valid(comparison.record(["a.msh", "b.msh"]))
        assert record["schema"] == "dvr.compare/1"
        assert (record["better"], record["first_difference"]) == (better, comparison.component)
        assert [mesh["mesh"]["path"] for mesh in record["meshes"]] == ["a.msh", "b.msh"]
        assert [mesh["rank"] for mesh in record["meshes"]] == {
            "after": [2, 1],
            "before": [1, 2],
            "equal": [1, 1],
        }[better]


def test_comparison_beyond_the_first_component():
    """A vertex far from the worst element moved: the vectors agree up to its rank."""
    mesh = random_mesh("triangle", 1, n=8)
    before = mesh_quality(mesh)
    vertex = before.quality.vertices[-1]
    points = mesh.points.copy()
    points[vertex] += 1e-9
    after = mesh_quality(Mesh(points, mesh.cells))
    comparison = compare_qualities([before, after], same_connectivity=True)
    u, w = before.quality.vector, after.quality.vector
    first = next(i for i in range(len(u)) if u[i] != w[i])
    assert first > 0
    assert comparison.component == first + 1
    assert comparison.better == ("after" if w[first] > u[first] else "before")


def test_meshes_of_different_connectivity_or_relaxed_vertices_cannot_be_compared():
    one = mesh_quality(random_mesh("triangle", 1))
    with pytest.raises(InputError, match="different cells"):
        compare_qualities([one, one], same_connectivity=False)
    other = mesh_quality(random_mesh("triangle", 1, n=4))
    with pytest.raises(InputError, match="different cells"):
        compare_qualities([one, other], same_connectivity=True)
