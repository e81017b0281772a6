"""PLY files: as trimesh writes them, by hand what else the format has; trimesh and VTK read them."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from dvr_cli.errors import InputError
from dvr_cli.files.formats import format_of
from dvr_cli.files.ply import read
from dvr_cli.mesh.domain import domain_of
from fuzz import COUNTS, check_damaged
from needs import require
from sources import cells_of, written

HEADER = """ply
format {} 1.0
comment by hand
obj_info 1 2 3
element vertex 6
property uchar quality
property {} x
property {} y
property {} z
property list uchar float weights
element material 1
property int id
element face 3
property short flag
property list uint8 int vertex_indices
property uchar red
element edge 1
property int vertex1
property int vertex2
end_header
"""
VERTICES = [(0, 0, 0, 0), (1, 2, 0, 0), (2, 2, 2, 0), (3, 0, 2, 0), (4, 1, 1, 0), (5, 3, 1, 0)]
FACES = [(7, (0, 1, 4), 255), (-8, (1, 2, 3, 4), 0), (9, (1, 5, 2), 3)]


def text(type_name: str = "double", line_end: str = "\n") -> bytes:
    rows = [f"{q} {x}.5 {y} {z} 2 .5 1e3" for q, x, y, z in VERTICES] + ["42"]
    rows += [f"{flag} {len(f)} {' '.join(map(str, f))} {red}" for flag, f, red in FACES] + ["3 0"]
    whole = HEADER.format("ascii", *[type_name] * 3) + "\n".join(rows) + "\n"
    return whole.replace("\n", line_end).encode()


def binary(order: str, code: str = "f", line_end: str = "\n") -> bytes:
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    type_name = {"f": "float", "d": "double", "i": "int"}[code]
    data = HEADER.format(name, *[type_name] * 3).replace("\n", line_end).encode()
    for q, x, y, z in VERTICES:
        data += struct.pack(f"{order}B3{code}Bf", q, x, y, z, 1, 0.25)
    data += struct.pack(order + "i", 42)
    for flag, f, red in FACES:
        data += struct.pack(f"{order}hB{len(f)}iB", flag, len(f), *f, red)
    return data + struct.pack(order + "2i", 3, 0)


def plain(type_name: str, order: str, code: str) -> bytes:
    """A square of four triangles without lists in its vertices."""
    name = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = f"ply\nformat {name} 1.0\nelement vertex 5\nproperty uchar red\nproperty {type_name} y\n"
    head += f"property {type_name} x\nproperty {type_name} z\nelement face 4\n"
    head += "property list uchar int vertex_index\nend_header\n"
    rows = [(9, 0, 0, 0), (8, 0, 4, 0), (7, 4, 4, 0), (6, 4, 0, 0), (5, 1, 1, 0)]
    faces = [(3, 0, 1, 4), (3, 1, 2, 4), (3, 2, 3, 4), (3, 3, 0, 4)]
    if not order:
        return (head + "".join(" ".join(map(str, row)) + "\n" for row in rows + faces)).encode()
    body = [struct.pack(f"{order}B3{code}", *row) for row in rows]
    return head.encode() + b"".join(body + [struct.pack(order + "B3i", *face) for face in faces])


STRIPS = b"""ply
format ascii 1.0
element vertex 6
property float x
property float y
property float z
element tristrips 1
property list int int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
1 1 0
0 2 0
1 2 0
9 0 1 2 3 -1 2 3 4 5
"""
FILES = {
    "text": text(),
    "float text": text("float"),
    "returns": text(line_end="\r\n"),
    "mac": text(line_end="\r"),
    "little": binary("<"),
    "big": binary(">"),
    "big double": binary(">", "d", "\r\n"),
    "plain little": plain("float", "<", "f"),
    "plain big": plain("short", ">", "h"),
    "plain text": plain("int", "", ""),
    "strips": STRIPS,
}


def read_by_vtk(path: Path) -> tuple[np.ndarray, list[list[int]]]:
    """Points and polygons as VTK's reader, which goes by float32, finds them."""
    require("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOPLY import vtkPLYReader

    reader = vtkPLYReader()
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutput()
    nodes = []
    for i in range(data.GetNumberOfCells()):
        cell = data.GetCell(i)  # one object for all of them
        nodes.append([cell.GetPointId(j) for j in range(cell.GetNumberOfPoints())])
    return vtk_to_numpy(data.GetPoints().GetData()), nodes


@pytest.mark.parametrize("name", ["text", "float text", "returns", "mac", "little", "big", "big double"])
def test_everything_that_the_format_has(name):
    source = read(FILES[name])
    mesh = source.mesh
    shift = 0.5 if source._records.order == "" else 0.0
    assert mesh.points.tolist() == [[x + shift, y, z] for _, x, y, z in VERTICES]
    assert cells_of(mesh) == [
        ("line", [[3, 0]]),
        ("triangle", [[0, 1, 4], [1, 5, 2]]),
        ("quad", [[1, 2, 3, 4]]),
    ]
    assert [tags.tolist() for tags in mesh.cell_data["flag"]] == [[0], [7, 9], [-8]]
    assert [tags.tolist() for tags in mesh.cell_data["red"]] == [[0], [255, 3], [0]]
    assert mesh.cell_data["red"][0].dtype == np.uint8
    assert mesh.point_data["quality"].tolist() == [0, 1, 2, 3, 4, 5]
    assert source.unread == ["not kept: elements 1 material", "not kept: lists weights of vertex"]


def test_strips_are_taken_apart():
    assert cells_of(read(STRIPS).mesh) == [("triangle", [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]])]


@pytest.mark.parametrize("name", FILES)
def test_unmoved_is_identical(name):
    source = read(FILES[name])
    assert written(source, source.mesh.points.copy()) == FILES[name]


def test_moved_differs_in_coordinates_only():
    source = read(text())
    points = source.mesh.points.copy()
    points[4] = 1 / 3, 1.0, -1e-17
    assert written(source, points) == text().replace(b"4 1.5 1 0 ", b"4 0.3333333333333333 1 -1e-17 ")
    source = read(binary(">", "d"))
    points = source.mesh.points.copy()
    points[4, 0] = 1 / 3
    before = struct.pack(">B3d", 4, 1, 1, 0)
    assert binary(">", "d").count(before) == 1
    after = struct.pack(">B3d", 4, 1 / 3, 1, 0)
    assert written(source, points) == binary(">", "d").replace(before, after)


@pytest.mark.parametrize("name", FILES)
def test_what_is_stored_is_what_readers_get(name, tmp_path):
    trimesh = require("trimesh")
    source = read(FILES[name])
    points = source.mesh.points * 1.5 + 1 / 3
    wide = source.widened()
    lists = b"weights" in FILES[name]
    for writer in [source] if wide is None else [source, wide]:
        out = written(writer, points)
        again = read(out)
        assert np.array_equal(again.mesh.points, writer.stored(points))
        assert cells_of(again.mesh) == cells_of(source.mesh)
        for old, new in zip(source.mesh.cell_data.items(), again.mesh.cell_data.items(), strict=True):
            assert old[0] == new[0]
            assert all(np.array_equal(a, b) for a, b in zip(old[1], new[1], strict=True))
        path = tmp_path / "x.ply"
        path.write_bytes(out)
        if name.startswith("plain"):
            theirs = trimesh.load(path, process=False, maintain_order=True)
            assert np.array_equal(theirs.vertices, writer.stored(points))
            assert theirs.faces.tolist() == source.mesh.cells[0].vertices.tolist()
        if name in ("text", "little", "big", "plain little", "plain text") and not lists:
            theirs, polygons = read_by_vtk(path)
            assert np.array_equal(theirs, points.astype(np.float32))
            assert polygons == source.mesh.cells[0].vertices.tolist()
    if wide is not None:
        assert np.array_equal(wide.stored(points), points)
    assert (wide is None) == (lists or b"double" in FILES[name])


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_files_by_trimesh(encoding, tmp_path):
    trimesh = require("trimesh")
    ball = trimesh.creation.icosphere(1)
    ball.visual.face_colors = np.arange(4 * len(ball.faces), dtype=np.uint8).reshape(-1, 4)
    data = ball.export(file_type="ply", encoding=encoding, vertex_normal=True)
    source = read(data)
    assert written(source, source.mesh.points.copy()) == data
    assert source.mesh.cells[0].vertices.tolist() == ball.faces.tolist()
    assert np.array_equal(source.mesh.cell_data["green"][0], ball.visual.face_colors[:, 1])
    points = source.mesh.points * 0.75
    path = tmp_path / "ball.ply"
    path.write_bytes(written(source, points))
    again = trimesh.load(path, process=False)
    assert np.array_equal(again.vertices, source.stored(points))
    assert np.array_equal(again.visual.face_colors, ball.visual.face_colors)


def test_edges_hold_their_vertices():
    data = plain("double", "", "").replace(
        b"end_header", b"element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header"
    )
    assert np.flatnonzero(domain_of(read(plain("double", "", "")).mesh).interior).tolist() == [4]
    assert not domain_of(read(data + b"0 4\n").mesh).interior.any()


def test_colours_are_no_regions_and_materials_are():
    square = plain("float", "", "").replace(b"end_header", b"property uchar red\nend_header")
    rows = square.splitlines(keepends=True)
    tagged = b"".join(
        row.rstrip() + b" %d\n" % (i % 2) if i >= len(rows) - 4 else row for i, row in enumerate(rows)
    )
    assert domain_of(read(tagged).mesh).interior.tolist() == [False] * 4 + [True]
    material = tagged.replace(b"property uchar red\nend", b"property uchar material_index\nend")
    assert not domain_of(read(material).mesh).interior.any()


def test_content_tells_it():
    assert all(format_of(Path("-"), data).name == "ply" for data in FILES.values())


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"plywood\n", "first line is not 'ply'"),
        (text()[:90], "no end_header"),
        (text().replace(b"format ascii", b"format utf8"), "line 2: 'format utf8 1.0' is no statement"),
        (text().replace(b"format ascii 1.0\n", b""), "names no format"),
        (text().replace(b"property short", b"property half"), "line 14: 'half' is no type"),
        (
            text().replace(b"list uint8 int vertex", b"list float int vertex"),
            "the length of a list is no float",
        ),
        (text().replace(b"double z", b"double w"), "properties x, y and z"),
        (text().replace(b"vertex_indices", b"corners"), "element face has no list vertex_indices"),
        (text().replace(b"vertex 6", b"vertex 0"), "face, but ends early"),
        (text().replace(b"vertex 6", b"vertex 999999999999"), "ends early"),
        (text().replace(b"7 3 0 1 4", b"7 3 0 1 6"), "names point 6, but there are 6"),
        (text().replace(b"7 3 0 1 4", b"7 3 0 1 x"), "line 28: not a number"),
        (text().replace(b"7 3 0 1 4", b"7 3 0 1 1.5"), "fractions"),
        (text().replace(b"9 3 1 5 2", b"9 2 1 5"), "is a polygon, but has 2 nodes"),
        (text().replace(b"double y", b"double x"), "line 8: a second property 'x'"),
        (text() + b"1\n", "more behind its last element"),
        (binary("<")[:-1], "edge, but ends early"),
        (binary("<") + b"x", "more behind its last element"),
        (text().replace(b"vertex1", b"from"), "vertex1 and vertex2"),
    ],
)
def test_refused_with_one_line_that_says_why(data, words):
    with pytest.raises(InputError) as caught:
        read(data)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(count):
    check_damaged(list(FILES.values()), count, 41, read, least=0.02)
