"""Arguments: wrong ones get one line and exit code 2, and every option that --help names works."""

from __future__ import annotations

import re
import subprocess
import sys

import numpy as np
import pytest

import dvr_cli
from cli_support import assert_one_line, fan, listing
from dvr_cli.api.options import BOUNDARIES
from dvr_cli.relax.schedule import ORDERS


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["frobnicate"], "frobnicate"),
        (["--frobnicate"], "--frobnicate"),
        (["report"], "missing command"),
        (["report", "frobnicate"], "frobnicate"),
        (["report", "quality"], "MESH"),
        (["report", "compare", "IN"], "AFTER"),
        (["report", "quality", "IN", "--json", "--csv"], "--csv"),
        (["report", "quality", "IN", "--worst", "-1"], "--worst"),
        (["report", "quality", "IN", "--plot", "p.jpg"], "p.jpg"),
        (["report", "compare", "IN", "IN", "--plot", "p"], "p"),
        (["report", "quality", "IN", "--fail-below", "nan"], "--fail-below"),
        (["report", "quality", "IN", "--fail-below", "2"], "--fail-below"),
        (["report", "quality", "IN", "--fail-below", "smoothness=1"], "smoothness"),
        (["report", "quality", "IN", "--fail-above", "0.5"], "--fail-above"),
        (["report", "quality", "IN", "--fail-above", "skewness=inf"], "inf"),
        (["report", "quality", "IN", "--measure", "beauty"], "--measure"),
        (["smooth", "IN", "OUT", "--measure", "skewness"], "--quality-field"),
        (["report", "quality", "IN", "--input-format", "cuneiform"], "cuneiform"),
        (["morph"], "IN"),
        (["morph", "IN"], "OUT"),
        (["morph", "IN", "OUT"], "--displacement"),
        (["morph", "IN", "OUT", "--displacement", "d.npy", "--near", "-1"], "--near"),
        (["smooth"], "IN"),
        (["smooth", "IN"], "OUT"),
        (["smooth", "IN", "OUT", "more.msh"], "more.msh"),
        (["untangle", "IN"], "OUT"),
        (["untangle", "IN", "OUT", "--seed", "1"], "--seed"),
        (["untangle", "IN", "OUT", "--time-limit", "-1"], "--time-limit"),
    ],
)
def test_wrong_arguments(dvr, tmp_path, arguments, named):
    paths = {"IN": fan(tmp_path / "in.msh"), "OUT": tmp_path / "out.msh"}
    before = listing(tmp_path)
    assert_one_line(dvr(*(paths.get(argument, argument) for argument in arguments)), 2, named)
    assert listing(tmp_path) == before


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--frobnicate"], "--frobnicate"),
        (["-n"], "-n"),
        (["-n", "many"], "--max-iterations"),
        (["-n", "-1"], "--max-iterations"),
        (["-n", "1.5"], "--max-iterations"),
        (["--tol", "-1e-3"], "--tol"),
        (["--tol", "nan"], "--tol"),
        (["--tol", "inf"], "--tol"),
        (["--tol", "small"], "--tol"),
        (["--patience", "0"], "--patience"),
        (["--target", "1.5"], "--target"),
        (["--target", "nan"], "--target"),
        (["--time-limit", "-1"], "--time-limit"),
        (["--time-limit", "inf"], "--time-limit"),
        (["--fail-below", "30"], "--fail-below"),
        (["--order", "alphabetical"], "--order"),
        (["--boundary", "float"], "--boundary"),
        (["--feature-angle", "181"], "--feature-angle"),
        (["--feature-angle", "nan"], "--feature-angle"),
        (["--max-deviation", "-1"], "--max-deviation"),
        (["--max-deviation", "inf"], "--max-deviation"),
        (["--seed", "-1"], "--seed"),
        (["--seed", str(2**64)], "seed"),
        (["--center", "1"], "--center"),
        (["--center", "1,2,3,4"], "--center"),
        (["--center", "1,x"], "--center"),
        (["--center", "nan,0"], "--center"),
        (["--axis", "0,1"], "--axis"),
        (["--axis", "0,0,inf"], "--axis"),
        (["-d", "sideways"], "sideways"),
        (["-d", "random,sideways"], "sideways"),
        (["-d", ""], "directions"),
        (["-d", "x,"], "directions"),
        (["-d", "z"], "z"),  # the mesh lies in the plane z = 0
        (["-d", "field:flow"], "flow"),
        (["-d", "file:d.bin"], "d.bin"),
        (["--below", "1.5"], "--below"),
        (["--below", "0.3", "--layers", "-1"], "--layers"),
        (["--layers", "1"], "below"),
        (["--fix", "wall"], "'wall'"),
        (["--only", "wall"], "'wall'"),
        (["--vertices", "v.dat"], "v.dat"),
        (["--floor", "1.1"], "--floor"),
        (["--floor", "nan"], "--floor"),
        (["--preset", "book"], "--preset"),
        (["--preset", "paper", "-d", "x"], "directions"),
        (["--preset", "paper", "--order", "shuffled"], "order"),
        (["--preset", "paper", "--polish"], "polish"),
        (["--preset", "paper", "--keep-height"], "keep_height"),
        (["--preset", "paper", "--tol", "0.1"], "tol"),
        (["--report", "r.txt"], "r.txt"),
        (["--report", "r"], "r"),
        (["--report", "r.json", "--no-report"], "--no-report"),
        (["--plot", "p.gif"], "p.gif"),
        (["--metric", "stress"], "no point field 'stress' (there are: none), nor a .sol or .solb file"),
        (["--metric", "m.sol", "--shape", "input"], "shape input"),
        (["--quality-field"], "out.msh"),
        (["-q", "-v"], "--verbose"),
        (["--input-format", "cuneiform"], "cuneiform"),
        (["--output-format", "cuneiform"], "cuneiform"),
    ],
)
def test_wrong_options(dvr, tmp_path, options, named):
    source = fan(tmp_path / "in.msh")
    before = listing(tmp_path)
    assert_one_line(dvr("smooth", source, tmp_path / "out.msh", *options), 2, named)
    assert listing(tmp_path) == before


@pytest.mark.parametrize("name", ["out.xyz", "out", "out.json"])
def test_an_output_whose_suffix_says_no_format(dvr, tmp_path, name):
    source = fan(tmp_path / "in.msh")
    before = listing(tmp_path)
    assert_one_line(dvr("smooth", source, tmp_path / name), 2, name)
    assert listing(tmp_path) == before


def test_a_report_in_the_place_of_the_mesh(dvr, tmp_path):
    source = fan(tmp_path / "in.msh")
    output = tmp_path / "out.json"
    options = ["--output-format", "vtk", "--report", output]
    assert_one_line(dvr("smooth", source, output, *options), 2, "out.json")
    assert not output.exists()


@pytest.mark.parametrize(
    ("vectors", "named"),
    [
        (np.ones((4, 2)), "(4, 2)"),
        (np.ones((5, 4)), "(5, 4)"),
        (np.ones(5), "(5,)"),
        (np.ones((2, 4, 2)), "(2, 4, 2)"),
        (np.ones((0, 5, 2)), "no sweeps"),
        (np.where(np.arange(10).reshape(5, 2) == 6, np.nan, 1.0), "vertex 3"),
        (np.where(np.arange(10).reshape(5, 2) == 9, np.inf, 1.0), "vertex 4"),
        (np.full((5, 2), "up"), "not numbers"),
    ],
)
def test_wrong_direction_arrays(dvr, tmp_path, vectors, named):
    source = fan(tmp_path / "in.msh")
    np.save(tmp_path / "d.npy", vectors)
    before = listing(tmp_path)
    directions = f"file:{tmp_path / 'd.npy'}"
    assert_one_line(dvr("smooth", source, tmp_path / "out.msh", "-d", directions), 2, named)
    assert listing(tmp_path) == before


def test_a_direction_file_that_is_missing(dvr, tmp_path):
    directions = f"file:{tmp_path / 'd.npy'}"
    result = dvr("smooth", fan(tmp_path / "in.msh"), tmp_path / "out.msh", "-d", directions)
    assert_one_line(result, 3, "d.npy")
    assert "in.msh" not in result.err


def test_usage_errors_say_where_to_look(dvr):
    assert dvr("smooth", "--frobnicate").err.endswith("(see 'dvr smooth --help')\n")


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"]])
def test_help(dvr, arguments):
    result = dvr(*arguments)
    assert (result.code, result.err) == (0, "")
    assert "Usage: dvr " in result.out
    assert re.search(r"^  smooth ", result.out, flags=re.MULTILINE)


@pytest.mark.parametrize(
    "arguments",
    [
        ["smooth"],
        ["untangle"],
        ["morph"],
        ["warm-up"],
        ["report"],
        ["report", "quality"],
        ["report", "compare"],
    ],
)
def test_help_of_commands(dvr, arguments):
    result = dvr(*arguments, "--help")
    assert (result.code, result.err) == (0, "")
    assert f"Usage: dvr {' '.join(arguments)} " in result.out
    assert max(map(len, result.out.splitlines())) <= 80


def examples(help_text):
    """The command lines at the end of a help."""
    return [line.strip() for line in re.findall(r"^  \S.*", help_text.split("Examples:\n")[1], re.MULTILINE)]


@pytest.mark.parametrize("command", ["smooth", "untangle", "morph", "report quality", "report compare"])
def test_the_examples_of_help_run(dvr, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    for name in ("in.msh", "before.msh", "after.msh", "in.vtk"):
        fan(tmp_path / name)
    tags = [np.ones(4, dtype=int)]
    mesh = fan(tmp_path / "tagged.msh", cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags})
    assert dvr("smooth", mesh, "deck.inp", "--output-format", "abaqus", "--no-report").code == 0
    np.save("d.npy", np.zeros((5, 3)))
    lines = examples(dvr(*command.split(), "--help").out)
    assert lines
    for line in lines:
        parts = [part.split() for part in line.split(" | ")]
        [own] = [part for part in parts if part[0] == "dvr"]
        assert own[1 : 1 + len(command.split())] == command.split()
        if "-" in own:  # a pipe, which the tests of pipes run
            continue
        result = dvr(*own[1:])
        assert (result.code, result.err.count("error")) == (0, 0), line


def test_every_option_stands_under_a_heading(dvr):
    for command in ("smooth", "untangle", "morph", "report quality", "report compare"):
        text = dvr(*command.split(), "--help").out
        [rest] = re.findall(r"^Options:\n(.*?)\n\n", text, flags=re.MULTILINE | re.DOTALL)
        assert rest.split() == ["-h,", "--help", "Show", "this", "message", "and", "exit."]


def test_help_in_a_terminal_says_the_same(dvr, monkeypatch):
    plain = dvr("smooth", "--help").out
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERM", "dumb")
    drawn = dvr("smooth", "--help").out
    assert "╭─ Boundary and regions ─" in drawn

    def words(text):
        text = re.sub(r"-[\s│]*\n[\s│]*", "-", text)  # a line may end behind a hyphen
        return {word.strip(".") for word in re.findall(r"[\w.-]+", text)}

    assert words(plain) - words(drawn) == set()
    assert "(needs dvr-cli[plot])" in re.sub(r"[\s│]+", " ", drawn)


SMOOTH = {
    "--directions": ["axis,random"],
    "--center": ["0.5,0.5"],
    "--axis": ["0,0,1"],
    "--max-iterations": ["2"],
    "--tol": ["1e-6"],
    "--patience": ["2"],
    "--target": ["0.7"],
    "--time-limit": ["5.5"],
    "--order": ["natural"],
    "--boundary": ["slide"],
    "--feature-angle": ["45"],
    "--max-deviation": ["0.01"],
    "--seed": ["18446744073709551615"],
    "--fix": ["1"],
    "--only": ["1"],
    "--below": ["0.5"],
    "--layers": ["2", "--below", "0.5"],
    "--vertices": ["{folder}/v.txt"],
    "--engine": ["numpy"],
    "--threads": ["2"],
    "--regions": ["none"],
    "--shape": ["ideal"],
    "--metric": ["{folder}/m.sol"],
    "--straighten": [],
    "--polish": [],
    "--keep-height": [],
    "--floor": ["0.9"],
    "--preset": ["paper"],
    "--patches": [],
    "--untangle": [],
    "--report": ["{folder}/r.csv"],
    "--plot": ["{folder}/p.svg"],
    "--quality-field": ["--output-format", "vtu"],
    "--no-report": [],
    "--input-format": ["gmsh"],
    "--output-format": ["vtk"],
    "--measure": ["skewness", "--quality-field", "--output-format", "vtu"],
    "--fail-below": ["-1", "--fail-below", "min-angle=0"],
    "--fail-above": ["max-angle=180"],
    "--quiet": [],
    "--verbose": [],
    "--debug": [],
}
MORPH = {
    "--displacement": ["{folder}/d.csv"],
    "--near": ["1"],
    **{
        name: SMOOTH[name]
        for name in (
            "--directions",
            "--center",
            "--axis",
            "--max-iterations",
            "--tol",
            "--patience",
            "--target",
            "--order",
            "--keep-height",
            "--seed",
            "--engine",
            "--threads",
            "--regions",
            "--shape",
            "--straighten",
            "--report",
            "--plot",
            "--quality-field",
            "--no-report",
            "--input-format",
            "--output-format",
            "--measure",
            "--fail-below",
            "--fail-above",
            "--quiet",
            "--verbose",
            "--debug",
        )
    },
}
UNTANGLE = {
    "--boundary": ["project"],
    "--feature-angle": ["40"],
    "--max-deviation": ["0.1"],
    "--fix": ["1"],
    "--time-limit": ["5.5"],
    "--report": ["{folder}/r.csv"],
    "--plot": ["{folder}/p.svg"],
    "--quality-field": ["--output-format", "vtu"],
    "--no-report": [],
    "--regions": ["none"],
    "--shape": ["input"],
    "--metric": ["{folder}/m.sol"],
    "--straighten": [],
    "--input-format": ["gmsh"],
    "--output-format": ["vtk"],
    "--measure": ["aspect-ratio", "--quality-field", "--output-format", "vtu"],
    "--fail-below": ["-1"],
    "--fail-above": ["aspect-ratio=1e9"],
    "--quiet": [],
    "--debug": [],
}
QUALITY = {
    "--regions": ["none"],
    "--metric": ["{folder}/m.sol"],
    "--json": [],
    "--csv": [],
    "--plot": ["{folder}/p.png"],
    "--worst": ["3"],
    "--measure": ["min-angle"],
    "--fail-below": ["0.1"],
    "--fail-above": ["max-angle=179"],
    "--input-format": ["gmsh"],
    "--debug": [],
}
COMPARE = {
    "--json": [],
    "--plot": ["{folder}/c.pdf"],
    "--measure": ["skewness"],
    "--fail-below": ["-1"],
    "--fail-above": ["aspect-ratio=1e9"],
    "--regions": ["none"],
    "--metric": ["{folder}/m.sol"],
    "--input-format": ["gmsh"],
    "--debug": [],
}


@pytest.mark.parametrize(
    ("command", "options"),
    [
        pytest.param("smooth", SMOOTH, id="smooth"),
        pytest.param("untangle", UNTANGLE, id="untangle", marks=pytest.mark.long),
        pytest.param("morph", MORPH, id="morph", marks=pytest.mark.long),
        pytest.param("report quality", QUALITY, id="quality"),
        pytest.param("report compare", COMPARE, id="compare", marks=pytest.mark.long),
    ],
)
def test_every_option_in_the_help_works(dvr, tmp_path, command, options):
    tags = [np.ones(4, dtype=int)]
    source = fan(tmp_path / "in.msh", cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags})
    (tmp_path / "v.txt").write_text("4\n")
    np.savetxt(tmp_path / "d.csv", np.zeros((5, 3)), delimiter=",")
    metric = "MeshVersionFormatted 2 Dimension 2 SolAtVertices 5 1 3" + 5 * " 4 1 1" + " End"
    (tmp_path / "m.sol").write_text(metric)
    paths = {
        "smooth": [source, tmp_path / "out.msh"],
        "untangle": [source, tmp_path / "out.msh"],
        "morph": [source, tmp_path / "out.msh", "--displacement", tmp_path / "d.csv"],
        "report quality": [source],
        "report compare": [source, source],
    }[command]
    text = dvr(*command.split(), "--help").out
    # --mesh is for files with several meshes, see the tests of MED; --mpi for jobs, see test_ranks;
    # --geometry needs a model, see test_cli_geometry
    known = {*options, "--help", "--mesh", *(["--mpi", "--geometry"] if command == "smooth" else [])}
    assert set(re.findall(r"^  (?:-\w, )?(--[\w-]+)", text, flags=re.MULTILINE)) == known
    for option, values in options.items():
        values = [value.format(folder=tmp_path) for value in values]
        result = dvr(*command.split(), option, *values, *paths)
        assert result.code == 0, (option, result.err)


def test_a_mesh_cannot_be_chosen_where_there_is_one_only(dvr, tmp_path):
    result = dvr("smooth", fan(tmp_path / "in.msh"), tmp_path / "out.msh", "--mesh", "a")
    assert_one_line(result, 3, "in.msh", "--mesh")
    assert not (tmp_path / "out.msh").exists()


def test_the_orders_are_those_of_the_schedule(dvr, tmp_path):
    for order in ORDERS:
        result = dvr("smooth", fan(tmp_path / "in.msh"), tmp_path / "out.msh", "--order", order)
        assert result.code == 0
    assert "|".join(ORDERS) in dvr("smooth", "--help").out


def test_the_treatments_of_the_boundary_are_those_of_the_options(dvr, tmp_path):
    for boundary in BOUNDARIES:
        result = dvr("smooth", fan(tmp_path / "in.msh"), tmp_path / "out.msh", "--boundary", boundary)
        assert result.code == 0
    assert "|".join(BOUNDARIES) in dvr("smooth", "--help").out


def test_the_version(dvr):
    for arguments in (["--version"], ["--version", "smooth"]):
        result = dvr(*arguments)
        assert (result.code, result.out, result.err) == (0, f"dvr {dvr_cli.__version__}\n", "")


@pytest.mark.parametrize(
    ("arguments", "unwanted"),
    [
        (["--version"], {"numpy", "meshio", "rich", "trimesh", "typer"}),
        (["smooth", "--help"], {"numpy", "meshio", "rich", "trimesh"}),
        (["smooth", "--frobnicate"], {"numpy", "meshio", "rich", "trimesh"}),
    ],
)
def test_what_is_not_imported(arguments, unwanted):
    program = (
        "import sys; from dvr_cli.cli.main import main; main(sys.argv[1:]);"
        "print('imported', *sorted({name.split('.')[0] for name in sys.modules}))"
    )
    run = subprocess.run(
        [sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=True, timeout=600
    )
    imported = set(run.stdout.splitlines()[-1].split())
    assert "dvr_cli" in imported
    assert not unwanted & imported
