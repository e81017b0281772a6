"""The sweep loops: the paper's Algorithm 1 over batches, and polishing, until a criterion is met.

Each is a phase of a run with a guarantee of its own, see ``phases``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dvr_cli.quality.badness import badness_of
from dvr_cli.relax.care import Care
from dvr_cli.relax.directions import DirectionField
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.polish import PLAIN, Aim
from dvr_cli.relax.stopping import Stopping, StopReason


@dataclass(frozen=True)
class Sweep:
    """One sweep: its number from 1, its phase, Q1 after it, vertices moved, seconds taken.

    mean: after a sweep of polishing, the mean quality of the corners with a relaxed vertex. below: where
    there is a level of care, the share of what is below it: of rings after relaxing, else of those corners.
    """

    sweep: int
    phase: str
    q1: float
    moved: int
    seconds: float
    mean: float | None = None
    below: float | None = None


@dataclass(frozen=True, eq=False)
class Relaxation:
    """The result of a phase: coordinates (N, d), the sweeps done, why they stopped.

    qualities: (C,) of the engine's corners there, if they are known.
    """

    points: np.ndarray
    sweeps: list[Sweep]
    stopped_because: StopReason
    qualities: np.ndarray | None = None

    def of_corners(self, engine: Engine) -> np.ndarray:
        """``qualities``, those where the engine is if none are known."""
        return engine.qualities() if self.qualities is None else self.qualities


def relax(
    engine: Engine,
    points: np.ndarray | None,
    field: DirectionField,
    stopping: Stopping,
    on_sweep: Callable[[Sweep], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
    care: Care | None = None,
    done: int = 0,
) -> Relaxation:
    """Relax the vertices of the engine's problem from ``points`` (N, d), None for where the engine is.

    care: for the rings of the engine where it is; with it only those below its level move, no further than
    needed, until all have settled. Without, all move as far as there is anything to gain, until Q1 has
    converged.
    on_sweep: called after each sweep. interrupted: asked after each batch; when true the mesh reached is the
    result. done: how many sweeps came before. Every intermediate mesh is valid and no worse (Theorem 4.10).
    """
    start = engine.now()
    if points is not None:
        engine.load(points)
    if not engine.relaxes:
        return Relaxation(engine.points, [], StopReason.NOTHING_TO_RELAX)
    history = [engine.q1() if care is None else care.q1]
    sweeps: list[Sweep] = []

    # towards a target they go as far as they can, as they have to make room for each other
    enough = 0.0
    if care is not None and stopping.target is None:
        enough = badness_of(care.level, engine.problem.dimension)

    def ended() -> StopReason | None:
        seconds = engine.now() - start
        return stopping.reason(history, seconds) if care is None else care.reason(len(sweeps), seconds)

    while (reason := ended()) is None:
        sweep_start = engine.now()
        moved = 0
        mover, active = (engine, None) if care is None else engine.focused(care.active)
        directions = mover.directions(field, len(sweeps), active)
        for batch in range(engine.batches):
            engine.hand_over()
            moved += mover.move_batch(batch, directions, active, enough)
            if (cut := cut_short(engine, start, stopping, interrupted)) is not None:
                return Relaxation(engine.points, sweeps, cut)
        if care is not None:
            care.update()
        history.append(engine.q1() if care is None else care.q1)
        number, seconds = done + len(sweeps) + 1, engine.now() - sweep_start
        below = None if care is None else care.below
        sweeps.append(Sweep(number, "relax", history[-1], moved, seconds, below=below))
        if on_sweep is not None:
            on_sweep(sweeps[-1])
    if not sweeps:  # what ended untangling early is then the reason
        reason = cut_short(engine, start, stopping, interrupted) or reason
    return Relaxation(engine.points, sweeps, reason, None if care is None else care.qualities)


class Work(NamedTuple):
    """The work of a phase of polishing.

    phase: its name in the sweeps. below: only rings with a worse quality are visited. measure: what of an
    engine's qualities of corners has to grow, None for their mean. foresees: whether the phase ends already
    where the next sweep would let it grow too little, if its growth fell by as much again as it did in the
    last. known: (C,) the qualities of corners where it begins, if they are known.
    """

    phase: str = "polish"
    below: float = np.inf
    measure: Callable[[Engine, np.ndarray], float] | None = None
    foresees: bool = False
    known: np.ndarray | None = None

    def reached(self, engine: Engine, qualities: np.ndarray, mean: float) -> float:
        """The measure of the qualities (C,) reached, whose mean is known."""
        return mean if self.measure is None else self.measure(engine, qualities)


_POLISHING = Work()


def polish(
    engine: Engine,
    floor: float,
    stopping: Stopping,
    done: int = 0,
    on_sweep: Callable[[Sweep], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
    aim: Aim | Callable[[np.ndarray], Aim] = PLAIN,
    work: Work = _POLISHING,
) -> Relaxation:
    """Raise the mean quality from where the engine is, with no quality that is above the floor falling below.

    Each vertex moves by Newton's step (see ``newton``), or if it walks along the direction in which the price
    of its ring (see ``polish``) falls fastest. Stops when the measure of the
    ``work`` grows by less than ``stopping.tol`` in a sweep (or would in the next, see ``Work``), and after
    its max_iterations and time_limit. done: how many sweeps came before. on_sweep, interrupted: see
    ``relax``. aim: the price, and whether the floor is one for all, or what says that in each sweep for the
    qualities (C,) reached.
    """
    limit = badness_of(floor, engine.problem.dimension)
    start = engine.now()
    qualities = engine.qualities() if work.known is None else work.known
    reached, growth = work.reached(engine, qualities, engine.mean(qualities)), 0.0
    sweeps: list[Sweep] = []
    while len(sweeps) < stopping.max_iterations:
        sweep_start = engine.now()
        moved = 0
        now = aim(qualities) if callable(aim) else aim
        active = None if work.below == np.inf else engine.ring_qualities(qualities) < work.below
        for batch in range(engine.batches):
            engine.hand_over()
            moved += engine.polish_batch(batch, limit, now, active)
            if (cut := cut_short(engine, start, stopping, interrupted)) is not None:
                return Relaxation(engine.points, sweeps, cut)
        qualities, before = engine.qualities(), reached
        mean = engine.mean(qualities)
        reached = work.reached(engine, qualities, mean)
        seconds = engine.now() - sweep_start
        below = engine.share(qualities < floor) if now.by_ring else None
        number, q1 = done + len(sweeps) + 1, engine.lowest(qualities)
        sweeps.append(Sweep(number, work.phase, q1, moved, seconds, mean, below))
        if on_sweep is not None:
            on_sweep(sweeps[-1])
        previous, growth = growth, reached - before
        falls = work.foresees and 0.0 < growth < previous
        if (growth * growth / previous if falls else growth) < stopping.tol:
            return Relaxation(engine.points, sweeps, StopReason.CONVERGED, qualities)
    return Relaxation(engine.points, sweeps, StopReason.MAX_ITERATIONS, qualities)


def cut_short(
    engine: Engine, start: float, stopping: Stopping, interrupted: Callable[[], bool]
) -> StopReason | None:
    """The reason to stop in the middle of a sweep, or None; start: when the phase began (``Engine.now``)."""
    if interrupted():
        return StopReason.INTERRUPTED
    if stopping.time_limit is not None and engine.now() - start >= stopping.time_limit:
        return StopReason.TIME_LIMIT
    return None
