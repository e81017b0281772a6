"""``dvr smooth`` in this process: what it writes, what it says, and the code it ends with."""

from __future__ import annotations

import re

import meshio
import numpy as np
import pytest

import dvr_cli
from cli_support import BEST, CORNERS, FAN, fan, listing, points_of, read_json, write

SUMMARY = """\
{folder}/in.msh -> {folder}/out.msh
2D, 4 triangle
relaxed 1 of 5 points in 5 sweeps, # s
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
converged: Q1 grew by less than 0.5 in each of the last 3 sweeps
limited: 4 elements meet at vertex 4, which allows 0.8660 at best
advice: only other elements help: remesh there
report: {folder}/out.quality.json
"""
BLOCK = {"q1", "fixed_cap", "min", "mean", "quantiles", "inverted", "degenerate", "worst"}


def test_the_mesh_and_the_summary(dvr, tmp_path):
    """The figures before are those of Heron's formula and the law of cosines; after, see cli_support."""
    source, output = fan(tmp_path / "in.msh"), tmp_path / "out.msh"
    result = dvr("smooth", source, output, "-d", "axis", "--tol", "0.5")
    assert (result.code, result.out) == (0, "")
    np.testing.assert_allclose(points_of(output)[4], [0.5, 0.5, 0.0], atol=1e-9)
    np.testing.assert_array_equal(points_of(output)[:4], points_of(source)[:4])
    assert re.sub(r"\d+\.\d+ s$", "# s", result.err, flags=re.MULTILINE) == SUMMARY.format(folder=tmp_path)


def test_the_report(dvr, tmp_path):
    output = tmp_path / "out.vtk"
    options = "-d", "axis", "--seed", "5", "-n", "9", "--engine", "numpy"
    assert dvr("smooth", fan(tmp_path / "in.vtk"), output, *options).code == 0
    record = read_json((tmp_path / "out.quality.json").read_text())
    assert record["schema"] == "dvr.smooth/1"
    assert record["dvr_version"] == dvr_cli.__version__
    mesh = record["mesh"]
    assert (mesh["path"], mesh["points"], mesh["cells"], mesh["dimension"]) == (
        str(output),
        5,
        {"triangle": 4},
        2,
    )
    assert record["relaxed"] == 1
    for name in ("quality", "before", "after"):
        assert set(record[name]) >= BLOCK
    assert record["quality"] == record["after"]
    assert set(record["after"]["quantiles"]) == {"0.01", "0.1", "0.5"}
    assert record["after"]["q1"] == pytest.approx(BEST)
    assert record["quality_vector"] == [record["after"]["q1"]]
    keys = {"sweep", "phase", "q1", "moved", "seconds", "mean", "below"}
    assert all(set(sweep) == keys for sweep in record["sweeps"])
    assert [sweep["sweep"] for sweep in record["sweeps"]] == list(range(1, len(record["sweeps"]) + 1))
    assert record["stopped_because"] == "converged"
    assert (record["engine"], record["threads"], record["seed"]) == ("numpy", 1, 5)
    assert record["options"]["directions"] == "axis"
    assert record["options"]["max_iterations"] == 9


def test_the_quality_in_the_report_is_that_of_the_output(dvr, tmp_path, cube):
    output = tmp_path / "out.vtk"
    assert dvr("smooth", cube, output, "-n", "2", "-q").code == 0
    smoothed = read_json((tmp_path / "out.quality.json").read_text())
    measured = read_json(dvr("report", "quality", output, "--json").out)
    assert measured["quality"] == smoothed["after"]
    assert measured["quality_vector"] == smoothed["quality_vector"]
    before = read_json(dvr("report", "quality", cube, "--json").out)
    assert before["quality"] == smoothed["before"]


@pytest.mark.parametrize(
    ("options", "left"),
    [
        ([], {"in.msh", "out.msh", "out.quality.json"}),
        (["--no-report"], {"in.msh", "out.msh"}),
        (["--report", "{folder}/r.json"], {"in.msh", "out.msh", "r.json"}),
        (["--report", "{folder}/R.CSV"], {"in.msh", "out.msh", "R.CSV"}),
    ],
)
def test_where_the_report_goes(dvr, tmp_path, options, left):
    options = [option.format(folder=tmp_path) for option in options]
    assert dvr("smooth", fan(tmp_path / "in.msh"), tmp_path / "out.msh", *options).code == 0
    assert {path.name for path in tmp_path.iterdir()} == left


def test_a_csv_report_is_the_quality_vector(dvr, tmp_path):
    options = ["-d", "axis", "--report", tmp_path / "r.csv"]
    assert dvr("smooth", fan(tmp_path / "in.msh"), tmp_path / "out.msh", *options).code == 0
    header, row, rest = (tmp_path / "r.csv").read_text().split("\n")
    assert (header, rest) == ("rank,vertex,quality", "")
    rank, vertex, quality = row.split(",")
    assert (rank, vertex, float(quality)) == ("1", "4", pytest.approx(BEST))


def test_options_before_between_and_after_the_paths(dvr, tmp_path):
    source = fan(tmp_path / "in.vtk")
    options = ["-d", "radial,circumferential", "--center", "-1,2", "-n", "3"]
    written = []
    for name, first in (("a.vtk", 0), ("b.vtk", 2), ("c.vtk", 6)):
        words = [*options[:first], source, *options[first:4], tmp_path / name, *options[max(first, 4) :]]
        assert dvr("smooth", *words).code == 0
        written.append((tmp_path / name).read_bytes())
    assert written[0] == written[1] == written[2]
    assert dvr("smooth", source, tmp_path / "d.vtk", "-n", "3").code == 0
    assert (tmp_path / "d.vtk").read_bytes() != written[0]


def test_in_place(dvr, tmp_path):
    path = fan(tmp_path / "mesh.msh")
    assert dvr("smooth", path, path, "-d", "axis").code == 0
    np.testing.assert_allclose(points_of(path)[4], [0.5, 0.5, 0.0], atol=1e-9)
    assert {path.name for path in tmp_path.iterdir()} == {"mesh.msh", "mesh.quality.json"}


def test_same_input_options_and_seed_give_the_same_bytes(dvr, tmp_path, cube):
    def run(name: str, seed: int) -> bytes:
        output = tmp_path / name
        assert dvr("smooth", cube, output, "-n", "2", "--seed", seed, "--no-report", "-q").code == 0
        return output.read_bytes()

    assert run("a.vtk", 0) == run("b.vtk", 0)
    assert run("c.vtk", 1) != run("a.vtk", 0)


def test_formats_named_where_suffixes_say_nothing(dvr, tmp_path):
    source = fan(tmp_path / "in.vtk").rename(tmp_path / "in")
    output = tmp_path / "out"
    assert dvr("smooth", source, output, "--input-format", "vtk", "--output-format", "vtk").code == 0
    points_of(output.rename(tmp_path / "out.vtk"))
    assert (tmp_path / "out.quality.json").exists()


def test_quiet_prints_nothing(dvr, tmp_path):
    result = dvr("smooth", fan(tmp_path / "in.msh"), tmp_path / "out.msh", "--quiet")
    assert (result.code, result.out, result.err) == (0, "", "")


def test_verbose_prints_a_line_for_each_sweep(dvr, tmp_path):
    result = dvr(
        "smooth",
        fan(tmp_path / "in.msh"),
        tmp_path / "out.msh",
        "-v",
        "-n",
        "3",
        "-d",
        "random",
        "--tol",
        "0",
    )
    numbers = re.findall(r"^sweep +(\d+)  Q1 \S+  moved \d+  ", result.err, flags=re.MULTILINE)
    assert numbers == ["1", "2", "3"]


@pytest.mark.parametrize(
    ("options", "reason", "words"),
    [
        (["-n", "2", "--tol", "0"], "max-iterations", "2 sweeps at most"),
        (["-n", "0"], "max-iterations", "0 sweeps at most"),
        (["--target", "0.5"], "target", "target, 0.5"),
        (["--time-limit", "0"], "time-limit", "time limit of 0"),
        (["--patience", "1", "--tol", "0.9"], "converged", "the last 1 sweep"),
    ],
)
def test_why_it_stopped(dvr, tmp_path, options, reason, words):
    result = dvr("smooth", fan(tmp_path / "in.msh"), tmp_path / "out.msh", "-d", "axis", *options)
    assert result.code == 0
    assert read_json((tmp_path / "out.quality.json").read_text())["stopped_because"] == reason
    assert words in result.err


@pytest.mark.parametrize(("limit", "code"), [("0.8", 0), ("0.9", 1)])
def test_the_quality_gate_looks_at_the_result(dvr, tmp_path, limit, code):
    source, output = fan(tmp_path / "in.msh"), tmp_path / "out.msh"
    result = dvr("smooth", source, output, "-d", "axis", "--fail-below", limit, "-q")
    assert result.code == code
    assert result.err == ("dvr: the worst quality, 0.8660, is below 0.9\n" if code else "")
    assert output.exists()


def test_the_quality_gate_counts_elements_that_cannot_be_relaxed(dvr, tmp_path):
    """The square improves to 0.866, but a flat triangle beside it has no vertex inside the mesh."""
    points = [*CORNERS, [0.5, 0.5], [0.5, -0.01]]
    source = write(tmp_path / "in.msh", points, {"triangle": [*FAN, [1, 0, 5]]})
    result = dvr("smooth", source, tmp_path / "out.msh", "--fail-below", "0.5", "-q")
    assert result.code == 1
    record = read_json((tmp_path / "out.quality.json").read_text())
    assert record["after"]["q1"] == pytest.approx(BEST)
    # base 1, height 0.01, two sides of squared length 0.2501
    assert record["after"]["fixed_cap"] == pytest.approx(4 * 3**0.5 * 0.005 / 1.5002)


def test_nothing_to_relax(dvr, tmp_path):
    source = write(tmp_path / "in.msh", CORNERS, {"triangle": [[0, 1, 2], [0, 2, 3]]})
    result = dvr("smooth", source, tmp_path / "out.msh")
    assert result.code == 0
    assert "nothing to relax" in result.err
    record = read_json((tmp_path / "out.quality.json").read_text())
    assert record["stopped_because"] == "nothing-to-relax"
    assert record["after"]["q1"] is None
    assert record["quality_vector"] == record["sweeps"] == []


def test_mirrored_cells_are_said_and_left_so(dvr, tmp_path):
    source = write(tmp_path / "in.msh", [*CORNERS, [0.8, 0.9]], {"triangle": np.array(FAN)[:, ::-1]})
    result = dvr("smooth", source, tmp_path / "out.msh", "-d", "axis")
    assert result.code == 0
    assert "note: 4 cells stored inside out" in result.err
    np.testing.assert_allclose(points_of(tmp_path / "out.msh")[4], [0.5, 0.5, 0.0], atol=1e-9)
    cells = meshio.read(tmp_path / "out.msh", file_format="gmsh").cells_dict["triangle"]
    np.testing.assert_array_equal(cells, np.array(FAN)[:, ::-1])


def test_inverted_elements_that_stay_are_said(dvr, tmp_path):
    """The last triangle belongs below the side from 1 to 5, but its vertex 6 is above; none can move."""
    points = [*CORNERS, [0.5, 0.5], [2.0, 0.0], [1.5, 0.2]]
    source = write(tmp_path / "in.msh", points, {"triangle": [*FAN, [1, 5, 2], [5, 1, 6]]})
    result = dvr("smooth", source, tmp_path / "out.msh")
    assert result.code == 0
    assert "note: 1 inverted or degenerate element left" in result.err
    record = read_json((tmp_path / "out.quality.json").read_text())
    assert (record["before"]["inverted"], record["after"]["inverted"]) == (1, 1)


@pytest.mark.parametrize("suffix", [".msh", ".vtk"])
def test_zero_volume_elements_are_reported_and_left(dvr, tmp_path, suffix):
    points = [*CORNERS, [0.5, 0.5], [2.0, 1.0], [3.0, 1.0]]
    source = write(tmp_path / f"in{suffix}", points, {"triangle": [*FAN, [2, 5, 6]]})
    result = dvr("smooth", source, tmp_path / f"out{suffix}")
    assert result.code == 0
    assert "note: 1 inverted or degenerate element left" in result.err
    assert read_json((tmp_path / "out.quality.json").read_text())["after"]["degenerate"] == 1
    np.testing.assert_array_equal(points_of(tmp_path / f"out{suffix}")[5:], points_of(source)[5:])


@pytest.mark.parametrize("kind", ["npy", "csv", "txt"])
def test_directions_from_a_file(dvr, tmp_path, kind):
    """Along (1, 0.5) from (0.8, 0.9); the inner vertex alone moves, and on that line."""
    vectors, path = np.tile([1.0, 0.5], (5, 1)), tmp_path / f"d.{kind}"
    if kind == "npy":
        np.save(path, vectors)
    else:
        np.savetxt(path, vectors, delimiter="," if kind == "csv" else " ")
    source, output = fan(tmp_path / "in.vtk"), tmp_path / "out.vtk"
    assert dvr("smooth", source, output, "-d", f"file:{path}").code == 0
    dx, dy = points_of(output)[4, :2] - [0.8, 0.9]
    assert dx < -0.1
    assert dy == pytest.approx(dx / 2)


def test_directions_from_a_point_field(dvr, tmp_path):
    field = np.tile([0.0, 2.0, 0.0], (5, 1))
    source = fan(tmp_path / "in.vtk", point_data={"flow": field})
    assert dvr("smooth", source, tmp_path / "out.vtk", "-d", "field:flow").code == 0
    x, y = points_of(tmp_path / "out.vtk")[4, :2]
    assert x == 0.8
    assert y < 0.8


def test_the_centre_of_radial_directions(dvr, tmp_path):
    """From a centre at the corner (0, 0) the inner vertex moves along the diagonal it is on."""
    source, output = fan(tmp_path / "in.vtk", 0.9, 0.9), tmp_path / "out.vtk"
    assert dvr("smooth", source, output, "-d", "radial", "--center", "0,0").code == 0
    np.testing.assert_allclose(points_of(output)[4, :2], [0.5, 0.5], atol=1e-9)


def test_the_input_is_left_alone(dvr, tmp_path):
    source = fan(tmp_path / "in.msh")
    before = listing(tmp_path)
    assert dvr("smooth", source, tmp_path / "out.msh").code == 0
    assert before.items() <= listing(tmp_path).items()
