"""Meshes of other libraries come back as what they were, improved, with all they hold."""

import subprocess
import sys

import numpy as np
import pytest

import dvr_cli
from dvr_cli.api.adapters import registry
from dvr_cli.api.adapters.registry import Adapter
from dvr_cli.errors import InputError, UsageError
from dvr_cli.mesh.mesh import Cells, Mesh
from meshes import random_mesh
from needs import require

VTK_NUMBER = {"triangle": 5, "quad": 9, "tetra": 10, "hexahedron": 12, "wedge": 13, "pyramid": 14}


@pytest.fixture(scope="module", autouse=True)
def libraries():
    """They take seconds to import, so only a worker that runs these tests does."""
    global pyvista, skfem, trimesh
    pyvista, skfem, trimesh = (require(name) for name in ("pyvista", "skfem", "trimesh"))


def grid_of(mesh):
    """The mesh as a grid of PyVista; VTK's wedges begin with the other triangle turned round."""
    [block] = mesh.cells
    cells = block.vertices[:, [0, 2, 1, 3, 5, 4]] if block.type == "wedge" else block.vertices
    return pyvista.UnstructuredGrid({VTK_NUMBER[block.type]: cells}, in_space(mesh.points))


def in_space(points):
    return np.column_stack([points, np.zeros(len(points))]) if points.shape[1] == 2 else points


def two_layers(grid):
    """Give a grid in the unit cube a region below and one above z = 1/2."""
    grid.cell_data["material"] = (grid.cell_centers().points[:, -1] > 0.5).astype(np.int32)


@pytest.mark.parametrize("kind", VTK_NUMBER)
def test_grids_of_pyvista_are_smoothed_as_arrays_are(kind):
    mesh = random_mesh(kind, 1)
    grid = grid_of(mesh)
    before = grid.copy()
    smoothed, report = dvr_cli.smooth(grid, max_iterations=5)
    arrays = {block.type: block.vertices for block in mesh.cells}
    points, expected = dvr_cli.smooth(in_space(mesh.points), arrays, max_iterations=5)
    assert type(smoothed) is pyvista.UnstructuredGrid
    assert np.array_equal(smoothed.points, points)
    assert report.after.q1 == expected.after.q1 > report.before.q1
    assert np.array_equal(smoothed.cells, before.cells)
    assert grid == before


def test_cells_in_any_order_and_arrays_of_any_kind_stay():
    grid = grid_of(random_mesh("tetra", 2))
    grid = grid.merge(grid_of(random_mesh("hexahedron", 2)).translate((2.0, 0.0, 0.0)))
    order = np.random.default_rng(0).permutation(grid.n_cells)
    grid = grid.extract_cells(order)  # VTK sorts them; so they are shuffled by hand
    cells = [grid.get_cell(i) for i in order]
    shuffled = pyvista.UnstructuredGrid(
        np.concatenate([[cell.n_points, *cell.point_ids] for cell in cells]),
        np.array([int(cell.type) for cell in cells]),
        grid.points.astype(np.float64),
    )
    shuffled.cell_data["name"] = [f"cell {i}" for i in range(shuffled.n_cells)]
    shuffled.cell_data["load"] = np.random.default_rng(1).normal(size=(shuffled.n_cells, 3))
    shuffled.field_data["step"] = [7]
    smoothed, report = dvr_cli.smooth(shuffled, max_iterations=5)
    assert report.after.q1 > report.before.q1
    assert (smoothed.compute_cell_sizes()["Volume"] > 0).all()
    assert np.array_equal(smoothed.cells, shuffled.cells)
    assert list(smoothed.cell_data["name"]) == list(shuffled.cell_data["name"])
    assert np.array_equal(smoothed.cell_data["load"], shuffled.cell_data["load"])
    assert smoothed.field_data["step"] == [7]


def test_a_material_of_pyvista_is_a_region():
    grid = grid_of(random_mesh("tetra", 3, n=4))
    two_layers(grid)
    held, _ = dvr_cli.smooth(grid, max_iterations=5)
    free, _ = dvr_cli.smooth(grid, max_iterations=5, regions="none")
    labels = grid.cell_data["material"]
    cells = grid.cells.reshape(-1, 5)[:, 1:]
    shared = np.intersect1d(cells[labels == 0], cells[labels == 1])
    assert len(shared)
    assert np.array_equal(held.points[shared], grid.points[shared])
    assert not np.array_equal(free.points[shared], grid.points[shared])


def test_surfaces_of_pyvista_keep_texture_and_lose_old_normals():
    surface = pyvista.Sphere(theta_resolution=12, phi_resolution=12)
    assert "Normals" in surface.point_data
    surface.active_texture_coordinates = np.random.default_rng(0).random((surface.n_points, 2)).astype("f4")
    smoothed, report = dvr_cli.smooth(surface, max_iterations=5)
    assert type(smoothed) is pyvista.PolyData
    assert report.after.q1 >= report.before.q1
    assert np.array_equal(smoothed.faces, surface.faces)
    assert np.array_equal(smoothed.active_texture_coordinates, surface.active_texture_coordinates)
    assert "Normals" not in smoothed.point_data
    assert "Normals" in surface.point_data


def test_pyvista_finds_the_accessor_by_itself():
    code = (
        "import sys, pyvista; grid = pyvista.examples.cells.Tetrahedron();"
        "assert 'dvr_cli' not in sys.modules; report = grid.dvr.quality(); print(report.quality.minimum)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(run.stdout) == pytest.approx(1.0)  # it is regular


def test_the_accessor_gives_what_the_functions_give():
    grid = grid_of(random_mesh("tetra", 1))
    assert np.array_equal(
        grid.dvr.smooth(directions="axis").points, dvr_cli.smooth(grid, directions="axis")[0].points
    )
    assert grid.dvr.quality(worst=3).quality.worst == dvr_cli.quality_report(grid, worst=3).quality.worst


SKFEM = {
    "MeshTri": 2,
    "MeshQuad": 2,
    "MeshTet": 3,
    "MeshHex": 3,
    "MeshWedge1": 3,
}


def shaken(name):
    """A refined mesh of scikit-fem with interior vertices moved about."""
    if name == "MeshWedge1":
        box = random_mesh("wedge", 0, n=4, noise=0.0)
        mesh = skfem.MeshWedge1(box.points.T.copy(), box.cells[0].vertices.T.copy())
    else:
        mesh = getattr(skfem, name)().refined(3 if SKFEM[name] == 2 else 2)
    points = mesh.p.copy()
    inside = mesh.interior_nodes()
    points[:, inside] += np.random.default_rng(0).uniform(-0.03, 0.03, (len(points), len(inside)))
    return type(mesh)(points, mesh.t)


@pytest.mark.parametrize("name", SKFEM)
def test_meshes_of_scikit_fem_are_smoothed(name):
    mesh = shaken(name)
    smoothed, report = dvr_cli.smooth(mesh)
    assert type(smoothed) is type(mesh)
    assert report.after.q1 > report.before.q1
    assert report.after.inverted == report.before.inverted == 0  # their corners are in our order
    assert np.array_equal(smoothed.t, mesh.t)
    assert np.array_equal(smoothed.p[:, mesh.boundary_nodes()], mesh.p[:, mesh.boundary_nodes()])
    assert not np.shares_memory(smoothed.p, mesh.p)


@pytest.mark.parametrize("name", ["MeshTri2", "MeshQuad2", "MeshTet2", "MeshHex2"])
def test_second_order_meshes_of_scikit_fem_stay_straight(name):
    linear = shaken(name[:-1])
    mesh = getattr(skfem, name).from_mesh(linear)
    smoothed, report = dvr_cli.smooth(mesh)
    assert type(smoothed) is type(mesh)
    assert report.after.q1 > report.before.q1
    corners = type(linear)(smoothed.doflocs[:, : linear.nvertices], linear.t)
    again = getattr(skfem, name).from_mesh(corners)
    assert np.allclose(smoothed.doflocs, again.doflocs, atol=1e-12)


def test_subdomains_are_regions_and_boundaries_bind():
    mesh = shaken("MeshTri").with_subdomains({"left": lambda x: x[0] < 0.5})
    mesh = mesh.with_boundaries({"foot": lambda x: (x[1] == 0.0) & (x[0] < 0.5)})
    nodes = np.intersect1d(
        mesh.t[:, mesh.subdomains["left"]], np.delete(mesh.t, mesh.subdomains["left"], axis=1)
    )
    held, _ = dvr_cli.smooth(mesh)
    assert np.array_equal(held.p[:, nodes], mesh.p[:, nodes])
    assert list(held.subdomains) == ["left"]
    assert list(held.boundaries) == ["foot"]
    end = np.flatnonzero((mesh.p[1] == 0.0) & (mesh.p[0] == 0.5))
    whole = skfem.MeshTri(mesh.p, mesh.t)
    bound, _ = dvr_cli.smooth(mesh, boundary="slide", regions="none")
    free, _ = dvr_cli.smooth(whole, boundary="slide")
    assert np.array_equal(bound.p[:, end], mesh.p[:, end])
    assert not np.array_equal(free.p[:, end], mesh.p[:, end])


def test_surfaces_of_trimesh_keep_their_colours():
    surface = trimesh.creation.icosphere(2)
    surface.vertices += np.random.default_rng(0).normal(scale=0.02, size=surface.vertices.shape)
    surface.visual.face_colors = np.random.default_rng(1).integers(0, 255, (len(surface.faces), 4))
    before = surface.vertices.copy()
    smoothed, report = dvr_cli.smooth(surface, max_iterations=5)
    assert type(smoothed) is trimesh.Trimesh
    assert report.after.q1 >= report.before.q1
    assert np.array_equal(smoothed.faces, surface.faces)
    assert np.array_equal(smoothed.visual.face_colors, surface.visual.face_colors)
    assert np.array_equal(surface.vertices, before)


def test_objects_of_every_library_can_be_judged_and_compared():
    mesh = shaken("MeshTet")
    smoothed, report = dvr_cli.smooth(mesh)
    assert dvr_cli.quality_report(mesh).quality.q1 == report.before.q1
    assert dvr_cli.compare(mesh, smoothed).better == "after"
    untangled, _ = dvr_cli.untangle(mesh)
    assert np.array_equal(untangled.p, mesh.p)
    relaxed, _ = dvr_cli.Relaxer(mesh).relax()
    assert relaxed.shape == mesh.p.T.shape


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (lambda: [[0, 0]], "meshio.Mesh, pyvista.UnstructuredGrid, .* is needed, not a list"),
        (lambda: pyvista.ImageData(dimensions=(3, 3, 3)), "is needed, not a pyvista.ImageData"),
        (lambda: trimesh.PointCloud(np.eye(3)), "is needed, not a trimesh.PointCloud"),
        (lambda: trimesh.primitives.Box(), "a trimesh Box has no vertices of its own"),
        (lambda: skfem.MeshLine(), "a skfem.MeshLine1 cannot be relaxed; MeshTri1, "),
        (lambda: skfem.MeshTri1DG.from_mesh(skfem.MeshTri()), "a skfem.MeshTri1DG cannot be relaxed; "),
        (lambda: pyvista.Sphere().strip(), "triangle strips are not supported"),
    ],
)
def test_other_objects_are_refused_by_name(mesh, message):
    with pytest.raises((InputError, UsageError), match=message):
        dvr_cli.smooth(mesh())


def test_cells_go_with_points_only():
    with pytest.raises(UsageError, match="a mesh has its own"):
        dvr_cli.smooth(skfem.MeshTri(), {"triangle": np.array([[0, 1, 2]])})


def test_an_array_of_cells_says_its_type_by_its_columns_or_is_refused():
    mesh = random_mesh("triangle", 1)
    [block] = mesh.cells
    points, _ = dvr_cli.smooth(mesh.points, block.vertices)
    assert np.array_equal(points, dvr_cli.smooth(mesh.points, {"triangle": block.vertices})[0])
    solid = random_mesh("tetra", 1)
    with pytest.raises(
        UsageError, match=r'4 columns may be several types; give {"quad": cells} or {"tetra": cells}'
    ):
        dvr_cli.smooth(solid.points, solid.cells[0].vertices)
    with pytest.raises(UsageError, match=r"shape \(5, 31\) is not \(n, k\)"):
        dvr_cli.smooth(solid.points, np.zeros((5, 31), dtype=int))


def test_no_library_is_imported_before_an_object_of_it_comes():
    code = (
        "import sys, numpy as np, dvr_cli;"
        "dvr_cli.smooth(np.random.default_rng(0).random((3, 2)), np.array([[0, 1, 2]]));"
        "print(sorted({'pyvista', 'skfem', 'vtk', 'meshio', 'trimesh'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


class Triangles:
    """A class of meshes that only this test knows."""

    def __init__(self, points):
        self.points = points


def read(mesh):
    """See ``Adapter``; this module is that of the record below."""
    return Mesh(mesh.points, [Cells("triangle", np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]]))])


def moved(mesh, points):
    """See ``Adapter``."""
    return type(mesh)(points)


def test_a_record_is_enough_for_another_library(monkeypatch):
    library = Triangles.__module__.split(".")[0]
    monkeypatch.setattr(registry, "ADAPTERS", [Adapter(library, "Triangles", Triangles.__module__)])
    mesh = Triangles(np.array([[0, 0], [1, 0], [0.5, 1], [0.5, 0.1]]))
    smoothed, report = dvr_cli.smooth(mesh)
    assert type(smoothed) is Triangles
    assert report.after.q1 > report.before.q1
    assert mesh.points[3].tolist() == [0.5, 0.1]
