"""Writing Gmsh files back: the bytes of the source, with nothing but moved coordinates replaced."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from dvr_cli.files.gmsh import read
from gmsh_corpus import NAMES, account, corpus
from pairwise import named_cases
from sources import written

ASCII = [name for name in NAMES if name.endswith("ascii")]
PARAMETRIC = [name for name in NAMES if name.startswith("parametric")]
TINY = b"""$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
4
1 0   1e0 -0
2\t1.50000 0 0
3 0 1 +.25
  4 0 0 1.
$EndNodes
$Elements
1
1 4 2 0 1 1 2 3 4
$EndElements
"""


def moved(points: np.ndarray) -> np.ndarray:
    """Move some of the points, and those linked by a shift along x alike: Gmsh puts the others back."""
    return np.where(abs(points[:, 1:2]) > 0.3, points + 1e-3, points)


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    return a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()


def around_nodes(data: bytes) -> tuple[bytes, bytes, bytes]:
    """What stands before the section of nodes, in it and behind it."""
    match = re.search(rb"\$(Parametric)?Nodes\s.*\$End(Parametric)?Nodes", data, re.DOTALL)
    return data[: match.start()], match[0], data[match.end() :]


@pytest.mark.parametrize("name", named_cases(NAMES))
def test_unmoved_mesh_comes_back_byte_identical(name):
    source = read(corpus(name))
    assert written(source, source.mesh.points) == corpus(name)
    assert source.notes == []


@pytest.mark.parametrize("name", named_cases(NAMES))
def test_moved_mesh_differs_in_coordinates_only(name):
    source = read(corpus(name))
    points = moved(source.mesh.points)
    assert not np.array_equal(points, source.mesh.points)
    output = written(source, points)
    (before, nodes, after), (new_before, new_nodes, new_after) = map(around_nodes, (corpus(name), output))
    assert (new_before, new_after) == (before, after)
    if name in ASCII and name not in PARAMETRIC:
        lines, new_lines = nodes.split(b"\n"), new_nodes.split(b"\n")
        changed = sum(a != b for a, b in zip(lines, new_lines, strict=True))
        assert changed == (points != source.mesh.points).any(axis=1).sum()
    again = read(output).mesh
    assert same_bits(again.points, points)
    assert same_bits(source.stored(points), points)
    for old, new in zip(source.mesh.cells, again.cells, strict=True):
        assert old.type == new.type
        assert same_bits(old.vertices, new.vertices)


@pytest.mark.parametrize("name", named_cases(NAMES))
def test_gmsh_finds_everything_in_the_output(name):
    source = read(corpus(name))
    before, after = account(corpus(name)), account(written(source, moved(source.mesh.points)))
    assert before.nodes.keys() == after.nodes.keys()
    expected = moved(np.array(list(before.nodes.values())))
    assert np.array_equal(np.array([after.nodes[tag] for tag in before.nodes]), expected)
    assert dataclasses.replace(after, nodes={}) == dataclasses.replace(before, nodes={})


@pytest.mark.parametrize("name", ASCII)
def test_line_endings_are_kept(name):
    data = corpus(name).replace(b"\n", b"\r\n")
    source = read(data)
    assert same_bits(source.mesh.points, read(corpus(name)).mesh.points)
    assert written(source, source.mesh.points) == data
    output = written(source, moved(source.mesh.points))
    assert output.count(b"\n") == output.count(b"\r\n") == data.count(b"\r\n")
    assert same_bits(read(output).mesh.points, moved(source.mesh.points))


def test_only_the_tokens_of_changed_coordinates_are_replaced():
    source = read(TINY)
    points = source.mesh.points.copy()
    points[1, 0], points[2, 2] = 0.1 + 0.2, 1e-7
    expected = TINY.replace(b"1.50000", b"0.30000000000000004").replace(b"+.25", b"1e-07")
    assert written(source, points) == expected


def test_sign_of_zero_and_not_a_number_are_coordinates_like_others():
    source = read(TINY)
    points = source.mesh.points.copy()
    assert np.signbit(points[0, 2])
    points[0, 2] = 0.0
    points[3] = [np.nan, np.inf, -np.inf]
    output = written(source, points)
    assert b"1 0   1e0 0.0\n" in output
    assert np.array_equal(read(output).mesh.points, points, equal_nan=True)
    assert written(read(output), points) == output


@pytest.mark.parametrize("name", ["box-22-ascii", "box-22-binary", "box-41-ascii", "box-41-binary"])
def test_coordinates_survive_to_the_last_bit(name):
    source = read(corpus(name))
    bits = np.random.default_rng(7).integers(0, 2**63, source.mesh.points.shape, dtype=np.int64)
    points = bits.view(np.float64)
    points = np.where(np.isfinite(points), points, 5e-324)
    points[::2] *= -1
    assert same_bits(read(written(source, points)).mesh.points, points)


def test_mesh_may_be_changed_before_writing():
    source = read(TINY)
    source.mesh.points += 1
    assert same_bits(read(written(source, source.mesh.points)).mesh.points, source.mesh.points)


@pytest.mark.parametrize("name", PARAMETRIC)
def test_moved_nodes_lose_their_parameters(name):
    source = read(corpus(name))
    output = written(source, source.mesh.points + 0.01)
    assert len(source.notes) == 1
    assert re.fullmatch(r"dropped the parametric coordinates of \d+ nodes: .*", source.notes[0])
    assert b"$ParametricNodes" not in output
    plain = read(output)
    written(plain, plain.mesh.points + 0.01)
    assert plain.notes == []  # there are none left


@pytest.mark.parametrize("name", PARAMETRIC)
def test_nodes_without_parameters_move_without_loss(name):
    """Nodes inside a volume have none, so all others keep theirs, and their bytes."""
    source = read(corpus(name))
    on_surface = {vertex for c in source.mesh.cells if c.type == "triangle" for vertex in c.vertices.flat}
    if name.startswith("parametric_sphere"):
        inside = [i for i in range(len(source.mesh.points)) if i not in on_surface]
    else:
        inside = [44]  # the only one; groups leave some surfaces without triangles
        assert (source.mesh.points[44] % 1 != 0).all()
    points = source.mesh.points.copy()
    points[inside] += 0.01
    output = written(source, points)
    assert source.notes == []
    assert len(inside) > 0
    assert same_bits(read(output).mesh.points, points)
    if name.endswith("binary"):
        assert len(output) == len(corpus(name))


def test_blocks_without_a_moved_node_keep_their_parameters():
    data = corpus("parametric_box-41-ascii")
    source = read(data)
    points = source.mesh.points.copy()
    points[20, 1] += 0.01  # in the first surface, which has nodes 21 to 24
    output = written(source, points)
    assert len(source.notes) == 1
    assert "of 4 nodes" in source.notes[0]
    blocks = re.compile(rb"^([0-3] \d+ [01] \d+)$", re.MULTILINE)
    before, after = blocks.findall(around_nodes(data)[1]), blocks.findall(around_nodes(output)[1])
    assert len(before) == 27
    assert [a for a, b in zip(before, after, strict=True) if a != b] == [b"2 1 1 4"]
    assert account(output).complaints == []
