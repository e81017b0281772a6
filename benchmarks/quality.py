"""The best Q1 in the least time: sweeps, then patches, on one thread, against the targets that were set.

A target is a Q1 and the seconds it may take; each is run with ``target`` set, and each mesh once more
without, to see how far it goes. The seconds are those of relaxing (rings and colours, sweeps, patches,
polishing), reading the mesh and the quality reports aside.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator

import meshes
from common import fastest, print_table, warm_up
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.relax.stopping import Stopping

_RUNS = 3  # of which the quickest counts
_SWEEPS = 10  # before the patches: more bring hardly anything that patches do not
_PHASES = {"sweeps": {}, "sweeps, patches": {"patches": True}}
_POLISHED = {"sweeps, patches, polish": {"patches": True, "polish": True}}

# Q1 to reach and the seconds for it
_Targets = list[tuple[float, float]]


def run(quick: bool) -> None:
    """Print the tables of the default run, of targets and of what each phase reaches."""
    run_by_default(quick)
    targets, phases = [], []
    for name, mesh, goals in _meshes(quick):
        warm_up(mesh, (fastest(), 1))
        _smoothed(mesh, patches=True, polish=True)
        for q1, limit in goals:
            reached = _smoothed(mesh, target=q1, patches=True)
            met = "yes" if reached[1] >= q1 and reached[3] <= limit else "no"
            targets.append([name, q1, limit, reached[1], reached[3], met])
        for phase, options in (_PHASES | _POLISHED).items():
            before, q1, mean, taken = _smoothed(mesh, **options)
            phases.append([name, phase, before, q1, mean, taken])
    header = ["mesh", "Q1 to reach", "in seconds", "Q1", "seconds", "met"]
    print_table("Quality: targets, one thread", header, targets)
    header = ["mesh", "phases", "Q1 before", "Q1", "mean", "seconds"]
    print_table(f"Quality: what each phase reaches, {_SWEEPS} sweeps, one thread", header, phases)


def run_by_default(quick: bool) -> None:
    """Print the table of the default run."""
    header = ["mesh", "Q1", "1 %", "mean", "CPU seconds"]
    print_table("Quality: default options, one thread", header, map(_by_default, _meshes(quick)))


def _by_default(row: tuple[str, Mesh, _Targets]) -> list[object]:
    name, mesh, _ = row
    options = SmoothOptions(engine=fastest(), threads=1)
    smooth_mesh(mesh, options)
    taken = []
    for _ in range(_RUNS):
        begin = time.process_time()
        _, report = smooth_mesh(mesh, options)
        taken.append(time.process_time() - begin)
    figures = report.after.q1, report.after.quantiles[0.01], report.after.mean
    return [name, *(f"{value:.4f}" for value in figures), min(taken)]


def _meshes(quick: bool) -> Iterator[tuple[str, Mesh, _Targets]]:
    yield "Delaunay tetrahedra, 1,000", meshes.random_tets(1_000), [(0.395, 0.15)]
    yield "Delaunay triangles, 100", meshes.random_triangles(100), [(0.60, 0.03)]
    if quick:
        return
    yield "Delaunay tetrahedra, 10,000", meshes.random_tets(10_000), [(0.290, 0.4)]
    yield "Delaunay tetrahedra, 100,000", meshes.random_tets(100_000), [(0.300, 5.0), (0.345, 20.0)]
    yield "Gmsh sphere, not optimised", meshes.gmsh_sphere(0.0322), [(0.44, 5.0)]
    yield "Gmsh part, optimised by Gmsh", meshes.gmsh_part(0.595), [(0.52, 5.0)]
    yield "Delaunay triangles, 10,000", meshes.random_triangles(10_000), [(0.48, 0.25)]
    yield "Delaunay triangles, 100,000", meshes.random_triangles(100_000), [(0.48, 2.0)]


def _smoothed(
    mesh: Mesh, target: float | None = None, patches: bool = False, polish: bool = False
) -> tuple[float, float, float, float]:
    """Q1 before and after, the mean quality after, and the seconds of relaxing."""
    stopping = Stopping(_SWEEPS, 0.0, target=target)
    options = SmoothOptions(engine=fastest(), threads=1, stopping=stopping, patches=patches, polish=polish)
    _, report = smooth_mesh(mesh, options)
    return report.before.q1 or 0.0, report.after.q1 or 0.0, report.after.mean, report.seconds


if __name__ == "__main__":
    run_by_default("--quick" in sys.argv)
