"""Nastran decks: as Gmsh writes them, and by hand what else the format has; read by Gmsh and meshio, too."""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import numpy as np
import pytest

from dvr_cli.errors import DvrError, InputError, OutputError
from dvr_cli.files.formats import format_of
from dvr_cli.files.nastran import read
from dvr_cli.files.nastran.columns import field_text, value_of
from dvr_cli.files.nastran.convert import convert
from dvr_cli.files.numbers_in_text import fitted
from dvr_cli.files.reading import open_mesh
from dvr_cli.files.source import InputFile
from dvr_cli.files.writing import Output
from dvr_cli.mesh.convert import from_meshio
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from fuzz import COUNTS, mutated
from gmsh_cad import into_hexahedra
from gmsh_session import gmsh_session, opened_by_gmsh
from needs import require
from sources import cells_of, written

# A deck with all that surrounds a mesh; vertex 5 is inside.
DECK = b"""$ a plate
SOL 101
CEND
TITLE = plate, with a comma
SPC = 1
LOAD = 2
SET 5 = 1 THRU 4
BEGIN BULK
PARAM,POST,-1
GRID,1,,0.0,0.0,0.
GRID,2,,2.0,0.0,0.   $ a corner
GRID    3               2.0     2.0     0.                     345
GRID*                  4                             0.0             2.0*G4
*G4                   0.
grid*   7                               1.6             1.5
*       0.0             0
CTRIA3,51,8,1,2,7
CTRIA3  52      8       2       3       7
ctria3,53,9,3,4,7,30.
CTRIA3* 54              9               4               1
*       7
PSHELL  8       1       .1
PSHELL  9       1       .2
MAT1,1,2.1+5,,0.3
SPC1,1,123456,1,4
FORCE,2,3,0,1.0,0.,1.,0.
ENDDATA
GRID, of no account
"""

SMALL = b"""BEGIN BULK
GRID           1             0.0     0.0     0.0
GRID           2        1.0000+0    0.D0     0.0
GRID           3        1.0000+01.0000+0     0.0
GRID           4             0.01.0000+0     0.0
GRID           5        6.6667-1 2.5D-01   0.E+0
CQUAD4         1       1       1       2       5       4
CTRIA3         2       1       2       3       5
CTRIA3         3       2       3       4       5
ENDDATA
"""


def opened(text: bytes):
    return read(InputFile(text, None))


@pytest.fixture(scope="module")
def gmsh_decks():
    """Decks by Gmsh: field formats free, small, large; first and second order; tetrahedra and hexahedra.

    With each the same mesh in Gmsh's own format.
    """
    gmsh = require("gmsh")
    from pathlib import Path
    from tempfile import TemporaryDirectory

    decks = {}
    with gmsh_session(Mesh_SecondOrderIncomplete=1, Mesh_MeshSizeMin=0.9, Mesh_SaveAll=1, Mesh_Binary=1):
        for hexahedra in (False, True):
            for order in (1, 2):
                gmsh.model.add("box")
                box = gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
                gmsh.model.occ.synchronize()
                if hexahedra:
                    into_hexahedra(gmsh, box)
                gmsh.model.mesh.generate(3)
                gmsh.model.mesh.setOrder(order)
                with TemporaryDirectory() as folder:
                    gmsh.write(f"{folder}/x.msh")
                    own = open_mesh(Path(folder) / "x.msh").mesh
                    for fields in (0, 1, 2):
                        gmsh.option.setNumber("Mesh.BdfFieldFormat", fields)
                        gmsh.write(f"{folder}/x.bdf")
                        decks[hexahedra, order, fields] = (Path(folder) / "x.bdf").read_bytes(), own
                gmsh.model.remove()
    return decks


def read_by_gmsh(deck: bytes, folder: Path) -> tuple[list[int], np.ndarray]:
    """The numbers of nodes, ascending, and their coordinates that Gmsh's own reader finds."""
    path = folder / "by_gmsh.bdf"
    path.write_bytes(deck)
    with opened_by_gmsh(path) as (_, tags, points):
        return tags.tolist(), points


def test_points_cells_and_properties():
    source = opened(DECK)
    mesh = source.mesh
    assert mesh.points.tolist() == [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1.6, 1.5, 0]]
    triangles, loaded = cells_of(mesh)
    assert triangles == ("triangle", [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    assert loaded == ("vertex", [[2]])
    assert mesh.cell_data["nastran:property"][0].tolist() == [8, 8, 9, 9]
    assert source.unread == [
        "not kept: executive and case control, 1 material, 1 load, 1 constraint, 1 parameter, 2 properties"
    ]


@pytest.mark.parametrize("line_end", [b"\n", b"\r\n", b"\r"])
@pytest.mark.parametrize("deck", [DECK, SMALL], ids=["deck", "small"])
def test_unmoved_is_identical(deck, line_end):
    deck = deck.replace(b"\n", line_end)
    source = opened(deck)
    assert written(source, source.mesh.points.copy()) == deck
    assert written(opened(deck).widened(), source.mesh.points.copy()) == deck


def test_moved_differs_in_coordinates_only():
    source = opened(DECK)
    points = source.mesh.points.copy()
    points[4] = 1 / 3, 1.0, -0.25
    points[1, 0] = 1 / 3
    points[2, 1] = -1 / 3
    expected = (
        DECK.replace(b"1.6             1.5", b".3333333333333331.0")
        .replace(b"*       0.0             0\n", b"*       -0.25           0\n")
        .replace(b"2,,2.0,0.0", b"2,,.3333333,0.0")
        .replace(b"2.0     2.0     0.   ", b"2.0     -.3333330.   ")
    )
    assert written(source, points) == expected
    assert opened(expected).mesh.points.tolist() == source.stored(points).tolist()
    assert np.abs(source.stored(points) - points).max() < 4e-7


def test_numbers_of_nastran():
    assert opened(SMALL).mesh.points[4].tolist() == [0.66667, 0.25, 0.0]
    texts = [b"1.5-3", b"1.5D-3", b"1.5d-03", b"1.5E-3", b"+1.5e-3", b".0015", b"15.-4", b"1.5-03"]
    for text in texts:
        points = opened(SMALL.replace(b" 2.5D-01", text.rjust(8))).mesh.points
        assert points[4, 1] == 0.0015
    assert opened(SMALL.replace(b" 2.5D-01", b"-1.25+2 ")).mesh.points[4, 1] == -125.0
    assert opened(SMALL.replace(b" 2.5D-01", b"        ")).mesh.points[4, 1] == 0.0


def test_widened_writes_large_fields_for_what_moves():
    source = opened(SMALL.replace(b"0.E+0\n", b"0.E+0       6 $ kept\n"))
    points = source.mesh.points.copy()
    points[4, :2] = 1 / 3, 2 / 3
    wide = source.widened()
    assert wide.widened() is None
    out = written(wide, points)
    assert out == SMALL.replace(
        b"GRID           5        6.6667-1 2.5D-01   0.E+0\n",
        b"GRID*   5                               .333333333333333.666666666666667\n"
        b"*       0.              6 $ kept\n",
    )
    again = opened(out).mesh
    assert again.points.tolist() == wide.stored(points).tolist()
    assert np.abs(again.points - points).max() < 1e-15
    assert cells_of(again) == cells_of(source.mesh)


def test_coordinates_left_out_are_written_where_they_belong():
    rows = (
        b"GRID,1\nGRID,2,,1.\nGRID    3               1.      1. $ here\nGRID*   4\n*\nCQUAD4,1,1,1,2,3,4\n"
    )
    source = opened(rows)
    assert source.mesh.points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0]]
    points = source.mesh.points + np.array([[0.5, 0, 0], [0, 0, 0.5], [0, 0, 0.25], [0, 0.125, 0.5]])
    out = written(source, points)
    assert opened(out).mesh.points.tolist() == points.tolist()
    assert cells_of(opened(out).mesh) == cells_of(source.mesh)
    assert b"GRID,1,,0.5\nGRID,2,,1.,0.,0.5\n" in out
    assert b"              1.      1.      0.25$ here" in out
    large = opened(rows.replace(b"*\nCQ", b"CQ").replace(b"GRID*   4", b"GRID*   4                       "))
    out = written(large, points)
    assert opened(out).mesh.points.tolist() == points.tolist()


def test_a_number_that_grows_does_not_shift_what_is_appended():
    for blank in (b"        ", b"\t"):
        deck = b"GRID    1       " + blank + b"0.      0.\n" + BODY[BODY.index(b"GRID,2") :]
        source = opened(deck)
        points = source.mesh.points + 1 / 3
        assert opened(written(source, points)).mesh.points.tolist() == source.stored(points).tolist()


def test_tabs_stand_for_columns():
    deck = (
        b"GRID\t1\t\t0.\t0.\t0.\nGRID\t2\t\t1.\t0.\nGRID*\t3\t\t\t\t1.\t\t1.\n*\t0.\nCTRIA3\t1\t4\t1\t2\t3\n"
    )
    source = opened(deck)
    assert source.mesh.points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert source.mesh.cell_data["nastran:property"][0].tolist() == [4]
    assert written(source, source.mesh.points.copy()) == deck
    points = source.mesh.points + np.array([1 / 3, 0.5, 0])
    out = written(source, points)
    assert opened(out).mesh.points.tolist() == source.stored(points).tolist()
    assert b"GRID\t1\t\t" in out
    with pytest.raises(InputError, match="line 3: 'x' is not a number"):
        opened(deck.replace(b"1.\t\t1.", b"x\t\t1."))


def test_continuations_marked_and_unmarked():
    body = b"".join(b"GRID,%d,,%d.,%d.,%d.\n" % (i + 1, i & 1, i >> 1 & 1, i >> 2) for i in range(8))
    order = (1, 2, 4, 3, 5, 6), (8, 7)
    first = b"CHEXA   1       1       " + b"".join(b"%-8d" % i for i in order[0])
    last = b"".join(b"%-8d" % i for i in order[1])
    decks = [
        first + b"\n        " + last,
        first + b"+A1\n+A1     " + last,
        first + b"+\n+       " + last,
        b"CHEXA,1,1,1,2,4,3,5,6,+B\n$ between\n+B,8,7",
        b"CHEXA,1,1,1,2,4,3,5,6\n,8,7",
        b"chexa,1,1,1,2,4,3,5,6,\n+,8,7",
        b"CHEXA*,1,1,1,2\n*,4,3,5,6\n*,8,7",
    ]
    for deck in decks:
        mesh = opened(body + deck + b"\n").mesh
        assert cells_of(mesh) == [("hexahedron", [[0, 1, 3, 2, 4, 5, 7, 6]])]
    with pytest.raises(InputError, match="line 10: it does not continue the line before it"):
        opened(body + first + b"+A1\n+A2     " + last)


@pytest.mark.parametrize("fields", [0, 1, 2])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("hexahedra", [False, True])
def test_decks_by_gmsh(gmsh_decks, hexahedra, order, fields, tmp_path):
    deck, own = gmsh_decks[hexahedra, order, fields]
    source = opened(deck)
    mesh = source.mesh
    assert written(source, mesh.points.copy()) == deck
    assert np.abs(mesh.points - own.points).max() < 1e-6
    held = [block for block in mesh.cells if block.type == "vertex"]
    assert len(held) <= (order > 1)  # Gmsh puts a bar's third node where the card has one to turn to
    for block in mesh.cells[: -1 if held else None]:
        kind, nodes = (f"line{order + 1}", 2) if block.type == "line" and order > 1 else (block.type, None)
        theirs = np.concatenate([other.vertices[:, :nodes] for other in own.cells if other.type == kind])
        assert block.vertices.tolist() == theirs.tolist()
    rng = np.random.default_rng(3)
    points = mesh.points + rng.normal(size=mesh.points.shape) * 1e-2
    out = written(source, points)
    stored = source.stored(points)
    again = opened(out).mesh
    assert np.array_equal(again.points, stored)
    assert cells_of(again) == cells_of(mesh)
    assert np.abs(stored - points).max() < (1e-14 if fields == 2 else 1e-6)
    tags, theirs = read_by_gmsh(out, tmp_path)
    assert tags == read_by_gmsh(deck, tmp_path)[0]  # all but some mid nodes of the hexahedra it wrote itself
    assert len(tags) == len(stored) or (hexahedra, order, fields) == (True, 2, 2)
    assert np.abs(theirs - stored[np.array(tags) - 1]).max() < 1e-15
    blank = re.compile(rb"^GRID.*\n(\*.*\n)?", re.MULTILINE)
    assert blank.sub(b"", out) == blank.sub(b"", deck)
    if not (hexahedra and order == 2):  # meshio takes the nodes of CHEXA as they come
        meshio = require("meshio")
        path = tmp_path / "x.bdf"
        path.write_bytes(b"BEGIN BULK\n" + out)
        theirs = from_meshio(meshio.read(path))
        assert np.array_equal(theirs.points, stored)


@pytest.mark.parametrize(
    ("card", "cell_type", "nodes", "order"),
    [
        (b"CTRIA3", "triangle", 3, None),
        (b"CTRIAR", "triangle", 3, None),
        (b"CTRIA6", "triangle", 3, None),
        (b"CTRIA6", "triangle6", 6, None),
        (b"CTRIAX6", "triangle6", 6, [0, 2, 4, 1, 3, 5]),
        (b"CQUAD4", "quad", 4, None),
        (b"CQUADR", "quad", 4, None),
        (b"CQUAD8", "quad8", 8, None),
        (b"CQUAD", "quad9", 9, None),
        (b"CTETRA", "tetra", 4, None),
        (b"CTETRA", "tetra10", 10, None),
        (b"CPYRAM", "pyramid", 5, None),
        (b"CPYRAM", "pyramid13", 13, None),
        (b"CPENTA", "wedge", 6, None),
        (b"CPENTA", "wedge15", 15, [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11]),
        (b"CHEXA", "hexahedron", 8, None),
        (b"CHEXA", "hexahedron20", 20, [*range(12), 16, 17, 18, 19, 12, 13, 14, 15]),
        (b"CBAR", "line", 2, None),
        (b"CBEAM", "line", 2, None),
        (b"CROD", "line", 2, None),
    ],
)
def test_elements(card, cell_type, nodes, order):
    grids = b"".join(b"GRID,%d,,%d.,0.,0.\n" % (10 * i, i) for i in range(1, 21))
    numbers = [b"%d" % (10 * (i + 1)) for i in range(nodes)]
    rows = [[b"3", b"77", *numbers[:6]], *(numbers[i : i + 8] for i in range(6, nodes, 8))]
    text = b"".join(b",".join([b"" if i else card, *row]) + b"\n" for i, row in enumerate(rows))
    mesh = opened(grids + text).mesh
    assert cells_of(mesh) == [(cell_type, [order or list(range(nodes))])]
    assert mesh.cell_data["nastran:property"][0].tolist() == [77]


def test_nodes_that_other_cards_need_are_held():
    grids = b"".join(b"GRID,%d,,%d.,%d.,0.\n" % (i, i % 5, i // 5) for i in range(1, 21))
    cards = {
        b"CELAS1,9,1,4,1,6,1": {4, 6},
        b"CELAS2,9,100.,4,1": {4},
        b"CBUSH,9,1,4": {4},
        b"CONM2,9,12,,5.": {12},
        b"CONM2   9       12              5.": {12},
        b"RBE2,9,3,123,7,8,9,10,11,\n,12,13": {3, 7, 8, 9, 10, 11, 12, 13},
        b"RBE3,9,,3,123456,1.,123,7,8,\n,9": {3, 7, 8, 9},
        b"RBAR,9,3,7": {3, 7},
        b"MPC,9,3,1,1.,7,2,-1.,,\n,,8,1,1.": {3, 7, 8},
        b"CORD1R,9,3,7,8": {3, 7, 8},
        b"CBAR,9,1,3,7,15": {15},
        b"CBAR,9,1,3,7,0.,0.,1.": set(),
        b"SPOINT,500\nCELAS1,9,1,500,1,6,1": {6},
    }
    for card, nodes in cards.items():
        mesh = opened(grids + b"CTRIA3,1,1,1,2,6\n" + card + b"\n").mesh
        held = [block.vertices.ravel() + 1 for block in mesh.cells if block.type == "vertex"]
        assert set(np.concatenate([[], *held]).tolist()) == nodes, card
    assert cells_of(opened(grids + b"CTRIA3,1,1,1,2,6\nPLOTEL,5,3,4\nCONROD,6,4,5,1,2.\n").mesh)[1:] == [
        ("line", [[2, 3]]),
        ("line", [[3, 4]]),
    ]


@pytest.mark.parametrize("deck", [DECK, SMALL], ids=["deck", "small"])
def test_a_deck_cut_off_anywhere_is_refused(deck):
    """With BEGIN BULK, and without where the rest does not end with a whole card that could be the last."""
    whole = opened(deck).mesh
    begin, end = deck.index(b"BEGIN BULK\n") + 11, deck.index(b"ENDDATA")
    for cut in range(end + 6):
        with pytest.raises(InputError):
            opened(deck[:cut])
    bulk = deck[begin:end]
    kept = set()
    for cut in range(1, len(bulk)):
        try:
            mesh = opened(bulk[:cut]).mesh
        except InputError:
            continue
        assert bulk[:cut].endswith(b"\n")
        kept.add(sum(len(block.vertices) for block in mesh.cells if block.type != "vertex"))
        assert np.array_equal(mesh.points, whole.points[: len(mesh.points)])
    assert len(kept) > 1  # at the end of a line a card may be the last


@pytest.mark.parametrize(
    ("end", "words"),
    [
        (b"GRID,4,,1.,1.,0.,,,,+A\n", "line 5: the line asks for another one behind it"),
        (b"GRID,4,,1.,1.,\n", "line 5: the line asks for another one"),
        (b"GRID*,4,,1.,1.,*A\n", "line 5: the line asks for another one"),
        (b"GRID*   4%s1.%s1.%s*A\n" % (b" " * 31, b" " * 14, b" " * 14), "line 5: the line asks"),
        (b"GRID,4,,1.,1.,0", "it breaks off within its last line, and there is no ENDDATA"),
        (
            b"GRID*,4,,1.,1.\n*,0.\nGRID*,5,,1.,1.\n",
            "line 7: the last card has fewer lines than those like it",
        ),
    ],
)
def test_what_breaks_off_without_enddata_is_refused(end, words):
    with pytest.raises(InputError, match=words):
        opened(BODY + end)
    if end.endswith(b"\n"):
        assert len(opened(BODY + end + b"ENDDATA").mesh.points) > 3


def test_bulk_data_without_enddata_are_whole():
    assert len(opened(BODY).mesh.points) == 3
    assert opened(BODY.replace(b"\n", b"\r")).mesh.points.tolist() == opened(BODY).mesh.points.tolist()
    with pytest.raises(InputError, match="BEGIN BULK has no ENDDATA: truncated; if the deck is whole, add"):
        opened(b"BEGIN BULK\n" + BODY)
    assert len(opened(b"BEGIN BULK\n" + BODY + b"ENDDATA").mesh.points) == 3


def test_loads_and_constraints_hold_their_nodes():
    """A square of 4 by 4 nodes from 1 to 16, of which 6, 7, 10 and 11 lie within."""
    grids = [b"GRID,%d,,%d.,%d.,0." % (i, (i - 1) % 4, (i - 1) // 4) for i in range(1, 17)]
    quads = [b"CQUAD4,%d,1,%d,%d,%d,%d" % (i, i, i + 1, i + 5, i + 4) for i in range(1, 12) if i % 4]
    inner = {6, 7, 10, 11}
    cards = {
        b"FORCE,2,6,0,1.,0.,1.,0.": {6},
        b"FORCE   2       6       0       1.      0.      1.      0.": {6},
        b"FORCE*  2               6               0               1.\n*       0.": {6},
        b"force,2,2,0,1.,0.,1.,0.": {2},
        b"MOMENT,2,6,0,1.,0.,1.,0.\nMOMENT,2,7,0,1.,0.,1.,0.": {6, 7},
        b"FORCE1,2,6,1.,7,10": {6, 7, 10},
        b"FORCE2,2,6,1.,7,10,11,1": {6, 7, 10, 11, 1},
        b"SLOAD,2,6,1.,7,2.": {6, 7},
        b"DAREA,2,6,3,1.,7,3,2.": {6, 7},
        b"SUPORT,6,123,7,1": {6, 7},
        b"\n".join(b"FORCE,2,%d,0,1.,0.,0.,1." % i for i in range(1, 17)): set(),  # the weight of all
        b"SPC,1,6,123,0.": {6},
        b"SPC,1,6,123,0.,10,12,0.": {6, 10},
        b"SPC,1,1,123,0.,6,123,.1": {6},  # several: those within count
        b"SPC,1,1,123,0.,2,123,.0": set(),
        b"SPC1,1,123,1": {1},
        b"SPC1,1,123,1,2,6,7": {6, 7},
        b"SPC1,1,123,5,THRU,8": {6, 7},
        b"SPC1    1       123     5       thru    8": {6, 7},
        b"SPC1,1,123,1,2,3,4,5,6,\n,7,8": {6, 7},
        b"SPC1,1,3,1,THRU,16": set(),  # a plane problem
        b"SPC1,1,3,1,THRU,16\nSPC1,1,12,5,THRU,8": {6, 7},
        b"SPCD,1,6,1,.2,2,1,.2": {6},
        b"MPC,9,6,1,1.,7,2,-1.": {6, 7},
        b"RBE2,9,6,123,7,10": {6, 7, 10},
        b"CONM2,9,11,,5.": {11},
        b"PLOAD4,2,1,1.": set(),
        b"TEMP,2,6,300.": set(),
    }
    for card, nodes in cards.items():
        mesh = opened(b"\n".join([*grids, *quads, card, b""])).mesh
        held = [block.vertices.ravel() + 1 for block in mesh.cells if block.type == "vertex"]
        assert set(np.concatenate([[], *held]).tolist()) == nodes, card
        moving = np.flatnonzero(domain_of(mesh).interior) + 1
        assert set(moving.tolist()) == inner - nodes, card


@pytest.mark.parametrize("form", ["commas", "columns", "large"])
def test_nodes_held_by_their_own_card(form):
    grids = []
    for i in range(1, 17):
        x, y, held = (i - 1) % 4, (i - 1) // 4, {6: "123", 7: "345"}.get(i, "345" if i < 3 else "")
        if form == "commas":
            grids.append(f"GRID,{i},,{x}.,{y}.,0.,,{held}")
        elif form == "columns":
            grids.append(f"{'GRID':<8}{i:<8}{'':<8}{x}.{'':<6}{y}.{'':<6}0.{'':<14}{held}")
        else:
            grids.append(f"{'GRID*':<8}{i:<16}{'':<16}{x}.{'':<14}{y}.\n{'*':<8}0.{'':<30}{held}")
    quads = [f"CQUAD4,{i},1,{i},{i + 1},{i + 5},{i + 4}" for i in range(1, 12) if i % 4]
    mesh = opened("\n".join([*grids, *quads, ""]).encode()).mesh
    assert np.flatnonzero(domain_of(mesh).interior).tolist() == [9, 10]


def test_a_node_in_the_middle_of_an_edge_that_is_loaded_holds_its_ends():
    grids = b"GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,.5,0.,0.\n"
    grids += b"GRID,5,,.5,.5,0.\nGRID,6,,0.,.5,0.\nCTRIA6,1,1,1,2,3,4,5,6\n"
    mesh = opened(grids + b"FORCE,2,5,0,1.,0.,1.,0.\n").mesh
    assert cells_of(mesh)[1:] == [("vertex", [[1], [2]])]


BODY = b"GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nCTRIA3,1,1,1,2,3\n"


@pytest.mark.parametrize(
    ("deck", "words"),
    [
        (BODY.replace(b"2,,1.", b"2,4,1."), "line 2: node 2 is in coordinate system 4, only basic"),
        (
            BODY.replace(b"2,,1.", b"2,4,1.") + b"CORD2C,4,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n",
            "coordinate system 4 (CORD2C, cylindrical)",
        ),
        (
            BODY.replace(b"2,,1.", b"2,5,1.") + b"CORD1S,4,1,2,3,5,1,2,3\n",
            "coordinate system 5 (CORD1S, spherical)",
        ),
        (BODY + b"GRDSET,,6\n", "line 5: GRDSET puts vertices into coordinate system 6, only"),
        (BODY.replace(b"2,,1.", b"2,,x"), "line 2: 'x' is not a number"),
        (BODY.replace(b"2,,1.", b"2,,1.5-3-2"), "line 2: '1.5-3-2' is not a number"),
        (BODY.replace(b"2,,1.", b"2,,nan"), "line 2: 'nan' is not a number"),
        (BODY.replace(b"2,,1.", b"2,,1. 2."), "line 2: '1. 2.' is not a number"),
        (BODY.replace(b"2,,1.", b"2.5,,1."), "line 2: '2.5' is not a whole number"),
        (BODY.replace(b"GRID,3", b"GRID,2"), "line 3: node 2 is defined a second time"),
        (BODY.replace(b"GRID,3", b"GRID,-3"), "line 3: a GRID needs a positive number"),
        (BODY.replace(b"1,2,3\n", b"1,2,4\n"), "line 4: CTRIA3 names node 4, which no GRID defines"),
        (BODY.replace(b"1,2,3\n", b"1,2\n"), "line 4: CTRIA3 1 has too few nodes"),
        (BODY.replace(b"CTRIA3,1,1,1,2,3", b"CTRIA6,1,1,1,2,3,1"), "has only some of its mid nodes"),
        (b",1,2\n" + BODY, "line 1: it continues a card, but there is none"),
        (BODY + b"=,*1,=\n", "line 5: cards repeated by = are not supported"),
        (BODY + b"\x00\x01\n", "line 5: '\\x00\\x01' begins no card"),
        (BODY + b"GRID,9,,0.,0.,0.,,,,,,,\n", "line 5: too many fields"),
        (BODY[: BODY.index(b"CTRIA")], "no elements"),
        (b"CTRIA3,1,1,1,2,3\n", "no GRID cards"),
        (b"SOL 101\nCEND\n" + BODY, "no BEGIN BULK"),
        (b"BEGIN BULK\n" + BODY + b"BEGIN SUPER=2\n", "several bulk data sections"),
        (b"INCLUDE 'x.bdf'\n" + BODY, "cannot be piped"),
        (b"hello", "no elements"),
    ],
)
def test_refused_with_one_line_that_says_why(deck, words):
    with pytest.raises(InputError) as caught:
        opened(deck)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


CUT_GRIDS = [(1, 0.0, 0.0), (2, 1.0, 0.0), (3, 1.0, 1.0), (4, 0.0, 1.0)]


class TestIncludes:
    MAIN = (
        b"SOL 101\nCEND\nBEGIN BULK\nINCLUDE 'sub/grids.inc' $ nodes\n"
        b'include "props.inc"\nCTRIA3,1,1,1,2,3\nENDDATA\n'
    )
    GRIDS = BODY[: BODY.index(b"CTRIA")].rstrip()
    PROPS = b"PSHELL,1,1,.1\nMAT1,1,2.+5,,.3\n"

    def test_one_that_breaks_off_in_its_last_line_is_refused(self, deck):
        """Seen where that line, which has no end, is shorter than all others of its card."""
        columns = "".join(f"{'GRID':<8}{i:<16}{x:<8}{y:<8}0.375\n" for i, x, y in CUT_GRIDS)
        part = deck.parent / "sub" / "grids.inc"
        part.write_text(columns)
        assert len(open_mesh(deck).mesh.points) == 4
        part.write_text(columns.rstrip())
        assert len(open_mesh(deck).mesh.points) == 4
        part.write_text(columns.rstrip()[:-2])
        with pytest.raises(InputError, match=r"sub/grids\.inc breaks off within its last line"):
            open_mesh(deck)
        part.write_text(columns.rstrip()[:-2] + "\n")
        assert open_mesh(deck).mesh.points[3].tolist() == [0, 1, 0.3]

    @pytest.fixture
    def deck(self, tmp_path):
        folder = tmp_path / "model"
        (folder / "sub").mkdir(parents=True)
        (folder / "deck.bdf").write_bytes(self.MAIN)
        (folder / "sub" / "grids.inc").write_bytes(self.GRIDS)
        (folder / "props.inc").write_bytes(self.PROPS)
        return folder / "deck.bdf"

    def moved(self, source):
        return source.mesh.points + np.array([0.25, 0.5, 0.0])

    def test_are_followed(self, deck):
        source = open_mesh(deck)
        assert source.mesh.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        assert written(source, self.moved(source)) == self.MAIN
        assert source.unread == ["not kept: executive and case control, 1 material, 1 property"]

    def test_over_the_input_only_what_moves_is_written(self, deck):
        source = open_mesh(deck)
        output = Output(source, deck)
        stamp = (deck.parent / "props.inc").stat().st_mtime_ns
        output.stored(self.moved(source))
        output.write(self.moved(source))
        assert open_mesh(deck).mesh.points.tolist() == self.moved(source).tolist()
        assert deck.read_bytes() == self.MAIN
        assert (deck.parent / "sub" / "grids.inc").read_bytes() == self.GRIDS.replace(
            b"1,,0.,0.", b"1,,0.25,0.5"
        ).replace(b"2,,1.,0.", b"2,,1.25,0.5").replace(b"3,,0.,1.", b"3,,0.25,1.5")
        assert (deck.parent / "props.inc").stat().st_mtime_ns == stamp

    def test_go_along_into_another_directory(self, deck, tmp_path):
        source = open_mesh(deck)
        (tmp_path / "other" / "sub").mkdir(parents=True)
        out = tmp_path / "other" / "out.bdf"
        output = Output(source, out)
        output.stored(self.moved(source))
        output.write(self.moved(source))
        assert open_mesh(out).mesh.points.tolist() == self.moved(source).tolist()
        assert open_mesh(deck).mesh.points.tolist() == source.mesh.points.tolist()

    def test_the_input_is_never_changed_through_what_both_include(self, deck):
        source = open_mesh(deck)
        output = Output(source, deck.parent / "out.bdf")
        with pytest.raises(OutputError, match=r"coordinates are in sub/grids\.inc"):
            output.stored(self.moved(source))
        output.stored(source.mesh.points)

    def test_faults_name_file_and_line(self, deck):
        (deck.parent / "sub" / "grids.inc").write_bytes(self.GRIDS.replace(b"1.", b"x"))
        with pytest.raises(InputError, match=r"line 2 of sub/grids\.inc: 'x' is not a number"):
            open_mesh(deck)
        deck.write_bytes(self.MAIN.replace(b"1,2,3\n", b"1,2,9\n"))
        (deck.parent / "sub" / "grids.inc").write_bytes(self.GRIDS)
        with pytest.raises(InputError, match=r"deck\.bdf: line 6: CTRIA3 names node 9"):
            open_mesh(deck)
        (deck.parent / "props.inc").unlink()
        with pytest.raises(InputError, match=r"props\.inc is missing"):
            open_mesh(deck)
        (deck.parent / "props.inc").write_bytes(b"INCLUDE 'props.inc'\n")
        with pytest.raises(InputError, match="includes itself"):
            open_mesh(deck)


class TestConversion:
    @pytest.mark.parametrize("order", [1, 2])
    @pytest.mark.parametrize("hexahedra", [False, True])
    def test_cells_and_coordinates_are_kept(self, gmsh_decks, hexahedra, order, tmp_path):
        own = gmsh_decks[hexahedra, order, 0][1]
        source = convert(own, ["its drawing is not kept"])
        points = own.points + np.array([1 / 3, 2 / 3, 0.5])
        stored = source.stored(points)
        assert source.notes[0] == "its drawing is not kept"
        assert np.abs(stored - points).max() < 1e-14
        out = written(source, points)
        mesh = opened(out).mesh
        assert np.array_equal(mesh.points, stored)
        theirs = [block for block in own.cells if block.type not in ("vertex", "line3")]
        assert {name for name, _ in cells_of(mesh)} == {block.type for block in theirs}
        for block in mesh.cells:
            same = np.concatenate([other.vertices for other in theirs if other.type == block.type])
            assert block.vertices.tolist() == same.tolist()
        tags, by_gmsh = read_by_gmsh(out, tmp_path)
        assert np.abs(by_gmsh - stored[np.array(tags) - 1]).max() < 1e-15
        assert len(tags) == len(stored)

    def test_regions_become_properties(self):
        points = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
        cells = [Cells("triangle", np.array([[0, 1, 2], [0, 2, 3]])), Cells("vertex", np.array([[3]]))]
        mesh = Mesh(points, cells, {"medit:ref": [np.array([7, 9]), np.array([1])]}, {"h": np.zeros(4)})
        source = convert(mesh, [])
        assert source.stored(points).tolist() == points.tolist()
        assert source.notes == [
            "the cell field medit:ref is kept as nastran:property",
            "not kept: 1 cell of type vertex or line3",
            "not kept: 1 point field (h)",
        ]
        back = opened(written(source, points)).mesh
        assert back.cell_data["nastran:property"][0].tolist() == [7, 9]
        mesh.cell_data = {"medit:ref": [np.array([0, -5]), np.array([0])]}
        source = convert(mesh, [])
        back = opened(written(source, points)).mesh
        assert len(set(back.cell_data["nastran:property"][0].tolist())) == 2

    def test_what_has_no_element_is_refused(self):
        mesh = Mesh(np.zeros((27, 3)), [Cells("hexahedron27", np.arange(27)[None])])
        with pytest.raises(OutputError, match="no elements for cells of type hexahedron27"):
            convert(mesh, [])


@pytest.mark.parametrize("width", [8, 16])
def test_fields_hold_as_much_as_fits(width):
    rng = np.random.default_rng(width)
    values = rng.normal(size=400) * 10.0 ** rng.integers(-12, 12, 400)
    values = [*values.tolist(), 0.0, 1.0, -1.0, 0.999999999999, 9999999.7, -999999.96, 1e-3, 1e22, 123456.0]
    for value in values:
        text = field_text(value, width)
        best = fitted(value, width, "")
        assert len(text) <= width
        assert "." in text
        assert abs(value_of(text) - value) <= abs(value_of(best.decode()) - value)


def test_the_interface_of_two_properties_stays():
    rows = [(x, y) for y in range(3) for x in range(5)]
    grids = b"".join(b"GRID,%d,,%d.,%d.,0.\n" % (i + 1, x, y) for i, (x, y) in enumerate(rows))
    quads = [i for i, (x, y) in enumerate(rows) if x < 4 and y < 2]
    cells = b"".join(
        b"CQUAD4,%d,%d,%d,%d,%d,%d\n" % (i + 1, 1 + i % 5 // 2, i + 1, i + 2, i + 7, i + 6) for i in quads
    )
    assert np.flatnonzero(domain_of(opened(grids + cells).mesh).interior).tolist() == [6, 8]


def test_elements_without_a_property_have_none_unless_one_has_their_number():
    """meshio leaves the field blank: then the number of the element stands for a property, if it is there."""
    text = BODY + b"CTRIA3,7,,1,2,3\nCTRIA3,8,,1,2,3\n"
    tags = opened(text.replace(b"CTRIA3,1,1,", b"CTRIA3,1,,")).mesh.cell_data["nastran:property"]
    assert tags[0].tolist() == [0, 0, 0]
    tags = opened(text + b"PSHELL,7,1,.1\nPARAM,8\n").mesh.cell_data["nastran:property"]
    assert tags[0].tolist() == [1, 7, 0]
    tags = opened(text + b"PSOLID         8       1\n").mesh.cell_data["nastran:property"]
    assert tags[0].tolist() == [1, 0, 8]


def test_a_deck_of_meshio_is_one_region(tmp_path):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.4, 0.3, 0]])
    cells = [("triangle", [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])]
    meshio.write(tmp_path / "in.bdf", meshio.Mesh(points, cells), file_format="nastran")
    domain = domain_of(open_mesh(tmp_path / "in.bdf").mesh)
    assert np.flatnonzero(domain.interior).tolist() == [4]


def test_content_tells_it_from_tecplot():
    assert format_of(Path("x.dat"), DECK).name == format_of(Path("x.dat"), SMALL).name == "nastran"
    assert format_of(Path("x.dat"), BODY).name == format_of(Path("-"), DECK).name == "nastran"
    assert format_of(Path("x.dat"), b'TITLE = "x"\nVARIABLES = "X"\n').name == "tecplot"
    assert format_of(Path("x.dat"), b"what\n").name == "tecplot"


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_decks_raise_input_errors_only(count):
    corpus = [DECK, SMALL, BODY.replace(b",", b"\t")]
    messages, read_well = [], 0
    for deck in mutated(corpus, count, seed=29):
        try:
            source = opened(deck)
        except DvrError as error:
            messages.append(str(error))
            continue
        read_well += 1
        mesh = source.mesh
        assert written(source, mesh.points.copy()) == deck
        if not np.isfinite(mesh.points).all() or np.abs(mesh.points).max() > 1e30:
            continue
        points = mesh.points + 1 / 3
        for writer in filter(None, (source, source.widened())):
            again = opened(written(writer, points)).mesh
            assert np.array_equal(again.points, writer.stored(points))
            assert cells_of(again) == cells_of(mesh)
    assert read_well > 0.05 * count
    assert len(messages) > count // 4
    assert all(len(message) < 300 and message.isprintable() for message in messages)
