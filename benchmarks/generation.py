"""Smoothing against generating the same mesh, and one thread against two."""

from __future__ import annotations

import tempfile
from pathlib import Path

import meshes
from common import FileRun, print_table, smooth_file, times

_HXT = 10  # Gmsh's number of that algorithm
_SIZE, _SMALL = 0.5, 3.0  # length of edges: a million tetrahedra, and five thousand
_RUNS = 2
_THREADS = 1, 2


def run(quick: bool) -> None:
    """Print the seconds of the whole process, and those of its phases."""
    mesh, (surfaces, whole) = meshes.timed_part(_SMALL if quick else _SIZE, _HXT, max(_THREADS))
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "part.msh"
        meshes.write_msh(mesh, source)
        smooth_file(source, 1)  # so that nothing has to be compiled
        taken = {threads: _quickest(source, threads) for threads in _THREADS}
    row: list[object] = [len(mesh.cells[0].vertices), whole, whole - surfaces]
    row += [run.used.elapsed for run in taken.values()]
    header = ["tetrahedra", "generation s", "of tetrahedra s", *(f"`dvr` s, {n} threads" for n in _THREADS)]
    against = taken[max(_THREADS)].used.elapsed
    header += ["`dvr` / generation", "/ of tetrahedra"]
    row += [times(whole, against), times(whole - surfaces, against)]
    print_table("Generating by HXT, and the default run", header, [row])
    phases = [taken[threads].phases for threads in _THREADS]
    rows = [[name, one, phases[1][name], times(phases[1][name], one)] for name, one in phases[0].items()]
    header = ["phase", *(f"s, {n} threads" for n in _THREADS), "times as quick"]
    print_table("Its phases on one thread and on two", header, rows)


def _quickest(source: Path, threads: int) -> FileRun:
    return min((smooth_file(source, threads) for _ in range(_RUNS)), key=lambda run: run.used.elapsed)
