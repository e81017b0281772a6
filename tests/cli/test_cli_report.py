"""``dvr report quality`` and ``dvr report compare`` in this process."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from cli_support import BEST, CORNERS, FAN, assert_one_line, fan, listing, points_of, read_json, write

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
  min altitude          0.1000
  conduction bound    510.0000

  other measures             worst      1 %     10 %     50 %     mean
  scaled-jacobian           0.1432   0.1464   0.1754   0.5088   0.5060
  aspect-ratio              5.8596   5.7767   5.0308   2.2025   2.8680
  skewness                  0.8812   0.8785   0.8542   0.5486   0.5431
  min-angle (deg)             7.13     7.29     8.75    27.08    27.41
  max-angle (deg)           146.31   145.04   133.63    93.46   102.67

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

worst elements by quality (numbered from 0 through all cells of the file)
     0.2038  triangle 2 at (0.6, 0.966667, 0)
     0.3646  triangle 1 at (0.933333, 0.633333, 0)

advice: dvr smooth can move vertices of the worst element to make it better
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
  min altitude          0.1000   0.5000
  conduction bound    510.0000  24.0000
"""


@pytest.fixture
def terminal(monkeypatch):
    """Let stdout count as a terminal of that many columns."""

    def connect(columns: int = 80) -> None:
        monkeypatch.setattr("sys.stdout.isatty", lambda: True)
        monkeypatch.setenv("COLUMNS", str(columns))

    return connect


def test_the_quality_on_a_terminal(dvr, terminal, tmp_path):
    path = fan(tmp_path / "mesh.msh")
    before = listing(tmp_path)
    terminal()
    result = dvr("report", "quality", path, "--worst", "2")
    assert (result.code, result.err) == (0, "")
    assert result.out.replace("█", "#") == QUALITY.format(path=path)
    assert listing(tmp_path) == before


@pytest.mark.parametrize("columns", [80, 40, 25])
def test_the_quality_fits_a_terminal(dvr, terminal, cube, columns):
    terminal(columns)
    result = dvr("report", "quality", cube)
    assert result.code == 0
    lines = result.out.splitlines()[1:]  # the first one is as long as the path
    assert max(map(len, lines)) <= max(columns, 30)  # a label and its value take 30
    assert "min dihedral (deg)" in result.out
    words = " ".join(result.out.split())
    assert "(numbered from 0 through all cells of the file)" in words
    terminal(200)
    wide = dvr("report", "quality", cube).out
    figures = [line for line in wide.splitlines() if line.startswith("  ") and "#" not in line]
    assert all(word in words for line in figures for word in line.replace("█", "").split())


@pytest.mark.parametrize("unit", [1e-4, 0.02, 1.0, 1e4])
def test_figures_of_any_size_fit_their_columns(dvr, tmp_path, unit):
    """Units range from micrometres to kilometres; the conduction bound is one over their square."""
    path = write(tmp_path / "mesh.vtk", unit * np.array([*CORNERS, [0.8, 0.9]]), {"triangle": FAN})
    summary = dvr("smooth", path, tmp_path / "out.vtk").err.splitlines()
    header = next(line for line in summary if line.endswith("before    after"))
    figures = next(line for line in summary if line.startswith("  conduction bound"))
    assert len(figures) == len(header)
    assert len(figures.split()) == 4


def test_the_quality_in_a_pipe_is_a_table(dvr, tmp_path):
    path = fan(tmp_path / "mesh.msh")
    result = dvr("report", "quality", path, "--worst", "2")
    assert (result.code, result.err) == (0, "")
    assert result.out.isascii()
    rows = [line.split("\t") for line in result.out.splitlines()]
    table = {row[0]: row[1] for row in rows}
    assert len(table) == len(rows)
    record = read_json(dvr("report", "quality", path, "--json", "--worst", "2").out)
    quality = record["quality"]
    assert (table["mesh"], table["dimension"], table["triangle"]) == (str(path), "2", "4")
    assert table["relaxed vertices"] == "1"
    assert float(table["Q1"]) == quality["q1"]
    assert table["fixed cap"] == "-"
    assert float(table["10 % quantile"]) == quality["quantiles"]["0.1"]
    assert float(table["max angle (deg)"]) == quality["max_angle"]
    assert [int(n) for name, n in table.items() if name.startswith("elements ")] == quality["histogram"]
    assert [row[1:] for row in rows if row[0].startswith("worst ")] == [
        [repr(worst["quality"]), place]
        for worst, place in zip(
            quality["worst"],
            ["triangle 2 at (0.6, 0.966667, 0)", "triangle 1 at (0.933333, 0.633333, 0)"],
            strict=True,
        )
    ]
    assert table["advice"].startswith("dvr smooth can ")


def test_a_name_cannot_break_the_table(dvr, tmp_path):
    path = fan(tmp_path / "a\tb\nc.msh")
    assert dvr("report", "quality", path).out.splitlines()[0] == f"mesh\t{tmp_path}/a b c.msh"


@pytest.mark.parametrize(
    ("points", "cells", "advice"),
    [
        ([*CORNERS, [0.5, 0.5]], FAN, "no need"),
        ([*CORNERS, [0.8, 0.9]], FAN, "dvr smooth can"),
        ([*CORNERS, [1.2, 0.9]], FAN, "1 inverted or degenerate: dvr smooth makes positive what it can"),
        ([*CORNERS[:2], [0.5, 0.1]], [[0, 1, 2]], "no vertex lies inside"),
        ([*CORNERS, [0.5, 0.5], [0.5, 1.01]], [*FAN, [3, 2, 5]], "the worst element has no vertex inside"),
    ],
)
def test_the_advice(dvr, tmp_path, points, cells, advice):
    path = write(tmp_path / "mesh.msh", points, {"triangle": cells})
    (line,) = [x for x in dvr("report", "quality", path).out.splitlines() if x.startswith("advice")]
    assert advice in line


def test_cells_that_are_kept_need_no_advice(dvr, tmp_path):
    """Five flat layers under squares: the flat cells are the worst, and as they are meant to be."""
    x, y = np.meshgrid(np.arange(9.0), [0, 0.03, 0.06, 0.09, 0.12, 0.15, 1, 2, 3], indexing="ij")
    number = np.arange(81).reshape(9, 9)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    path = write(tmp_path / "mesh.msh", points, {"quad": quads.reshape(-1, 4)})
    (line,) = [x for x in dvr("report", "quality", path).out.splitlines() if x.startswith("advice")]
    assert "all but the cells that dvr smooth keeps" in line
    (note,) = [x for x in dvr("report", "quality", path).out.splitlines() if "which dvr smooth keeps;" in x]
    said = r"note\t.*; relative to their own shape Q1 is (\S+) \(plain: (\S+)\), the fixed cap "
    both = re.fullmatch(said + r"(\S+) \(plain: (\S+)\)", note)
    summary = dvr("smooth", path, tmp_path / "out.msh", "--no-report", "-n", "0").err.splitlines()
    before = {x[2:21].strip(): x[21:].split()[:1] for x in summary if x.startswith("  ")}
    names = ("Q1", "plain Q1", "fixed cap", "plain fixed cap")
    assert [[value] for value in both.groups()] == [before[name] for name in names]


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


def test_gates_of_measures_and_their_cells(dvr, tmp_path):
    path = fan(tmp_path / "mesh.msh")
    measures = read_json(dvr("report", "quality", path, "--json").out)["measures"]
    least, most = measures["min-angle"]["worst"], measures["max-angle"]["worst"]
    assert (least, most) == pytest.approx((7.125, 146.31), abs=1e-2)
    assert measures["max-angle"]["unit"] == "deg"
    passing = ["--fail-below", f"min-angle={least}", "--fail-above", f"max-angle={most}"]
    assert dvr("report", "quality", path, *passing).code == 0
    failing = ["--fail-below", "min-angle=8", "--fail-above", "max-angle=146", "--fail-below", "0.3"]
    result = dvr("report", "quality", path, *failing)
    assert result.code == 1
    assert result.err.splitlines() == [
        f"dvr: {path}: the smallest min-angle, 7.1250, is below 8",
        f"dvr: {path}: the worst quality, 0.2038, is below 0.3",
        f"dvr: {path}: the largest max-angle, 146.3099, is above 146",
    ]
    by = read_json(dvr("report", "quality", path, "--json", "--measure", "min-angle", "--worst", "1").out)
    assert by["by_measure"]["measure"] == "min-angle"
    assert [worst["value"] for worst in by["by_measure"]["worst"]] == [least]
    rows = dvr("report", "quality", path, "--csv", "--measure", "min-angle").out.splitlines()
    assert rows[0] == "cell,type,value"
    assert sorted(float(row.split(",")[2]) for row in rows[1:])[0] == least
    result = dvr("report", "quality", path, "--measure", "non-orthogonality")
    assert_one_line(result, 3, "volume cells")


def test_a_gate_after_smoothing_looks_at_the_result(dvr, tmp_path):
    path = fan(tmp_path / "mesh.msh")
    result = dvr(
        "smooth",
        path,
        tmp_path / "out.msh",
        "-q",
        "--fail-below",
        "min-angle=44",
        "--fail-above",
        "skewness=0.26",
    )
    assert (result.code, result.err) == (0, "")
    result = dvr("smooth", path, tmp_path / "out.msh", "-q", "--fail-below", "min-angle=46")
    assert result.code == 1
    corners = points_of(tmp_path / "out.msh")[FAN]
    edges = np.roll(corners, -1, axis=1) - corners
    edges /= np.linalg.norm(edges, axis=2, keepdims=True)
    smallest = np.degrees(np.arccos((edges * -np.roll(edges, 1, axis=1)).sum(axis=2))).min()
    assert smallest == pytest.approx(45.0, abs=1e-3)
    assert f"the smallest min-angle, {smallest:.4f}, is below 46" in result.err


def test_comparing_with_a_better_mesh(dvr, terminal, tmp_path):
    before, after = fan(tmp_path / "a.msh"), fan(tmp_path / "b.msh", 0.5, 0.5)
    q, best = (
        read_json(dvr("report", "quality", path, "--json").out)["quality"]["q1"] for path in (before, after)
    )
    terminal(200)
    result = dvr("report", "compare", before, after)
    assert (result.code, result.err) == (0, "")
    assert result.out == COMPARISON.format(after=after, q=q, best=best)


def test_comparing_with_a_worse_mesh(dvr, terminal, tmp_path):
    terminal()
    before, after = fan(tmp_path / "a.msh", 0.5, 0.5), fan(tmp_path / "b.msh")
    result = dvr("report", "compare", before, after)
    assert (result.code, result.err) == (1, "")
    assert result.out.startswith(f"before is better: {before}\n")


def test_comparing_equal_meshes(dvr, terminal, tmp_path):
    terminal()
    before, after = fan(tmp_path / "a.msh"), fan(tmp_path / "b.vtk")
    result = dvr("report", "compare", before, after)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith("equal: ")


def test_a_comparison_as_json(dvr, tmp_path):
    before, after = fan(tmp_path / "a.msh"), fan(tmp_path / "b.msh", 0.5, 0.5)
    result = dvr("report", "compare", "--json", before, after)
    record = read_json(result.out)
    assert (result.code, record["better"], record["first_difference"]) == (0, "after", 1)
    assert [mesh["mesh"]["path"] for mesh in record["meshes"]] == [str(before), str(after)]
    assert [mesh["rank"] for mesh in record["meshes"]] == [2, 1]
    assert record["meshes"][1]["quality"]["q1"] == pytest.approx(BEST)


@pytest.mark.parametrize(
    ("order", "ranks", "code"),
    [
        ("abcd", [4, 2, 1, 2], 0),
        ("bacd", [2, 4, 1, 2], 0),
        ("cabd", [1, 4, 2, 2], 1),
        ("dabc", [2, 4, 2, 1], 0),
        ("cba", [1, 2, 3], 1),
    ],
)
def test_ranking_many_meshes(dvr, terminal, tmp_path, order, ranks, code):
    """Nearer to the middle is better; the last against the first decides on the exit code."""
    places = {"a": (0.8, 0.9), "b": (0.5, 0.6), "c": (0.5, 0.5), "d": (0.5, 0.6)}
    paths = [fan(tmp_path / f"{name}{i}.msh", *places[name]) for i, name in enumerate(order)]
    table = dvr("report", "compare", *paths)
    assert table.code == code
    header, *rows = (line.split("\t") for line in table.out.splitlines())
    assert header[:4] == ["mesh", "rank", "Q1", "fixed cap"]
    assert [row[:2] for row in rows] == [
        [str(path), str(rank)] for path, rank in zip(paths, ranks, strict=True)
    ]
    record = read_json(dvr("report", "compare", *paths, "--json").out)
    assert [mesh["rank"] for mesh in record["meshes"]] == ranks
    assert [float(row[2]) for row in rows] == [mesh["quality"]["q1"] for mesh in record["meshes"]]
    terminal(200)
    shown = dvr("report", "compare", *paths).out.splitlines()
    assert [line.split()[-1] for line in shown[1:]] == [
        str(paths[i]) for i in sorted(range(len(paths)), key=lambda i: ranks[i])
    ]
    assert shown[0].split()[:2] == ["rank", "Q1"]


def test_comparing_by_a_measure(dvr, terminal, tmp_path):
    """A mesh can have a better worst triangle, and the worse largest angle."""
    flat, thin = [[0, 0], [1, 0], [0.5, 0.2], [0.5, -0.5]], [[0, 0], [1, 0], [1, 0.15], [0.5, -0.5]]
    cells = {"triangle": [[0, 1, 2], [0, 3, 1]]}
    paths = [write(tmp_path / f"{name}.msh", points, cells) for name, points in (("f", flat), ("t", thin))]
    by_ratio = [read_json(dvr("report", "quality", path, "--json").out)["quality"]["min"] for path in paths]
    assert by_ratio[0] > by_ratio[1]
    angles = [180 - 2 * math.degrees(math.atan(0.4)), 90.0]  # of the upper triangle; the lower has 90°, too

    result = dvr("report", "compare", *paths, "--measure", "max-angle", "--json")
    record = read_json(result.out)
    assert (result.code, record["judged_by"], record["better"]) == (0, "max-angle", "after")
    assert record["first_difference"] == 1
    worst = [mesh["measures"]["max-angle"]["worst"] for mesh in record["meshes"]]
    assert worst == pytest.approx(angles)
    back = dvr("report", "compare", *reversed(paths), "--measure", "max-angle")
    assert back.code == 1
    header, *rows = (line.split("\t") for line in back.out.splitlines())
    assert [row[1] for row in rows] == ["1", "2"]
    at = header.index("max-angle (deg) worst")
    assert [float(row[at]) for row in rows] == pytest.approx(angles[::-1])
    terminal(200)
    shown = dvr("report", "compare", *paths, "--measure", "max-angle").out
    assert shown.startswith(
        f"after is better: {paths[1]}\nthe cells' values of max-angle, worst first, first "
    )
    found = re.search(r"component 1 of 2: (\S+) before, (\S+) after", shown)
    assert [float(value) for value in found.groups()] == pytest.approx(angles)
    assert re.search(r"^    worst \(deg\) +136.40 +90.00$", shown, re.MULTILINE)
    same = dvr("report", "compare", paths[0], paths[0], "--measure", "max-angle")
    assert same.code == 0
    assert same.out.startswith("equal: the cells' values of max-angle, worst first, are the same")
    ranking = dvr("report", "compare", *paths, paths[0], "--measure", "min-angle").out.splitlines()
    assert ranking[0].split()[:4] == ["rank", "worst", "min-angle", "(deg)"]
    assert [line.split()[0] for line in ranking[1:]] == ["1", "1", "3"]


def test_gates_of_a_comparison_are_for_the_last_mesh(dvr, tmp_path):
    before, after = fan(tmp_path / "a.msh"), fan(tmp_path / "b.msh", 0.5, 0.5)
    passing = ["--fail-below", "min-angle=44", "--fail-above", "max-angle=91", "--fail-below", "0.8"]
    assert dvr("report", "compare", before, after, *passing).code == 0
    result = dvr("report", "compare", before, after, "--fail-above", "max-angle=89")
    assert (result.code, result.err) == (1, f"dvr: {after}: the largest max-angle, 90.0000, is above 89\n")
    assert dvr("report", "compare", before, after, "--fail-below", "0.9").code == 1
    bad = dvr("report", "compare", before, after, "--fail-below", "roundness=1")
    assert_one_line(bad, 2, "--fail-below", "roundness")
    assert_one_line(dvr("report", "compare", before, after, "--measure", "face-skewness"), 3, "volume")


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
