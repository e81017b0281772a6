"""MSH 1, 3 and 4.0, as Gmsh writes them, and reads what is written; binary 4.0 is made from the text."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh import read
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.groups import group_vertices
from fuzz import COUNTS, check_damaged
from gmsh_session import gmsh_session, opened_by_gmsh
from needs import require
from sources import written

# version, binary, parametric; Gmsh writes binary files of version 1 as 2.2, and none of version 4.0
KINDS = [(version, binary, p) for version in (1, 3, 4.0) for binary in (0, 1) for p in (0, 1)]
KINDS = [kind for kind in KINDS if kind[0] == 3 or not kind[1]]
NAMES = [f"{version:g}-{'binary' if binary else 'text'}-{p}" for version, binary, p in KINDS]

# Gmsh opens no binary files of version 4.0, nor its own ones with parameters of version 1 and, binary, 3
GMSH_CANNOT = ("1-text-1", "3-binary-1", "4-binary-0", "4-binary-1")


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> dict[str, bytes]:
    """Two boxes that share a face and are groups, in all the older versions, and in 4.1."""
    gmsh = require("gmsh")
    folder = tmp_path_factory.mktemp("older")
    with gmsh_session():
        boxes = [(3, gmsh.model.occ.addBox(x, 0, 0, 1, 1, 1)) for x in (0, 1)]
        gmsh.model.occ.fragment(boxes[:1], boxes[1:])
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [boxes[0][1]], 7, "left")
        gmsh.model.addPhysicalGroup(3, [boxes[1][1]], 8, "right")
        gmsh.model.addPhysicalGroup(2, [1], 3, "wall")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
        gmsh.model.mesh.generate(3)
        made = {}
        for (version, binary, parametric), name in zip(KINDS, NAMES, strict=True):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.option.setNumber("Mesh.SaveParametric", parametric)
            gmsh.write(str(folder / "x.msh"))
            made[name] = (folder / "x.msh").read_bytes()
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.option.setNumber("Mesh.SaveParametric", 0)
        gmsh.write(str(folder / "x.msh"))
        made["4.1"] = (folder / "x.msh").read_bytes()
    for parametric in (0, 1):
        made[f"4-binary-{parametric}"] = binary_of(made[f"4-text-{parametric}"])
    return made


def binary_of(text: bytes) -> bytes:
    """A file of version 4.0, text, in binary, as its documentation has it."""
    sections = {}
    for name in (b"PhysicalNames", b"Entities", b"Nodes", b"Elements"):
        sections[name] = text[text.index(b"$" + name) :].split(b"\n$End" + name)[0].split(b"\n", 1)[1]

    def numbers(name):
        return iter(sections[name].split())

    def pack(out, source, kinds):
        words = [next(source) for _ in kinds]
        values = [float(w) if kind == "d" else int(w) for kind, w in zip(kinds, words, strict=True)]
        out.append(struct.pack("<" + kinds, *values))
        return values

    entities: list[bytes] = []
    source = numbers(b"Entities")
    for dimension, count in enumerate(pack(entities, source, "QQQQ")):
        for _ in range(count):
            pack(entities, source, "i" * pack(entities, source, "iddddddQ")[-1])
            if dimension:
                pack(entities, source, "i" * pack(entities, source, "Q")[0])
    nodes: list[bytes] = []
    source = numbers(b"Nodes")
    for _ in range(pack(nodes, source, "QQ")[0]):
        _, dimension, parametric, count = pack(nodes, source, "iiiQ")
        for _ in range(count):
            pack(nodes, source, "iddd" + "d" * (dimension if parametric else 0))
    elements: list[bytes] = []
    source = numbers(b"Elements")
    for _ in range(pack(elements, source, "QQ")[0]):
        _, _, code, count = pack(elements, source, "iiiQ")
        for _ in range(count):
            pack(elements, source, "i" * (1 + {15: 1, 1: 2, 2: 3, 4: 4}[code]))
    out = b"$MeshFormat\n4 1 8\n" + struct.pack("<i", 1) + b"\n$EndMeshFormat\n"
    out += b"$PhysicalNames\n" + sections[b"PhysicalNames"] + b"\n$EndPhysicalNames\n"
    for name, parts in ((b"Entities", entities), (b"Nodes", nodes), (b"Elements", elements)):
        out += b"$" + name + b"\n" + b"".join(parts) + b"\n$End" + name + b"\n"
    return out


def cells_of(mesh):
    return sorted((block.type, sorted(block.vertices.tolist())) for block in mesh.cells)


def read_by_gmsh(path: Path) -> tuple[np.ndarray, int, list[tuple[int, int]]]:
    """Coordinates by ascending tag, the number of elements, and the groups."""
    with opened_by_gmsh(path) as (gmsh, _, points):
        elements = sum(map(len, gmsh.model.mesh.getElements()[1]))
        return points, elements, gmsh.model.getPhysicalGroups()


@pytest.mark.parametrize("name", [*NAMES, "4-binary-0", "4-binary-1"])
def test_each_version_is_the_same_mesh_and_gmsh_reads_what_is_written(files, name, tmp_path):
    own = read(files["4.1"]).mesh
    source = read(files[name])
    mesh = source.mesh
    assert np.abs(mesh.points - own.points).max() < 1e-15
    assert cells_of(mesh) == cells_of(own)
    assert np.array_equal(domain_of(mesh).interior, domain_of(own).interior)
    assert domain_of(mesh).interior.sum() > 0
    if not name.startswith("1"):  # it has no names
        for group in ("left", "right", "wall"):
            assert np.array_equal(group_vertices(mesh, group), group_vertices(own, group))
    assert written(source, mesh.points.copy()) == files[name]
    path = tmp_path / "x.msh"
    path.write_bytes(files[name])
    opened = name not in GMSH_CANNOT
    if opened:
        assert np.array_equal(read_by_gmsh(path)[0], mesh.points)
    points = mesh.points.copy()
    inside = np.flatnonzero(domain_of(mesh).interior)
    points[inside] += 1 / 64
    points[-1] += 1 / 3
    path.write_bytes(written(source, points))
    if opened:
        theirs, elements, groups = read_by_gmsh(path)
        assert np.array_equal(theirs, points)
        assert elements == sum(len(block.vertices) for block in mesh.cells)
        assert groups == [(2, 3), (3, 7), (3, 8)]
    again = read(path.read_bytes()).mesh
    assert np.array_equal(again.points, points)
    assert cells_of(again) == cells_of(mesh)


@pytest.mark.parametrize("name", [*NAMES, "4-binary-0", "4-binary-1"])
def test_nodes_that_leave_their_surface_lose_their_parameters(files, name, tmp_path):
    source = read(files[name])
    own = read(files["4.1"]).mesh
    wall = np.flatnonzero(group_vertices(own, "wall"))
    points = source.mesh.points.copy()
    points[wall] += 1 / 3
    out = written(source, points)
    assert bool(source.notes) == name.endswith("1")
    again = read(out)
    assert np.array_equal(again.mesh.points, points)
    assert cells_of(again.mesh) == cells_of(source.mesh)
    path = tmp_path / "x.msh"
    path.write_bytes(out)
    if name == "1-text-1" or name not in GMSH_CANNOT:  # its parameters are gone now
        assert np.array_equal(read_by_gmsh(path)[0], points)


def test_two_materials_keep_their_interface(files):
    for name in (*NAMES, "4-binary-0"):
        mesh = read(files[name]).mesh
        interface = mesh.points[:, 0] == 1.0
        assert interface.sum() > 4
        assert not domain_of(mesh).interior[interface].any()


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("1-text-0", b"$ENDNOD", b"$EndNOD", "no $ENDNOD"),
        ("1-text-0", b"\n1 2 3 1 3 ", b"\n1 2 3 1 4 ", "gives an element of type 2 4 nodes"),
        ("1-text-0", b"$ELM", b"$NOD\n0\n$ENDNOD\n$ELM", "more than one $Nodes"),
        ("3-text-1", b"$Entities\n", b"$Entities\n1 ", "$Entities"),
        ("4-text-0", b"$MeshFormat\n4 0 8", b"$MeshFormat\n4.2 0 8", "MSH format 4.2 is not supported"),
    ],
)
def test_refused_with_one_line_that_says_why(files, name, old, new, words):
    assert old in files[name]
    with pytest.raises(InputError) as caught:
        read(files[name].replace(old, new, 1))
    assert words in str(caught.value)


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(files, count):
    small = [data for name, data in files.items() if name != "4.1"]
    check_damaged(small, count, 59, read, least=0.02, exact=True)
