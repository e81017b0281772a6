"""Engines against each other: microseconds per vertex update, and the ratios."""

from __future__ import annotations

import meshes
from common import (
    contenders,
    domain_for,
    engine_for,
    print_table,
    random_directions,
    seconds,
    sweep_all,
    times,
    warm_up,
)
from dvr_cli.mesh.mesh import Mesh

_SWEEPS = 10
_ROUNDS = 7  # engines take turns, and the quickest round counts: what slows one is other work on the machine


def run(quick: bool) -> None:
    """Print the table of engines."""
    scale = 10 if quick else 1
    rows = []
    for kind, mesh in {
        "tetrahedra": meshes.random_tets(100_000 // scale),
        "triangles": meshes.random_triangles(100_000 // scale),
        "hexahedra": meshes.shaken_hexes(40 // (2 if quick else 1)),
    }.items():
        rows += _rows(kind, mesh)
    header = ["elements", "free vertices", "corners a ring", "engine", "threads", "µs per update"]
    header += ["against NumPy", "against one thread", "same bytes"]
    print_table("Engines", header, rows)


def _rows(kind: str, mesh: Mesh) -> list[list[object]]:
    engines = {}
    for contender in contenders():
        warm_up(mesh, contender)
        engines[contender] = engine_for(domain_for(mesh, contender), contender)
    taken: dict[tuple[str, int], list[float]] = {contender: [] for contender in engines}
    points = domain_for(mesh, ("numpy", 1)).points
    for _ in range(_ROUNDS):
        for contender, engine in engines.items():
            engine.load(points)
            directions = random_directions(engine, _SWEEPS)
            taken[contender].append(seconds(lambda: sweep_all(engine, directions)))  # noqa: B023
    rings = engines["numpy", 1].problem.rings
    updates = _SWEEPS * len(rings.vertices)
    micro = {contender: min(runs) / updates * 1e6 for contender, runs in taken.items()}
    reference = engines["numpy", 1].points.tobytes()
    return [
        [
            kind,
            len(rings.vertices),
            float(rings.sizes.mean()),
            name,
            threads,
            micro[name, threads],
            times(micro[name, threads], micro["numpy", 1]),
            times(micro[name, threads], micro[name, 1]),
            "yes" if engine.points.tobytes() == reference else "no",
        ]
        for (name, threads), engine in engines.items()
    ]
