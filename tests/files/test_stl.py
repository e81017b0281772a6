"""STL files, text and binary; trimesh reads what comes back."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import trimesh

from dvr_cli.cli.main import main
from dvr_cli.errors import InputError
from dvr_cli.files import stl
from dvr_cli.files.reading import open_mesh
from dvr_cli.mesh.mesh import Cells, Mesh
from fuzz import COUNTS, mutated
from meshes import grid
from sources import written

# A square of four facets around (.8, .9), the left and the right two of which are solids.
LEFT = """solid left  wall
  facet normal 0 0 1
    outer loop
      vertex 0 0 0
      vertex 1 0 0
      vertex .8 9e-1 0
    endloop
  endfacet
  facet normal 0 0 0
    outer loop
      vertex 0 1 0
      vertex 0 0 0
      vertex 8e-1 .9 0
    endloop
  endfacet
endsolid left  wall
"""
RIGHT = """solid
facet normal 0.0 0.0 1.0
outer loop
vertex 1 0 -0
vertex 1 1 0
vertex 0.8 0.90 0
endloop
endfacet
facet normal -nan nan 1
outer loop
vertex 1 1 0
vertex 0 1 0
vertex 0.8 0.9 0
endloop
endfacet
facet normal 0 0 0
outer loop
vertex 0.8 0.9 0
vertex 1 1 0
vertex 1 1 0
endloop
endfacet
endsolid
"""
ODD = f"\n\n{LEFT.upper()}\n{RIGHT.replace('vertex', '	 vertex  ')}".replace("\n", "\r\n")

CORNERS = [[(0, 0, 0), (1, 0, 0), (0.8, 0.9, 0)], [(0, 1, 0), (0, 0, 0), (0.8, 0.9, 0)]]
CORNERS += [[(1, 0, -0.0), (1, 1, 0), (0.8, 0.9, 0)], [(1, 1, 0), (0, 1, 0), (0.8, 0.9, 0)]]
CORNERS += [[(0.8, 0.9, 0), (1, 1, 0), (1, 1, 0)]]
NORMALS = [(0, 0, 1), (0, 0, 0), (0, 0, 1), (0.1, 0, 1), (0, 0, 0)]


def binary(header: bytes, corners: list, normals: list, attributes: list[int]) -> bytes:
    out = header.ljust(80, b" ") + struct.pack("<I", len(corners))
    for normal, facet, attribute in zip(normals, corners, attributes, strict=True):
        out += struct.pack("<12fH", *normal, *(x for corner in facet for x in corner), attribute)
    return out


FILES = {
    "text": (LEFT + RIGHT).encode(),
    "odd": ODD.encode(),
    "binary": binary(b"made by hand", CORNERS, NORMALS, [0] * 5),
    "solid": binary(b"solid of a binary file\n facet", CORNERS, NORMALS, [3, 3, 0, 65535, 7]),
}


@pytest.mark.parametrize("name", FILES)
def test_equal_coordinates_are_one_vertex(name):
    source = stl.read(FILES[name])
    mesh = source.mesh
    expected = np.array([(0, 0, 0), (1, 0, 0), (0.8, 0.9, 0), (0, 1, 0), (1, 1, 0)])
    text = name in ("text", "odd")
    assert mesh.points.tolist() == (expected if text else expected.astype("f4")).tolist()
    ((block,), solids) = mesh.cells, mesh.cell_data["stl:solid"][0].tolist()
    assert block.type == "triangle"
    assert block.vertices.tolist() == [[0, 1, 2], [3, 0, 2], [1, 4, 2], [4, 3, 2]]
    assert solids == ([0, 0, 1, 1] if text else [0, 0, 0, 0])
    assert source.unread == ["not kept: 1 facet of two corners in one place"]
    if text:
        key = "left  wall" if name == "text" else "LEFT  WALL"
        assert {set_: cells[0].tolist() for set_, cells in mesh.cell_sets.items()} == {key: [0, 1]}
    if name == "solid":
        assert mesh.cell_data["stl:attribute"][0].tolist() == [3, 3, 0, 65535]


@pytest.mark.parametrize("name", FILES)
def test_unmoved_is_identical(name):
    source = stl.read(FILES[name])
    assert written(source, source.mesh.points.copy()) == FILES[name]


def test_moved_differs_in_coordinates_and_normals_of_what_moved():
    """A normal is that of its facet again, but for those of zeros, which say that readers shall find it."""
    source = stl.read(FILES["text"])
    points = source.mesh.points.copy()
    points[2] = 0.5, 0.9, 0.25
    moved = written(source, points)
    a, b, c = points[source.mesh.cells[0].vertices].swapaxes(0, 1)
    across = np.cross(b - a, c - a)
    unit = (across / np.linalg.norm(across, axis=1)[:, None]).tolist()
    text = FILES["text"].decode().replace("vertex .8 9e-1 0", "vertex 0.5 9e-1 0.25")
    for old in ("vertex 8e-1 .9 0", "vertex 0.8 0.90 0", "vertex 0.8 0.9 0"):
        text = text.replace(old, old.replace("8e-1", "0.5").replace("0.8", "0.5")[:-1] + "0.25")
    lines = text.split("\n")
    facets = [i for i, line in enumerate(lines) if "facet normal" in line]
    for facet in (0, 2, 3):
        head = lines[facets[facet]].split("normal ")[0]
        lines[facets[facet]] = f"{head}normal {' '.join(map(repr, unit[facet]))}"
    assert moved.decode() == "\n".join(lines)


@pytest.mark.parametrize("name", ["binary", "solid"])
def test_moved_binary_keeps_its_header_and_attributes(name):
    data = FILES[name]
    source = stl.read(data)
    points = source.mesh.points.copy()
    points[3] = 1 / 3, 1, 0.1  # of facets 1 and 3
    moved = written(source, points)
    assert moved[:84] == data[:84]
    corners = np.frombuffer(moved, np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]), 5, 84)
    before = np.frombuffer(data, corners.dtype, 5, 84)
    assert corners["a"].tolist() == before["a"].tolist()
    assert [corners[i].tobytes() == before[i].tobytes() for i in range(5)] == [True, False, True, False, True]
    assert corners["n"][1].tolist() == [0, 0, 0]
    across = np.cross(*(corners["c"][3, k].astype(float) - corners["c"][3, 0] for k in (1, 2)))
    np.testing.assert_allclose(corners["n"][3], across / np.linalg.norm(across), rtol=1e-6)
    assert stl.read(moved).mesh.points.tolist() == source.stored(points).tolist()
    assert source.stored(points).tolist() == points.astype("f4").tolist()
    assert source.widened() is None


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"hello", "neither begins with solid nor has the header"),
        (FILES["binary"][:-1], "a binary STL file of 5 facets has 334 bytes, this one 333"),
        (FILES["binary"] + b"more", "this one 338"),
        (FILES["solid"][:-1], "this one 333"),
        (b"solid x\nendsolid x\n", "it has no facets"),
        (binary(b"", [], [], []), "it has no facets"),
        (binary(b"", CORNERS[4:], NORMALS[4:], [0]), "two corners in one place"),
        (LEFT.replace("endsolid left  wall\n", "").encode(), "not every solid has its endsolid"),
        ((LEFT + "endsolid\n").encode(), "not every solid has its endsolid"),
        (LEFT.replace("endloop", "", 1).encode(), "not every facet is a loop of three vertices"),
        ((LEFT + LEFT.split("\n", 1)[1].rsplit("endsolid", 1)[0]).encode(), "not every facet is a loop"),
        (LEFT.replace("vertex 1 0 0", "vertex 1 0").encode(), "line 5: a vertex has three coordinates, but"),
        (LEFT.replace("vertex 1 0 0", "vertex 1 0 x").encode(), "a coordinate of a vertex is no number"),
        (LEFT.replace("normal 0 0 1", "normal 0 0").encode(), "line 2: a normal has three components, but"),
        (LEFT.replace("outer", "utter", 1).encode(), "line 3 begins with 'utter': not an STL file"),
    ],
)
def test_refused_with_one_line_that_says_why(data, words):
    with pytest.raises(InputError) as caught:
        stl.read(data)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


# ------------------------------------------------------------------------------------------ the command line


def smooth(*arguments: object) -> int:
    return main(["smooth", *map(str, arguments), "-n", "5"])


def square(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a plane square, those off the middle line and the boundary shifted."""
    points, quads = grid(n, 2)
    inner = ((points > 0) & (points < 1)).all(axis=1) & (points[:, 0] != 0.5)
    points[inner] += 0.3 / n * np.random.default_rng(2).uniform(-1, 1, (inner.sum(), 2))
    points[points[:, 0] == 0.5, 0] += 0.02 * np.sin(9 * points[points[:, 0] == 0.5, 1])
    triangles = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    return np.column_stack([points, np.zeros(len(points))]), triangles


def as_two_solids(points: np.ndarray, triangles: np.ndarray, n: int) -> str:
    texts = []
    left = triangles.min(axis=1) < n // 2 * (n + 1)
    for name, chosen in (("inlet", left), ("wall", ~left)):
        texts.append(f"solid {name}\n")
        for facet in points[triangles[chosen]].tolist():
            corners = "".join(f"   vertex {x!r} {y!r} {z!r}\n" for x, y, z in facet)
            texts.append(f" facet normal 0 0 1\n  outer loop\n{corners}  endloop\n endfacet\n")
        texts.append(f"endsolid {name}\n")
    return "".join(texts)


def test_solids_and_their_interface_stay(tmp_path):
    n = 6
    points, triangles = square(n)
    source, output = tmp_path / "in.stl", tmp_path / "out.stl"
    source.write_text(as_two_solids(points, triangles, n))
    assert smooth(source, output) == 0
    before, after = open_mesh(source).mesh, open_mesh(output).mesh
    vertices, solid = before.cells[0].vertices, before.cell_data["stl:solid"][0]
    interface = np.intersect1d(vertices[solid == 0], vertices[solid == 1])
    assert len(interface) == n + 1
    assert (after.points[interface] == before.points[interface]).all()
    assert (after.points != before.points).any(axis=1).sum() == (n - 1) * (n - 2)
    lines = [text.read_text().split("\n") for text in (source, output)]
    assert len(lines[0]) == len(lines[1])
    differing = {a.split()[0] for a, b in zip(*lines, strict=True) if a != b}
    assert differing <= {"vertex", "facet"}
    scene = trimesh.load_scene(output, process=False)
    assert sorted(scene.geometry) == ["inlet", "wall"]
    for number, name in enumerate(("inlet", "wall")):
        ours = after.points[vertices[solid == number]]
        np.testing.assert_allclose(scene.geometry[name].triangles, ours, atol=1e-7)
        assert scene.geometry[name].area == pytest.approx(
            trimesh.load_scene(source).geometry[name].area, rel=1e-6
        )


def test_a_binary_surface_against_trimesh(tmp_path):
    sphere = trimesh.creation.icosphere(subdivisions=2)
    rng = np.random.default_rng(4)
    noisy = sphere.vertices + 0.05 * rng.uniform(-1, 1, sphere.vertices.shape)
    sphere = trimesh.Trimesh(noisy / np.linalg.norm(noisy, axis=1)[:, None], sphere.faces, process=False)
    path = tmp_path / "sphere.stl"
    path.write_bytes(sphere.export(file_type="stl"))
    before = path.read_bytes()
    assert smooth(path, path) == 0
    after = path.read_bytes()
    assert len(after) == len(before)
    assert after != before
    assert after[:84] == before[:84]
    read = trimesh.load_mesh(path)
    ours = open_mesh(path).mesh
    assert read.is_watertight
    assert len(read.vertices) == len(ours.points) == len(sphere.vertices)
    assert read.triangles.tolist() == ours.points[ours.cells[0].vertices].tolist()
    given = np.frombuffer(after, np.dtype([("n", "<f4", 3), ("rest", "V38")]), len(read.faces), 84)["n"]
    np.testing.assert_allclose(given, read.face_normals, atol=1e-5)


def test_what_cannot_be_read_leaves_no_output(tmp_path, capsys):
    source, output = tmp_path / "in.stl", tmp_path / "out.stl"
    for data in (None, b"\xff" * 100, FILES["binary"][:200], FILES["text"][:300]):
        if data is not None:
            source.write_bytes(data)
        assert smooth(source, output) == 3
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert str(source) in error
        assert not output.exists()


# ------------------------------------------------------------------------------------------------- conversion


def two_groups() -> Mesh:
    mesh = stl.read(FILES["text"]).mesh
    return Mesh(mesh.points, mesh.cells, cell_sets={"left": [np.array([0, 1])], "right": [np.array([2])]})


def test_named_groups_become_solids(tmp_path):
    mesh = two_groups()
    converted = stl.convert(mesh, ["7 loads"])
    assert converted.stored(mesh.points).tolist() == mesh.points.tolist()
    assert converted.notes == ["7 loads"]
    path = tmp_path / "out.stl"
    with path.open("wb") as file:
        converted.write(mesh.points, file)
    back = stl.read(path.read_bytes()).mesh
    assert {name: len(cells[0]) for name, cells in back.cell_sets.items()} == {"left": 2, "right": 1}
    assert (
        back.points[back.cells[0].vertices].tolist()
        == mesh.points[mesh.cells[0].vertices[[3, 0, 1, 2]]].tolist()
    )
    scene = trimesh.load_scene(path, process=False)
    assert {"left", "right"} <= set(scene.geometry)
    assert scene.area == pytest.approx(1)


def test_what_stl_cannot_keep_is_said(tmp_path, capsys):
    source = tmp_path / "in.mesh"
    source.write_text(
        "MeshVersionFormatted 2 Dimension 2 Vertices 6  0 0 0  1 0 0  1 1 0  0 1 0  .8 .9 0  .8 .9 0\n"
        "Edges 1  1 2 7  Triangles 4  1 2 5 1  2 3 5 1  3 4 5 1  4 1 5 1 End\n"
    )
    assert smooth(source, tmp_path / "out.stl") == 0
    error = capsys.readouterr().err
    for words in (
        "not kept: 1 line cell\n",
        "not kept: 1 cell field (medit:ref)\n",
        "not kept: 1 point of no triangle\n",
        "coordinates are rounded to 32 bits\n",
    ):
        assert words in error
    read = trimesh.load_mesh(tmp_path / "out.stl")
    assert len(read.faces) == 4
    assert read.area == pytest.approx(1)


def test_vertices_in_one_place_become_one():
    points = np.array([[0.0, 0], [1, 0], [0, 1], [1, 0], [0, 1], [1, 1]])
    converted = stl.convert(Mesh(points, [Cells("triangle", np.array([[0, 1, 2], [3, 5, 4]]))]), [])
    converted.stored(points)
    assert converted.notes == ["vertices that become one with others in the same place: 2"]


def test_other_cells_are_refused(tmp_path, capsys):
    source, output = tmp_path / "in.mesh", tmp_path / "out.stl"
    source.write_text(
        "MeshVersionFormatted 2 Dimension 2 Vertices 6  0 0 0  1 0 0  2 0 0  0 1 0  1 1 0  2 1 0\n"
        "Quadrilaterals 2  1 2 5 4 0  2 3 6 5 0 End\n"
    )
    assert smooth(source, output) == 4
    assert "stl holds triangles only, and this mesh has quad cells" in capsys.readouterr().err
    assert not output.exists()


# ----------------------------------------------------------------------------------------------------- damage


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(count):
    messages, read_well = [], 0
    for data in mutated(list(FILES.values()), count, seed=31):
        try:
            source = stl.read(data)
        except InputError as error:
            messages.append(str(error))
            continue
        read_well += 1
        mesh = source.mesh
        assert written(source, mesh.points.copy()) == data
        (block,), (solid,) = mesh.cells, mesh.cell_data["stl:solid"]
        assert len(solid) == len(block.vertices)
        assert 0 <= block.vertices.min() <= block.vertices.max() < len(mesh.points)
        with np.errstate(all="ignore"):
            points = mesh.points + 0.25
            if not np.isfinite(mesh.points).all() or np.abs(mesh.points).max() > 1e6:
                continue
        if len(np.unique(source.stored(points), axis=0)) < len(points):
            continue  # what damage put next to each other rounds to one place
        again = stl.read(written(source, points)).mesh
        assert (
            again.points[again.cells[0].vertices].tolist() == source.stored(points)[block.vertices].tolist()
        )
    assert read_well > 0.1 * count
    assert len(messages) > count // 4
    assert all(len(message) < 300 and message.isprintable() for message in messages)
