"""UCD files, by hand, as no program that writes them is at hand; VTK reads them, and the output."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dvr_cli.errors import InputError, OutputError
from dvr_cli.files.avsucd import convert, read
from dvr_cli.files.formats import format_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.regions import region_names
from fuzz import COUNTS, check_damaged
from needs import require
from sources import cells_of, written

# Two materials on either side of the nodes 2, 15 and 3; the nodes 5 and 15 would like to move.
_PLANE = b"""# a comment, 1 2 3
 # another
9 9 2  1 0
1 0 0 0
2 2 0 0
3 2. 2 0
4  0 2 0
5 0.75 1.25 0
6\t4 0 0
7 4 2 0
P 2 0.8 0
Q 3.25 1.25 0
1 1 tri 1 2 5
2 1 TRI 2 P 5
3 1 Tri P 3 5
4 1 tri 3 4 5
5 1 tri 4 1 5
6 2 quad 2 6 Q P
7 2 quad P Q 7 3
8 2 tri 6 7 Q
9 7 line 1 2
2 1 1
temperature, K
 load # 1, N
1 1 -1
2 2 -2
3 3 -3
P 9 -9
4 4 -4
5 5 -5
6 6 -6
7 7 -7
Q 8 -8
1 1
number, none
9 90
1 10
2 20
3 30
4 40
5 50
6 60
7 70
8 80
"""
PLANE = _PLANE.replace(b"P", b"15").replace(b"Q", b"8")
# VTK takes ids for places, and types in lower case only
ORDERED = _PLANE.replace(b"P", b"8").replace(b"Q", b"9").replace(b"TRI", b"tri").replace(b"Tri", b"tri")
SOLID = b"""10 5 0 0 0
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 0 0 1
6 1 0 1
7 1 1 1
8 0 1 1
9 0.5 .5 1.5
10 2 0 0
1 3 hex 1 2 3 4 5 6 7 8
2 3 pyr 9 5 6 7 8
3 4 prism 1 2 4 5 6 8
4 5 tet 2 10 3 6
5 6 pt 9
"""
FILES = {"plane": PLANE, "solid": SOLID}


def read_by_vtk(path: Path) -> tuple[np.ndarray, list[tuple[str, list[int]]], dict, dict]:
    """Points, cells in the order of the file, and data of points and cells."""
    require("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOGeometry import vtkAVSucdReader

    reader = vtkAVSucdReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    cells = []
    for i in range(grid.GetNumberOfCells()):
        cell = grid.GetCell(i)
        nodes = [cell.GetPointId(j) for j in range(cell.GetNumberOfPoints())]
        cells.append((cell.GetClassName().removeprefix("vtk").lower(), nodes))
    arrays = [
        {part.GetArrayName(i): vtk_to_numpy(part.GetArray(i)) for i in range(part.GetNumberOfArrays())}
        for part in (grid.GetPointData(), grid.GetCellData())
    ]
    return vtk_to_numpy(grid.GetPoints().GetData()), cells, *arrays


def test_points_cells_materials_and_data():
    source = read(PLANE)
    mesh = source.mesh
    assert mesh.points[7].tolist() == [2, 0.8, 0]
    assert cells_of(mesh) == [
        ("line", [[0, 1]]),
        ("triangle", [[0, 1, 4], [1, 7, 4], [7, 2, 4], [2, 3, 4], [3, 0, 4], [5, 6, 8]]),
        ("quad", [[1, 5, 8, 7], [7, 8, 6, 2]]),
    ]
    assert [tags.tolist() for tags in mesh.cell_data["avsucd:material"]] == [[7], [1, 1, 1, 1, 1, 2], [2, 2]]
    assert [values.tolist() for values in mesh.cell_data["number"]] == [
        [90],
        [10, 20, 30, 40, 50, 80],
        [60, 70],
    ]
    assert mesh.point_data["temperature"].tolist() == [1, 2, 3, 4, 5, 6, 7, 9, 8]
    assert mesh.point_data["load # 1"].tolist() == [-1, -2, -3, -4, -5, -6, -7, -9, -8]
    assert source.unread == []


def test_interfaces_between_materials_stay():
    mesh = read(PLANE).mesh
    assert region_names(mesh) == ["avsucd:material"]
    assert np.flatnonzero(domain_of(mesh).interior).tolist() == [4, 8]
    one = read(PLANE.replace(b" 2 quad", b" 1 quad").replace(b" 2 tri", b" 1 tri")).mesh
    assert np.flatnonzero(domain_of(one).interior).tolist() == [4, 7, 8]


def test_numbers_of_cells_may_repeat_where_no_data_go_by_them():
    """deal.II counts the cells of each dimension anew, and reads such files."""
    text = b"4 3 0 0 0\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n1 7 quad 1 2 3 4\n1 5 line 1 2\n2 5 line 2 3\n"
    assert cells_of(read(text).mesh) == [("line", [[0, 1], [1, 2]]), ("quad", [[0, 1, 2, 3]])]


@pytest.mark.parametrize("data", [ORDERED, SOLID])
def test_vtk_reads_the_same(data, tmp_path):
    source = read(data)
    mesh = source.mesh
    points = mesh.points + 1 / 3
    path = tmp_path / "x.avs"
    path.write_bytes(written(source, points))
    theirs, cells, on_points, on_cells = read_by_vtk(path)
    assert np.array_equal(theirs, points.astype(np.float32))
    assert sorted(cells) == sorted(
        (block.type, row) for block in mesh.cells for row in block.vertices.tolist()
    )
    materials = np.concatenate(mesh.cell_data["avsucd:material"])
    assert sorted(on_cells["Material Id"].tolist()) == sorted(materials.tolist())
    on_points = {name.strip(): values for name, values in on_points.items()}
    assert on_points.keys() == mesh.point_data.keys()
    for name, values in mesh.point_data.items():
        assert np.array_equal(on_points[name], values)


@pytest.mark.parametrize("line_end", [b"\n", b"\r\n", b"\r"])
@pytest.mark.parametrize("name", FILES)
def test_unmoved_is_identical(name, line_end):
    data = FILES[name].replace(b"\n", line_end)
    source = read(data)
    assert cells_of(source.mesh) == cells_of(read(FILES[name]).mesh)
    assert written(source, source.mesh.points.copy()) == data


def test_moved_differs_in_coordinates_only():
    source = read(PLANE)
    points = source.mesh.points.copy()
    points[4, :2] = 1 / 3, 1e-17
    points[2, 0] = 2.5
    out = written(source, points)
    assert out == PLANE.replace(b"0.75 1.25", b"0.3333333333333333 1e-17").replace(b"3 2. 2 0", b"3 2.5 2 0")
    assert read(out).mesh.points.tolist() == points.tolist() == source.stored(points).tolist()


class TestConversion:
    def mesh(self):
        cells = [
            Cells("hexahedron", np.arange(8)[None]),
            Cells("pyramid", np.array([[4, 5, 6, 7, 8]])),
            Cells("wedge", np.array([[0, 1, 3, 4, 5, 7]])),
        ]
        points = read(SOLID).mesh.points[:9]
        data = {"gmsh:physical": [np.array([5]), np.array([6]), np.array([5])], "q": [np.array([0.5])] * 3}
        return Mesh(
            points, cells, data, {"h": np.arange(9.0), "a,b": np.zeros(9)}, {"body": np.array([5, 3])}
        )

    def test_vtk_opens_it(self, tmp_path):
        mesh = self.mesh()
        source = convert(mesh, ["its drawing is not kept"])
        points = mesh.points + 0.25
        assert source.stored(points).tolist() == points.tolist()
        assert source.notes == [
            "its drawing is not kept",
            "the order of the cells is not kept",
            "not kept: 1 point field (a,b)",
            "not kept: 1 cell field (gmsh:physical)",
            "not kept: 1 group name (body)",
        ]
        out = written(source, points)
        back = read(out).mesh
        assert dict(cells_of(back)) == dict(cells_of(mesh))
        path = tmp_path / "x.avs"
        path.write_bytes(out)
        theirs, cells, on_points, on_cells = read_by_vtk(path)
        assert np.array_equal(theirs, points.astype(np.float32))
        assert cells == [(block.type, block.vertices[0].tolist()) for block in mesh.cells]
        assert on_points["h"].tolist() == mesh.point_data["h"].tolist()
        assert on_cells["q"].tolist() == [0.5] * 3
        assert on_cells["Material Id"].tolist() == [5, 6, 5]

    def test_what_it_cannot_hold_is_refused(self):
        with pytest.raises(OutputError, match="triangle6"):
            convert(Mesh(np.zeros((6, 3)), [Cells("triangle6", np.arange(6)[None])]), [])


def test_content_tells_it_from_an_abaqus_deck():
    for data in FILES.values():
        assert format_of(Path("x.inp"), data).name == "avsucd"
        assert format_of(Path("-"), data).name == "avsucd"
    assert format_of(Path("x.inp"), b"*NODE\n1, 0, 0, 0\n").name == "abaqus"
    assert format_of(Path("x.inp"), b"** comment\n*Heading\n").name == "abaqus"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\x07\0\0\0\1", "binary UCD files are not supported"),
        (b"hello\n", "does not begin with five counts"),
        (SOLID.replace(b"10 5 0", b"999999999999 5 0"), "999999999999 lines, one for each node"),
        (SOLID.replace(b"10 5 0", b"0 5 0"), "it has no nodes"),
        (SOLID.replace(b"10 5 0", b"10 4 0"), "line 16: there is more than the first line says"),
        (SOLID.replace(b"10 5 0", b"10 6 0"), "6 lines, one for each cell"),
        (SOLID.replace(b"0.5 .5 1.5", b"0.5 x 1.5"), "line 10: not numbers"),
        (SOLID.replace(b"0.5 .5 1.5", b"0.5 .5"), "line 10: 4 numbers are needed for a node"),
        (SOLID.replace(b"0.5 .5 1.5", b"0.5 .5 1 1"), "line 10: a node has an id and three"),
        (SOLID.replace(b"9 0.5 .5", b"8 0.5 .5"), "there are two nodes 8"),
        (SOLID.replace(b"9 0.5 .5", b"8.5 0.5 .5"), "ids of nodes are whole numbers"),
        (SOLID.replace(b"prism", b"wedge"), "line 14: 'wedge' is no cell type"),
        (SOLID.replace(b"tet 2 10", b"tet 2"), "line 15: a cell tet has 4 nodes"),
        (SOLID.replace(b"tet 2 10", b"tet 2 11"), "line 15: there is no node 11"),
        (SOLID.replace(b"tet 2 10", b"tet 2 1.5"), "line 15: not numbers"),
        (PLANE.replace(b"3 1 Tri", b"4 1 Tri"), "there are two cells 4"),
        (PLANE.replace(b"\n3 30", b"\n4 30"), "there are two cells 4"),
        (SOLID.replace(b"10 5 0", b"10 5 1"), "sizes of the data of nodes"),
        (PLANE.replace(b"2 1 1\n", b"2 1 2\n"), "sizes of the data of nodes should follow, 2 numbers"),
        (PLANE.replace(b"15 9 -9", b"16 9 -9"), "there is no such node"),
        (PLANE.replace(b"15 9 -9", b"15 9"), "3 numbers are needed for a node"),
        (PLANE[: PLANE.index(b"number,")], "labels of the data of cells are missing"),
    ],
)
def test_refused_with_one_line_that_says_why(data, words):
    with pytest.raises(InputError) as caught:
        read(data)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(count):
    check_damaged(list(FILES.values()), count, 47, read, least=0.02, exact=True)
