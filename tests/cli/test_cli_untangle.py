"""``dvr untangle`` and ``dvr smooth --untangle``: what they write, say and exit with."""

from __future__ import annotations

import pytest

from cli_support import assert_one_line, points_of, read_json, write
from meshes import boxes_of, bump


def tangled(path):
    mesh = bump("quad", 10)
    return write(path, mesh.points, {"quad": mesh.cells[0].vertices})


def impossible(path):
    """A square of triangles whose lower side is pushed through its upper side in one point."""
    mesh = boxes_of("triangle", 4)
    mesh.points[(mesh.points == [0.5, 0]).all(axis=1)] = [0.5, 1.05]
    return write(path, mesh.points, {"triangle": mesh.cells[0].vertices})


def test_untangle_makes_a_valid_mesh_and_says_so(dvr, tmp_path):
    source, output = tangled(tmp_path / "in.msh"), tmp_path / "out.msh"
    assert dvr("report", "quality", source, "--fail-below", "0").code == 1
    result = dvr("untangle", source, output, "--fail-below", "0")
    assert (result.code, result.out) == (0, "")
    assert "every element that can be is positive" in result.err
    assert "sweeps at most" not in result.err
    report = read_json((tmp_path / "out.quality.json").read_text())
    assert report["before"]["inverted"] > 0 == report["after"]["inverted"]
    phase = report["phases"][0]
    assert (phase["phase"], phase["stopped_because"]) == ("untangle", "untangled")
    assert phase["rounds"][-1]["tangled"] == 0
    assert report["sweeps"] == []
    assert dvr("report", "quality", output, "--fail-below", "0").code == 0


def test_smooth_goes_on_from_there(dvr, tmp_path):
    source = tangled(tmp_path / "in.msh")
    dvr("untangle", source, tmp_path / "untangled.msh")
    assert dvr("smooth", source, tmp_path / "out.msh", "--untangle").code == 0
    first, second = (
        read_json((tmp_path / f"{name}.quality.json").read_text()) for name in ("untangled", "out")
    )
    assert second["options"]["untangle"] is True
    assert len(second["sweeps"]) > 0
    assert second["after"]["q1"] > first["after"]["q1"] > 0


def test_a_valid_mesh_comes_back_byte_for_byte(dvr, tmp_path):
    mesh = boxes_of("quad", 3)
    source = write(tmp_path / "in.msh", mesh.points, {"quad": mesh.cells[0].vertices})
    result = dvr("untangle", source, tmp_path / "out.msh")
    assert result.code == 0
    assert "nothing to untangle" in result.err
    assert (tmp_path / "out.msh").read_bytes() == source.read_bytes()


@pytest.mark.parametrize("command", [["untangle"], ["smooth", "--untangle"]])
def test_what_stays_inverted_is_reported_with_place_and_reason(dvr, tmp_path, command):
    source, output = impossible(tmp_path / "in.msh"), tmp_path / "out.msh"
    result = dvr(*command, source, output)
    assert result.code == 0
    report = read_json((tmp_path / "out.quality.json").read_text())
    left = report["after"]["inverted"] + report["after"]["degenerate"]
    assert 0 < report["after"]["inverted"] <= report["before"]["inverted"]
    reasons = report["phases"][0]["left"]
    assert reasons["elements"] == left
    assert f"{left} inverted or degenerate element" in result.err
    worst = report["after"]["worst"][0]
    assert f"triangle {worst['cell']} at" in result.err
    assert f"{reasons['crossing']} of them near held facets that cross" in result.err
    assert points_of(output).shape == points_of(source).shape
    assert dvr(*command, source, output, "--fail-below", "0").code == 1


def test_surfaces_in_space_are_refused(dvr, tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0], [0.5, 0.5, 1]]
    source = write(tmp_path / "in.msh", points, {"triangle": [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]})
    assert_one_line(dvr("untangle", source, tmp_path / "out.msh"), 3, "in.msh", "surface")
    assert not (tmp_path / "out.msh").exists()


def test_smooth_untangles_by_default(dvr, tmp_path):
    """Unless it is told not to, or along what to move; then it names the option."""
    source, output = tangled(tmp_path / "in.msh"), tmp_path / "out.msh"
    result = dvr("smooth", source, output, "--fail-below", "0")
    assert result.code == 0
    assert "every element that can be is positive" in result.err
    report = read_json((tmp_path / "out.quality.json").read_text())
    assert [phase["phase"] for phase in report["phases"]][:3] == ["untangle", "descent", "relax"]
    assert report["options"]["untangle"] is True
    for options in (["--no-untangle"], ["-d", "x"]):
        result = dvr("smooth", source, output, *options)
        report = read_json((tmp_path / "out.quality.json").read_text())
        assert "untangle" not in [phase["phase"] for phase in report["phases"]]
        assert report["options"]["untangle"] is False
        assert report["after"]["inverted"] > 0
        assert "advice: --untangle makes positive what it can" in result.err


def test_no_sweeps_at_all_means_no_untangling_either(dvr, tmp_path):
    source, output = tangled(tmp_path / "in.msh"), tmp_path / "out.msh"
    assert dvr("smooth", source, output, "-n", "0").code == 0
    assert output.read_bytes() == source.read_bytes()


def test_an_element_that_is_inverted_because_it_is_held_is_said_to_be(dvr, tmp_path):
    """A square in four around vertex 4, and on its right side a triangle that is folded into it."""
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [0.4, 0.4], [0.8, 0.5]]
    cells = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 5, 2]]
    source = write(tmp_path / "in.msh", points, {"triangle": cells})
    for directions in ("x", "steepest,random"):
        result = dvr("smooth", source, tmp_path / "out.msh", "-d", directions)
        first = result.err.split("\n")[0]
        assert first.startswith("not touched: the worst element (triangle 4, quality -")
        assert "none of the 3 vertices of triangle 4 can move" in first
        assert "1 of them with a corner whose vertices are all held: no movement helps" in result.err
        assert "--untangle" not in result.err


def test_surfaces_are_not_untangled_by_default(dvr, tmp_path):
    """Nor is there advice to do so: the tip of the tent is pushed over its side."""
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0], [1.4, 0.5, 1]]
    source = write(tmp_path / "in.msh", points, {"triangle": [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]})
    result = dvr("smooth", source, tmp_path / "out.msh")
    assert result.code == 0
    assert "--untangle" not in result.err
    report = read_json((tmp_path / "out.quality.json").read_text())
    assert "untangle" not in [phase["phase"] for phase in report["phases"]]
