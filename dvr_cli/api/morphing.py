"""Morphing: the boundary of a mesh displaced, in as many substeps as keep the mesh valid (paper section 5.3).

A substep moves the held vertices a part of their way and relaxes the others. If elements stay inverted it is
undone and halved; after one that succeeds the next is twice as long.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.relaxer import Relaxer
from dvr_cli.api.smoothing import Storage
from dvr_cli.errors import InputError, OutputError
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.measure import DEGENERATE, Quality, measure
from dvr_cli.relax.phases import MorphPhase
from dvr_cli.relax.stopping import StopReason
from dvr_cli.relax.sweeps import Sweep
from dvr_cli.report.records import SmoothReport, summarise

SMALLEST = 2.0**-10  # part of the displacement that a substep makes at least


def morph_mesh(
    mesh: Mesh,
    displacement: np.ndarray,
    options: SmoothOptions,
    near: int | None = None,
    storage: Storage | None = None,
    on_sweep: Callable[[Sweep], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
) -> tuple[np.ndarray, SmoothReport]:
    """Displace the held vertices of a valid Mesh and relax the others; its new points (N, D) and the report.

    displacement, near: see ``Relaxer.relax``. options: how to relax in each substep, in sweeps alone.
    storage, on_sweep, interrupted: see ``smooth_mesh``; interrupted, it returns the mesh of the last valid
    substep.

    Raises InputError for a mesh that is not valid to begin with, and when even the smallest substep would
    leave elements inverted; OutputError if rounding in the storage would invert elements.
    """
    relaxer = Relaxer.of(mesh, options)
    domain = relaxer.domain
    shift = relaxer.shift(displacement)
    selected = None if near is None else relaxer.near((shift != 0).any(axis=1), near)
    relaxed = np.flatnonzero(domain.interior if selected is None else domain.interior & selected)
    before = measure(domain, mesh.points, relaxed)
    _check_possible(domain, before, relaxer.displace(mesh.points, mesh.points + shift), relaxed)

    start = time.perf_counter()
    points, reached, length = mesh.points.copy(), 0.0, 1.0
    substeps: list[dict[str, Any]] = []
    sweeps: list[Sweep] = []
    reason = StopReason.INTERRUPTED

    def renumber(sweep: Sweep) -> Sweep:
        return replace(sweep, sweep=len(sweeps) + sweep.sweep)

    while reached < 1.0 and not interrupted():
        length = min(length, 1.0 - reached)
        displaced = relaxer.displace(points, mesh.points + (reached + length) * shift)
        target = relaxer.spread(points, displaced, selected)
        moved, step = relaxer.step(
            target, selected, on_sweep and (lambda sweep: on_sweep(renumber(sweep))), interrupted
        )
        if not _valid(domain, moved):
            length /= 2
            if length < SMALLEST and not interrupted():
                raise InputError(_too_far(domain, moved, relaxed, reached))
            continue
        points, reached, length = moved, reached + length, 2 * length
        substeps.append(
            {
                "fraction": reached,
                "q1_before": step.q1_before,
                "q1": step.q1_after,
                "sweeps": len(step.sweeps),
            }
        )
        sweeps += [renumber(sweep) for sweep in step.sweeps]
        reason = step.stopped_because
    seconds = time.perf_counter() - start

    engine, threads = relaxer.at_work
    stopped_because = reason if reached == 1.0 else StopReason.INTERRUPTED
    phase = MorphPhase("morph", len(sweeps), stopped_because, fraction=reached, substeps=substeps)
    points, after = _stored_result(domain, points, relaxed, storage)
    return points, SmoothReport(
        mesh=summarise(mesh, domain),
        relaxed=len(relaxed),
        before=before,
        after=after,
        phases=[phase],
        sweeps=[asdict(sweep) for sweep in sweeps],
        stopped_because=stopped_because,
        limited_by=None,
        seconds=seconds,
        engine=engine,
        threads=threads,
        options={**options.record(), "near": near},
    )


def _valid(domain: Domain, points: np.ndarray) -> bool:
    """True if no element is inverted or degenerate."""
    qualities = corner_qualities(domain.flatten(points), domain.corners, domain.backend)
    return bool(qualities.min() > DEGENERATE)


def _check_possible(domain: Domain, before: Quality, target: np.ndarray, relaxed: np.ndarray) -> None:
    """Raise InputError if the mesh is not valid, or elements that nothing relaxes end inverted."""
    if wrong := before.inverted + before.degenerate:
        raise InputError(
            f"{wrong} inverted or degenerate elements before anything is moved; make the mesh valid first"
        )
    cap = measure(domain, target, relaxed).fixed_cap
    if cap is not None and cap <= DEGENERATE:
        raise InputError("the displacement inverts elements without a vertex to relax; nothing can mend them")


def _too_far(domain: Domain, points: np.ndarray, relaxed: np.ndarray, reached: float) -> str:
    """The message for a displacement that relaxing could not follow."""
    worst = measure(domain, points, relaxed, worst=1).worst[0]
    place = ", ".join(f"{x:.4g}" for x in worst.centroid)
    return (
        f"the mesh stays valid for {100 * reached:.4g} % of the displacement only: beyond, {worst.cell_type} "
        f"{worst.cell} at ({place}) stays inverted; displace less, or mesh anew"
    )


def _stored_result(
    domain: Domain, points: np.ndarray, relaxed: np.ndarray, storage: Storage | None
) -> tuple[np.ndarray, Quality]:
    """The points as the storage keeps them, and their quality: still a valid mesh."""
    if storage is None:
        return points, measure(domain, points, relaxed)
    kept = storage.stored(points)
    if not _valid(domain, kept) and storage.widen():
        kept = storage.stored(points)
    if not _valid(domain, kept):
        raise OutputError(
            "rounding the coordinates as the output stores them would invert elements; choose a format with "
            "64-bit coordinates"
        )
    return kept, measure(domain, kept, relaxed)
