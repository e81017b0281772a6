"""Universal files: as Gmsh writes them, by hand what else the format has; Gmsh reads what is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dvr_cli.errors import InputError
from dvr_cli.files.formats import format_of
from dvr_cli.files.reading import open_mesh
from dvr_cli.files.unv import read
from dvr_cli.files.unv.elements import NODE_ORDER
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import domain_of
from fuzz import COUNTS, check_damaged
from gmsh_session import gmsh_session, opened_by_gmsh
from needs import require
from sources import cells_of, written

# label, x, y: two materials meet along 2, 5, 3; the nodes 5, 8 and 9 would like to move.
POINTS = [(1, 0, 0), (2, 2, 0), (3, 2, 2), (4, 0, 2), (5, 2, 0.75), (6, 4, 0), (7, 4, 2), (18, 1.25, 1)]
POINTS += [(9, 3.25, 1)]
QUADS = [(1, 1, (1, 2, 5, 18)), (2, 1, (5, 3, 4, 18))]
TRIANGLES = [(3, 1, (4, 1, 18)), (4, 2, (2, 6, 9)), (5, 2, (6, 7, 9)), (6, 2, (7, 3, 9)), (7, 2, (3, 5, 9))]
TRIANGLES += [(8, 2, (5, 2, 9))]


def dataset(number: int, *lines: str) -> str:
    return "\n".join(["    -1", f"{number:6d}", *lines, "    -1", ""])


def integers(*numbers: int) -> str:
    rows = [numbers[i : i + 8] for i in range(0, len(numbers), 8)]
    return "\n".join("".join(f"{n:10d}" for n in row) for row in rows)


def nodes(number: int, exponent: str = "D", system: int = 1, displacement: int = 1) -> str:
    lines = []
    for label, x, y in POINTS:
        head = integers(label, system, displacement, 11)
        if number == 15:
            lines.append(head + "".join(f"{v:13.5E}" for v in (x, y, 0.5)))
        else:
            row = "".join(f"{v:25.16E}" for v in (x, y, 0.5)).replace("E", exponent)
            lines += [head, row]
    return dataset(number, *lines)


def element(label: int, fe: int, tag: int, corners: tuple[int, ...], beam: bool = False) -> str:
    lines = [integers(label, fe, tag, 10 + tag, 7, len(corners))]
    return "\n".join([*lines, *([integers(0, 1, 1)] if beam else []), integers(*corners)])


ELEMENTS = dataset(
    2412,
    *(element(label, 44, tag, corners) for label, tag, corners in QUADS),
    *(element(label, 91, tag, corners) for label, tag, corners in TRIANGLES),
    element(20, 21, 3, (1, 2), beam=True),
    element(21, 161, 4, (4,)),
)
UNITS = dataset(164, "         1  SI: Meter (newton)         2", "  1.0000000000000000E+00" * 3)
GROUPS = dataset(
    2467,
    integers(1, 0, 0, 0, 0, 0, 0, 3),
    "left half",
    integers(8, 1, 0, 0, 8, 2, 0, 0),
    integers(8, 3, 0, 0),
    integers(2, 0, 0, 0, 0, 0, 0, 2),
    "corner",
    integers(7, 1, 0, 0, 7, 18, 0, 0),
)
SYSTEMS = dataset(
    2420,
    integers(1),
    "part",
    integers(1, 0, 8),
    "global",
    *("".join(f"{v:25.16E}" for v in row) for row in np.eye(4, 3)),
    integers(2, 1, 8),
    "round",
    *("".join(f"{v:25.16E}" for v in row) for row in np.eye(4, 3)),
)
FILES = {
    "2411": UNITS + SYSTEMS + nodes(2411) + ELEMENTS + GROUPS + dataset(2414, "         1", "stress"),
    "2411 E": nodes(2411, "E", 0, 0) + ELEMENTS,
    "781": nodes(781, "E") + ELEMENTS + GROUPS,
    "15": nodes(15, system=0, displacement=0) + ELEMENTS,
}
FILES = {name: text.encode() for name, text in FILES.items()}


def by_gmsh(folder: Path, order: int, kind: str) -> tuple[Path, Path]:
    """A box that Gmsh meshes and writes as UNV, and as MSH."""
    gmsh = require("gmsh")
    with gmsh_session(Mesh_SecondOrderIncomplete=1, Mesh_MeshSizeMin=0.9):
        square = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        layers = {"numElements": [2], "recombine": kind != "tetra"}
        made = gmsh.model.occ.extrude([(2, square)], 0, 0, 1, **layers)
        gmsh.model.occ.synchronize()
        box = next(tag for dimension, tag in made if dimension == 3)
        if kind == "hexahedron":
            gmsh.model.mesh.setTransfiniteSurface(square)
            gmsh.model.mesh.setRecombine(2, square)
        gmsh.model.addPhysicalGroup(3, [box], 1, "body")
        gmsh.model.addPhysicalGroup(2, [square], 2, "floor")
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", 1)
        gmsh.write(str(folder / "x.unv"))
        gmsh.write(str(folder / "x.msh"))
    return folder / "x.unv", folder / "x.msh"


def read_by_gmsh(path: Path) -> tuple[np.ndarray, dict[str, int]]:
    """Coordinates by ascending tag, and how many elements of each type there are."""
    with opened_by_gmsh(path) as (gmsh, _, points):
        types, elements, _ = gmsh.model.mesh.getElements()
        names = [gmsh.model.mesh.getElementProperties(kind)[0] for kind in types]
        return points, dict(zip(names, map(len, elements), strict=True))


@pytest.mark.parametrize("name", FILES)
def test_nodes_and_elements(name):
    mesh = read(FILES[name]).mesh
    assert mesh.points.tolist() == [[x, y, 0.5] for _, x, y in POINTS]
    place = {label: i for i, (label, *_) in enumerate(POINTS)}
    assert cells_of(mesh) == [
        ("quad", [[place[n] for n in corners] for *_, corners in QUADS]),
        ("triangle", [[place[n] for n in corners] for *_, corners in TRIANGLES]),
        ("line", [[0, 1]]),
        ("vertex", [[3]]),
    ]
    assert [tags.tolist() for tags in mesh.cell_data["unv:property"]] == [
        [1, 1],
        [1, 2, 2, 2, 2, 2],
        [3],
        [4],
    ]
    assert mesh.cell_data["unv:material"][0].tolist() == [11, 11]


def test_groups_and_what_else_there_is():
    source = read(FILES["2411"])
    mesh = source.mesh
    assert [members.tolist() for members in mesh.cell_sets["left half"]] == [[0, 1], [0], [], []]
    assert mesh.point_sets["corner"].tolist() == [0, 7]
    assert [tags.tolist() for tags in mesh.cell_data["unv:group"]] == [[1, 1], [1, 0, 0, 0, 0, 0], [0], [0]]
    assert source.unread == ["not kept: 1 dataset of kind 2414"]


def test_interfaces_stay():
    assert np.flatnonzero(domain_of(read(FILES["2411"]).mesh).interior).tolist() == [7, 8]
    same = ELEMENTS.replace(f"{2:10d}{12:10d}", f"{1:10d}{11:10d}")
    assert same != ELEMENTS
    assert np.flatnonzero(domain_of(read((nodes(2411) + same).encode()).mesh).interior).tolist() == [4, 7, 8]


@pytest.mark.parametrize("line_end", [b"\n", b"\r\n"])
@pytest.mark.parametrize("name", FILES)
def test_unmoved_is_identical(name, line_end):
    data = FILES[name].replace(b"\n", line_end)
    source = read(data)
    assert written(source, source.mesh.points.copy()) == data


@pytest.mark.parametrize("name", FILES)
def test_moved_differs_in_coordinates_only(name):
    data = FILES[name]
    source = read(data)
    points = source.mesh.points.copy()
    points[7] = -1 / 3, 1e-17, 0.5
    points[8, 0] = 12345.678901234
    out = written(source, points)
    assert len(out) == len(data)  # columns are kept
    old, new = data.split(b"\n"), out.split(b"\n")
    changed = [i for i, (a, b) in enumerate(zip(old, new, strict=True)) if a != b]
    assert len(changed) == 2
    assert b"0.5" in new[changed[0]] or b"5.0000" in new[changed[0]]
    again = read(out).mesh
    stored = source.stored(points)
    assert np.array_equal(again.points, stored)
    assert cells_of(again) == cells_of(source.mesh)
    if name == "15":
        assert np.abs(stored - points).max() < 5e-7  # half of the last digit that fits
        assert stored[7].tolist() == [-0.333333333, 1e-17, 0.5]
    else:
        assert np.array_equal(stored, points)
        assert (b"D" in new[changed[0]]) == (name == "2411")


def test_numbers_out_of_columns_are_replaced_where_they_are():
    text = dataset(2411, "1 1 1 11", "0 0.25 0", "2 1 1 11", " 1.5 0 0", "3 1 1 11", "0 1 0")
    text += dataset(2412, "1 91 1 1 7 3", "1 2 3")
    source = read(text.encode())
    points = source.mesh.points.copy()
    points[0, 1] = 1 / 3
    assert written(source, points) == text.replace("0.25", "0.3333333333333333").encode()


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("kind", ["tetra", "wedge", "hexahedron"])
def test_files_by_gmsh(kind, order, tmp_path):
    unv, msh = by_gmsh(tmp_path, order, kind)
    own = open_mesh(msh).mesh
    data = unv.read_bytes()
    source = read(data)
    mesh = source.mesh
    assert written(source, mesh.points.copy()) == data
    assert np.abs(mesh.points - own.points).max() < 1e-15
    theirs = dict(cells_of(own))
    assert all(rows == theirs[name] for name, rows in cells_of(mesh))
    assert kind in {name.rstrip("0123456789") for name, _ in cells_of(mesh)}
    assert {"body", "floor"} <= mesh.cell_sets.keys()
    points = mesh.points + 1 / 3
    unv.write_bytes(written(source, points))
    moved, counts = read_by_gmsh(unv)
    assert np.array_equal(moved, points)
    assert sum(counts.values()) == sum(len(block.vertices) for block in mesh.cells)


@pytest.mark.parametrize("name", NODE_ORDER)
def test_orders_of_nodes_are_complete(name):
    assert sorted(NODE_ORDER[name]) == list(range(CELL_TYPES[name].nodes))


def test_content_tells_it():
    assert all(format_of(Path("-"), data).name == "unv" for data in FILES.values())


WHOLE = FILES["2411"]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"hello\n", "does not begin with a line -1"),
        (ELEMENTS.encode(), "it has no nodes"),
        (WHOLE[:-8], "does not end with a line -1"),
        (WHOLE.replace(b"  2412\n", b"  x\n"), "a dataset without a number"),
        (WHOLE.replace(b"    -1\n  2412", b"1\n    -1\n  2412"), "outside of the datasets"),
        (WHOLE.replace(b"  2412\n", b"   780\n"), "elements in dataset 780 are not supported"),
        (
            (SYSTEMS + nodes(2411, system=2) + ELEMENTS).encode(),
            "node 1 has its coordinates in coordinate system 2, which is cylindrical",
        ),
        (
            (SYSTEMS + nodes(2411, displacement=2) + ELEMENTS).encode(),
            "node 1 has its displacements in coordinate system 2",
        ),
        ((nodes(2411, system=3) + ELEMENTS).encode(), "coordinate system 3, which is undefined"),
        (
            (SYSTEMS.replace("1.0", "2.0") + nodes(2411) + ELEMENTS).encode(),
            "system 1, which is Cartesian, but turned or shifted",
        ),
        (WHOLE.replace(b"       161         4", b"       117         4"), "FE descriptor 117"),
        (WHOLE.replace(b"       161         4", b"        91         4"), "is a triangle, but has 1 nodes"),
        (WHOLE.replace(b"         9         1", b"         1         1", 1), "there are two nodes 1"),
        (WHOLE.replace(b"         7         3         9", b"         7         3        99"), "has node 99"),
        (WHOLE.replace(b"2.0000000000000000D+00", b"2.0000000000000000X+00", 1), "line 28: '"),
        (WHOLE.replace(b"         0         3\nleft", b"         0       300\nleft"), "whose 300 entities"),
    ],
)
def test_refused_with_one_line_that_says_why(data, words):
    with pytest.raises(InputError) as caught:
        read(data)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_files_raise_input_errors_only(count):
    check_damaged(list(FILES.values()), count, 53, read, least=0.02)
