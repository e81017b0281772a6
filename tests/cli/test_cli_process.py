"""``dvr`` as a process of its own: streams, terminals, signals, and failures of its own."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import dvr_cli
from cli_support import DVR, assert_one_line, fan, listing, points_of, read_json
from dvr_cli.cli.interrupt import Interrupt


@pytest.fixture(autouse=True)
def interruptible():
    """A test run in the background of a shell is born with SIGINT ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


posix = pytest.mark.skipif(sys.platform == "win32", reason="signals and terminals of POSIX")


def run(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [DVR, *map(str, arguments)], capture_output=True, text=True, check=False, timeout=600, **options
    )


def test_the_command(tmp_path):
    result = run("--version")
    assert (result.returncode, result.stdout, result.stderr) == (0, f"dvr {dvr_cli.__version__}\n", "")
    source, output = fan(tmp_path / "in.msh"), tmp_path / "out.msh"
    result = run("smooth", source, output)
    assert (result.returncode, result.stdout) == (0, "")
    assert "\r" not in result.stderr  # no progress where stderr is no terminal
    result = run("report", "quality", output, "--json")
    assert (result.returncode, result.stderr) == (0, "")
    assert read_json(result.stdout)["schema"] == "dvr.quality/1"
    result = run("smooth", tmp_path / "missing.msh", output)
    assert (result.returncode, result.stdout) == (3, "")
    assert result.stderr == f"dvr: error: {tmp_path / 'missing.msh'}: no such file\n"


def test_a_pipe_carries_the_mesh_and_nothing_else(dvr, tmp_path):
    source, output = fan(tmp_path / "in.vtk"), tmp_path / "out.vtk"
    assert dvr("smooth", source, output, "--no-report").code == 0
    before = listing(tmp_path)
    piped = subprocess.run(
        [DVR, "smooth", "-", "-", "-v"],
        input=source.read_bytes(),
        capture_output=True,
        check=False,
        timeout=600,
        cwd=tmp_path,
    )
    assert piped.returncode == 0
    assert piped.stdout == output.read_bytes()
    assert piped.stderr.startswith(b"sweep   1 ")
    assert listing(tmp_path) == before


def test_the_module_is_the_command(tmp_path):
    module = subprocess.run(
        [sys.executable, "-m", "dvr_cli", "smooth"], capture_output=True, text=True, check=False, timeout=600
    )
    command = run("smooth")
    assert (module.returncode, module.stderr) == (command.returncode, command.stderr)


def on_a_terminal(stream: str, *arguments: object, **variables: str) -> str:
    """What ``dvr`` shows on a terminal that its ``stream`` ("stdout" or "stderr") is connected to."""
    ours, theirs = os.openpty()
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8", **variables}
    with subprocess.Popen([DVR, *map(str, arguments)], env=environment, **{stream: theirs}) as process:
        os.close(theirs)
        text = b""
        with contextlib.suppress(OSError):  # raised when the other end is closed
            while part := os.read(ours, 4096):
                text += part
        os.close(ours)
        assert process.wait(600) == 0
    return text.decode().replace("\r\n", "\n")


@posix
def test_progress_on_a_terminal(tmp_path):
    """The line is rewritten, never longer than the terminal is wide, and wiped before the summary."""
    source, begin, wipe = fan(tmp_path / "in.msh"), "\x1b[?25l", "\x1b[?25h\r\x1b[1A\x1b[2K"
    for columns in (30, 80):
        variables = {"TERM": "xterm", "COLUMNS": str(columns), "NO_COLOR": "1"}
        shown = on_a_terminal("stderr", "smooth", source, tmp_path / "out.msh", **variables)
        progress, summary = shown.removeprefix(begin).split(wipe)
        lines = [re.sub("\x1b\\[[0-9;]*[mK]", "", line) for line in progress.removesuffix("\n").split("\r")]
        assert all(len(line) <= columns for line in lines)
        assert any("  sweep 1  Q1 " in line for line in lines)
        assert not any("\n" in line for line in lines)
        assert summary.startswith(f"{source} -> ")
        assert ("below care" in progress) == (columns == 80)


@posix
def test_quiet_on_a_terminal(tmp_path):
    source = fan(tmp_path / "in.msh")
    assert on_a_terminal("stderr", "smooth", source, tmp_path / "out.msh", "--quiet") == ""


@posix
def test_bars_are_blocks_only_on_a_terminal(tmp_path):
    path = fan(tmp_path / "in.msh")
    shown = on_a_terminal("stdout", "report", "quality", path)
    piped = run("report", "quality", path, env={**os.environ, "PYTHONIOENCODING": "utf-8"}).stdout
    assert "█" in shown
    assert "#" not in shown
    assert piped.isascii()
    assert "\nQ1\t0.20" in piped


@posix
@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_terminal_without_blocks(tmp_path, encoding):
    path = fan(tmp_path / "in.msh")
    shown = on_a_terminal("stdout", "report", "quality", path, PYTHONIOENCODING=encoding, COLUMNS="40")
    assert shown.isascii()
    assert " 1  ####" in shown
    assert max(map(len, shown.splitlines()[1:])) <= 40


@posix
def test_the_summary_on_a_narrow_terminal(tmp_path):
    shown = on_a_terminal(
        "stderr", "smooth", fan(tmp_path / "in.msh"), tmp_path / "out.msh", "--no-report", COLUMNS="40"
    )
    lines = shown.rsplit("\r", 1)[1].splitlines()
    assert max(map(len, lines[1:])) <= 40


@pytest.mark.parametrize("variable", [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0"}])
def test_a_pipe_of_ascii(tmp_path, variable):
    path = fan(tmp_path / "größe.msh")
    for command in (["quality", path], ["compare", path, path]):
        result = run("report", *command, env={**os.environ, **variable})
        assert (result.returncode, result.stderr) == (0, "")
        assert result.stdout.isascii()
        assert "gr" in result.stdout


@posix
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_has_the_mesh_reached_written(dvr, tmp_path, cube, sent):
    output = tmp_path / "out.vtk"
    endless = ["-v", "--tol", "0", "-n", "1000000", "-d", "random", "--engine", "numpy"]
    process = subprocess.Popen(
        [DVR, "smooth", cube, output, *endless],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # it may be ignored in processes started in the background
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        assert process.stderr.readline().startswith("sweep   1 ")
        process.send_signal(sent)
        out, err = process.communicate(timeout=600)
    finally:
        process.kill()
    assert (process.returncode, out) == (130, "")
    assert "interrupted" in err
    assert "Traceback" not in err
    record = read_json((tmp_path / "out.quality.json").read_text())
    assert record["stopped_because"] == "interrupted"
    assert record["after"]["q1"] > record["before"]["q1"]
    assert len(points_of(output)) == record["mesh"]["points"]
    assert {path.name for path in tmp_path.iterdir()} == {"out.vtk", "out.quality.json"}
    assert dvr("report", "compare", cube, output).code == 0


@posix
def test_the_second_ctrl_c_leaves_at_once(dvr, tmp_path, monkeypatch):
    def relax_while_the_user_is_impatient(*_: object, **__: object) -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        raise AssertionError("still here")

    monkeypatch.setattr("dvr_cli.api.smoothing.smooth_mesh", relax_while_the_user_is_impatient)
    source = fan(tmp_path / "in.msh")
    before = listing(tmp_path)
    result = dvr("smooth", source, tmp_path / "out.msh")
    assert (result.code, result.out, result.err) == (130, "", "dvr: interrupted\n")
    assert listing(tmp_path) == before


@posix
def test_what_a_signal_does_is_restored():
    before = signal.getsignal(signal.SIGINT)
    with Interrupt() as interrupt:
        assert not interrupt.requested
        signal.raise_signal(signal.SIGINT)
        assert interrupt.requested
    assert signal.getsignal(signal.SIGINT) is before


@posix
def test_an_ignored_signal_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with Interrupt() as interrupt:
            signal.raise_signal(signal.SIGINT)
        assert not interrupt.requested
    finally:
        signal.signal(signal.SIGINT, before)


@posix
def test_a_reader_that_goes_away(tmp_path, cube):
    reading, writing = os.pipe()
    os.close(reading)
    process = subprocess.run(
        [DVR, "report", "quality", cube, "--csv"],
        stdout=writing,
        stderr=subprocess.PIPE,
        check=False,
        timeout=600,
    )
    os.close(writing)
    assert (process.returncode, process.stderr) == (4, b"")


@posix
def test_a_listener_that_goes_away_does_not_stop_the_work(tmp_path):
    source, output = fan(tmp_path / "in.msh"), tmp_path / "out.msh"
    reading, writing = os.pipe()
    os.close(reading)
    process = subprocess.run(
        [DVR, "smooth", source, output, "-v"],
        stdout=subprocess.PIPE,
        stderr=writing,
        check=False,
        timeout=600,
    )
    os.close(writing)
    assert (process.returncode, process.stdout) == (0, b"")
    assert output.exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
@pytest.mark.parametrize("arguments", [["--version"], ["report", "quality"], ["smooth", "-q", "--no-report"]])
def test_standard_output_that_cannot_be_written(tmp_path, arguments):
    paths = [fan(tmp_path / "in.msh")] if len(arguments) > 1 else []
    paths += ["-"] if "smooth" in arguments else []
    with Path("/dev/full").open("w") as full:
        process = subprocess.run(
            [DVR, *arguments, *paths],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            timeout=600,
        )
    assert process.returncode == 4
    assert process.stderr.startswith("dvr: error: standard output: ")
    assert process.stderr.count("\n") == 1


def test_a_defect_is_one_line_too(dvr, tmp_path, monkeypatch):
    def fail(*_: object) -> None:
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr("dvr_cli.api.measuring.mesh_quality", fail)
    path = fan(tmp_path / "in.msh")
    result = dvr("report", "quality", path)
    assert result.code == 1
    assert result.err.startswith("dvr: internal error: ZeroDivisionError: a defect ")
    assert result.err.count("\n") == 1
    assert "--debug" in result.err
    result = dvr("report", "quality", path, "--debug")
    assert result.code == 1
    assert "Traceback (most recent call last)" in result.err


def test_debug_shows_where_an_error_comes_from(dvr, tmp_path):
    missing = tmp_path / "missing.msh"
    assert_one_line(dvr("report", "quality", missing), 3)
    result = dvr("report", "quality", missing, "--debug")
    assert result.code == 3
    assert "Traceback" in result.err
    assert result.err.splitlines()[-1] == f"dvr: error: {missing}: no such file"
