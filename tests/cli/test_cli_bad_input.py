"""Bad meshes and outputs: each its exit code, one line that names the file, nothing written."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from cli_support import CORNERS, assert_one_line, fan, listing, write

INPUTS = {}


def bad_input(make):
    """Register a maker of a bad mesh file in a folder."""
    INPUTS[make.__name__] = make
    return make


def damaged(path: Path, keep: float) -> Path:
    """A mesh file cut off after a part of it."""
    content = fan(path).read_bytes()
    path.write_bytes(content[: int(len(content) * keep)])
    return path


@bad_input
def missing(folder: Path) -> Path:
    return folder / "missing.msh"


@bad_input
def directory(folder: Path) -> Path:
    (folder / "dir.msh").mkdir()
    return folder / "dir.msh"


@bad_input
def empty(folder: Path) -> Path:
    (folder / "empty.msh").touch()
    return folder / "empty.msh"


@bad_input
def gmsh_cut_in_its_nodes(folder: Path) -> Path:
    return damaged(folder / "cut.msh", 0.3)


@bad_input
def gmsh_cut_in_its_elements(folder: Path) -> Path:
    return damaged(folder / "cut.msh", 0.8)


@bad_input
def vtk_cut_in_its_points(folder: Path) -> Path:
    return damaged(folder / "cut.vtk", 0.4)


@bad_input
def vtk_cut_in_its_cells(folder: Path) -> Path:
    return damaged(folder / "cut.vtk", 0.75)


@bad_input
def suffix_of_no_format(folder: Path) -> Path:
    (folder / "mesh.xyz").write_text("3\ncoordinates of atoms\nH 0 0 0\n")
    return folder / "mesh.xyz"


@bad_input
def suffix_of_another_format(folder: Path) -> Path:
    return fan(folder / "mesh.vtk").rename(folder / "mesh.msh")


@bad_input
def a_text_that_is_no_mesh(folder: Path) -> Path:
    (folder / "letter.msh").write_text("Dear mesh,\n\nplease get better.\n")
    return folder / "letter.msh"


@bad_input
def bytes_that_are_no_mesh(folder: Path) -> Path:
    (folder / "noise.vtk").write_bytes(np.random.default_rng(0).bytes(3000))
    return folder / "noise.vtk"


@bad_input
def no_cells(folder: Path) -> Path:
    return write(folder / "nocells.vtk", CORNERS, {"triangle": np.empty((0, 3), dtype=np.int64)})


@bad_input
def only_lines(folder: Path) -> Path:
    return write(folder / "lines.msh", CORNERS, {"line": [[0, 1], [1, 2]]})


@bad_input
def nan_coordinate(folder: Path) -> Path:
    return fan(folder / "nan.vtk", np.nan)


@bad_input
def nan_coordinate_in_gmsh(folder: Path) -> Path:
    return fan(folder / "nan.msh", np.nan)


@bad_input
def signalling_nan_coordinate(folder: Path) -> Path:
    """Of 32 bits, of which NumPy warns when they become 64."""
    facet = np.array([0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0], dtype="<f4").tobytes() + bytes(2)
    signals = facet[:20] + (0x7F800001).to_bytes(4, "little") + facet[24:]
    path = folder / "nan.stl"
    path.write_bytes(bytes(80) + (2).to_bytes(4, "little") + facet + signals)
    return path


@bad_input
def infinite_coordinate(folder: Path) -> Path:
    return fan(folder / "inf.vtk", 0.5, -np.inf)


@bad_input
def index_too_large(folder: Path) -> Path:
    return write(folder / "index.vtk", CORNERS, {"triangle": [[0, 1, 2], [0, 2, 4]]})


@bad_input
def index_too_large_in_gmsh(folder: Path) -> Path:
    return write(folder / "index.msh", CORNERS, {"triangle": [[0, 1, 2], [0, 2, 999]]})


@bad_input
def negative_index(folder: Path) -> Path:
    return write(folder / "index.vtk", CORNERS, {"triangle": [[0, 1, 2], [0, 2, -1]]})


@bad_input
def repeated_vertex(folder: Path) -> Path:
    return write(folder / "twice.msh", CORNERS, {"triangle": [[0, 1, 2], [0, 3, 3]]})


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("make", INPUTS.values(), ids=INPUTS.keys())
@pytest.mark.parametrize("command", ["smooth", "quality", "compare"])
def test_bad_input(dvr, tmp_path, make, command):
    path = make(tmp_path)
    before = listing(tmp_path)
    arguments = {
        "smooth": ["smooth", path, tmp_path / "out.vtk"],
        "quality": ["report", "quality", path],
        "compare": ["report", "compare", path, path],
    }[command]
    assert_one_line(dvr(*arguments), 3, path.name)
    assert listing(tmp_path) == before


def test_curved_second_order_cells(dvr, tmp_path):
    points = [[0, 0], [1, 0], [0, 1], [0.5, -0.2], [0.5, 0.5], [0, 0.5]]
    path = write(tmp_path / "curved.msh", points, {"triangle6": [[0, 1, 2, 3, 4, 5]]})
    done = dvr("smooth", path, tmp_path / "out.msh")
    assert done.code == 0
    assert "note: 1 second-order cell curved, with vertices that stay (--straighten moves them)" in done.err
    done = dvr("smooth", path, tmp_path / "out.msh", "--straighten")
    assert done.code == 0
    assert "note: 1 second-order cell curved, taken as straight" in done.err


def test_a_file_that_may_not_be_read(dvr, tmp_path):
    path = fan(tmp_path / "secret.msh")
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip("this user may read everything")
    assert_one_line(dvr("report", "quality", path), 3, "secret.msh")


def test_a_file_name_that_is_not_one_line(dvr, tmp_path):
    result = dvr("report", "quality", tmp_path / "two\nlines\x1b[31m.msh")
    assert_one_line(result, 3, r"two\nlines\x1b[31m.msh")


def test_a_format_that_is_not_the_files(dvr, tmp_path):
    path = fan(tmp_path / "mesh.msh")
    assert_one_line(dvr("report", "quality", path, "--input-format", "stl"), 3, "mesh.msh")


@pytest.mark.parametrize(
    ("output", "options", "named"),
    [
        ("no/out.vtk", [], "no/out.vtk"),
        ("dir.vtk", [], "dir.vtk"),
        ("in.msh/out.vtk", [], "in.msh/out.vtk"),
        ("out.vtk", ["--report", "{folder}/no/r.json"], "no/r.json"),
        ("out.vtk", ["--report", "{folder}/dir.json"], "dir.json"),
    ],
)
def test_unwritable_output(dvr, tmp_path, output, options, named):
    source = fan(tmp_path / "in.msh")
    (tmp_path / "dir.vtk").mkdir()
    (tmp_path / "dir.json").mkdir()
    before = listing(tmp_path)
    options = [option.format(folder=tmp_path) for option in options]
    assert_one_line(dvr("smooth", source, tmp_path / output, *options), 4, named)
    assert listing(tmp_path) == before


def test_a_folder_that_may_not_be_written(dvr, tmp_path):
    source, folder = fan(tmp_path / "in.msh"), tmp_path / "locked"
    folder.mkdir(mode=0o555)
    if os.access(folder, os.W_OK):
        pytest.skip("this user may write everywhere")
    assert_one_line(dvr("smooth", source, folder / "out.msh"), 4, "locked")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
def test_a_full_device(dvr, tmp_path):
    options = ["--output-format", "vtk", "--no-report", "-q"]
    assert_one_line(dvr("smooth", fan(tmp_path / "in.msh"), "/dev/full", *options), 4, "/dev/full")


def test_output_that_is_checked_before_the_input_is_read(dvr, tmp_path):
    path = tmp_path / "missing.msh"
    assert_one_line(dvr("smooth", path, tmp_path / "no" / "out.vtk"), 4, "no/out.vtk")
    assert_one_line(dvr("smooth", path, tmp_path / "out.vtk", "-d", "sideways"), 2, "sideways")
    assert_one_line(dvr("smooth", path, tmp_path / "out.vtk", "--report", "r.txt"), 2, "r.txt")


def test_a_format_that_cannot_hold_the_mesh(dvr, tmp_path):
    quad = write(tmp_path / "quad.vtk", CORNERS, {"quad": [[0, 1, 2, 3]]})
    before = listing(tmp_path)
    assert_one_line(dvr("smooth", quad, tmp_path / "out.stl", "-q"), 4, "out.stl")
    assert listing(tmp_path) == before
