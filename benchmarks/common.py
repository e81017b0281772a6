"""What the benchmark sections share: tables, times, processes and their memory, dvr's engines."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dvr_cli.mesh.domain import Domain, domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.relax.directions import random_field
from dvr_cli.relax.engines.choice import KINDS, has_numba
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.problem import build_problem

Contender = tuple[str, int]  # an engine's name and its number of threads

# Runs a command in a process of little memory of its own, since Linux counts the peak of the process that
# starts another towards the other's; prints the seconds, the peak in kB, the CPU seconds and the exit code.
_LAUNCHER = """
import resource, subprocess, sys, time
begin = time.perf_counter()
code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(time.perf_counter() - begin, used.ru_maxrss, used.ru_utime + used.ru_stime, code)
"""


def print_table(title: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a section's heading and a Markdown table, numbers to three digits; each row when it is there."""
    print(f"\n### {title}\n")
    print("| " + " | ".join(header) + " |")
    print("|" + "---|" * len(header))
    for row in rows:
        print("| " + " | ".join(_shown(value) for value in row) + " |", flush=True)


def _shown(value: object) -> str:
    if not isinstance(value, float):
        return str(value)
    return f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"


def seconds(work: Callable[[], object]) -> float:
    """How long ``work`` takes."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


class Used(NamedTuple):
    """The time and memory of a process: seconds, CPU seconds and the peak in MB."""

    elapsed: float
    cpu: float
    memory: float


def run_process(command: Sequence[str | Path]) -> Used:
    """The time and memory of a process, bytecode kept as usual; SystemExit if it fails."""
    launch = [sys.executable, "-c", _LAUNCHER, *map(str, command)]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    answer = subprocess.run(launch, capture_output=True, text=True, check=True, env=environment)
    elapsed, peak, cpu, code = answer.stdout.split()
    if code != "0":
        raise SystemExit(f"{' '.join(map(str, command))} failed:\n{answer.stderr}")
    in_kb = 1 if sys.platform != "darwin" else 1 / 1024
    return Used(float(elapsed), float(cpu), float(peak) * in_kb * 1024 / 1e6)


class FileRun(NamedTuple):
    """A run from file to file: what its process used, and its report."""

    used: Used
    report: dict[str, Any]

    @property
    def phases(self) -> dict[str, float]:
        """The seconds of the sweeps of each phase."""
        taken: dict[str, float] = defaultdict(float)
        for sweep in self.report["sweeps"]:
            taken[sweep["phase"]] += sweep["seconds"]
        return dict(taken)


def smooth_file(source: Path, threads: int) -> FileRun:
    """Smooth a file into another one beside it, with default options, by the fastest engine."""
    report = source.with_name("report.json")
    command = [sys.executable, "-m", "dvr_cli", "smooth", source, source.with_name(f"out{source.suffix}")]
    command += ["-q", "--engine", fastest(), "--threads", str(threads), "--report", report]
    return FileRun(run_process(command), json.loads(report.read_text()))


def processes(command: Sequence[str | Path], runs: int) -> list[float]:
    """Seconds of several runs of a process, ascending, after one that is not counted."""
    run_process(command)
    return sorted(run_process(command).elapsed for _ in range(runs))


def contenders(threads: Sequence[int] = (1, 2)) -> list[Contender]:
    """The engines to compare: NumPy, and numba on so many threads if it is installed."""
    return [("numpy", 1), *([("numba", n) for n in threads] if has_numba() else [])]


def fastest() -> str:
    """The compiled engine if it is installed, or else NumPy."""
    return contenders()[-1][0]


def engine_for(domain: Domain, contender: Contender) -> Engine:
    """An engine for all interior vertices of a domain, coloured order; coordinates not yet loaded."""
    name, threads = contender
    relaxed = np.flatnonzero(domain.interior)
    kind = KINDS[name]
    return kind.make(build_problem(domain.corners, relaxed, domain.points, backend=kind.backend), threads)


def random_directions(engine: Engine, sweeps: int) -> list[np.ndarray]:
    """The random directions of the first sweeps, (m, d) each, in the order of the engine's rings."""
    field = random_field(engine.problem.components, seed=0, backend=engine.backend)
    vertices = engine.problem.relaxed
    return [field(sweep, engine.relaxed_points, vertices) for sweep in range(sweeps)]


def sweep_all(engine: Engine, directions: Sequence[np.ndarray]) -> None:
    """Sweep once for each entry of ``directions``."""
    for sweep in directions:
        for batch in range(engine.batches):
            engine.relax_batch(batch, sweep)


def warm_up(mesh: Mesh, contender: Contender) -> None:
    """Have all code compiled and loaded that smoothing this kind of mesh needs, by two unlike sweeps."""
    import dvr_cli

    cells = {block.type: block.vertices for block in mesh.cells}
    name, threads = contender
    dvr_cli.smooth(mesh.points, cells, engine=name, threads=threads, max_iterations=2)


def domain_for(mesh: Mesh, contender: Contender) -> Domain:
    """The domain of a mesh, found the way its contender's engine would have it found."""
    return domain_of(mesh, backend=KINDS[contender[0]].backend)


def times(one: float, other: float) -> str:
    """other / one as the tables show it."""
    return f"{other / one:.2f}×"
