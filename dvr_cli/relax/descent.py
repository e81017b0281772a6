"""Descent: before anything else the price of all elements falls, and that finds the level of care.

First the sum of 1/Q alone counts. From then on elements below the quality that a few of them stay below cost
much more (``polish``), and only the rings near it are visited, as long as the low end of the mesh grows.

On a surface vertices have less room: there all rings are visited, what costs more is said anew in each sweep,
and vertices go beyond where their own price is lowest, which spares most of the sweeps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.quality.level import level_of
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.stopping import Stopping, StopReason
from dvr_cli.relax.sweeps import Relaxation, Sweep, Work, polish

if TYPE_CHECKING:
    from dvr_cli.relax.engines.engine import State

_PHASE = "descent"
_DEAR = 0.032  # share of the elements that cost more,
_DEAR_WALKING = 0.05  # and where some walk: measured, with less Q1 ends lower, with more it takes longer
_NEAR = 1.1  # rings below so much of the quality at which that begins are visited
_LOW_END = 0.01  # share of the elements whose growth counts
# On surfaces. Measured: with 1.5 half as many sweeps as with 1, from 1.9 on the worst elements get worse.
_DEAR_ON_SURFACE = 0.1  # share of the elements that cost more
_STRETCH = 1.7  # how many times as far as to the lowest price vertices go
_GROWTH = 1.5  # times the tolerance: what the low end has to grow by in each sweep


@dataclass(frozen=True)
class Descent:
    """The result of a descent.

    outcome: as of any phase. floor: below which no quality fell. level: of care, and dear: the quality below
    which elements cost more. They are None where the mesh is too tangled, and ``dear`` on surfaces, too.
    """

    outcome: Relaxation
    floor: float
    level: float | None
    dear: float | None


def descend(
    engine: Engine,
    stopping: Stopping,
    on_sweep: Callable[[Sweep], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
    qualities: np.ndarray | None = None,
) -> Descent:
    """Lower the price from where the engine is; see ``sweeps.polish`` for the other arguments.

    No quality falls below the Q1 of the start. Should the quality vector fall, the descent is undone.
    """
    start, problem = engine.state(), engine.problem
    floor = engine.q1()
    qualities = engine.qualities() if qualities is None else qualities
    before = engine.ring_qualities(qualities)
    hooks = on_sweep, interrupted
    if problem.is_surface:
        slower = replace(stopping, tol=_GROWTH * stopping.tol)
        work = Work(_PHASE, measure=_low_end, known=qualities)
        outcome = polish(engine, floor, slower, 0, *hooks, _aim_on_surface, work)
        outcome = _kept(engine, outcome, start, before)
        level = engine.level(outcome.of_corners(engine))
        return Descent(outcome, floor, level if level > 0.0 else None, None)
    work = Work(_PHASE, foresees=True, known=qualities)
    outcome = polish(engine, floor, stopping, 0, *hooks, work=work)
    dear = engine.level(outcome.of_corners(engine), _DEAR if problem.carriers is None else _DEAR_WALKING)
    if not outcome.stopped_because.cuts_short and dear > 0.0:
        done, aim = len(outcome.sweeps), Aim(dear, relative=True)
        rest = stopping.less(sum(sweep.seconds for sweep in outcome.sweeps))
        work = Work(_PHASE, _NEAR * dear, _low_end, known=outcome.qualities)
        low = polish(engine, floor, rest, done, *hooks, aim, work)
        outcome = replace(low, sweeps=outcome.sweeps + low.sweeps)
    outcome = _kept(engine, outcome, start, before)
    level = engine.level(outcome.of_corners(engine))
    return Descent(outcome, floor, *((level, dear) if level > 0.0 else (None, None)))


def _kept(engine: Engine, outcome: Relaxation, start: State, before: np.ndarray) -> Relaxation:
    """``outcome``, undone if the quality vector is below ``before`` (m,); start: where all was then."""
    if engine.is_at_least(engine.ring_qualities(outcome.of_corners(engine)), before):
        return outcome
    engine.restore(start)
    cut = outcome.stopped_because
    return Relaxation(engine.points, [], cut if cut.cuts_short else StopReason.UNDONE)


def _aim_on_surface(qualities: np.ndarray) -> Aim:
    """The price on a surface with these qualities (C,)."""
    return Aim(max(level_of(qualities, _DEAR_ON_SURFACE), 0.0), stretch=_STRETCH)


def _low_end(engine: Engine, qualities: np.ndarray) -> float:
    return engine.level(qualities, _LOW_END, 0)
