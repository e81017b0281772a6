"""``dvr smooth`` from end to end over the fixture corpora, and over damaged copies of them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import gmsh_corpus
import vtk_corpus
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.cli.main import main
from dvr_cli.errors import DvrError
from dvr_cli.files.reading import open_mesh
from dvr_cli.files.writing import Output
from dvr_cli.relax.stopping import Stopping
from fuzz import mutated
from pairwise import named_cases

VTK_NAMES = list(vtk_corpus.corpus())
# Why files cannot be relaxed, by what their names begin with; all others can.
REFUSED = {
    "third_order-": "cells of type 'triangle10' are not supported",
    "all_linear-": "cells of type 'polygon' are not supported",
    "second_order-42": "cells of type 'quad6' are not supported",
    "second_order-51": "cells of type 'quad6' are not supported",
    "polydata-": "cells of type 'polygon' are not supported",
    "structured151-": "the mesh has only line cells: nothing to relax",
    "structured111-": "the mesh has only vertex cells: nothing to relax",
}
# Structured grids one cell thick, which are not plane.
SURFACES = ("structured341-", "structured134-", "structured314-")
# Models whose meshes have vertices inside that two sweeps move.
MOVED = ("periodic_rectangle", "quads", "sparse_tags", "embedded", "triangles_and_quads")


def refusal_of(name: str) -> str | None:
    return next((words for start, words in REFUSED.items() if name.startswith(start)), None)


class Runner:
    """Runs ``dvr smooth`` in a folder of its own."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self._folder, self._capsys = folder, capsys

    def smooth(self, data: bytes, suffix: str, sweeps: int) -> bytes | str:
        """The bytes written, or the one line of the error."""
        source, output = self._folder / f"in{suffix}", self._folder / f"out{suffix}"
        source.write_bytes(data)
        self._capsys.readouterr()
        code = main(["smooth", str(source), str(output), "-n", str(sweeps), "--quiet", "--no-report"])
        captured = self._capsys.readouterr()
        assert captured.out == ""
        if code == 0:
            assert captured.err == ""
            return output.read_bytes()
        assert code == 3
        assert not output.exists()
        assert captured.err.count("\n") == 1
        assert captured.err.startswith(f"dvr: error: {source}: ")
        return captured.err


@pytest.fixture
def runner(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Runner:
    return Runner(tmp_path, capsys)


def around(data: bytes, begin: bytes, end: bytes) -> tuple[bytes, bytes]:
    """What a file holds in front of and behind its one section of coordinates."""
    head, tail = data.index(begin), data.rindex(end)
    return data[: head + len(begin)], data[tail:]


@pytest.mark.parametrize("name", named_cases(gmsh_corpus.NAMES))
def test_gmsh_files(runner, name):
    data = gmsh_corpus.corpus(name)
    result = runner.smooth(data, ".msh", 0)
    if words := refusal_of(name):
        assert isinstance(result, str)
        assert words in result
        return
    assert result == data
    result = runner.smooth(data, ".msh", 2)
    assert isinstance(result, bytes)
    if name.startswith(MOVED):
        assert result != data
    if result == data:
        return
    begin = b"$ParametricNodes" if b"$ParametricNodes" in data else b"$Nodes"
    end = b"$EndParametricNodes" if b"$ParametricNodes" in data else b"$EndNodes"
    if b"arametric" not in data and "parametric" not in name:
        assert around(result, begin, end) == around(data, begin, end)
    before, after = gmsh_corpus.account(data), gmsh_corpus.account(result)
    assert after.nodes.keys() == before.nodes.keys()
    for what in ("elements", "entities", "groups", "elements_of", "periodic", "views", "complaints"):
        assert getattr(after, what) == getattr(before, what), what


@pytest.mark.parametrize("name", named_cases(VTK_NAMES))
def test_vtk_files(runner, name):
    """Those that can be relaxed have no vertex inside, so that they come back as they were, but surfaces."""
    data = vtk_corpus.corpus()[name]
    for sweeps in (0, 2):
        result = runner.smooth(data, ".vtk", sweeps)
        if words := refusal_of(name):
            assert isinstance(result, str)
            assert words in result
        elif sweeps and name.startswith(SURFACES):
            assert result != data
            assert around(result, b"double\n", b"CELL_DATA") == around(data, b"double\n", b"CELL_DATA")
        else:
            assert result == data


def block(double: bool, kind: str) -> object:
    """A block of 3 × 3 × 3 boxes of which the inner vertices can move, as VTK makes it."""
    points = np.stack(np.meshgrid(*[np.arange(4.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    points += vtk_corpus.JITTER
    if kind == "structured":
        grid = vtk_corpus.vtk.vtkStructuredGrid()
        grid.SetDimensions(4, 4, 4)
        order = np.arange(64).reshape(4, 4, 4).transpose(2, 1, 0).ravel()
        grid.SetPoints(vtk_corpus._points(points[order], double))
    else:
        grid = vtk_corpus.vtk.vtkUnstructuredGrid()
        grid.SetPoints(vtk_corpus._points(points, double))
        index = np.arange(64).reshape(4, 4, 4)
        for i, j, k in np.ndindex(3, 3, 3):
            low, high = index[i : i + 2, j : j + 2, k], index[i : i + 2, j : j + 2, k + 1]
            ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
            cell = [int(layer[at]) for layer in (low, high) for at in ring]
            grid.InsertNextCell(12, 8, cell)
    grid.GetCellData().AddArray(vtk_corpus._array("vtkIntArray", "number", np.arange(27)))
    words = [f"point {i}" for i in range(64)]
    grid.GetPointData().AddArray(vtk_corpus._strings("some words", words))
    return grid


@pytest.mark.parametrize("double", [False, True], ids=["float", "double"])
@pytest.mark.parametrize("binary", [False, True], ids=["ascii", "binary"])
@pytest.mark.parametrize("version", [42, 51])
@pytest.mark.parametrize("kind", ["structured", "unstructured"])
def test_vtk_files_that_move(runner, kind, version, binary, double):
    data = vtk_corpus.write(block(double, kind), version, binary)
    assert runner.smooth(data, ".vtk", 0) == data
    result = runner.smooth(data, ".vtk", 2)
    assert isinstance(result, bytes)
    pattern = rb"POINTS 64 (?:float|double)\n"
    (start,) = re.finditer(pattern, data)
    end = b"\nMETADATA" if b"METADATA" in data[start.end() :] else b"\nCELL"
    assert result[: start.end()] == data[: start.end()]
    assert result[result.index(end, start.end()) :] == data[data.index(end, start.end()) :]
    before, after = vtk_corpus.read_with_vtk(data), vtk_corpus.read_with_vtk(result)
    as_before, as_after = map(vtk_corpus.everything_but_coordinates, (before, after))
    assert as_after == as_before
    assert (vtk_corpus.coordinates(after) != vtk_corpus.coordinates(before)).any(axis=1).sum() == 8


@pytest.mark.parametrize("damaged_files", [150, pytest.param(500, marks=pytest.mark.long)])
def test_damaged_files_through_the_whole_command(tmp_path, damaged_files):
    """Errors are of the kinds a user can be told of, and what is written can be read."""
    gmsh_names = [n for n in gmsh_corpus.NAMES if n.startswith(("quads", "sparse", "periodic_r", "embedded"))]
    small_vtk = ("tetrahedra-", "scalars-", "structured342-", "hand-", "meshio-")
    files = {
        ".msh": [gmsh_corpus.corpus(name) for name in gmsh_names],
        ".vtk": [vtk_corpus.corpus()[name] for name in VTK_NAMES if name.startswith(small_vtk)],
    }
    options = SmoothOptions(stopping=Stopping(max_iterations=1))
    written = refused = several_lines = 0
    for suffix, sound in files.items():
        source, output = tmp_path / f"in{suffix}", tmp_path / f"out{suffix}"
        for damaged in mutated(sound, damaged_files, seed=17):
            source.write_bytes(damaged)
            try:
                opened = open_mesh(source)
                destination = Output(opened, output)
                with np.errstate(all="ignore"):
                    points, report = smooth_mesh(opened.mesh, options, destination)
            except DvrError as error:
                several_lines += "\n" in str(error)
                refused += 1
                continue
            destination.write(points)
            again = open_mesh(output).mesh
            assert np.array_equal(again.points, points)
            assert report.after.inverted <= report.before.inverted
            written += 1
    assert several_lines == 0
    assert min(written, refused) > damaged_files / 5  # both happen, or the damage is not of the right kind
