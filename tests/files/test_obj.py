"""OBJ: what is read, what is written back, and what is refused; trimesh and meshio where they can read."""

from __future__ import annotations

import io
import tracemalloc

import meshio
import numpy as np
import pytest
import trimesh

from dvr_cli.errors import InputError
from dvr_cli.files import obj
from dvr_cli.files.patched_text import PatchedText
from fuzz import COUNTS, check_damaged
from sources import written

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 0.125\n"
FAN = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]


def fan(form: str) -> str:
    """The faces of FAN, each vertex spelled by ``form`` with its index counted from 1."""
    return "".join("f " + " ".join(form.format(i + 1) for i in face) + "\n" for face in FAN)


# Files that hold the vertices of SQUARE and the triangles of FAN, in all manners of spelling.
FANS = {
    "plain": SQUARE + fan("{}"),
    "texture": SQUARE + "vt 0 0\n" * 5 + fan("{0}/{0}"),
    "normal": SQUARE + "vn 0 0 1\n" + fan("{}//1"),
    "texture and normal": SQUARE + "vt 0 0\n" * 2 + "vn 0 0 1\n" + fan("{}/2/1"),
    "mixed": SQUARE + "vt 0 0\nvn 0 0 1\nf 1 2/1 5//1\nf 2/1/1 3 5\nf 3 4 5\nf 4// 1/ 5\n",
    "relative": SQUARE + "f -5 -4 -1\nf -4 -3 -1\nf -3 -2 -1\nf -2 -5 -1\n",
    "relative and interleaved": (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 0.125\nf -5 -4 -1\nf 2 3 5\nf -3/1 4 -1\nf 4 1 -1\n"
    ),
    "faces first": fan("{}") + SQUARE,
    "colours": SQUARE.replace("\n", " 0.5 0.25 1\n") + fan("{}"),
    "weights": SQUARE.replace("\n", " 1.0\n") + fan("{}"),
    "weights and colours": SQUARE.replace("\n", " 1.0 0.5 0.25 1\n") + fan("{}"),
    "continued": SQUARE.replace("1 1", "1 \\\n 1") + fan("{}").replace(" 5", " \\\n5"),
    "continued crlf": (SQUARE.replace("1 1", "1 \\\n 1") + fan("{}")).replace("\n", "\r\n"),
    "crlf": (SQUARE + fan("{}")).replace("\n", "\r\n"),
    "cr": (SQUARE + fan("{}")).replace("\n", "\r"),
    "tabs and blanks": (SQUARE + fan("{}"))
    .replace("v ", "  \tv\t ")
    .replace("f ", "\tf  ")
    .replace("\n", " \t \n"),
    "no last line end": (SQUARE + fan("{}"))[:-1],
    "byte order mark": "\ufeff" + SQUARE + fan("{}"),
    "comments": "# c:\\folder\\\n"
    + (SQUARE + fan("{}/1")).replace("\n", " # v 9 9 9 \\\n").replace("v", "#f 7\n v", 1),
    "groups": (
        "mtllib a#b.mtl\no the thing\n"
        + SQUARE
        + "s off\nusemtl red # 1\n"
        + fan("{}").replace("f 3", "g a b\ns 1\nf 3")
    ),
    "unknown keywords": "vendor_extension 1 2\n" + SQUARE + "lod 3\n" + fan("{}") + "v2 9 9 9\n",
    "exponents": SQUARE.replace("0.5 0.5 0.125", "5E-1 +.5 125.e-3") + fan("{}"),
    "blank lines": (SQUARE + fan("{}")).replace("\n", "\n\n \n"),
    "normals in between": SQUARE.replace("\n", "\nvn 0 0 1\nvt 1 1\n") + fan("{0}/{0}/{0}"),
}


def read(text: str) -> PatchedText:
    return obj.read(text.encode())


@pytest.mark.parametrize("name", FANS)
def test_every_spelling_reads_the_same(name):
    mesh = read(FANS[name]).mesh
    assert mesh.points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0.125]]
    assert [block.type for block in mesh.cells] == ["triangle"]
    assert mesh.cells[0].vertices.tolist() == FAN


@pytest.mark.parametrize("name", FANS)
def test_unmoved_is_identical(name):
    source = read(FANS[name])
    assert written(source, source.mesh.points.copy()) == FANS[name].encode()


@pytest.mark.parametrize("name", FANS)
def test_moved_differs_in_its_numbers_only(name):
    source = read(FANS[name])
    points = source.mesh.points.copy()
    points[4, :2] = 0.1, 1e-17
    output = written(source, points)
    again = obj.read(output).mesh
    assert again.points.tolist() == source.stored(points).tolist() == points.tolist()
    before = FANS[name].encode()
    third = b"125.e-3" if name == "exponents" else b"0.125"
    at = before.index(third)
    x = before.rindex(b"5E-1" if name == "exponents" else b"0.5", 0, before.rindex(b".5", 0, at))
    between = before[x:at].replace(b"5E-1", b"0.1").replace(b"+.5", b"1e-17")
    expected = between.replace(b"0.5", b"0.1", 1).replace(b"0.5", b"1e-17", 1)
    assert output == before[:x] + expected + before[at:]


# Spellings that trimesh cannot read, or reads otherwise.
_NOT_TRIMESH = {
    "faces first",
    "cr",
    "continued crlf",
    "mixed",
    "tabs and blanks",
    "byte order mark",
    "comments",
}


@pytest.mark.parametrize("name", sorted(FANS.keys() - _NOT_TRIMESH))
def test_trimesh_reads_the_moved_points(name):
    source = read(FANS[name])
    points = source.mesh.points + np.array([0.1, 0.2, 1 / 3])
    loaded = trimesh.load(
        io.BytesIO(written(source, points)), file_type="obj", process=False, maintain_order=True, force="mesh"
    )
    assert sorted(loaded.triangles.reshape(-1, 9).tolist()) == sorted(points[FAN].reshape(-1, 9).tolist())


def test_meshio_reads_the_same(tmp_path):
    text = SQUARE + "f 1 2 5\nf 2 3 5\nf 3 4 5\n"
    path = tmp_path / "x.obj"
    path.write_text(text)
    expected = meshio.read(path)
    mesh = read(text).mesh
    assert mesh.points.tolist() == expected.points.tolist()
    assert mesh.cells[0].vertices.tolist() == expected.cells[0].data.tolist()


def test_polygons_lines_and_points_come_by_size():
    mesh = read(
        SQUARE + "f 1 2 3 4 5\nl 1/1 2/1 3/1\nf 1 2 3\np 5 -4\nf 2 3 4 5\nf 3 4 5\nl -1 1\nf 5 4 3 2 1\n"
    ).mesh
    assert [(block.type, block.vertices.tolist()) for block in mesh.cells] == [
        ("vertex", [[4], [1]]),
        ("line", [[0, 1], [1, 2], [4, 0]]),
        ("triangle", [[0, 1, 2], [2, 3, 4]]),
        ("quad", [[1, 2, 3, 4]]),
        ("polygon", [[0, 1, 2, 3, 4], [4, 3, 2, 1, 0]]),
    ]


def test_groups_number_the_combinations_of_object_group_and_material():
    mesh = read(
        SQUARE
        + "f 1 2 5\no thing\ng left\nusemtl red\nf 2 3 5\nl 1 2\ng right side\nf 3 4 5\n"
        + "g left\nf 4 1 5\nusemtl blue\nf 1 2 3\n  g  right\tside\nusemtl red\nf 2 3 4\n"
    ).mesh
    lines, triangles = mesh.cell_data["obj:group"]
    none, left, right, again, blue, right_again = triangles.tolist()
    assert again == left == lines.tolist()[0]
    assert right_again == right
    assert none == 0
    assert len({none, left, right, blue}) == 4


def test_vertices_that_no_face_uses_are_kept():
    assert len(read(SQUARE + "f 1 2 3\nv 7 7 7\n").mesh.points) == 6


def test_a_mesh_without_cells_is_read():
    assert read(SQUARE).mesh.cells == []


def test_a_sign_of_zero_is_a_change():
    source = read(SQUARE + fan("{}"))
    points = source.mesh.points.copy()
    points[0, 1] = -0.0
    assert written(source, points).startswith(b"v 0 -0.0 0\nv 1 0 0\n")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no v lines"),
        ("hello world\n", "no v lines"),
        ("\x00\x01\x02\xff", "no v lines"),
        (SQUARE + "\x7fELF\n", "line 6 does not begin with a keyword"),
        ("v 1 2\n", "line 1: a vertex needs at least 3 coordinates"),
        ("v\n", "line 1: a vertex needs"),
        ("v 1 2 3\nv 1 2 3 # ok\nv 1 2 # 3\n", "line 3: a vertex needs"),
        ("v 1 2 3\nv 1 2 x\nv 1 2 3\n", "line 2: 'v 1 2 x' is not valid"),
        ("v 1 2 3 red\n", "line 1: 'v 1 2 3 red' is not valid"),
        ("v 1 2 3.0.0\n", "line 1: 'v 1 2 3.0.0' is not valid"),
        (SQUARE + "f 1 2\n", "line 6: a face needs at least 3 vertices"),
        (SQUARE + "l 1\n", "line 6: a line needs at least 2 vertices"),
        (SQUARE + "p\n", "line 6: a point needs at least 1 vertices"),
        (SQUARE + "f 1 2 0\n", "line 6: there is no vertex 0"),
        (SQUARE + "f 1 2 3\nf 1 2 6\n", "line 7: there is no vertex 6"),
        (SQUARE + "f 1 2 -6\n", "line 6: there is no vertex -6"),
        (SQUARE + "f 1 2 -9223372036854775808\n", "line 6: there is no vertex -9223372036854775808"),
        (SQUARE + "f 1 2 99999999999999999999\n", "line 6: there is no vertex"),
        (SQUARE + "f 1 2 /3\n", "line 6: 'f 1 2 /3' is not valid"),
        (SQUARE + "f 1-2 - 5\n", "line 6: 'f 1-2 - 5' is not valid"),
        (SQUARE + "f 1 2 3.5\n", "line 6: 'f 1 2 3.5' is not valid"),
        (SQUARE + "f 1 \\\n2\n\nf 1 2 x\n", "line 6: a face needs"),
        (SQUARE + "f 1 \\\n2 3\n\nf 1 2 x\n", "line 9: 'f 1 2 x' is not valid"),
        (SQUARE + "cstype bezier\n", "line 6: free-form geometry (cstype) not supported"),
        (SQUARE + "curv 0 1 1 2 3\n", "free-form geometry (curv)"),
        (SQUARE + "surf 0 1 0 1 1 2 3\n", "free-form geometry (surf)"),
        (SQUARE + "call other.obj\n", "including other files (call)"),
        (SQUARE + "fo 1 2 3\n", "(fo) not supported"),
    ],
)
def test_refused_with_one_line_that_says_why(text, words):
    with pytest.raises(InputError) as caught:
        obj.read(text.encode("latin-1"))
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


def test_a_relative_index_looks_back_from_its_own_line():
    with pytest.raises(InputError, match="line 3: there is no vertex -3"):
        read("v 0 0 0\nv 1 0 0\nf -1 -2 -3\nv 0 1 0\n")


def test_long_lines_and_deep_indents_take_no_more_than_their_share():
    text = " " * 300_000 + SQUARE + "# " + "x" * 300_000 + "\n" + "f 1 2 3 " + "4 " * 100_000 + "\n"
    tracemalloc.start()
    try:
        mesh = read(text).mesh
        assert tracemalloc.get_traced_memory()[1] < 60 * len(text)
    finally:
        tracemalloc.stop()
    assert mesh.cells[0].vertices.shape == (1, 100_003)


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(count):
    files = [text.encode() for text in FANS.values()]
    files.append((SQUARE + "f 1 2 3 4 5\nl 1/1 2/1 3/1\nf 1 2 3\np 5 -4\nf 2 3 4 5\ng x\nf 3 4 5\n").encode())
    check_damaged(files, count, 11, obj.read, 0.1, exact=True)
