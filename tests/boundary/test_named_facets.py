"""Facets in named sets and sets of points hold and bind as cells of lower dimension and groups do."""

import numpy as np
import pytest

from dvr_cli.api.boundary import moves_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh

N = 6  # cells on a side


def square(**more):
    """A square of N x N cells, cut into triangles; vertex i + (N + 1) j is at (i, j)."""
    j, i = np.divmod(np.arange((N + 1) ** 2), N + 1)
    low = (np.arange(N)[:, None] * (N + 1) + np.arange(N)).ravel()
    a, b, c, d = low, low + 1, low + N + 2, low + N + 1
    cells = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Mesh(np.column_stack([i, j]).astype(float), [Cells("triangle", cells)], **more)


def cube(kind="hexahedron", **more):
    """A cube of N x N x N hexahedra, or each cut into two wedges; vertex i + (N + 1) (j + (N + 1) k)."""
    m = N + 1
    at = np.arange(m**3)
    points = np.column_stack([at % m, at // m % m, at // m**2]).astype(float)
    low = at[(points < N).all(axis=1)]
    corners = [low, low + 1, low + 1 + m, low + m]
    hexes = np.column_stack([*corners, *(c + m * m for c in corners)])
    if kind == "wedge":
        hexes = np.concatenate([hexes[:, [0, 1, 2, 4, 5, 6]], hexes[:, [0, 2, 3, 4, 6, 7]]])
    return Mesh(points, [Cells(kind, hexes)], **more)


def bottom(n):
    """The first n edges at the bottom of the square."""
    return np.column_stack([np.arange(n), np.arange(n) + 1])


def sliding(mesh):
    """(N,) dimension of the freedom of each vertex under --boundary slide."""
    everything = np.ones(len(mesh.points), dtype=bool)
    return moves_of(mesh, domain_of(mesh), "slide", everything, 30.0).freedom.dimension


def test_without_sets_the_sides_slide():
    free = sliding(square())
    assert free[1:N].tolist() == [1] * (N - 1)


@pytest.mark.parametrize("filled", [0, 2])
def test_the_ends_of_a_named_part_of_a_side_stay(filled):
    rows = np.pad(bottom(3), ((0, 0), (0, filled)), constant_values=-1)
    free = sliding(square(facet_sets={"inlet": rows}))
    assert free[1:N].tolist() == [1, 1, 0, 1, 1]


def test_where_one_set_ends_and_another_begins_a_vertex_stays():
    edges = bottom(N)
    free = sliding(square(facet_sets={"a": edges[:2], "b": edges[2:4], "c": edges[3:]}))
    assert free[1:N].tolist() == [1, 0, 0, 0, 1]


def test_a_set_of_points_binds_where_whole_facets_are_in_it():
    free = sliding(square(point_sets={"inlet": np.arange(4), "everything": np.arange((N + 1) ** 2)}))
    assert free[1:N].tolist() == [1, 1, 0, 1, 1]


def test_a_point_of_a_set_that_has_no_facet_there_stays():
    free = sliding(square(point_sets={"load": np.array([3, 10])}))
    assert free[1:N].tolist() == [1, 1, 0, 1, 1]
    assert free[10] == 2  # inside the mesh a set is no embedded cell


def test_named_facets_inside_the_mesh_hold_their_vertices():
    inner = np.array([[17, 18], [18, 19]])
    interior = domain_of(square()).interior
    held = domain_of(square(facet_sets={"wall": inner})).interior
    assert np.flatnonzero(interior & ~held).tolist() == [17, 18, 19]


def test_cells_of_a_planar_mesh_in_a_set_are_no_facets():
    mesh = square()
    with_faces = square(facet_sets={"upper side": mesh.cells[0].vertices[:5]})
    assert np.array_equal(domain_of(mesh).interior, domain_of(with_faces).interior)
    assert np.array_equal(sliding(mesh), sliding(with_faces))


def floor(columns):
    """The facets of the cube's bottom with these columns (x)."""
    m = N + 1
    return np.array([[v := x + m * y, v + 1, v + 1 + m, v + m] for x in columns for y in range(N)])


@pytest.mark.parametrize("kind", ["hexahedron", "wedge"])
def test_the_rim_of_a_named_face_slides_along_itself(kind):
    rows = floor(range(3))
    if kind == "wedge":
        rows = np.concatenate([np.pad(rows[:, [0, 1, 2]], ((0, 0), (0, 1)), constant_values=-1)])
        rows = np.concatenate(
            [rows, np.pad(floor(range(3))[:, [0, 2, 3]], ((0, 0), (0, 1)), constant_values=-1)]
        )
    free = sliding(cube(kind, facet_sets={"inlet": rows})).reshape(N + 1, N + 1, N + 1)  # [z, y, x]
    assert free[0, 1:N, 1:N].tolist() == [[2, 2, 1, 2, 2]] * (N - 1)
    assert free[0, 0, 1:N].tolist() == [1, 1, 0, 1, 1]


def test_named_edges_of_a_volume_mesh_slide_along_themselves():
    line = np.column_stack([np.arange(N), np.arange(N) + 1]) + 3 * (N + 1)  # y = 3 on the bottom
    free = sliding(cube(facet_sets={"weld": line})).reshape(N + 1, N + 1, N + 1)
    assert free[0, 3, 1:N].tolist() == [1] * (N - 1)
    assert free[0, 2, 1:N].tolist() == [2] * (N - 1)


def test_named_facets_of_second_order_cells_are_known_by_their_corners():
    mesh = square()
    t = mesh.cells[0].vertices
    edges = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    unique, place = np.unique(edges, axis=0, return_inverse=True)
    mids = len(mesh.points) + place.reshape(3, -1).T
    points = np.concatenate([mesh.points, mesh.points[unique].mean(axis=1)])
    rows = [[*edge, len(mesh.points) + unique.tolist().index(edge)] for edge in bottom(3).tolist()]
    quadratic = Mesh(points, [Cells("triangle6", np.hstack([t, mids]))], facet_sets={"inlet": np.array(rows)})
    assert sliding(quadratic)[1:N].tolist() == [1, 1, 0, 1, 1]
