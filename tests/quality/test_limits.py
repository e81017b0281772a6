"""What limits a mesh: meshes made so that the reason is known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.boundary.constraints import constraints_of
from dvr_cli.boundary.features import features_of
from dvr_cli.files.reading import open_mesh
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.limits import HeldBy, limit_of
from dvr_cli.quality.measure import measure
from dvr_cli.relax.stopping import Stopping
from dvr_cli.report.export import as_json
from dvr_cli.report.text.summary import smooth_text
from meshes import grid
from oracle import mean_ratio

SAMPLES = Path(__file__).parents[2] / "sample_meshes"
MANY = Stopping(max_iterations=200, tol=1e-9, patience=5)


def limit(mesh, **options):
    """What a run says, and the quality it reached; what it says is also in the JSON and the summary."""
    _, report = smooth_mesh(mesh, SmoothOptions(stopping=options.pop("stopping", MANY), **options))
    found = report.limited_by
    record = json.loads(as_json(report.record()))["limited_by"]
    lines = smooth_text(report, "in", "out").split("\n")
    said = [line for line in lines if line.startswith(("not touched", "limited", "advice"))]
    assert max(len(line) for line in lines if not line.startswith("not touched")) <= 80
    if found is None:
        assert record is None
        assert not said
        return None, report
    assert set(record) == {"kind", "vertex", "element", "text", "advice", "keeps"}
    assert (record["kind"], record["vertex"], record["text"]) == (found.kind, found.vertex, found.text)
    assert record["element"] == report.record()["after"]["worst"][0]
    if report.after.q1 is None or report.after.minimum < report.after.q1:
        assert said == lines[:1]
        assert f"{found.text}; {found.advice}" in lines[0]
        assert lines[0].endswith(found.keeps)
    else:
        assert said == [f"limited: {found.text}", f"advice: {found.advice}"]
    return found, report


def wheel(n):
    """n triangles around vertex 0, off the centre, in a regular polygon."""
    turns = 2 * np.pi * np.arange(n) / n
    rim = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    ring = np.arange(n)
    return Mesh(
        np.vstack([[0.1, 0.05], rim]),
        [Cells("triangle", np.stack([0 * ring, 1 + ring, 1 + (ring + 1) % n], 1))],
    )


@pytest.mark.parametrize("n", [3, 4, 8, 11, 16])
def test_valence_in_the_plane(n):
    """In a regular polygon the centre is best, and every triangle has the nth part of the angle."""
    found, report = limit(wheel(n))
    share = 2 * np.pi / n
    best = np.sqrt(3) * np.sin(share) / (2 - np.cos(share))
    assert report.after.q1 == pytest.approx(best, rel=1e-3)
    assert (found.kind, found.vertex) == ("valence", 0)
    assert found.text == f"{n} elements meet at vertex 0, which allows {best:.4f} at best"


def test_balance():
    """A regular polygon again: its corners cannot move, and 7 triangles could be as good as 0.98."""
    found, report = limit(wheel(7))
    assert report.stopped_because == "converged"
    assert (found.kind, found.vertex) == ("balance", None)


def test_nothing_is_said_where_there_is_nothing_to_gain():
    """Six equilateral triangles are perfect; a square cut in four at its middle is as good as it can be."""
    found, report = limit(wheel(6))
    assert report.after.q1 == pytest.approx(1.0)
    assert found is None
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
    quarters = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    mesh = Mesh(square, [Cells("triangle", quarters)])
    points, report = smooth_mesh(mesh, SmoothOptions(stopping=MANY))
    assert np.array_equal(points, square)
    assert report.after.q1 == pytest.approx(np.sqrt(3) / 2)
    assert report.limited_by is None


def test_valence_in_space():
    """An octahedron: by symmetry the eight tetrahedra around its centre are best when it is in the middle."""
    axes = np.eye(3)
    cells = np.array([[0, x, y, z] for x in (1, 4) for y in (2, 5) for z in (3, 6)])
    mesh = Mesh(np.array([[0.1, -0.2, 0.15], *axes, *-axes]), [Cells("tetra", cells)])
    found, report = limit(mesh)
    best = float(mean_ratio(np.array([[0, 0, 0], *axes])))
    assert report.after.q1 == pytest.approx(best, rel=1e-3)
    assert found.text == f"8 elements meet at vertex 0, which allows {best:.4f} at best"
    assert (found.kind, found.vertex) == ("valence", 0)


def test_many_tetrahedra_around_an_edge():
    """A bipyramid of 14 tetrahedra around its axis, of the best shape; its tip counts as relaxed."""
    n = 14
    turns = 2 * np.pi * np.arange(n) / n
    half = np.sqrt(1 + np.sin(np.pi / n) ** 2) / 2
    rim = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    ring = np.arange(n)
    cells = np.stack([0 * ring, 0 * ring + 1, 2 + ring, 2 + (ring + 1) % n], axis=1)
    mesh = Mesh(np.vstack([[[0, 0, -half], [0, 0, half]], rim]), [Cells("tetra", cells)])
    domain = domain_of(mesh)
    quality = measure(domain, mesh.points, np.array([1]))
    found = limit_of(domain, mesh.points, np.array([1]), quality, HeldBy({}, {}))
    assert (found.kind, found.vertex) == ("valence", 0)
    assert found.text == f"14 elements meet at edge 0-1, which allows {quality.q1:.4f} at best"


def strip(inner=(1.5, 0.5)):
    """A rectangle of 1 by 3 with one vertex inside and boundary vertices along its long sides."""
    points = np.array([[0, 0], [1.9, 0], [3, 0], [3, 1], [1.1, 1], [0, 1], inner], dtype=float)
    rim = np.arange(6)
    return Mesh(points, [Cells("triangle", np.stack([rim, (rim + 1) % 6, 0 * rim + 6], axis=1))])


def test_boundary_vertices_that_slide_would_free():
    """The triangles at the ends hold the inner vertex off; 1 and 4 are the only ones on straight edges."""
    found, report = limit(strip())
    assert report.after.minimum == report.after.q1
    assert (found.kind, found.advice) == ("boundary", "--boundary slide would free 1 of them")
    assert found.vertex in (1, 4)
    assert found.text.endswith("has 2 of its 3 vertices on the boundary")
    slid, _ = limit(strip(), boundary="slide")
    assert slid.kind != "boundary"


def test_corners_of_the_domain_cannot_be_freed():
    """The triangle at the corner has all its vertices there or on edges that turn: no option frees them."""
    points = np.array([[0, 0], [1, 0], [1.2, 1.2], [0, 1], [0.6, 0.6], [-0.5, -0.02], [0.5, -0.4]])
    cells = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [5, 6, 0], [6, 1, 0]])
    found, report = limit(Mesh(points, [Cells("triangle", cells)]))
    assert report.after.minimum == report.after.fixed_cap < report.after.q1
    assert (found.kind, found.vertex, found.element.cell) == ("fixed-cap", None, 4)
    assert found.text == "none of the 3 vertices of triangle 4 can move"


def test_a_fixed_cap_that_slide_would_free():
    """A flat triangle cuts the corner 2 off; its other vertices lie on the straight edges there."""
    points = np.array([[0, 0], [0.95, 0], [1, 0], [1, 0.3], [1, 1], [0, 1], [0.4, 0.4]])
    cells = np.array([[0, 1, 6], [1, 3, 6], [1, 2, 3], [3, 4, 6], [4, 5, 6], [5, 0, 6]])
    found, report = limit(Mesh(points, [Cells("triangle", cells)]))
    assert report.after.fixed_cap == report.after.minimum < report.after.q1
    assert (found.kind, found.element.cell) == ("boundary", 2)
    assert found.text == "triangle 2 has 3 of its 3 vertices on the boundary"
    assert found.advice == "--boundary slide would free 2 of them"
    assert found.keeps == "planes, straight edges, regions and groups keep their shape"


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"fix": "2"}, "--fix"),
        ({"only": "1"}, "--only"),
        ({"below": -1.0}, "--below"),
        ({"vertices": [1]}, "--vertices"),
    ],
)
def test_selection(options, name):
    mesh = wheel(8)
    mesh.cell_data["region"] = [np.full(8, 2)]
    mesh.point_sets["1"] = np.array([3])
    found, report = limit(mesh, **options)
    assert report.stopped_because == "nothing-to-relax"
    assert (found.kind, found.vertex) == ("selection", 0)
    assert found.text.startswith(f"{name} keeps 1 of the 3 vertices of triangle ")
    assert found.advice == "let vertex 0 move, too"
    assert "the selection leaves no vertex that could move" in smooth_text(report, "in", "out")


def test_vertices_that_the_selection_keeps_are_not_freed_by_sliding():
    found, _ = limit(strip(), vertices=[6])
    assert found.kind in ("fixed-cap", "balance")


def test_quadrilaterals_count_by_their_corner():
    """The lower left corner of the grid is the worst of its cell: two of its three vertices can slide."""
    points, boxes = grid(3, 2)
    points[np.isclose(points, [1 / 3, 0]).all(axis=1)] = [0.05, 0]
    found, _ = limit(Mesh(points, [Cells("quad", boxes)]))
    assert found.element.cell_type == "quad"
    assert found.kind == "boundary"
    assert found.text.startswith("a corner of quad 0 has 3 of its 3 vertices on")


def test_nothing_is_said_before_q1_has_stopped_growing():
    found, report = limit(wheel(8), directions="random", stopping=Stopping(max_iterations=1))
    assert report.stopped_because == "max-iterations"
    assert found is None
    assert limit(wheel(8), stopping=Stopping(target=0.1))[0] is None


def test_inverted_elements():
    """The inner vertex is outside the square, and can only move along a line on which that stays so."""
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2.0, 0.5]])
    cells = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    mesh = Mesh(points, [Cells("triangle", cells)])
    found, report = limit(mesh, directions="y")
    assert report.after.inverted == 1
    assert (found.kind, found.advice) == ("tangled", "--untangle makes positive what it can")
    assert "is not positive" in found.text
    found, report = limit(mesh, directions="y", untangle=True)
    assert report.after.inverted == 0
    assert found is None or found.kind != "tangled"


@pytest.mark.parametrize("name", ["two_materials.msh", "plate_quads.msh", "mixed_solid.vtu", "panel.obj"])
def test_looking_around_some_vertices_tells_what_they_may_do(name):
    """The advice asks only the elements around the worst one what sliding would free."""
    mesh = open_mesh(SAMPLES / name).mesh
    domain = domain_of(mesh)

    def dimension(part):
        return features_of(part.points, part.interior, constraints_of(mesh, part)).freedom.dimension

    everywhere = dimension(domain)
    assert (everywhere[~domain.interior] > 0).any()
    for vertices in np.random.default_rng(1).choice(np.flatnonzero(~domain.interior), (20, 4)):
        assert np.array_equal(dimension(domain.around(vertices))[vertices], everywhere[vertices])
