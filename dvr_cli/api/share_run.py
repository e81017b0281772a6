"""Runs on a mesh that no rank has whole: all phases, and whether they are to be made again with weights."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from dvr_cli.api.away_from_layers import least_qualities, vertices_of, weighted, weights_from
from dvr_cli.api.boundary import Moves
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.phases import Run
from dvr_cli.api.share_setup import Mine, Work
from dvr_cli.api.untangling import reference_quality
from dvr_cli.boundary.freedom import interior_freedom
from dvr_cli.distributed.job import LEAD
from dvr_cli.distributed.ranks import agree
from dvr_cli.distributed.share_engine import ShareEngine
from dvr_cli.distributed.share_quality import is_at_least, minima_of, quality_of
from dvr_cli.distributed.shared_parts import share_of
from dvr_cli.distributed.shares import Store
from dvr_cli.distributed.tangle import Tangle
from dvr_cli.mesh.orientation import turned_cells
from dvr_cli.quality.mean_ratio import element_qualities
from dvr_cli.quality.measure import Quality
from dvr_cli.relax.directions import DirectionField, restrict_field
from dvr_cli.relax.engines.choice import KINDS
from dvr_cli.relax.sweeps import Sweep


class Hooks(NamedTuple):
    """The functions that tell and ask the leading rank meanwhile, see ``sweeps.relax``."""

    on_sweep: Callable[[Sweep], None] | None = None
    interrupted: Callable[[], bool] = lambda: False


class Attempt(NamedTuple):
    """One of the runs that may be needed.

    field: of directions in the whole. before: the quality of the input. untangling: whether it is untangled
    first. weight, spent: as in ``smoothing``.
    """

    field: DirectionField
    before: Quality
    untangling: bool
    weight: np.ndarray | None = None
    spent: float = 0.0


def made(
    comm: Any, store: Store, mine: Mine, work: Work, hooks: Hooks, attempt: Attempt
) -> tuple[Run, ShareEngine, Quality]:
    """A run of all phases, its engine, and the quality that the result must not be below."""
    local, domain, moves, view, options = mine.local, mine.domain, mine.moves, mine.view, work.options
    share = mine.share
    if attempt.weight is not None:
        heavier = replace(domain, corners=weighted(domain.corners, attempt.weight))
        share = share_of(comm, store, local, heavier, moves.freedom)
    engine = ShareEngine(comm, KINDS[work.engine], share, options.threads)
    field = restrict_field(attempt.field, moves.freedom, local.index)
    anywhere = Moves(interior_freedom(moves.freedom.dimension > 0, domain.dimension), None)  # as the field is
    asked = _asked(comm, hooks.interrupted)
    run = Run(domain, anywhere, engine, options, hooks.on_sweep, asked, 0.0, attempt.spent)
    reference = attempt.before
    if attempt.untangling:
        run.begin_with(tangle_of(store, mine).untangled(_ends(options, hooks.interrupted)))
        after = quality_of(comm, view, domain.lift(local.mesh.points, run.points), False)
        reference = reference_quality(after, attempt.before)
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
    return run, engine, reference


def weights_needed(
    comm: Any,
    store: Store,
    mine: Mine,
    points: np.ndarray,
    q1s: tuple[float, float],
    given: np.ndarray | None,
) -> np.ndarray | None:
    """(c,) the weights of the rank's cells, see ``away_from_layers.weights_needed``; None on all or on none.

    points: reached. q1s: of input and result. given: the weights so far.
    """
    local, domain = mine.local, mine.domain
    if mine.layers is None or mine.layers.max_aspect == 1.0:
        return None
    both = points, local.mesh.points
    fell = given is not None and not is_at_least(comm, *(minima_of(mine.view, some) for some in both))
    new, old = (element_qualities(domain.flatten(some), domain.corners) for some in both)
    least = least_qualities(
        domain,
        vertices_of(domain, mine.layers.kept),
        old,
        partial(store.as_owned, local),
        lambda value: min(comm.allgather(float(value))),
    )
    below = any(comm.allgather(bool((new < least).any())))
    return weights_from(least, q1s, fell, below, given, partial(agree, comm))


def tangle_of(store: Store, mine: Mine) -> Tangle:
    """The mesh as one of which elements may be tangled."""
    mirrored = np.zeros(len(mine.local.cells), dtype=bool)
    if mine.mirrored is not None:
        mirrored = mine.mirrored
    elif mine.domain.mirrored:
        mirrored = turned_cells(mine.local.mesh.cells[: len(mine.domain.cells)], mine.domain.cells)
    others = mine.share.relaxed, mine.targets
    return Tangle(store, mine.local, mine.domain, mirrored, mine.moves.freedom, *others)


def _ends(options: SmoothOptions, interrupted: Callable[[], bool]) -> Callable[[], bool]:
    """The answer of this rank alone to whether it is time to end."""
    start = time.perf_counter()
    return lambda: interrupted() or options.stopping.less(time.perf_counter() - start).time_limit == 0


def _asked(comm: Any, interrupted: Callable[[], bool]) -> Callable[[], bool]:
    """The answer of the leading rank, on all ranks."""
    return lambda: bool(comm.bcast(interrupted() if comm.rank == LEAD else None, LEAD))
