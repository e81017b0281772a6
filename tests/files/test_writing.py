"""Writing: atomic, in place, rounding said or refused, and what formats cannot keep said."""

from __future__ import annotations

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest

from dvr_cli.cli.main import main
from dvr_cli.errors import OutputError
from dvr_cli.files.formats import FORMATS, format_named
from dvr_cli.files.meshio_source import MeshioSource
from dvr_cli.files.reading import open_mesh
from dvr_cli.files.source import Source
from dvr_cli.files.writing import Output, write_text

CORNERS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
FAN = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
posix = pytest.mark.skipif(sys.platform == "win32", reason="limits and permissions of POSIX")
not_root = pytest.mark.skipif(hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may write anywhere")


def fan(path: Path, file_format: str = "gmsh22", scale: float = 1.0, shift: float = 0.0, **data) -> Path:
    """A square of four triangles around a vertex that is not in the middle."""
    points = scale * np.array([*CORNERS, [0.8, 0.9, 0.0]]) + [shift, shift, 0.0]
    meshio.write(path, meshio.Mesh(points, {"triangle": FAN}, **data), file_format=file_format)
    return path


def smooth(*arguments: object) -> int:
    return main(["smooth", *map(str, arguments), "--no-report"])


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


# ------------------------------------------------------------------------------------------------- atomic


class HalfWritten(Source):
    """A source whose writing fails half way."""

    def __init__(self, source: Source, error: BaseException) -> None:
        super().__init__()
        self.mesh, self.format, self.companions = source.mesh, source.format, source.companions  # type: ignore
        self._error = error

    def write(self, points, file):
        file.write(b"half of it")
        raise self._error


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError()])
@pytest.mark.parametrize("exists", [True, False])
def test_a_failure_while_writing_leaves_what_was_there(tmp_path, error, exists):
    source = open_mesh(fan(tmp_path / "in.msh"))
    (tmp_path / "in.msh").unlink()
    output = tmp_path / "out.msh"
    if exists:
        output.write_bytes(b"old")
    expected = OutputError if isinstance(error, OSError) else type(error)
    with pytest.raises(expected) as caught:
        Output(HalfWritten(source, error), output).write(source.mesh.points)
    if expected is OutputError:
        assert str(caught.value) == f"{output}: no space left on device"
    assert names(tmp_path) == ({"out.msh"} if exists else set())
    assert not exists or output.read_bytes() == b"old"


LIMITED = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # then writing fails as on a full disk
sys.dont_write_bytecode = True  # Python would keep modules cut off for all later runs
resource.setrlimit(resource.RLIMIT_FSIZE, (200, 200))
from dvr_cli.cli.main import main
print([main(line.split()) for line in sys.stdin.read().splitlines()])
"""


@posix
def test_a_full_disk(tmp_path, monkeypatch):
    """In place and into another file that is there, in three formats."""
    monkeypatch.chdir(tmp_path)
    lines = []
    for suffix, file_format in ((".msh", "gmsh22"), (".vtk", "vtk42"), (".vtu", "vtu")):
        source, output = fan(Path(f"in{suffix}"), file_format), Path(f"out{suffix}")
        assert source.stat().st_size > 200
        output.write_bytes(b"old")
        lines += [f"smooth {source} {source}", f"smooth {source} {output}"]
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    run = [sys.executable, "-c", LIMITED]
    process = subprocess.run(
        run, input="\n".join(lines), capture_output=True, text=True, check=False, timeout=600
    )
    assert (process.returncode, process.stdout) == (0, f"{[4] * 6}\n")
    errors = process.stderr.splitlines()
    assert len(errors) == 6
    for error, line in zip(errors, lines, strict=True):
        assert error.startswith(f"dvr: error: {line.split()[-1]}: ")
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_report_that_cannot_be_written_is_no_half_report(tmp_path, monkeypatch):
    def fail(descriptor: int) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OutputError, match="input/output error"):
        write_text(tmp_path / "report.json", "{}")
    assert names(tmp_path) == set()


# ------------------------------------------------------------------------------------- what is kept in place


def test_in_place_gives_what_another_file_gets(tmp_path):
    source, output = fan(tmp_path / "a.msh"), tmp_path / "b.msh"
    before = source.read_bytes()
    assert smooth(source, output) == 0
    assert smooth(source, source) == 0
    assert source.read_bytes() == output.read_bytes() != before


@posix
@pytest.mark.parametrize("mode", [0o600, 0o644, 0o664, 0o755, 0o444])
def test_permissions_of_a_replaced_file_are_kept(tmp_path, mode):
    source, output = fan(tmp_path / "in.msh"), tmp_path / "out.msh"
    output.touch()
    output.chmod(mode)
    assert smooth(source, output) == 0
    assert stat.S_IMODE(output.stat().st_mode) == mode
    assert output.stat().st_size > 0


@posix
@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_a_new_file_has_the_usual_permissions(tmp_path, mask):
    source = fan(tmp_path / "in.msh")
    old = os.umask(mask)
    try:
        assert smooth(source, tmp_path / "out.msh") == 0
        assert os.umask(mask) == mask
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "out.msh").stat().st_mode) == 0o666 & ~mask


@posix
def test_links_stay_links(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    real, link = fan(tmp_path / "elsewhere" / "real.msh"), tmp_path / "link.msh"
    before = real.read_bytes()
    link.symlink_to(Path("elsewhere") / "real.msh")
    assert smooth(link, link) == 0
    assert link.is_symlink()
    assert real.read_bytes() != before
    dangling = tmp_path / "dangling.msh"
    dangling.symlink_to("elsewhere/new.msh")
    assert smooth(real, dangling) == 0
    assert dangling.is_symlink()
    assert (tmp_path / "elsewhere" / "new.msh").is_file()
    assert names(tmp_path) == {"elsewhere", "link.msh", "dangling.msh"}


@posix
@not_root
def test_a_directory_that_may_not_be_written(tmp_path, capsys):
    folder = tmp_path / "folder"
    folder.mkdir()
    source = fan(folder / "in.msh")
    before = source.read_bytes()
    folder.chmod(0o555)
    try:
        assert smooth(source, source) == 4
    finally:
        folder.chmod(0o755)
    assert "no permission" in capsys.readouterr().err
    assert source.read_bytes() == before


@posix
def test_names_that_the_system_refuses(tmp_path, capsys):
    source = fan(tmp_path / "in.msh")
    circle = tmp_path / "circle.msh"
    circle.symlink_to("circle.msh")
    capsys.readouterr()
    for output in (tmp_path / ("a" * 300 + ".msh"), circle):
        assert smooth(source, output) == 4
        assert capsys.readouterr().err.startswith(f"dvr: error: {output}: ")
    assert smooth(circle, tmp_path / "out.msh") == 3
    assert names(tmp_path) == {"in.msh", "circle.msh"}


@pytest.mark.parametrize("name", ["with space", "日" * 80, "ünïcödé", "-n", "a.b.c", "'\"$;&"])
def test_names_of_all_sorts(tmp_path, name):
    source = fan(tmp_path / f"{name}.msh")
    assert main(["smooth", str(source), str(tmp_path / f"{name}.vtk"), "--quiet"]) == 0
    assert names(tmp_path) == {f"{name}.msh", f"{name}.vtk", f"{name}.quality.json"}


def test_the_report_goes_beside_the_output(tmp_path):
    source = fan(tmp_path / "in.msh")
    (tmp_path / "out").mkdir()
    for output, report in (("out/a.b.msh", "out/a.b.quality.json"), ("out/plain", "out/plain.quality.json")):
        arguments = [source, tmp_path / output, "--output-format", "gmsh", "--quiet"]
        assert main(["smooth", *map(str, arguments)]) == 0
        assert (tmp_path / report).is_file()
    assert names(tmp_path) == {"in.msh", "out"}


# ------------------------------------------------------------------------------------------------ rounding


def coarse(path: Path, step: float, dtype: type) -> Path:
    """Five triangles around one vertex near (1e4, 1e4), all vertices on a grid of width ``step``.

    The vertex is best (Q1 0.43) at about (1.3, 4.0) steps, where rounding puts it on a corner; it begins at a
    point of the grid where Q1 is 0.27.
    """
    steps = np.array([[2, 5], [1, 5], [1, 4], [1, 3], [3, 1], [2, 3]])
    points = np.pad(1e4 + steps * step, ((0, 0), (0, 1))).astype(dtype)
    triangles = np.array([[i, (i + 1) % 5, 5] for i in range(5)])
    meshio.write(path, meshio.Mesh(points, {"triangle": triangles}), file_format="vtk42")
    return path


def test_float32_that_would_lower_the_quality_is_widened(tmp_path, capsys):
    source = coarse(tmp_path / "in.vtk", float(np.spacing(np.float32(1e4))), np.float32)
    output = tmp_path / "out.vtk"
    assert b" float\n" in source.read_bytes()
    # heights here are a few steps of 32 bits, so that keeping them would leave no vertex to move
    assert smooth(source, output, "--tol", "0", "--no-keep-height") == 0
    assert "stored in 64 bits, as rounding them to 32 would lower the quality" in capsys.readouterr().err
    assert b" double\n" in output.read_bytes()
    assert main(["report", "compare", str(source), str(output)]) == 0
    moved = open_mesh(output).mesh.points
    assert (moved.astype(np.float32) != moved).any()


def test_float32_that_does_no_harm_stays(tmp_path, capsys):
    points = np.array([*CORNERS, [0.8, 0.9, 0.0]], dtype=np.float32)
    meshio.write(tmp_path / "in.vtk", meshio.Mesh(points, {"triangle": FAN}), file_format="vtk42")
    assert smooth(tmp_path / "in.vtk", tmp_path / "out.vtk") == 0
    assert "64 bits" not in capsys.readouterr().err
    assert b" float\n" in (tmp_path / "out.vtk").read_bytes()


def test_a_format_that_rounds_says_by_how_much(tmp_path, capsys):
    source = fan(tmp_path / "in.vtk", "vtk42")
    assert smooth(source, tmp_path / "out.bdf") == 0
    said = re.search(r"note: .*: coordinates are rounded, by up to (\S+)\n", capsys.readouterr().err)
    assert 0 < float(said[1]) < 1e-11


def test_a_format_whose_rounding_lowers_the_quality_is_refused(tmp_path, capsys):
    """The columns of Nastran files hold 15 digits of a coordinate at most."""
    source, output = coarse(tmp_path / "in.vtk", 4e-11, np.float64), tmp_path / "out.bdf"
    output.write_bytes(b"old")
    assert smooth(source, output, "--tol", "0") == 4
    said = capsys.readouterr().err
    refused = re.fullmatch(
        rf"dvr: error: {output}: rounding the coordinates .* would lower Q1 from .* by (\S+); choose a .*\n",
        said,
    )
    assert float(refused[1]) > 0
    assert output.read_bytes() == b"old"


# --------------------------------------------------------------------------------------------- what is lost


def test_what_a_format_cannot_keep_is_said(tmp_path, capsys):
    source = fan(
        tmp_path / "in.msh",
        cell_data={"gmsh:physical": [np.array([5, 5, 5, 5])], "gmsh:geometrical": [np.array([1, 1, 1, 1])]},
        field_data={"sheet": np.array([5, 2])},
    )
    expected = {
        "vtk": ["not kept: 1 group name (sheet)"],
        "mesh": [
            "the cell field gmsh:physical is kept as medit:ref",
            "not kept: 1 cell field (gmsh:geometrical)",
            "not kept: 1 group name (sheet)",
        ],
        "off": [
            "not kept: 2 cell fields (gmsh:geometrical, gmsh:physical)",
            "not kept: 1 group name (sheet)",
        ],
    }
    for suffix, lines in expected.items():
        output = tmp_path / f"out.{suffix}"
        assert smooth(source, output) == 0
        assert re.findall(r"note: .*?: (.*)\n", capsys.readouterr().err) == lines
        assert len(open_mesh(output).mesh.points) == 5


def test_data_whose_values_change_are_said(tmp_path, capsys):
    source = fan(tmp_path / "in.vtu", "vtu", point_data={"u": np.arange(5) / 3})
    mesh = open_mesh(source).mesh
    mesh.point_data["u"] = mesh.point_data["u"].reshape(5, 1)
    assert Output(open_mesh(source), tmp_path / "out.vtu").notes == []
    column = MeshioSource(mesh, "vtk")
    column.stored(mesh.points)
    assert column.notes == ["1 point field with other values or shapes: u"]


def test_what_is_beyond_the_mesh_of_an_obj_is_said_in_other_formats(tmp_path, capsys):
    source = tmp_path / "in.obj"
    corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv .8 .9 0\n"
    faces = "f 1/1 2/1 5/1\nf 2/1 3/1 5/1\nf 3/1 4/1 5/1\nf 4/1 1/1 5/1\n"
    source.write_text(corners + "vt 0 0\nusemtl red\n" + faces)
    assert smooth(source, tmp_path / "out.obj") == 0
    assert "note:" not in capsys.readouterr().err
    assert smooth(source, tmp_path / "out.vtu") == 0
    assert re.findall(r"note: .*?: (.*)\n", capsys.readouterr().err) == [
        "not kept: 1 texture coordinate",
        "not kept: 1 cell set (red)",
    ]


def test_binary_medit_is_told_by_its_suffix(tmp_path):
    """Programs look at the name of the file."""
    output = tmp_path / "out.meshb"
    assert smooth(fan(tmp_path / "in.mesh", "medit"), output) == 0
    assert output.read_bytes()[:4] in (b"\x01\0\0\0", b"\0\0\0\x01")
    assert len(open_mesh(output).mesh.points) == 5


# ------------------------------------------------------------------------------------------------- TetGen

NODE = "5 2 0 1\n" + "".join(f"{i} {x} {y} 1\n" for i, (x, y) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]))
NODE += "4 .8 .9 0\n# made by hand\n"
ELE = "4 3 0\n" + "".join(f"{i} {a} {b} {c}\n" for i, (a, b, c) in enumerate(FAN)) + "# the end\n"


@pytest.fixture
def pair(tmp_path: Path) -> Path:
    (tmp_path / "in.node").write_text(NODE)
    (tmp_path / "in.ele").write_text(ELE)
    return tmp_path


@pytest.mark.parametrize(("source", "output"), [("in.node", "out.node"), ("in.ele", "out.ele")])
def test_a_pair_of_files_goes_in_and_out(pair, source, output):
    assert main(["smooth", str(pair / source), str(pair / output), "-q", "-d", "axis"]) == 0
    assert names(pair) == {"in.node", "in.ele", "out.node", "out.ele", "out.quality.json"}
    assert (pair / "out.ele").read_text() == ELE
    old, new = NODE.splitlines(), (pair / "out.node").read_text().splitlines()
    assert [i for i in range(len(old)) if old[i] != new[i]] == [5]
    np.testing.assert_allclose(np.array(new[5].split(), dtype=float)[1:3], 0.5, atol=0.01)


def test_a_pair_in_place(pair):
    assert smooth(pair / "in.node", pair / "in.node") == 0
    assert (pair / "in.ele").read_text() == ELE
    assert (pair / "in.node").read_text() != NODE


def test_a_pair_of_which_one_cannot_be_written_is_not_written_at_all(pair, monkeypatch):
    for suffix in (".node", ".ele"):
        (pair / f"out{suffix}").write_text("old")
    source = open_mesh(pair / "in.node")
    before = names(pair)
    with pytest.raises(OutputError):
        Output(HalfWritten(source, OSError(28, "No space left on device")), pair / "out.node").write(
            source.mesh.points
        )
    assert {(pair / f"out{suffix}").read_text() for suffix in (".node", ".ele")} == {"old"}
    assert names(pair) == before


def test_half_a_pair(pair, capsys):
    (pair / "in.ele").unlink()
    assert smooth(pair / "in.node", pair / "out.node") == 3
    assert "in.ele is missing" in capsys.readouterr().err
    assert smooth(fan(pair / "a.msh"), pair / "out.node") == 4
    assert "only be written where the input is tetgen" in capsys.readouterr().err


# UGRID is left out, as meshio writes it wrongly
@pytest.mark.parametrize(
    "name", [name for name in FORMATS if not format_named(name).patched and name != "ugrid"]
)
def test_what_only_meshio_reads_is_not_written_back(tmp_path, capsys, name):
    """meshio leaves out what it does not know, so nobody could say what is lost."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    source = tmp_path / f"in{format_named(name).suffixes[0]}"
    meshio.write(source, meshio.Mesh(points, [("tetra", [[0, 1, 2, 3]])]), file_format=name)
    capsys.readouterr()  # warnings of meshio's writer
    for output in (source, tmp_path / f"out{source.suffix}"):
        before = source.read_bytes()
        options = ["--no-report", "--engine", "numpy", "--input-format", name, "--output-format", name]
        assert main(["smooth", str(source), str(output), *options]) == 4
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert f"{name} files are read by meshio" in error
        assert source.read_bytes() == before
    assert not (tmp_path / f"out{source.suffix}").exists()
    assert smooth(source, tmp_path / "out.vtu", "--input-format", name) == 0
