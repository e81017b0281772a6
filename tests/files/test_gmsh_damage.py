"""Damaged and unsupported Gmsh files: one clear line, never another exception, a hang or a memory blow-up."""

from __future__ import annotations

import io
import itertools
import re
import struct
import tracemalloc
import warnings

import numpy as np
import pytest

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh import read
from fuzz import mutated
from gmsh_corpus import NAMES, corpus

SMALL = 12_000  # bytes
MODEST = 64_000_000  # bytes; ample for what stands in a small file, nothing for what it may declare

TEXT_2 = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
1
2 5 "sheet"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
2
1 2 2 5 1 1 2 3
2 2 2 5 1 1 3 4
$EndElements
$Periodic
1
1 2 4
1
2 1
$EndPeriodic
$NodeData
1
"h"
1
0
3
0
1
1
2 0.5
$EndNodeData
"""
TEXT_4 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$Entities
0 0 1 0
1 0 0 0 1 1 0 1 5 0
$EndEntities
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
0 0 0
1 0 0
1 1 0
0 1 0
$EndNodes
$Elements
1 2 1 2
2 1 2 2
1 1 2 3
2 1 3 4
$EndElements
"""


def read_quietly(data: bytes) -> str:
    """Read a file that may be damaged: the message, or "" if all is well and what is written can be read."""
    try:
        source = read(data)
    except InputError as error:
        message = str(error)
        assert message
        assert "\n" not in message
        assert message.isprintable()
        return message
    points = np.where(np.isfinite(source.mesh.points), source.mesh.points, 0.0) + 0.25
    file = io.BytesIO()
    source.write(points, file)
    assert np.array_equal(read(file.getvalue()).mesh.points, points)
    return ""


@pytest.mark.parametrize("seed", [0, *(pytest.param(i, marks=pytest.mark.long) for i in range(1, 8))])
def test_mutated_files_give_an_input_error_or_a_mesh(seed):
    files = [data for data in map(corpus, NAMES) if len(data) < SMALL]
    assert len(files) > 50
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        outcomes = [read_quietly(data) for data in mutated(files, 1000, seed)]
    assert 300 < sum(map(bool, outcomes)) < 1000


@pytest.mark.parametrize("name", ["sparse_tags-22-ascii", "sparse_tags-22-binary", "sparse_tags-41-binary"])
def test_truncated_anywhere(name):
    data = corpus(name)
    between_sections = {match.end() for match in re.finditer(rb"\$End\w+\n?", data)} | {0}
    between_sections |= {end - 1 for end in between_sections}
    for size in range(len(data) - 1):
        message = read_quietly(data[:size])
        assert "truncated" in message or size in between_sections or size <= len("$MeshFormat")


@pytest.mark.parametrize(
    "name",
    [
        "partitioned_topology-41-binary",
        *(pytest.param(name, marks=pytest.mark.long) for name in ("coarse-41-binary", "coarse-22-ascii")),
    ],
)
def test_no_count_is_believed(name):
    """Put huge numbers in place of every size in a file, and watch the memory."""
    data = corpus(name)
    huge = itertools.cycle([10**6, 2**31 - 1, 2**31, 2**32 + 7, 2**62, 2**63 - 1, -1, -(2**63)])
    if name.endswith("binary"):
        places = range(data.index(b"$Entities"), len(data) - 8, 4)
        spans = [(at, at + 8) for at in places if 0 <= struct.unpack_from("<q", data, at)[0] < 1000]
        numbers = (struct.pack("<q", n) for n in huge)
    else:
        spans = [match.span() for match in re.finditer(rb"(?<=\s)\d+(?=\s)", data)]
        numbers = (b"%d" % n for n in huge)
    assert len(spans) > 200
    tracemalloc.start()
    try:
        for (start, stop), number in zip(spans, numbers, strict=False):
            read_quietly(data[:start] + number + data[stop:])
        assert tracemalloc.get_traced_memory()[1] < MODEST
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("2.2 0 8", "1 0 8", r"MSH format 1 is not supported .*convert it with 'gmsh IN -save"),
        ("2.2 0 8", "5 0 8", r"MSH format 5 is not supported"),
        ("2.2 0 8", "4.2 0 8", r"MSH format 4.2 is not supported"),
        ("2.2 0 8", "2.2 2 8", r"\$MeshFormat is damaged"),
        ("2.2 0 8", "2.2", r"\$MeshFormat is damaged"),
        ("2.2 0 8", "2.2 1 8", r"\$MeshFormat is damaged: it does not give the byte order"),
        ("2.2 0 8", "2.2 1 4", r"a data size other than 8"),
        ("$MeshFormat\n2.2 0 8\n$EndMeshFormat", "", r"no \$MeshFormat section"),
        ("$MeshFormat", "$NOD\n$ENDNOD\n$MeshFormat", r"more than one \$Nodes section"),
        ("$MeshFormat", "(0 grid written by ANSYS Fluent)", r"not a Gmsh mesh"),
        ("$EndNodes\n", "$EndNodes\nstray\n", r"a section is expected where 'stray' stands"),
        ("$EndNodes\n", "", r"\$Nodes has no \$EndNodes"),
        ("$Nodes\n", "", r"expected where '4' stands"),
        (
            '$PhysicalNames\n1\n2 5 "sheet"\n',
            "",
            r"\$EndPhysicalNames stands where no such section",
        ),
        ("$Nodes", "$Notes", r"\$Notes has no \$EndNotes"),
        ("4\n1 0 0 0", "5\n1 0 0 0", r"\$Nodes ends early or declares too much"),
        ("4\n1 0 0 0", "3\n1 0 0 0", r"\$Nodes holds more than it declares"),
        ("4\n1 0 0 0", "4\n1 0 zero 0", r"\$Nodes .*something that is not a number"),
        ("4\n1 0 0 0", "4\n1.5 0 0 0", r"\$Nodes has a number with a fraction"),
        ("4\n1 0 0 0", "4\nnan 0 0 0", r"\$Nodes has a number with a fraction"),
        ("4\n1 0 0 0", "4\n0 0 0 0", r"node tag 0 is not positive"),
        ("4\n1 0 0 0", "4\n3 0 0 0", r"node tag 3 occurs more than once"),
        ("2 2 2 5 1 1 3 4", "2 2 2 5 1 1 3 99", r"element 2 refers to node 99, which the file lacks"),
        ("2 2 2 5 1 1 3 4", "2 34 2 5 1 1 3 4", r"Gmsh element type 34 is not supported"),
        ("2 2 2 5 1 1 3 4", "2 2 -2 5 1 1 3 4", r"\$Elements ends early"),
        ("2 2 2 5 1 1 3 4", "2 2 2 5 1 1 3 4 4", r"\$Elements holds more"),
        ("2 2 2 5 1 1 3 4", "2 2 2 5 1 1 3", r"\$Elements ends early"),
        ("2\n1 2 2", "two\n1 2 2", r"\$Elements .*something that is not a number"),
        ('2 5 "sheet"', '2 "sheet"', r"""'2 "sheet"' does not name a group"""),
        ('1\n2 5 "sheet"', '2\n2 5 "sheet"', r"declares 2 names and holds 1"),
        (
            '1\n2 5 "sheet"',
            'one\n2 5 "sheet"',
            r"\$PhysicalNames .*a count is expected where 'one'",
        ),
        ("1 2 4\n1\n2 1", "1 2 4\n7\n2 1", r"\$Periodic is truncated or damaged"),
        ("1\n1 2 4\n1", "8\n1 2 4\n1", r"\$Periodic is truncated or damaged"),
        ("0\n1\n1\n2 0.5", "0\n1\n7\n2 0.5", r"\$NodeData does not hold the 7 values"),
        ("0\n1\n1\n2 0.5", "0\none\n1\n2 0.5", r"\$NodeData is damaged: its integer tags are wrong"),
        ("0\n1\n1\n2 0.5", "0\n1\n1\n2 np.float64(0.5)", r"\$NodeData .*something that is not a number"),
    ],
)
def test_message_names_what_is_wrong_in_msh_2(old, new, message):
    assert read_quietly(TEXT_2.encode()) == ""
    assert TEXT_2.count(old) == 1
    assert re.search(message, read_quietly(TEXT_2.replace(old, new).encode()))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("4.1 0 8", "4.0 0 8", r"\$Nodes is damaged"),
        ("0 0 1 0", "0 0 2 0", r"\$Entities ends early"),
        ("0 0 1 0", "0 0 0 0", r"\$Entities holds more than it declares"),
        ("1 0 0 0 1 1 0 1 5 0", "1 0 0 0 1 1 0 99999999999 5 0", r"\$Entities ends early"),
        (
            "1 0 0 0 1 1 0 1 5 0",
            "1 0 0 0 1 1 0 70 " + "5 " * 70 + "0",
            r"in 70 physical groups; dvr takes",
        ),
        ("1 4 1 4", "1 5 1 4", r"\$Nodes declares 5 nodes and holds 4"),
        ("1 4 1 4", "2 4 1 4", r"\$Nodes ends early"),
        ("2 1 0 4", "2 1 0 5", r"\$Nodes ends early"),
        ("2 1 0 4", "4 1 0 4", r"a block of nodes has a wrong header"),
        ("2 1 0 4", "2 1 7 4", r"a block of nodes has a wrong header"),
        ("2 1 0 4", "2 1 1 4", r"\$Nodes ends early"),
        ("$Nodes", "$ParametricNodes", r"\$ParametricNodes has no \$EndParametricNodes"),
        ("1 2 1 2", "1 3 1 2", r"\$Elements declares 3 elements and holds 2"),
        ("2 1 2 2", "2 1 77 2", r"Gmsh element type 77 is not supported"),
        ("2 1 3 4", "2 1 3 -4", r"element 2 refers to node -4"),
        (
            "$EndElements\n",
            "$EndElements\n$Elements\n0 0 0 0\n$EndElements\n",
            r"more than one \$Elements",
        ),
    ],
)
def test_message_names_what_is_wrong_in_msh_4(old, new, message):
    assert read_quietly(TEXT_4.encode()) == ""
    assert TEXT_4.count(old) == 1
    assert re.search(message, read_quietly(TEXT_4.replace(old, new).encode()))


def test_element_in_too_many_groups():
    lines = "\n".join(f"{i} 2 2 {i} 1 1 2 3" for i in range(1, 71))
    data = TEXT_2.replace("2\n1 2 2 5 1 1 2 3\n2 2 2 5 1 1 3 4", f"70\n{lines}").encode()
    assert read_quietly(data) == "an element is in 70 physical groups; dvr takes 64"


def test_parametric_nodes_do_not_belong_in_msh_4():
    data = TEXT_4.replace("Nodes", "ParametricNodes").encode()
    assert read_quietly(data) == "the file has no $Nodes section, hence no mesh"


@pytest.mark.parametrize("data", [b"", b"\n\n", b"$", b"$MeshFormat", bytes(1000), bytes(range(256)) * 9])
def test_no_mesh_at_all(data):
    assert read_quietly(data)


def test_missing_newline_at_the_end_is_no_damage():
    assert read_quietly(TEXT_2.rstrip().encode()) == ""
