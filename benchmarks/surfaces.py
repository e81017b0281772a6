"""Vertices on surfaces and curved boundaries: how good, how far from the input, how fast, and against others.

Times are CPU seconds on one thread, of the whole call of ``dvr_cli.smooth``, reports and checks included,
once all kernels are compiled; those of a scan are of a process on two threads, from file to file. The
deviation is measured by trimesh, from both sides.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh

import dvr_cli
import meshes
from common import fastest, print_table, random_directions, smooth_file, times, warm_up
from dvr_cli.api.boundary import bound_of, moves_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.options import default
from dvr_cli.quality.badness import badness_of
from dvr_cli.relax.engines.choice import KINDS
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.steepest import STEEPEST
from dvr_cli.report.records import SmoothReport
from surface_smoothers import SMOOTHERS

# subdivisions of the icosphere: the Q1 to reach, and in how many seconds
_GOALS = {4: (0.93, 1.0), 5: (0.85, 3.0), 6: (0.80, 5.0), 7: (0.78, 15.0)}
_SAMPLES = 20_000  # places on each surface whose distance from the other is taken
_SWEEPS = 10
_SHARE = 0.97  # of the bound, which walks keep to at first
_PASSES = (5, 20)
_SCAN = (1250, 400)  # a million triangles
_THREADS = 2  # of the process that smooths it
_PART = 1.25  # the edge length of the part: 61,045 tetrahedra


def run(quick: bool) -> None:
    """Print the tables of ellipsoids, updates, the part and the other tools."""
    first = meshes.noisy_ellipsoid(3, 0)
    warm_up(first, (fastest(), 1))
    header = ["triangles", "folded", "Q1 before", "Q1", "to reach", "1 % quantile", "mean"]
    header += ["CPU seconds", "to reach", "deviation / bound", "by trimesh"]
    print_table("Surfaces: noisy ellipsoids, default options, one thread", header, _ellipsoids(quick))
    header = ["triangles", "Q1 before", "Q1", "seconds", "CPU seconds", "in sweeps", "outside", "peak MB"]
    title = f"Surfaces: a scan, whole process, default options, {_THREADS} threads"
    print_table(title, header, [_scan(*((90, 28) if quick else _SCAN))])
    header = ["mesh", "vertices that walk", "random", "steepest", "polishing"]
    print_table("Surfaces: µs an update, deviation checked, one thread", header, _updates(quick))
    part = meshes.gmsh_part(3.0 if quick else _PART)
    header = [
        "boundary",
        "relaxed",
        "Q1 before",
        "Q1",
        "worst",
        "1 % quantile",
        "mean",
        "CPU seconds",
        "against slide",
    ]
    header += ["deviation / bound"]
    title = f"Surfaces: a part with drilled holes, {len(part.cells[0].vertices)} tetrahedra, default options"
    print_table(title, header, _part(part))
    for name, mesh in _compared(quick):
        header = [
            "tool",
            "passes",
            "Q1",
            "1 % quantile",
            "mean",
            "turned over",
            "deviation / bound",
            "CPU seconds",
        ]
        print_table(f"Surfaces: {name}, one thread", header, _against(mesh))


def _smoothed(mesh: Mesh, **options: str | float) -> tuple[np.ndarray, SmoothReport, float]:
    """The points, the report and the CPU seconds of a call with these options."""
    cells = {block.type: block.vertices for block in mesh.cells}
    begin = time.process_time()
    points, report = dvr_cli.smooth(mesh.points, cells, engine=fastest(), threads=1, **options)
    return points, report, time.process_time() - begin


def _ellipsoids(quick: bool) -> Iterator[list[object]]:
    for subdivisions, (q1, seconds) in _GOALS.items():
        for folded in (0, 1):
            if quick and subdivisions > min(_GOALS):
                continue
            mesh = meshes.noisy_ellipsoid(subdivisions, folded)
            points, report, taken = _smoothed(mesh)
            assert report.boundary is not None
            bound, after = report.boundary.max_deviation, report.after
            row: list[object] = [len(mesh.cells[0].vertices), "yes" if folded else "no", report.before.q1]
            row += [after.q1, q1, after.quantiles[0.01], after.mean, taken, seconds]
            yield [*row, report.boundary.deviation / bound, _compare(mesh, points).deviation / bound]


def _scan(around: int, across: int) -> list[object]:
    """The row of a surface as scanners see them, smoothed from file to file."""
    mesh = meshes.scanned_torus(around, across)
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "scan.ply"
        trimesh.Trimesh(mesh.points, mesh.cells[0].vertices, process=False).export(source)
        used, report = run = smooth_file(source, _THREADS)
    swept = sum(run.phases.values())
    row: list[object] = [len(mesh.cells[0].vertices), report["before"]["q1"], report["after"]["q1"]]
    return [*row, used.elapsed, used.cpu, swept, used.elapsed - swept, used.memory]


def _updates(quick: bool) -> Iterator[list[object]]:
    """Sweeps over the vertices that walk alone, from the input, with the limit a run has."""
    yield _per_update("ellipsoid", meshes.noisy_ellipsoid(4 if quick else 6, 0), "fixed")
    yield _per_update("boundary of the part", meshes.gmsh_part(3.0 if quick else _PART), "project")


def _per_update(name: str, mesh: Mesh, boundary: str) -> list[object]:
    engine = _walking(mesh, boundary)
    updates = len(engine.problem.rings.vertices)
    row: list[object] = [name, updates]
    for phase in (_random, _steepest, _polishing):
        least = np.inf
        for _ in range(3):
            engine.load(mesh.points)
            sweeps = phase(engine)
            begin = time.process_time()
            for sweep in sweeps:
                for batch in range(engine.batches):
                    sweep(batch)
            least = min(least, time.process_time() - begin)
        row.append(1e6 * least / (_SWEEPS * updates))
    return row


def _walking(mesh: Mesh, boundary: str) -> Engine:
    """An engine for the vertices of a mesh that walk."""
    kind = KINDS[fastest()]
    domain = domain_of(mesh, backend=kind.backend)
    everywhere = np.ones(len(mesh.points), dtype=bool)
    moves = moves_of(mesh, domain, boundary, everywhere, default("feature_angle"))
    assert moves.parts is not None
    how = {"backend": kind.backend, "freedom": moves.within, "parts": moves.parts}
    problem = build_problem(domain.corners, moves.parts.walking, domain.points, **how)
    return kind.make(problem.keeping_within(_SHARE * bound_of(domain, None)), 1)


_Update = Callable[[int], object]  # of the vertices of a batch


def _random(engine: Engine) -> list[_Update]:
    """The updates of each sweep along random directions, drawn before."""
    drawn = random_directions(engine, _SWEEPS)
    return [partial(engine.relax_batch, directions=directions) for directions in drawn]


def _steepest(engine: Engine) -> list[_Update]:
    return [partial(engine.move_batch, directions=STEEPEST)] * _SWEEPS


def _polishing(engine: Engine) -> list[_Update]:
    limit = badness_of(engine.q1(), engine.problem.dimension)
    return [lambda batch: engine.polish_batch(batch, limit)] * _SWEEPS


def _part(mesh: Mesh) -> Iterator[list[object]]:
    warm_up(mesh, (fastest(), 1))
    runs = {boundary: _smoothed(mesh, boundary=boundary) for boundary in ("fixed", "slide", "project")}
    for boundary in runs:  # what it takes the first time is not its speed
        taken = _smoothed(mesh, boundary=boundary)[2]
        runs[boundary] = *runs[boundary][:2], taken
    for boundary, (_, report, taken) in runs.items():
        after, change = report.after, report.boundary
        row: list[object] = [boundary, report.relaxed, report.before.q1, after.q1, after.minimum]
        row += [after.quantiles[0.01], after.mean, taken, times(runs["slide"][2], taken)]
        yield [*row, change.deviation / change.max_deviation if change else ""]


def _compared(quick: bool) -> Iterator[tuple[str, Mesh]]:
    for subdivisions in list(_GOALS)[: 1 if quick else 3]:
        for folded, noise in enumerate(("without folds", "with folds")):
            mesh = meshes.noisy_ellipsoid(subdivisions, folded)
            yield f"ellipsoid of {len(mesh.cells[0].vertices)} triangles {noise}", mesh
    if not quick:
        try:
            yield "the Stanford bunny", meshes.scanned_bunny()
        except ImportError as error:
            print(f"\nThe Stanford bunny is left out: {error}")


def _against(mesh: Mesh) -> Iterator[list[object]]:
    points, report, taken = _smoothed(mesh)
    assert report.boundary is not None
    bound = report.boundary.max_deviation
    yield ["input", "", *_compare(mesh, mesh.points).row(bound), ""]
    yield ["dvr, default options", "", *_compare(mesh, points).row(bound), taken]
    for tool, smooth in SMOOTHERS.items():
        for passes in _PASSES:
            try:
                points, taken = smooth(mesh.points, mesh.cells[0].vertices, passes)
            except ImportError as error:
                yield [f"{tool}: not installed ({error})", *[""] * 7]
                break
            found = _compare(mesh, points)
            yield [tool, passes, *found.row(bound), taken]
        else:  # no farther from the input than that
            points, _, taken = _smoothed(mesh, max_deviation=found.deviation)
            yield ["dvr, within that deviation", "", *_compare(mesh, points).row(bound), taken]


class _Comparison(NamedTuple):
    """A surface against its input.

    qualities: (n,) mean ratios, positive. turned_over: how many triangles are on the other side of the facet
    of the input that is nearest to their middle. deviation: the largest distance found, either way.
    """

    qualities: np.ndarray
    turned_over: int
    deviation: float

    def row(self, bound: float) -> list[object]:
        """The figures as the table has them."""
        worst, low, mean = self.qualities.min(), np.quantile(self.qualities, 0.01), self.qualities.mean()
        return [float(worst), float(low), float(mean), self.turned_over, self.deviation / bound]


def _compare(mesh: Mesh, points: np.ndarray) -> _Comparison:
    """``mesh`` with its vertices at ``points`` (N, 3) against itself, by trimesh."""
    triangles = mesh.cells[0].vertices
    before = trimesh.Trimesh(mesh.points, triangles, process=False)
    after = trimesh.Trimesh(points, triangles, process=False)
    squares = (np.diff(points[triangles[:, [0, 1, 2, 0]]], axis=1) ** 2).sum(axis=(1, 2))
    farthest = 0.0
    for one, other in ((before, after), (after, before)):
        places = trimesh.sample.sample_surface(one, _SAMPLES, seed=0)[0]
        corners = one.vertices[:: max(len(one.vertices) // _SAMPLES, 1)]
        farthest = max(farthest, _distance(other, np.concatenate([places, corners])))
    facet = trimesh.proximity.closest_point(before, after.triangles_center)[2]
    turned = (np.cross(*np.diff(points[triangles], axis=1).swapaxes(0, 1)) * before.face_normals[facet]).sum(
        axis=1
    )
    qualities = 4.0 * np.sqrt(3.0) * after.area_faces / squares
    return _Comparison(qualities, int((turned < 0.0).sum()), farthest)


def _distance(surface: trimesh.Trimesh, places: np.ndarray) -> float:
    """The largest distance of places from a surface."""
    return float(trimesh.proximity.closest_point(surface, places)[1].max())
