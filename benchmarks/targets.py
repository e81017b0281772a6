"""Target shapes: what looking for layers costs, and what targets of their own cost an update."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import meshes
from common import domain_for, engine_for, fastest, print_table, random_directions, sweep_all, times, warm_up
from dvr_cli.api.shapes import shaped
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.mesh import Mesh
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


def _micro_per_update(targets: dict[str, Domain], contender: tuple[str, int]) -> dict[str, float]:
    """Microseconds of an update with each kind of target."""
    engines = {name: engine_for(domain, contender) for name, domain in targets.items()}
    taken: dict[str, list[float]] = {name: [] for name in engines}
    for _ in range(_ROUNDS):
        for name, engine in engines.items():
            points = targets[name].points
            engine.load(points)
            directions = random_directions(engine, len(points), _SWEEPS)
            taken[name].append(_cpu(lambda: sweep_all(engine, directions)))  # noqa: B023
    updates = _SWEEPS * int(targets["ideal"].interior.sum())
    return {name: 1e6 * min(runs) / updates for name, runs in taken.items()}


def _cpu(work: Callable[[], object]) -> float:
    """CPU seconds that ``work`` takes."""
    begin = time.process_time()
    work()
    return time.process_time() - begin
