"""The records of cell types, and that one more is all that a new type takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dvr_cli.api.measuring import mesh_quality
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES, CellType, topological_dimension
from dvr_cli.mesh.corners import SHAPES
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.relax.engines.choice import has_numba
from dvr_cli.relax.stopping import Stopping
from meshes import random_mesh

ENGINES = ["numpy", *(["numba"] if has_numba() else [])]
# By new type: the known one of the same shape, and the node of that one that each of its own nodes is.
TOYS = {
    "rowwise2": ("quad", (0, 1, 3, 2)),
    "rowwise3": ("hexahedron", (0, 1, 3, 2, 4, 5, 7, 6)),
    "topfirst": ("wedge", (3, 4, 5, 0, 1, 2)),
}


def renumbered(name: str) -> CellType:
    """The record of one of TOYS."""
    known, order = TOYS[name]
    record = CELL_TYPES[known]
    own = {node: i for i, node in enumerate(order)}

    def mapped(rows):
        return tuple(tuple(own[i] for i in row) for row in rows)

    return replace(
        record,
        name=name,
        corners=mapped(record.corners),
        mirror=tuple(own[record.mirror[node]] for node in order),
        facets=mapped(record.facets),
        edges=mapped(record.edges),
    )


def test_facets_of_planar_types_follow_each_other():
    for record in CELL_TYPES.values():
        if record.dimension == 2 and record.facets:
            assert [facet[1] for facet in record.facets] == [*record.outline[1:], record.outline[0]]


def test_edges_are_those_of_the_facets():
    for record in CELL_TYPES.values():
        if record.dimension == 3 and record.facets:
            edges = {
                frozenset(pair)
                for facet in record.facets
                for pair in zip(facet, facet[1:] + facet[:1], strict=True)
            }
            assert {frozenset(edge) for edge in record.edges} == edges
            assert len(record.edges) == len(edges)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("name", TOYS)
def test_a_type_with_other_node_numbers_is_relaxed_and_reported_alike(name, mirrored, engine, monkeypatch):
    """Corners, orientation, interior, angles and the treatment of the boundary come from the record alone."""
    monkeypatch.setitem(CELL_TYPES, name, renumbered(name))
    known, order = TOYS[name]
    mesh = random_mesh(known, 3)
    cells = mesh.cells[0].vertices
    if mirrored:
        cells = cells[:, CELL_TYPES[known].mirror]
    options = SmoothOptions(
        directions="steepest,random", boundary="slide", stopping=Stopping(max_iterations=4), engine=engine
    )
    expected, before = smooth_mesh(Mesh(mesh.points, [Cells(known, cells)]), options)
    other = Mesh(mesh.points, [Cells(name, cells[:, order])])
    points, report = smooth_mesh(other, options)
    assert points.tobytes() == expected.tobytes()
    assert not np.array_equal(points, mesh.points)
    ours, theirs = report.after, before.after
    assert (ours.q1, ours.mean, ours.minimum) == (theirs.q1, theirs.mean, theirs.minimum)
    assert ours.measures == pytest.approx(theirs.measures)
    assert ours.worst[0].cell_type == name


def test_a_planar_type_may_lie_on_a_surface(monkeypatch):
    monkeypatch.setitem(CELL_TYPES, "rowwise2", renumbered("rowwise2"))
    flat = random_mesh("quad", 3)
    points = np.column_stack([flat.points, 0.1 * np.square(flat.points).sum(axis=1)])
    cells = flat.cells[0].vertices
    options = SmoothOptions(boundary="project", stopping=Stopping(max_iterations=2))
    expected, _ = smooth_mesh(Mesh(points, [Cells("quad", cells)]), options)
    ours, _ = smooth_mesh(Mesh(points, [Cells("rowwise2", cells[:, TOYS["rowwise2"][1]])]), options)
    np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-12)
    assert not np.array_equal(ours, points)


def test_a_type_may_have_a_shape_of_its_own(monkeypatch):
    """A rectangle twice as wide as high is then best where a square was."""
    corner = np.array([[0, 0], [2, 0], [0, 1.0]])
    across = np.array([[0, 0], [0, 1], [-2, 0.0]])
    brick = replace(CELL_TYPES["quad"], name="brick", targets=(corner, across) * 2)
    monkeypatch.setitem(CELL_TYPES, "brick", brick)
    x, y = np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij")
    points = np.column_stack([2 * x.ravel(), y.ravel()])
    first = (5 * np.arange(4)[:, None] + np.arange(4)).ravel()
    cells = np.stack([first, first + 5, first + 6, first + 1], axis=1)
    mesh = Mesh(points, [Cells("brick", cells)])
    assert mesh_quality(mesh).quality.minimum == pytest.approx(1.0, abs=1e-12)
    assert mesh_quality(Mesh(points, [Cells("quad", cells)])).quality.minimum == pytest.approx(0.8)
    moved = points.copy()
    moved[12] += [0.5, 0.2]
    for engine in ENGINES:
        _, report = smooth_mesh(Mesh(moved, mesh.cells), SmoothOptions(engine=engine))
        assert report.after.minimum > 0.97 > report.before.minimum


def test_a_second_order_type_is_carried_along(monkeypatch):
    """Five nodes: those of a quadrilateral, and one in their middle."""
    quad = CELL_TYPES["quad"]
    monkeypatch.setitem(CELL_TYPES, "quad5", CellType("quad5", 2, 5, linear=quad, mids=((0, 1, 2, 3),)))
    linear = random_mesh("quad", 3)
    cells = linear.cells[0].vertices
    centres = linear.points[cells].mean(axis=1)
    number = len(linear.points) + np.arange(len(cells))
    mesh = Mesh(np.vstack([linear.points, centres]), [Cells("quad5", np.column_stack([cells, number]))])
    options = SmoothOptions(stopping=Stopping(max_iterations=3))
    expected, _ = smooth_mesh(linear, options)
    points, _ = smooth_mesh(mesh, options)
    assert points[: len(expected)].tobytes() == expected.tobytes()
    np.testing.assert_allclose(points[number], expected[cells].mean(axis=1), rtol=0, atol=1e-12)
    assert topological_dimension("quad5") == 2


def test_rows_of_known_types_stay_when_new_shapes_come(monkeypatch):
    before = SHAPES[2].norm.copy()
    target = np.array([[0, 0], [3, 0], [0, 1.0]])
    tall = CellType(
        "tall",
        2,
        3,
        corners=((0, 1, 2),),
        targets=(target,),
        mirror=(0, 2, 1),
        facets=((0, 1), (1, 2), (2, 0)),
    )
    monkeypatch.setitem(CELL_TYPES, "tall", tall)
    assert mesh_quality(
        Mesh(target, [Cells("tall", np.array([[0, 1, 2]]))])
    ).quality.minimum == pytest.approx(1)
    assert len(SHAPES[2].norm) > len(before)
    assert SHAPES[2].norm[: len(before)].tobytes() == before.tobytes()


def test_unknown_types_are_refused():
    with pytest.raises(InputError, match="'rowwise2' are not supported"):
        mesh_quality(Mesh(np.eye(4)[:, :2], [Cells("rowwise2", np.arange(4)[None])]))
