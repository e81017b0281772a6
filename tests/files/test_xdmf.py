"""XDMF: what is read, what is written back, and what is refused; VTK, meshio and h5py are the oracles."""

from __future__ import annotations

import re
from io import BytesIO
from pathlib import Path

import meshio
import numpy as np
import pytest

from dvr_cli.errors import DvrError, InputError, OutputError
from dvr_cli.files import obj, xdmf
from dvr_cli.files.reading import open_mesh
from dvr_cli.files.source import InputFile
from dvr_cli.files.writing import Output
from dvr_cli.files.xdmf.convert import convert
from dvr_cli.mesh.mesh import Cells, Mesh
from fuzz import COUNTS, mutated
from needs import require

h5py = require("h5py")

POINTS = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [0.9, 1.1, 0], [3, 1, 0]], dtype=float)
TRIANGLES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 5, 2]])
TAGS = np.array([1, 1, 2, 2, 3])
MOVED = POINTS + np.where(np.arange(6) == 4, 0.1, 0)[:, None] * [1, -1, 0]


def mesh(dtype: type = np.float64) -> meshio.Mesh:
    return meshio.Mesh(
        POINTS.astype(dtype),
        [("triangle", TRIANGLES)],
        point_data={"u": np.arange(6.0), "v": np.arange(18.0).reshape(6, 3)},
        cell_data={"material": [TAGS]},
    )


def by_meshio(folder: Path, data_format: str = "HDF", dtype: type = np.float64) -> Path:
    path = folder / "mesh.xdmf"
    meshio.write(path, mesh(dtype), file_format="xdmf", data_format=data_format)
    return path


FENICS = """<?xml version="1.0"?>
<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>
<Xdmf Version="3.0" xmlns:xi="https://www.w3.org/2001/XInclude">
  <Domain>
    <Grid Name="mesh" GridType="Uniform">
      <Topology TopologyType="Triangle" NumberOfElements="5" NodesPerElement="3">
        <DataItem Dimensions="5 3" NumberType="Int" Format="HDF">mesh.h5:/Mesh/mesh/topology</DataItem>
      </Topology>
      <Geometry GeometryType="XY">
        <DataItem Dimensions="6 2" Format="HDF">
          mesh.h5:/Mesh/mesh/geometry
        </DataItem>
      </Geometry>
    </Grid>
    <Grid Name="cell_tags" GridType="Uniform">
      <xi:include xpointer="xpointer(/Xdmf/Domain/Grid/Geometry)" />
      <Topology TopologyType="Triangle" NumberOfElements="3" NodesPerElement="3">
        <DataItem Dimensions="3 3" NumberType="Int" Format="HDF">mesh.h5:/MeshTags/cells/topology</DataItem>
      </Topology>
      <Attribute Name="cell_tags" AttributeType="Scalar" Center="Cell">
        <DataItem Dimensions="3 1" Format="HDF">mesh.h5:/MeshTags/cells/Values</DataItem>
      </Attribute>
    </Grid>
    <Grid Name="facet_tags" GridType="Uniform">
      <xi:include xpointer="xpointer(/Xdmf/Domain/Grid/Geometry)" />
      <Topology TopologyType="PolyLine" NumberOfElements="2" NodesPerElement="2">
        <DataItem Dimensions="2 2" NumberType="Int" Format="HDF">mesh.h5:/MeshTags/facets/topology</DataItem>
      </Topology>
      <Attribute Name="facet_tags" AttributeType="Scalar" Center="Cell">
        <DataItem Dimensions="2 1" Format="HDF">mesh.h5:/MeshTags/facets/Values</DataItem>
      </Attribute>
    </Grid>
    <Grid Name="f" GridType="Collection" CollectionType="Temporal">
      <Grid Name="f" GridType="Uniform">
        <xi:include xpointer="xpointer(/Xdmf/Domain/Grid[1]/*[self::Topology or self::Geometry])" />
        <Time Value="0.5" />
        <Attribute Name="f" AttributeType="Scalar" Center="Node">
          <DataItem Dimensions="6 1" Format="HDF">mesh.h5:/Function/f/0</DataItem>
        </Attribute>
      </Grid>
    </Grid>
  </Domain>
</Xdmf>
"""


def as_dolfinx(folder: Path, dtype: type = np.float64, **layout: object) -> Path:
    """A mesh with tags on cells and facets and a function in time, laid out as dolfinx does."""
    with h5py.File(folder / "mesh.h5", "w") as file:
        file["Mesh/mesh/topology"] = TRIANGLES
        geometry = file.create_dataset("Mesh/mesh/geometry", data=POINTS[:, :2].astype(dtype), **layout)
        geometry.attrs["unit"] = "mm"
        file["MeshTags/cells/topology"] = TRIANGLES[[3, 2, 4]][:, [1, 2, 0]]
        file["MeshTags/cells/Values"] = np.array([[7], [7], [9]], dtype=np.int32)
        file["MeshTags/facets/topology"] = np.array([[0, 1], [1, 2]])
        file["MeshTags/facets/Values"] = np.array([[4], [5]], dtype=np.int32)
        file["Function/f/0"] = np.arange(6.0)[:, None]
        file["deep/unnamed"] = np.arange(3)
    path = folder / "mesh.xdmf"
    path.write_text(FENICS)
    return path


def datasets(path: Path) -> dict[str, tuple]:
    """All objects of an HDF5 file: type, values and attributes."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, item: found.update(
                {name: (item.dtype, item[()].tobytes(), dict(item.attrs)) if hasattr(item, "dtype") else ()}
            )
        )
    return found


def read_with_vtk(path: Path) -> object:
    reader = require("vtkmodules.vtkIOXdmf2").vtkXdmfReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutputDataObject(0)


def points_of(data: object) -> np.ndarray:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return vtk_to_numpy(data.GetPoints().GetData())


def write(source: object, path: Path, points: np.ndarray) -> None:
    Output(source, path).write(points)


@pytest.mark.parametrize("name", ["out.xdmf", "mesh.xdmf", "elsewhere/mesh.xdmf", "elsewhere/other.xmf"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_both_files_are_right(tmp_path, name, dtype):
    before = by_meshio(tmp_path, dtype=dtype)
    text, objects = before.read_text(), datasets(tmp_path / "mesh.h5")
    (tmp_path / "elsewhere").mkdir()
    target = tmp_path / name
    source = open_mesh(before)
    write(source, target, MOVED)
    kept = name.endswith("mesh.xdmf") or "other" in name
    heavy = target.parent / "mesh.h5" if kept else target.with_suffix(".h5")
    assert target.read_text() == (text if kept else text.replace("mesh.h5", "out.h5"))
    after = datasets(heavy)
    assert np.frombuffer(after["data0"][1], dtype).reshape(-1, 3).tolist() == MOVED.astype(dtype).tolist()
    assert {k: v for k, v in after.items() if k != "data0"} == {
        k: v for k, v in objects.items() if k != "data0"
    }
    again = meshio.read(target)
    assert again.points.tolist() == MOVED.astype(dtype).tolist()
    assert again.cells[0].data.tolist() == TRIANGLES.tolist()
    assert points_of(read_with_vtk(target)).tolist() == MOVED.astype(dtype).tolist()
    if name != "mesh.xdmf":
        assert (before.read_text(), datasets(tmp_path / "mesh.h5")) == (text, objects)


@pytest.mark.parametrize("layout", [{}, {"chunks": (2, 2), "compression": "gzip", "shuffle": True}])
def test_unmoved_is_identical_and_moved_in_place_differs_in_coordinates_only(tmp_path, layout):
    path = as_dolfinx(tmp_path, **layout)
    heavy = (tmp_path / "mesh.h5").read_bytes()
    write(open_mesh(path), path, open_mesh(path).mesh.points)
    assert ((tmp_path / "mesh.h5").read_bytes(), path.read_text()) == (heavy, FENICS)
    before = datasets(tmp_path / "mesh.h5")
    write(open_mesh(path), path, MOVED[:, :2])
    after = datasets(tmp_path / "mesh.h5")
    assert path.read_text() == FENICS
    place = "Mesh/mesh/geometry"
    assert np.frombuffer(after[place][1]).reshape(-1, 2).tolist() == MOVED[:, :2].tolist()
    assert after.pop(place)[::2] == before.pop(place)[::2]
    assert after == before
    with h5py.File(tmp_path / "mesh.h5") as file:
        assert file[place].compression == layout.get("compression")
    if not layout:  # the very bytes
        new = (tmp_path / "mesh.h5").read_bytes()
        assert len(new) == len(heavy)
        old_bytes = POINTS[:, :2].tobytes()
        assert new.replace(MOVED[:, :2].tobytes(), old_bytes) == heavy


def test_tags_of_dolfinx_are_data_and_cells(tmp_path):
    source = open_mesh(as_dolfinx(tmp_path))
    assert [(b.type, b.vertices.tolist()) for b in source.mesh.cells] == [
        ("triangle", TRIANGLES.tolist()),
        ("line", [[0, 1], [1, 2]]),
    ]
    assert [b.tolist() for b in source.mesh.cell_data["cell_tags"]] == [[0, 0, 7, 7, 9], [0, 0]]
    assert [b.tolist() for b in source.mesh.cell_data["facet_tags"]] == [[0] * 5, [4, 5]]
    assert source.unread == ["not kept: 1 step of a series in time"]
    assert source.mesh.points.shape == (6, 2)


@pytest.mark.parametrize("layout", [{}, {"chunks": (2, 2), "compression": "gzip"}])
def test_widened_hdf5_keeps_layout_and_attributes(tmp_path, layout):
    path = as_dolfinx(tmp_path, np.float32, **layout)
    source = open_mesh(path)
    output = Output(source, tmp_path / "out.xdmf")
    assert output.stored(MOVED[:, :2]).tolist() == MOVED[:, :2].astype(np.float32).tolist()
    assert output.widen()
    assert not output.widen()
    assert output.stored(MOVED[:, :2]).tolist() == MOVED[:, :2].tolist()
    output.write(MOVED[:, :2])
    with h5py.File(tmp_path / "out.h5") as file:
        geometry = file["Mesh/mesh/geometry"]
        assert geometry.dtype == np.float64
        assert geometry[()].tolist() == MOVED[:, :2].tolist()
        assert dict(geometry.attrs) == {"unit": "mm"}
        assert geometry.compression == layout.get("compression")
    expected = FENICS.replace("mesh.h5", "out.h5")
    expected = expected.replace('Dimensions="6 2"', 'Precision="8" Dimensions="6 2"')
    assert (tmp_path / "out.xdmf").read_text() == expected
    assert open_mesh(tmp_path / "out.xdmf").mesh.points.tolist() == MOVED[:, :2].tolist()


def test_inline_text_and_raw_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where meshio writes and reads raw files
    for data_format in ("XML", "Binary"):
        path = by_meshio(Path(), data_format)
        text = path.read_text()
        write(open_mesh(path), Path("out.xdmf"), MOVED)
        assert meshio.read("out.xdmf").points.tolist() == MOVED.tolist()
        if data_format == "XML":
            old, new = text.split(), Path("out.xdmf").read_text().split()
            changed = [(a, b) for a, b in zip(old, new, strict=True) if a != b]
            assert [float(b) for _, b in changed] == MOVED[4, :2].tolist()
        else:
            assert Path("out.bin").read_bytes() == MOVED.tobytes()
            assert Path("out.xdmf").read_text() == text.replace("mesh0.bin", "out.bin")


ARRAYS = """<Xdmf><Domain><Grid><Topology TopologyType="Mixed" NumberOfElements="4">
<DataItem Dimensions="18" NumberType="Int">4 0 1 4  5 1 5 2 4  2 2 0 1  2 3 1 2 3</DataItem></Topology>
<Geometry GeometryType="X_Y_Z"><DataItem Dimensions="6" Precision="8">0 2 2 0 .9 3</DataItem>
<DataItem Dimensions="6" Precision="8">0 0 2 2 1.1 1</DataItem>
<DataItem Dimensions="6" Precision="8">0 0 0 0 0 0</DataItem></Geometry>
<Attribute Name="a" Center="Cell"><DataItem Dimensions="4" NumberType="Int">1 2 3 4</DataItem></Attribute>
</Grid></Domain></Xdmf>
"""
OTHER = ARRAYS[ARRAYS.index("<Grid") : ARRAYS.index("</Domain")].replace(".9", "1")


def test_coordinates_apart_and_mixed_cells(tmp_path):
    path = tmp_path / "a.xmf"
    path.write_text(ARRAYS)
    source = open_mesh(path)
    assert source.mesh.points.tolist() == POINTS.tolist()
    assert [(b.type, b.vertices.tolist()) for b in source.mesh.cells] == [
        ("triangle", [[0, 1, 4]]),
        ("quad", [[1, 5, 2, 4]]),
        ("line", [[0, 1], [1, 2], [2, 3]]),
    ]
    assert [b.tolist() for b in source.mesh.cell_data["a"]] == [[1], [2], [3, 4, 4]]
    write(source, tmp_path / "b.xmf", MOVED)
    assert (tmp_path / "b.xmf").read_text() == ARRAYS.replace(".9", "1.0").replace("1.1", "1.0")


def test_a_field_is_added_and_replaced(tmp_path):
    path = as_dolfinx(tmp_path)
    for value in (0.25, 0.5):
        source = open_mesh(path)
        output = Output(source, path, field="a & q")
        output.fill([np.full(len(b.vertices), value) for b in source.mesh.cells], source.mesh.points)
        output.write(source.mesh.points)
    mesh = open_mesh(path).mesh
    assert [b.tolist() for b in mesh.cell_data["a & q"]] == [[0.5] * 5, [0.5] * 2]
    assert re.sub(r"<Attribute Name=\"a &amp; q.*?</Attribute>", "", path.read_text()) == FENICS


def test_a_foreign_file_is_never_overwritten(tmp_path):
    path = by_meshio(tmp_path)
    foreign = tmp_path / "out.h5"
    foreign.write_bytes(b"precious")
    with pytest.raises(OutputError, match=r"out\.h5 is in the way"):
        Output(open_mesh(path), tmp_path / "out.xdmf")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub/mesh.h5").write_bytes(b"precious")
    write(open_mesh(path), tmp_path / "sub/new.xdmf", MOVED)
    assert (tmp_path / "sub/mesh.h5").read_bytes() == foreign.read_bytes() == b"precious"
    assert meshio.read(tmp_path / "sub/new.xdmf").points.tolist() == MOVED.tolist()
    write(open_mesh(path), tmp_path / "sub/new.xdmf", POINTS)  # what is its own may be written again
    assert meshio.read(tmp_path / "sub/new.xdmf").points.tolist() == POINTS.tolist()


def test_pipes_are_refused(tmp_path):
    path = by_meshio(tmp_path)
    with pytest.raises(OutputError, match="cannot be piped"):
        Output(open_mesh(path), Path("-"))


PETSC = """<?xml version="1.0" ?>
<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" [
<!-- <!ENTITY HeavyData "other.h5"> -->
<!ENTITY HeavyData "mesh.h5">
]>
<Xdmf><Domain Name="domain">
<DataItem Name="cells" ItemType="Uniform" Format="HDF" NumberType="Float" Precision="8" Dimensions="5 3">
  &HeavyData;:/viz/topology/cells
</DataItem>
<DataItem Name="vertices" Format="HDF" Dimensions="6 3">&HeavyData;:/geometry/vertices</DataItem>
<Grid Name="domain" GridType="Uniform">
<Topology TopologyType="Triangle" NumberOfElements="5">
<DataItem Reference="XML">/Xdmf/Domain/DataItem[@Name="cells"]</DataItem>
</Topology>
<Geometry GeometryType="XYZ"><DataItem Reference="/Xdmf/Domain[1]/DataItem[2]"/></Geometry>
</Grid></Domain></Xdmf>
"""


def by_petsc(folder: Path, text: str = PETSC) -> Path:
    """As petsc_gen_xdmf.py writes it: cells as floating-point numbers, entities and references."""
    with h5py.File(folder / "mesh.h5", "w") as file:
        file["viz/topology/cells"] = TRIANGLES.astype(float)
        file["geometry/vertices"] = POINTS
    path = folder / "petsc.xmf"
    path.write_text(text)
    return path


def test_references_and_entities_are_followed(tmp_path):
    path = by_petsc(tmp_path)
    source = open_mesh(path)
    assert source.mesh.points.tolist() == POINTS.tolist()
    assert source.mesh.cells[0].vertices.tolist() == TRIANGLES.tolist()
    write(source, tmp_path / "new.xmf", MOVED)
    assert (tmp_path / "new.xmf").read_text() == PETSC.replace(
        "&HeavyData;:/geometry", "new.h5:/geometry"
    ).replace("&HeavyData;:/viz", "new.h5:/viz")
    again = open_mesh(tmp_path / "new.xmf").mesh
    assert again.points.tolist() == MOVED.tolist()
    assert again.cells[0].vertices.tolist() == TRIANGLES.tolist()
    assert open_mesh(path).mesh.points.tolist() == POINTS.tolist()
    write(open_mesh(path), path, MOVED)  # in place
    assert path.read_text() == PETSC
    assert open_mesh(path).mesh.points.tolist() == MOVED.tolist()


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('[@Name="cells"]', '[@Name="cell"]', "refers to another"),
        ('[@Name="cells"]', "", "refers to another"),  # there are two
        ('[@Name="cells"]', "[position()=1]", "refers to another"),
        ("DataItem[2]", "DataItem[3]", "refers to another"),
        ('"mesh.h5">', '"&other;">', "entities declared"),
        ('"mesh.h5">', '"mesh.h5:/viz">', "entities declared"),
        ('"mesh.h5">', 'SYSTEM "mesh.h5">', "entities declared"),
        ("!ENTITY HeavyData", "!ENTITY % HeavyData", "entit"),
        ('!ENTITY HeavyData "mesh.h5"', '!ENTITY Other "mesh.h5"', "&HeavyData; is missing"),
    ],
)
def test_other_references_and_entities_are_refused(tmp_path, old, new, why):
    assert old in PETSC
    at = PETSC.rindex(old)
    with pytest.raises(InputError, match=why):
        open_mesh(by_petsc(tmp_path, PETSC[:at] + new + PETSC[at + len(old) :]))


@pytest.mark.parametrize("beside", [True, False])
def test_other_formats_become_files_that_vtk_reads(tmp_path, monkeypatch, beside):
    """The arrays are in an HDF5 file; without h5py, as simulated here, they are text."""
    vtk_corpus = pytest.importorskip("vtk_corpus")
    monkeypatch.setattr("dvr_cli.files.xdmf.convert.is_there", lambda: beside)
    from dvr_cli.files import vtk

    for build in ("all_linear", "second_order"):
        data = vtk_corpus.write(getattr(vtk_corpus, build)(), 51, True)
        source = vtk.read(data)
        blocks = [b for b in source.mesh.cells if b.type in CONVERTED]
        source.mesh.cells = blocks
        source.mesh.cell_data = {"n": [np.arange(len(b.vertices)) for b in blocks]}
        path = tmp_path / f"{build}.xdmf"
        output = Output(source, path)
        output.write(source.mesh.points)
        assert (tmp_path / f"{build}.h5").exists() == beside
        oracle = read_with_vtk(path)
        assert points_of(oracle).tolist() == source.mesh.points.tolist()
        kinds = [oracle.GetCellType(i) for i in range(oracle.GetNumberOfCells())]
        before = vtk_corpus.cells(vtk_corpus.read_with_vtk(data))
        known = {kind: nodes for kind, nodes in before if kind not in (8, 11)}
        for i, kind in enumerate(kinds):
            if kind in known and kinds.count(kind) == 1:
                cell = oracle.GetCell(i)
                assert [cell.GetPointId(k) for k in range(cell.GetNumberOfPoints())] == known[kind]
        again = open_mesh(path).mesh
        # runs of one type are one block
        assert rows(b.vertices for b in again.cells) == rows(b.vertices for b in blocks)
        assert rows(again.cell_data["n"]) == rows(source.mesh.cell_data["n"])


def test_a_converted_mesh_of_one_type_has_its_name(tmp_path):
    """So dolfin and others can read it, which know no mixed Topology; meshio is the independent reader."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1.0]])
    cells = [Cells("tetra", np.array([[0, 1, 2, 3], [1, 2, 3, 4]]))]
    fields = {"<a> & b": [np.array([3, 4])], "vectors": [np.arange(6.0).reshape(2, 3)]}
    mesh = Mesh(points, cells, fields, {"on": np.array([True, False, True, False, True])})
    source = convert(mesh, [])
    source.target = tmp_path / "m.xdmf"
    write(source, tmp_path / "m.xdmf", points)
    back = meshio.read(tmp_path / "m.xdmf")
    assert b'"Tetrahedron"' in (tmp_path / "m.xdmf").read_bytes()
    assert back.points.tolist() == points.tolist()
    assert back.cells_dict["tetra"].tolist() == cells[0].vertices.tolist()
    assert back.cell_data["<a> & b"][0].tolist() == [3, 4]
    assert back.cell_data["vectors"][0].tolist() == fields["vectors"][0].tolist()
    assert back.point_data["on"].tolist() == [1, 0, 1, 0, 1]


def test_conversion_overwrites_no_foreign_file_and_its_own_again(tmp_path):
    source = obj.read(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "new.h5").write_bytes(b"a precious thing")
    with pytest.raises(OutputError, match=r"new\.h5 is in the way"):
        Output(source, tmp_path / "new.xdmf")
    assert not (tmp_path / "new.xdmf").exists()
    for factor in (1, 2):
        Output(source, tmp_path / "other.xdmf").write(factor * source.mesh.points)
        assert meshio.read(tmp_path / "other.xdmf").points[1].tolist() == [factor, 0, 0]


def test_conversion_without_a_place_is_text():
    source = convert(obj.read(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").mesh, [])
    file = BytesIO()
    source.write(source.mesh.points, file)
    assert source.companions(source.mesh.points) == {}
    again = xdmf.read(InputFile(file.getvalue(), None)).mesh
    assert again.points.tolist() == source.mesh.points.tolist()
    assert again.cells[0].vertices.tolist() == [[0, 1, 2]]


def rows(arrays) -> list:
    return [row for array in arrays for row in array.tolist()]


CONVERTED = (
    *("triangle", "quad", "tetra", "hexahedron", "wedge", "pyramid", "polygon", "line", "vertex"),
    *("line3", "triangle6", "quad8", "quad9", "tetra10", "hexahedron20", "wedge15", "wedge18", "pyramid13"),
)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("<Xdmf", "<Xdmg", "damaged XML"),
        ("Mixed", "3DSMesh", "the Topology '3DSMesh' is not supported"),
        ("X_Y_Z", "Origin_DxDyDz", "implied"),
        ("X_Y_Z", "XYZ", "should have 1 DataItems"),
        ('NumberOfElements="4"', 'NumberOfElements="5"', "do not add up"),
        ("2 3 1 2 3<", "7 3 1 2 3<", "do not add up"),
        ("4 0 1 4", "4 0 1 6", "names point 6"),
        ('"6"', '"7"', "should be 7 numbers"),
        ('"6"', '"99999999999999999"', "whole numbers"),
        ("<DataItem", '<DataItem Reference="XML"', "refers to another"),
        ("<DataItem", '<DataItem Format="HDF"', "names no file"),
        ("<DataItem", '<DataItem Format="Blob"', "the format 'Blob'"),
        ("<Grid>", '<Grid GridType="Subset">', "of the kind 'subset'"),
        ("</Domain>", OTHER + "</Domain>", "points of its own"),
    ],
)
def test_refused_by_name(tmp_path, old, new, why):
    path = tmp_path / "a.xdmf"
    path.write_text(ARRAYS.replace(old, new))
    with pytest.raises(InputError, match=re.escape(why)):
        open_mesh(path)


@pytest.mark.parametrize("what", ["missing", "garbled", "truncated", "another"])
def test_a_bad_hdf5_file_is_one_line(tmp_path, what):
    path = as_dolfinx(tmp_path)
    heavy = tmp_path / "mesh.h5"
    data = heavy.read_bytes()
    if what == "missing":
        heavy.unlink()
    elif what == "another":
        with h5py.File(heavy, "w") as file:
            file["Mesh/mesh/geometry"] = "no numbers"
    else:
        heavy.write_bytes(b"x" * 3000 if what == "garbled" else data[:2000])
    with pytest.raises(InputError) as error:
        open_mesh(path)
    assert "mesh.h5" in str(error.value) or "dataset" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("count", COUNTS)
def test_damage_is_an_error_or_read_consistently(tmp_path, count):
    as_dolfinx(tmp_path)
    heavy = (tmp_path / "mesh.h5").read_bytes()
    path = tmp_path / "mesh.xdmf"
    rng = np.random.default_rng(5)
    for i, data in enumerate(mutated([FENICS.encode(), ARRAYS.encode()], count, seed=20)):
        path.write_bytes(data if i % 3 else FENICS.encode())
        damaged = bytearray(heavy)
        if i % 3 == 0:
            for at in rng.integers(len(heavy), size=3):
                damaged[at] = rng.integers(256)
        (tmp_path / "mesh.h5").write_bytes(damaged)
        try:
            source = open_mesh(path)
            for block in source.mesh.cells:
                assert block.vertices.min(initial=0) >= 0
                assert block.vertices.max(initial=0) < len(source.mesh.points)
            before = path.read_bytes(), bytes(damaged)
            write(source, path, source.mesh.points.copy())
            assert (path.read_bytes(), (tmp_path / "mesh.h5").read_bytes()) == before
        except DvrError:
            continue
