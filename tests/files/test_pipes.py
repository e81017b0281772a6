"""Pipes: of real processes, Gmsh, dvr and readers of what comes out; what bytes tell, in this process."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import meshio
import numpy as np
import pytest

from dvr_cli.cli.main import main
from dvr_cli.files.reading import open_mesh
from gmsh_corpus import account
from needs import require

SCRIPTS = Path(sysconfig.get_path("scripts"))
DVR = str(SCRIPTS / "dvr")
posix = pytest.mark.skipif(sys.platform == "win32", reason="pipes of POSIX")
long = pytest.mark.long  # the same again for another format
GEO = """
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 1, 1};
Mesh.MeshSizeMax = 0.4;
Physical Volume("solid", 7) = {1};
Physical Surface("walls", 3) = {1, 2};
"""


def run(*command: object, data: bytes | None = None, **options: object) -> subprocess.CompletedProcess[bytes]:
    """Run a process with ``data`` piped in."""
    return subprocess.run(
        [str(word) for word in command], input=data, capture_output=True, check=False, timeout=600, **options
    )


@pytest.fixture
def piped(monkeypatch, capsysbinary):
    """Run ``dvr`` in this process with ``data`` on its standard input: exit code, stdout, stderr."""

    def run(data: bytes, *arguments: str) -> tuple[int, bytes, bytes]:
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        capsysbinary.readouterr()
        return main([*arguments]), *capsysbinary.readouterr()

    return run


def pipeline(*commands: list[object]) -> list[subprocess.CompletedProcess[bytes]]:
    """Run processes of which each reads what the one before writes."""
    processes: list[subprocess.Popen[bytes]] = []
    for command in commands:
        processes.append(
            subprocess.Popen(
                [str(word) for word in command],
                stdin=processes[-1].stdout if processes else subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
        )
        if len(processes) > 1:
            processes[-2].stdout.close()  # so that it learns when its reader goes away
            processes[-2].stdout = None
    results = []
    for process in reversed(processes):
        out, err = process.communicate(timeout=600)
        results.insert(0, subprocess.CompletedProcess(process.args, process.returncode, out, err))
    return results


@pytest.fixture
def generator(tmp_path: Path) -> list[object]:
    """The command by which Gmsh writes a mesh to its standard output; -v 0 keeps its talk out of that."""
    require("gmsh")
    (tmp_path / "part.geo").write_text(GEO)
    gmsh = SCRIPTS / "gmsh"
    return [sys.executable, gmsh, tmp_path / "part.geo", "-3", "-v", "0", "-o", "/dev/stdout"]


@posix
@pytest.mark.parametrize(
    ("version", "binary"),
    [
        pytest.param("msh22", [], id="msh22-ascii", marks=long),
        pytest.param("msh41", ["-bin"], id="msh41-binary"),
        pytest.param("msh22", ["-bin"], id="msh22-binary", marks=long),
        pytest.param("msh41", [], id="msh41-ascii", marks=long),
    ],
)
def test_from_gmsh_through_dvr_to_a_file(generator, version, binary):
    generated = run(*generator, "-format", version, *binary)
    assert generated.returncode == 0, generated.stderr
    *_, smoothed = pipeline([*generator, "-format", version, *binary], [DVR, "smooth", "-", "-", "-n", "2"])
    assert smoothed.returncode == 0, smoothed.stderr
    before, after = account(generated.stdout), account(smoothed.stdout)
    assert after.complaints == []
    for what in ("elements", "entities", "groups", "elements_of"):
        assert getattr(after, what) == getattr(before, what)
    assert set(after.groups) == {(3, 7), (2, 3)}
    assert after.nodes.keys() == before.nodes.keys()
    assert after.nodes != before.nodes


@posix
def test_from_gmsh_through_dvr_twice(generator):
    *_, measured = pipeline(
        [*generator, "-format", "msh41", "-bin"],
        [DVR, "smooth", "-", "-", "--quiet", "-n", "2"],
        [DVR, "report", "quality", "-"],
    )
    assert (measured.returncode, measured.stderr) == (0, b"")
    assert b"inverted" in measured.stdout


@posix
def test_gmsh_reads_from_the_pipe(generator, tmp_path):
    """Gmsh opens files by name only, so its end of the pipe is a named one or /dev/stdin."""
    script = "import sys, gmsh; gmsh.initialize(); gmsh.option.setNumber('General.Terminal', 0);"
    script += "gmsh.merge(sys.argv[1]); print(len(gmsh.model.mesh.getNodes()[0]))"
    kept = tmp_path / "kept.msh"
    reader = "import sys; data = sys.stdin.buffer.read(); open(sys.argv[1], 'wb').write(data)"
    *_, last = pipeline(
        [*generator, "-format", "msh41", "-bin"],
        [DVR, "smooth", "-", "-", "-q", "-n", "2"],
        [sys.executable, "-c", reader, kept],
    )
    assert last.returncode == 0
    opened = run(sys.executable, "-c", script, kept)
    assert int(opened.stdout) == len(open_mesh(kept).mesh.points)


# ------------------------------------------------------------------------------------------------ formats

CORNERS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.8, 0.9, 0.0]]
FAN = meshio.Mesh(np.array(CORNERS), {"triangle": [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]})
SNIFFED = {
    "gmsh22": ("gmsh22", {"binary": False}),
    "gmsh22-binary": ("gmsh22", {"binary": True}),
    "gmsh41": ("gmsh", {"binary": False}),
    "gmsh41-binary": ("gmsh", {"binary": True}),
    "vtk": ("vtk42", {"binary": False}),
    "vtk-binary": ("vtk", {"binary": True}),
    "vtu": ("vtu", {}),
    "vtu-ascii": ("vtu", {"binary": False}),
    "obj": ("obj", {}),
    "medit": ("medit", {}),
    "off": ("off", {}),
    "ply": ("ply", {"binary": False}),
    "ply-binary": ("ply", {"binary": True}),
}
SUFFIXES = {
    "gmsh": "msh",
    "vtk": "vtk",
    "vtu": "vtu",
    "obj": "obj",
    "medit": "mesh",
    "off": "off",
    "ply": "ply",
}


def format_of(name: str) -> str:
    return next(known for known in SUFFIXES if name.startswith(known))


def fan(path: Path, name: str) -> bytes:
    file_format, options = SNIFFED[name]
    meshio.write(path, FAN, file_format=file_format, **options)
    return path.read_bytes()


@pytest.mark.parametrize("name", SNIFFED)
def test_the_format_is_told_by_the_bytes_and_kept(tmp_path, monkeypatch, piped, name):
    data = fan(tmp_path / "mesh", name)
    monkeypatch.chdir(tmp_path)
    code, out, err = piped(data, "smooth", "-", "-", "-d", "axis")
    assert code == 0, err
    assert {path.name for path in tmp_path.iterdir()} == {"mesh"}
    path = tmp_path / f"out.{SUFFIXES[format_of(name)]}"
    path.write_bytes(out)
    np.testing.assert_allclose(open_mesh(path).mesh.points[4], [0.5, 0.5, 0.0], atol=0.01)


@pytest.mark.parametrize("name", ["gmsh41-binary", "vtk", "vtu", "obj", "medit", "off", "ply"])
def test_the_format_of_the_output_can_be_named(tmp_path, piped, name):
    data, wanted = fan(tmp_path / "mesh", "gmsh22"), format_of(name)
    formats = ["--input-format", "gmsh", "--output-format", wanted]
    code, out, err = piped(data, "smooth", "-", "-", "-q", *formats)
    assert (code, err) == (0, b"")
    path = tmp_path / f"out.{SUFFIXES[wanted]}"
    path.write_bytes(out)
    assert len(open_mesh(path).mesh.points) == 5


def test_a_format_that_bytes_do_not_tell_has_to_be_named(piped):
    """The numbers of an AFLR3 file could be anything's; SU2 has keywords."""
    numbers = b"4 0 0 1 0 0 0\n0 0 0 1 0 0 0 1 0 0 0 1\n1 2 3 4\n"
    code, out, err = piped(numbers, "report", "quality", "-")
    assert (code, out) == (3, b"")
    assert err.startswith(b"dvr: error: standard input: neither its suffix nor its first bytes")
    data = b"NDIME= 2\nNELEM= 1\n9 0 1 2 3 0\nNPOIN= 4\n0 0 0\n1 0 1\n1 1 2\n0 1 3\nNMARK= 0\n"
    assert piped(data, "report", "quality", "-")[0] == 0
    assert piped(data, "report", "quality", "-", "--input-format", "su2")[0] == 0


@posix
@pytest.mark.parametrize(
    "name", ["gmsh41-binary", *(pytest.param(name, marks=long) for name in ("vtk", "vtu", "medit"))]
)
def test_a_pipe_that_has_a_name(tmp_path, piped, name):
    """As a shell's <(...) and >(...), or /dev/stdin and /dev/stdout."""
    data = fan(tmp_path / "mesh", name)
    _, expected, _ = piped(data, "smooth", "-", "-")
    assert expected
    assert run(DVR, "smooth", "/dev/stdin", "/dev/stdout", "-q", data=data).stdout == expected
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen([DVR, "smooth", str(pipe), "-", "-q"], stdout=subprocess.PIPE) as process:
        pipe.write_bytes(data)
        assert process.communicate(timeout=600)[0] == expected
    with subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE) as reader:
        assert run(DVR, "smooth", tmp_path / "mesh", pipe, "--input-format", format_of(name)).returncode == 0
        assert reader.communicate(timeout=600)[0] == expected
    assert {path.name for path in tmp_path.iterdir()} == {"mesh", "pipe"}


@posix
def test_standard_output_by_name_that_is_a_file(tmp_path, piped):
    """What stood in front of the mesh in that file is the shell's business; no report is left in /dev."""
    data = fan(tmp_path / "mesh", "gmsh22")
    with (tmp_path / "out.msh").open("wb") as file:
        command = [DVR, "smooth", str(tmp_path / "mesh"), "/dev/stdout", "-q", "--input-format", "gmsh"]
        assert subprocess.run(command, stdout=file, check=False, timeout=600).returncode == 0
    assert (tmp_path / "out.msh").read_bytes() == piped(data, "smooth", "-", "-")[1]
    assert not Path("/dev/stdout.quality.json").exists()


# ------------------------------------------------------------------------------------------------- trouble


@pytest.mark.parametrize("data", [b"", b"\n \n"])
@pytest.mark.parametrize("arguments", [["smooth", "-", "-"], ["report", "quality", "-"]])
def test_empty_input_is_an_error(piped, data, arguments):
    code, out, err = piped(data, *arguments)
    assert (code, out) == (3, b"")
    assert re.fullmatch(rb"dvr: error: standard input: .*\n", err)


def test_a_generator_that_fails_leaves_no_output(tmp_path):
    """It is the pipe's reader that has to notice."""
    failing = [sys.executable, "-c", "import sys; print('$MeshFormat\\n4.1 0 8'); sys.exit(1)"]
    _, smoothed = pipeline(failing, [DVR, "smooth", "-", tmp_path / "out.msh"])
    assert (smoothed.returncode, smoothed.stdout) == (3, b"")
    assert re.fullmatch(rb"dvr: error: standard input: .*\n", smoothed.stderr)
    assert list(tmp_path.iterdir()) == []


@posix
@pytest.mark.parametrize("unbuffered", ["", pytest.param("1", marks=long)])
@pytest.mark.parametrize(
    "name", ["gmsh41-binary", *(pytest.param(name, marks=long) for name in ("vtk-binary", "ply-binary"))]
)
def test_a_reader_that_has_seen_enough_ends_it_quietly(tmp_path, name, unbuffered, monkeypatch):
    """The mesh is larger than a pipe holds."""
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)  # then Python leaves it to us to write all of it
    points, triangles = square(180)
    file_format, options = SNIFFED[name]
    meshio.write(tmp_path / "mesh", meshio.Mesh(points, {"triangle": triangles}), file_format, **options)
    assert (tmp_path / "mesh").stat().st_size > 1 << 20
    smooth = [DVR, "smooth", tmp_path / "mesh", "-", "-q", "-n", "0", "--input-format", format_of(name)]
    writer, reader = pipeline(smooth, [sys.executable, "-c", "import os; print(len(os.read(0, 10)))"])
    assert reader.stdout.strip() == b"10"
    assert writer.stderr == b""
    assert writer.returncode == 4


def square(n: int) -> tuple[np.ndarray, np.ndarray]:
    """The points and triangles of a square of n × n boxes, each cut in two."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    halves = [np.column_stack([a, a + 1, a + n + 2]), np.column_stack([a, a + n + 2, a + n + 1])]
    return points, np.concatenate(halves)


@posix
def test_a_mesh_is_not_typed_in_or_shown_on_a_terminal(tmp_path):
    ours, theirs = os.openpty()
    try:
        typed = subprocess.run(
            [DVR, "smooth", "-", "-"], stdin=theirs, capture_output=True, check=False, timeout=600
        )
        shown = subprocess.run(
            [DVR, "smooth", "-", "-"],
            input=fan(tmp_path / "mesh", "gmsh22"),
            stdout=theirs,
            stderr=subprocess.PIPE,
            check=False,
            timeout=600,
        )
    finally:
        os.close(ours)
        os.close(theirs)
    assert (typed.returncode, typed.stdout) == (3, b"")
    assert typed.stderr == b"dvr: error: standard input: a mesh has to be piped in\n"
    assert shown.returncode == 4
    assert re.fullmatch(rb"dvr: error: standard output is a terminal.*\n", shown.stderr)


@posix
@pytest.mark.parametrize("closed", [0, 1])
def test_streams_that_are_closed(tmp_path, closed):
    data = fan(tmp_path / "mesh", "gmsh22")
    command = f'"$0" smooth - - {"<&-" if closed == 0 else ">&-"}'
    process = run("sh", "-c", command, DVR, data=data)
    assert process.returncode == (3 if closed == 0 else 4)
    assert re.fullmatch(rb"dvr: error: standard (in|out)put.*\n", process.stderr)
