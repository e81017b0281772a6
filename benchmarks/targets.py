"""Target shapes: what looking for layers and targets of their own cost, what set-up costs with that, what is
reached in a metric."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import dvr_cli
import meshes
from common import (
    Contender,
    domain_for,
    engine_for,
    fastest,
    print_table,
    random_directions,
    sweep_all,
    times,
    warm_up,
)
from dvr_cli.api.shapes import shaped
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.measure import measure
from dvr_cli.quality.stretching import coherent

_SWEEPS = 5
_ROUNDS = 7  # targets take turns, and the quickest round counts


def run(quick: bool) -> None:
    """Print the table of targets."""
    scale = 10 if quick else 1
    rows = [
        _row(kind, mesh)
        for kind, mesh in {
            "tetrahedra": meshes.random_tets(58_000 // scale),
            "triangles": meshes.random_triangles(100_000 // scale),
            "hexahedra": meshes.shaken_hexes(40 // (2 if quick else 1)),
        }.items()
    ]
    header = ["elements", "cells", "kept", "ms to look for layers", "in sweeps"]
    header += ["µs per update, ideal", "own shapes", "in a metric"]
    print_table("Targets: CPU time, one thread", header, rows)
    tables = [
        _set_up(kind, make(size))
        for kind, make, sizes in (
            ("triangles", meshes.random_triangles, (10_000, 60_000)),
            ("tetrahedra", meshes.random_tets, (10_000, 60_000)),
            ("hexahedra", meshes.shaken_hexes, (21, 39)),
        )
        for size in (sizes[:1] if quick else sizes)
    ]
    header = ["elements", "vertices", "domain", "search for layers", "measure", "problem", "engine"]
    header += ["set-up in all", "in whole sweeps"]
    print_table("Set-up in sweeps of vertex updates: CPU time, one thread", header, tables)
    rows = [
        *_reached("triangles", meshes.random_triangles(2000)),
        *_reached("tetrahedra", meshes.random_tets(3000)),
    ]
    header = ["elements", "stretched", "Q1", "1 % quantile", "mean", "sweeps"]
    print_table(
        "Metrics: stretched and turned meshes in the metric that undoes it, default options", header, rows
    )


def _row(kind: str, mesh: Mesh) -> list[object]:
    contender = fastest(), 1
    warm_up(mesh, contender)
    domain = domain_for(mesh, contender)
    tensors = np.tile(np.diag(np.arange(1.0, domain.dimension + 1)), (len(domain.points), 1, 1))
    targets = {
        "ideal": domain,
        "input": shaped(domain, "input").domain,
        "metric": shaped(domain, "ideal", tensors).domain,
    }
    found = coherent(domain)
    search = min(_cpu(lambda: coherent(domain)) for _ in range(_ROUNDS))
    micro = _micro_per_update(targets, contender)
    updates = int(domain.interior.sum())
    return [
        kind,
        len(domain.cell_ids),
        0 if found is None else int(found.kept.sum()),
        1e3 * search,
        1e6 * search / (updates * micro["ideal"]),
        micro["ideal"],
        *(times(micro["ideal"], micro[name]) for name in ("input", "metric")),
    ]


def _set_up(kind: str, mesh: Mesh) -> list[object]:
    """What each part of the set-up costs in sweeps of vertex updates, the quickest of some rounds each."""
    contender = fastest(), 1
    warm_up(mesh, contender)
    *parts, rest, sweep = np.min([_set_up_seconds(mesh, contender) for _ in range(_ROUNDS)], axis=0).tolist()
    in_all = sum(parts)
    return [kind, len(mesh.points), *(part / sweep for part in (*parts, in_all)), in_all / (rest + sweep)]


def _set_up_seconds(mesh: Mesh, contender: Contender) -> list[float]:
    """CPU seconds of each part of the set-up, of the directions and Q1 of a sweep, and of its updates."""
    clock = [time.process_time()]
    domain = domain_for(mesh, contender)
    clock.append(time.process_time())
    shapes = shaped(domain, "auto")
    clock.append(time.process_time())
    measure(domain, mesh.points, np.flatnonzero(domain.interior), by_corner=shapes.own_quality)
    clock.append(time.process_time())
    engine = engine_for(domain, contender)
    clock.append(time.process_time())
    engine.load(domain.points)
    engine.q1()
    clock.append(time.process_time())
    directions: list[np.ndarray] = []
    rest = _cpu(lambda: directions.extend(random_directions(engine, _SWEEPS))) / _SWEEPS + _cpu(engine.q1)
    return [*np.diff(clock).tolist(), rest, _cpu(lambda: sweep_all(engine, directions)) / _SWEEPS]


def _reached(kind: str, mesh: Mesh) -> list[list[object]]:
    """What smoothing makes of a mesh, and of the same stretched in its metric."""
    cells = {block.type: block.vertices for block in mesh.cells}
    d = mesh.points.shape[1]
    cos, sin = np.cos(0.5), np.sin(0.5)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])[:d, :d]
    rows: list[list[object]] = []
    for by in (1.0, 10.0, 100.0):
        stretch = turn @ np.array([[by, 0.3 * by, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[:d, :d]
        back = np.linalg.inv(stretch)
        if by == 1.0:
            _, report = dvr_cli.smooth(mesh.points, cells, shape="ideal", threads=1)
        else:
            tensors = np.tile(back.T @ back, (len(mesh.points), 1, 1))
            _, report = dvr_cli.smooth(mesh.points @ stretch.T, cells, metric=tensors, threads=1)
        after = report.after
        rows.append([kind, f"{by:g}×", after.q1, after.quantiles[0.01], after.mean, len(report.sweeps)])
    return rows


def _micro_per_update(targets: dict[str, Domain], contender: tuple[str, int]) -> dict[str, float]:
    """Microseconds of an update with each kind of target."""
    engines = {name: engine_for(domain, contender) for name, domain in targets.items()}
    taken: dict[str, list[float]] = {name: [] for name in engines}
    for _ in range(_ROUNDS):
        for name, engine in engines.items():
            points = targets[name].points
            engine.load(points)
            directions = random_directions(engine, _SWEEPS)
            taken[name].append(_cpu(lambda: sweep_all(engine, directions)))  # noqa: B023
    updates = _SWEEPS * int(targets["ideal"].interior.sum())
    return {name: 1e6 * min(runs) / updates for name, runs in taken.items()}


def _cpu(work: Callable[[], object]) -> float:
    """CPU seconds that ``work`` takes."""
    begin = time.process_time()
    work()
    return time.process_time() - begin
