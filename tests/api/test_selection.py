"""Selection takes freedom away, and nothing else: vertices outside it keep their very bits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dvr_cli
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.selection import Selection
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.errors import InputError, UsageError
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.relax.stopping import Stopping
from meshes import KINDS, delaunay, random_mesh
from oracle import mean_ratio


def parts(n=60, seed=3):
    """Random triangles in two regions, left 1 and right 2, as cell data "region"."""
    mesh = delaunay(n, 2, seed)
    centre = mesh.points[mesh.cells[0].vertices].mean(axis=1)
    mesh.cell_data["region"] = [np.where(centre[:, 0] < 0.5, 1, 2)]
    return mesh


def moved(mesh, **options):
    """Which vertices move, and the report."""
    points, report = smooth_mesh(mesh, SmoothOptions(stopping=Stopping(max_iterations=5), **options))
    return (points.view(np.int64) != mesh.points.view(np.int64)).any(axis=1), report


def of_region(mesh, tag):
    inside = np.zeros(len(mesh.points), dtype=bool)
    inside[mesh.cells[0].vertices[mesh.cell_data["region"][0] == tag]] = True
    return inside


def test_without_criteria_all_that_may_move_do():
    mesh = parts()
    now, report = moved(mesh)
    interior = domain_of(mesh).interior
    assert not now[~interior].any()
    assert report.relaxed == interior.sum() == len(report.after.vector)


@pytest.mark.parametrize("tag", [1, 2])
def test_only_and_fix_of_a_region(tag):
    """The vertices of both regions lie on the interface, which stays anyway."""
    mesh = parts()
    interior = domain_of(mesh).interior
    inside = of_region(mesh, tag)
    only, report = moved(mesh, only=str(tag))
    assert report.relaxed == (interior & inside).sum()
    assert only.any()
    assert not only[~inside].any()
    fixed, report = moved(mesh, fix=[str(tag)])
    assert report.relaxed == (interior & ~inside).sum()
    assert fixed.any()
    assert not fixed[inside].any()
    assert np.array_equal(only | fixed, moved(mesh)[0])  # regions do not touch but where nothing moves


def test_names_add_up_and_criteria_intersect():
    mesh = parts()
    domain = domain_of(mesh)
    left, right = of_region(mesh, 1), of_region(mesh, 2)
    some = np.arange(0, len(mesh.points), 2)
    masks = Selection(fix=("1", "2"), only=("2", "1"), vertices=some).masks(mesh, domain)
    assert np.array_equal(masks["--only"], left | right)
    assert np.array_equal(masks["--fix"], ~(left | right))
    assert np.flatnonzero(masks["--vertices"]).tolist() == some.tolist()
    _, report = moved(mesh, only="1", vertices=some)
    assert report.relaxed == (domain.interior & left)[some].sum()
    _, report = moved(mesh, only="1", fix="1")
    assert (report.relaxed, report.stopped_because) == (0, "nothing-to-relax")


def neighbours(cells, inside):
    """The vertices of cells that have one in the set ``inside``."""
    return inside | {v for cell in cells for v in cell if inside & set(cell)}


@pytest.mark.parametrize("layers", [0, 1, 2, 99])
@pytest.mark.parametrize("kind", KINDS)
def test_below_chooses_bad_elements_and_rings_of_neighbours(kind, layers):
    mesh = random_mesh(kind, 5)
    domain = domain_of(mesh)
    report = dvr_cli.quality_report(mesh.points, [(b.type, b.vertices) for b in mesh.cells])
    limit = float(np.quantile(report.quality.elements, 0.05)) + 1e-9
    cells = [cell.tolist() for block in mesh.cells for cell in block.vertices]
    expected = {v for cell, q in zip(cells, report.quality.elements, strict=True) if q < limit for v in cell}
    for _ in range(min(layers, 10)):
        expected = neighbours(cells, expected)
    mask = Selection(below=limit, layers=layers).masks(mesh, domain)["--below"]
    assert set(np.flatnonzero(mask).tolist()) == expected


def test_below_looks_at_the_input():
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.1], [0.5, 0.6]])
    cells = np.array([[0, 1, 4], [1, 5, 4], [5, 0, 4], [1, 2, 5], [2, 3, 5], [3, 0, 5]])
    qualities = [mean_ratio(points[cell]) for cell in cells]
    limit = 0.5
    expected = {v for cell, q in zip(cells.tolist(), qualities, strict=True) if q < limit for v in cell}
    mesh = Mesh(points, [Cells("triangle", cells)])
    mask = Selection(below=limit).masks(mesh, domain_of(mesh))["--below"]
    assert set(np.flatnonzero(mask).tolist()) == expected
    assert 0 < len(expected) < 6
    now, _ = moved(mesh, below=limit)
    assert now.tolist() == [v in expected and v in (4, 5) for v in range(6)]
    assert moved(mesh, below=-1.0)[1].relaxed == 0


@settings(max_examples=15, deadline=None)
@given(
    kind=st.sampled_from(KINDS),
    seed=st.integers(0, 20),
    share=st.floats(0, 1),
    below=st.one_of(st.none(), st.floats(0, 1)),
    layers=st.integers(0, 3),
)
def test_vertices_outside_keep_their_bits_and_nothing_gets_worse(kind, seed, share, below, layers):
    mesh = random_mesh(kind, seed)
    n = len(mesh.points)
    chosen = np.flatnonzero(np.random.default_rng(seed).random(n) < share)
    now, report = moved(mesh, vertices=chosen, below=below, layers=layers if below is not None else 0)
    allowed = np.isin(np.arange(n), chosen) & domain_of(mesh).interior
    assert not now[~allowed].any()
    assert set(report.after.vertices.tolist()) <= set(np.flatnonzero(allowed).tolist())
    assert sorted(report.after.vertices) == sorted(report.before.vertices)
    if report.relaxed:
        assert report.after.q1 >= report.before.q1
    assert report.after.minimum >= report.before.minimum


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"below": 2.0}, "below"),
        ({"below": float("nan")}, "below"),
        ({"layers": 1}, "layers"),
        ({"below": 0.5, "layers": -1}, "layers"),
        ({"vertices": [0.5]}, "vertices: 0.5"),
        ({"vertices": [float("nan")]}, "vertices: nan"),
        ({"vertices": ["a"]}, "vertices"),
        ({"vertices": [True]}, "vertices"),
        ({"vertices": [-1]}, "no vertex -1"),
        ({"vertices": [3, 60]}, "no vertex 60.* 60,"),
        ({"only": "3"}, "only: .*'3'.*region 1, 2"),
        ({"fix": ["1", "x"]}, "fix: .*'x'.*region 1, 2"),
    ],
)
def test_wrong_options(options, message):
    mesh = parts()
    with pytest.raises(UsageError, match=message):
        smooth_mesh(mesh, SmoothOptions(**options))


@pytest.mark.parametrize("suffix", [".txt", ".csv", ".npy"])
def test_vertices_from_files(tmp_path, suffix):
    mesh = parts()
    wanted = np.flatnonzero(domain_of(mesh).interior)[[3, 1, 4, 1]]
    path = tmp_path / f"v{suffix}"
    if suffix == ".npy":
        np.save(path, wanted)
    else:
        path.write_text((" " if suffix == ".txt" else ",").join(map(str, wanted)) + "\n")
    for given_as in (path, str(path), wanted, wanted.tolist(), wanted.astype(float)):
        now, report = moved(mesh, vertices=given_as)
        assert now[wanted].all()
        assert now.sum() == report.relaxed == 3
    record = SmoothOptions(vertices=path).record()
    assert record["vertices"] == str(path)


def test_an_empty_list_of_vertices_leaves_nothing():
    assert moved(parts(), vertices=[])[1].relaxed == 0


@pytest.mark.parametrize(
    ("name", "text", "error"),
    [
        ("v.dat", "1", UsageError),
        ("v.txt", "one", UsageError),
        ("v.txt", "1.5", UsageError),
        ("v.csv", "", UsageError),
        ("v.npy", "1", UsageError),
        ("none.txt", None, InputError),
    ],
)
def test_files_without_vertices(tmp_path, name, text, error):
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(error, match=f"^vertices .*{name}: "):
        SmoothOptions(vertices=path)


def test_periodic_vertices_stay_and_the_rest_moves():
    """Interior vertices that links tie together: moving one without the other would part them."""
    mesh = parts()
    interior = np.flatnonzero(domain_of(mesh).interior)
    mesh.periodic = interior[:4].reshape(2, 2)
    now, report = moved(mesh)
    assert not now[interior[:4]].any()
    assert report.relaxed == len(interior) - 4
    assert now[interior[4:]].any()
