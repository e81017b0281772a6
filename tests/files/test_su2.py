"""SU2 meshes: as Gmsh writes them, by hand what else the format has; meshio reads them as far as it can."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from dvr_cli.errors import InputError, OutputError
from dvr_cli.files.formats import format_of
from dvr_cli.files.reading import open_mesh
from dvr_cli.files.su2 import read
from dvr_cli.files.su2.convert import convert
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.groups import group_vertices
from dvr_cli.mesh.mesh import Cells, Mesh
from fuzz import COUNTS, check_damaged
from gmsh_cad import into_hexahedra
from gmsh_session import gmsh_session
from needs import require
from sources import cells_of, written

# Triangles and quads, a square with one vertex inside.
HYBRID = b"""% a comment = with a sign
 NDIME = 2
ndime= 2   % twice does no harm
NELEM= 3
9 0 1 4 3 0

5\t1 2 4 1   % the next one has no number
5 2 3 4
NPOIN= 5 5
0.0 0.0 0
2.e0 0 1
  2 2 2
0\t2 3
0.75 1.25
NMARK= 2
MARKER_TAG= lower
MARKER_ELEMS= 1
3 0 1
MARKER_TAG= far field
MARKER_ELEMS= 3
3 1 2
3 2 3 1
3 3 0
FFD_NBOX= 1
FFD_TAG= MAIN
FFD_CORNER_POINTS= 4
-1 -1
3 -1
3 3
-1 3
FFD_SURFACE_POINTS= 1
lower 1 0.75 0.25 0.0
"""

ZONES = b"""NZONE= 2
IZONE= 1
NDIME= 2
NELEM= 4
5 0 1 4
5 1 2 4
5 2 3 4
5 3 0 4
NPOIN= 5
0 0
1 0
1 1
0 1
0.4 0.45
NMARK= 1
MARKER_TAG= wall
MARKER_ELEMS= 1
3 0 1
IZONE= 2
NDIME= 2
NPOIN= 3
1 0
2 0
2 1
NELEM= 1
5 0 1 2
NMARK= 2
MARKER_TAG= wall
MARKER_ELEMS= 1
3 0 1
MARKER_TAG= SEND_RECEIVE
MARKER_ELEMS= 2
SEND_TO= 1
1 0 0
1 2 0
"""

SOLID = b"""NDIME= 3
NPOIN= 9
0 0 0
1 0 0
1 1 0
0 1 0
0 0 1
1 0 1
1 1 1
0 1 1
.5 .5 1.75
NELEM= 2
12 0 1 2 3 4 5 6 7 0
14 4 5 6 7 8 1
NMARK= 1
MARKER_TAG= floor
MARKER_ELEMS= 1
9 0 1 2 3
"""
FILES = {"hybrid": HYBRID, "zones": ZONES, "solid": SOLID}


def read_by_meshio(data: bytes) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """What meshio's own reader finds: coordinates, and the cells of each type."""
    meshio = require("meshio")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.su2"
        path.write_bytes(data)
        mesh = meshio.read(path)
    cells: dict[str, list[np.ndarray]] = {}
    for block in mesh.cells:
        cells.setdefault(block.type, []).append(block.data)
    return mesh.points, {name: np.concatenate(parts) for name, parts in cells.items()}


def markers_in(data: bytes) -> dict[str, set[int]]:
    """The nodes of each marker, found line by line as SU2's own reader goes; meshio loses the names."""
    lines = iter(data.decode().splitlines())
    markers: dict[str, set[int]] = {}
    for line in lines:
        if line.startswith("MARKER_TAG="):
            nodes = markers.setdefault(line.split("=")[1].strip(), set())
            for _ in range(int(next(lines).removeprefix("MARKER_ELEMS="))):
                kind, *numbers = map(int, next(lines).split())
                nodes.update(numbers[: {3: 2, 5: 3, 9: 4, 22: 6, 23: 8}[kind]])
    return markers


def test_points_cells_and_markers():
    source = read(HYBRID)
    mesh = source.mesh
    assert mesh.points.tolist() == [[0, 0], [2, 0], [2, 2], [0, 2], [0.75, 1.25]]
    assert cells_of(mesh) == [
        ("triangle", [[1, 2, 4], [2, 3, 4]]),
        ("quad", [[0, 1, 4, 3]]),
        ("line", [[0, 1], [1, 2], [2, 3], [3, 0]]),
        ("vertex", [[1]]),
    ]
    assert [tags.tolist() for tags in mesh.cell_data["su2:marker"]] == [[0, 0], [0], [1, 2, 2, 2], [0]]
    assert {name: pair.tolist() for name, pair in mesh.field_data.items()} == {
        "lower": [1, 1],
        "far field": [2, 1],
    }
    assert np.flatnonzero(group_vertices(mesh, "lower")).tolist() == [0, 1]
    assert source.unread == [
        "not kept: 4 kinds of statement (FFD_CORNER_POINTS, FFD_NBOX, FFD_SURFACE_POINTS, FFD_TAG)"
    ]
    assert np.flatnonzero(domain_of(mesh).interior).tolist() == [4]


def test_zones_are_one_mesh():
    mesh = read(ZONES).mesh
    assert len(mesh.points) == 8
    assert cells_of(mesh) == [
        ("triangle", [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [5, 6, 7]]),
        ("vertex", [[5], [7]]),
        ("line", [[0, 1], [5, 6]]),
    ]
    assert mesh.cell_data["su2:zone"][0].tolist() == [1, 1, 1, 1, 2]
    assert mesh.cell_data["su2:marker"][2].tolist() == [1, 1]


def test_solids():
    mesh = read(SOLID).mesh
    assert [name for name, _ in cells_of(mesh)] == ["hexahedron", "pyramid", "quad"]
    assert "su2:zone" not in mesh.cell_data


@pytest.mark.parametrize("line_end", [b"\n", b"\r\n", b"\r"])
@pytest.mark.parametrize("name", FILES)
def test_unmoved_is_identical(name, line_end):
    data = FILES[name].replace(b"\n", line_end)
    source = read(data)
    assert written(source, source.mesh.points.copy()) == data


def test_moved_differs_in_coordinates_only():
    source = read(HYBRID)
    points = source.mesh.points.copy()
    points[4] = 1 / 3, 1e-17
    points[1, 0] = 2.5
    out = written(source, points)
    assert out == HYBRID.replace(b"0.75 1.25", b"0.3333333333333333 1e-17").replace(b"2.e0 0 1", b"2.5 0 1")
    assert read(out).mesh.points.tolist() == points.tolist() == source.stored(points).tolist()


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("hexahedra", [False, True])
def test_files_by_gmsh(hexahedra, order, tmp_path):
    gmsh = require("gmsh")
    with gmsh_session(Mesh_SecondOrderIncomplete=1, Mesh_MeshSizeMin=0.9):
        box = gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [box], 1, "body")
        gmsh.model.addPhysicalGroup(2, [1, 3], 2, "walls")
        gmsh.model.addPhysicalGroup(2, [2], 3, "outlet")
        if hexahedra:
            into_hexahedra(gmsh, box)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(tmp_path / "x.su2"))
        gmsh.write(str(tmp_path / "x.msh"))
    data = (tmp_path / "x.su2").read_bytes()
    own = open_mesh(tmp_path / "x.msh").mesh
    source = read(data)
    mesh = source.mesh
    assert written(source, mesh.points.copy()) == data
    assert np.abs(mesh.points - own.points).max() < 1e-15
    volume = [block for block in own.cells if block.type == mesh.cells[0].type]
    assert mesh.cells[0].vertices.tolist() == volume[0].vertices.tolist()
    for name in ("walls", "outlet"):
        assert (group_vertices(mesh, name) == group_vertices(own, name)).all()
    points = mesh.points + 0.125
    out = written(source, points)
    for name, nodes in markers_in(out).items():
        assert nodes == set(np.flatnonzero(group_vertices(own, name)).tolist())
    if order == 1:
        theirs, cells = read_by_meshio(out)
        assert np.array_equal(theirs, points)
        assert cells[mesh.cells[0].type].tolist() == mesh.cells[0].vertices.tolist()


def test_zones_and_markers_do_not_move():
    for data, inside in ((ZONES, [4]), (HYBRID, [4]), (SOLID, [])):
        assert np.flatnonzero(domain_of(read(data).mesh).interior).tolist() == inside


class TestConversion:
    def mesh(self, z=0.0):
        points = np.array([[0, 0, z], [2, 0, z], [2, 2, z], [0, 2, z], [0.75, 1.25, z]])
        cells = [
            Cells("triangle", np.array([[1, 2, 4], [2, 3, 4]])),
            Cells("quad", np.array([[0, 1, 4, 3]])),
            Cells("line", np.array([[0, 1], [1, 2], [2, 3], [3, 0]])),
            Cells("vertex", np.array([[4]])),
        ]
        tags = [np.array([7, 8]), np.array([7]), np.array([1, 1, 2, 5]), np.array([0])]
        return Mesh(
            points,
            cells,
            {"gmsh:physical": tags},
            {"h": np.zeros(5)},
            {"lower wall": np.array([1, 1]), "inside": np.array([7, 2])},
            {"side": [np.array([], int), np.array([], int), np.array([2]), np.array([], int)]},
        )

    def test_markers_come_from_groups(self):
        mesh = self.mesh()
        source = convert(mesh, ["its drawing is not kept"])
        points = mesh.points + np.array([1 / 3, 0.5, 0.0])
        assert source.stored(points).tolist() == points.tolist()
        assert source.notes == [
            "its drawing is not kept",
            "not kept: 1 cell of dimension below 1",
            "not kept: 1 group name (inside)",
            "not kept: 1 cell field (gmsh:physical)",
            "not kept: 1 point field (h)",
        ]
        out = written(source, points)
        back = read(out).mesh
        assert back.points.tolist() == points[:, :2].tolist()
        assert cells_of(back) == cells_of(mesh)[:3]
        markers = {name: np.flatnonzero(group_vertices(back, name)).tolist() for name in back.field_data}
        assert markers == {"lower_wall": [0, 1, 2], "side": [2, 3], "marker_5": [0, 3]}
        assert markers_in(out) == {"lower_wall": {0, 1, 2}, "side": {2, 3}, "marker_5": {0, 3}}
        theirs, cells = read_by_meshio(out)
        assert np.array_equal(theirs, points[:, :2])
        assert {name: rows.tolist() for name, rows in cells.items()} == {
            block.type: block.vertices.tolist() for block in mesh.cells[:3]
        }

    def test_side_sets_are_markers(self):
        mesh = self.mesh()
        mesh.cells, mesh.cell_data, mesh.cell_sets, mesh.field_data = mesh.cells[:2], {}, {}, {}
        mesh.facet_sets = {"inlet": np.array([[0, 1], [3, 0]])}
        back = read(written(convert(mesh, []), mesh.points)).mesh
        assert cells_of(back)[2:] == [("line", [[0, 1], [3, 0]])]
        assert list(back.field_data) == ["inlet"]

    def test_a_third_coordinate_is_named(self):
        source = convert(self.mesh(z=2.5), [])
        source.stored(source.mesh.points)
        assert "the third coordinate, 2.5, is not kept" in source.notes

    @pytest.mark.parametrize(
        ("cell_type", "z", "words"),
        [("triangle", 1.0, "no surfaces in space"), ("polygon", 0.0, "no cells of type polygon")],
    )
    def test_refused_with_one_line_that_says_why(self, cell_type, z, words):
        points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, z]], dtype=float)
        with pytest.raises(OutputError, match=words):
            convert(Mesh(points, [Cells(cell_type, np.array([[0, 1, 2]]))]), [])

    def test_second_order_is_refused(self):
        points = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
        with pytest.raises(OutputError, match="triangle6"):
            convert(Mesh(points, [Cells("triangle6", np.array([[0, 1, 2, 3, 4, 5]]))]), [])


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"hello\n", "no statements"),
        (b"NDIME= 2\n", "NPOIN is missing"),
        (HYBRID.replace(b"NDIME = 2", b"NDIME = 4"), "line 2: NDIME is 4"),
        (HYBRID.replace(b"NELEM= 3", b"NELEM= 4"), "line 4: NELEM declares 4 rows, but 3 follow"),
        (HYBRID.replace(b"NELEM= 3", b"NELEM= x"), "line 4: NELEM needs a whole number, not 'x'"),
        (HYBRID.replace(b"NPOIN= 5", b"NPOIN= 999999999999"), "declares 999999999999 rows, but 5 follow"),
        (HYBRID.replace(b"NPOIN= 5", b"NPOIN= -5"), "NPOIN needs a whole number"),
        (HYBRID.replace(b"9 0 1 4 3 0", b"99 0 1 4 3 0"), "line 5: cell type 99 is not known"),
        (
            HYBRID.replace(b"9 0 1 4 3 0", b"209 0 1 4 3 0"),
            "cell type 209 is a quad of order 3, which is not",
        ),
        (HYBRID.replace(b"9 0 1 4 3 0", b"9 0 1 4"), "line 5: a quad needs 4 nodes"),
        (HYBRID.replace(b"9 0 1 4 3 0", b"9 0 1 4 5 0"), "a quad names point 5, but there are 5"),
        (HYBRID.replace(b"9 0 1 4 3 0", b"9 0 1 4.5 3 0"), "line 5: not numbers"),
        (HYBRID.replace(b"0.75 1.25", b"0.75"), "a point needs 2 coordinates"),
        (HYBRID.replace(b"0.75 1.25", b"0.75 x"), "line 14: not numbers"),
        (HYBRID.replace(b"NMARK= 2", b"NMARK= 3"), "NMARK declares 1 markers more"),
        (HYBRID.replace(b"NMARK= 2", b"NMARK= 1"), "NMARK declares 1 markers fewer"),
        (HYBRID[: HYBRID.index(b"3 1 2\n")], "the elements of the last marker are missing"),
        (HYBRID.replace(b"MARKER_TAG= lower\n", b""), "MARKER_ELEMS without a MARKER_TAG"),
        (HYBRID.replace(b"FFD_NBOX= 1", b"FFD?NBOX= 1"), "is no keyword"),
        (ZONES.replace(b"NZONE= 2", b"NZONE= 3"), "NZONE declares 3 zones, but the file has 2"),
        (ZONES.replace(b"IZONE= 2\n", b""), "NPOIN a second time"),
        (ZONES.replace(b"SEND_TO= 1\n1 0 0\n", b"SEND_TO= 1\n"), "declares 2 rows, but 1 follow"),
    ],
)
def test_refused_with_one_line_that_says_why(data, words):
    with pytest.raises(InputError) as caught:
        read(data)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


def test_files_that_break_off_are_refused():
    """A square of two triangles, its rows without numbers of their own."""
    mesh = b"NDIME= 2\nNELEM= 2\n5 0 1 2\n5 0 2 3\nNPOIN= 4\n0.0 0.0\n1.0 0.0\n1.25 1.25\n0.0 1.25\n"
    marks = b"NMARK= 2\nMARKER_TAG= low\nMARKER_ELEMS= 1\n3 0 1\nMARKER_TAG= top\nMARKER_ELEMS= 1\n3 2 3\n"
    whole = read(mesh + marks).mesh
    for cut in range(1, len(mesh)):
        with pytest.raises(InputError):
            read(mesh[:cut])
    assert read(mesh).mesh.points.tolist() == whole.points.tolist()
    with pytest.raises(InputError, match="it breaks off within a row of NPOIN: truncated"):
        read(mesh[:-2])
    with pytest.raises(InputError, match="it breaks off within a row of MARKER_ELEMS: truncated"):
        read((mesh + marks)[:-1])
    with pytest.raises(InputError, match="the marker 'top' has no MARKER_ELEMS: truncated"):
        read((mesh + marks)[: -len(b"MARKER_ELEMS= 1\n3 2 3\n")])


def test_content_tells_it():
    for data in (HYBRID, ZONES, SOLID):
        assert format_of(Path("-"), data).name == "su2"


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(count):
    check_damaged(list(FILES.values()), count, 31, read, least=0.05, exact=True)
