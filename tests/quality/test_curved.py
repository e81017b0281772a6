"""Curved cells judged by their own Jacobian: closed forms, and the Jacobians that Gmsh computes."""

import meshio
import numpy as np
import pytest

import dvr_cli
from dvr_cli.api.measuring import mesh_quality
from dvr_cli.cli.main import main
from dvr_cli.files.gmsh.cells import NODE_ORDER
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.curved import curved_quality
from gmsh_session import gmsh_session

LINEAR = {
    "triangle": [(0, 0), (1, 0), (0.5, 0.8)],
    "quad": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "tetra": [(0, 0, 0), (1, 0, 0), (0.5, 0.8, 0), (0.5, 0.3, 0.8)],
    "hexahedron": [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))],
    "wedge": [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (0.5, 0.8))],
    "pyramid": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 0.8)],
}
POLYNOMIAL = ["triangle6", "quad8", "quad9", "tetra10", "hexahedron20", "hexahedron27", "wedge15", "wedge18"]
PYRAMIDS = ["pyramid13", "pyramid14"]
CURVED = [*POLYNOMIAL, *PYRAMIDS]
KIND = dict(zip(CURVED, (9, 16, 10, 11, 17, 12, 18, 13, 19, 14), strict=True))  # their numbers in Gmsh


def one_bent(h, stored=(0, 1, 2, 3, 4, 5)):
    """The triangle (0,0), (1,0), (0,1) with the node on its lower edge raised by h; det J is 1 - 4hx."""
    points = np.array([[0, 0], [1, 0], [0, 1], [0.5, h], [0.5, 0.5], [0, 0.5]])
    return Mesh(points, [Cells("triangle6", np.array([stored]))])


def cells_apart(name, noise, n=120, seed=3):
    """Cells of one type that share no node, their corners and mid nodes moved at random."""
    rng = np.random.default_rng(seed)
    cell_type = CELL_TYPES[name]
    corners = np.array(LINEAR[cell_type.linear.name], dtype=float)
    corners = corners + 0.1 * rng.standard_normal((n, *corners.shape))
    mids = np.stack([corners[:, list(around)].mean(axis=1) for around in cell_type.mids], axis=1)
    mids += rng.uniform(0, noise, (n, 1, 1)) * rng.standard_normal(mids.shape)
    points = np.concatenate([corners, mids], axis=1)
    points[..., 0] += 10.0 * np.arange(n)[:, None]
    vertices = np.arange(points.shape[0] * points.shape[1]).reshape(n, -1)
    return Mesh(points.reshape(-1, points.shape[-1]), [Cells(name, vertices)])


def of_gmsh(mesh):
    """The least determinant of the Jacobian of each cell, and the least at its nodes, by Gmsh."""
    (block,), d = mesh.cells, mesh.points.shape[1]
    order = np.argsort(NODE_ORDER[block.type]) if block.type in NODE_ORDER else slice(None)
    with gmsh_session() as gmsh:
        entity = gmsh.model.addDiscreteEntity(d)
        numbers, points = np.arange(1, len(mesh.points) + 1), np.pad(mesh.points, ((0, 0), (0, 3 - d)))
        gmsh.model.mesh.addNodes(d, entity, numbers, points.ravel())
        tags = np.arange(1, len(block.vertices) + 1)
        gmsh.model.mesh.addElementsByType(
            entity, KIND[block.type], tags, block.vertices[:, order].ravel() + 1
        )
        count, local = gmsh.model.mesh.getElementProperties(KIND[block.type])[3:5]
        local = np.pad(np.reshape(local, (count, d)), ((0, 0), (0, 3 - d)))
        least = gmsh.model.mesh.getElementQualities(tags, "minDetJac")
        jacobians = gmsh.model.mesh.getJacobians(KIND[block.type], local.ravel())[0]
    at_nodes = np.linalg.det(np.reshape(jacobians, (-1, count, 3, 3))[..., :d, :d])
    return np.array(least), at_nodes.min(axis=1)


def jacobians_of_gmsh(mesh, places):
    """(n, p) the determinants of the Jacobians of cells at places (p, 3) in the reference cell, by Gmsh."""
    (block,) = mesh.cells
    order = np.argsort(NODE_ORDER[block.type])
    with gmsh_session() as gmsh:
        entity = gmsh.model.addDiscreteEntity(3)
        gmsh.model.mesh.addNodes(3, entity, np.arange(1, len(mesh.points) + 1), mesh.points.ravel())
        tags = np.arange(1, len(block.vertices) + 1)
        gmsh.model.mesh.addElementsByType(
            entity, KIND[block.type], tags, block.vertices[:, order].ravel() + 1
        )
        return gmsh.model.mesh.getJacobians(KIND[block.type], places.ravel())[1].reshape(-1, len(places))


@pytest.mark.parametrize("stored", [(0, 1, 2, 3, 4, 5), (0, 2, 1, 5, 4, 3)])
@pytest.mark.parametrize(("h", "inverted"), [(0.2, 0), (0.2499, 0), (0.25, 1), (0.42, 1), (-0.4, 0)])
def test_a_triangle_with_one_bent_edge(h, inverted, stored):
    quality = mesh_quality(one_bent(h, stored)).quality
    assert (quality.inverted, quality.uncertain, quality.degenerate) == (inverted, 0, 0)
    expected = np.sqrt(3) / 2  # of the straight triangle
    if inverted:  # at (1, 0), of the map to it from the regular triangle
        tangents = np.array([[1, -4 * h], [0, 1 - 4 * h]])
        ideal = np.array([[1, 0], [0.5, np.sqrt(3) / 2]])
        map_ = np.linalg.solve(ideal, tangents)
        expected = 2 * np.linalg.det(map_) / (map_**2).sum()
    assert quality.minimum == pytest.approx(expected, abs=1e-12)
    assert quality.fixed_cap == quality.minimum == quality.worst[0].quality


@pytest.mark.parametrize("name", POLYNOMIAL)
def test_verdicts_agree_with_the_jacobians_of_gmsh(name):
    mesh = cells_apart(name, 0.25 if CELL_TYPES[name].dimension == 2 else 0.12)
    judged = curved_quality(domain_of(mesh), mesh.points)
    assert len(judged.element) > 100
    least, at_nodes = (values[judged.element] for values in of_gmsh(mesh))
    assert np.array_equal(judged.inverted, at_nodes <= 0)
    certain = ~judged.inverted & ~judged.uncertain
    assert (least[certain] > 0).all()
    assert (least[judged.inverted] <= 0).all()
    assert judged.inverted.sum() > 5
    assert certain.sum() > 5
    assert not (judged.inverted & judged.uncertain).any()
    if name in ("quad8", "quad9", "hexahedron27"):  # among these are cells negative between their nodes alone
        assert (least[judged.uncertain] <= 0).any()


@pytest.mark.parametrize("name", POLYNOMIAL)
def test_the_mean_ratio_at_the_nodes_of_a_nearly_straight_cell_is_that_of_its_corners(name):
    mesh = cells_apart(name, 0.0, n=20)
    mids = len(CELL_TYPES[name].mids)
    mesh.points[mesh.cells[0].vertices[:, -mids]] += 1e-5
    domain = domain_of(mesh)
    judged = curved_quality(domain, mesh.points)
    straight = mesh_quality(mesh).quality.elements
    if CELL_TYPES[name].linear.is_simplex:
        np.testing.assert_allclose(judged.quality, straight, atol=1e-3)
    assert (judged.quality <= straight + 1e-3).all()


@pytest.mark.parametrize("name", [PYRAMIDS[0], pytest.param(PYRAMIDS[1], marks=pytest.mark.long)])
def test_verdicts_about_pyramids_agree_with_the_jacobians_of_gmsh(name):
    """Inverted: at the nodes. Certain: nowhere negative, at random places (Gmsh's least value is none)."""
    mesh = cells_apart(name, 0.12, n=300)
    judged = curved_quality(domain_of(mesh), mesh.points)
    assert len(judged.element) > 250
    at_nodes = of_gmsh(mesh)[1][judged.element]
    assert np.array_equal(judged.inverted, at_nodes <= 0)
    rng = np.random.default_rng(5)
    w = np.concatenate([rng.uniform(0, 1, 150), 1 - rng.uniform(0, 0.05, 150), np.full(50, 1e-9)])
    places = np.column_stack([rng.uniform(-1, 1, (len(w), 2)) * (1 - w)[:, None], w])
    inside = jacobians_of_gmsh(mesh, places)[judged.element].min(axis=1)
    certain = ~judged.inverted & ~judged.uncertain
    assert (inside[certain] > 0).all()
    assert judged.inverted.sum() > 20
    assert certain.sum() > 100
    assert 0 < judged.uncertain.sum() < certain.sum()
    assert (inside[judged.uncertain] <= 0).any()  # negative between its nodes alone


@pytest.mark.parametrize("name", PYRAMIDS)
def test_a_straight_pyramid_has_the_quality_of_its_corners_and_is_certain(name):
    mesh = cells_apart(name, 0.0, n=20)
    mesh.points[mesh.cells[0].vertices[:, 5]] += 1e-5
    judged = curved_quality(domain_of(mesh), mesh.points)
    straight = mesh_quality(mesh).quality.elements
    assert len(judged.element) == 20
    assert not judged.uncertain.any()
    assert (judged.quality <= straight + 1e-3).all()


@pytest.mark.parametrize("name", CURVED)
def test_a_node_beyond_the_quarter_point_of_a_straight_edge_inverts_its_cell(name):
    """The Jacobian at the ends of an edge is (4t - 1) and (3 - 4t) times that of the straight cell."""
    for t, inverted in ((0.5, 0), (0.3, 0), (0.251, 0), (0.249, 1), (0.749, 0), (0.751, 1), (0.05, 1)):
        mesh = cells_apart(name, 0.0, n=1)
        cells = mesh.cells[0].vertices
        first, end = CELL_TYPES[name].mids[0]
        corners = mesh.points[cells[0]]
        mesh.points[cells[0, -len(CELL_TYPES[name].mids)]] = (1 - t) * corners[first] + t * corners[end]
        quality = mesh_quality(mesh).quality
        assert quality.inverted == inverted, t
        assert (quality.minimum <= 0) == bool(inverted)


@pytest.fixture
def neg(tmp_path):
    """A square of four triangles, of which one has a mid node so far in that it is inverted."""
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5], [0.5, 0.42], [1, 0.5], [0.5, 1], [0, 0.5]]
    points += [[0.25, 0.25], [0.75, 0.25], [0.75, 0.75], [0.25, 0.75]]
    cells = [[0, 1, 4, 5, 10, 9], [1, 2, 4, 6, 11, 10], [2, 3, 4, 7, 12, 11], [3, 0, 4, 8, 9, 12]]
    path = tmp_path / "neg.msh"
    space = np.pad(np.array(points, dtype=float), ((0, 0), (0, 1)))
    meshio.write(path, meshio.Mesh(space, {"triangle6": np.array(cells)}), "gmsh22", binary=False)
    return path


def test_the_gate_fails_for_a_cell_inverted_by_its_curved_shape(neg, capfd):
    assert main(["report", "quality", str(neg), "--fail-below", "0"]) == 1
    out, err = capfd.readouterr()
    assert "inverted\t1" in out
    assert "--straighten" in out
    assert "is below 0" in err


def test_untangling_with_straighten_makes_it_straight_and_says_so(neg, capfd):
    out = neg.with_name("out.msh")
    assert main(["untangle", str(neg), str(out), "--straighten", "--fail-below", "0"]) == 0
    err = capfd.readouterr().err
    assert "nothing to untangle" not in err
    assert "made straight" in err
    before, after = meshio.read(neg, "gmsh").points, meshio.read(out, "gmsh").points
    assert after[5].tolist() == [0.5, 0, 0]
    assert np.array_equal(np.delete(after, 5, axis=0), np.delete(before, 5, axis=0))


def test_untangling_without_it_says_what_helps(neg, capfd):
    assert main(["untangle", str(neg), str(neg.with_name("out.msh"))]) == 0
    err = capfd.readouterr().err
    assert "nothing to untangle" not in err
    assert "--straighten makes it straight" in err
    assert "1 inverted or degenerate element left" in err


def test_straightening_one_edge_of_a_curved_layer_does_not_invert_the_layer():
    """Two curved layers, the lower one inverted: made straight, its upper edge would cut into the other."""
    h, thin = 0.3, 0.05
    x = np.array([0, 0.5, 1])
    rows = [
        np.stack([x, y + bend * np.array([0, 1, 0])], 1)
        for y, bend in ((0, 0), (thin, h), (2 * thin, h), (1, 0))
    ]
    sides = [np.array([[x, y]]) for y in (thin / 2, 1.5 * thin, 0.5) for x in (0.0, 1.0)]
    rows[0][1, 1] = h + thin  # beyond the upper edge
    points = np.concatenate([*rows, *sides])
    cells = [
        [3 * k, 3 * k + 2, 3 * k + 5, 3 * k + 3, 3 * k + 1, 13 + 2 * k, 3 * k + 4, 12 + 2 * k]
        for k in range(3)
    ]
    mesh = Mesh(points, [Cells("quad8", np.array(cells))])
    before = mesh_quality(mesh).quality
    assert before.inverted >= 1
    moved, report = dvr_cli.untangle(points, {"quad8": np.array(cells)}, straighten=True)
    assert report.after.inverted == 0
    assert mesh_quality(Mesh(moved, mesh.cells)).quality.inverted == 0
