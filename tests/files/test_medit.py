"""MEDIT files, text and binary: mmg, FreeFem++ and Gmsh write some of them and read all that comes back."""

from __future__ import annotations

import itertools
import re
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest

from dvr_cli.cli.main import main
from dvr_cli.errors import InputError
from dvr_cli.files import medit
from dvr_cli.files.reading import open_mesh
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells, Mesh
from fuzz import COUNTS, check_damaged
from gmsh_session import gmsh_session
from meshes import TETRAHEDRA, grid
from needs import require, require_program
from sources import written

FAN = """MeshVersionFormatted 2
Dimension 2
Vertices
5
0 0 0
1 0 0
1 1 3
0 1 0
.8 .9 0
Edges
1
1 2 7
RequiredEdges
1
1
Triangles
4
1 2 5 1
2 3 5 1
3 4 5 1
4 1 5 1
End
"""
# The same with everything that the text may have.
ODD = """\ufeff# made by hand: Vertices 3
 MeshVersionFormatted\t1  # Dimension 2
Dimension
2
Identifier "Triangles 7 # no comment"
AngleOfCornerBound 30
Vertices 5   0 0 0   1 0 0  # two at once
1.D0 1d+0 3
0 10.0D-1 0 .8   9E-1 0
MyOwnSection
2
1 x 2.5 y
Edges 1
1 2 7

RequiredEdges
1 1
Triangles
4 1 2 5 1 2 3 5 1
3 4 5 1
4 1 5 1
SolAtVertices 1 1 1
0.5
End
Vertices 99 whatever comes behind
""".replace("\n", "\r\n")


def binary(version: int, order: str, dimension: int, sections: list[tuple[int, list]]) -> bytes:
    """A .meshb file of these sections, (keyword number, rows); vertices end in their reference."""
    position = "i" if version < 3 else "q"
    integer = "i" if version < 4 else "q"
    real = "f" if version == 1 else "d"
    out = struct.pack(f"{order}ii", 1, version)
    bodies = [(3, struct.pack(f"{order}i", dimension))]
    for code, rows in sections:
        body = struct.pack(f"{order}{integer}", len(rows))
        for row in rows:
            form = real * dimension + integer if code == 4 else real * len(row)
            form = form if code in (4, 59, 60) else integer * len(row)
            body += struct.pack(f"{order}{form}", *row)
        bodies.append((code, body))
    for code, body in bodies:
        following = len(out) + 4 + struct.calcsize(f"={position}") + len(body)
        out += struct.pack(f"{order}i{position}", code, following) + body
    return out + struct.pack(f"{order}i{position}", 54, 0)


SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 3), (0, 1, 0), (0.8, 0.9, 0)]
SECTIONS = [
    (4, SQUARE),
    (5, [(1, 2, 7)]),
    (16, [(1,)]),
    (60, [(0.1, 0.2), (0.3, 0.4)]),
    (6, [(1, 2, 5, 1), (2, 3, 5, 1), (3, 4, 5, 1), (4, 1, 5, 1)]),
]
UNKNOWN = (333, [(1, 2, 3)])
VERSIONS = [(version, order) for version in range(1, 5) for order in "<>"]
BINARY = {f"{v}{order}": binary(v, order, 2, [*SECTIONS, UNKNOWN]) for v, order in VERSIONS}
FILES = {"fan": FAN.encode(), "odd": ODD.encode(), **BINARY}


def cells(mesh: Mesh) -> list[tuple]:
    tags = mesh.cell_data["medit:ref"]
    return [(b.type, b.vertices.tolist(), t.tolist()) for b, t in zip(mesh.cells, tags, strict=True)]


# ---------------------------------------------------------------------------------------------------- by hand


@pytest.mark.parametrize("name", FILES)
def test_every_spelling_reads_the_same(name):
    mesh = medit.read(FILES[name]).mesh
    expected = np.array(SQUARE)[:, :2]
    assert mesh.points.tolist() == (expected.astype("f4") if name[0] == "1" else expected).tolist()
    assert mesh.point_data["medit:ref"].tolist() == [0, 0, 3, 0, 0]
    assert cells(mesh) == [
        ("line", [[0, 1]], [7]),
        ("triangle", [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], [1, 1, 1, 1]),
        ("vertex", [[0], [1]], [0, 0]),
    ]
    assert [members.tolist() for members in mesh.cell_sets["RequiredEdges"]] == [[0], [], []]
    assert mesh.point_data["medit:ref"].dtype.kind == mesh.cell_data["medit:ref"][0].dtype.kind == "i"


@pytest.mark.parametrize("name", FILES)
def test_unmoved_is_identical(name):
    source = medit.read(FILES[name])
    assert written(source, source.mesh.points.copy()) == FILES[name]


@pytest.mark.parametrize("name", FILES)
def test_moved_differs_in_coordinates_only(name):
    source = medit.read(FILES[name])
    points = source.mesh.points.copy()
    points[4] = 1 / 3, 1e-17
    moved = written(source, points)
    if name in BINARY:
        at = np.flatnonzero(np.frombuffer(moved, "u1") != np.frombuffer(FILES[name], "u1"))
        version, real = int(name[0]), 4 if name[0] == "1" else 8
        position, integer = 4 if version < 3 else 8, 4 if version < 4 else 8
        last = 8 + (4 + position + 4) + (4 + position + integer) + 4 * (2 * real + integer)
        assert last <= at.min() < at.max() < last + 2 * real
    else:
        last = b".8   9E-1 0" if name == "odd" else b".8 .9 0"
        blank = b"   " if name == "odd" else b" "
        assert moved == FILES[name].replace(last, b"0.3333333333333333" + blank + b"1e-17 0")
    assert medit.read(moved).mesh.points.tolist() == source.stored(points).tolist()
    assert (source.stored(points) == points).all() == (name[0] != "1")


@pytest.mark.parametrize("order", "<>")
def test_float32_is_widened_where_all_sections_are_known(order):
    known = medit.read(binary(1, order, 2, SECTIONS))
    wide = known.widened()
    assert wide.mesh.points.tolist() == known.mesh.points.tolist()
    assert cells(wide.mesh) == cells(known.mesh)
    points = wide.mesh.points + 1 / 3
    assert wide.stored(points).tolist() == points.tolist()
    back = medit.read(written(wide, points))
    assert back.mesh.points.tolist() == points.tolist()
    assert back.unread == known.unread
    rounded = [(float(np.float32(x)), float(np.float32(y)), reference) for x, y, reference in SQUARE]
    normals = np.float32([(0.1, 0.2), (0.3, 0.4)]).tolist()
    expected = [(code, {4: rounded, 60: normals}.get(code, rows)) for code, rows in SECTIONS]
    assert written(wide, wide.mesh.points.copy()) == binary(2, order, 2, expected)
    assert wide.widened() is None
    assert medit.read(BINARY[f"1{order}"]).widened() is None


@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_three_dimensions_and_every_element(version):
    corner = [(x, y, z, 0) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    elements = {
        "Hexahedra": (10, "hexahedron", [(1, 2, 4, 3, 5, 6, 8, 7, 11)]),
        "Prisms": (9, "wedge", [(1, 2, 3, 5, 6, 7, 12)]),
        "Pyramids": (49, "pyramid", [(1, 2, 4, 3, 5, 13)]),
        "Tetrahedra": (8, "tetra", [(1, 2, 3, 5, 14)]),
        "Quadrilaterals": (7, "quad", [(1, 2, 4, 3, 15)]),
    }
    expected = [(t, [[n - 1 for n in rows[0][:-1]]], [rows[0][-1]]) for _, t, rows in elements.values()]
    data = binary(version, "<", 3, [(4, corner), *((code, rows) for code, _, rows in elements.values())])
    mesh = medit.read(data).mesh
    assert mesh.points.tolist() == [list(row[:3]) for row in corner]
    assert cells(mesh) == expected
    text = f"MeshVersionFormatted {version}\nDimension 3\nVertices\n8\n"
    for row in corner:
        text += f"{' '.join(map(str, row))}\n"
    for name, (_, _, rows) in elements.items():
        text += f"{name}\n1\n{' '.join(map(str, rows[0]))}\n"
    for spelling in (text, text.replace("Hexahedra", "Hexaedra"), text + "End\n"):
        assert cells(medit.read(spelling.encode()).mesh) == expected


def test_what_a_remesher_may_not_move_is_held():
    sections = "Corners\n1\n4\nRequiredVertices 1 3\nRidges\n1\n1\nRequiredTriangles 1 2\n"
    text = FAN.replace("RequiredEdges\n1\n1\n", "").replace("End", sections + "PeriodicVertices 1\n1 4\nEnd")
    mesh = medit.read(text.encode()).mesh
    assert mesh.cells[-1].type == "vertex"
    assert mesh.cells[-1].vertices.ravel().tolist() == [1, 2, 3, 4]
    assert mesh.cell_data["medit:ref"][-1].tolist() == [0, 3, 0, 0]
    assert mesh.point_sets["Corners"].tolist() == [3]
    assert mesh.point_sets["RequiredVertices"].tolist() == [2]
    assert [members.tolist() for members in mesh.cell_sets["Ridges"]] == [[0], [], []]
    assert [members.tolist() for members in mesh.cell_sets["RequiredTriangles"]] == [[], [1], []]
    assert mesh.periodic.tolist() == [[0, 3]]


def test_an_order_of_nodes_of_its_own():
    head = "MeshVersionFormatted 2 Dimension 2 Vertices 6  0 0 0  2 0 0  0 2 0  1 0 0  1 1 0  0 1 0\n"
    plain = medit.read((head + "TrianglesP2 1  1 2 3 4 5 6 9 End").encode()).mesh
    assert cells(plain) == [("triangle6", [[0, 1, 2, 3, 4, 5]], [9])]
    order = "TrianglesP2Ordering 6  1 1 0  0 1 1  1 0 1  0 0 2  2 0 0  0 2 0\n"
    listed = medit.read((head + order + "TrianglesP2 1  4 5 6 3 1 2 9 End").encode()).mesh
    assert cells(listed) == cells(plain)


# The nodes of a hexahedron in the order of an example that comes with libMeshb, from 0 to 2 on each axis.
LIBMESHB = """0 0 0  2 0 0  2 2 0  0 2 0  0 0 2  2 0 2  2 2 2  0 2 2
1 0 0  2 1 0  1 2 0  0 1 0  1 0 2  2 1 2  1 2 2  0 1 2  0 0 1  2 0 1  2 2 1  0 2 1
1 1 0  1 1 2  1 0 1  2 1 1  1 2 1  0 1 1  1 1 1"""


def test_nodes_of_hexahedra_in_the_order_that_the_file_lists():
    rows = np.array(LIBMESHB.split(), dtype=int).reshape(-1, 3)
    mixed = np.random.default_rng(4).permutation(27)
    for order in (np.arange(27), mixed):
        vertices = "".join(f"{x} {y} {z} 0\n" for x, y, z in rows.tolist())
        listed = " ".join(map(str, rows[order].ravel().tolist()))
        nodes = " ".join(map(str, (order + 1).tolist()))
        text = (
            f"MeshVersionFormatted 2 Dimension 3 Vertices 27\n{vertices}"
            f"HexahedraQ2Ordering 27 {listed}\nHexahedraQ2 1 {nodes} 5\nEnd\n"
        )
        mesh = medit.read(text.encode()).mesh
        (block,) = mesh.cells
        corners = mesh.points[block.vertices[0, :8]]
        assert corners.tolist() == rows[:8].tolist()
        for around, node in zip(CELL_TYPES["hexahedron27"].mids, block.vertices[0, 8:], strict=True):
            assert mesh.points[node].tolist() == corners[list(around)].mean(axis=0).tolist()


@pytest.mark.parametrize(
    ("name", "cell_type", "corners", "n_corners"),
    [  # corners in Bézier's indices: those of triangles, and the height of a prism
        ("PrismsP2", "wedge18", "200 020 002", 6),
        ("PyramidsP2", "pyramid14", "000 200 220 020 002", 5),
    ],
)
def test_nodes_of_prisms_and_pyramids_in_the_order_that_the_file_lists(name, cell_type, corners, n_corners):
    """Every node lies where its indices say, so that each middle is the mean of the corners around it."""
    places = [tuple(map(int, word)) for word in corners.split()]
    if name == "PrismsP2":
        places = [(*corner, z) for z in (0, 2) for corner in places]
    mids = CELL_TYPES[cell_type].mids
    nodes = places + [tuple(np.mean([places[i] for i in around], axis=0).astype(int)) for around in mids]
    order = np.random.default_rng(3).permutation(len(nodes))
    listed = [nodes[i] for i in order]
    text = f"MeshVersionFormatted 2 Dimension 3 Vertices {len(nodes)}\n"
    text += "".join(f"{row[-3]} {row[-2]} {row[-1]} 0\n" for row in listed)
    text += f"{name}Ordering {len(nodes)} {' '.join(str(i) for row in listed for i in row)}\n"
    text += f"{name} 1 {' '.join(str(i + 1) for i in range(len(nodes)))} 7\nEnd\n"
    mesh = medit.read(text.encode()).mesh
    (block,) = mesh.cells
    assert block.type == cell_type
    found = mesh.points[block.vertices[0]]
    assert found[:n_corners].tolist() == [list(map(float, row[-3:])) for row in places]
    for around, middle in zip(mids, found[n_corners:], strict=True):
        assert middle.tolist() == found[list(around)].mean(axis=0).tolist()


def test_linear_cells_in_the_order_that_the_file_lists():
    """Hexahedra whose nodes run along x, y and z, and tetrahedra in the usual order."""
    head = "MeshVersionFormatted 2 Dimension 3 Vertices 8\n"
    grid = [(x, y, z) for z in range(2) for y in range(2) for x in range(2)]
    head += "".join(f"{x} {y} {z} 0\n" for x, y, z in grid)
    order = "HexahedraQ1Ordering 8 " + " ".join(f"{x} {y} {z}" for x, y, z in grid)
    tetrahedra = "TetrahedraP1Ordering 4 1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1 Tetrahedra 1 1 2 3 5 1\n"
    text = f"{head}{order}\n{tetrahedra}Hexahedra 1 1 2 3 4 5 6 7 8 4 End"
    mesh = medit.read(text.encode()).mesh
    found = {block.type: block.vertices.tolist() for block in mesh.cells}
    assert found == {"tetra": [[0, 1, 2, 4]], "hexahedron": [[0, 1, 3, 2, 4, 5, 7, 6]]}


def test_nodes_of_quadrilaterals_in_the_order_that_the_file_lists():
    head = "MeshVersionFormatted 2 Dimension 2 Vertices 9 "
    head += "".join(f"{x} {y} 0 " for y in range(3) for x in range(3))
    plain = medit.read((head + "QuadrilateralsQ2 1  1 3 9 7 2 6 8 4 5 1 End").encode()).mesh
    order = "QuadrilateralsQ2Ordering 9 " + " ".join(f"{x} {y}" for y in range(3) for x in range(3))
    listed = medit.read((head + order + " QuadrilateralsQ2 1 1 2 3 4 5 6 7 8 9 1 End").encode()).mesh
    assert cells(listed) == cells(plain)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("MFEM mesh v1.0\n\ndimension\n3\n", "a mesh of MFEM, which is not supported"),
        ("4\n0 0 0\n1 0 0\n", "as Netgen's neutral format does"),
        ("hello", "does not begin with MeshVersionFormatted"),
        ("Dimension 2", "does not begin with MeshVersionFormatted"),
        ("MeshVersionFormatted", "the keyword MeshVersionFormatted and its number are missing"),
        ("MeshVersionFormatted 7 Dimension 2", "MeshVersionFormatted 7 is not known"),
        ("MeshVersionFormatted 2 Vertices 0", "the keyword Dimension and its number are missing"),
        ("MeshVersionFormatted 2 Dimension 4", "Dimension 4; 2 or 3 are possible"),
        ("MeshVersionFormatted 2 Dimension 3", "section Vertices is missing"),
        (FAN.replace("\n5\n", "\n5000000000000\n", 1), "5000000000000 rows, which the file is too short for"),
        (FAN.replace("\n5\n", "\n6\n", 1), "section Vertices should have 6 rows"),
        (FAN.replace("\n5\n", "\n4\n", 1), "should have 4 rows of 3 numbers: 15 numbers instead of 12"),
        (FAN.replace("1 1 3", "1 1 3.5"), "references that are no whole numbers"),
        (FAN.replace(".8", "1-2"), "section Vertices should have 5 rows of 3 numbers"),
        (FAN.replace("\n4\n1 2", "\n3\n1 2"), "section Triangles should have 3 rows of 4 whole numbers"),
        (FAN.replace("\n4\n1 2", "\nx\n1 2"), "section Triangles should begin with the number of its rows"),
        (
            FAN.replace("4 1 5 1", "4 1 6 1"),
            "row 4 of section Triangles names vertex 6, which does not exist",
        ),
        (
            FAN.replace("4 1 5 1", "4 0 5 1"),
            "row 4 of section Triangles names vertex 0, which does not exist",
        ),
        (FAN.replace("4 1 5 1", "4 1 .5 1"), "section Triangles should have"),
        (FAN.replace("RequiredEdges\n1\n1", "RequiredEdges\n1\n2"), "names element 2, which does not exist"),
        (FAN.replace("End", "Edges 0"), "two sections 'Edges'"),
        (FAN.replace("End", "TrianglesP3 0"), "cells of order 3 or 4 (section TrianglesP3)"),
        (FAN.replace("End", "ExtraVerticesAtEdges 0"), "nodes of curved cells apart from them"),
        (FAN.replace("End", "TrianglesP2 0 TrianglesP2Ordering 1 1 2 3"), "does not list the 6 nodes"),
        (FAN.replace("End", "PrismsP2 0 PrismsP2Ordering 0"), "does not list the 18 nodes"),
        (FAN.replace("End", "TrianglesP1Ordering 3 1 0 0  0 1 0  0 1 0"), "does not list the 3 nodes"),
        *(
            (FAN.replace("End", f"{name} 1 {'1 ' * n} 0"), f"programs order the nodes of {name} differently")
            for name, n in (("PyramidsP2", 14), ("PrismsP2", 18), ("HexahedraQ2", 27))
        ),
    ],
)
def test_refused_with_one_line_that_says_why(text, words):
    with pytest.raises(InputError) as caught:
        medit.read(text.encode())
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


def test_text_without_end_is_read_if_its_last_line_ends():
    """Many programs leave End out."""
    text = FAN[: FAN.index("End")]
    whole = medit.read(FAN.encode()).mesh
    assert cells(medit.read(text.encode()).mesh) == cells(whole)
    begin = text.index("Vertices")
    for cut in range(begin, len(text) - 1):
        if text[cut - 1] != "\n":
            with pytest.raises(InputError):
                medit.read(text[:cut].encode())
    with pytest.raises(InputError, match="nothing follows its last keyword 'Tria', and there is no End"):
        medit.read((text + "Tria\n").encode())


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\1\0\0\0", "ends in its header"),
        (struct.pack("<ii", 1, 9), "version 9 of the binary format is not known"),
        (struct.pack("<ii", 1, 2), "ends before its keyword End"),
        (BINARY["2<"][:-8], "ends before its keyword End"),
        (BINARY["4>"][:100], "says that the next one is at"),
        (binary(2, "<", 4, []), "section Vertices is missing"),
        (binary(2, "<", 4, [(4, [])]), "Dimension 4"),
        (binary(2, "<", 2, [(4, SQUARE), (4, SQUARE)]), "two sections Vertices"),
        (binary(2, "<", 2, [(4, SQUARE), (90, [])]), "cells of order 3 or 4"),
        (binary(2, "<", 2, [(4, SQUARE), (6, [(1, 2, 9, 0)])]), "names vertex 9"),
        (BINARY["2<"].replace(struct.pack("<id", 5, 0), struct.pack("<id", 5000, 0)), "have 5000 rows"),
    ],
)
def test_damaged_binary_is_refused_with_one_line(data, words):
    with pytest.raises(InputError) as caught:
        medit.read(data)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


# ------------------------------------------------------------------------------------------- the command line


def smooth(*arguments: object) -> int:
    return main(["smooth", *map(str, arguments), "-n", "5"])


@pytest.mark.parametrize("name", FILES)
def test_required_edges_come_back(tmp_path, name):
    """In place, and through a pipe the format is told by the first bytes."""
    path = tmp_path / ("in.meshb" if name in BINARY else "in.mesh")
    path.write_bytes(FILES[name])
    before = medit.read(FILES[name]).mesh.points
    assert smooth(path, path) == 0
    after = medit.read(path.read_bytes())
    assert np.flatnonzero((after.mesh.points != before).any(axis=1)).tolist() == [4]
    assert cells(after.mesh) == cells(medit.read(FILES[name]).mesh)
    back = written(after, np.where(np.arange(5)[:, None] == 4, before, after.mesh.points))
    if name in BINARY:
        assert back == FILES[name]
    unsuffixed = tmp_path / "mesh"
    unsuffixed.write_bytes(FILES[name])
    assert open_mesh(unsuffixed).format == "medit"


@pytest.mark.parametrize("name", ["in.mesh", "in.meshb"])
def test_what_cannot_be_read_leaves_no_output(tmp_path, capsys, name):
    source, output = tmp_path / name, tmp_path / f"out{Path(name).suffix}"
    whole = BINARY["2<"] if name.endswith("b") else FAN.encode()
    for data in (None, b"MFEM mesh v1.0\n", b"\xff" * 40, whole[: len(whole) // 2]):
        if data is not None:
            source.write_bytes(data)
        assert smooth(source, output) == 3
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert str(source) in error
        assert not output.exists()


def two_materials(n: int) -> Mesh:
    """A cube of tetrahedra whose middle plane, curved a little, is where two references meet."""
    points, boxes = grid(n, 3)
    inner = ((points > 0) & (points < 1)).all(axis=1)
    points[inner] += 0.25 / n * np.random.default_rng(1).uniform(-1, 1, (inner.sum(), 3))
    tets = boxes[:, np.array(TETRAHEDRA)].reshape(-1, 4)
    low = np.repeat(boxes.min(axis=1), len(TETRAHEDRA)) < n // 2 * (n + 1) ** 2
    return Mesh(points, [Cells("tetra", tets)], {"medit:ref": [np.where(low, 1, 2)]})


@pytest.mark.parametrize("suffix", [".mesh", ".meshb"])
def test_interfaces_between_references_stay(tmp_path, suffix):
    mesh = two_materials(4)
    source, output = tmp_path / f"in{suffix}", tmp_path / f"out{suffix}"
    converted = medit.convert(mesh, [])
    converted.target = source
    with source.open("wb") as file:
        converted.write(mesh.points, file)
    assert smooth(source, output) == 0
    after = open_mesh(output).mesh.points
    (tets,), (tags,) = [mesh.cells[0].vertices], mesh.cell_data["medit:ref"]
    interface = np.intersect1d(tets[tags == 1], tets[tags == 2])
    assert len(interface) == 25
    assert (after[interface] == mesh.points[interface]).all()
    assert (after != mesh.points).any()


def test_text_and_binary_into_each_other(tmp_path, capsys):
    """Programs go by the suffix, so the name of the output decides; what may not move still may not."""
    source = tmp_path / "in.mesh"
    source.write_text(FAN.replace("End", "Corners 1 4 Tangents 1 0 0 Ridges 1 1 End"))
    binary_path, text_path = tmp_path / "out.meshb", tmp_path / "back.mesh"
    assert smooth(source, binary_path) == 0
    assert "note: " in (error := capsys.readouterr().err)
    assert re.findall(r"sections not kept: (.*)", error) == ["Tangents (1)"]
    assert binary_path.read_bytes()[:4] == b"\1\0\0\0"
    assert smooth(binary_path, text_path) == 0
    assert "note: " not in capsys.readouterr().err
    assert text_path.read_bytes().startswith(b"MeshVersionFormatted 2\n")
    for path in (binary_path, text_path):
        mesh = open_mesh(path).mesh
        original = open_mesh(source).mesh
        assert cells(mesh) == cells(original)
        assert mesh.point_sets["Corners"].tolist() == [3]
        assert mesh.cell_sets.keys() == original.cell_sets.keys() == {"RequiredEdges", "Ridges"}


def test_what_conversion_loses_is_said(tmp_path, capsys):
    source = tmp_path / "in.mesh"
    source.write_text(FAN.replace("End", "Normals 1 0 1 NormalAtVertices 1 1 1 End"))
    assert smooth(source, tmp_path / "out.vtu") == 0
    lost = "sections not kept: RequiredEdges (1), Normals (1), NormalAtVertices (1)\n"
    assert lost in capsys.readouterr().err
    assert smooth(source, tmp_path / "out.mesh") == 0
    assert "not kept" not in capsys.readouterr().err


# --------------------------------------------------------------------------------------------- other programs


@pytest.fixture(scope="module")
def by_mmg(tmp_path_factory) -> Path:
    """What mmg makes of a mesh: ridges, corners, normals, tangents."""
    mmgpy = require("mmgpy")
    folder = tmp_path_factory.mktemp("mmg")
    mesh = two_materials(3)
    with (folder / "in.mesh").open("wb") as file:
        medit.convert(mesh, []).write(mesh.points, file)
    made = mmgpy.MmgMesh3D(str(folder / "in.mesh"))
    made.remesh(hmax=0.4, verbose=-1)
    for suffix in (".mesh", ".meshb"):
        made.save(str(folder / f"mmg{suffix}"))
    return folder


@pytest.mark.parametrize("suffix", [".mesh", ".meshb"])
def test_mmg(by_mmg, tmp_path, suffix):
    mmgpy = require("mmgpy")
    path = by_mmg / f"mmg{suffix}"
    source = open_mesh(path)
    mesh = source.mesh
    assert {block.type for block in mesh.cells} == {"tetra", "triangle", "line", "vertex"}
    assert {*map(tuple, mesh.points[mesh.point_sets["Corners"]])} >= set(itertools.product((0, 1), repeat=3))
    assert {"Ridges"} <= mesh.cell_sets.keys()
    assert written(source, mesh.points.copy()) == path.read_bytes()
    output = tmp_path / f"out{suffix}"
    assert smooth(path, output) == 0
    before, after = mmgpy.MmgMesh3D(str(path)), mmgpy.MmgMesh3D(str(output))
    ours = open_mesh(output).mesh.points
    points, references = after.get_vertices_with_refs()
    assert points.tolist() == ours.tolist()
    assert (points != before.get_vertices()).any()
    assert references.tolist() == before.get_vertices_with_refs()[1].tolist()
    for kind in ("tetrahedra", "triangles", "edges"):
        for one, other in zip(*(getattr(m, f"get_{kind}_with_refs")() for m in (before, after)), strict=True):
            assert one.tolist() == other.tolist()
    if suffix == ".mesh":
        assert_coordinates_only(path.read_text(), output.read_text())


def assert_coordinates_only(before: str, after: str) -> None:
    """Nothing outside the section of vertices differs, and there the references do not."""
    whole = re.compile(r"(.*\n *Vertices\s+)(\d+)\n(.*?)(\n\s*[A-Z].*)", re.DOTALL)
    one, other = (whole.fullmatch(text).groups() for text in (before, after))
    assert one[0] == other[0]
    assert one[1] == other[1]
    assert one[3] == other[3]
    references = ([row.split()[-1:] for row in text.split("\n")] for text in (one[2], other[2]))
    assert next(references) == next(references)


SQUARE_BY_FREEFEM = """
border left(t=0, 1) {{ x=0; y=1-t; label=4; }}
border bottom(t=0, 2) {{ x=t; y=0; label=1; }}
border right(t=0, 1) {{ x=2; y=t; label=2; }}
border top(t=0, 2) {{ x=2-t; y=1; label=3; }}
border middle(t=0, 1) {{ x=1+.2*sin(pi*t); y=t; label=9; }}
mesh Th = buildmesh(left(8) + bottom(16) + right(8) + top(16) + middle(8));
savemesh(Th, "{}");
"""
MEASURED_BY_FREEFEM = """
mesh Th = readmesh("{}");
cout.precision(17);
cout << "n " << Th.nv << " " << Th.nt << endl;
cout << "region 0 " << int2d(Th, Th(0.1, 0.5).region)(1.) << endl;
cout << "region 1 " << int2d(Th, Th(1.9, 0.5).region)(1.) << endl;
cout << "labels 1 3 " << int1d(Th, 1, 3)(1.) << endl;
cout << "labels 2 4 " << int1d(Th, 2, 4)(1.) << endl;
cout << "label 9 " << int1d(Th, 9)(1.) << endl;
cout << "x " << int2d(Th)(x*x*y) << endl;
"""


def freefem(folder: Path, script: str) -> str:
    (folder / "script.edp").write_text(script)
    program = require_program("FreeFem++")
    command = [program, "-nw", "-ne", "-v", "0", "script.edp"]
    done = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_freefem_measures_the_same_areas_and_lengths(tmp_path):
    """Regions and labels are where they were, and the integral of a polynomial over them is the same."""
    freefem(tmp_path, SQUARE_BY_FREEFEM.format("in.mesh"))
    before, output = tmp_path / "in.mesh", tmp_path / "out.mesh"
    source = open_mesh(before)
    assert written(source, source.mesh.points.copy()) == before.read_bytes()
    assert smooth(before, output) == 0
    assert (open_mesh(output).mesh.points != source.mesh.points).any()
    assert_coordinates_only(before.read_text(), output.read_text())
    measured = []
    for path in (before, output):
        lines = freefem(tmp_path, MEASURED_BY_FREEFEM.format(path.name)).split("\n")
        rows = [line.split() for line in lines if line]
        measured.append({" ".join(words[:-1]): float(words[-1]) for words in rows})
    assert measured[0].keys() == measured[1].keys()
    assert len(measured[0]) == 7
    assert all(measured[1][key] == pytest.approx(value, rel=1e-12) for key, value in measured[0].items())
    assert 1.1 < measured[1]["region 0"] < 1.2


def test_gmsh_reads_what_second_order_cells_become(tmp_path):
    gmsh = require("gmsh")
    with gmsh_session(Mesh_SaveAll=1):
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        path, output = tmp_path / "in.mesh", tmp_path / "out.mesh"
        gmsh.write(str(path))
        source = open_mesh(path)
        mesh = source.mesh
        assert written(source, mesh.points.copy()) == path.read_bytes()
        (tets,) = (block.vertices for block in mesh.cells if block.type == "tetra10")
        for node, ends in zip(tets.T[4:], [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)], strict=True):
            np.testing.assert_allclose(mesh.points[node], mesh.points[tets[:, ends]].mean(axis=1), atol=1e-12)
        assert smooth(path, output) == 0
        assert_coordinates_only(path.read_text(), output.read_text())
        gmsh.option.setNumber("Mesh.SaveAll", 0)
        gmsh.open(str(output))
        _, coordinates, _ = gmsh.model.mesh.getNodes()
        ours = open_mesh(output).mesh.points
        assert (ours != mesh.points).any()
        assert np.sort(coordinates.reshape(-1, 3), axis=0).tolist() == np.sort(ours, axis=0).tolist()
        types, elements, _ = gmsh.model.mesh.getElements(3)
        assert types.tolist() == [11]
        assert len(elements[0]) == len(tets)
        assert gmsh.model.mesh.getElementQualities(elements[0], "minSJ").min() > 0


def test_mmg_reads_what_is_converted(tmp_path):
    mmgpy = require("mmgpy")
    mesh = two_materials(2)
    mesh.point_sets["Corners"] = np.array([0, 2])
    mesh.cells.append(Cells("vertex", np.array([[0], [2]])))
    mesh.cell_data["medit:ref"].append(np.array([0, 0]))
    for suffix in (".mesh", ".meshb"):
        converted = medit.convert(mesh, ["7 loads"])
        converted.target = tmp_path / f"x{suffix}"
        with converted.target.open("wb") as file:
            converted.write(mesh.points, file)
        read = mmgpy.MmgMesh3D(str(converted.target))
        assert read.get_vertices().tolist() == mesh.points.tolist()
        tets, references = read.get_tetrahedra_with_refs()
        assert np.sort(tets, axis=1).tolist() == np.sort(mesh.cells[0].vertices, axis=1).tolist()
        assert references.tolist() == mesh.cell_data["medit:ref"][0].tolist()
        assert open_mesh(converted.target).mesh.point_sets["Corners"].tolist() == [0, 2]
        converted.stored(mesh.points)
        assert converted.notes == ["7 loads"]


# ----------------------------------------------------------------------------------------------------- damage


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(count):
    check_damaged(list(FILES.values()), count, 29, medit.read, 0.1)
