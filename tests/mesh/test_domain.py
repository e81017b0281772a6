"""What of a mesh can be relaxed, against brute force in Python sets; and what is refused, and how."""

from collections import defaultdict

import numpy as np
import pytest

from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from meshes import KINDS, random_mesh

SECOND_ORDER = [
    *("triangle6", "triangle7", "quad8", "quad9", "tetra10", "wedge15", "wedge18"),
    *("hexahedron20", "hexahedron27", "pyramid13", "pyramid14"),
]


def interior(mesh, region):
    """The vertices all of whose facets lie between two cells of one region, as a list of bool."""
    cells = [(block.type, vertices) for block in mesh.cells for vertices in block.vertices.tolist()]
    beside = defaultdict(list)
    for number, (cell_type, vertices) in enumerate(cells):
        for facet in CELL_TYPES[cell_type].facets:
            beside[frozenset(vertices[i] for i in facet)].append(region[number])
    used = {v for _, vertices in cells for v in vertices}
    outer = {
        v for facet, regions in beside.items() if len(regions) != 2 or len(set(regions)) > 1 for v in facet
    }
    return [v in used - outer for v in range(len(mesh.points))]


def number_of_cells(mesh):
    return sum(len(block.vertices) for block in mesh.cells)


def fan(n=6):
    """Triangles around vertex 0."""
    angles = 2 * np.pi / n * np.arange(n)
    points = np.vstack([[0.1, 0.0], np.column_stack([np.cos(angles), np.sin(angles)])])
    return Mesh(points, [Cells("triangle", np.array([[0, 1 + i, 1 + (i + 1) % n] for i in range(n)]))])


# ------------------------------------------------------------------------------------------ the interior


@pytest.mark.parametrize("kind", KINDS)
def test_vertices_off_the_boundary_are_interior(kind):
    mesh = random_mesh(kind, 1)
    domain = domain_of(mesh)
    assert domain.interior.tolist() == interior(mesh, [0] * number_of_cells(mesh))
    assert domain.interior.any()
    assert not domain.interior.all()


@pytest.mark.parametrize("kind", KINDS)
def test_vertices_on_an_interface_between_regions_are_not(kind):
    mesh = random_mesh(kind, 1, n=4)
    rng = np.random.default_rng(0)
    centroids = np.concatenate([mesh.points[block.vertices].mean(axis=1) for block in mesh.cells])
    tag = (centroids[:, 0] > 0.6).astype(int)  # two regions with a plane between them, or nearly so
    tag[rng.integers(len(tag))] = 7  # and one that is a single cell
    cuts = np.cumsum([len(block.vertices) for block in mesh.cells])[:-1]
    tagged = Mesh(mesh.points, mesh.cells, {"gmsh:physical": np.split(tag, cuts)})
    domain = domain_of(tagged)
    assert domain.interior.tolist() == interior(mesh, tag)
    assert 0 < domain.interior.sum() < domain_of(mesh).interior.sum()
    for one in range(len(tag)):
        assert (domain.region == domain.region[one]).tolist() == (tag == tag[one]).tolist()


@pytest.mark.parametrize(
    ("kind", "embedded", "nodes"),
    [
        *((kind, name, n) for kind in ("triangle", "quad") for name, n in {"vertex": 1, "line": 2}.items()),
        *(
            (kind, name, n)
            for kind in ("tetra", "hexahedron", "mixed3d")
            for name, n in {"vertex": 1, "line": 2, "triangle": 3, "quad": 4}.items()
        ),
    ],
)
def test_vertices_of_embedded_cells_are_not(kind, embedded, nodes):
    mesh = random_mesh(kind, 1, n=4)
    inner = np.flatnonzero(domain_of(mesh).interior)
    pinned = inner[:nodes]
    for blocks in (
        [Cells(embedded, pinned[None]), *mesh.cells],
        [*mesh.cells, Cells(embedded, pinned[None])],
    ):
        domain = domain_of(Mesh(mesh.points, blocks))
        assert np.flatnonzero(domain.interior).tolist() == sorted(set(inner) - set(pinned))


def test_orphan_nodes_are_not():
    mesh = fan()
    domain = domain_of(Mesh(np.vstack([mesh.points, [[0.2, 0.2]]]), mesh.cells))
    assert np.flatnonzero(domain.interior).tolist() == [0]


def test_vertices_of_a_facet_with_more_than_two_cells_are_not():
    """A second triangle on one side of an edge to the middle: three cells share the edge."""
    mesh = fan()
    points = np.vstack([mesh.points, [[1.0, 1.0]]])
    triangles = np.vstack([mesh.cells[0].vertices, [[0, 1, 7], [7, 2, 0]]])
    assert domain_of(mesh).interior[0]
    domain = domain_of(Mesh(points, [Cells("triangle", triangles)]))
    assert not domain.interior.any()


def test_a_cell_given_twice_counts_once():
    mesh = fan()
    twice = np.vstack([mesh.cells[0].vertices, mesh.cells[0].vertices[:1]])
    once = domain_of(mesh).interior
    assert once.any()
    assert (domain_of(Mesh(mesh.points, [Cells("triangle", twice)])).interior == once).all()


# ------------------------------------------------------------------------------------- cells and their ids


def test_cells_are_those_of_the_highest_dimension_numbered_through_all_blocks():
    mesh = random_mesh("mixed3d", 1)
    hexahedra, pyramids, wedges = mesh.cells
    faces = Cells("quad", hexahedra.vertices[:, :4])
    blocks = [Cells("vertex", np.array([[0], [1]])), hexahedra, faces, pyramids, wedges]
    domain = domain_of(Mesh(mesh.points, blocks))
    assert domain.dimension == 3
    assert [block.type for block in domain.cells] == ["hexahedron", "pyramid", "wedge"]
    through = [(block.type, vertices.tolist()) for block in blocks for vertices in block.vertices]
    assert len(domain.cell_ids) == number_of_cells(mesh)
    cells = [(block.type, vertices.tolist()) for block in domain.cells for vertices in block.vertices]
    assert [through[cell_id] for cell_id in domain.cell_ids] == cells


def test_region_tags_of_lower_cells_do_not_make_regions():
    mesh = fan()
    blocks = [Cells("line", np.array([[1, 2], [2, 3]])), *mesh.cells]
    domain = domain_of(Mesh(mesh.points, blocks, {"gmsh:physical": [np.array([1, 2]), np.full(6, 3)]}))
    assert domain.region.tolist() == [0] * 6
    assert domain.interior[0]


@pytest.mark.parametrize("integer", [np.int32, np.int64, np.uint32, np.uint64])
def test_connectivity_of_any_integer_type(integer):
    mesh = fan()
    cells = [Cells("triangle", mesh.cells[0].vertices.astype(integer))]
    np.testing.assert_array_equal(
        domain_of(Mesh(mesh.points, cells)).corners.vertices, mesh.cells[0].vertices
    )


def test_empty_blocks_do_no_harm():
    mesh = fan()
    empty = [Cells(name, np.empty((0, n), dtype=int)) for name, n in {"tetra10": 10, "polygon": 5}.items()]
    domain = domain_of(Mesh(mesh.points, [*empty, *mesh.cells, Cells("tetra", np.empty((0, 4), dtype=int))]))
    assert domain.dimension == 2
    assert domain.interior[0]


# -------------------------------------------------------------------------------------- what is refused


def refusal(mesh):
    """The message, of one line, with which the mesh is refused."""
    with pytest.raises(InputError) as caught:
        domain_of(mesh)
    message = str(caught.value)
    assert message
    assert "\n" not in message
    return message


@pytest.mark.parametrize("cell_type", SECOND_ORDER)
def test_vertices_of_curved_second_order_cells_stay(cell_type):
    n = int("".join(filter(str.isdigit, cell_type)))
    points = np.random.default_rng(0).random((n, 3))
    domain = domain_of(Mesh(points, [Cells(cell_type, np.arange(n)[None])]))
    assert domain.mids is not None
    assert domain.mids.curved == 1
    assert not domain.interior.any()


@pytest.mark.parametrize(
    ("cell_type", "n"),
    [
        ("polygon", 5),
        ("polyhedron6", 6),
        ("tetra14", 14),
        ("hexahedron24", 24),
        ("tetra20", 20),
        ("VTK_LAGRANGE_TRIANGLE", 15),
    ],
)
def test_other_cells(cell_type, n):
    mesh = random_mesh("tetra", 1)
    alone = refusal(Mesh(mesh.points, [Cells(cell_type, np.arange(n)[None])]))
    beside = refusal(Mesh(mesh.points, [*mesh.cells, Cells(cell_type, np.arange(n)[None])]))
    assert repr(cell_type) in alone
    assert repr(cell_type) in beside


@pytest.mark.parametrize("cells", [[], [Cells("triangle", np.empty((0, 3), dtype=int))]])
def test_no_cells(cells):
    assert "no cells" in refusal(Mesh(np.zeros((3, 2)), cells))


def test_only_lines_and_vertices():
    cells = [Cells("line", np.array([[0, 1]])), Cells("vertex", np.array([[2]]))]
    message = refusal(Mesh(np.eye(3), cells))
    assert "line" in message
    assert "vertex" in message


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("kind", ["triangle", "tetra"])
def test_coordinates_that_are_not_finite(kind, value):
    mesh = random_mesh(kind, 1)
    mesh.points[5, 1] = value
    assert "vertex 5 (counted from 0)" in refusal(mesh)


@pytest.mark.parametrize("wrong", [-1, 7, 2**40])
def test_cells_that_name_missing_vertices(wrong):
    mesh = fan()
    lines = Cells("line", np.array([[1, 2], [2, 3]]))
    triangles = mesh.cells[0].vertices.copy()
    triangles[4, 1] = wrong
    message = refusal(Mesh(mesh.points, [lines, Cells("triangle", triangles)]))
    assert "cell 6 (triangle)" in message
    assert "7 vertices" in message
    assert "cell 0 (line)" in refusal(Mesh(mesh.points, [Cells("line", np.array([[1, wrong]])), *mesh.cells]))


@pytest.mark.parametrize(("column", "other"), [(0, 1), (0, 2), (1, 2)])
def test_cells_that_name_one_vertex_twice(column, other):
    mesh = fan()
    lines = Cells("line", np.array([[1, 2], [2, 3]]))
    triangles = mesh.cells[0].vertices.copy()
    triangles[3, column] = triangles[3, other]
    assert "cell 5 (triangle)" in refusal(Mesh(mesh.points, [lines, Cells("triangle", triangles)]))


@pytest.mark.parametrize("cells", [[[0, 1]], [[0, 1, 2, 3]], [0, 1, 2], [[0.0, 1.0, 2.0]], [["0", "1", "2"]]])
def test_connectivity_of_the_wrong_shape_or_type(cells):
    mesh = fan()
    assert "triangle" in refusal(Mesh(mesh.points, [Cells("triangle", np.array(cells))]))


@pytest.mark.parametrize("coordinates", [1, 4])
def test_points_with_too_few_or_too_many_coordinates(coordinates):
    points = np.random.default_rng(0).random((7, coordinates))
    assert f"{coordinates}" in refusal(Mesh(points, fan().cells))


@pytest.mark.parametrize("kind", ["tetra", "hexahedron", "mixed3d"])
def test_volume_cells_with_two_coordinates(kind):
    mesh = random_mesh(kind, 1)
    assert "2" in refusal(Mesh(mesh.points[:, :2], mesh.cells))


def test_coordinates_too_large_to_compute_with():
    mesh = random_mesh("tetra", 1)
    assert "1e+50" in refusal(Mesh(mesh.points * 1e60, mesh.cells))
    assert domain_of(Mesh(mesh.points * 1e49, mesh.cells)).interior.any()


@pytest.mark.filterwarnings("error")
def test_points_of_any_layout_become_what_kernels_are_compiled_for():
    mesh = random_mesh("tetra", 0)
    for points in (np.asfortranarray(mesh.points), mesh.points.astype(np.float32)):
        points.setflags(write=False)
        domain = domain_of(Mesh(points, mesh.cells))
        for found in (domain.points, domain.flatten(points.astype(float))):
            assert found.flags.c_contiguous
            assert found.flags.writeable
            assert found.dtype == np.float64
            assert (found == points).all()
