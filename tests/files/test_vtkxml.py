"""VTU and VTP: what is read, what is written back, and what is refused; VTK is the oracle."""

from __future__ import annotations

import re
from importlib import import_module

import numpy as np
import pytest

from dvr_cli.errors import InputError
from fuzz import COUNTS, mutated
from pairwise import named_cases
from sources import bits, written
from vtk_corpus import arrays, cells, coordinates, everything_but_coordinates
from vtkxml_corpus import NAMES, file, grid, module_of, points_blanked, read_with_vtk, write


def read(data: bytes):
    return import_module(f"dvr_cli.files.vtkxml.{module_of(data)}").read(data)


def moved(points: np.ndarray) -> np.ndarray:
    """Every fifth point moved, by amounts that float32 cannot hold."""
    points = points.copy()
    points[::5] += np.random.default_rng(0).uniform(-0.01, 0.01, points[::5].shape)
    return points


@pytest.mark.parametrize("name", named_cases(NAMES))
def test_unmoved_is_identical(name):
    data = file(name)
    source = read(data)
    assert written(source, source.mesh.points.copy()) == data


@pytest.mark.parametrize("name", named_cases(NAMES))
def test_vtk_reads_the_same_points_cells_and_arrays(name):
    data = file(name)
    mesh, oracle = read(data).mesh, read_with_vtk(data)
    assert bits(mesh.points) == bits(coordinates(oracle))
    of_vtk = cells(oracle)
    if "cell id" in mesh.cell_data and "pieces" not in name:  # blocks may have another order than the file
        numbers = np.concatenate(mesh.cell_data["cell id"]).tolist()
        for block, number in zip(
            mesh.cells, np.split(numbers, np.cumsum([len(b.vertices) for b in mesh.cells])[:-1]), strict=True
        ):
            for nodes, n in zip(block.vertices.tolist(), number, strict=True):
                kind, expected = of_vtk[n]
                assert set(nodes) <= set(expected) if kind in (2, 4) else sorted(nodes) == sorted(expected)
        assert set(numbers) == set(range(len(of_vtk)))
    elif "surface" not in name:
        ours = [sorted(row) for block in mesh.cells for row in block.vertices.tolist()]
        assert ours == [sorted(nodes) for _, nodes in of_vtk]
        for key, expected in arrays(oracle.GetCellData()).items():
            if not isinstance(expected, list):
                values = np.concatenate(mesh.cell_data[key])
                assert np.array_equal(values.reshape(expected.shape), expected)
    of_points = {k: v for k, v in arrays(oracle.GetPointData()).items() if not isinstance(v, list)}
    assert set(mesh.point_data) | {"a Bit"} == set(of_points) | {"a Bit"}
    for key, values in mesh.point_data.items():
        values, theirs = values.reshape(of_points[key].shape), of_points[key]
        if "ascii" in name:  # VTK reads "-inf" as infinity
            values = np.where(values == -np.inf, np.inf, values)
        assert np.array_equal(values, theirs, equal_nan=True)


@pytest.mark.parametrize("name", named_cases(NAMES))
def test_moved_differs_in_coordinates_only(name):
    data = file(name)
    source = read(data)
    points = moved(source.mesh.points)
    output = written(source, points)
    if "zlib" not in name and "lz4" not in name and "lzma" not in name:
        assert points_blanked(output) == points_blanked(data)
    before, after = read_with_vtk(data), read_with_vtk(output)
    assert everything_but_coordinates(after) == everything_but_coordinates(before)
    assert coordinates(after).dtype == coordinates(before).dtype
    assert bits(coordinates(after)) == bits(source.stored(points))
    assert bits(read(output).mesh.points) == bits(source.stored(points))


@pytest.mark.parametrize("name", named_cases(NAMES))
def test_widened_stores_every_bit(name):
    data = file(name)
    source = read(data)
    wide = source.widened()
    points = moved(source.mesh.points)
    if wide is None:  # nothing to widen: every bit is stored already
        assert bits(source.stored(points)) == bits(points)
        return
    assert bits(wide.stored(points)) == bits(points)
    for given in (points, source.mesh.points):
        oracle = read_with_vtk(written(wide, given))
        assert coordinates(oracle).dtype == np.float64
        assert bits(coordinates(oracle)) == bits(given)
        assert everything_but_coordinates(oracle) == everything_but_coordinates(read_with_vtk(data))


@pytest.mark.parametrize("name", named_cases(NAMES))
def test_a_cell_field_is_added_and_replaced(name):
    data = file(name)
    source = read(data)
    points = moved(source.mesh.points)
    zeros = [np.zeros(len(block.vertices)) for block in source.mesh.cells]
    values = [np.arange(len(block.vertices)) + 0.5 for block in source.mesh.cells]
    filled = source.with_cell_field("a & q", zeros, points).with_cell_field("a & q", values, points)
    output = written(filled, points)
    again = read(output)
    assert [b.tolist() for b in again.mesh.cell_data["a & q"]] == [b.tolist() for b in values] or (
        "linear" in name or "surface" in name  # polylines in pieces have one value
    )
    oracle = read_with_vtk(output)
    assert bits(coordinates(oracle)) == bits(source.stored(points))
    added = arrays(oracle.GetCellData())
    assert len(added.pop("a & q")) == oracle.GetNumberOfCells()
    assert list(added) == list(arrays(read_with_vtk(data).GetCellData()))
    assert output.count(b'Name="a &amp; q"') == len(re.findall(rb"<Piece ", data))


@pytest.mark.parametrize("compressor", ["zlib", "lz4", "lzma"])
@pytest.mark.parametrize("form", ["binary", "raw", "base64"])
def test_blocks_that_did_not_change_keep_their_bytes(form, compressor):
    data = write(grid(), form, compressor)
    source = read(data)
    points = source.mesh.points.copy()
    points[-1] += 0.001  # in the last of nine blocks
    output = written(source, points)
    first = next(i for i, (a, b) in enumerate(zip(data, output, strict=False)) if a != b)
    assert bits(coordinates(read_with_vtk(output))) == bits(points)
    if form == "raw":
        begin = data.index(b"_", data.index(b"<AppendedData")) + 1
        offset = int(re.search(rb'Name="Points"[^>]*offset="(\d+)"', data).group(1))
        sizes = np.frombuffer(data, "<u4", 12, begin + offset)
        assert sizes[:3].tolist() == [9, 72, 0]
        start = begin + offset + 48
        packed = data[start : start + sizes[3:11].sum()]
        assert packed in output
    assert first > 0


def test_a_byte_order_mark_is_kept():
    for form in ("ascii", "raw", "binary"):
        data = b"\xef\xbb\xbf" + write(grid(), form)
        source = read(data)
        assert written(source, source.mesh.points) == data
        output = written(source, moved(source.mesh.points))
        assert output[:3] == b"\xef\xbb\xbf"
        assert bits(coordinates(read_with_vtk(output[3:]))) == bits(moved(source.mesh.points))


def test_whole_number_points_become_float64_once_moved():
    data = write(grid(), "ascii").replace(b'"Float64" Name="Points"', b'"Int32" Name="Points"')
    begin, end = re.search(rb'Name="Points"[^>]*>(.*?)<', data, re.DOTALL).span(1)
    whole = " ".join(str(i % 3 + i // 27) for i in range(81)).encode()
    head, tail = data[:begin], data[end:]
    data = head + whole + tail
    source = read(data)
    assert written(source, source.mesh.points) == data
    points = source.mesh.points.copy()
    points[3, 1] = 0.125
    output = written(source, points)
    expected = whole.split()
    expected[10] = b"0.125"
    head = head.replace(b'"Int32" Name="Points"', b'"Float64" Name="Points"')
    assert output == head + b" ".join(expected) + tail
    assert bits(coordinates(read_with_vtk(output))) == bits(points)


TWO = b"""<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<UnstructuredGrid>%s</UnstructuredGrid></VTKFile>
"""
PIECE = b"""<Piece NumberOfPoints="4" NumberOfCells="2"><Points>
<DataArray type="Float64" NumberOfComponents="3" format="ascii">%s</DataArray></Points><Cells>
<DataArray type="Int64" Name="connectivity" format="ascii">0 1 2 0 2 3</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">3 6</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">5 5</DataArray></Cells>%s</Piece>
"""
SQUARE = b"0 0 0 1 0 0 1 1 0 0 1 0"
ONE = TWO % (PIECE % (SQUARE, b""))


def test_pieces_are_one_mesh_and_no_regions():
    data = TWO % (PIECE % (SQUARE, b"") + PIECE % (SQUARE.replace(b"1", b"2"), b""))
    mesh = read(data).mesh
    assert mesh.points.shape == (8, 3)
    assert [block.vertices.tolist() for block in mesh.cells] == [
        [[0, 1, 2], [0, 2, 3]],
        [[4, 5, 6], [4, 6, 7]],
    ]
    assert mesh.cell_data == {}


def test_points_that_pieces_share_are_linked():
    right = b"1 0 0 2 0 0 2 1 0 1 1 0"
    mesh = read(TWO % (PIECE % (SQUARE, b"") + PIECE % (right, b""))).mesh
    assert mesh.periodic.tolist() == [[4, 1], [7, 2]]
    assert mesh.unlinked.tolist() == [True, False, False, True, False, True, True, False]


def of_cells(kind: bytes, name: bytes, values: bytes) -> bytes:
    return b'<CellData><DataArray type="%s" Name="%s" format="ascii">%s</DataArray></CellData>' % (
        *(kind, name, values),
    )


def test_data_that_not_all_pieces_have_are_named():
    data = TWO % (PIECE % (SQUARE, of_cells(b"Int32", b"material", b"1 2")) + PIECE % (SQUARE, b""))
    source = read(data)
    assert source.mesh.cell_data == {}
    assert source.unread == ["not kept: 1 array of a part (material)"]


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"<a/>", "not a VTK XML file"),
        (TWO % b"", "no Piece"),
        (TWO.replace(b"</Un", b"</un") % b"", "damaged XML: mismatched tag in line 2"),
        (TWO.replace(b"UnstructuredGrid", b"PUnstructuredGrid") % b"", "only lists the files of its pieces"),
        (TWO.replace(b"UnstructuredGrid", b"ImageData") % b"", "VTK XML of type 'ImageData'"),
        (TWO.replace(b"LittleEndian", b"Middle") % b"", "byte_order 'Middle'"),
        (TWO.replace(b"UInt64", b"Int8") % b"", "header_type 'Int8'"),
        (TWO.replace(b"version", b'compressor="vtkBrotli" version') % b"", "compressor 'vtkBrotli'"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]>' + TWO % b"", "entities"),
        ((TWO % (PIECE % (SQUARE, b""))).decode().encode("utf-16"), "UTF-16"),
        (TWO % (PIECE % (SQUARE + b" 1", b"")), "Points should be 12 numbers"),
        (TWO % (PIECE % (SQUARE, of_cells(b"UInt8", b"vtkGhostType", b"0 1"))), "ghost cells"),
        (TWO % (PIECE % (SQUARE, of_cells(b"Float32", b"vtkGhostType", b"2 -1"))), "ghost cells"),
        (TWO % (PIECE % (SQUARE, of_cells(b"Float64", b"vtkGhostType", b"0 nan"))), "no number for some"),
        (ONE.replace(b'"3"', b'"2"'), "the points have '2' coordinates"),
        (ONE.replace(b">5 5<", b">5 42<"), "polyhedra (VTK cell type 42, cell 1)"),
        (ONE.replace(b">5 5<", b">5 68<"), "Lagrange"),
        (ONE.replace(b"2 3</", b"2 4</"), "cell 1 names point 4"),
        (ONE.replace(b">3 6<", b">3 5<"), "connectivity of Cells should be 5"),
        (
            ONE.replace(b'"ascii">0 1', b'"appended" offset="0">0 1'),
            "there are none",
        ),
    ],
)
def test_refused_by_name(data, why):
    with pytest.raises(InputError, match=re.escape(why)):
        import_module("dvr_cli.files.vtkxml.vtu").read(data)


def test_strips_are_refused():
    data = file("surface-ascii-none-double").replace(b'NumberOfStrips="0"', b'NumberOfStrips="1"')
    with pytest.raises(InputError, match="triangle strips"):
        read(data)


def test_coordinates_that_share_their_bytes_are_refused():
    data = file("grid-raw-none-32-little")
    offset = re.search(rb'Name="Points"[^>]*offset="(\d+)"', data).group(1)
    shared = re.sub(rb'(Name="material"[^>]*offset=")(\d+)', rb"\g<1>" + offset, data)
    with pytest.raises(InputError):
        read(shared)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("count", COUNTS)
def test_damage_is_an_input_error_or_read_consistently(count):
    names = NAMES[:: len(NAMES) // 24]
    for data in mutated([file(name) for name in names], count, seed=14):
        try:
            with np.errstate(invalid="ignore"):  # as where files are opened
                source = read(data)
        except InputError:
            continue
        mesh = source.mesh
        for block in mesh.cells:
            assert block.vertices.min(initial=0) >= 0
            assert block.vertices.max(initial=0) < len(mesh.points)
        assert written(source, mesh.points.copy()) == data
        with np.errstate(all="ignore"):
            points = np.nan_to_num(moved(mesh.points), posinf=1.0, neginf=1.0)
            again = read(written(source, points)).mesh
            expected = source.stored(points)
        same = np.isnan(expected) | (again.points == expected)
        assert same.all()
