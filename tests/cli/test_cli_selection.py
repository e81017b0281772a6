"""Selecting what relaxes on the command line: groups as Gmsh itself finds them, lists, qualities."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

from cli_support import CORNERS, FAN, assert_one_line, fan, listing, points_of, read_json, write
from dvr_cli.files.reading import open_mesh
from gmsh_session import gmsh_session
from meshes import random_mesh

SAMPLES = Path(__file__).parents[2] / "sample_meshes"
VARIANTS = [(2.2, 0), (4.1, 1), *(pytest.param(*v, marks=pytest.mark.long) for v in ((2.2, 1), (4.1, 0)))]
SWEEPS = ["-n", "3", "-q"]


def two_halves(path: Path, version: float, binary: int, periodic: bool = False) -> dict[str, np.ndarray]:
    """A rectangle of two squares, 11 "left" and 12 "right", 5 "rim" around both; returns the coordinates of
    the nodes of each group by name and by tag, and of those that are tied to others, as Gmsh tells."""
    with gmsh_session() as gmsh:
        left, right = (gmsh.model.occ.addRectangle(x, 0, 0, 1, 1) for x in (0, 1))
        gmsh.model.occ.fragment([(2, left)], [(2, right)])
        gmsh.model.occ.synchronize()
        rim = [tag for _, tag in gmsh.model.getBoundary([(2, left), (2, right)], oriented=False)]
        if periodic:
            x = {tag: gmsh.model.occ.getCenterOfMass(1, tag)[0] for tag in rim}
            move = [1, 0, 0, 2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
            gmsh.model.mesh.setPeriodic(1, [max(x, key=x.get)], [min(x, key=x.get)], move)
        groups = {"left": (2, 11, [left]), "right": (2, 12, [right]), "rim": (1, 5, rim)}
        for name, (dimension, tag, entities) in groups.items():
            gmsh.model.addPhysicalGroup(dimension, entities, tag, name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.16)
        gmsh.option.setNumber("Mesh.RandomFactor", 0.1)
        gmsh.model.mesh.generate(2)
        found = {}
        for name, (dimension, tag, _) in groups.items():
            nodes = gmsh.model.mesh.getNodesForPhysicalGroup(dimension, tag)[1].reshape(-1, 3)
            found[name] = found[str(tag)] = nodes
        tied = [gmsh.model.mesh.getPeriodicNodes(1, tag)[1:3] for tag in rim] if periodic else []
        tags = np.unique(np.concatenate([np.empty(0), *(np.concatenate(pair) for pair in tied)]))
        found["tied"] = np.array([gmsh.model.mesh.getNode(int(tag))[0] for tag in tags])
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(path))
    return found


def inside(points: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Which of the points are among some others; Gmsh writes no more than 16 digits as text."""
    rows = {tuple(row) for row in some.round(9).tolist()}
    return np.array([tuple(row) in rows for row in points.round(9).tolist()])


def moved(source: Path, output: Path) -> np.ndarray:
    """Which vertices differ in any bit."""
    before, after = open_mesh(source).mesh.points, open_mesh(output).mesh.points
    return (before.view(np.int64) != after.view(np.int64)).any(axis=1)


@pytest.mark.parametrize(
    ("version", "binary"),
    [(2.2, 0), (4.1, 1), *(pytest.param(*v, marks=pytest.mark.long) for v in ((2.2, 1), (4.1, 0)))],
)
def test_physical_groups_of_gmsh_by_name_and_by_tag(dvr, tmp_path, version, binary):
    source, output = tmp_path / "in.msh", tmp_path / "out.msh"
    groups = two_halves(source, version, binary)
    points = open_mesh(source).mesh.points
    everything = moved_by(dvr, source, output, [])
    for by in (("left", "right", "rim"), ("11", "12", "5")):
        left, right, rim = (inside(points, groups[name]) for name in by)
        assert left.sum() == len(groups["left"])
        assert not (everything & (rim | (left & right))).any()
        fixed = moved_by(dvr, source, output, ["--fix", by[0]])
        assert np.array_equal(fixed, everything & ~left)
        only = moved_by(dvr, source, output, ["--only", by[0]])
        assert np.array_equal(only, everything & left)
        both = moved_by(dvr, source, output, ["--only", by[0], "--only", by[1]])
        assert np.array_equal(both, everything)
        assert not moved_by(dvr, source, output, ["--only", by[0], "--only", by[2], "--fix", by[0]]).any()
        assert left.any()
        assert right.any()


def moved_by(dvr, source, output, options):
    result = dvr("smooth", source, output, *SWEEPS, *options)
    assert (result.code, result.err) == (0, "")
    return moved(source, output)


def test_text_outside_the_selection_stays_as_it_is(dvr, tmp_path):
    """Line by line: nodes of a Gmsh file written as text, those that stay with all their digits."""
    source, output = tmp_path / "in.msh", tmp_path / "out.msh"
    groups = two_halves(source, 4.1, 0)
    assert dvr("smooth", source, output, *SWEEPS, "--only", "left").code == 0
    before, after = (path.read_text().splitlines() for path in (source, output))
    assert len(before) == len(after)
    changed = [line for line, other in zip(before, after, strict=True) if line != other]
    assert changed
    at = inside(np.array([[float(x) for x in line.split()] for line in changed]), groups["left"])
    assert at.all()


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("boundary", ["fixed", "slide"])
def test_periodic_vertices_stay_whatever_the_boundary_may_do(dvr, tmp_path, version, boundary):
    source, output = tmp_path / "in.msh", tmp_path / "out.msh"
    groups = two_halves(source, version, 1, periodic=True)
    points = open_mesh(source).mesh.points
    tied, rim = inside(points, groups["tied"]), inside(points, groups["rim"])
    assert tied.sum() == len(groups["tied"]) > 8
    now = moved_by(dvr, source, output, ["--boundary", boundary])
    assert not now[tied].any()
    assert now[rim].any() == (boundary == "slide")
    assert now[~rim].any()


def test_selection_under_slide(dvr, tmp_path):
    source, output = tmp_path / "in.msh", tmp_path / "out.msh"
    groups = two_halves(source, 4.1, 1)
    points = open_mesh(source).mesh.points
    rim = inside(points, groups["rim"])
    now = moved_by(dvr, source, output, ["--boundary", "slide", "--only", "rim"])
    assert now.any()
    assert not now[~rim].any()
    now = moved_by(dvr, source, output, ["--boundary", "slide", "--fix", "rim"])
    assert now.any()
    assert not now[rim].any()


def test_names_there_are(dvr, tmp_path):
    before = listing(tmp_path)
    result = dvr("smooth", SAMPLES / "two_materials.msh", tmp_path / "out.msh", "--fix", "steal")
    assert_one_line(
        result, 2, "fix", "'steal'", "steel, brass", "crack", "clamped", "loaded", "gmsh:physical 1"
    )
    assert listing(tmp_path) == before


def test_names_in_an_obj_file(dvr, tmp_path):
    source, output = SAMPLES / "panel.obj", tmp_path / "out.obj"
    everything = moved_by(dvr, source, output, [])
    left = moved_by(dvr, source, output, ["--only", "left"])
    right = moved_by(dvr, source, output, ["--only", "right"])
    assert left.any()
    assert right.any()
    assert not (left & right).any()
    assert np.array_equal(left | right, everything)
    assert_one_line(dvr("smooth", source, output, "--only", "middle"), 2, "left, right; obj:group ")


def test_the_names_of_obj_groups_are_missed_in_other_formats(dvr, tmp_path):
    result = dvr("smooth", SAMPLES / "panel.obj", tmp_path / "out.vtk", "-n", "1")
    assert "not kept: 3 cell sets (left, panel, right)\n" in result.err


def test_references_of_a_medit_file(dvr, tmp_path):
    source, output = tmp_path / "in.mesh", tmp_path / "out.mesh"
    corners = "\n".join(f"{x} {y} 1" for x, y in [*CORNERS, [0.8, 0.9]])
    cells = "\n".join(" ".join(map(str, [*(v + 1 for v in cell), 7])) for cell in FAN)
    source.write_text(
        f"MeshVersionFormatted 2\nDimension 2\nVertices\n5\n{corners}\nTriangles\n4\n{cells}\nEnd\n"
    )
    assert moved_by(dvr, source, output, ["--only", "7"]).tolist() == [False] * 4 + [True]
    assert not moved_by(dvr, source, output, ["--fix", "7"]).any()
    assert_one_line(dvr("smooth", source, output, "--fix", "8"), 2, "'8'", "medit:ref 7")


def test_a_list_of_vertices_and_the_report(dvr, tmp_path):
    points = [*CORNERS, [0.8, 0.9], [2, 0.2], [2, 1], [1.3, 0.6]]
    cells = [*FAN, [1, 5, 7], [5, 6, 7], [6, 2, 7], [2, 1, 7]]
    source = write(tmp_path / "in.vtk", points, {"triangle": cells})
    (tmp_path / "v.txt").write_text("7\n0\n")
    output = tmp_path / "out.vtk"
    options = ["--vertices", tmp_path / "v.txt", "--below", "1", "--fail-below", "-1"]
    assert dvr("smooth", source, output, *options).code == 0
    assert np.flatnonzero((points_of(source) != points_of(output)).any(axis=1)).tolist() == [7]
    record = read_json((tmp_path / "out.quality.json").read_text())
    assert record["relaxed"] == len(record["quality_vector"]) == 1
    assert record["after"]["q1"] == record["quality_vector"][0] > record["before"]["q1"]
    assert record["after"]["fixed_cap"] == record["before"]["fixed_cap"] < record["after"]["q1"]
    assert record["options"]["vertices"] == str(tmp_path / "v.txt")
    assert (record["options"]["below"], record["options"]["layers"]) == (1.0, 0)
    limited = record["limited_by"]
    assert (limited["kind"], limited["vertex"]) == ("selection", 4)
    assert limited["element"] == record["after"]["worst"][0]


@pytest.mark.parametrize(("layers", "relaxed"), [("0", 0), ("1", 1)])
def test_layers_around_what_is_below(dvr, tmp_path, layers, relaxed):
    """The one bad triangle is in a corner; the inner vertex is its neighbour."""
    points = np.array([[0, 0], [0.95, 0], [1, 0], [1, 0.3], [1, 1], [0, 1], [0.4, 0.4]])
    cells = [[0, 1, 6], [1, 3, 6], [1, 2, 3], [3, 4, 6], [4, 5, 6], [5, 0, 6]]
    source = write(tmp_path / "in.msh", points, {"triangle": cells})
    result = dvr("smooth", source, tmp_path / "out.msh", "--below", "0.4", "--layers", layers)
    assert result.code == 0
    assert f"relaxed {relaxed} of 7 points" in result.err
    assert ("nothing to relax: the selection leaves no vertex" in result.err) == (relaxed == 0)


@pytest.mark.parametrize(
    ("name", "text", "code", "named"),
    [
        ("v.txt", "5", 2, "no vertex 5; the mesh has 5, numbered from 0"),
        ("v.csv", "1,2,x", 2, "v.csv"),
        ("v.txt", "0.5", 2, "0.5 is not the number of a vertex"),
        ("v.npy", "", 2, "empty"),
        ("missing.txt", None, 3, "no such file"),
    ],
)
def test_wrong_lists_of_vertices(dvr, tmp_path, name, text, code, named):
    source = fan(tmp_path / "in.msh")
    if text is not None:
        (tmp_path / name).write_text(text)
    before = listing(tmp_path)
    result = dvr("smooth", source, tmp_path / "out.msh", "--vertices", tmp_path / name)
    assert_one_line(result, code, "vertices", named)
    assert listing(tmp_path) == before


# --------------------------------------------------------------------------------------------- regions


def two_materials(path: Path, field: str, dtype: str = "i8") -> Path:
    """A 4 x 2 rectangle of 16 triangles, two materials meeting at x = 2, vertex 7 of the interface off it."""
    j, i = np.divmod(np.arange(15), 5)
    points = np.column_stack([i, j]).astype(float)
    points[7] = [2.6, 1.0]
    low = (np.arange(2)[:, None] * 5 + np.arange(4)).ravel()
    cells = np.stack([np.column_stack([low, low + 1, low + 6]), np.column_stack([low, low + 6, low + 5])])
    tags = np.where(np.tile(low % 5 < 2, 2), 1, 2).astype(dtype)
    return write(path, points, {"triangle": cells.reshape(-1, 3)}, cell_data={field: [tags]})


@pytest.mark.parametrize("field", ["material", "attribute", "PartId"])
def test_interfaces_stay_whatever_the_field_is_called(dvr, tmp_path, field):
    path = two_materials(tmp_path / "in.vtk", field)
    done = dvr("smooth", path, tmp_path / "out.vtk", "-n", "3")
    assert done.code == 0
    assert np.array_equal(points_of(tmp_path / "out.vtk")[7], [2.6, 1.0, 0.0])
    assert f"note: 2 regions, told apart by {field} (2 values)" in done.err
    mesh = read_json((tmp_path / "out.quality.json").read_text())["mesh"]
    assert mesh["divided_by"] == [{"name": field, "kind": "cell data", "count": 2}]


def test_regions_none_lets_them_move_and_a_name_holds_what_has_none(dvr, tmp_path):
    path, out = two_materials(tmp_path / "in.vtk", "PartId"), tmp_path / "out.vtk"
    assert dvr("smooth", path, out, *SWEEPS, "--regions", "none").code == 0
    assert points_of(out)[7, 0] < 2.5
    path = two_materials(tmp_path / "in.vtk", "rank")
    assert dvr("smooth", path, out, *SWEEPS).code == 0
    assert points_of(out)[7, 0] < 2.5
    assert dvr("smooth", path, out, *SWEEPS, "--regions", "rank").code == 0
    assert points_of(out)[7, 0] == 2.6
    reported = read_json(dvr("report", "quality", path, "--regions", "rank", "--json").out)
    assert (reported["mesh"]["regions"], reported["relaxed"]) == (2, 2)
    assert read_json((tmp_path / "out.quality.json").read_text())["options"]["regions"] == ["rank"]


def test_regions_that_are_not_there(dvr, tmp_path):
    path = two_materials(tmp_path / "in.vtk", "PartId")
    done = dvr("smooth", path, tmp_path / "out.vtk", "--regions", "steel")
    words = "no cells of a group and no cell data are called 'steel'; known: PartId"
    assert_one_line(done, 2, words)
    assert not (tmp_path / "out.vtk").exists()


def test_cells_of_a_type_are_a_group(dvr, tmp_path):
    """As physical groups are; a type that the mesh lacks is no group."""
    mesh = random_mesh("mixed3d", 1)
    types = sorted({block.type for block in mesh.cells})
    assert len(types) > 1
    source = tmp_path / "in.vtu"
    meshio.write_points_cells(source, mesh.points, [(b.type, b.vertices) for b in mesh.cells])
    for name in types:
        fixed = np.unique(np.concatenate([b.vertices.ravel() for b in mesh.cells if b.type == name]))
        moved = moved_by(dvr, source, tmp_path / "out.vtu", ["--fix", name])
        assert not moved[fixed].any()
        others = moved_by(dvr, source, tmp_path / "out.vtu", ["--only", name])
        assert not others[np.setdiff1d(np.arange(len(mesh.points)), fixed)].any()
    assert_one_line(dvr("smooth", source, tmp_path / "out.vtu", "--fix", "triangle"), 2, "'triangle'")
