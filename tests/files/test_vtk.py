"""Legacy VTK: what is read, what is written back, and what is refused; VTK and meshio are the oracles."""

from __future__ import annotations

import tracemalloc

import meshio
import numpy as np
import pytest

import vtk_corpus
from dvr_cli.errors import InputError
from dvr_cli.files import vtk
from fuzz import COUNTS, check_damaged
from gmsh_session import gmsh_session
from needs import require
from sources import bits, written
from vtk_corpus import arrays, cells, coordinates, corpus, everything_but_coordinates, read_with_vtk

FILES = sorted(corpus())
BEYOND = [
    "not kept: 1 field array (TIME)",
    "not kept: 3 string arrays (history of the run, some words, variants)",
    "not kept: 1 lookup table (lookup_table)",
]


def files_named(*beginnings: str) -> list[str]:
    return [name for name in FILES if name.startswith(beginnings)]


def moved(points: np.ndarray) -> np.ndarray:
    """Every other point moved, by amounts that float32 cannot hold."""
    points = points.copy()
    points[::2] += np.random.default_rng(0).uniform(-0.01, 0.01, points[::2].shape)
    return points


def points_section(data: bytes, n: int, binary: bool) -> tuple[int, int]:
    """Where the coordinates of a file begin and end, found without the package."""
    begin = data.upper().index(b"\nPOINTS ") + 1
    begin = data.index(b"\n", begin) + 1
    if binary:
        size = 24 if b"double" in data[begin - 30 : begin] else 12
        return begin, begin + size * n
    end = begin
    for _ in range(3 * n):
        while data[end : end + 1].isspace():
            end += 1
        while end < len(data) and not data[end : end + 1].isspace():
            end += 1
    return begin, end


@pytest.mark.parametrize("name", FILES)
def test_unmoved_is_identical(name):
    data = corpus()[name]
    source = vtk.read(data)
    assert source.unread == (BEYOND if name.startswith("with_data") else [])
    assert written(source, source.mesh.points.copy()) == data


@pytest.mark.parametrize("name", FILES)
def test_vtk_reads_the_same_points_cells_and_arrays(name):
    data = corpus()[name]
    mesh, oracle = vtk.read(data).mesh, read_with_vtk(data)
    assert bits(mesh.points) == bits(coordinates(oracle))
    of_vtk = cells(oracle)
    if "cell id" in mesh.cell_data:  # blocks may have another order than the file
        numbers = np.concatenate(mesh.cell_data["cell id"]).tolist()
    else:
        numbers = range(len(of_vtk))
    ours = [sorted(row) for block in mesh.cells for row in block.vertices.tolist()]
    assert len(ours) == len(numbers)
    assert set(numbers) == set(range(len(of_vtk)))
    for nodes, number in zip(ours, numbers, strict=True):
        kind, expected = of_vtk[number]
        if kind in (2, 4):  # poly-vertices and polylines are taken apart
            assert set(nodes) <= set(expected)
        else:
            assert nodes == sorted(expected)
    of_points, of_cells = oracle.GetPointData(), oracle.GetCellData()
    for data_by_name, theirs in ((mesh.point_data, of_points), (mesh.cell_data, of_cells)):
        expected_arrays = {k: v for k, v in arrays(theirs).items() if not isinstance(v, list)}
        assert set(data_by_name) == set(expected_arrays)
        for key, expected in expected_arrays.items():
            values = data_by_name[key]
            if isinstance(values, list):
                values = np.concatenate(values)
                expected = expected[list(numbers)]
            assert values.dtype.isnative
            if key == "colors" and "ascii" in name:  # VTK writes 0 ... 1 in ASCII, and reads 0 ... 255
                values = np.rint(255 * values)
            expected = expected.reshape(len(values), -1)
            assert np.array_equal(values.reshape(len(values), -1), expected, equal_nan=True)


@pytest.mark.parametrize("name", [name for name in FILES if name != "hand-int"])  # which becomes double
def test_moved_differs_in_coordinates_only(name):
    data = corpus()[name]
    source = vtk.read(data)
    points = moved(source.mesh.points)
    output = written(source, points)
    binary = b"BINARY" in data[:300]
    begin, end = points_section(data, len(points), binary)
    new_begin, new_end = points_section(output, len(points), binary)
    assert (output[:new_begin], output[new_end:]) == (data[:begin], data[end:])
    assert output[new_begin:new_end] != data[begin:end]
    before, after = read_with_vtk(data), read_with_vtk(output)
    assert everything_but_coordinates(after) == everything_but_coordinates(before)
    assert coordinates(after).dtype == coordinates(before).dtype
    assert bits(coordinates(after)) == bits(source.stored(points))
    again = vtk.read(output)
    assert bits(again.mesh.points) == bits(source.stored(points))
    if not binary:
        old, new = data[begin:end].split(), output[new_begin:new_end].split()
        still = bits(source.stored(points)) == np.array(bits(source.mesh.points))
        assert [b for b, keep in zip(new, still, strict=True) if keep] == [
            b for b, keep in zip(old, still, strict=True) if keep
        ]
        assert all(
            b == repr(x).encode()
            for b, x, keep in zip(new, source.stored(points).ravel().tolist(), still, strict=True)
            if not keep
        )


@pytest.mark.parametrize("name", FILES)
def test_widened_stores_every_bit(name):
    data = corpus()[name]
    source = vtk.read(data)
    wide = source.widened()
    points = moved(source.mesh.points)
    if wide is None:  # nothing to widen: every bit is stored already
        assert bits(source.stored(points)) == bits(points)
        return
    assert bits(wide.stored(points)) == bits(points)
    for given in (points, source.mesh.points):
        output = written(wide, given)
        oracle = read_with_vtk(output)
        assert coordinates(oracle).dtype == np.float64
        assert bits(coordinates(oracle)) == bits(given)
        assert everything_but_coordinates(oracle) == everything_but_coordinates(read_with_vtk(data))


def test_a_sign_of_zero_is_a_change():
    data = corpus()["hand-2.0-double"]
    source = vtk.read(data)
    points = source.mesh.points.copy()
    points[0, 1] = -0.0
    assert written(source, points) == data.replace(b"\n0 0 0\n", b"\n0 -0.0 0\n", 1)


@pytest.mark.parametrize("name", ["tetrahedra-51ascii-double", "tetrahedra-42binary-float"])
def test_a_byte_order_mark_is_passed_over_and_kept(name):
    data = corpus()[name]
    source = vtk.read(b"\xef\xbb\xbf" + data)
    assert bits(source.mesh.points) == bits(vtk.read(data).mesh.points)
    points = moved(source.mesh.points)
    assert written(source, source.mesh.points) == b"\xef\xbb\xbf" + data
    assert written(source, points) == b"\xef\xbb\xbf" + written(vtk.read(data), points)


def test_float_text_is_rounded_on_reading():
    source = vtk.read(corpus()["hand-2.0-float"])
    assert source.mesh.points[3].tolist() == [float(np.float32(0.1)), float(np.float32(1e-3)), 1.5]
    assert vtk.read(corpus()["hand-2.0-double"]).mesh.points[3].tolist() == [0.1, 1e-3, 1.5]


def test_whole_number_points_become_double_once_moved():
    data = corpus()["hand-int"]
    source = vtk.read(data)
    points = source.mesh.points.copy()
    points[2, 0] = 0.1
    expected = data.replace(b"points 5 int", b"points 5 double").replace(b"0 1 0\n", b"0.1 1 0\n", 1)
    assert written(source, points) == expected


@pytest.mark.parametrize("name", files_named("meshio", "tetrahedra", "scalars-42", "hand"))
def test_meshio_reads_the_same(name, tmp_path):
    path = tmp_path / "x.vtk"
    path.write_bytes(corpus()[name].replace(b"\r\n", b"\n"))
    expected = meshio.read(path)
    mesh = vtk.read(corpus()[name]).mesh
    assert bits(mesh.points) == bits(expected.points)
    assert [block.type for block in mesh.cells] == [block.type for block in expected.cells]
    for ours, theirs in zip(mesh.cells, expected.cells, strict=True):
        assert ours.vertices.tolist() == theirs.data.tolist()
    for key, blocks in expected.cell_data.items():
        assert [b.ravel().tolist() for b in mesh.cell_data[key]] == [b.ravel().tolist() for b in blocks]
    assert set(mesh.point_data) == set(expected.point_data)


def midpoints(points: np.ndarray, edges: list[tuple[int, ...]]) -> np.ndarray:
    return np.array([points[list(edge)].mean(axis=0) for edge in edges])


# Which corners the further nodes of each type lie between, in meshio's order.
_QUAD_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0)]
_HEX_EDGES = [*_QUAD_EDGES, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
_HEX_SIDES = [(0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7)]
_WEDGE_ENDS = [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3)]
_WEDGE_EDGES = [*_WEDGE_ENDS, (0, 3), (1, 4), (2, 5)]
BETWEEN = {
    "line3": [(0, 1)],
    "triangle6": [(0, 1), (1, 2), (2, 0)],
    "triangle7": [(0, 1), (1, 2), (2, 0), (0, 1, 2)],
    "quad8": _QUAD_EDGES,
    "quad9": [*_QUAD_EDGES, (0, 1, 2, 3)],
    "tetra10": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "hexahedron20": _HEX_EDGES,
    "hexahedron24": [*_HEX_EDGES, *_HEX_SIDES],
    "hexahedron27": [*_HEX_EDGES, *_HEX_SIDES, (0, 1, 2, 3), (4, 5, 6, 7), tuple(range(8))],
    "wedge12": _WEDGE_ENDS,
    "wedge15": _WEDGE_EDGES,
    "wedge18": [*_WEDGE_EDGES, (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
}


def test_second_order_nodes_lie_where_meshio_puts_them():
    """VTK's parametric coordinates are the oracle; those of the pyramid are a collapsed cube's, of no use."""
    mesh = vtk.read(corpus()["second_order-51binary-double"]).mesh
    assert [block.type for block in mesh.cells] == list(vtk_corpus.SECOND_ORDER)
    for block in mesh.cells:
        if block.type in BETWEEN:
            x = mesh.points[block.vertices[0]]
            expected = midpoints(x, BETWEEN[block.type])
            assert np.allclose(x[len(x) - len(expected) :], expected), block.type


SOLIDS = {  # one of each, as Gmsh numbers types and nodes
    4: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    5: [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    6: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]],
    7: [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.4, 0.4, 1]],
}


@pytest.mark.parametrize(
    ("order", "incomplete", "kinds"),
    [
        (1, 0, {"tetra", "hexahedron", "wedge", "pyramid"}),
        (2, 0, {"tetra10", "hexahedron27", "wedge18"}),
        (2, 1, {"tetra10", "hexahedron20"}),
    ],
)
def test_gmsh_writes_the_same_cells_as_msh_and_as_vtk(order, incomplete, kinds, tmp_path):
    """Node orders of linear and quadratic solids; meshio reads the MSH file."""
    gmsh = require("gmsh")
    with gmsh_session():
        first = 1
        for place, (kind, nodes) in enumerate(SOLIDS.items()):
            if (kind == 7 and order == 2) or (kind == 6 and incomplete):
                continue  # Gmsh gives quadratic pyramids the type of linear ones; meshio knows no wedge15
            x = np.add(nodes, [2 * place, 0, 0])
            tags = list(range(first, first + len(x)))
            first += len(x)
            volume = gmsh.model.addDiscreteEntity(3)
            gmsh.model.mesh.addNodes(3, volume, tags, x.ravel())
            gmsh.model.mesh.addElementsByType(volume, kind, [], tags)
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", incomplete)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(tmp_path / "x.vtk"))
        gmsh.write(str(tmp_path / "x.msh"))
    ours = vtk.read((tmp_path / "x.vtk").read_bytes()).mesh
    theirs = meshio.read(tmp_path / "x.msh", file_format="gmsh")
    assert {block.type for block in ours.cells} == {block.type for block in theirs.cells} == kinds
    for block in ours.cells:
        (expected,) = (theirs.points[b.data] for b in theirs.cells if b.type == block.type)
        if (
            block.type == "wedge18"
        ):  # which meshio leaves in Gmsh's order: bottom, upright and top edges mixed
            expected = expected[:, [*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16]]
        assert np.allclose(ours.points[block.vertices], expected), block.type


def test_voxels_and_pixels_go_round_their_faces():
    mesh = vtk.read(corpus()["all_linear-42ascii-double"]).mesh
    by_type = [(block.type, mesh.points[block.vertices]) for block in mesh.cells]
    hexahedra = np.concatenate([x for kind, x in by_type if kind == "hexahedron"])
    assert len(hexahedra) == 3
    for a, b in _HEX_EDGES:
        assert np.allclose(np.linalg.norm(hexahedra[:, a] - hexahedra[:, b], axis=1), 1)
    quads = np.concatenate([x for kind, x in by_type if kind == "quad"])
    assert len(quads) == 3  # quad, pixel, polygon of four
    for a, b in _QUAD_EDGES:
        assert np.allclose(np.linalg.norm(quads[:, a] - quads[:, b], axis=1), 1)


def test_blocks_of_an_unstructured_grid_are_runs():
    mesh = vtk.read(corpus()["all_linear-51ascii-double"]).mesh
    kinds = [(block.type, len(block.vertices)) for block in mesh.cells]
    assert kinds == [
        *(("tetra", 2), ("hexahedron", 1), ("hexahedron", 2), ("wedge", 1), ("pyramid", 1), ("triangle", 1)),
        *(("quad", 1), ("quad", 1), ("triangle", 1), ("quad", 1), ("polygon", 1), ("line", 4), ("vertex", 3)),
    ]
    assert mesh.cells[11].vertices.tolist() == [[0, 1], [0, 1], [1, 3], [3, 2]]
    assert mesh.cell_data["cell id"][11].tolist() == [13, 14, 14, 14]


def test_cells_that_change_type_all_the_time_come_in_few_blocks():
    n = 600
    body = b"".join(b"3 0 1 2\n4 0 1 2 3\n" for _ in range(n))
    data = (
        b"# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        + b"POINTS 4 float\n0 0 0 1 0 0 1 1 0 0 1 0\n"
        + b"CELLS %d %d\n%sCELL_TYPES %d\n%s\n" % (2 * n, 9 * n, body, 2 * n, b"5 9 " * n)
        + b"CELL_DATA %d\nSCALARS i int\nLOOKUP_TABLE default\n" % (2 * n)
        + " ".join(map(str, range(2 * n))).encode()
    )
    mesh = vtk.read(data).mesh
    assert [(block.type, len(block.vertices)) for block in mesh.cells] == [("triangle", n), ("quad", n)]
    assert [block.tolist() for block in mesh.cell_data["i"]] == [[*range(0, 2 * n, 2)], [*range(1, 2 * n, 2)]]


def test_polydata_has_one_block_for_each_number_of_nodes():
    mesh = vtk.read(corpus()["polydata-42binary-float"]).mesh
    kinds = [(block.type, block.vertices.shape) for block in mesh.cells]
    assert kinds == [
        *(("vertex", (3, 1)), ("line", (3, 2)), ("triangle", (2, 3)), ("quad", (1, 4))),
        *(("polygon", (1, 5)), ("polygon", (1, 6))),
    ]
    numbers = [ids.tolist() for ids in mesh.cell_data["cell id"]]
    assert numbers == [[0, 1, 1], [2, 3, 3], [4, 7], [5], [6], [8]]


@pytest.mark.parametrize("name", [n for n in files_named("structured") if "ascii" in n])
def test_structured_cells_have_the_node_order_of_vtk(name):
    """Not only the same nodes: quads and hexahedra of a grid are no pixels and voxels."""
    data = corpus()[name]
    blocks = vtk.read(data).mesh.cells
    expected = [nodes for _, nodes in cells(read_with_vtk(data))]
    assert [row for block in blocks for row in block.vertices.tolist()] == expected


HEAD = b"# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET %s\n"
GRID = HEAD % b"UNSTRUCTURED_GRID"
POINTS = b"POINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n"
TETRA = GRID + POINTS + b"CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n"


def one_cell(kind: int, nodes: int) -> bytes:
    return GRID + POINTS + b"CELLS 1 %d\n%d %s\nCELL_TYPES 1\n%d\n" % (nodes + 1, nodes, b"0 " * nodes, kind)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "not a legacy VTK file"),
        (b"\x89PNG\r\n", "not a legacy VTK file"),
        (b"# vtk DataFile Version 3.0\n", "ends where ASCII or BINARY"),
        (b"# vtk DataFile Version 3.0\ntitle\nBASCII\n", "should be ASCII or BINARY, not 'BASCII'"),
        (HEAD % b"STRUCTURED_POINTS", "points of a STRUCTURED_POINTS are implied"),
        (HEAD % b"RECTILINEAR_GRID", "points of a RECTILINEAR_GRID are implied"),
        (HEAD % b"TABLE", "'TABLE' is not supported"),
        (GRID, "no POINTS"),
        (GRID + b"POINTS 0 float\n", "no POINTS"),
        (GRID + b"POINTS 2 float\n0 0 0 1 0", "POINTS should have 6 numbers"),
        (GRID + b"POINTS 2 float\n0 0 0 1 0 x\n", "something else is among them"),
        (GRID + b"POINTS 2 string\nab\ncd\n", "type 'string' is not supported"),
        (GRID + b"POINTS -2 float\n", "negative"),
        (GRID + b"POINTS 2.5 float\n", "whole number, not '2.5'"),
        (GRID + POINTS + POINTS, "two POINTS"),
        (GRID + POINTS + b"CELLS 1 5\n4 0 1 2 3\n", "CELLS has 1 cells, but CELL_TYPES has 0"),
        (GRID + POINTS + b"CELLS 1 5\n4 0 1 2 4\nCELL_TYPES 1\n10\n", "cell 0 names point 4, but"),
        (GRID + POINTS + b"CELLS 1 5\n4 0 1 2 -1\nCELL_TYPES 1\n10\n", "cell 0 names point -1"),
        (GRID + POINTS + b"CELLS 1 5\n3 0 1 2 3\nCELL_TYPES 1\n10\n", "do not add up"),
        (GRID + POINTS + b"CELLS 2 5\n3 0 1 2 3\nCELL_TYPES 2\n5 5\n", "do not add up"),
        (GRID + POINTS + b"CELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n10\n", "cell 0 is a tetra, but has 3 nodes"),
        (GRID + POINTS + b"CELL_TIPES 1\n10\n", "unknown section 'cell_tipes'"),
        (
            GRID + POINTS + b"CELLS 2 4\nOFFSETS vtktypeint64\n0 5\nCONNECTIVITY vtktypeint64\n0 1 2 3\n",
            "offsets do not ascend",
        ),
        (GRID + POINTS + b"CELLS 2 4\nOFFSETS float\n0 4\n", "OFFSETS should be whole numbers"),
        (GRID + POINTS + b"CELLS 2 4\nOFFSETS int\n0 4\n", "no CONNECTIVITY"),
        (one_cell(0, 0), "empty cells (VTK cell type 0"),
        (one_cell(6, 4), "triangle strips"),
        (one_cell(42, 4), "polyhedra"),
        (one_cell(71, 4), "Lagrange cells"),
        (one_cell(79, 4), "Bezier cells"),
        (one_cell(99, 4), "unknown cells (VTK cell type 99, cell 0)"),
        (one_cell(7, 2), "cell 0 is a polygon, but has 2 nodes"),
        (one_cell(4, 1), "too few for its type"),
        (HEAD % b"POLYDATA" + POINTS + b"TRIANGLE_STRIPS 1 5\n4 0 1 2 3\n", "TRIANGLE_STRIPS are not"),
        (HEAD % b"POLYDATA" + POINTS + b"POLYGONT 1 4\n3 0 1 2\n", "unknown section 'polygont'"),
        (HEAD % b"STRUCTURED_GRID" + POINTS, "no DIMENSIONS"),
        (HEAD % b"STRUCTURED_GRID" + b"DIMENSIONS 2 2 2\n" + POINTS, "DIMENSIONS 2 2 2 do not match"),
        (HEAD % b"STRUCTURED_GRID" + b"DIMENSIONS 2 2 0\n" + POINTS, "should be positive"),
        (HEAD % b"STRUCTURED_GRID" + b"BLANKING 4 unsigned_char\n1 1 1 1\n", "BLANKING"),
    ],
)
def test_refused_with_one_line_that_says_why(data, words):
    with pytest.raises(InputError) as caught:
        vtk.read(data)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("tail", "words"),
    [
        (b"POINT_DATA 5\nSCALARS s float\nLOOKUP_TABLE default\n1 2 3 4 5\n", "POINT_DATA is for 5"),
        (b"POINT_DATA 4\nSCALARS s float\n1 2 3 4\n", "LOOKUP_TABLE"),
        (b"POINT_DATA 4\nSCALARS s float\nLOOKUP_TABLE default\n1 2 3\n", "4 numbers, fewer are left"),
        (b"POINT_DATA 4\nSCALARS s complex\nLOOKUP_TABLE default\n1 2 3 4\n", "type 'complex'"),
        (b"POINT_DATA 4\nSOMETHING s float\n", "'something' is not an attribute"),
        (b"SOMETHING 4\n", "unknown section 'something'"),
        (
            b"POINT_DATA 4\nFIELD f 1\n" + b"y" * 20000 + b" POINTS\n",
            "should be a whole number, not 'POINTS'",
        ),
        (b"POINT_DATA 4\nFIELD f 2\na 1 4 float\n1 2 3 4\nb 1 999999999999 float\n1\n", "fewer are left"),
    ],
)
def test_data_that_cannot_be_read_are_left_out(tail, words):
    head = b"CELL_DATA 1\nSCALARS first int\nLOOKUP_TABLE default\n7\n"
    source = vtk.read(TETRA + (b"" if tail.startswith(b"SOME") else head) + tail)
    assert len(source.unread) == 1
    assert words in source.unread[0]
    assert len(source.unread[0]) < 230
    assert len(source.mesh.cells) == 1
    if not tail.startswith(b"SOME"):
        assert source.mesh.cell_data["first"][0].tolist() == [7]
    assert set(source.mesh.point_data) <= {"a"}
    assert written(source, source.mesh.points + 1).endswith(tail)


@pytest.mark.parametrize(
    "text",
    [
        b"POINTS 900000000000000000 float\n0 0 0\n",
        POINTS + b"CELLS 100000000000 500000000000\n4 0 1 2 3\n",
        POINTS + b"CELLS 2 4\nOFFSETS int\n0 4\nCONNECTIVITY int\n0 1 2 3\nCELL_TYPES 300000000000\n10\n",
        POINTS + b"CELLS 100000000000 4\nOFFSETS vtktypeint64\n0\n",
        b"FIELD f 1\nx 1 900000000000000 double\n1\n",
        b"FIELD f 1\nx 1 900000000000000 string\na\n",
        b"FIELD f 900000000000000\nx 1 1 int\n1\n",
        b"FIELD f 1\nx 900000000000000 0 int\nMETADATA\nCOMPONENT_NAMES\na\nb\n",
    ],
)
@pytest.mark.parametrize("coding", [b"ASCII", b"BINARY"])
def test_huge_declared_counts_allocate_nothing(text, coding):
    data = GRID.replace(b"ASCII", coding) + text + b" " * 100
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            vtk.read(data)
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(count):
    names = files_named("tetrahedra", "with_data", "polydata", "structured342", "all_linear", "hand")
    check_damaged([corpus()[name] for name in names], count, 7, vtk.read, 0.1)


TRUNCATED = ("tetrahedra-42ascii-float", "tetrahedra-51binary-double", "polydata-51ascii-float")


@pytest.mark.parametrize("name", TRUNCATED)
def test_truncated_in_the_geometry_is_refused(name):
    data = corpus()[name]
    keywords = (b"NORMALS", b"POINT_DATA", b"CELL_DATA")
    end = min((data.index(k) for k in keywords if k in data), default=len(data.rstrip()) - 1)
    if name.startswith("polydata"):  # a file may end in front of any section
        end = data.index(b"POLYGONS")
        whole = [data.index(k) for k in (b"METADATA", b"VERTICES", b"LINES", b"POLYGONS") if k in data]
        lengths = [n for n in range(end) if data[:n].rstrip() not in [data[:w].rstrip() for w in whole]]
    else:
        lengths = list(range(end))
    refused = 0
    for n in lengths:
        try:
            mesh = vtk.read(data[:n]).mesh
        except InputError:
            refused += 1
        else:
            # only digits of a last number, or a section not begun, can go unnoticed
            assert sum(len(block.vertices) for block in mesh.cells) in (0, 2, 3, 6)
    assert refused > 0.8 * len(lengths)
