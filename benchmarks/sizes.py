"""How cost grows with the mesh: updates, set-up and memory, from a thousand to a million vertices."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import meshes
from common import (
    Contender,
    contenders,
    domain_for,
    engine_for,
    fastest,
    print_table,
    random_directions,
    seconds,
    sweep_all,
    warm_up,
)
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.measure import measure

_SWEEPS = 5
_ROUNDS = 3  # the quickest of each part counts: what slows it is other work on the machine


def run(quick: bool) -> None:
    """Print the tables of cost per update, set-up and memory."""
    sizes = [1_000, 10_000, *([] if quick else [100_000, 1_000_000])]
    makers = {"random": meshes.raw_tets, "along a curve": meshes.raw_tets_along_curve}
    contender = (fastest(), 1)
    warm_up(meshes.raw_tets(1_000), contender)
    speed, memory = [], []
    for n in sizes:
        for numbering, make in makers.items():
            speed.append([n, numbering, *_costs(make(n), contender)])
    header = ["vertices", "numbering", "µs per update", "µs per vertex for directions and Q1"]
    header += ["domain", "measure", "problem", "engine", "set-up in all", "in whole sweeps"]
    print_table(f"Sizes: {contender[0]} engine, one thread; set-up in sweeps", header, speed)
    for n in sizes:
        path = meshes.path_of(meshes.raw_tets, n)
        tets = len(meshes.load_mesh(path).cells[0].vertices)
        for name, threads in contenders([2]):
            memory.append([n, tets, name, peak := _peak_bytes(path, name, threads), peak / tets])
    header = ["vertices", "tetrahedra", "engine", "peak bytes above the interpreter's", "per tetrahedron"]
    print_table("Memory", header, memory)


def _costs(mesh: Mesh, contender: Contender) -> list[float]:
    """Seconds per update in µs, of the rest of a sweep likewise, and each part of the set-up in sweeps."""
    m = int(domain_for(mesh, contender).interior.sum())
    *parts, rest, sweep = np.min([_seconds(mesh, contender) for _ in range(_ROUNDS)], axis=0)
    in_all = sum(parts)
    in_sweeps = [part / sweep for part in (*parts, in_all)]
    return [sweep / m * 1e6, rest / m * 1e6, *in_sweeps, in_all / (sweep + rest)]


def _seconds(mesh: Mesh, contender: Contender) -> list[float]:
    """Seconds of each part of the set-up, of the directions and Q1 of a sweep, and of its vertex updates."""
    clock = [time.perf_counter()]
    domain = domain_for(mesh, contender)
    clock.append(time.perf_counter())
    measure(domain, mesh.points, np.flatnonzero(domain.interior))
    clock.append(time.perf_counter())
    engine = engine_for(domain, contender)
    clock.append(time.perf_counter())
    engine.load(domain.points)
    engine.q1()
    clock.append(time.perf_counter())
    directions: list[np.ndarray] = []
    rest = seconds(lambda: directions.extend(random_directions(engine, _SWEEPS)))
    rest = rest / _SWEEPS + seconds(engine.q1)
    sweep = seconds(lambda: sweep_all(engine, directions)) / _SWEEPS
    return [*np.diff(clock).tolist(), rest, sweep]


def _peak_bytes(path: Path, name: str, threads: int) -> int:
    """Peak memory of smoothing a kept mesh, above what the process has after loading all code."""
    command = [sys.executable, __file__, str(path), name, str(threads)]
    return int(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout)


def _memory_of_this_process(field: str) -> int:
    """VmRSS (memory now) or VmHWM (its peak) in bytes; of this process alone, as getrusage's is not."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(field):
            return int(line.split()[1]) * 1024
    raise SystemExit(f"no {field} in /proc/self/status: memory is measured on Linux only")


def _smooth_and_print_peak(path: Path, name: str, threads: int) -> None:
    import dvr_cli

    warm_up(meshes.raw_tets(1_000), (name, threads))
    before = _memory_of_this_process("VmRSS")
    mesh = meshes.load_mesh(path)
    cells = {"tetra": mesh.cells[0].vertices}
    options = {"directions": "random", "max_iterations": _SWEEPS, "tol": 0.0}
    dvr_cli.smooth(mesh.points, cells, engine=name, threads=threads, **options)
    print(_memory_of_this_process("VmHWM") - before)


if __name__ == "__main__":
    _smooth_and_print_peak(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
