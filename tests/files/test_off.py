"""OFF files: as Gmsh and trimesh write them, by hand what else the format has; both read what is written."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from dvr_cli.errors import InputError, OutputError
from dvr_cli.files.formats import format_of
from dvr_cli.files.off import convert, read
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from fuzz import COUNTS, check_damaged
from gmsh_session import gmsh_session, opened_by_gmsh
from needs import require
from sources import cells_of, written

POINTS = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [0.75, 1.25, 0], [3, 1, 0]]
TEXT = b"""# a comment
  OFF   # another
6
 4 0
0 0 0
  2.e0 0 0

2 2 0 # here, too
0 2 0
0.75 1.25 0
3\t1 0
3 0 1 4  255 0 0
4 1 2 3 4
  3 3 0 4 0.5 0.5 0.5 1
3 1 5 2
"""
COLOURED = b"""STCNOFF 3 1 3
0 0 0  0 0 1  1 0 0 1  .5 .5
1 0 0  0 0 1  1 0 0 1  .5 .5
0 1 0  0 0 1  1 0 0 1  .5 .5
3 0 1 2
"""
BARE = b"3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
MANY = b"OFF\n6 3 0\n0 0 0\n1 0 0\n2 1 0\n1 2 0\n0 1 0\n.5 .5 0\n5 0 1 2 3 4\n1 5\n2 0 5\n"
BINARY = b"COFF BINARY\n" + struct.pack(">3i", 6, 3, 0)
BINARY += b"".join(struct.pack(">7f", *point, 1, 0, 0, 1) for point in POINTS)
BINARY += struct.pack(">4ii3f", 3, 0, 1, 4, 3, 1, 0, 0)
BINARY += struct.pack(">5ii", 4, 1, 2, 3, 4, 0) + struct.pack(">4ii", 3, 3, 0, 4, 0)
FILES = {"text": TEXT, "coloured": COLOURED, "bare": BARE, "many": MANY, "binary": BINARY}


def read_by_gmsh(path: Path) -> tuple[np.ndarray, list[list[int]]]:
    """Coordinates, and triangles and quads with nodes counted from 0."""
    with opened_by_gmsh(path) as (gmsh, tags, points):
        faces = []
        for kind, size in ((2, 3), (3, 4)):
            nodes = gmsh.model.mesh.getElementsByType(kind)[1]
            faces += (nodes.reshape(-1, size).astype(int) - int(tags[0])).tolist()
        return points, faces


def test_points_and_faces():
    source = read(TEXT)
    assert source.mesh.points.tolist() == POINTS
    assert cells_of(source.mesh) == [
        ("triangle", [[0, 1, 4], [3, 0, 4], [1, 5, 2]]),
        ("quad", [[1, 2, 3, 4]]),
    ]
    assert source.unread == ["not kept: colours"]
    assert np.flatnonzero(domain_of(source.mesh).interior).tolist() == [4]


def test_other_headers():
    source = read(COLOURED)
    assert cells_of(source.mesh) == [("triangle", [[0, 1, 2]])]
    assert source.unread == ["not kept: texture coordinates, colours, normals"]
    assert cells_of(read(BARE).mesh) == [("triangle", [[0, 1, 2]])]
    assert cells_of(read(MANY).mesh) == [
        ("vertex", [[5]]),
        ("line", [[0, 5]]),
        ("polygon", [[0, 1, 2, 3, 4]]),
    ]


def test_binary():
    source = read(BINARY)
    assert source.mesh.points.tolist() == POINTS
    assert cells_of(source.mesh) == [("triangle", [[0, 1, 4], [3, 0, 4]]), ("quad", [[1, 2, 3, 4]])]
    assert source.unread == ["not kept: colours"]
    points = source.mesh.points.copy()
    points[4, 1] = 1 / 3
    before, after = (struct.pack(">7f", 0.75, y, 0, 1, 0, 0, 1) for y in (1.25, 1 / 3))
    assert written(source, points) == BINARY.replace(before, after)
    assert read(written(source, points)).mesh.points.tolist() == source.stored(points).tolist()
    assert source.stored(points)[4, 1] == np.float32(1 / 3)
    assert source.widened() is None


@pytest.mark.parametrize("line_end", [b"\n", b"\r\n", b"\r"])
@pytest.mark.parametrize("name", FILES)
def test_unmoved_is_identical(name, line_end):
    data = FILES[name] if name == "binary" else FILES[name].replace(b"\n", line_end)
    source = read(data)
    assert written(source, source.mesh.points.copy()) == data


def test_moved_differs_in_coordinates_only():
    source = read(TEXT)
    points = source.mesh.points.copy()
    points[4, :2] = 1 / 3, 1e-17
    points[1, 0] = 2.5
    out = written(source, points)
    assert out == TEXT.replace(b"0.75 1.25", b"0.3333333333333333 1e-17").replace(b"2.e0 0 0", b"2.5 0 0")
    assert read(out).mesh.points.tolist() == points.tolist() == source.stored(points).tolist()


def test_files_by_trimesh(tmp_path):
    trimesh = require("trimesh")
    ball = trimesh.creation.icosphere(1)
    data = ball.export(file_type="off").encode()
    source = read(data)
    assert source.mesh.cells[0].vertices.tolist() == ball.faces.tolist()
    points = source.mesh.points * 0.3
    path = tmp_path / "ball.off"
    path.write_bytes(written(source, points))
    again = trimesh.load(path, process=False)
    assert np.array_equal(again.vertices, points)
    assert again.faces.tolist() == ball.faces.tolist()


def test_files_by_gmsh(tmp_path):
    gmsh = require("gmsh")
    path = tmp_path / "x.off"
    with gmsh_session():
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(path))
    source = read(path.read_bytes())
    points = source.mesh.points + 1 / 3
    path.write_bytes(written(source, points))
    theirs, faces = read_by_gmsh(path)
    assert np.array_equal(theirs, points)
    assert faces == source.mesh.cells[0].vertices.tolist()


class TestConversion:
    def mesh(self):
        cells = [
            Cells("line", np.array([[0, 1]])),
            Cells("triangle", np.array([[0, 1, 4], [3, 0, 4]])),
            Cells("quad", np.array([[1, 2, 3, 4]])),
        ]
        tags = [np.array([1]), np.array([2, 3]), np.array([2])]
        return Mesh(np.array(POINTS)[:5, :2], cells, {"gmsh:physical": tags}, {}, {"wall": np.array([1, 1])})

    def test_gmsh_and_trimesh_open_it(self, tmp_path):
        source = convert(self.mesh(), ["its drawing is not kept"])
        points = self.mesh().points + 1 / 3
        assert source.stored(points).tolist() == points.tolist()
        assert source.notes[0] == "its drawing is not kept"
        assert "not kept: 1 cell of type vertex or line" in source.notes
        assert any("gmsh:physical" in note for note in source.notes)
        assert any("wall" in note for note in source.notes)
        path = tmp_path / "x.off"
        path.write_bytes(written(source, points))
        assert cells_of(read(path.read_bytes()).mesh) == cells_of(self.mesh())[1:]
        theirs, faces = read_by_gmsh(path)
        assert theirs[:, :2].tolist() == points.tolist()
        assert faces == [[0, 1, 4], [3, 0, 4], [1, 2, 3, 4]]
        assert np.array_equal(require("trimesh").load(path, process=False).vertices[:, :2], points)

    @pytest.mark.parametrize("cell_type", ["tetra", "triangle6", "line"])
    def test_what_it_cannot_hold_is_refused(self, cell_type):
        cells = [Cells(cell_type, np.arange({"tetra": 4, "triangle6": 6, "line": 2}[cell_type])[None])]
        with pytest.raises(OutputError, match=cell_type):
            convert(Mesh(np.array(POINTS), cells), [])


def test_content_tells_it():
    assert all(format_of(Path("-"), data).name == "off" for name, data in FILES.items() if name != "bare")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"hello\n", "line 1: OFF and the numbers"),
        (b"4OFF\n1 0 0\n0 0 0 1\n", "'4OFF': points of other dimensions"),
        (b"nOFF 2 BINARY\n", "OFF and the numbers"),
        (b"OFF\n3 1\n", "three counts"),
        (TEXT.replace(b" 4 0\n", b" 5 0\n", 1), "6 lines of vertices and 5 of faces"),
        (TEXT.replace(b"6\n", b"999999999999\n", 1), "999999999999 lines, one for each vertex"),
        (TEXT.replace(b"3\t1 0", b"3\t1"), "line 11: 3 numbers are needed for a vertex"),
        (TEXT.replace(b"3\t1 0", b"3\t1 x"), "line 11: not numbers"),
        (TEXT.replace(b"4 1 2 3 4", b"5 1 2 3 4"), "line 13: a face needs its number of vertices"),
        (TEXT.replace(b"4 1 2 3 4", b"4 1 2 3 6"), "names point 6, but there are 6"),
        (TEXT.replace(b"4 1 2 3 4", b"4 1 2 3 .5"), "line 13: the vertices of a face are whole numbers"),
        (b"OFF 0 0 0\n", "no vertices"),
        (BINARY[:-1], "face, but ends early"),
        (BINARY + b"x", "more behind its last face"),
        (BINARY.replace(b"COFF", b"C4OFF"), "other dimensions"),
        (BINARY[:20], "edges are missing"),
    ],
)
def test_refused_with_one_line_that_says_why(data, words):
    with pytest.raises(InputError) as caught:
        read(data)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(count):
    check_damaged(list(FILES.values()), count, 43, read, least=0.05)
