"""Smoothing a mesh that no rank has whole: from byte ranges of a file to its copy and a report.

Ranks run the phases of a run side by side. What this does not do, ``smooth_mesh`` does with the mesh on the
leading rank, and with the same result; so whatever is unusual is left to that.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dvr_cli.api.altitudes import lowers_altitude
from dvr_cli.api.boundary import Moves
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.phases import Run
from dvr_cli.api.share_selection import masks_of, regions_of_kinds
from dvr_cli.api.smoothing import DONE, freer, has_nothing_to_gain, is_worse
from dvr_cli.api.untangling import reference_quality, untangle_phase
from dvr_cli.boundary.freedom import interior_freedom
from dvr_cli.distributed.job import LEAD
from dvr_cli.distributed.layers import Layers, NeedsAll, layers_among
from dvr_cli.distributed.member import take_turns
from dvr_cli.distributed.orientation import mirrored_of, of_cells
from dvr_cli.distributed.ranks import on_all
from dvr_cli.distributed.rows import bounds, owner_of, sent
from dvr_cli.distributed.share_engine import ShareEngine
from dvr_cli.distributed.share_quality import View, is_at_least, minima_of, quality_of
from dvr_cli.distributed.share_reading import own_range, read_share, store_of, values_of_tags, with_regions
from dvr_cli.distributed.share_writing import write_copy
from dvr_cli.distributed.shared_parts import Share, share_of
from dvr_cli.distributed.shares import CellRows, Local, Store
from dvr_cli.distributed.sliding import sliding
from dvr_cli.distributed.tangle import Tangle
from dvr_cli.errors import DvrError, InputError, UsageError
from dvr_cli.files.ranges import Ranges
from dvr_cli.mesh.corners import Corners
from dvr_cli.mesh.domain import Domain, domain_of
from dvr_cli.mesh.neighbours import within_rings
from dvr_cli.mesh.orientation import are_alike, turned_cells
from dvr_cli.mesh.ranks import distinct
from dvr_cli.mesh.region_choice import NONE, Divider, RegionChoice
from dvr_cli.quality.limits import HeldBy, Limit, limit_of
from dvr_cli.quality.mean_ratio import DEGENERATE, corner_qualities, element_qualities
from dvr_cli.quality.measure import Quality
from dvr_cli.quality.stretching import REACH, held_by
from dvr_cli.relax.directions import direction_field, restrict_field
from dvr_cli.relax.engines.choice import KINDS
from dvr_cli.relax.phases import TANGLED
from dvr_cli.relax.sweeps import Sweep
from dvr_cli.report.records import MeshSummary, ShapeUse, SmoothReport, summarise

_DIRECTIONS = ("random", "x", "y", "z", "axis", "steepest", "narrowing", "optimal")


class Work(NamedTuple):
    """The work of a job: how the vertices of a mesh move, and what is said of that.

    engine: the name of a kind. vector: whether the leading rank gets quality vectors. counts: how many cells
    of each type the whole has. once: whether a lower cell that is there twice would have to count once. held:
    as in ``Ranges``.
    """

    options: SmoothOptions
    engine: str
    vector: bool
    counts: dict[str, int]
    once: bool
    held: tuple[tuple[int, int], ...] = ()


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
        return Work(self.options, self.engine, self.vector, ranges.counts, ranges.once, ranges.held)


class Hooks(NamedTuple):
    """The functions that tell and ask the leading rank meanwhile, see ``sweeps.relax``."""

    on_sweep: Callable[[Sweep], None] | None = None
    interrupted: Callable[[], bool] = lambda: False


def takes(options: SmoothOptions) -> bool:
    """True if a run with these options needs no rank that has the whole mesh.

    These are all phases, along directions that do not depend on the mesh as a whole.
    """
    named = all(isinstance(entry, str) and entry in _DIRECTIONS for entry in options.entries)
    return (
        named
        and options.selection is not None  # so that files are read here
        and options.metric is None
        and not isinstance(options.region_choice, np.ndarray)
        and options.boundary in ("fixed", "slide")
        and options.order == "coloured"
        and options.shape in ("auto", "ideal")
    )


def smooth_shares(comm: Any, task: Task, hooks: Hooks | None = None) -> SmoothReport | DvrError | None:
    """Smooth a mesh of which each rank reads and writes a part, on all ranks together.

    hooks: of the leading rank. Returns there the report, or the error with which it has ended; on all ranks
    None, with nothing written, where the mesh has to be on one rank for the result of ``smooth_mesh``: where
    anything is wrong with it, or layers may have to be kept.
    """
    try:
        changed = on_all(comm, lambda: _changed(task.source))
        values = on_all(comm, lambda: values_of_tags(comm, task.source, task.ranges))
        chosen = with_regions(comm, task.ranges, values)
        if chosen is None:
            return None
        ranges, regions = chosen
        (read,) = on_all(comm, lambda: [read_share(comm, task.source, ranges)])
    except DvrError as error:
        return error
    if not _agree(comm, read is not None) or read is None:
        return None
    take_turns(KINDS[task.engine])
    store = store_of(comm, ranges, regions, read)
    del read
    result = smooth_store(comm, store, task.work, hooks or Hooks())
    if result is None:
        return None
    if not _agree(comm, _changed(task.source) == changed):
        return InputError(f"{task.source}: it has changed while it was being smoothed")
    rows = ranges.points
    first, values = _for_file(comm, store, task, result.vertices, result.points)
    return write_copy(comm, task.source, task.output, rows, first, values) or result.report


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
    mine = _prepared(comm, store, work, KINDS[work.engine].backend)
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


def _agree(comm: Any, good: bool) -> bool:
    """True if it is good on all ranks."""
    return all(comm.allgather(good))


class _Mine(NamedTuple):
    """The work of a rank: its cells, their domain, how its vertices move, its share, its view of all.

    mirrored: (c,) bool, the cells stored inside out, None where their measures say so. regions: (kinds,) of
    the cells of each kind; dividers: what tells them apart. movable: (n,) bool, vertices that could move, and
    masks: for each criterion those that it lets move, right for those of the rank. layers: what is kept, and
    held: (n,) bool, the vertices that stay for its sake.
    """

    local: Local
    domain: Domain
    mirrored: np.ndarray | None
    regions: np.ndarray
    dividers: tuple[Divider, ...]
    movable: np.ndarray
    masks: dict[str, np.ndarray]
    moves: Moves
    share: Share
    view: View
    layers: Layers | None
    held: np.ndarray


def _prepared(comm: Any, store: Store, work: Work, backend: Any) -> _Mine | None:
    """The work of this rank; None on all ranks where the mesh has to be on one, see ``smooth_shares``."""
    is_surface = len(store.axes) > store.kinds.dimension
    if is_surface or not _agree(comm, len(store.cells.ids) > 0):
        return None
    if work.once and not _agree(comm, not _has_repeated(store)):
        return None
    looks, looked, layers = work.options.shape == "auto", False, None
    try:
        if looks and comm.size > 1:
            looked, layers = _layers(comm, store, backend)
        regions, dividers = regions_of_kinds(comm, store, work.options.region_choice)
    except (NeedsAll, UsageError):  # the leading rank will say so
        return None
    local = store.local(store.cells, store.lower)
    oriented = _oriented(comm, store, local, regions, backend)
    if oriented is None:
        return None
    domain, mirrored, quality = oriented
    owned = store.owned(store.cells.cells)
    try:
        if looks and comm.size == 1:  # it has all there is
            layers = layers_among(comm, store, store.cells, local, domain, quality)
        elif looks and not looked:
            looked, layers = _layers(comm, store, backend, mirrored)
            if not looked:
                return None
    except NeedsAll:
        return None
    held = np.zeros(len(local.number), dtype=bool)
    if layers is not None:
        held = store.as_owned(local, held_by(domain, layers.kept, quality))
        corners, all_held = _with_held(domain.corners, layers.kept, held)
        if not _agree(comm, all_held):
            return None  # some need a row in the table of targets
        domain = replace(domain, corners=corners)
    del oriented, quality  # large, and needed no more
    moves = Moves(interior_freedom(domain.interior, domain.dimension), None)
    if work.options.boundary == "slide":
        slides = sliding(comm, store, local, domain)
        if slides is None:
            return None
        moves = Moves(slides[0], None, slides[1])
    try:
        masks = masks_of(store, local, domain, work.options.selection)
    except UsageError:
        return None
    movable = moves.freedom.dimension > 0
    selected = np.logical_and.reduce([~held, *masks.values()])
    moves = replace(moves, freedom=moves.freedom.only(selected))
    share = share_of(comm, store, local, domain, moves.freedom)
    own = np.flatnonzero(share.own & share.relaxed)
    ends = np.array(work.held, dtype=np.int64).ravel()  # of ranges, ascending
    if not _agree(comm, not (np.searchsorted(ends, local.index[own], side="right") % 2).any()):
        return None
    domain = replace(domain, cell_ids=local.cells)
    view = View(domain, owned, share.relaxed, own, local.index[own])
    return _Mine(local, domain, mirrored, regions, dividers, movable, masks, moves, share, view, layers, held)


def _with_held(corners: Corners, kept: np.ndarray, held: np.ndarray) -> tuple[Corners, bool]:
    """The corners as ``with_targets`` makes them, and whether those of all kept cells are held.

    kept: (c,) bool, of the cells; held: (n,) bool, the vertices that stay for their sake.
    """
    of_kept = np.repeat(kept, np.diff(corners.start))
    of_held = of_kept & held[corners.vertices].all(axis=1)
    return replace(corners, held=of_held if of_held.any() else None), bool((of_held == of_kept).all())


def _has_repeated(store: Store) -> bool:
    """True if a lower cell is here twice."""
    cells = store.lower.cells
    rows = np.column_stack([np.array(store.kinds.sizes)[store.lower.kinds], np.sort(cells, axis=1)])
    return len(np.unique(rows, axis=0)) < len(rows)


def _oriented(
    comm: Any, store: Store, local: Local, regions: np.ndarray, backend: Any
) -> tuple[Domain, np.ndarray | None, np.ndarray] | None:
    """The domain of a rank's mesh, its ``mirrored`` (see ``_Mine``), and (C,) the quality of its corners.

    Where all cells are positive and alike once those of negative measure are turned, no other way to orient
    the whole is; else it is followed from rank to rank. None on all where a cell is there twice, or rounding
    would decide.
    """
    of_cells = _per_cell(regions, local)
    domain = domain_of(local.mesh, backend=backend, regions=of_cells)
    if not _agree(comm, not len(domain.repeated)):
        return None
    quality = corner_qualities(domain.points, domain.corners, backend)
    good = bool((quality > DEGENERATE).all())
    ways = set(comm.allgather(domain.mirrored / len(local.cells)))
    if len(ways) > 1 or not ways <= {0.0, 1.0}:
        good = good and are_alike(domain.cells, backend)
    if _agree(comm, good):
        return domain, None, quality
    mirrored = mirrored_of(comm, store, local, domain, backend)
    if mirrored is None:
        return None
    domain = domain_of(local.mesh, backend=backend, regions=of_cells, mirrored=mirrored)
    return domain, mirrored, corner_qualities(domain.points, domain.corners, backend)


def _per_cell(regions: np.ndarray, local: Local) -> RegionChoice:
    """The regions of the cells of a mesh; regions: (kinds,) of those of each kind."""
    return regions[local.kinds] if regions.any() else (NONE,)


def _layers(
    comm: Any, store: Store, backend: Any, mirrored: np.ndarray | None = None
) -> tuple[bool, Layers | None]:
    """False if it could not be found out what is kept; and that. mirrored: see ``_Mine``.

    It cannot where cells are not positive and ``mirrored`` is not given. Raises NeedsAll, on all ranks.
    """
    cells = store.within(REACH)
    none = CellRows(*(column[:0] for column in store.lower))
    local = store.local(cells, none)
    turned = None if mirrored is None else of_cells(store, mirrored, cells)
    domain = domain_of(local.mesh, backend=backend, mirrored=turned)
    if not _agree(comm, not len(domain.repeated)):
        raise NeedsAll
    quality = corner_qualities(domain.points, domain.corners, backend)
    if mirrored is None and not _agree(comm, bool((quality > DEGENERATE).all())):
        return False, None
    return True, layers_among(comm, store, cells, local, domain, quality)


def _smoothed(
    comm: Any, store: Store, mine: _Mine, work: Work, hooks: Hooks
) -> tuple[SmoothReport | None, np.ndarray]:
    """The report, None where the result is not what it should be, and the rank's coordinates reached."""
    local, domain, moves, share, view = mine.local, mine.domain, mine.moves, mine.share, mine.view
    options, kind = work.options, KINDS[work.engine]
    try:
        field = direction_field(options.entries, domain, {}, options.seed, options.center, options.axis)
    except UsageError:  # the leading rank will say so
        return None, domain.points
    before = quality_of(comm, view, local.mesh.points, work.vector)
    untangling = options.untangle
    if untangling is None:
        untangling = options.is_free and options.stopping.max_iterations > 0 and before.inverted > 0
    start = time.perf_counter()
    engine = ShareEngine(comm, kind, share, options.threads)
    field = restrict_field(field, moves.freedom, local.index)
    anywhere = Moves(interior_freedom(moves.freedom.dimension > 0, domain.dimension), None)  # as the field is
    run = Run(domain, anywhere, engine, options, hooks.on_sweep, _asked(comm, hooks.interrupted), 0.0)
    reference = before
    if untangling:
        run.begin_with(_tangle(store, mine).untangled(_ends(options, hooks.interrupted)))
        after = quality_of(comm, view, domain.lift(local.mesh.points, run.points), False)
        reference = reference_quality(after, before)
    if options.takes_descent and engine.batches:
        run.descend()
    run.relax(field)
    if options.takes_patches:
        run.relax_patches()
    if options.takes_polish:
        run.polish(reference.q1 or 0.0)
    if options.polish is None and run.polished:
        reached = domain.lift(local.mesh.points, run.points)
        minima = minima_of(view, reached), minima_of(view, local.mesh.points)
        if not is_at_least(comm, *minima):
            run.undo_polish()
    points = domain.lift(local.mesh.points, run.points)
    after = quality_of(comm, view, points, work.vector)
    seconds = time.perf_counter() - start
    if is_worse(after, reference) or (options.keeps_altitude and lowers_altitude(after, reference)):
        return None, points
    again = options.stopping.target is None and not run.stopped_because.cuts_short
    if again and _fell_away_from_layers(comm, store, mine, points, before):
        return None, points  # it is to be made with weights
    left = dict.fromkeys(TANGLED, 0)
    if after.inverted + after.degenerate:
        left = _tangle(store, mine).left(run.points)
    if run.untangling is not None:
        run.phases.insert(0, untangle_phase(run.untangling, left))
    unmoved = _agree(comm, np.array_equal(points, local.mesh.points))
    plain = None
    if mine.layers is not None:
        ideal = replace(view, domain=replace(domain, corners=replace(domain.corners, held=None)))
        both = (quality_of(comm, ideal, some, work.vector) for some in (local.mesh.points, points))
        plain = next(both), next(both)
    limited_by = None
    ended = run.stopped_because in DONE or after.is_capped
    if ended and not has_nothing_to_gain(after, unmoved):
        mends = left["elements"] > left["hopeless"] and not untangling
        limited_by = _limit(comm, store, mine, points, after, options, mends)
    report = SmoothReport(
        shape=ShapeUse(options.shape_mode, *((0, 1.0) if mine.layers is None else mine.layers[1:])),
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


def _fell_away_from_layers(comm: Any, store: Store, mine: _Mine, points: np.ndarray, before: Quality) -> bool:
    """True if a cell away from layers has become worse than the worst of them was, see ``weights_needed``."""
    local, domain = mine.local, mine.domain
    if mine.layers is None or (before.q1 or 0.0) <= 0.0:
        return False
    rows = [block.vertices for block in domain.cells]
    both = local.mesh.points, points
    old, new = (element_qualities(domain.flatten(some), domain.corners) for some in both)
    near = np.zeros(len(local.number), dtype=bool)
    near[domain.corners.vertices[np.repeat(mine.layers.kept, np.diff(domain.corners.start))]] = True
    fell = False
    for rings in range(2):
        near = store.as_owned(local, within_rings(rows, near, rings))
        away = mine.view.cells & np.concatenate([~near[block].any(axis=1) for block in rows])
        least = min(comm.allgather(float(old[away].min(initial=np.inf))))
        fell |= any(comm.allgather(bool((new[away] < least).any())))
    return fell


def _tangle(store: Store, mine: _Mine) -> Tangle:
    """The mesh as one of which elements may be tangled."""
    mirrored = np.zeros(len(mine.local.cells), dtype=bool)
    if mine.mirrored is not None:
        mirrored = mine.mirrored
    elif mine.domain.mirrored:
        mirrored = turned_cells(mine.local.mesh.cells[: len(mine.domain.cells)], mine.domain.cells)
    return Tangle(store, mine.local, mine.domain, mirrored, mine.moves.freedom, mine.share.relaxed)


def _ends(options: SmoothOptions, interrupted: Callable[[], bool]) -> Callable[[], bool]:
    """The answer of this rank alone to whether it is time to end."""
    start = time.perf_counter()
    return lambda: interrupted() or options.stopping.less(time.perf_counter() - start).time_limit == 0


def _asked(comm: Any, interrupted: Callable[[], bool]) -> Callable[[], bool]:
    """The answer of the leading rank, on all ranks."""
    return lambda: bool(comm.bcast(interrupted() if comm.rank == LEAD else None, LEAD))


def _summary(comm: Any, store: Store, mine: _Mine, counts: dict[str, int]) -> MeshSummary:
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


def _limit(
    comm: Any,
    store: Store,
    mine: _Mine,
    points: np.ndarray,
    after: Quality,
    options: SmoothOptions,
    mends: bool,
) -> Limit | None:
    """The limit of the whole, on the leading rank: from the cells around the worst ones alone.

    mends: whether untangling helps, see ``limit_of``.
    """
    local, domain, share = mine.local, mine.domain, mine.share
    worst = np.isin(local.cells, [element.cell for element in after.worst])
    place = np.repeat(worst, np.diff(domain.corners.start))
    named = distinct(local.number[domain.corners.vertices[place].ravel()])
    named = distinct(np.concatenate(comm.allgather(named)))
    if comm.rank != LEAD:
        named = named[:0]
    cells = store.around(named)
    near = store.local(cells, store.lower_around(named))
    mirrored = None if mine.mirrored is None else of_cells(store, mine.mirrored, cells)
    d = points.shape[1]
    flags = np.stack([domain.interior, share.relaxed, mine.movable, mine.held, *mine.masks.values()], axis=1)
    kept = None if mine.layers is None else of_cells(store, mine.layers.kept, cells)
    rows = np.zeros((store.count, d + flags.shape[1]))
    rows[:, :d] = store.points
    rows[local.number[share.own] - store.first] = np.hstack([points, flags])[share.own]
    around, _ = store.of_others(near.number, rows)
    if comm.rank != LEAD:
        return None
    # two vertices more, of no cell, so that the mesh is as large as the whole
    corners = np.stack([store.low, store.high])
    small = replace(near.mesh, points=np.concatenate([near.mesh.points, corners]))
    interior, relaxed, movable, held, *masks = np.pad(around[:, d:].T > 0.0, ((0, 0), (0, 2)))
    free = np.logical_and.reduce([~held, *masks])
    of_small = domain_of(small, regions=_per_cell(mine.regions, near), mirrored=mirrored)
    of_small = replace(of_small, interior=interior, cell_ids=near.cells)
    if kept is not None:
        of_small = replace(of_small, corners=_with_held(of_small.corners, kept, held)[0])
    not_chosen = {name: movable & ~mask for name, mask in zip(mine.masks, masks, strict=True)}
    return limit_of(
        of_small,
        np.concatenate([around[:, :d], corners]),
        np.flatnonzero(relaxed),
        after,
        HeldBy(not_chosen, freer(small, of_small, options.boundary, free, options.feature_angle)),
        mends,
        names=np.append(near.index, (-1, -1)),
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
