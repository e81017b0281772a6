"""What boundary, interface and embedded vertices may do, on meshes where it is known from coordinates."""

import numpy as np
import pytest

from dvr_cli.backend import COMPILED, NUMPY
from dvr_cli.boundary.constraints import constraints_of
from dvr_cli.boundary.features import features_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from gmsh_parts import part
from meshes import KINDS, grid, random_mesh
from needs import require

N = 4
TURN = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
TURN *= np.linalg.det(TURN)


def features(mesh, angle=None):
    domain = domain_of(mesh)
    angle = None if angle is None else np.radians(angle)
    return features_of(domain.points, domain.interior, constraints_of(mesh, domain), angle)


def dimensions(mesh, **options):
    return features(mesh, **options).freedom.dimension


def box(d=3, kind=None):
    points, boxes = grid(N, d)
    return Mesh(points, [Cells(kind or ("quad" if d == 2 else "hexahedron"), boxes)])


def walls(points):
    """(N, d) bool: on a side of the unit box across this axis."""
    return (points == 0) | (points == 1)


def lower(points, chosen):
    """Quadrilaterals (edges) of the grid all of whose vertices are marked."""
    d = points.shape[1]
    index = np.arange((N + 1) ** d).reshape((N + 1,) * d)
    found = []
    for across in range(d):
        along = [axis for axis in range(d) if axis != across]
        corners = []
        for offset in [(0,), (1,)] if d == 2 else [(0, 0), (1, 0), (1, 1), (0, 1)]:
            part = [slice(None)] * d
            for axis, o in zip(along, offset, strict=True):
                part[axis] = slice(o, o + N)
            corners.append(index[tuple(part)].ravel())
        found.append(np.stack(corners, axis=1))
    cells = np.concatenate(found)
    return cells[chosen[cells].all(axis=1)]


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "triangle"])
@pytest.mark.parametrize("angle", [None, 30])
def test_a_box(kind, angle):
    mesh = random_mesh(kind, 1)
    domain = domain_of(mesh)
    found = features(mesh, angle)
    used = np.unique(domain.corners.vertices)
    on = walls(mesh.points)
    assert (found.freedom.dimension[used] == mesh.points.shape[1] - on.sum(axis=1)[used]).all()
    lines = found.freedom.dimension == 1
    assert (np.abs(found.freedom.axis[lines]) == ~on[lines]).all()
    if domain.dimension == 3:
        planes = found.freedom.dimension == 2
        assert (found.freedom.axis[planes] == on[planes] * (2 * mesh.points[planes] - 1)).all()  # outward


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("shift", [0.0, 1e5])
def test_a_box_in_general_position(factor, shift):
    mesh = random_mesh("tetra", 3)
    turned = Mesh(factor * ((mesh.points + shift) @ TURN.T), mesh.cells)
    found, straight = features(turned), features(mesh)
    assert (found.freedom.dimension == straight.freedom.dimension).all()
    off = np.abs(found.freedom.axis) - np.abs(straight.freedom.axis @ TURN.T)
    assert np.abs(off).max() < 1e-15 * (10 + 10 * shift)


@pytest.mark.parametrize("d", [2, 3])
def test_an_interface_between_two_regions(d):
    mesh = box(d)
    centre = mesh.points[mesh.cells[0].vertices].mean(axis=1)
    mesh.cell_data["material"] = [(centre[:, 0] > 0.5).astype(int)]
    expected = d - walls(mesh.points).sum(axis=1) - (mesh.points[:, 0] == 0.5)
    assert (dimensions(mesh) == expected).all()


def test_interfaces_that_cross():
    mesh = box()
    centre = mesh.points[mesh.cells[0].vertices].mean(axis=1)
    mesh.cell_data["material"] = [((centre[:, 0] > 0.5) ^ (centre[:, 1] > 0.5)).astype(int)]
    expected = 3 - walls(mesh.points).sum(axis=1) - (mesh.points[:, :2] == 0.5).sum(axis=1)
    assert (dimensions(mesh) == expected).all()


@pytest.mark.parametrize("d", [2, 3])
def test_a_group_that_ends_within_a_flat_side(d):
    mesh = box(d)
    cells = lower(mesh.points, mesh.points[:, -1] == 0)
    half = mesh.points[cells].mean(axis=1)[:, 0] < 0.5
    mesh.cells.append(Cells("line" if d == 2 else "quad", cells))
    seam = (mesh.points[:, -1] == 0) & (mesh.points[:, 0] == 0.5)
    for tags, ends in ((np.where(half, 1, 2), seam), (np.ones(len(cells), int), False)):
        mesh.cell_data["gmsh:physical"] = [np.zeros(len(mesh.cells[0].vertices), int), tags]
        assert (dimensions(mesh) == d - walls(mesh.points).sum(axis=1) - ends).all()
    # the same where only one half is a group, and where that half is in two
    for again in (1, 2):
        chosen = np.repeat(cells[half], again, axis=0)
        mesh.cells[1] = Cells(mesh.cells[1].type, chosen)
        tags = np.arange(len(chosen)) % again
        mesh.cell_data["gmsh:physical"] = [np.zeros(len(mesh.cells[0].vertices), int), tags]
        assert (dimensions(mesh) == d - walls(mesh.points).sum(axis=1) - seam).all()


@pytest.mark.parametrize("d", [2, 3])
def test_an_embedded_sheet(d):
    """Its inside moves within it, its straight border along itself, whichever way its cells are turned."""
    mesh = box(d)
    x, last = mesh.points[:, : d - 1], mesh.points[:, -1]
    cells = lower(mesh.points, (last == 0.5) & ((x >= 0.25) & (x <= 0.75)).all(axis=1))
    cells[::2] = cells[::2, ::-1]
    mesh.cells.append(Cells("line" if d == 2 else "quad", cells))
    on = np.zeros(len(mesh.points), bool)
    on[cells] = True
    border = ((x == 0.25) | (x == 0.75)).sum(axis=1)
    expected = np.where(on, d - 1 - border, d - walls(mesh.points).sum(axis=1))
    assert (dimensions(mesh) == expected).all()


def test_an_embedded_sheet_of_tetrahedra():
    require("gmsh")
    mesh = part("embedded")
    x = mesh.points
    on = np.unique(np.concatenate([b.vertices for b in mesh.cells if b.type == "triangle"]))
    border = np.isclose(x[on, :2], 0.2) | np.isclose(x[on, :2], 0.8)
    assert border.any(axis=1).sum() < len(on)
    assert (dimensions(mesh)[on] == 2 - border.sum(axis=1)).all()


@pytest.mark.parametrize("d", [2, 3])
def test_a_sheet_that_divides_a_region(d):
    mesh = box(d)
    cells = lower(mesh.points, mesh.points[:, -1] == 0.5)
    mesh.cells.append(Cells("line" if d == 2 else "quad", cells))
    expected = d - walls(mesh.points).sum(axis=1) - (mesh.points[:, -1] == 0.5)
    assert (dimensions(mesh) == expected).all()


def slit_box(d, doubled):
    """A box whose lower half has its own copy of the marked vertices halfway up."""
    mesh = box(d)
    points, cells = mesh.points, mesh.cells[0].vertices
    on = np.flatnonzero((points[:, -1] == 0.5) & doubled(points))
    copy = np.arange(len(points))
    copy[on] = len(points) + np.arange(len(on))
    above = points[cells].mean(axis=1)[:, -1] > 0.5
    both = np.where(above[:, None], copy[cells], cells)
    return Mesh(np.vstack([points, points[on]]), [Cells(mesh.cells[0].type, both)])


def test_halves_that_share_one_vertex():
    middle = np.array([0.5, 0.5, 0.5])
    mesh = slit_box(3, lambda x: (x != middle).any(axis=1))
    expected = 3 - walls(mesh.points).sum(axis=1) - (mesh.points[:, 2] == 0.5)
    expected[(mesh.points == middle).all(axis=1)] = 0
    assert (dimensions(mesh) == expected).all()


@pytest.mark.parametrize("d", [2, 3])
def test_a_slit(d):
    """Its faces are doubled and open at x = 0; vertices on a face move within it, the front along itself."""
    slit = slit_box(d, lambda x: x[:, 0] < 0.5)
    x = slit.points
    expected = d - walls(x).sum(axis=1)
    faces = (x[:, -1] == 0.5) & (x[:, 0] <= 0.5)
    expected[faces] -= 1
    expected[faces & (x[:, 0] == 0.5)] -= 1
    for angle in (None, 30):
        assert (dimensions(slit, angle=angle) == expected).all()


def test_line_cells_on_edges_and_inside():
    mesh = box()
    x = mesh.points
    index = np.arange((N + 1) ** 3).reshape((N + 1,) * 3)
    plain = dimensions(mesh)
    edge, inner, flat = index[:, 0, 0], index[1:4, 2, 2], index[:, 2, 0]
    lines = np.concatenate([np.stack([row[:-1], row[1:]], axis=1) for row in (edge, inner, flat)])
    mesh.cells.append(Cells("line", lines))
    expected = plain.copy()
    expected[inner], expected[flat[1:-1]] = [0, 1, 0], 1
    expected[flat[[0, -1]]] = 0  # where one ends at an edge of the box
    assert (dimensions(mesh) == expected).all()
    tags = np.ones(len(lines), int)
    tags[0] = 2  # the group changes within the edge of the box
    mesh.cell_data["cell_tags"] = [np.ones(N**3, int), tags]
    expected[edge[1]] = 0
    assert (dimensions(mesh) == expected).all()
    assert (np.abs(features(mesh).freedom.axis[edge[2]]) == [1, 0, 0]).all()
    assert (x[edge][:, 1:] == 0).all()


def test_vertices_that_stay():
    mesh = box()
    centre = np.flatnonzero((mesh.points == [0.5, 0.5, 0]).all(axis=1))
    for extra in (
        [Cells("vertex", centre[:, None])],
        [Cells("line", np.array([[centre[0], 0]]))],  # no edge of the mesh
        [Cells("triangle", np.array([[centre[0], 0, 7]]))],  # no face of the mesh
    ):
        assert dimensions(Mesh(mesh.points, mesh.cells + extra))[centre] == 0
    linked = Mesh(mesh.points, mesh.cells, periodic=np.array([[centre[0], 1]]))
    found, plain = dimensions(linked), dimensions(mesh)
    assert np.flatnonzero(found != plain).tolist() == [1, centre[0]]
    assert found[centre] == 0


@pytest.mark.parametrize("size", [1e-3, 1e-9, 1e-13])
@pytest.mark.parametrize("place", [(0.5, 0.5, 0), (0.5, 0.25, 0)])
def test_a_side_that_is_nearly_flat_is_not_flat(size, place):
    mesh = box()
    near = np.abs(mesh.points - place).max(axis=1) <= 0.25
    near &= mesh.points[:, 2] == 0
    expected = np.where(near, 0, 3 - walls(mesh.points).sum(axis=1))
    mesh.points[(mesh.points == place).all(axis=1), 2] += size
    assert (dimensions(mesh) == expected).all()


def test_sides_with_warped_faces_stay():
    mesh = box()
    top = mesh.points[:, 2] == 1
    mesh.points[top, 2] += 1e-3 * (-1.0) ** np.arange(top.sum())  # neighbours up and down: all normals are z
    assert (dimensions(mesh)[top] == 0).all()


@pytest.mark.parametrize("size", [1e-3, 1e-9, 1e-13])
def test_an_edge_that_is_nearly_straight_is_not_straight(size):
    mesh = box(2)
    near = (mesh.points[:, 1] == 0) & (np.abs(mesh.points[:, 0] - 0.5) <= 0.25)
    expected = np.where(near, 0, 2 - walls(mesh.points).sum(axis=1))
    mesh.points[near & (mesh.points[:, 0] == 0.5), 1] = size
    assert (dimensions(mesh) == expected).all()


def test_planes_lost_in_rounding_stay():
    mesh = random_mesh("tetra", 3)
    on = walls(mesh.points).any(axis=1)
    far = Mesh((mesh.points + 1e9) @ TURN.T, mesh.cells)
    assert (dimensions(far) == np.where(on, 0, 3)).all()


@pytest.mark.parametrize("kind", ["quad", "tetra"])
def test_axes_are_exact_where_coordinates_are_so_but_for_rounding(kind):
    mesh = random_mesh(kind, 1)
    c, s = np.cos(np.pi / 2), np.sin(np.pi / 2)  # c is 6e-17
    turn = np.eye(mesh.points.shape[1])
    turn[:2, :2] = [[c, -s], [s, c]]
    axis = features(Mesh(mesh.points @ turn.T, mesh.cells)).freedom.axis
    assert axis.any()
    assert set(np.unique(np.abs(axis))) == {0.0, 1.0}


def bent_bar(kind, turn):
    """A box of 16 layers bent by ``turn`` degrees about the z axis, x becoming the angle."""
    points, boxes = grid(N, 3)
    angle = np.radians(turn) * points[:, 0]
    radius = 1 + points[:, 1]
    bent = np.column_stack([-radius * np.sin(angle), radius * np.cos(angle), points[:, 2]])
    return points, Mesh(bent, [Cells(kind, boxes)])


def test_curved_sides_and_edges():
    flat, mesh = bent_bar("hexahedron", 60)  # N pieces: 15 degrees each
    sides = 3 - walls(flat).sum(axis=1)
    smooth = features(mesh, angle=20)
    assert (smooth.freedom.dimension == sides).all()
    curve = (flat[:, 1] == 1) & (flat[:, 2] == 1) & (sides == 1)
    tangent = np.column_stack([-mesh.points[:, 1], mesh.points[:, 0]])[curve] / 2
    assert np.abs(np.abs((smooth.freedom.axis[curve, :2] * tangent).sum(axis=1)) - 1).max() < 1e-12
    outside = (flat[:, 1] == 1) & (sides == 2)
    normal = np.column_stack([mesh.points[outside, :2] / 2, np.zeros(outside.sum())])
    np.testing.assert_allclose(smooth.freedom.axis[outside], normal, atol=1e-12)
    # exactly, or at a smaller angle, a curved side is flat strips that meet in ridges along z
    strips = sides - ((sides > 0) & (flat[:, 1] % 1 == 0) & (flat[:, 0] % 1 != 0))
    for angle in (None, 10):
        found = features(mesh, angle=angle)
        assert (found.freedom.dimension == strips).all()
    assert (np.abs(found.freedom.axis[(strips == 1) & (flat[:, 0] % 1 != 0)]) == [0, 0, 1]).all()


@pytest.mark.parametrize("kind", ["tetra", "mixed3d", "quad"])
def test_compiled_set_up_finds_the_same(kind):
    require("numba")
    mesh = random_mesh(kind, 2)
    rng = np.random.default_rng(0)
    mesh.cell_data["material"] = [rng.integers(0, 2, len(block.vertices)) for block in mesh.cells]
    one, other = (constraints_of(mesh, domain_of(mesh, backend=backend)) for backend in (NUMPY, COMPILED))
    for name in ("facets", "label", "two_sided", "lines", "line_label", "fixed"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_interface_facets_are_seen_from_the_higher_region():
    mesh = random_mesh("hexahedron", 1, noise=0)
    centre = mesh.points[mesh.cells[0].vertices].mean(axis=1)
    mesh.cell_data["material"] = [(centre[:, 0] < 0.5).astype(int)]  # the higher one at smaller x
    domain = domain_of(mesh)
    found = constraints_of(mesh, domain)
    a, b, c = (mesh.points[found.facets[:, k]] for k in range(3))
    normal = np.cross(b - a, c - b)
    assert not found.two_sided.any()
    middle = mesh.points[found.facets].mean(axis=1)
    inside = (np.abs(middle - 0.5) < 0.49).all(axis=1)
    assert inside.sum() == 9
    assert (normal[inside, 0] < 0).all()
    assert ((normal * (middle - 0.5)).sum(axis=1)[~inside] > 0).all()
