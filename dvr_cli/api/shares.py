"""Smoothing a mesh that no rank has whole: from byte ranges of a file to its copy and a report.

Ranks run the phases of a run side by side. What this does not do, ``smooth_mesh`` does with the mesh on the
leading rank, and with the same result; so whatever is unusual is left to that.
"""

from __future__ import annotations

import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dvr_cli.api.altitudes import lowers_altitude
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.share_limit import limit_of_whole
from dvr_cli.api.share_run import Attempt, Hooks, made, tangle_of, weights_needed
from dvr_cli.api.share_setup import Mine, Work, prepared
from dvr_cli.api.smoothing import DONE, has_nothing_to_gain, is_worse
from dvr_cli.api.untangling import untangle_phase
from dvr_cli.distributed.member import take_turns
from dvr_cli.distributed.ranks import agree, on_all
from dvr_cli.distributed.rows import bounds, owner_of, sent
from dvr_cli.distributed.share_quality import quality_of
from dvr_cli.distributed.share_reading import (
    own_range,
    read_share,
    store_of,
    values_of_tags,
    with_indices,
    with_regions,
)
from dvr_cli.distributed.share_writing import stale_parts, write_copy
from dvr_cli.distributed.shares import Store
from dvr_cli.errors import DvrError, InputError, UsageError
from dvr_cli.files.losses import parameters_dropped
from dvr_cli.files.ranges import Ranges
from dvr_cli.mesh.orientation import turned_cells
from dvr_cli.quality.metric import tensors_of
from dvr_cli.relax.directions import direction_field
from dvr_cli.relax.engines.choice import KINDS
from dvr_cli.relax.phases import TANGLED
from dvr_cli.report.records import MeshSummary, ShapeUse, SmoothReport, summarise

_DIRECTIONS = ("random", "x", "y", "z", "axis", "steepest", "narrowing", "optimal")


class Task(NamedTuple):
    """The task of a job: ranges of ``source``, what is written at ``output``, and how vertices move.

    options, engine, vector: see ``Work``.
    """

    source: Path
    ranges: Ranges
    output: Path
    options: SmoothOptions
    engine: str
    vector: bool

    @property
    def work(self) -> Work:
        """The work between reading and writing."""
        ranges = self.ranges
        return Work(self.options, self.engine, self.vector, ranges.counts, ranges.once)


def takes(options: SmoothOptions) -> bool:
    """True if a run with these options needs no rank that has the whole mesh.

    These are all phases, along directions that do not depend on the mesh as a whole.
    """
    named = all(isinstance(entry, str) and entry in _DIRECTIONS for entry in options.entries)
    return (
        named
        and options.selection is not None  # so that files are read here
        and (options.metric_source is None or not options.metric_source.is_file)
        and not isinstance(options.region_choice, np.ndarray)
        and options.boundary in ("fixed", "slide")
        and options.order == "coloured"
        and options.shape in ("auto", "ideal", "input")
    )


class Written(NamedTuple):
    """The report of a run that has written its mesh, and notes on what the file could not keep."""

    report: SmoothReport
    notes: list[str]


def smooth_shares(comm: Any, task: Task, hooks: Hooks | None = None) -> Written | DvrError | None:
    """Smooth a mesh of which each rank reads and writes a part, on all ranks together.

    hooks: of the leading rank. Returns there what has been written, or the error with which it has ended; on
    all ranks None, with nothing written, where the mesh has to be on one rank for the result of
    ``smooth_mesh``: where anything is wrong with it, or layers may have to be kept.
    """
    try:
        changed = on_all(comm, lambda: _changed(task.source))
        values = on_all(comm, lambda: values_of_tags(comm, task.source, task.ranges))
        chosen = with_regions(comm, task.ranges, values)
        if chosen is None:
            return None
        ranges, regions = chosen
        field = None if task.options.metric is None else str(task.options.metric)
        (read,) = on_all(comm, lambda: [read_share(comm, task.source, ranges, field)])
    except DvrError as error:
        return error
    found = with_indices(comm, ranges, read)
    if found is None:
        return None
    read, linked = found
    del found
    take_turns(KINDS[task.engine])
    work = task.work
    store = store_of(comm, ranges, regions, read)
    store.linked = linked
    if read.field is not None:
        tensors = tensors_among(comm, store, read.field)
        if tensors is None:
            return None
        work = work._replace(tensors=tensors)
    del read
    result = smooth_store(comm, store, work, hooks or Hooks())
    if result is None:
        return None
    if not agree(comm, _changed(task.source) == changed):
        return InputError(f"{task.source}: it has changed while it was being smoothed")
    rows = ranges.points
    first, values = _for_file(comm, store, task, result.vertices, result.points)
    stale = stale_parts(comm, task.source, rows, first, values)
    dropped = sum(part.rows.count for part in rows.parts if part.flag in stale)
    fault = write_copy(comm, task.source, task.output, rows, first, values, stale)
    return fault or Written(result.report, parameters_dropped(dropped))


def tensors_among(comm: Any, store: Store, values: np.ndarray) -> np.ndarray | None:
    """(n, k, k) the tensors of the vertices that the rank owns; None on all ranks where some are none.

    values: what a field has for the vertices of its range by index, see ``rows.bounds``.
    """
    try:
        return store.of_own(on_all(comm, lambda: tensors_of(values, len(values))))
    except InputError:  # the leading rank will say so
        return None


class Smoothed(NamedTuple):
    """The result for a store: the report, and where the vertices are that this rank owns.

    vertices: (n,) the index of these in the whole, and points: (n, D).
    """

    report: SmoothReport
    vertices: np.ndarray
    points: np.ndarray


def smooth_store(comm: Any, store: Store, work: Work, hooks: Hooks) -> Smoothed | None:
    """Smooth a mesh of which each rank has a store, on all ranks together.

    None on all where the mesh has to be on one rank, see ``smooth_shares``.
    """
    mine = prepared(comm, store, work, KINDS[work.engine].backend)
    if mine is None:
        return None
    report, moved = _smoothed(comm, store, mine, work, hooks)
    own = mine.share.own
    return None if report is None else Smoothed(report, mine.local.index[own], moved[own])


def _changed(source: Path) -> int:
    """When a file was last changed; raises InputError where it is no more."""
    try:
        return source.stat().st_mtime_ns
    except OSError as error:
        raise InputError(f"{source}: {(error.strerror or str(error)).lower()}") from error


def _smoothed(
    comm: Any, store: Store, mine: Mine, work: Work, hooks: Hooks
) -> tuple[SmoothReport | None, np.ndarray]:
    """The report, None where the result is not what it should be, and the rank's coordinates reached."""
    local, domain, view = mine.local, mine.domain, mine.view
    options, kind = work.options, KINDS[work.engine]
    try:
        how = options.seed, options.center, options.axis, local.index
        field = direction_field(options.entries, domain, {}, *how)
    except UsageError:  # the leading rank will say so
        return None, domain.points
    before = quality_of(comm, view, local.mesh.points, work.vector)
    untangling = options.untangle
    if untangling is None:
        untangling = options.is_free and options.stopping.max_iterations > 0 and before.inverted > 0
    start = time.perf_counter()
    attempt = Attempt(field, before, untangling)
    while True:
        run, engine, reference = made(comm, store, mine, work, hooks, attempt)
        points = domain.lift(local.mesh.points, run.points)
        after = quality_of(comm, view, points, work.vector)
        if is_worse(after, reference) or (options.keeps_altitude and lowers_altitude(after, reference)):
            return None, points
        if options.stopping.target is not None or run.stopped_because.cuts_short:
            break
        q1s = before.q1 or 0.0, after.q1 or 0.0
        weight = weights_needed(comm, store, mine, points, q1s, attempt.weight)
        if weight is None:
            break
        attempt = attempt._replace(weight=weight, spent=run.seconds)
    seconds = time.perf_counter() - start
    left = dict.fromkeys(TANGLED, 0)
    if after.inverted + after.degenerate:
        left = tangle_of(store, mine).left(run.points)
    if run.untangling is not None:
        run.phases.insert(0, untangle_phase(run.untangling, left))
    unmoved = agree(comm, np.array_equal(points, local.mesh.points))
    plain = None
    if mine.layers is not None or work.tensors is not None:
        ideal = replace(view, domain=replace(domain, corners=mine.plain))
        both = (quality_of(comm, ideal, some, work.vector) for some in (local.mesh.points, points))
        plain = next(both), next(both)
    limited_by = None
    ended = run.stopped_because in DONE or after.is_capped
    if ended and not has_nothing_to_gain(after, unmoved):
        mends = left["elements"] > left["hopeless"] and not untangling
        limited_by = limit_of_whole(comm, store, mine, points, after, options, mends)
    report = SmoothReport(
        shape=ShapeUse(options.shape_mode, 0 if mine.layers is None else mine.layers.number, mine.max_aspect),
        plain=plain,
        mesh=_summary(comm, store, mine, work.counts),
        relaxed=comm.allreduce(len(view.own)),
        before=before,
        after=after,
        phases=run.phases,
        sweeps=[asdict(sweep) for sweep in run.sweeps],
        stopped_because=run.stopped_because,
        limited_by=limited_by,
        left=left,
        level=run.level,
        seconds=seconds,
        engine=kind.name_of(engine),
        threads=engine.threads,
        options=options.record() | {"untangle": untangling},
    )
    return report, points


def _summary(comm: Any, store: Store, mine: Mine, counts: dict[str, int]) -> MeshSummary:
    """The summary of the whole mesh."""
    cells, mirrored = mine.domain.cells, 0
    if mine.domain.mirrored:
        turned = turned_cells(mine.local.mesh.cells[: len(cells)], cells)
        mirrored = int((turned & mine.view.cells).sum())
    return replace(
        summarise(mine.local.mesh, mine.domain, mine.moves.constraints),
        points=store.size,
        cells=counts,
        mirrored=comm.allreduce(mirrored),
        regions=int(mine.regions.max()) + 1,
        divided_by=mine.dividers,
        orphans=store.size - comm.allreduce(int(mine.share.own.sum())),
    )


def _for_file(comm: Any, store: Store, task: Task, index: np.ndarray, points: np.ndarray) -> Any:
    """The first row that this rank writes, and its rows: those it has read, with what its owners moved.

    index: (n,) of the vertices that this rank owns in the whole, and points: (n, 3).
    """
    index, points = sent(comm, owner_of(index, bounds(store.size, comm.size)), index, points)
    first, last = own_range(comm, task.ranges.points)
    rows = task.ranges.points.read(task.source, first, last)
    assert rows is not None  # as before
    rows[index - first] = points
    return first, rows
