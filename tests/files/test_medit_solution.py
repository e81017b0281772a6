"""MEDIT solutions: what mmg writes, and files written by hand as the format's documentation has it."""

from __future__ import annotations

import struct
import subprocess

import meshio
import numpy as np
import pytest

from dvr_cli.errors import InputError
from dvr_cli.files.medit.solution import read_tensors
from meshes import boxes_of
from needs import require_program

# m11; m21, m22; m31, m32, m33
PLANE = np.array([[[2.0, 0.5], [0.5, 3.0]], [[1.0, 0.0], [0.0, 4.0]]])
SPACE = np.array([[[2.0, 0.5, 0.25], [0.5, 3.0, -0.125], [0.25, -0.125, 4.0]]])


def text(dimension: int, head: str, *rows: str) -> str:
    return "\n".join(
        ["MeshVersionFormatted 2", f"Dimension\n{dimension}", "SolAtVertices", head, *rows, "End", ""]
    )


def binary(dimension: int, kinds: list[int], rows: np.ndarray, order: str = "<", version: int = 2) -> bytes:
    """As libMeshb writes it: positions and counts grow from 32 to 64 bits with the version."""
    position, count = "q" if version > 2 else "i", "q" if version > 3 else "i"
    real = "f4" if version == 1 else "f8"
    data = struct.pack(f"{order}ii", 1, version)
    header = struct.pack(f"{order}i", dimension)
    data += struct.pack(f"{order}i{position}", 3, len(data) + 4 + struct.calcsize(position) + 4) + header
    body = struct.pack(f"{order}{count}i{len(kinds)}i", len(rows), len(kinds), *kinds)
    body += np.asarray(rows, dtype=f"{order}{real}").tobytes()
    following = len(data) + 4 + struct.calcsize(position) + len(body)
    return (
        data
        + struct.pack(f"{order}i{position}", 62, following)
        + body
        + struct.pack(f"{order}i{position}", 54, 0)
    )


def lower(tensors: np.ndarray) -> np.ndarray:
    return tensors[:, *np.tril_indices(tensors.shape[1])]


def test_text_of_the_plane_and_of_space(tmp_path):
    path = tmp_path / "a.sol"
    path.write_text(text(2, "2\n1 3", "2 0.5 3", "1 0 4"))
    assert (read_tensors(path) == PLANE).all()
    path.write_text("# by hand\n" + text(3, "1\n1 3", "2 .5 3D0 0.25 -1.25e-1 4"))
    assert (read_tensors(path) == SPACE).all()


def test_the_tensor_among_other_solutions(tmp_path):
    path = tmp_path / "a.sol"
    path.write_text(text(2, "2 3 1 3 2", "9 2 0.5 3 8 8", "9 1 0 4 8 8"))
    assert (read_tensors(path) == PLANE).all()


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_binary(tmp_path, order, version):
    path = tmp_path / "a.solb"
    for tensors in (PLANE, SPACE):
        path.write_bytes(binary(tensors.shape[1], [3], lower(tensors), order, version))
        assert (read_tensors(path) == tensors).all()
    rows = np.hstack([np.full((2, 1), 9.0), lower(PLANE)])
    path.write_bytes(binary(2, [1, 3], rows, order, version))
    assert (read_tensors(path) == PLANE).all()


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ("", "not a MEDIT file"),
        ("hello", "not a MEDIT file"),
        ("MeshVersionFormatted 2\nDimension 2\nEnd\n", "no section SolAtVertices"),
        ("MeshVersionFormatted 2\nSolAtVertices 1 1 3 1 0 1\n", "Dimension"),
        (text(2, "1\n1 1", "2"), "has a scalar a vertex; scalars are sizes"),
        (text(2, "1\n1 2", "2 2"), "has a vector a vertex; one tensor"),
        (text(2, "1\n2 3 3", "1 0 1 1 0 1"), "a tensor, a tensor a vertex; one tensor"),
        (text(2, "1\n1 4", "2 2"), "kind 1, 2 or 3"),
        (text(2, "1\n0", "2 2"), "kind 1, 2 or 3"),
        (text(2, "1\n3 3", ""), "kind 1, 2 or 3"),
        (text(2, "", ""), "should begin with"),
        (text(2, "1\n999999", ""), "should begin with"),
        (text(2, "2\n1 3", "1.0 0.0 1.0"), "2 rows of 3 numbers"),
        (text(2, "999999999\n1 3", "1 0 1"), "too short"),
        (text(2, "1\n1 3", "1 0 1 1"), "1 rows of 3 numbers"),
        (text(2, "1\n1 3", "1 0 nan"), "too short"),
        (text(2, "1\n1 3", "1 0 -"), "1 rows of 3 numbers"),
    ],
)
def test_damaged_text(tmp_path, content, fault):
    path = tmp_path / "a.sol"
    path.write_text(content)
    with pytest.raises(InputError, match=fault) as error:
        read_tensors(path)
    assert "\n" not in str(error.value)


def test_damaged_binary_files_raise_input_errors_only(tmp_path):
    """Cut anywhere, and with any four bytes replaced: an error in one line, or tensors."""
    path = tmp_path / "a.solb"
    whole = binary(3, [3], lower(SPACE))
    damaged = [whole[:n] for n in range(4, len(whole))]
    for n in range(4, len(whole) - 4, 4):
        damaged += [whole[:n] + struct.pack("<i", value) + whole[n + 4 :] for value in (-1, 0, 7, 2**31 - 1)]
    messages = []
    for data in damaged:
        path.write_bytes(data)
        try:
            assert read_tensors(path).shape[1:] in ((2, 2), (3, 3))
        except InputError as error:
            messages.append(str(error))
    assert len(messages) > len(damaged) / 3
    assert not any("\n" in message for message in messages)


def test_a_missing_file_is_said(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_tensors(tmp_path / "none.sol")


@pytest.mark.parametrize(("kind", "n", "program"), [("triangle", 5, "mmg2d_O3"), ("tetra", 4, "mmg3d_O3")])
def test_mmg_writes_the_metric_that_a_mesh_has(tmp_path, kind, n, program):
    """With -optim -A the tensor at a vertex is, up to size, the inverse of the sum of e eᵀ over its edges."""
    program = require_program(program)
    mesh = boxes_of(kind, n)
    d = mesh.points.shape[1]
    points = mesh.points @ np.array([[1.0, 0.6, 0.3], [0.0, 0.4, -0.2], [0.0, 0.0, 0.2]])[:d, :d].T
    cells = mesh.cells[0].vertices
    source = tmp_path / "in.mesh"
    meshio.write(source, meshio.Mesh(points, [(kind, cells)]), file_format="medit")
    command = [program, "-optim", "-A", "-noinsert", "-noswap", "-nomove", "-hgrad", "-1", "-v", "0"]
    files = [str(source), str(tmp_path / "out.mesh")]
    subprocess.run([*command, *files], check=True, capture_output=True, timeout=600)
    tensors = read_tensors(tmp_path / "out.sol")
    assert len(tensors) == len(points)
    inner = np.flatnonzero(((mesh.points > 1e-9) & (mesh.points < 1 - 1e-9)).all(axis=1))
    for vertex in inner:
        around = cells[(cells == vertex).any(axis=1)]
        edges = points[np.setdiff1d(around, [vertex])] - points[vertex]
        expected = np.linalg.inv(edges.T @ edges)
        got = tensors[vertex] / np.linalg.det(tensors[vertex]) ** (1 / d)
        assert got == pytest.approx(expected / np.linalg.det(expected) ** (1 / d), rel=1e-3)
