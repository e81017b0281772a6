"""Abaqus decks: read as they are meant, and written back with other coordinates and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from abaqus_corpus import BOX, DECKS, FLAT, PARTS, TWO_MATERIALS
from dvr_cli.cli.main import main
from dvr_cli.errors import DvrError, InputError, OutputError
from dvr_cli.files.abaqus import convert, read
from dvr_cli.files.abaqus.types import FACES, element_type
from dvr_cli.files.formats import format_of
from dvr_cli.files.reading import open_mesh
from dvr_cli.files.source import InputFile, Source, differing
from dvr_cli.files.writing import Output
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells, Mesh
from fuzz import COUNTS, mutated
from sources import written


def opened(text: str | bytes, path: Path | None = None) -> Source:
    return read(InputFile(text if isinstance(text, bytes) else text.encode(), path))


def nodes_of(text: bytes) -> list[list[tuple[int, float, float, float]]]:
    """The nodes in each *NODE card, read line by line as CalculiX does: 20 characters of each number."""
    cards: list[list[tuple[int, float, float, float]]] = []
    inside = False
    for line in text.decode("latin-1").replace("\r", "\n").splitlines():
        line = line.replace(" ", "").upper()
        if not line or line.startswith("**"):
            continue
        if line.startswith("*"):
            inside = line.split(",")[0] == "*NODE"
            cards += [[]] if inside else []
        elif inside:
            words = [word[:20].replace("D", "E") for word in [*line.split(","), "", "", ""][:4]]
            numbers = [re.sub(r"(?<=[\d.])([+-])", r"E\1", word) for word in words[1:]]
            cards[-1].append((int(words[0]), *(float(number or 0) for number in numbers)))
    return cards


@pytest.mark.parametrize("name", DECKS)
def test_unmoved_comes_back_byte_for_byte(name):
    source = opened(DECKS[name])
    assert written(source, source.mesh.points) == DECKS[name]
    assert np.array_equal(source.stored(source.mesh.points), source.mesh.points)


@pytest.mark.parametrize("name", DECKS)
def test_moved_differs_in_coordinates_only(name):
    data = DECKS[name]
    source = opened(data)
    rng = np.random.default_rng(3)
    points = source.mesh.points + rng.normal(size=source.mesh.points.shape) * 1e-3
    out = written(source, points)
    old, new = nodes_of(data), nodes_of(out)
    assert [[row[0] for row in card] for card in old] == [[row[0] for row in card] for card in new]
    # whatever is no *NODE card stays byte for byte
    card = re.compile(rb"(\*node\b(?!\s*print)[^\r\n]*)[\r\n][^*]*(\*\*[^\r\n]*[^*]*)*", re.IGNORECASE)
    assert card.sub(rb"\1", out) == card.sub(rb"\1", data)
    stored = source.stored(points)
    xyz = np.array([row[1:] for rows in new for row in rows])
    assert np.array_equal(xyz[:, : points.shape[1]], stored)
    assert np.abs(stored - points).max() < 1e-15
    again = opened(out)
    assert np.array_equal(again.mesh.points, stored)
    for a, b in zip(source.mesh.cells, again.mesh.cells, strict=True):
        assert (a.type, a.vertices.tolist()) == (b.type, b.vertices.tolist())


def test_one_vertex_that_moves_changes_its_line_only():
    source = opened(FLAT)
    points = source.mesh.points.copy()
    points[4, :2] = 1.0, 1.0
    assert written(source, points).decode() == FLAT.replace("900, 1.6, 1.5, 0.", "900, 1.0, 1.0, 0.")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.1, "0.1"),
        (-1.2345678901234567, "-1.2345678901234567"),
        (1e22, "1.e22"),
        (-0.00012345678901234567, "-.000123456789012346"),
    ],
)
def test_numbers_take_20_columns_at_most(value, text):
    """CalculiX reads the first 20 characters of a number, Abaqus as many."""
    source = opened(FLAT)
    points = source.mesh.points.copy()
    points[4, 0] = value
    line = written(source, points).decode().splitlines()[7]
    assert len(line.split(",")[1].strip()) <= 20
    assert abs(float(line.split(",")[1]) - value) <= abs(float(text) - value)
    assert source.stored(points)[4, 0] == float(line.split(",")[1])


def test_every_way_to_write_nodes_and_elements():
    mesh = opened(BOX).mesh
    assert mesh.points.tolist() == [
        [-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1], [0.2, 0.1, 0.15],
    ]  # fmt: skip
    assert mesh.cells[0].type == "tetra"
    assert mesh.cells[0].vertices[[0, 1, 7]].tolist() == [[0, 2, 4, 6], [2, 1, 4, 6], [0, 3, 5, 6]]
    assert mesh.point_sets["All Nodes"].tolist() == list(range(7))
    assert mesh.point_sets["Ends"].tolist() == [0, 4]
    assert [part.tolist() for part in mesh.cell_sets["Both"]] == [[0, 1, 2, 4, 6]]
    assert mesh.facet_sets["Skin"].tolist() == [[0, 2, 4], [1, 3, 4], [2, 0, 5], [3, 1, 5]]
    assert mesh.cell_data["abaqus:section"][0].tolist() == [1] * 8


def test_what_is_missing_is_put_in_where_it_belongs():
    source = opened(BOX)
    points = source.mesh.points.copy()
    points[2] = 0.25, -1, 0.5
    points[3, 2] = 0.5
    points[4, 1] = 0.125
    points[1, 2] = 2.0
    lines = written(source, points).decode().splitlines()
    assert lines[5:9] == [" 2,  1, 0.,2.0", " 3,0.25, -1., 0.5", " 4, 0, 1, 0.5", " 5, 0, 0.125, -1.0d+0"]


def test_a_plane_deck_without_third_coordinates():
    text = FLAT.replace(", 0.\n", "\n")
    source = opened(text)
    assert source.mesh.points.shape == (5, 2)
    points = source.mesh.points.copy()
    points[4] = 1.0, 1.25
    assert written(source, points).decode() == text.replace("900, 1.6, 1.5", "900, 1.0, 1.25")


def test_parts_have_nodes_of_their_own():
    mesh = opened(PARTS).mesh
    assert mesh.points[[4, 9, 14]].tolist() == [[0.7, 0.6], [6.4, 1.2], [20.2, 0.2]]
    assert [(block.type, len(block.vertices)) for block in mesh.cells] == [("triangle", 12), ("vertex", 2)]
    assert mesh.cells[0].vertices[[0, 4, 8]].tolist() == [[0, 1, 4], [5, 6, 9], [10, 11, 14]]
    assert mesh.cells[1].vertices.ravel().tolist() == [1, 10]  # what the spring joins
    assert mesh.cell_data["abaqus:part"][0].tolist() == [1] * 4 + [2] * 4 + [3] * 4
    sets = {name: vertices.tolist() for name, vertices in mesh.point_sets.items()}
    assert sets == {"Left.Fixed": [0, 3], "Right.Fixed": [6], "Corners": [0, 2, 6], "Named": [0, 1, 3, 9]}
    assert [part.tolist() for part in mesh.cell_sets["Some"]] == [[9, 10, 11], []]


TYPES = """
tetra: C3D4 C3D4H C3D4T DC3D4 DC3D4E AC3D4 FC3D4 Q3D4 EMC3D4
hexahedron: C3D8 C3D8R C3D8I C3D8IH C3D8PT DC3D8 F3D8 SC8R CSS8
tetra10: C3D10 C3D10T C3D10M C3D10HS C3D10MPT DC3D10 AC3D10
hexahedron20: C3D20 C3D20R C3D20RI C3D20RHT DC3D20 AC3D20
wedge: C3D6 DC3D6 SC6R AC3D6
wedge15: C3D15 C3D15H DC3D15
pyramid: C3D5
triangle: CPS3 CPE3 CAX3 CPEG3 S3 S3R S3RS STRI3 M3D3 R3D3 DC2D3 DS3
quad: CPS4 CPE4R CAX4P S4 S4R S4R5 S4RSW M3D4R SFM3D4 AC2D4 DCAX4
triangle6: CPS6 CPE6M CAX6 S6 STRI65 M3D6 DC2D6
quad8: CPS8R CPE8RH CAX8 S8 S8R S8R5 M3D8R
quad9: M3D9R S9R5
line: T3D2
line3: T3D3
none: B31 B32 MASS SPRINGA CONN3D2 U1 COH3D8 CIN3D8 CAXA8R1 D F3D4 GAPUNI
"""


@pytest.mark.parametrize("line", TYPES.split("\n")[1:-1])
def test_element_types(line):
    cell, names = line.split(": ")
    for name in names.split():
        known = element_type(name)
        assert (known.cell if known else "none") == cell


def test_faces_are_those_of_the_cells():
    """Abaqus numbers faces in its own order and starts each where it likes."""
    assert FACES.keys() == {name for name, known in CELL_TYPES.items() if known.facets}
    for name, faces in FACES.items():
        assert {frozenset(face) for face in faces} == {frozenset(facet) for facet in CELL_TYPES[name].facets}
        assert len(faces) == len(CELL_TYPES[name].facets)


@pytest.mark.parametrize(
    "cards",
    [
        "*ELEMENT, TYPE=MASS, ELSET=S\n9001, 900\n",
        "*ELEMENT, TYPE=B31, ELSET=S\n9001, 100, 900, 110\n",
        "*BOUNDARY\n900, 1, 2\n",
        "*NSET, NSET=MID\n900, 100\n*BOUNDARY\nMID, 1, 2\n",
        "*NSET, NSET=MID\n900, 100\n*CLOAD\nMID, 1, 2.\n",
        "*EQUATION\n2\n100, 1, 1., 900, 1, -1.\n",
        "*MPC\nBEAM, 900, 100\n",
        "*RIGID BODY, NSET=MID, REF NODE=900\n",
        "*SURFACE, NAME=INNER\n5001, S2\n*COUPLING, REF NODE=100, SURFACE=INNER\n*KINEMATIC\n1, 2\n",
    ],
)
def test_what_is_tied_to_a_vertex_holds_it(cards):
    mesh = opened(FLAT.replace("*STEP", cards + "*STEP")).mesh
    assert mesh.cells[-1].type == "vertex"
    assert 4 in mesh.cells[-1].vertices
    free = opened(FLAT).mesh
    assert [block.type for block in free.cells] == ["triangle"]


def test_a_condition_for_all_vertices_holds_none():
    cards = "*BOUNDARY\nNALL, 3\n*CLOAD\nNALL, 1, 1.\n"
    mesh = opened(FLAT.replace("*STEP", cards + "*STEP")).mesh
    assert [block.type for block in mesh.cells] == ["triangle"]


def test_an_element_that_names_a_node_twice_is_held():
    text = FLAT.replace("*NSET, NSET=LEFT", "*ELEMENT, TYPE=CPS4\n7, 100, 110, 900, 900\n*NSET, NSET=LEFT")
    source = opened(text)
    assert source.mesh.cells[-1].vertices.ravel().tolist() == [0, 1, 4]
    assert "1 elements collapsed quad" in source.unread[-1]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("*NODE, NSET=NALL", "*NODE, SYSTEM=C", r"line 3: \*NODE in cylindrical coordinates \(SYSTEM=C\)"),
        ("*NODE, NSET=NALL", "*NODE, SYSTEM=s", r"line 3: \*NODE in spherical coordinates"),
        ("*NODE, NSET=NALL", "*SYSTEM\n1., 0., 0.\n*NODE", r"line 5: \*NODE in a local system"),
        ("*NSET, NSET=LEFT", "*NGEN\n100, 110\n*NSET, NSET=LEFT", r"line 14: \*NGEN: generated nodes"),
        ("*NSET, NSET=LEFT", "*ELGEN\n5001, 2\n*NSET, NSET=LEFT", r"\*ELGEN: generated elements"),
        ("*NSET, NSET=LEFT", "*NCOPY\n*NSET, NSET=LEFT", r"\*NCOPY: copied nodes"),
        ("900, 1.6, 1.5, 0.", "900, 1.6, x, 0.", r"line 8: 'x' is no number"),
        ("900, 1.6, 1.5, 0.", "900, 1.6 1.5, 0.", r"line 8: '1.6 1.5' is no number"),
        ("900, 1.6, 1.5, 0.", "9.5, 1.6, 1.5, 0.", r"line 8: a node number is expected first"),
        ("900, 1.6, 1.5, 0.", "100, 1.6, 1.5, 0.", r"node 100 is defined twice, at different places"),
        ("900, 1.6, 1.5, 0.", "901, 1.6, 1.5, 0.", r"element 5001 names node 900, which is not defined"),
        ("5002, 110,", "5001, 110,", r"element 5001 is defined twice"),
        ("5002, 110, 120, 900", "5002, 110, 120", r"line 11: an element CPS3 has 3 nodes"),
        ("5002, 110, 120, 900", "5002, 110, 120, 900, 1", r"line 11: an element CPS3 has 3 nodes"),
        ("5002, 110, 120, 900", "5002 110 120 900", r"line 11: numbers have to be separated by one comma"),
        ("5002, 110, 120, 900", "5002, 110, 12.5, 900", r"line 11: '12.5' is no whole number"),
        ("TYPE=CPS3", "TYPE=MASS", r"no element is a solid, a plane one, a shell .* only MASS"),
        ("TYPE=CPS3,", "", r"line 9: \*ELEMENT does not say its TYPE"),
        ("*HEADING", "nothing\n*HEADING", r"line 1: no keyword"),
        ("*HEADING", "*INCLUDE, INPUT=a.inp\n*HEADING", r"a mesh in several files cannot be piped: a.inp"),
        ("*HEADING", "*INCLUDE\n*HEADING", r"line 1: \*INCLUDE names no file"),
        ("*HEADING\n", "*KEYWORD\n*HEADING\n", r"LS-DYNA"),
    ],
)
def test_message_names_what_is_wrong(old, new, message):
    assert FLAT.count(old) == 1
    with pytest.raises(InputError, match=message) as caught:
        opened(FLAT.replace(old, new))
    assert "\n" not in str(caught.value)


def test_a_last_row_that_breaks_off_is_refused(tmp_path):
    """Seen where it has no line end and is shorter than all others, in the deck or in what it includes."""
    nodes = "*NODE\n" + "".join(
        f"{i}, {x}, {y}\n" for i, x, y in [(1, 0, 0), (2, 1, 0), (3, 1, 1), (4, 0, 1)]
    )
    rows = "12, .5, .5\n*ELEMENT, TYPE=CPS3\n1, 1, 2, 12\n2, 2, 3, 12\n3, 3, 4, 12\n4, 4, 1, 12"
    for whole in (nodes + rows, nodes + rows + "\n", nodes + rows[:-1] + "\n"):
        opened(whole)
    message = r"line 11: it breaks off within a row of \*ELEMENT, which is shorter .* end that line"
    with pytest.raises(InputError, match=message):
        opened((nodes + rows)[:-1])
    (tmp_path / "rows.inc").write_text(rows[:-1])
    (tmp_path / "deck.inp").write_text(f"{nodes}*INCLUDE, INPUT=rows.inc\n*STEP\n*END STEP\n")
    with pytest.raises(InputError, match=r"rows\.inc, line 6: it breaks off"):
        open_mesh(tmp_path / "deck.inp")


def test_nodes_given_twice_at_one_place_move_together():
    text = FLAT.replace("*ELEMENT", "*NODE, NSET=AGAIN\n900, 1.60, 1.5\n*ELEMENT", 1)
    source = opened(text)
    assert len(source.mesh.points) == 5
    points = source.mesh.points.copy()
    points[4, 0] = 1.25
    expected = text.replace("900, 1.6, ", "900, 1.25, ").replace("900, 1.60,", "900, 1.25,")
    assert written(source, points).decode() == expected


# Decks in several files.


@pytest.fixture
def included(tmp_path):
    """A deck whose nodes and steps are in files of their own."""
    head, rest = FLAT.split("*ELEMENT", 1)
    heading, nodes = head.split("*NODE", 1)
    mesh, step = rest.split("*STEP", 1)
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "Nodes.inp").write_text("*NODE" + nodes.rstrip("\n"))
    (tmp_path / "step.inp").write_text("*STEP" + step)
    main = heading + '*include, input="parts/Nodes.inp"\n*ELEMENT' + mesh + "*INCLUDE, INPUT=step.inp\n"
    (tmp_path / "main.inp").write_text(main)
    return tmp_path


def moved(source: Source) -> np.ndarray:
    points = source.mesh.points.copy()
    points[4, :2] = 1.0, 1.25
    return points


MOVED = FLAT.replace("900, 1.6, 1.5, 0.", "900, 1.0, 1.25, 0.")


def test_in_place_the_included_file_changes(included):
    before = {path: path.read_bytes() for path in included.rglob("*.inp")}
    source = open_mesh(included / "main.inp")
    output = Output(source, included / "main.inp")
    output.write(moved(source))
    assert output.notes == ["parts/Nodes.inp, which the deck includes: changed, too"]
    after = {path: path.read_bytes() for path in included.rglob("*.inp")}
    changed = [path for path in before if after[path] != before[path]]
    assert changed == [included / "parts" / "Nodes.inp"]
    assert after[changed[0]] == before[changed[0]].replace(b"900, 1.6, 1.5,", b"900, 1.0, 1.25,")


@pytest.mark.parametrize("place", ["beside", "elsewhere"])
def test_another_output_has_within_it_what_changes(included, tmp_path_factory, place):
    folder = included if place == "beside" else tmp_path_factory.mktemp("elsewhere")
    before = {path: path.read_bytes() for path in included.rglob("*.inp")}
    source = open_mesh(included / "main.inp")
    output = Output(source, folder / "out.inp")
    output.write(moved(source))
    assert {path: path.read_bytes() for path in before} == before
    text = (folder / "out.inp").read_text()
    if place == "beside":
        assert text == MOVED.split("*STEP")[0] + "*INCLUDE, INPUT=step.inp\n"
        assert output.notes == ["parts/Nodes.inp, which the deck includes: within the output now"]
    else:
        assert text == MOVED
    assert np.array_equal(open_mesh(folder / "out.inp").mesh.points, moved(source))


def test_unmoved_the_deck_still_includes(included):
    source = open_mesh(included / "main.inp")
    Output(source, included / "out.inp").write(source.mesh.points)
    assert (included / "out.inp").read_bytes() == (included / "main.inp").read_bytes()


def test_data_lines_in_another_file(tmp_path):
    head, rest = FLAT.split("*ELEMENT", 1)
    heading, nodes = head.split("*NODE, NSET=NALL\n")
    (tmp_path / "nodes.txt").write_text(nodes)
    main = heading + "*NODE, NSET=NALL, INPUT=nodes.txt\n*ELEMENT" + rest
    (tmp_path / "main.inp").write_text(main)
    source = open_mesh(tmp_path / "main.inp")
    assert source.mesh.point_sets["NALL"].tolist() == [0, 1, 2, 3, 4]
    Output(source, tmp_path / "out.inp").write(moved(source))
    assert (tmp_path / "out.inp").read_text() == MOVED
    assert (tmp_path / "nodes.txt").read_text() == nodes


@pytest.mark.parametrize("name", ["missing.inp", "main.inp"])
def test_files_that_are_not_there_or_include_themselves(included, name):
    path = included / "main.inp"
    path.write_text(path.read_text().replace("step.inp", name))
    with pytest.raises(InputError, match=r"main.inp: (its other .*missing.inp|files include one another)"):
        open_mesh(path)


# Other formats.


def test_first_bytes_tell_a_deck_from_other_formats():
    assert format_of(Path("-"), DECKS["flat"]).name == "abaqus"
    assert format_of(Path("-"), DECKS["box"]).name == "abaqus"
    assert format_of(Path("-"), DECKS["byte order mark"]).name == "abaqus"


@pytest.mark.parametrize(
    "sections", ["", "*SOLID SECTION, ELSET=STEEL, MATERIAL=S\n*SOLID SECTION, ELSET=BRASS, MATERIAL=B\n"]
)
def test_interfaces_between_sections_and_sets_stay(tmp_path, sections):
    path = tmp_path / "two.inp"
    path.write_text(TWO_MATERIALS + sections)
    status = main(["smooth", str(path), str(tmp_path / "out.inp"), "--quiet"])
    assert status == 0
    before, after = open_mesh(path).mesh, open_mesh(tmp_path / "out.inp").mesh
    moved_ones = np.flatnonzero(differing(after.points, before.points).any(axis=1)).tolist()
    assert moved_ones == [9, 10]


def test_conversion_keeps_groups_and_names_what_it_cannot(tmp_path):
    triangles = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.3, 1 / 3]])
    mesh = Mesh(
        points,
        [Cells("triangle", triangles), Cells("line", np.array([[0, 1]]))],
        cell_data={"gmsh:physical": [np.array([7, 7, 8, 8]), np.array([3])]},
        field_data={"left half": np.array([7, 2]), "base": np.array([3, 1])},
        point_data={"T": np.zeros(5)},
    )
    target = convert(mesh, ["2 loads"])
    again = opened(written(target, points)).mesh
    assert np.array_equal(again.points, target.stored(points))
    assert again.cells[0].vertices.tolist() == triangles.tolist()
    assert [part.tolist() for part in again.cell_sets["left_half"]] == [[0, 1]]
    assert again.point_sets["base"].tolist() == [0, 1]
    assert target.notes[0] == "2 loads"
    assert "not kept: 1 point field (T)" in target.notes
    assert any(note.startswith("1 line cell:") for note in target.notes)
    with pytest.raises(OutputError, match="polygon"):
        convert(Mesh(points, [Cells("polygon5", np.array([[0, 1, 2, 3, 4]]))]), [])


@pytest.mark.parametrize(
    ("kind", "front"), [("PART", ""), ("PART", "*PART, NAME=A\n{}*END PART\n"), ("ASSEMBLY", "")]
)
def test_decks_that_break_off_in_a_part_are_refused(kind, front):
    mesh = "*NODE\n1, 0., 0.\n2, 1., 0.\n3, 1., 1.\n*ELEMENT, TYPE=CPS3\n1, 1, 2, 3\n"
    text = f"{front.format(mesh)}*{kind}, NAME=B\n{mesh}"
    line = front.format(mesh).count("\n") + 1
    with pytest.raises(InputError, match=rf"^line {line}: \*{kind} has no \*END {kind}: truncated$"):
        opened(text.encode())
    assert len(opened(f"{text}*End {kind.lower()}\n".encode()).mesh.points) == 3 * text.count("*NODE")


@pytest.mark.parametrize("count", COUNTS)
def test_damaged_decks_are_read_or_refused_in_one_line(count):
    read_again = 0
    for data in mutated(list(DECKS.values()), count, 7):
        message, source = outcome(data)
        if source is None:
            assert message.isprintable()  # one line, that is
            continue
        points = np.where(np.isfinite(source.mesh.points), source.mesh.points, 0.0) + 0.25
        again = opened(written(source, points)).mesh
        assert np.array_equal(again.points, source.stored(points))
        for a, b in zip(source.mesh.cells, again.cells, strict=True):
            assert (a.type, a.vertices.tolist()) == (b.type, b.vertices.tolist())
        read_again += 1
    assert 0 < read_again < count


def outcome(data: bytes) -> tuple[str, Source | None]:
    """The message, or what was read."""
    try:
        return "", opened(data)
    except DvrError as error:
        return str(error), None
