"""``--plot``, reports in HTML and ``--quality-field``: what is written, and what is refused."""

from __future__ import annotations

import importlib.util
import itertools
import os
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest

import dvr_cli
from cli_support import FAN, assert_one_line, fan, listing, read_json, write
from dvr_cli.files.reading import open_mesh

MAGIC = {".svg": b"<?xml", ".png": b"\x89PNG", ".pdf": b"%PDF", ".html": b"<!DOCTYPE html>"}


COMMANDS = {
    "smooth": ["smooth", "in.msh", "out.msh"],
    "quality": ["report", "quality", "in.msh"],
    "compare": ["report", "compare", "in.msh", "other.msh"],
}
USUAL = {
    ("smooth", ".svg"),
    ("quality", ".png"),
    ("compare", ".pdf"),
    ("smooth", ".html"),
    ("compare", ".html"),
}


@pytest.mark.parametrize(
    ("name", "suffix"),
    [
        pytest.param(*pair, marks=[] if pair in USUAL else pytest.mark.long)
        for pair in itertools.product(COMMANDS, MAGIC)
    ],
)
def test_pictures_of_all_commands(dvr, tmp_path, monkeypatch, name, suffix):
    monkeypatch.chdir(tmp_path)
    fan(Path("in.msh"))
    fan(Path("other.msh"), 0.7, 0.6)
    plot = Path(f"{name}{suffix}")
    without = dvr(*COMMANDS[name])
    result = dvr(*COMMANDS[name], "--plot", plot)
    assert (result.code, result.out) == (0, without.out)
    assert plot.read_bytes().startswith(MAGIC[suffix])
    assert (f"picture: {plot}\n" in result.err) == (name == "smooth")


@pytest.mark.filterwarnings("error")
def test_names_that_mean_something_to_matplotlib(dvr, tmp_path):
    sources = [
        fan(tmp_path / name) for name in ("_a.msh", "$b^$.msh", "$c\\d$.msh", "格子.msh", "l" * 60 + ".msh")
    ]
    plot = tmp_path / "p.svg"
    assert dvr("report", "compare", *sources, "--plot", plot).code == 0
    assert dvr("report", "quality", sources[2], "--plot", plot).code == 0


def test_the_mean_over_the_sweeps_is_in_the_report_of_a_run_that_draws(dvr, tmp_path):
    source, output = fan(tmp_path / "in.msh"), tmp_path / "out.msh"
    dvr("smooth", source, output, "--plot", tmp_path / "p.svg")
    record = read_json((tmp_path / "out.quality.json").read_text())
    assert record["sweeps"][-1]["elements_mean"] == record["after"]["mean"]


@pytest.mark.parametrize(
    ("command", "option", "name"),
    [
        ("quality", "--plot", "p.gif"),
        ("quality", "--plot", "p"),
        ("compare", "--plot", "p.txt"),
        ("smooth", "--plot", "p.json"),
        ("smooth", "--report", "p.svg"),
    ],
)
def test_unknown_suffixes(dvr, tmp_path, command, option, name):
    source = fan(tmp_path / "in.msh")
    arguments = {
        "quality": ["report", "quality", source],
        "compare": ["report", "compare", source, source],
        "smooth": ["smooth", source, tmp_path / "out.msh"],
    }[command]
    before = listing(tmp_path)
    assert_one_line(dvr(*arguments, option, tmp_path / name), 2, name, "known: ")
    assert listing(tmp_path) == before


def test_a_picture_in_the_place_of_another_file(dvr, tmp_path):
    source, page = fan(tmp_path / "in.msh"), tmp_path / "p.html"
    os.link(source, page)
    assert dvr("report", "quality", source, "--plot", tmp_path / "none" / "p.svg").code == 4
    result = dvr("smooth", source, tmp_path / "out.msh", "--report", page, "--plot", page)
    assert_one_line(result, 2, "p.html", "overwrite")
    (tmp_path / "in.svg").symlink_to(source)
    assert_one_line(dvr("report", "quality", source, "--plot", tmp_path / "in.svg"), 2, "overwrite")


@pytest.mark.parametrize("option", ["--plot", "--report"])
def test_matplotlib_missing(dvr, tmp_path, monkeypatch, option):
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "matplotlib" else find_spec(name)
    )
    source = fan(tmp_path / "in.msh")
    before = listing(tmp_path)
    result = dvr("smooth", source, tmp_path / "out.msh", option, tmp_path / "p.html")
    assert_one_line(result, 2, "p.html", "pip install 'dvr-cli[plot]'")
    assert listing(tmp_path) == before


def test_no_picture_code_unless_asked_for(tmp_path):
    source = fan(tmp_path / "in.msh")
    program = (
        "import sys; from dvr_cli.cli.main import main\n"
        "for line in sys.argv[1:]: assert main(line.split()) == 0\n"
        "print('imported', *sys.modules)"
    )
    runs = [
        f"smooth {source} {tmp_path}/out.vtu --quality-field",
        f"report quality {source}",
        f"report quality {source} --json",
        f"report compare {source} {tmp_path}/out.vtu",
    ]

    def imported(*lines):
        run = subprocess.run(
            [sys.executable, "-c", program, *lines], capture_output=True, text=True, check=True, timeout=600
        )
        return set(run.stdout.splitlines()[-1].split())

    code = {"matplotlib", "dvr_cli.report.picture", "dvr_cli.report.plot", "dvr_cli.report.render"}
    page = {"dvr_cli.report.view"}
    assert not (code | page) & imported(*runs)
    drawn = imported(f"{runs[1]} --plot {tmp_path}/p.png")
    assert code <= drawn
    assert not page & drawn


# --------------------------------------------------------------------------------------------- the field


@pytest.mark.parametrize("name", ["out.vtu", "out.vtk"])
def test_the_quality_of_each_cell_as_a_field(dvr, tmp_path, name):
    """Cells of lower dimension come first, and have none."""
    source = write(
        tmp_path / "in.msh",
        [[0, 0], [1, 0], [1, 1], [0, 1], [0.8, 0.9]],
        {"line": [[0, 1], [1, 2]], "triangle": FAN},
    )
    output = tmp_path / name
    assert dvr("smooth", source, output, "--quality-field", "-n", "2").code == 0
    mesh = open_mesh(output).mesh
    lines, triangles = mesh.cell_data["quality"]
    assert np.isnan(lines).all()
    expected = dvr_cli.quality_report(mesh.points, [(b.type, b.vertices) for b in mesh.cells])
    assert triangles.tolist() == expected.quality.elements.tolist()
    record = read_json((tmp_path / "out.quality.json").read_text())
    assert triangles.min() == record["after"]["min"]


def test_the_field_of_a_file_that_meshio_writes_again(dvr, tmp_path):
    once, twice = tmp_path / "once.vtu", tmp_path / "twice.vtu"
    dvr("smooth", fan(tmp_path / "in.msh"), once, "-d", "random", "-n", "1", "--quality-field")
    assert dvr("smooth", once, twice, "-n", "9", "--quality-field").code == 0
    (before,), (after,) = (meshio.read(path).cell_data["quality"] for path in (once, twice))
    assert after.min() > before.min()


@pytest.mark.parametrize(("name", "word"), [("out.msh", "gmsh"), ("out.off", "off")])
def test_formats_without_a_place_for_the_field(dvr, tmp_path, name, word):
    source = fan(tmp_path / "in.msh")
    before = listing(tmp_path)
    assert_one_line(dvr("smooth", source, tmp_path / name, "--quality-field"), 2, name, word, ".vtu")
    assert listing(tmp_path) == before
