"""Jobs of several ranks: the bytes, report and messages of a run in one process, and how they end."""

import contextlib
import json
import re
from functools import partial

import meshio
import numpy as np
import pytest

from dvr_cli.cli.main import main
from meshes import KINDS, random_mesh, tangled


def cases_of(usual, others, compiled):
    """The usual case, and the long ones: others, and those of the compiled engine."""
    return [
        usual,
        *(pytest.param(*both, "numpy", marks=pytest.mark.long) for both in others),
        *(pytest.param(*both, "numba", marks=pytest.mark.long) for both in compiled),
    ]


SWEEPS = "-d random,steepest -n 2 --tol 0 --no-polish --no-patches"
# name of a mesh, and options
RUNS = (
    *((kind, SWEEPS) for kind in KINDS),
    ("mirrored", SWEEPS),
    ("triangle", "-d axis,circumferential,radial,optimal,narrowing -n 6 --order natural"),
    ("tetra", "-d random -n 2 --order shuffled --seed 5"),
    ("quad", f"{SWEEPS} --boundary slide"),
    ("mixed3d", f"{SWEEPS} --boundary slide"),
    ("triangle", "--patches -n 5"),
    ("tetra", "--patches --boundary slide -n 3"),
    ("hexahedron", "--boundary slide --no-patches -n 4"),
    ("tetra", "--target 0.4 -n 4"),
    ("tetra", "-d random --polish --floor 0.9 -n 2"),
    ("triangle", "--below 0.6 --layers 1 -n 3"),
    ("level", f"{SWEEPS} --boundary slide --keep-height"),
    ("level", "-n 3 --boundary slide"),
    ("tangled", "--untangle -n 2"),
    ("tetra", "-d random --time-limit 1e-9"),
    ("few", "-n 3"),  # fewer vertices than ranks
    ("none", "-n 3"),
)
# ranks, and one run in so many, where tests may take long
OTHERS = ((1, 2), (2, 2), (3, 3), (4, 1), (8, 3))
COMPILED = ((2, 3), (3, 1), (8, 4))  # the same with the compiled engine
CASES = cases_of((3, 8, "numpy"), OTHERS, COMPILED)


def job(on_ranks, ranks, folder, commands, *fault):
    """The process of a job, and the exit codes of its commands if it came so far."""
    (folder / "commands.json").write_text(json.dumps(commands))
    files = folder / "commands.json", folder / "codes.json"
    done = on_ranks(ranks, "job.py", *files, *fault, cwd=folder)
    return done, json.loads(files[1].read_text()) if files[1].exists() else None


def mesh_of(name):
    if name == "few":
        return random_mesh("quad", 0, n=3)  # 4 inner vertices
    if name == "none":
        return random_mesh("quad", 0, n=1)
    if name == "tangled":
        return tangled("triangle", 4, 0.9, 1)
    if name == "mirrored":
        mesh = random_mesh("tetra", 3)
        cells = mesh.cells[0].vertices
        cells[::3] = cells[::3, [1, 0, 2, 3]]
        return mesh
    if name == "level":  # altitudes are much alike, so moves are cut short
        return random_mesh("tetra", 1, noise=0.02)
    return random_mesh(name, 1, noise=0.45)


def write(folder, name, binary=True):
    mesh = mesh_of(name)
    points = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.points.shape[1])))
    path = folder / f"{name}.vtk"
    meshio.Mesh(points, [(b.type, b.vertices) for b in mesh.cells]).write(path, binary=binary)
    return path


write_text = partial(write, binary=False)  # of which no rank reads a range


def commands_of(folder, runs, *more, write=write, engine="numpy"):
    """A command each, of which the meshes are in a folder, and the outputs in whatever folder it runs in.

    write: makes the file of a mesh by folder and name.
    """
    others = ["--engine", engine, "--threads", "1", "--quiet", *more]
    paths = [write(folder, name) for name, _ in runs]
    return [
        ["smooth", str(path), f"{i}{path.suffix}", *options.split(), *others]
        for i, (path, (_, options)) in enumerate(zip(paths, runs, strict=True))
    ]


def in_one_process(folder, commands):
    """The exit codes of commands that run in a folder."""
    with contextlib.chdir(folder):
        return [main(command) for command in commands]


def without_times(report):
    return re.sub(rb'"seconds": [^,}]*', b"", report)


@pytest.mark.parametrize(("ranks", "every", "engine"), CASES)
def test_the_bytes_and_reports_are_those_of_one_process(tmp_path, on_ranks, ranks, every, engine):
    """One rank has the mesh; in the usual run of the tests one run in so many."""
    runs = RUNS[::every]
    alone, together = tmp_path / "alone", tmp_path / "together"
    alone.mkdir()
    together.mkdir()
    how = {"write": write_text, "engine": engine}
    assert set(in_one_process(alone, commands_of(alone, runs, **how))) == {0}
    done, ends = job(on_ranks, ranks, together, commands_of(alone, runs, "--mpi", **how))
    assert (done.returncode, done.stderr) == (0, "")
    assert set(ends) == {0}
    for i, (name, options) in enumerate(runs):
        meshes = [(folder / f"{i}.vtk").read_bytes() for folder in (together, alone)]
        assert meshes[0] == meshes[1], runs[i]
        moved = meshes[0] != (alone / f"{name}.vtk").read_bytes()
        assert moved == (name != "none" and "time-limit" not in options), runs[i]
        reports = [(folder / f"{i}.quality.json").read_bytes() for folder in (together, alone)]
        assert without_times(reports[0]) == without_times(reports[1]), runs[i]


def test_messages_come_once(tmp_path, on_ranks):
    """What is wrong with the input, options or walking is one line, and nothing is written."""
    mesh = write(tmp_path, "tetra")
    (tmp_path / "cut.vtk").write_bytes(mesh.read_bytes()[:-100])
    more = ["--engine", "numpy", "--mpi"]
    commands = [
        ["smooth", "cut.vtk", "out.vtk", *more],
        ["smooth", "tetra.vtk", "out.vtk", "--seed", "x", *more],
        ["report", "quality", "tetra.vtk", "--mpi"],
    ]
    done, ends = job(on_ranks, 3, tmp_path, commands)
    assert ends == [3, 2, 2]
    lines = done.stderr.splitlines()
    assert [line.split(":")[0] for line in lines] == ["dvr"] * 3
    assert "cut.vtk" in lines[0]
    assert done.stdout == ""
    assert not list(tmp_path.glob("out*"))


def test_boundaries_on_which_vertices_walk_are_refused(tmp_path, on_ranks):
    mesh = random_mesh("tetra", 0, n=2)
    radius = np.linalg.norm(mesh.points - 0.5, axis=1, keepdims=True)
    size = np.abs(mesh.points - 0.5).max(axis=1, keepdims=True)
    points = (mesh.points - 0.5) * size / np.where(radius > 0, radius, 1.0)  # a ball
    meshio.Mesh(points, [("tetra", mesh.cells[0].vertices)]).write(tmp_path / "ball.vtk")
    options = ["--boundary", "project", "--feature-angle", "120", "--engine", "numpy", "--mpi"]
    done, ends = job(on_ranks, 2, tmp_path, [["smooth", "ball.vtk", "out.vtk", *options]])
    assert ends == [2]
    assert done.stderr == (
        "dvr: error: mpi: curved boundaries and surfaces, whose vertices walk, are relaxed by one rank only\n"
    )
    assert not list(tmp_path.glob("out*"))


@pytest.mark.parametrize("order", ["coloured", "natural"])  # without a lead, and with one
def test_a_rank_that_fails_ends_the_job(tmp_path, on_ranks, order):
    commands = commands_of(tmp_path, [("hexahedron", f"{SWEEPS} --order {order}")], "--mpi")
    done, ends = job(on_ranks, 3, tmp_path, commands, "a rank fails")
    assert done.returncode != 0
    assert ends is None
    assert "dvr: internal error on rank 2: MemoryError: nothing left" in done.stderr
    assert not (tmp_path / "0.vtk").exists()


@pytest.mark.parametrize("order", ["coloured", "natural"])
def test_an_interrupted_job_writes_what_it_has_reached(tmp_path, on_ranks, order):
    """All ranks get the signal, as from a terminal; the leading one ends the sweep that follows."""
    runs = [("hexahedron", f"-d random -n 9 --tol 0 --no-polish --order {order}")]
    command = [word for word in commands_of(tmp_path, runs, "--mpi")[0] if word != "--quiet"]
    done, ends = job(on_ranks, 3, tmp_path, [command], "interrupted")
    assert ends == [130]
    assert "interrupted" in done.stderr
    report = json.loads((tmp_path / "0.quality.json").read_text())
    assert report["stopped_because"] == "interrupted"
    assert len(report["sweeps"]) == 1
    assert (tmp_path / "0.vtk").read_bytes() != (tmp_path / "hexahedron.vtk").read_bytes()


def test_a_full_disk_ends_the_job_with_nothing_half_written(tmp_path, on_ranks):
    commands = commands_of(tmp_path, [("hexahedron", SWEEPS)], "--mpi")
    before = {path.name for path in tmp_path.iterdir()}
    done, ends = job(on_ranks, 3, tmp_path, commands, "a full disk")
    assert ends == [4], done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("dvr: error: 0.vtk: ")
    assert {path.name for path in tmp_path.iterdir()} - before == {"codes.json", "commands.json"}
