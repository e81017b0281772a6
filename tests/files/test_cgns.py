"""CGNS files: Gmsh writes and reads them, VTK reads them, h5py looks into them; only coordinates change."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cgns_corpus import cgns, condition, node, section, zone
from containers import differences, hdf5_objects
from dvr_cli.cli.main import main
from dvr_cli.errors import DvrError, InputError
from dvr_cli.files import cgns as format_
from fuzz import COUNTS, mutated
from gmsh_cad import KINDS, check_nodes, nodes_by_gmsh, two_boxes, written_by_gmsh
from meshes import random_mesh
from needs import require
from sources import written

h5py = require("h5py")

TETRA = random_mesh("tetra", 1, n=2)
CELLS = TETRA.cells[0].vertices + 1
QUADS = random_mesh("quad", 5, n=4)


def one_zone(*fill: Callable[[Any], None], real: str = "f8") -> bytes:
    """Tetrahedra in one zone, numbered from 1, and what ``fill`` adds to it."""

    def build(base):
        made = zone(base, "Zone", TETRA.points, len(CELLS), real)
        section(made, "Tets", "TETRA_4", 1, len(CELLS), CELLS)
        for add in fill:
            add(made)

    return cgns(build)


def two_zones(base: Any) -> None:
    """Quadrilaterals of the left and right half of a square; the vertices between them are in both."""
    cells = QUADS.cells[0].vertices
    left = QUADS.points[cells].mean(axis=1)[:, 0] < 0.5
    for name, side in (("left", left), ("right", ~left)):
        own, local = np.unique(cells[side], return_inverse=True)
        made = zone(base, name, QUADS.points[own], side.sum())
        section(made, "Quads", "QUAD_4", 1, side.sum(), local.reshape(-1, 4) + 1)


@pytest.fixture(scope="module")
def boxes(tmp_path_factory) -> bytes:
    return two_boxes(tmp_path_factory.mktemp("cgns") / "boxes.cgns")


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("cgns")
    kinds = [kind for kind in KINDS if kind != "pyramid13"]  # which Gmsh does not write
    made = {kind: written_by_gmsh(kind, folder / f"{kind}.cgns") for kind in kinds}
    return {**made, "float32": one_zone(real="f4"), "zones": cgns(two_zones, (2, 2))}


def test_unmoved_is_identical_and_moved_differs_in_coordinates_only(files):
    for kind in ("tetra", "wedge15", "float32", "zones"):
        data = files[kind]
        source = format_.read(data)
        assert written(source, source.mesh.points.copy()) == data
        points = source.mesh.points.copy()
        points[1:] += 1 / 3
        new = written(source, points)
        paths = differences(hdf5_objects(data), hdf5_objects(new))
        assert len(paths) == (4 if kind == "zones" else 3)
        assert {path.split("/")[-2][:-1] for path in paths} == {"Coordinate"}
        stored = points.astype(np.float32) if kind == "float32" else points
        assert np.array_equal(source.stored(points), stored.astype(float))
        assert np.array_equal(format_.read(new).mesh.points, source.stored(points))


def test_gmsh_reads_the_output(boxes, tmp_path):
    source = format_.read(boxes)
    points = source.mesh.points + np.linspace(0, 0.01, source.mesh.points.size).reshape(-1, 3)
    (tmp_path / "new.cgns").write_bytes(written(source, points))
    assert np.array_equal(nodes_by_gmsh(tmp_path / "new.cgns"), points)


def test_vtk_reads_the_output(boxes, tmp_path):
    vtk = require("vtk")
    from vtk.util.numpy_support import vtk_to_numpy

    source = format_.read(boxes)
    points = source.mesh.points + 0.125
    path = tmp_path / "new.cgns"
    path.write_bytes(written(source, points))
    reader = vtk.vtkCGNSReader()
    reader.SetFileName(str(path))
    reader.DoublePrecisionMeshOn()
    reader.Update()
    part = reader.GetOutput().GetBlock(0).GetBlock(0)
    assert np.array_equal(vtk_to_numpy(part.GetPoints().GetData()), points)
    cells = part.GetCells()
    sizes = np.diff(vtk_to_numpy(cells.GetOffsetsArray()))
    theirs = vtk_to_numpy(cells.GetConnectivityArray())[np.repeat(sizes == 4, sizes)]
    ours = [block.vertices for block in source.mesh.cells if block.type == "tetra"]
    assert theirs.reshape(-1, 4).tolist() == np.concatenate(ours).tolist()


def test_nodes_are_where_meshio_has_them(files):
    """Gmsh knows CGNS's node orders: middles lie in the middle, volumes are positive."""
    found = set().union(*(check_nodes(format_.read(data).mesh) for data in files.values()))
    assert found >= (set(KINDS) - {"pyramid13"}) | {"triangle6", "quad8", "quad9", "line3", "vertex"}


def test_families_and_boundary_conditions_are_sets(boxes):
    source = format_.read(boxes)
    mesh = source.mesh
    x = [mesh.points[block.vertices].mean(axis=1)[:, 0] for block in mesh.cells]
    tetra = [block.type == "tetra" for block in mesh.cells]
    for b, members in enumerate(mesh.cell_sets["steel"]):
        assert members.tolist() == np.flatnonzero((x[b] < 1) & tetra[b]).tolist()
    assert {"wall", "inlet", "brass", "corner", "V_1"} <= mesh.cell_sets.keys()
    families = [
        np.unique(f).tolist() for f, solid in zip(mesh.cell_data["cgns:family"], tetra, strict=True) if solid
    ]
    assert len({family for found in families for family in found}) == 2
    assert source.unread == ["not kept: 1 descriptor", "not kept: 6 boundary conditions"]


def test_boundary_conditions_in_all_ways():
    def fill(made):
        n = len(CELLS)
        section(made, "Skin", "TRI_3", n + 1, 2, CELLS[:2, :3])
        section(made, "Loose", "TRI_3", n + 3, 1, CELLS[2, :3])
        condition(made, "a", PointList=[3, 5])
        condition(made, "b", PointRange=[2, 4], location="Vertex")
        condition(made, "c", PointList=[n + 2], location="FaceCenter", family="F")
        condition(made, "d", ElementList=[n + 1])
        condition(made, "e", ElementRange=[1, 3])
        condition(made, "f", PointRange=[n + 1, n + 1], location="FaceCenter", family="F")

    mesh = format_.read(one_zone(fill)).mesh
    assert {name: v.tolist() for name, v in mesh.point_sets.items()} == {"a": [2, 4], "b": [1, 2, 3]}
    found = {name: [m.tolist() for m in lists] for name, lists in mesh.cell_sets.items()}
    assert found == {
        "c": [[], [1], []],
        "F": [[], [0, 1], []],
        "d": [[], [0], []],
        "e": [[0, 1, 2], [], []],
        "f": [[], [0], []],
        "Loose": [[], [], [0]],
    }


@pytest.mark.parametrize("with_offsets", [True, False])
def test_mixed_sections(with_offsets):
    flat = random_mesh("mixed2d", 2)
    triangles, quads = (block.vertices + 1 for block in flat.cells)
    rows = [[5, *row] for row in triangles.tolist()]
    for i, row in enumerate(quads.tolist()):
        rows.insert(2 * i, [7, *row])
    offsets = np.cumsum([0, *map(len, rows)]) if with_offsets else None

    def build(base):
        made = zone(base, "Zone", flat.points, len(rows))
        section(made, "All", "MIXED", 1, len(rows), np.concatenate(rows), offsets)
        condition(made, "first", ElementRange=[1, 2])

    mesh = format_.read(cgns(build, (2, 2))).mesh
    assert {b.type: b.vertices.tolist() for b in mesh.cells} == {
        "quad": flat.cells[1].vertices.tolist(),
        "triangle": flat.cells[0].vertices.tolist(),
    }
    assert [m.tolist() for m in mesh.cell_sets["first"]] == [[0], [0]]


def test_zones_are_one_mesh_and_stay_together(tmp_path):
    data = cgns(two_zones, (2, 2))
    mesh = format_.read(data).mesh
    assert [np.unique(tags).tolist() for tags in mesh.cell_data["cgns:zone"]] == [[1], [2]]
    pairs = mesh.points[mesh.periodic]
    assert len(pairs) == 5
    assert np.array_equal(pairs[:, 0], pairs[:, 1])
    (tmp_path / "in.cgns").write_bytes(data)
    paths = [str(tmp_path / name) for name in ("in.cgns", "out.cgns")]
    for boundary in ("fixed", "slide"):
        assert main(["smooth", *paths, "-q", "-n", "2", "--boundary", boundary]) == 0
        after = format_.read((tmp_path / "out.cgns").read_bytes()).mesh
        assert not np.array_equal(after.points, mesh.points)
        assert np.array_equal(after.points[mesh.periodic], pairs)


def test_what_connects_zones_is_held():
    def connect(made):
        ties = node(made, "ZoneGridConnectivity", "ZoneGridConnectivity_t")
        tie = node(ties, "tie", "GridConnectivity1to1_t", "Other")
        node(tie, "PointList", "IndexArray_t", np.array([[2], [7]], np.int32))

    mesh = format_.read(one_zone(connect)).mesh
    assert np.unique(mesh.periodic).tolist() == [1, 6]


def test_the_interface_between_families_stays(boxes, tmp_path):
    (tmp_path / "in.cgns").write_bytes(boxes)
    paths = [str(tmp_path / name) for name in ("in.cgns", "out.cgns")]
    assert main(["smooth", *paths, "-q", "-n", "2"]) == 0
    new = (tmp_path / "out.cgns").read_bytes()
    assert len(differences(hdf5_objects(boxes), hdf5_objects(new))) == 3
    before, after = nodes_by_gmsh(tmp_path / "in.cgns"), nodes_by_gmsh(tmp_path / "out.cgns")
    between = before[:, 0] == 1
    assert between.sum() > 4
    assert np.array_equal(before[between], after[between])


def rind(made: Any) -> None:
    node(made["GridCoordinates"], "Rind", "Rind_t", np.array([0, 4], np.int32))


def polar(made: Any) -> None:
    made["GridCoordinates"].move("CoordinateX", "CoordinateR")
    made["GridCoordinates"].move("CoordinateY", "CoordinateTheta")


def structured(made: Any) -> None:
    made["ZoneType/ data"][...] = np.frombuffer(b"Structured\0\0", np.int8)


def moving(made: Any) -> None:
    made.copy("GridCoordinates", "GridCoordinates#2")


def link(made: Any) -> None:
    node(made, "Flow", "", "other.cgns").attrs["type"] = np.bytes_(b"LK")


def polygons(made: Any) -> None:
    made["Tets/ data"][0] = 22


def third_order(made: Any) -> None:
    made["Tets/ data"][0] = 30


def wrong_vertex(made: Any) -> None:
    made["Tets/ElementConnectivity/ data"][3] = 999


def wrong_count(made: Any) -> None:
    made["Tets/ElementRange/ data"][1] -= 1


def two_bases() -> bytes:
    return cgns(two_zones, (2, 2), {"Another": two_zones})


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\x01@(#)ADF Database Version A02011", "it is an ADF file"),
        (b"hello", "damaged, or no HDF5 file"),
        (one_zone()[:3000], "damaged, or no HDF5 file"),
        (cgns(lambda base: None), "it has no CGNS base with a zone"),
        (two_bases(), "several bases with unstructured zones: Base, Another"),
        (one_zone(rind), "has a rind"),
        (one_zone(polar), "there are: CoordinateR, CoordinateTheta, CoordinateZ"),
        (one_zone(structured), "all its zones are structured"),
        (one_zone(moving), "has 2 sets of coordinates"),
        (one_zone(link), "is a link to another place or file"),
        (one_zone(polygons), "polygons (NGON_n) are not supported"),
        (one_zone(third_order), "elements of type 30, of third order or unknown, are not supported"),
        (one_zone(wrong_vertex), "names vertex 999, but there are 27"),
        (one_zone(wrong_count), "does not hold 4 nodes for each of 47 elements"),
        (one_zone(lambda made: condition(made, "x", PointList=[28])), "names more than there are: 27"),
    ],
)
def test_refused_with_one_line_that_says_why(data, words):
    with pytest.raises(InputError) as caught:
        format_.read(data)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


def test_of_several_bases_the_one_with_an_unstructured_mesh():
    mesh = format_.read(cgns(two_zones, (2, 2), {"Empty": lambda base: None})).mesh
    assert len(mesh.cells) == 2


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(files, count):
    whole = [files["pyramid"], files["float32"], files["zones"]]
    expected = [format_.read(data).mesh for data in whole]
    messages, read_well = [], 0
    for i, data in enumerate(mutated(whole, count // 4, seed=31)):
        try:
            source = format_.read(data)
            points = source.mesh.points + 0.25
            again = format_.read(written(source, points)).mesh
        except DvrError as error:
            messages.append(str(error))
            continue
        read_well += 1
        assert written(source, source.mesh.points.copy()) == data
        assert np.array_equal(again.points, source.stored(points), equal_nan=True)
        cells = [(block.type, len(block.vertices)) for block in again.cells]  # none gone unnoticed
        assert cells == [(block.type, len(block.vertices)) for block in expected[i % 3].cells]
    assert read_well > 0
    assert len(messages) > count // 16
    assert all(len(message) < 300 and message.isprintable() for message in messages)
