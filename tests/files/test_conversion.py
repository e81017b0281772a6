"""Conversion of two materials with groups and fields: another program agrees, or the format is refused."""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import numpy as np
import pytest

from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.cli.main import main
from dvr_cli.files.formats import FORMATS, format_named
from dvr_cli.files.reading import open_mesh
from dvr_cli.relax.stopping import Stopping
from gmsh_session import gmsh_session, opened_by_gmsh
from needs import require

Mesh = tuple[np.ndarray, np.ndarray]  # points (N, 3) and tetrahedra (n, 4)


def _with_vtk(reader_name: str):
    def read(path: Path) -> Mesh:
        require("vtk")
        from vtkmodules import all as vtk
        from vtkmodules.util.numpy_support import vtk_to_numpy

        reader = getattr(vtk, reader_name)()
        reader.SetFileName(str(path))
        reader.Update()
        grid = reader.GetOutput()
        while grid.IsA("vtkMultiBlockDataSet"):
            grid = grid.GetBlock(0)
        cells = [
            [grid.GetCell(i).GetPointId(k) for k in range(4)]
            for i in range(grid.GetNumberOfCells())
            if grid.GetCellType(i) == vtk.VTK_TETRA
        ]
        return vtk_to_numpy(grid.GetPoints().GetData()).astype(float), np.array(cells)

    return read


def _with_gmsh(path: Path) -> Mesh:
    with opened_by_gmsh(path) as (gmsh, tags, points):
        _, nodes = gmsh.model.mesh.getElementsByType(4)
        return points, np.searchsorted(tags, nodes).reshape(-1, 4)


def _with_netcdf(path: Path) -> Mesh:
    netcdf = require("netCDF4")
    with netcdf.Dataset(path) as data:
        points = np.asarray(data["coord"][:]).T
        blocks = [data[name][:] for name in data.variables if name.startswith("connect")]
        return points, np.concatenate([b for b in blocks if b.shape[1] == 4]) - 1


def _with_meshio(name: str):
    def read(path: Path) -> Mesh:
        mesh = meshio.read(path, name)
        return mesh.points, mesh.get_cells_type("tetra")

    return read


def _netgen(path: Path) -> Mesh:
    """By hand: material, number of nodes and nodes of an element, which Netgen orders the other way round."""
    words = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
    at, start = words.index("points"), words.index("volumeelements")
    points = [[float(x) for x in words[at + 2 + i].split()] for i in range(int(words[at + 1]))]
    rows = [words[start + 2 + i].split()[2:] for i in range(int(words[start + 1]))]
    return np.array(points), np.array(rows, dtype=int)[:, [0, 2, 1, 3]] - 1


# what reads each format that takes tetrahedra; the others refuse them
READERS = {
    "abaqus": _with_meshio("abaqus"),
    "avsucd": _with_vtk("vtkAVSucdReader"),
    "exodus": _with_netcdf,
    "gmsh": _with_gmsh,
    "medit": _with_gmsh,
    "nastran": _with_gmsh,
    "netgen": _netgen,
    "su2": _with_meshio("su2"),
    "vtk": _with_vtk("vtkUnstructuredGridReader"),
    "vtu": _with_vtk("vtkXMLUnstructuredGridReader"),
    "xdmf": None,  # see test_xdmf
}


RUN = ["--max-iterations", "2"]


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    """Two boxes of two materials in one volume mesh, with a wall and a field."""
    path = tmp_path_factory.mktemp("conversion") / "source.msh"
    with gmsh_session(Mesh_MeshSizeMax=0.6) as gmsh:
        occ = gmsh.model.occ
        occ.fragment([(3, occ.addBox(0, 0, 0, 1, 1, 1))], [(3, occ.addBox(1, 0, 0, 0.7, 1, 1))])
        occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [1], 5, "steel")
        gmsh.model.addPhysicalGroup(3, [2], 4, "rubber")
        gmsh.model.addPhysicalGroup(2, [1], 7, "wall")
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
        tags = gmsh.model.mesh.getNodes()[0]
    values = "".join(f"{tag} {0.5 * tag}\n" for tag in tags)
    with path.open("a") as file:
        head = f'$NodeData\n1\n"temperature"\n1\n0.0\n3\n0\n1\n{len(tags)}\n'
        file.write(f"{head}{values}$EndNodeData\n")
    return path


def shapes(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """The signed volume and centroid of each tetrahedron, in one order."""
    corners = points[cells]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    rows = np.column_stack([corners.mean(axis=1), volume])
    return rows[np.lexsort(np.round(rows, 5).T)]


@pytest.mark.parametrize("name", FORMATS)
def test_a_format_converts_as_another_program_reads_it_or_is_refused(source, tmp_path, capfd, name):
    given = source
    if name == "gmsh":  # converted, not patched
        given = tmp_path / "given.vtu"
        assert main(["smooth", str(source), str(given), "--no-report", "--max-iterations", "0"]) == 0
        capfd.readouterr()
    out = tmp_path / f"out{format_named(name).suffixes[0]}"
    before = set(tmp_path.iterdir())
    # heights are kept as rounded by the format, which another run would not do
    options = ["--output-format", name, "--no-report", "--no-keep-height", *RUN]
    code = main(["smooth", str(given), str(out), *options])
    err = capfd.readouterr().err
    if name not in READERS:
        assert code == 4
        assert err.startswith(f"dvr: error: {out}: ")
        assert err.count("\n") == 1
        assert set(tmp_path.iterdir()) == before
        return
    assert code == 0
    if READERS[name] is None:
        return
    mesh = open_mesh(given).mesh
    cells = np.concatenate([block.vertices for block in mesh.cells if block.type == "tetra"])
    options = SmoothOptions(stopping=Stopping(max_iterations=2), keep_height=False)
    expected, _ = smooth_mesh(mesh, options)
    points, read = READERS[name](out)
    assert len(read) == len(cells)
    np.testing.assert_allclose(shapes(points, read), shapes(expected, cells), rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["netgen", "vtk", "vtu", "avsucd", "exodus"])
def test_what_is_lost_is_named(source, tmp_path, capfd, name):
    out = tmp_path / f"out{format_named(name).suffixes[0]}"
    main(["smooth", str(source), str(out), "--output-format", name, "--no-report", "--max-iterations", "0"])
    err = capfd.readouterr().err
    back = open_mesh(out, name).mesh
    if "temperature" not in back.point_data:
        assert "not kept: 1 point field (temperature)" in err
    if not {"steel", "rubber"} <= {*back.field_data, *back.cell_sets}:
        assert re.search(r"not kept: [1-3] (group names?|cell sets?) \(", err)


def test_gmsh_finds_groups_and_field_of_a_converted_mesh(source, tmp_path):
    between, out = tmp_path / "between.vtu", tmp_path / "out.msh"
    for one, other in ((source, between), (between, out)):
        assert main(["smooth", str(one), str(other), "--no-report", "--max-iterations", "0"]) == 0
    mesh = open_mesh(source).mesh
    with gmsh_session() as gmsh:
        gmsh.open(str(out))
        assert set(gmsh.model.getPhysicalGroups(3)) == {(3, 4), (3, 5)}
        (view,) = (tag for tag in gmsh.view.getTags() if _name(gmsh, tag) == "temperature")
        kind, tags, values, _, _ = gmsh.view.getModelData(view, 0)
    assert kind == "NodeData"
    assert np.array_equal(tags, np.arange(1, len(mesh.points) + 1))
    assert np.array_equal(np.ravel(values), mesh.point_data["temperature"].ravel())


def _name(gmsh, tag: int) -> str:
    return gmsh.option.getString(f"View[{gmsh.view.getIndex(tag)}].Name")


@pytest.mark.parametrize(
    ("name", "reader"), [("ply", "vtkPLYReader"), ("obj", "vtkOBJReader"), ("tecplot", "vtkTecplotReader")]
)
def test_a_surface_converts_as_vtk_reads_it(tmp_path, name, reader):
    require("vtk")
    from vtkmodules import all as vtk
    from vtkmodules.util.numpy_support import vtk_to_numpy

    rng = np.random.default_rng(2)
    x, y = (a.ravel() for a in np.meshgrid(np.arange(6.0), np.arange(5.0)))
    points = np.column_stack([x + 0.1 * rng.random(30), y, 0.2 * rng.random(30)])
    first = (np.arange(5) + 6 * np.arange(4)[:, None]).ravel()
    triangles = np.concatenate(
        [np.stack([first, first + 1, first + 7], 1), np.stack([first, first + 7, first + 6], 1)]
    )
    given, out = tmp_path / "in.vtu", tmp_path / f"out{format_named(name).suffixes[0]}"
    data = {"height": points[:, 2]} if name == "tecplot" else {}
    meshio.write(given, meshio.Mesh(points, {"triangle": triangles}, point_data=data))
    options = ["--output-format", name, "--no-report", "--max-iterations", "0"]
    assert main(["smooth", str(given), str(out), *options]) == 0
    reading = getattr(vtk, reader)()
    reading.SetFileName(str(out))
    reading.Update()
    grid = reading.GetOutput()
    while grid.IsA("vtkMultiBlockDataSet"):
        grid = grid.GetBlock(0)
    cells = [[grid.GetCell(i).GetPointId(k) for k in range(3)] for i in range(grid.GetNumberOfCells())]
    assert np.array_equal(cells, triangles)
    np.testing.assert_allclose(vtk_to_numpy(grid.GetPoints().GetData()), points, rtol=0, atol=1e-6)
    if data:
        height = vtk_to_numpy(grid.GetPointData().GetArray("height"))
        np.testing.assert_allclose(height, points[:, 2], atol=1e-6)


def test_fields_on_cells_of_several_kinds_reach_gmsh(tmp_path):
    """meshio writes them rightly, but cannot read them back itself."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0.0]])
    cells = [("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 4, 2]]), ("vertex", [[0], [4]])]
    given, made = tmp_path / "given.vtu", tmp_path / "made.msh"
    meshio.write(given, meshio.Mesh(points, cells, cell_data={"part": [[3], [4], [5, 6]]}))
    assert main(["smooth", str(given), str(made), "--no-report", "--max-iterations", "0"]) == 0
    with opened_by_gmsh(made) as (gmsh, _, found):
        assert found.tolist() == points.tolist()
        assert [len(gmsh.model.mesh.getElementsByType(kind)[0]) for kind in (3, 2, 15)] == [1, 1, 2]
        (view,) = gmsh.view.getTags()
        assert np.ravel(gmsh.view.getModelData(view, 0)[2]).tolist() == [3, 4, 5, 6]


def test_what_meshio_writes_so_that_it_cannot_be_read_is_refused(tmp_path, capfd):
    """Families of MED have negative numbers, which Netgen's counts of names cannot be."""
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    mesh = meshio.Mesh(points, [("triangle", [[0, 1, 2], [0, 2, 3]])], cell_data={"cell_tags": [[-2, -3]]})
    mesh.cell_tags = {-2: ["left"], -3: ["right"]}
    given, made = tmp_path / "given.med", tmp_path / "made.vol"
    meshio.write(given, mesh)
    assert main(["smooth", str(given), str(made), "--no-report", "--max-iterations", "0"]) == 4
    assert "meshio writes this mesh as netgen wrongly" in capfd.readouterr().err
    assert not made.exists()


@pytest.mark.parametrize("mixed", [True, False])
def test_ply_has_the_fields_of_faces_in_types_that_others_read(tmp_path, capfd, mixed):
    trimesh = require("trimesh")
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0.5]])
    second = ("quad", [[0, 1, 2, 3]]) if mixed else ("triangle", [[0, 1, 2]])
    cells = [("triangle", [[1, 4, 2]]), second, ("line", [[0, 1]])]
    data = {"part": [[3], [4], [0]], "far": [[1 << 40], [5], [6]]}
    given, made = tmp_path / "given.vtu", tmp_path / "made.ply"
    meshio.write(given, meshio.Mesh(np.pad(points, ((0, 0), (0, 1))), cells, cell_data=data))
    assert main(["smooth", str(given), str(made), "--no-report", "--max-iterations", "0"]) == 0
    said = capfd.readouterr().err
    assert "not kept: 1 cell field (far)" in said
    assert "1 cell of type vertex or line" in said
    loaded = trimesh.load(made, process=False)
    assert loaded.vertices[:, :2].tolist() == points.tolist()
    assert loaded.faces[0].tolist() == [1, 4, 2]
    assert len(loaded.faces) == 2 + mixed  # trimesh divides the quadrilateral
    parts = open_mesh(made).mesh.cell_data["part"]
    assert np.concatenate(parts).tolist() == [3, 4]
