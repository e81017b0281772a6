"""Measures beside the mean ratio: a record is enough for all reports."""

from __future__ import annotations

import json

import meshio
import numpy as np
import pytest

import dvr_cli
from dvr_cli.cli.main import main
from dvr_cli.quality.measures import MEASURES, Measure
from meshes import random_mesh


@pytest.fixture
def longest(monkeypatch):
    """A measure that only this test knows: the longest side of a box around a cell; none in 2D."""

    def values(domain, flat):
        if domain.dimension == 2:
            return (np.nan,)
        return (max(np.ptp(flat[block.vertices], axis=1).max() for block in domain.cells),)

    record = Measure(("longest",), (("span in 2D",), ("span",)), (("span", "that of the points"),), values)
    monkeypatch.setattr("dvr_cli.quality.measures.MEASURES", [*MEASURES, record])


def test_a_new_record_is_in_all_reports(longest, tmp_path, capsys):
    mesh = random_mesh("tetra", 1)
    cells = mesh.cells[0].vertices
    expected = float(np.ptp(mesh.points[cells], axis=1).max())
    path = tmp_path / "in.vtk"
    meshio.Mesh(mesh.points, {"tetra": cells}).write(path)

    assert main(["report", "quality", str(path), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["quality"]["longest"] == expected
    assert record["units"]["span"] == "that of the points"
    assert main(["report", "quality", str(path)]) == 0
    assert f"\nspan\t{expected!r}\n" in capsys.readouterr().out
    assert main(["report", "compare", str(path), str(path)]) == 0
    assert "span" in capsys.readouterr().out
    _, report = dvr_cli.smooth(mesh.points, {"tetra": cells}, max_iterations=1)
    assert report.before.measures["longest"] == expected
    assert report.record()["before"]["longest"] == expected


def test_what_a_mesh_does_not_have_is_none(longest):
    mesh = random_mesh("quad", 1)
    quality = dvr_cli.quality_report(mesh.points, {"quad": mesh.cells[0].vertices}).quality
    assert quality.measures["longest"] is None
    assert quality.measures["min_angle"] > 0
