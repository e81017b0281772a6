"""Exodus files: netCDF4 and VTK agree, and only coordinates change."""

from __future__ import annotations

import io
from itertools import product

import numpy as np
import pytest

from containers import differences, netcdf_objects
from dvr_cli.cli.main import main
from dvr_cli.errors import InputError, OutputError
from dvr_cli.files import exodus
from dvr_cli.files.formats import format_named
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells, Mesh
from exodus_corpus import VARIANTS, vtk_blocks
from exodus_corpus import exodus as exodus_file
from fuzz import COUNTS, check_damaged
from meshes import random_mesh
from needs import require
from sources import written

require("h5py")
require("netCDF4")

TETRA = random_mesh("tetra", 1)
CELLS = TETRA.cells[0].vertices
HALVES = [("TETRA", CELLS[:70]), ("TETRA", CELLS[70:])]
SETS = {
    "names": ("steel", "brass"),
    "node_sets": {"clamped": [0, 5, 9], "tip": [3]},
    "side_sets": {"pressure": [(1, 1), (80, 4), (2, 3)]},
    "steps": 3,
}

# Corners of the reference cells, and the corners around each further node in Exodus's order (its manual).
HEX = np.array(list(product((0, 1), repeat=3)))[[0, 4, 6, 2, 1, 5, 7, 3]].astype(float)
HEX20 = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 4)]
HEX27 = [*HEX20, range(8), (0, 1, 2, 3), (4, 5, 6, 7), (0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (2, 3, 7, 6)]
WEDGE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=float)
WEDGE15 = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (5, 3)]
PYRAMID = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.375, 0.375, 1]])
PYRAMID13 = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)]
TET10 = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
# name in the file, coordinates, meshio's type
ELEMENTS = {
    "HEX8": (HEX, [], "hexahedron"),
    "HEX20": (HEX, HEX20, "hexahedron20"),
    "HEX27": (HEX, HEX27, "hexahedron27"),
    "WEDGE6": (WEDGE, [], "wedge"),
    "WEDGE15": (WEDGE, WEDGE15, "wedge15"),
    "WEDGE18": (WEDGE, [*WEDGE15, (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)], "wedge18"),
    "PYRAMID5": (PYRAMID, [], "pyramid"),
    "PYRAMID13": (PYRAMID, PYRAMID13, "pyramid13"),
    "TETRA4": (WEDGE[:4], [], "tetra"),
    "TETRA10": (WEDGE[:4], TET10, "tetra10"),
    "SHELL4": (HEX[:4], [], "quad"),
    "SHELL9": (HEX[:4], [(0, 1), (1, 2), (2, 3), (3, 0), (0, 1, 2, 3)], "quad9"),
    "TRISHELL3": (WEDGE[:3], [], "triangle"),
    "TRI6": (WEDGE[:3], [(0, 1), (1, 2), (2, 0)], "triangle6"),
}


def one_element(name: str, **options) -> tuple[np.ndarray, bytes]:
    """The points, in Exodus's order, and a file of one element."""
    corners, around, _ = ELEMENTS[name]
    points = np.array([*corners, *(corners[list(c)].mean(axis=0) for c in around)])
    return points, exodus_file(points, [(name, np.arange(len(points))[None])], **options)


def coordinates(data: bytes) -> np.ndarray:
    """As netCDF4 reads them."""
    netcdf = require("netCDF4")
    with netcdf.Dataset("mesh", memory=data) as file:
        if "coord" in file.variables:
            return np.asarray(file["coord"][:]).T.astype(float)
        names = [f"coord{axis}" for axis in "xyz" if f"coord{axis}" in file.variables]
        return np.stack([np.asarray(file[name][:], dtype=float) for name in names], axis=1)


def files() -> dict[str, bytes]:
    """One file of each kind."""
    flat = random_mesh("mixed2d", 2)
    plane = [("TRI3", flat.cells[0].vertices), ("QUAD4", flat.cells[1].vertices)]
    result = {
        f"{variant}-{'joint' if joint else 'apart'}-{real}": exodus_file(
            TETRA.points, HALVES, variant, joint=joint, real=real, **SETS
        )
        for variant in VARIANTS
        for joint, real in ((False, "f8"), (True, "f8"), (False, "f4"))
    }
    result["plane"] = exodus_file(flat.points, plane)
    result["compressed"] = exodus_file(TETRA.points, HALVES, "NETCDF4", compressed=True, **SETS)
    return result


FILES = files()


@pytest.mark.parametrize("name", FILES)
def test_unmoved_is_identical(name):
    source = exodus.read(FILES[name])
    assert written(source, source.mesh.points.copy()) == FILES[name]
    assert np.array_equal(source.mesh.points, coordinates(FILES[name]))


@pytest.mark.parametrize("name", FILES)
def test_moved_differs_in_coordinates_only(name):
    data = FILES[name]
    source = exodus.read(data)
    points = source.mesh.points.copy()
    points[2:5] += 1 / 3
    new = written(source, points)
    assert np.array_equal(coordinates(new), source.stored(points))
    exact = np.float32 if "f4" in name else np.float64
    assert np.array_equal(source.stored(points), points.astype(exact).astype(float))
    changed = differences(netcdf_objects(data), netcdf_objects(new))
    assert changed in ({"coord"}, {"coordx", "coordy", "coordz"}, {"coordx", "coordy"})
    again = exodus.read(new)
    assert np.array_equal(again.mesh.points, source.stored(points))
    if data[:3] == b"CDF":  # byte for byte, then, but for the coordinates of three points
        different = np.frombuffer(data, np.uint8) != np.frombuffer(new, np.uint8)
        assert 0 < different.sum() <= 3 * points.shape[1] * 8


def test_blocks_sets_and_variables():
    source = exodus.read(FILES["NETCDF3_64BIT_OFFSET-apart-f8"])
    mesh = source.mesh
    assert [block.type for block in mesh.cells] == ["tetra", "tetra"]
    assert [block.vertices.tolist() for block in mesh.cells] == [CELLS[:70].tolist(), CELLS[70:].tolist()]
    assert [np.unique(tags).tolist() for tags in mesh.cell_data["exodus:block"]] == [[10], [20]]
    assert [m.tolist() for m in mesh.cell_sets["steel"]] == [list(range(70)), []]
    assert [m.tolist() for m in mesh.cell_sets["brass"]] == [[], list(range(len(CELLS) - 70))]
    assert {k: v.tolist() for k, v in mesh.point_sets.items()} == {"clamped": [0, 5, 9], "tip": [3]}
    a, b, c = CELLS[[0, 1, 79]]
    facets = [[a[0], a[1], a[3]], [b[0], b[3], b[2]], [c[0], c[2], c[1]]]
    assert mesh.facet_sets["pressure"].tolist() == facets
    n = len(mesh.points)
    assert np.array_equal(mesh.point_data["temp"], 200 + np.arange(n) / n)  # of the last step
    assert np.array_equal(mesh.point_data["disp"], 200 + np.arange(n)[:, None] / n + np.arange(1, 4))
    assert mesh.cell_data["stress"][0].tolist() == (14.0 + np.arange(70)).tolist()
    assert np.isnan(mesh.cell_data["stress"][1]).all()
    assert source.unread == ["not kept: 3 time steps", "not kept: 2 QA records", "not kept: numbers of nodes"]


def test_all_variants_hold_the_same_mesh():
    meshes = [exodus.read(data).mesh for name, data in FILES.items() if name != "plane"]
    for mesh in meshes:
        assert mesh.cell_sets.keys() == meshes[0].cell_sets.keys()
        assert mesh.facet_sets["pressure"].tolist() == meshes[0].facet_sets["pressure"].tolist()
        assert mesh.cells[1].vertices.tolist() == meshes[0].cells[1].vertices.tolist()
        assert mesh.cells[1].vertices.dtype == np.int64


@pytest.mark.parametrize("name", ELEMENTS)
def test_nodes_are_where_meshio_has_them(name):
    """VTK, whose order is meshio's but for wedges, and the straight places of further nodes."""
    points, data = one_element(name)
    block = exodus.read(data).mesh.cells[0]
    assert block.type == ELEMENTS[name][2]
    if name != "HEX8":
        around = CELL_TYPES[block.type].mids
        nodes = block.vertices[0]
        corners = len(nodes) - len(around)
        for k, ends in enumerate(around):
            middle = points[nodes[list(ends)]].mean(axis=0)
            assert np.allclose(points[nodes[corners + k]], middle, atol=1e-15)
    if "wedge" not in block.type:
        (found,) = vtk_blocks(data, "ELEM_BLOCK").values()
        nodes = found[1][0][1]  # the middle of a shell is left out
        assert len(nodes) == block.vertices.shape[1] - (name == "SHELL9")
        assert found[0][nodes].tolist() == points[block.vertices[0]].tolist()[: len(nodes)]


@pytest.mark.parametrize(
    ("name", "sides"),
    [
        ("HEX8", 6),
        ("HEX20", 6),
        ("WEDGE6", 5),
        ("WEDGE15", 5),
        ("PYRAMID5", 5),
        ("TETRA4", 4),
        ("TETRA10", 4),
        ("SHELL4", 6),
        ("TRISHELL3", 5),
    ],
)
def test_sides_are_numbered_as_vtk_has_them(name, sides):
    for side in range(1, sides + 1):
        points, data = one_element(name, side_sets={"side": [(1, side)]})
        (facet,) = exodus.read(data).mesh.facet_sets["side"]
        (found,) = vtk_blocks(data, "SIDE_SET").values()
        nodes, corners = found[1][0][1], points[: len(ELEMENTS[name][0])]
        theirs = {tuple(p) for p in found[0][nodes].tolist()} & {tuple(p) for p in corners.tolist()}
        assert {tuple(p) for p in points[facet[facet >= 0]].tolist()} == theirs


def test_vtk_reads_the_output():
    data = FILES["NETCDF3_64BIT_OFFSET-apart-f8"]
    source = exodus.read(data)
    points = source.mesh.points + np.random.default_rng(3).uniform(-0.01, 0.01, source.mesh.points.shape)
    found = vtk_blocks(written(source, points), "ELEM_BLOCK")
    assert list(found) == ["steel", "brass"]
    for name, block in zip(found, source.mesh.cells, strict=True):
        theirs, cells = found[name]
        assert {kind for kind, _ in cells} == {10}
        ours = points[block.vertices].astype(np.float32)  # as VTK holds them
        assert theirs[[nodes for _, nodes in cells]].tolist() == ours.tolist()


def test_a_file_by_meshio(tmp_path):
    meshio = require("meshio")
    cells = [("tetra", CELLS[:70]), ("tetra", CELLS[70:])]
    meshio.write(tmp_path / "x.e", meshio.Mesh(TETRA.points, cells), file_format="exodus")
    data = (tmp_path / "x.e").read_bytes()
    source = exodus.read(data)
    assert source.mesh.cells[1].vertices.tolist() == CELLS[70:].tolist()
    new = written(source, source.mesh.points + 0.5)
    assert differences(netcdf_objects(data), netcdf_objects(new)) == {"coord"}
    (tmp_path / "x.e").write_bytes(new)
    assert np.array_equal(meshio.read(tmp_path / "x.e").points, TETRA.points + 0.5)


def test_other_formats_as_exodus():
    """VTK reads what meshio writes; cells of another node order are refused, as meshio does not turn them."""
    tetra = Mesh(TETRA.points, [Cells("tetra", CELLS)])
    file = io.BytesIO()
    format_named("exodus").convert(tetra, []).write(tetra.points, file)
    (found,) = vtk_blocks(file.getvalue(), "ELEM_BLOCK").values()
    ours = TETRA.points[CELLS].astype(np.float32)
    assert found[0][[nodes for _, nodes in found[1]]].tolist() == ours.tolist()
    hexahedron = Mesh(np.zeros((20, 3)), [Cells("hexahedron20", np.arange(20)[None])])
    with pytest.raises(OutputError, match="hexahedron20 cells can only be written as exodus"):
        format_named("exodus").convert(hexahedron, [])


@pytest.mark.parametrize(
    ("names", "nodes", "cell_type"),
    [
        ("HEX hex HEX8 hex8 HEXAHEDRON Hexahedron", 8, "hexahedron"),
        ("TETRA TET4 tet TETRA4 tetrahedron", 4, "tetra"),
        ("TETRA TET10 TETRA10", 10, "tetra10"),
        ("TRI TRI3 TRIANGLE TRISHELL TRISHELL3 SHELL SHELL3", 3, "triangle"),
        ("TRI6 TRISHELL6 tri", 6, "triangle6"),
        ("QUAD QUAD4 SHELL SHELL4 quadrilateral", 4, "quad"),
        ("QUAD8 SHELL8 quad shell", 8, "quad8"),
        ("WEDGE WEDGE6 wedge PRISM", 6, "wedge"),
        ("PYRAMID PYRAMID5 PYR", 5, "pyramid"),
        ("BAR BAR2 BEAM BEAM2 TRUSS ROD EDGE2 LINE", 2, "line"),
        ("BAR3 BEAM3", 3, "line3"),
        ("SPHERE sphere CIRCLE POINT NODE", 1, "vertex"),
    ],
)
def test_element_types_in_all_spellings(names, nodes, cell_type):
    points = np.random.default_rng(0).random((nodes + 1, 3))
    for name in names.split():
        block = exodus.read(exodus_file(points, [(name, np.arange(nodes)[None])])).mesh.cells[0]
        assert block.type == cell_type
        assert sorted(block.vertices[0].tolist()) == list(range(nodes))


def test_names_are_kept_apart():
    data = exodus_file(TETRA.points, HALVES, names=("", ""), ids=(7, 9))
    assert list(exodus.read(data).mesh.cell_sets) == ["block_7", "block_9"]
    data = exodus_file(TETRA.points, HALVES, names=("x", "x"), ids=(7, 9))
    assert list(exodus.read(data).mesh.cell_sets) == ["x", "x (block 9)"]
    data = exodus_file(TETRA.points, HALVES, names=("x", "x"), ids=(7, 7))
    assert len(exodus.read(data).mesh.cell_sets) == 2


def test_element_sets_and_empty_blocks():
    def more(file):
        file.createDimension("num_el_in_blk3", 0)
        file.createDimension("num_elem_sets", 1)
        file.createVariable("els_prop1", "i4", ("num_elem_sets",))[:] = 4
        file.createDimension("num_ele_els1", 3)
        file.createVariable("elem_els1", "i4", ("num_ele_els1",))[:] = [1, 71, 70]

    mesh = exodus.read(exodus_file(TETRA.points, HALVES, "NETCDF4", extra=more)).mesh
    assert [m.tolist() for m in mesh.cell_sets["elemset_4"]] == [[0, 69], [0]]


def test_the_interface_between_blocks_stays(tmp_path):
    flat = random_mesh("quad", 5, n=4)
    left = flat.points[flat.cells[0].vertices].mean(axis=1)[:, 0] < 0.5
    blocks = [("QUAD4", flat.cells[0].vertices[side]) for side in (left, ~left)]
    data = exodus_file(flat.points, blocks, real="f4", steps=1)
    (tmp_path / "in.e").write_bytes(data)
    assert main(["smooth", str(tmp_path / "in.e"), str(tmp_path / "out.e"), "-q", "-n", "2"]) == 0
    new = (tmp_path / "out.e").read_bytes()
    changed = differences(netcdf_objects(data), netcdf_objects(new))
    assert changed == {"coordx", "coordy"}
    between = np.intersect1d(blocks[0][1], blocks[1][1])
    before, after = coordinates(data), coordinates(new)
    assert len(between) == 5
    assert np.array_equal(before[between], after[between])


def without(name: str):
    return lambda file: file.renameVariable(name, "gone")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"hello", "it is no netCDF file"),
        (FILES["NETCDF4-apart-f8"][:3000], "damaged, or no HDF5 file"),
        (FILES["plane"][:300], "the file ends within its header"),
        (FILES["plane"][:-200], "the file ends before the variable"),
        (exodus_file(TETRA.points, [("NSIDED", CELLS)]), "elements of type NSIDED are not supported"),
        (exodus_file(TETRA.points, [("nfaced", CELLS)]), "elements of type NFACED are not supported"),
        (exodus_file(TETRA.points, [("TETRA", CELLS[:, :3])]), "type TETRA with 3 nodes are not supported"),
        (exodus_file(TETRA.points, [("FOO", CELLS)]), "elements of type FOO with 4 nodes"),
        (exodus_file(TETRA.points, [("", CELLS)]), "elements without a type with 4 nodes"),
        (exodus_file(TETRA.points[:, :1], HALVES), "of 1 coordinates; 2 or 3"),
        (exodus_file(TETRA.points, [("TETRA", CELLS + 1)]), "names node 65, but there are 64"),
        (exodus_file(TETRA.points, HALVES, extra=without("coordy")), "it has no variable coordy"),
        (exodus_file(TETRA.points, HALVES, extra=without("connect2")), "it has no variable connect2"),
        (exodus_file(TETRA.points, HALVES, real="i4"), "does not hold a number for each"),
        (
            exodus_file(TETRA.points, HALVES, side_sets={"s": [(1, 5)]}),
            "side set s names side 5, but there are 4",
        ),
        (
            exodus_file(TETRA.points, HALVES, extra=lambda file: file.createDimension("num_processors", 4)),
            "one of the 4 parts of a mesh",
        ),
    ],
)
def test_refused_with_one_line_that_says_why(data, words):
    with pytest.raises(InputError) as caught:
        exodus.read(data)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(count):
    small = random_mesh("tetra", 1, n=1)
    blocks = [("TETRA", small.cells[0].vertices)]
    kinds = VARIANTS[:3]
    whole = [exodus_file(small.points, blocks, kind, side_sets={"s": [(1, 2)]}, steps=1) for kind in kinds]
    check_damaged(whole, count, 23, exodus.read, 0.05)
