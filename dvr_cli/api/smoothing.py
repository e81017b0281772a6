"""Smoothing from a mesh to new points and a report: domain, problem, sweeps, what the output keeps."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any, Protocol

import numpy as np

from dvr_cli.api.boundary import moves_of, projected
from dvr_cli.api.options import BOUNDARIES, SmoothOptions
from dvr_cli.api.untangling import untangle_phase, weaker
from dvr_cli.errors import InputError, OutputError
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.relax.choice import checked_threads, chosen_engine, make_engine
from dvr_cli.relax.directions import direction_field, restricted
from dvr_cli.relax.patches import relax_patches
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.projection import Projection
from dvr_cli.relax.sweeps import PHASES, Relaxation, Sweep, polish, relax
from dvr_cli.relax.untangle import untangle
from dvr_cli.report.limits import limit_of
from dvr_cli.report.quality import Quality, measure
from dvr_cli.report.records import SmoothReport, summarise

_FINAL = ("interrupted", "time-limit", "nothing-to-relax", "deviation")  # no phase follows
_DONE = ("converged", "nothing-to-relax")  # the reasons for which relaxing on would gain nothing


class Storage(Protocol):
    """Where the result will be kept: what becomes of coordinates there, and whether that can be bettered."""

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates as they will be read back."""

    def widen(self) -> bool:
        """Keep coordinates in float64 from now on; False if they are already or cannot be."""


def smooth_mesh(
    mesh: Mesh,
    options: SmoothOptions,
    storage: Storage | None = None,
    on_sweep: Callable[[Sweep], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
) -> tuple[np.ndarray, SmoothReport]:
    """Untangle, if asked for, and relax a Mesh; returns its new points (N, 2|3) and the report.

    storage: where the result goes; the points returned and the report's final qualities are those kept there.
    on_sweep, interrupted: see ``sweeps.relax``.

    Raises OutputError if rounding in the storage would make the mesh worse than it was.
    """
    engine_name = chosen_engine(
        options.engine, len(mesh.points), options.stopping.max_iterations, options.patches
    )
    compiled = engine_name == "numba"
    domain = domain_of(mesh, options.straighten, compiled)
    if options.untangle and domain.is_surface:
        raise InputError("a surface in space cannot be untangled; planar and volume meshes can")
    chosen = options.selection.masks(mesh, domain)
    selected = np.logical_and.reduce([mesh.unlinked, *chosen.values()])
    moves = partial(moves_of, mesh, feature_angle=options.feature_angle)
    movement = moves(domain, options.boundary, selected)
    relaxed = movement.relaxed
    field = direction_field(
        options.entries, domain, mesh.point_data, options.seed, options.center, options.axis
    )
    directions = restricted(field, movement.freedom)
    before = measure(domain, mesh.points, relaxed)
    begin = time.perf_counter()
    sliding = movement.freedom.relaxed
    parts = options.order, options.seed, compiled, movement.freedom
    problem = build_problem(domain.corners, sliding, domain.points, *parts)
    engine = make_engine(engine_name, problem, checked_threads(options.threads))
    start, stopping, reference, untangling = domain.points, options.stopping, before, None
    if options.untangle:

        def ended() -> bool:
            return interrupted() or options.stopping.less(time.perf_counter() - begin).time_limit == 0

        untangling = untangle(start, domain.corners, movement.freedom, ended)
        start = untangling.points
        stopping = stopping.less(time.perf_counter() - begin)
        reference = weaker(measure(domain, domain.lift(mesh.points, start), relaxed), before)

    def run(projection: Projection | None) -> Relaxation:
        return relax(engine, start, directions, stopping, on_sweep, interrupted, projection)

    inverted, boundary = None, None
    if movement.curved is None:
        outcome = run(None)
    else:
        outcome, inverted, boundary = projected(run, domain, movement.curved, field, options)
    phases = [_phase("relax", outcome)]
    flat, sweeps, stopped_because = outcome.points, outcome.sweeps, outcome.stopped_because
    if options.patches and len(sliding) and stopped_because in ("converged", "max-iterations"):
        left = options.stopping.less(time.perf_counter() - begin)
        patched = relax_patches(engine, left, len(sweeps), on_sweep, interrupted)
        phases.append(_phase("patches", patched))
        flat, sweeps = patched.points, sweeps + patched.sweeps
        stopped_because = patched.stopped_because
    if options.polish and len(sliding) and stopped_because not in _FINAL:
        floor = max(options.floor * engine.q1(), reference.q1 or 0.0)
        left = options.stopping.less(time.perf_counter() - begin)
        polished = polish(engine, floor, left, len(sweeps), on_sweep, interrupted)
        phases.append({**_phase("polish", polished), "floor": floor})
        flat, sweeps = polished.points, sweeps + polished.sweeps
        if polished.stopped_because in ("interrupted", "time-limit"):
            stopped_because = polished.stopped_because
    seconds = time.perf_counter() - begin
    points = domain.lift(mesh.points, flat)
    if domain.is_tilted and _worse(measure(domain, points, relaxed), reference):
        points, stopped_because = mesh.points.copy(), "rounding"
    measured = partial(measure, domain, relaxed=relaxed, inverted=inverted)
    points, after = _kept(measured, points, reference, storage)
    if untangling is not None:
        phases.insert(0, untangle_phase(untangling, domain, movement.freedom, points))
    limited_by = None
    if stopped_because in _DONE or _capped(after):
        movable = moves(domain, options.boundary, mesh.unlinked).relaxed if chosen else relaxed
        deselected = {
            name: np.isin(np.arange(len(mesh.points)), movable) & ~mask for name, mask in chosen.items()
        }
        others = () if domain.is_surface else BOUNDARIES[BOUNDARIES.index(options.boundary) + 1 :]

        def freed(name: str, vertices: np.ndarray) -> np.ndarray:
            return np.isin(vertices, moves(domain.around(vertices), name, selected).relaxed)

        frees = {f"--boundary {name}": partial(freed, name) for name in others}
        limited_by = limit_of(domain, points, relaxed, after, deselected, frees)
    report = SmoothReport(
        mesh=summarise(mesh, domain),
        relaxed=len(relaxed),
        before=before,
        after=after,
        phases=phases,
        sweeps=[asdict(sweep) for sweep in sweeps],
        stopped_because=stopped_because,
        limited_by=limited_by,
        seconds=seconds,
        engine=engine.name,
        threads=engine.threads,
        options=options.record(),
        boundary=boundary,
    )
    return points, report


def _phase(name: str, outcome: Relaxation) -> dict[str, Any]:
    """A phase as the report gives it."""
    return {
        "phase": name,
        "guarantee": PHASES[name],
        "sweeps": len(outcome.sweeps),
        "stopped_because": outcome.stopped_because,
    }


def _kept(
    measured: Callable[[np.ndarray], Quality], points: np.ndarray, before: Quality, storage: Storage | None
) -> tuple[np.ndarray, Quality]:
    """The points as the storage keeps them, and their quality, which is not below that of the input."""
    if storage is None:
        return points, measured(points)
    kept = storage.stored(points)
    after = measured(kept)
    if _worse(after, before) and storage.widen():
        kept = storage.stored(points)
        after = measured(kept)
    if _worse(after, before):
        raise OutputError(
            f"rounding the coordinates as the output stores them would lower Q1 from {before.q1:.6g} to "
            f"{after.q1:.6g}; choose a format with 64-bit coordinates"
        )
    return kept, after


def _worse(after: Quality, before: Quality) -> bool:
    if after.q1 is None or before.q1 is None:
        return False
    return after.inverted > before.inverted or after.q1 < before.q1


def _capped(quality: Quality) -> bool:
    """Whether the worst element has no relaxed vertex, so that relaxing on cannot better it."""
    return quality.q1 is None or quality.minimum < quality.q1
