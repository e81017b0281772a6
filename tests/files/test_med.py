"""MED files: Gmsh writes and reads them, h5py looks into them, and only coordinates change."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from containers import differences, hdf5_objects
from dvr_cli.cli.main import main
from dvr_cli.errors import DvrError, InputError
from dvr_cli.files import med
from dvr_cli.files.med import MedSource
from dvr_cli.files.reading import open_mesh
from dvr_cli.files.source import InputFile
from fuzz import COUNTS, mutated
from gmsh_cad import KINDS, check_nodes, nodes_by_gmsh, two_boxes, written_by_gmsh
from needs import require
from sources import written

h5py = require("h5py")
COO = "NOE/COO"


def read(data: bytes, mesh: str | None = None) -> MedSource:
    return med.read(InputFile(data, None, mesh))


def changed(data: bytes, change: Callable[[Any], None]) -> bytes:
    """The file after ``change`` was called with it, open."""
    buffer = io.BytesIO(data)
    with h5py.File(buffer, "r+") as file:
        change(file)
    return buffer.getvalue()


def step_of(file: Any) -> Any:
    """The only time step of the only mesh."""
    (mesh,) = file["ENS_MAA"].values()
    (step,) = mesh.values()
    return step


@pytest.fixture(scope="module")
def boxes(tmp_path_factory) -> bytes:
    return two_boxes(tmp_path_factory.mktemp("med") / "boxes.med")


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("med")
    return {kind: written_by_gmsh(kind, folder / f"{kind}.med") for kind in KINDS if kind != "pyramid14"}


def test_unmoved_is_identical_and_moved_differs_in_coordinates_only(files, tmp_path):
    for kind in ("tetra", "hexahedron27", "wedge15", "pyramid13"):
        data = files[kind]
        source = read(data)
        assert written(source, source.mesh.points.copy()) == data
        points = source.mesh.points.copy()
        points[1:] += 1 / 3
        new = written(source, points)
        (path,) = differences(hdf5_objects(data), hdf5_objects(new))
        assert path.endswith(COO)
        assert np.array_equal(read(new).mesh.points, points)
        (tmp_path / "new.med").write_bytes(new)
        assert np.array_equal(nodes_by_gmsh(tmp_path / "new.med"), points)


def test_nodes_are_where_meshio_has_them(files):
    """Gmsh knows MED's node orders: middles lie in the middle, volumes are positive."""
    found = set().union(*(check_nodes(read(data).mesh) for data in files.values()))
    expected = {
        "tetra",
        "tetra10",
        "hexahedron",
        "hexahedron20",
        "hexahedron27",
        "wedge",
        "wedge15",
        "wedge18",
    }
    assert found >= expected | {"pyramid", "pyramid13", "triangle6", "quad8", "quad9", "line3", "vertex"}


def test_groups_are_cell_sets_and_families_regions(boxes):
    source = read(boxes)
    mesh = source.mesh
    sizes = {name: sum(map(len, members)) for name, members in mesh.cell_sets.items()}
    types = [block.type for block in mesh.cells]
    assert sorted(types) == ["tetra", "triangle", "vertex"]
    tetra = types.index("tetra")
    x = mesh.points[mesh.cells[tetra].vertices].mean(axis=1)[:, 0]
    assert mesh.cell_sets["steel"][tetra].tolist() == np.flatnonzero(x < 1).tolist()
    assert mesh.cell_sets["brass"][tetra].tolist() == np.flatnonzero(x > 1).tolist()
    assert sizes["corner"] == 1
    assert sizes["wall"] > 0
    assert len(np.unique(mesh.cell_data["med:family"][tetra])) == 2
    assert source.unread == ["not kept: numbers of nodes", "not kept: numbers of cells"]


def test_groups_of_nodes_by_h5py(boxes):
    def add(file):
        node_families = step_of(file)["NOE/FAM"]
        node_families[...] = np.arange(len(node_families)) % 2
        (mesh,) = file["FAS"].values()
        family = mesh.create_group("NOEUD/held")
        family.attrs["NUM"] = 1
        names = np.array([list(b"odd".ljust(80, b"\0")), list(b"some".ljust(80))], dtype=np.int8)
        listed = family.create_dataset("GRO/NOM", (2,), dtype=np.dtype(("i1", (80,))))
        listed[...] = names

    mesh = read(changed(boxes, add)).mesh
    odd = np.arange(1, len(mesh.points), 2).tolist()
    assert {name: nodes.tolist() for name, nodes in mesh.point_sets.items()} == {"odd": odd, "some": odd}


def test_the_interface_between_groups_stays(boxes, tmp_path):
    (tmp_path / "in.med").write_bytes(boxes)
    assert main(["smooth", str(tmp_path / "in.med"), str(tmp_path / "out.med"), "-q", "-n", "2"]) == 0
    new = (tmp_path / "out.med").read_bytes()
    (path,) = differences(hdf5_objects(boxes), hdf5_objects(new))
    assert path.endswith(COO)
    before, after = nodes_by_gmsh(tmp_path / "in.med"), nodes_by_gmsh(tmp_path / "out.med")
    between = before[:, 0] == 1
    assert between.sum() > 4
    assert np.array_equal(before[between], after[between])


def test_float32_is_rounded(boxes):
    def narrow(file):
        step = step_of(file)
        values, attributes = step[COO][...], dict(step[COO].attrs)
        del step[COO]
        step.create_dataset(COO, data=values.astype("f4")).attrs.update(attributes)

    source = read(changed(boxes, narrow))
    points = source.mesh.points + 1 / 3
    assert np.array_equal(source.stored(points), points.astype(np.float32).astype(float))
    assert np.array_equal(read(written(source, points)).mesh.points, source.stored(points))


def test_a_plane_mesh_has_two_coordinates(tmp_path):
    meshio = require("meshio")
    points, triangles = np.array([[0, 0], [1, 0], [0, 1], [1, 1.0]]), np.array([[0, 1, 2], [1, 3, 2]])
    meshio.write(tmp_path / "x.med", meshio.Mesh(points, [("triangle", triangles)]))
    data = (tmp_path / "x.med").read_bytes()
    source = read(data)
    assert source.mesh.points.tolist() == points.tolist()
    assert source.mesh.cells[0].vertices.tolist() == triangles.tolist()
    (tmp_path / "x.med").write_bytes(written(source, points + 0.5))
    assert meshio.read(tmp_path / "x.med").points.tolist() == (points + 0.5).tolist()


def test_one_of_several_meshes_is_chosen_by_name(boxes, tmp_path):
    def copy(file):
        file.copy("ENS_MAA/two boxes", "ENS_MAA/another")
        (step,) = file["ENS_MAA/another"].values()
        step[COO][...] += 1

    data = changed(boxes, copy)
    with pytest.raises(InputError, match=r"it holds 2 meshes, .* to be named \(--mesh\): another, two boxes"):
        read(data)
    with pytest.raises(InputError, match="it has no mesh 'x'; there are: another, two boxes"):
        read(data, "x")
    source = read(data, "another")
    assert np.array_equal(source.mesh.points, read(boxes).mesh.points + 1)
    new = written(source, source.mesh.points + 1)
    (changed_path,) = differences(hdf5_objects(data), hdf5_objects(new))
    assert changed_path.startswith("/ENS_MAA/another/")
    assert source.unread[0] == "not kept: 1 other mesh"
    path = tmp_path / "two.med"
    path.write_bytes(data)
    assert np.array_equal(open_mesh(path, mesh_name="another").mesh.points, source.mesh.points)
    with pytest.raises(InputError, match=r"two\.med: it holds 2 meshes.*--mesh"):
        open_mesh(path)


def test_all_time_steps_are_written(boxes):
    later = "0000000000000000002-0000000000000000001"

    def copy(file):
        step = step_of(file)
        file.copy(step, step.parent, name=later)

    data = changed(boxes, copy)
    source = read(data)
    new = written(source, source.mesh.points + 1)
    assert len(differences(hdf5_objects(data), hdf5_objects(new))) == 2
    assert np.array_equal(read(new).mesh.points, source.mesh.points + 1)

    def move(file):
        file[f"ENS_MAA/two boxes/{later}/{COO}"][3] += 1e-9

    with pytest.raises(InputError, match="its 2 time steps have different meshes"):
        read(changed(data, move))


def test_files_before_version_3_have_no_time_steps(boxes):
    def older(file):
        (mesh,) = file["ENS_MAA"].values()
        (step,) = mesh
        for name in list(mesh[step]):
            mesh.move(f"{step}/{name}", name)
        del mesh[step], mesh.attrs["ESP"]

    source = read(changed(boxes, older))
    assert np.array_equal(source.mesh.points, read(boxes).mesh.points)
    new = written(source, source.mesh.points + 1)
    assert np.array_equal(read(new).mesh.points, source.mesh.points + 1)


def attribute(name: str, value: int) -> Callable[[Any], None]:
    return lambda file: file["ENS_MAA/two boxes"].attrs.__setitem__(name, value)


def profile(file: Any) -> None:
    step_of(file)["MAI/TE4"].attrs["PFL"] = np.bytes_("upper half")


def polyhedra(file: Any) -> None:
    step_of(file).move("MAI/TE4", "MAI/POE")


def no_nodes(file: Any) -> None:
    del step_of(file)[COO]


def wrong_node(file: Any) -> None:
    step_of(file)["MAI/TE4/NOD"][5] = 999999


def short(file: Any) -> None:
    nodes = step_of(file)["MAI/TE4"]
    values = nodes["NOD"][...]
    del nodes["NOD"]
    nodes["NOD"] = values[:-1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (attribute("TYP", 1), "is a structured mesh"),
        (attribute("REP", 1), "has cylindrical coordinates"),
        (attribute("REP", 2), "has spherical coordinates"),
        (attribute("ESP", 1), "have 1 coordinates"),
        (attribute("ESP", 7), "have 7 coordinates"),
        (profile, "is given on a profile (upper half)"),
        (polyhedra, "polyhedra (POE) are not supported"),
        (no_nodes, "has no nodes"),
        (wrong_node, "names node 999999, but there are"),
        (short, "does not hold 4 nodes for each cell"),
        (lambda file: file.pop("ENS_MAA"), "it is a MED file without a mesh"),
        (lambda file: file["ENS_MAA/two boxes"].create_group("JNT/other"), "a part of a distributed mesh"),
    ],
)
def test_refused_with_one_line_that_says_why(boxes, change, words):
    with pytest.raises(InputError) as caught:
        read(changed(boxes, change))
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


def test_what_is_no_hdf5_file_or_truncated(boxes, tmp_path):
    for data in (b"hello", boxes[: len(boxes) // 2], b""):
        with pytest.raises(InputError, match="damaged, or no HDF5 file"):
            read(data)
    path = Path(tmp_path / "x.med")
    path.write_bytes(boxes[:5000])
    assert main(["smooth", str(path), str(tmp_path / "out.med")]) == 3
    assert not (tmp_path / "out.med").exists()


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(files, count):
    whole = [files["pyramid"], files["hexahedron"]]
    expected = [read(data).mesh for data in whole]
    messages, read_well = [], 0
    for i, data in enumerate(mutated(whole, count // 4, seed=29)):
        try:
            source = read(data)
            points = source.mesh.points + 0.25
            again = read(written(source, points)).mesh
        except DvrError as error:
            messages.append(str(error))
            continue
        read_well += 1
        assert written(source, source.mesh.points.copy()) == data
        assert np.array_equal(again.points, points, equal_nan=True)
        cells = [(block.type, len(block.vertices)) for block in again.cells]  # none gone unnoticed
        assert cells == [(block.type, len(block.vertices)) for block in expected[i % 2].cells]
        assert again.cell_sets.keys() == expected[i % 2].cell_sets.keys()
    assert read_well > 0
    assert len(messages) > count // 16
    assert all(len(message) < 300 and message.isprintable() for message in messages)
