"""``dvr report quality`` and ``dvr report compare`` in this process."""

from __future__ import annotations

import numpy as np
import pytest

from cli_support import BEST, CORNERS, FAN, assert_one_line, fan, listing, read_json, write

# The figures follow from Heron's formula and the law of cosines.
QUALITY = """\
{path} (2D)
  points                     5
  triangle                   4
  relaxed vertices           1

quality (mean ratio: 1 ideal, 0 degenerate, below 0 inverted)
  Q1                    0.2038  triangle 2 at (0.6, 0.9667, 0)
  fixed cap                  -  every element has a relaxed vertex
  worst                 0.2038  triangle 2 at (0.6, 0.9667, 0)
  1 % quantile          0.2086
  10 % quantile         0.2520
  50 % quantile         0.6293
  mean                  0.6018
  inverted                   0
  degenerate                 0
  min angle (deg)         7.13
  max angle (deg)       146.31

elements by quality
   below 0.05  0
  0.05 - 0.10  0
  0.10 - 0.15  0
  0.15 - 0.20  0
  0.20 - 0.25  1  ##################################################
  0.25 - 0.30  0
  0.30 - 0.35  0
  0.35 - 0.40  1  ##################################################
  0.40 - 0.45  0
  0.45 - 0.50  0
  0.50 - 0.55  0
  0.55 - 0.60  0
  0.60 - 0.65  0
  0.65 - 0.70  0
  0.70 - 0.75  0
  0.75 - 0.80  0
  0.80 - 0.85  0
  0.85 - 0.90  1  ##################################################
  0.90 - 0.95  1  ##################################################
  0.95 - 1.00  0

worst elements (numbered from 0 through all cells of the file)
     0.2038  triangle 2 at (0.6, 0.966667, 0)
     0.3646  triangle 1 at (0.933333, 0.633333, 0)
"""
COMPARISON = """\
after is better: {after}
the quality vectors first differ at component 1 of 1: {q!r} before, {best!r} after
                        before    after
  Q1                    0.2038   0.8660
  fixed cap                  -        -
  worst                 0.2038   0.8660
  1 % quantile          0.2086   0.8660
  10 % quantile         0.2520   0.8660
  50 % quantile         0.6293   0.8660
  mean                  0.6018   0.8660
  inverted                   0        0
  degenerate                 0        0
  min angle (deg)         7.13    45.00
  max angle (deg)       146.31    90.00
"""


def test_the_quality_as_text(dvr, tmp_path):
    path = fan(tmp_path / "mesh.msh")
    before = listing(tmp_path)
    result = dvr("report", "quality", path, "--worst", "2")
    assert (result.code, result.err) == (0, "")
    assert result.out == QUALITY.format(path=path)
    assert listing(tmp_path) == before


def test_the_quality_fits_80_columns(dvr, cube, tmp_path):
    result = dvr("report", "quality", cube)
    assert result.code == 0
    lines = result.out.splitlines()[1:]  # the first one is as long as the path
    assert max(map(len, lines)) <= 80
    assert "min dihedral (deg)" in result.out
    assert result.out.isascii()


def test_the_quality_as_json(dvr, tmp_path):
    path = fan(tmp_path / "mesh.msh")
    result = dvr("report", "quality", path, "--json", "--worst", "1")
    assert (result.code, result.err) == (0, "")
    record = read_json(result.out)
    assert record["schema"] == "dvr.quality/1"
    assert record["mesh"]["path"] == str(path)
    assert (record["mesh"]["points"], record["mesh"]["cells"], record["mesh"]["dimension"]) == (
        5,
        {"triangle": 4},
        2,
    )
    assert record["relaxed"] == 1
    assert record["units"]["angle"] == "degree"
    quality = record["quality"]
    assert quality["fixed_cap"] is None
    assert (quality["inverted"], quality["degenerate"]) == (0, 0)
    assert set(quality["quantiles"]) == {"0.01", "0.1", "0.5"}
    # triangle 2: area 0.05, squared sides 0.65, 0.05 and 1
    assert quality["q1"] == quality["min"] == pytest.approx(4 * 3**0.5 * 0.05 / 1.7)
    (worst,) = quality["worst"]
    assert (worst["cell_type"], worst["cell"], worst["quality"]) == ("triangle", 2, quality["q1"])
    assert worst["centroid"] == pytest.approx([0.6, 2.9 / 3, 0.0])
    assert record["quality_vector"] == [quality["q1"]]


def test_the_quality_vector_as_csv(dvr, cube):
    record = read_json(dvr("report", "quality", cube, "--json").out)
    result = dvr("report", "quality", cube, "--csv")
    assert (result.code, result.err) == (0, "")
    header, *rows = result.out.splitlines()
    assert header == "rank,vertex,quality"
    ranks, vertices, qualities = zip(*(row.split(",") for row in rows), strict=True)
    assert [int(rank) for rank in ranks] == list(range(1, record["relaxed"] + 1))
    assert len(set(vertices)) == record["relaxed"]
    assert [float(quality) for quality in qualities] == record["quality_vector"]
    assert record["quality_vector"] == sorted(record["quality_vector"])


def test_a_mesh_without_relaxed_vertices(dvr, tmp_path):
    path = write(tmp_path / "mesh.msh", CORNERS, {"triangle": [[0, 1, 2], [0, 2, 3]]})
    text = dvr("report", "quality", path)
    assert text.code == 0
    assert "nothing can be relaxed" in text.out
    assert dvr("report", "quality", path, "--csv").out == "rank,vertex,quality\n"
    record = read_json(dvr("report", "quality", path, "--json").out)
    assert record["quality"]["q1"] is None
    assert record["quality"]["fixed_cap"] == pytest.approx(BEST)  # halves of a square: the same triangle


def test_zero_volume_elements_are_counted(dvr, tmp_path):
    points = [*CORNERS, [0.5, 0.5], [2.0, 1.0], [3.0, 1.0]]
    path = write(tmp_path / "mesh.msh", points, {"triangle": [*FAN, [2, 5, 6]]})
    record = read_json(dvr("report", "quality", path, "--json").out)
    assert (record["quality"]["degenerate"], record["quality"]["inverted"]) == (1, 0)
    result = dvr("report", "quality", path)
    assert (result.code, result.err) == (0, "")


def test_a_volume_element_collapsed_to_a_point(dvr, tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], *np.ones((4, 3))]
    path = write(tmp_path / "mesh.vtk", points, {"tetra": [[0, 1, 2, 3], [4, 5, 6, 7]]})
    result = dvr("report", "quality", path, "--json")
    assert (result.code, result.err) == (0, "")
    assert read_json(result.out)["quality"]["degenerate"] == 1


@pytest.mark.parametrize(("limit", "code"), [("0.2", 0), ("0.21", 1)])
@pytest.mark.parametrize("form", [[], ["--json"], ["--csv"]])
def test_the_quality_gate(dvr, tmp_path, limit, code, form):
    path = fan(tmp_path / "mesh.msh")
    result = dvr("report", "quality", path, "--fail-below", limit, *form)
    assert result.code == code
    assert result.out
    assert result.err == (f"dvr: {path}: the worst quality, 0.2038, is below 0.21\n" if code else "")


def test_comparing_with_a_better_mesh(dvr, tmp_path):
    before, after = fan(tmp_path / "a.msh"), fan(tmp_path / "b.msh", 0.5, 0.5)
    q, best = (
        read_json(dvr("report", "quality", path, "--json").out)["quality"]["q1"] for path in (before, after)
    )
    result = dvr("report", "compare", before, after)
    assert (result.code, result.err) == (0, "")
    assert result.out == COMPARISON.format(after=after, q=q, best=best)


def test_comparing_with_a_worse_mesh(dvr, tmp_path):
    before, after = fan(tmp_path / "a.msh", 0.5, 0.5), fan(tmp_path / "b.msh")
    result = dvr("report", "compare", before, after)
    assert (result.code, result.err) == (1, "")
    assert result.out.startswith(f"before is better: {before}\n")


def test_comparing_equal_meshes(dvr, tmp_path):
    before, after = fan(tmp_path / "a.msh"), fan(tmp_path / "b.vtk")
    result = dvr("report", "compare", before, after)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith("equal: ")


def test_a_comparison_as_json(dvr, tmp_path):
    before, after = fan(tmp_path / "a.msh"), fan(tmp_path / "b.msh", 0.5, 0.5)
    result = dvr("report", "compare", "--json", before, after)
    record = read_json(result.out)
    assert (result.code, record["better"], record["first_difference"]) == (0, "after", 1)
    assert record["before"]["mesh"]["path"] == str(before)
    assert record["after"]["quality"]["q1"] == pytest.approx(BEST)


def test_meshes_of_different_cells_are_not_compared(dvr, tmp_path):
    before = fan(tmp_path / "a.msh")
    after = write(tmp_path / "b.msh", CORNERS, {"triangle": [[0, 1, 2], [0, 2, 3]]})
    assert_one_line(dvr("report", "compare", before, after), 3, "a.msh", "b.msh")


@pytest.mark.parametrize("bad", [0, 1])
def test_the_mesh_that_cannot_be_compared_is_named(dvr, tmp_path, bad):
    paths = [fan(tmp_path / "good.msh"), fan(tmp_path / "nan.vtk", np.nan)]
    if bad == 0:
        paths.reverse()
    result = dvr("report", "compare", *paths)
    assert_one_line(result, 3, "nan.vtk")
    assert "good.msh" not in result.err
