"""Second-order cells: their corners move as in the linear mesh, the other nodes keep their place."""

from __future__ import annotations

import numpy as np
import pytest

from dvr_cli.api.measuring import mesh_quality
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.second_order import STRAIGHT, linear_cells, mid_nodes
from dvr_cli.relax.stopping import Stopping
from meshes import random_mesh

OPTIONS = SmoothOptions(stopping=Stopping(max_iterations=4, tol=0.0))
STRAIGHTEN = SmoothOptions(straighten=True, stopping=OPTIONS.stopping)
# types of a mesh: those it is made with, in place of the linear type of the same shape
KINDS = {
    "triangle6": "triangle",
    "triangle7": "triangle",
    "quad8": "quad",
    "quad9": "quad",
    "tetra10": "tetra",
    "hexahedron20": "hexahedron",
    "hexahedron27": "hexahedron",
    "wedge15": "wedge",
    "wedge18": "wedge",
    "pyramid13": "pyramid",
    "pyramid14": "pyramid",
}


def raised(linear: Mesh, *types: str, t: float = 0.5) -> Mesh:
    """``linear`` with its cells made second-order, nodes of edges at ``t`` from the lower corner.

    Other nodes lie in the middle of their corners. Cells of shapes not in ``types`` stay linear.
    """
    becomes = {CELL_TYPES[name].linear.name: name for name in types}
    points = list(linear.points)
    number: dict[tuple[int, ...], int] = {}
    blocks = []
    for block in linear.cells:
        if block.type not in becomes:
            blocks.append(block)
            continue
        rows = []
        for cell in block.vertices.tolist():
            row = list(cell)
            for around in CELL_TYPES[becomes[block.type]].mids:
                key = tuple(sorted(cell[i] for i in around))
                if key not in number:
                    number[key] = len(points)
                    ends = linear.points[list(key)]
                    middle = (1 - t) * ends[0] + t * ends[1] if len(key) == 2 else ends.mean(axis=0)
                    points.append(middle)
                row.append(number[key])
            rows.append(row)
        blocks.append(Cells(becomes[block.type], np.array(rows)))
    return Mesh(np.array(points), blocks)


def edges_of(mesh: Mesh) -> np.ndarray:
    """(n, 3): the ends of every edge with a node on it, lower first, and that node."""
    found = set()
    for block in mesh.cells:
        for k, around in enumerate(CELL_TYPES[block.type].mids):
            if len(around) == 2:
                node = block.vertices[:, CELL_TYPES[block.type].linear.nodes + k]
                ends = np.sort(block.vertices[:, around], axis=1)
                found |= set(zip(*ends.T.tolist(), node.tolist(), strict=True))
    return np.array(sorted(found))


def middles_of(mesh: Mesh) -> list[tuple[int, tuple[int, ...]]]:
    """The nodes in the middle of faces and cells, each with the corners around it."""
    found = set()
    for block in mesh.cells:
        for k, around in enumerate(CELL_TYPES[block.type].mids):
            if len(around) > 2:
                node = block.vertices[:, CELL_TYPES[block.type].linear.nodes + k]
                corners = np.sort(block.vertices[:, around], axis=1)
                found |= set(zip(node.tolist(), map(tuple, corners.tolist()), strict=True))
    return sorted(found)


def assert_carried(mesh: Mesh, moved: np.ndarray, t: float) -> None:
    """Every node of ``moved`` is in its straight place, and its bits are the old ones if its corners' are."""
    low, high, node = edges_of(mesh).T
    np.testing.assert_allclose(moved[node], (1 - t) * moved[low] + t * moved[high], rtol=0, atol=1e-12)
    still = (moved[low] == mesh.points[low]).all(axis=1) & (moved[high] == mesh.points[high]).all(axis=1)
    assert moved[node[still]].tobytes() == mesh.points[node[still]].tobytes()
    for node, corners in middles_of(mesh):
        ring = list(corners)
        np.testing.assert_allclose(moved[node], moved[ring].mean(axis=0), rtol=0, atol=1e-12)
        if (moved[ring] == mesh.points[ring]).all():
            assert moved[node].tobytes() == mesh.points[node].tobytes()


def test_every_type_of_dimension_2_and_3_is_tried():
    assert set(KINDS) == {
        name for name, record in CELL_TYPES.items() if record.linear and record.dimension > 1
    }


@pytest.mark.parametrize("t", [0.5, 0.25])
@pytest.mark.parametrize("name", KINDS)
def test_corners_move_as_in_the_linear_mesh_and_the_rest_follows(name, t):
    linear = random_mesh(KINDS[name], seed=5)
    mesh = raised(linear, name, t=t)
    expected, before = smooth_mesh(linear, OPTIONS)
    points, report = smooth_mesh(mesh, OPTIONS)
    n = len(linear.points)
    assert (expected != linear.points).any()
    assert points[:n].tobytes() == expected.tobytes()
    assert (report.before.q1, report.after.q1) == (before.before.q1, before.after.q1)
    assert_carried(mesh, points, t)


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("mixed2d", ("triangle6", "quad8")),
        ("mixed2d", ("triangle7", "quad9")),
        ("mixed3d", ("hexahedron20", "wedge15", "pyramid13")),
        ("mixed3d", ("hexahedron27", "wedge18", "pyramid14")),
    ],
)
def test_mixtures_of_shapes(kind, names):
    linear = random_mesh(kind, seed=2, n=4)
    mesh = raised(linear, *names, t=0.25)
    expected, _ = smooth_mesh(linear, OPTIONS)
    points, _ = smooth_mesh(mesh, OPTIONS)
    assert (expected != linear.points).any()
    assert points[: len(linear.points)].tobytes() == expected.tobytes()
    assert_carried(mesh, points, 0.25)


def test_linear_and_second_order_cells_in_one_mesh():
    """The nodes on edges between the two follow as well."""
    linear = random_mesh("mixed2d", seed=3, n=4)
    mesh = raised(linear, "quad8")
    points, _ = smooth_mesh(mesh, OPTIONS)
    assert {block.type for block in mesh.cells} == {"triangle", "quad8"}
    assert points[: len(linear.points)].tobytes() == smooth_mesh(linear, OPTIONS)[0].tobytes()
    assert_carried(mesh, points, 0.5)


def test_second_order_lines_mark_the_vertices_they_hold():
    linear = random_mesh("quad", seed=1, n=4)
    inner = np.flatnonzero(domain_of(linear).interior)
    column = inner[np.argsort(linear.points[inner, 1])]
    linear.cells.append(Cells("line", np.array([column[:2]])))
    mesh = raised(linear, "quad8", "line3")
    points, _ = smooth_mesh(mesh, OPTIONS)
    held = [*column[:2], mesh.cells[1].vertices[0, 2]]
    assert points[held].tobytes() == mesh.points[held].tobytes()
    assert (points[column[2:]] != mesh.points[column[2:]]).any()


def test_a_mesh_in_a_tilted_plane_or_far_away_stays_straight():
    flat = raised(random_mesh("triangle", seed=4), "triangle6", t=0.25)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    for offset, tolerance in ((0.0, 1e-12), (1e4, 1e-10)):
        points = np.pad(flat.points, ((0, 0), (0, 1))) @ turn + offset
        mesh = Mesh(points, flat.cells)
        moved, _ = smooth_mesh(mesh, OPTIONS)
        assert (moved != points).any()
        low, high, node = edges_of(mesh).T
        place = 0.75 * moved[low] + 0.25 * moved[high]
        np.testing.assert_allclose(moved[node], place, rtol=0, atol=tolerance)


# ---------------------------------------------------------------------------------------- curved cells


def bent(name: str, cells: int, by: float) -> tuple[Mesh, np.ndarray, int]:
    """A mesh with a node of an edge off it by ``by`` edge lengths in some cells; the nodes, cells bent."""
    mesh = raised(random_mesh(KINDS[name], seed=6), name)
    block = mesh.cells[0].vertices
    corners = CELL_TYPES[KINDS[name]].nodes
    nodes = np.unique(block[:: len(block) // cells, corners][:cells])
    edges = {node: (low, high) for low, high, node in edges_of(mesh).tolist()}
    for node in nodes.tolist():
        edge = mesh.points[edges[node][1]] - mesh.points[edges[node][0]]
        normal = np.array([0.3, 0.6, 0.7])[: len(edge)]
        normal -= (normal @ edge) / (edge @ edge) * edge
        mesh.points[node] += by * np.linalg.norm(edge) * normal / np.linalg.norm(normal)
    return mesh, nodes, int(np.isin(block, nodes).any(axis=1).sum())


@pytest.mark.parametrize(
    ("name", "boundary"), [*((name, "fixed") for name in KINDS), ("triangle6", "slide"), ("tetra10", "slide")]
)
def test_vertices_of_curved_cells_stay_and_the_others_move_as_if_these_were_held(name, boundary):
    mesh, nodes, count = bent(name, 1, 0.03)
    block = mesh.cells[0].vertices
    curved = np.isin(block, nodes).any(axis=1)
    stopping = Stopping(max_iterations=2, tol=0.0)
    options = SmoothOptions(boundary=boundary, patches=False, polish=False, stopping=stopping)
    points, report = smooth_mesh(mesh, options)
    assert points[np.unique(block[curved])].tobytes() == mesh.points[np.unique(block[curved])].tobytes()
    assert (report.mesh.curved, report.mesh.straighten) == (count, False)
    held = Cells("vertex", np.unique(block[curved][:, : CELL_TYPES[KINDS[name]].nodes])[:, None])
    linear = Mesh(mesh.points, [*linear_cells(mesh.cells), held])
    corners = np.unique(linear.cells[0].vertices)
    assert points[corners].tobytes() == smooth_mesh(linear, options)[0][corners].tobytes()


@pytest.mark.parametrize(("by", "counts"), [(0.9 * STRAIGHT, False), (1.1 * STRAIGHT, True)])
def test_what_counts_as_curved(by, counts):
    mesh, _, count = bent("triangle6", 2, by)
    assert mid_nodes(mesh).curved == (count if counts else 0)


@pytest.mark.parametrize("name", KINDS)
def test_straighten_moves_what_moves_to_its_straight_place(name):
    mesh, nodes, _ = bent(name, 6, 0.05)
    linear = Mesh(mesh.points, linear_cells(mesh.cells))
    points, _ = smooth_mesh(mesh, STRAIGHTEN)
    corners = np.unique(linear.cells[0].vertices)
    assert points[corners].tobytes() == smooth_mesh(linear, OPTIONS)[0][corners].tobytes()
    low, high, node = edges_of(mesh).T
    moves = (points[low] != mesh.points[low]).any(axis=1) | (points[high] != mesh.points[high]).any(axis=1)
    assert np.isin(nodes, node[moves]).any()
    place = (points[low] + points[high]) / 2
    np.testing.assert_allclose(points[node[moves]], place[moves], rtol=0, atol=1e-12)
    assert points[node[~moves]].tobytes() == mesh.points[node[~moves]].tobytes()


def test_a_vertex_that_is_corner_here_and_mid_node_there():
    linear = random_mesh("triangle", seed=8)
    mesh = raised(linear, "triangle6")
    taken = int(mesh.cells[0].vertices[0, 3])
    extra = Cells("triangle", np.array([[taken, 0, 1]]))
    with pytest.raises(InputError, match=f"vertex {taken} .* a corner of one cell and a mid node of another"):
        smooth_mesh(Mesh(mesh.points, [*mesh.cells, extra]), OPTIONS)


def test_the_report_of_a_curved_mesh_says_so():
    mesh, _, count = bent("triangle6", 3, 0.03)
    report = mesh_quality(mesh)
    assert report.mesh.curved == count
    assert report.relaxed == smooth_mesh(mesh, OPTIONS)[1].relaxed
