"""Smoothing against generating the same mesh, and one thread against two."""

from __future__ import annotations

import json
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import meshes
from common import fastest, print_table, run_process, times

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
        run_process(_command(source, 1))  # so that nothing has to be compiled
        taken = {threads: min(_smoothed(source, threads) for _ in range(_RUNS)) for threads in _THREADS}
    row: list[object] = [len(mesh.cells[0].vertices), whole, whole - surfaces]
    row += [elapsed for elapsed, _ in taken.values()]
    header = ["tetrahedra", "generation s", "of tetrahedra s", *(f"`dvr` s, {n} threads" for n in _THREADS)]
    against = taken[max(_THREADS)][0]
    header += ["`dvr` / generation", "/ of tetrahedra"]
    row += [times(whole, against), times(whole - surfaces, against)]
    print_table("Generating by HXT, and the default run", header, [row])
    phases = [taken[threads][1] for threads in _THREADS]
    rows = [[name, one, phases[1][name], times(phases[1][name], one)] for name, one in phases[0].items()]
    header = ["phase", *(f"s, {n} threads" for n in _THREADS), "times as quick"]
    print_table("Its phases on one thread and on two", header, rows)


def _command(source: Path, threads: int) -> list[str | Path]:
    smooth = [sys.executable, "-m", "dvr_cli", "smooth", source, source.with_name("out.msh"), "-q"]
    more = ["--engine", fastest(), "--threads", str(threads), "--report", source.with_name("report.json")]
    return [*smooth, *more]


def _smoothed(source: Path, threads: int) -> tuple[float, dict[str, float]]:
    """Seconds of a run from file to file, and those of its phases' sweeps."""
    elapsed, _ = run_process(_command(source, threads))
    phases: dict[str, float] = defaultdict(float)
    for sweep in json.loads(source.with_name("report.json").read_text())["sweeps"]:
        phases[sweep["phase"]] += sweep["seconds"]
    return elapsed, dict(phases)
