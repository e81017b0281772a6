"""Losses named by kind and count: of every kind a file can have, into every format that takes cells."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from dvr_cli.cli.main import main
from dvr_cli.files.formats import FORMATS, format_named
from dvr_cli.files.losses import counted
from dvr_cli.files.reading import open_mesh
from dvr_cli.mesh.mesh import Cells, Mesh

# Eight triangles round the middle of a square, two fields at its vertices, three of its cells and two strings
VTK = """# vtk DataFile Version 3.0
square
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 9 double
0 0 0  1 0 0  2 0 0  0 1 0  1.1 1.2 0  2 1 0  0 2 0  1 2 0  2 2 0
CELLS 8 32
3 0 1 4  3 1 2 4  3 2 5 4  3 5 8 4  3 8 7 4  3 7 6 4  3 6 3 4  3 3 0 4
CELL_TYPES 8
5 5 5 5 5 5 5 5
FIELD of_the_file 1
TIME 1 1 double
0.5
POINT_DATA 9
SCALARS pressure double 1
LOOKUP_TABLE default
0.5 1 2 3 4 5 6 7 8.5
VECTORS velocity double
0.5 0 0  0 0 0  0 0 0  0 0 0  0 0 0  0 0 0  0 0 0  0 0 0  0 0 0
CELL_DATA 8
FIELD cells 5
density 1 8 double
0.5 1 2 3 4 5 6 7
damage 1 8 double
1.5 1 2 3 4 5 6 7
strain 1 8 double
2.5 1 2 3 4 5 6 7
label 1 8 string
a
b
c
d
e
f
g
h
material 1 8 string
a
b
c
d
e
f
g
h
"""


def notes(source: Path, target: Path, capsys, *options: str) -> list[str]:
    capsys.readouterr()
    arguments = ["smooth", str(source), str(target), "--no-report", "-n", "1", *options]
    assert main(arguments) == 0
    return re.findall(r"note: .*?: (.*)\n", capsys.readouterr().err)


@pytest.fixture
def square(tmp_path) -> Path:
    path = tmp_path / "square.vtk"
    path.write_text(VTK)
    return path


@pytest.mark.parametrize("name", [n for n in FORMATS if format_named(n).converter is not None and n != "vtk"])
def test_fields_and_strings_are_counted_in_every_format(square, tmp_path, capsys, name):
    out = tmp_path / f"out{format_named(name).suffixes[0]}"
    lines = notes(square, out, capsys, "--output-format", name)
    assert "not kept: 2 string arrays (label, material)" in lines
    assert "not kept: 1 field array (TIME)" in lines
    back = open_mesh(out, name).mesh
    if not {"pressure", "velocity"} & back.point_data.keys():
        assert "not kept: 2 point fields (pressure, velocity)" in lines
    if not {"density", "damage", "strain"} & back.cell_data.keys():
        assert "not kept: 3 cell fields (damage, density, strain)" in lines


def test_sets_facets_and_links_are_counted(tmp_path):
    points = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.4, 0.5]])
    triangles = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    mesh = Mesh(
        points,
        [Cells("triangle", triangles)],
        cell_sets={"left": [np.array([3])], "right": [np.array([1])]},
        point_sets={"hinge": np.array([0])},
        facet_sets={f"wall{i}": np.array([[0, 1]]) for i in range(10)},
        field_data={"sheet": np.array([7, 2])},
        periodic=np.array([[0, 1], [2, 3]]),
    )
    target = format_named("vtu").convert(mesh, ["not kept: 1 drawing"])
    target.stored(points)
    assert target.notes == [
        "not kept: 1 drawing",
        "not kept: 1 group name (sheet)",
        "not kept: 2 cell sets (left, right)",
        "not kept: 1 point set (hinge)",
        "not kept: 10 facet sets (wall0, wall1, wall2, wall3, wall4, wall5, wall6, wall7, 2 more)",
        "not kept: 2 periodic links",
    ]


def test_sections_views_and_steps_of_gmsh_are_counted(tmp_path, capsys):
    path = tmp_path / "in.msh"
    nodes = "$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 .4 .5 0\n$EndNodes\n"
    elements = "$Elements\n4\n" + "".join(f"{i + 1} 2 2 0 1 {i + 1} {(i + 1) % 4 + 1} 5\n" for i in range(4))
    step = '$NodeData\n1\n"T"\n1\n{0}\n3\n{0}\n1\n5\n1 0\n2 0\n3 0\n4 0\n5 {0}\n$EndNodeData\n'
    odd = '$ElementData\n1\n"odd"\n1\n0\n3\n0\n2\n1\n1 0 0\n$EndElementData\n'
    other = '$ElementNodeData\n1\n"s"\n1\n0\n3\n0\n1\n1\n1 3 0 0 0\n$EndElementNodeData\n'
    head = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Comments\nby hand\n$EndComments\n"
    path.write_text(
        head
        + nodes
        + elements
        + "$EndElements\n"
        + "".join(step.format(i) for i in range(3))
        + odd
        + 2 * other
    )
    lines = notes(path, tmp_path / "out.vtu", capsys)
    assert "not kept: 2 steps of a field" in lines
    assert "not kept: 1 field of neither numbers, vectors nor tensors" in lines
    assert "not kept: 2 sections of kind ElementNodeData" in lines


@pytest.mark.parametrize(
    ("count", "what", "text"),
    [
        (1, "entry", "1 entry"),
        (2, "entry", "2 entries"),
        (3, "array", "3 arrays"),
        (2, "other mesh", "2 other meshes"),
        (2, "set of names", "2 sets of names"),
    ],
)
def test_numbers_and_plurals(count, what, text):
    assert counted(count, what) == text
