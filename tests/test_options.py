"""The table of options: a row is enough for a command, the Python API's checks and the record in reports."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import fields

import pytest
import typer

import dvr_cli
from dvr_cli import options
from dvr_cli.api.options import SmoothOptions
from dvr_cli.cli.options import takes_options
from dvr_cli.errors import UsageError
from dvr_cli.options import OPTIONS, TABLE
from dvr_cli.options.record import COUNT, QUALITY, Option, Values
from dvr_cli.relax.stopping import Stopping
from meshes import random_mesh


def test_a_new_row_is_an_option_of_its_command(monkeypatch, capsys):
    values = Values(float, 0, 2, must="be from 0 to 2")
    row = Option("strength", values, 1.0, "How strongly.", ("smooth",), "S")
    monkeypatch.setattr("dvr_cli.cli.options.TABLE", (*TABLE, row))
    seen = {}

    @takes_options("smooth")
    def command(**given) -> int:
        seen.update(given)
        return 0

    app = typer.Typer(rich_markup_mode=None)
    app.command()(command)
    app(["--strength", "1.5"], standalone_mode=False)
    assert seen["strength"] == 1.5
    assert seen["order"] == "coloured"
    with pytest.raises(Exception, match=r"'3' is not a number from 0 to 2"):
        app(["--strength", "3"], standalone_mode=False)
    app(["--help"], standalone_mode=False)
    assert "How strongly." in capsys.readouterr().out
    with pytest.raises(UsageError, match="strength: must be from 0 to 2"):
        row.check(2.5)
    assert row.record(1) == 1.0


def test_fields_of_smoothing_are_rows_and_rows_are_fields():
    known = {each.name for of in (SmoothOptions, Stopping) for each in fields(of)} - {"stopping"}
    recorded = {option.name for option in TABLE if option.recorded}
    assert recorded <= known <= set(OPTIONS)
    assert set(SmoothOptions().record()) == recorded


@pytest.mark.parametrize("of", [SmoothOptions, Stopping], ids=lambda of: of.__name__)
def test_defaults_are_those_of_the_table(of):
    made = of()
    for each in fields(of):
        if each.name != "stopping":
            assert getattr(made, each.name) == OPTIONS[each.name].default


@pytest.mark.parametrize("row", [row for row in TABLE if row.values.must], ids=lambda row: row.name)
def test_bounds_hold_in_python_as_on_the_command_line(row):
    values = row.values
    for bound, step in ((values.low, -1), (values.high, 1)):
        if abs(bound) < float("inf"):
            row.check(bound)
            with pytest.raises(UsageError, match=re.escape(f"{row.label}: must {values.must}")):
                row.check(bound + step)
    with pytest.raises(UsageError):
        row.check("much")
    with pytest.raises(UsageError):
        row.check(float("nan"))


def test_a_mistyped_option_is_told_the_nearest_one():
    mesh = random_mesh("triangle", 0)
    cells = [(block.type, block.vertices) for block in mesh.cells]
    with pytest.raises(UsageError, match="unknown option 'max_iteration'; did you mean 'max_iterations'"):
        dvr_cli.smooth(mesh.points, cells, max_iteration=3)
    with pytest.raises(UsageError, match="unknown option 'boundary'"):
        dvr_cli.Relaxer(mesh.points, cells, boundary="slide")


def test_the_table_loads_no_numpy():
    code = "import sys, dvr_cli.options; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_names_are_told_where_only_some_are_known():
    with pytest.raises(UsageError, match="order: unknown 'random'; known: coloured, natural, shuffled"):
        SmoothOptions(order="random")
    assert OPTIONS["boundary"].of("untangle").values.names == ("fixed", "slide", "project")
    assert options.default("directions", "morph") == "random"
    assert COUNT.low == 0
    assert (QUALITY.low, QUALITY.high) == (-1, 1)
