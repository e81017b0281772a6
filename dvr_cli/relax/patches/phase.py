"""Worst-first patches: where single vertices jam, a worst corner's neighbourhood is moved together.

After some sweeps Q1 is decided by a few places in which no vertex alone can gain. The corners are taken worst
first; around each the relaxed vertices within some layers are freed, and moved together by ``solver``,
which accepts a patch only if the smallest quality of its corners grows. That suffices for the guarantee: be m
that quality before. A vertex whose ring minimum is at most m afterwards has it from a corner outside the
patch, which has not changed, so its ring minimum was no larger before; and the freed vertices of the worst
corner had m and have more. So the quality vector grows in the paper's ordering (eq. 2), and Q1 never falls.

A corner that gains little is tried again with one more layer. The patches of a round share no corner: they
are as independent as the vertices of a batch, so the result does not depend on their order or on threads.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dvr_cli.quality.badness import badness_of
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.patches.neighbourhoods import CANDIDATES, ROUND
from dvr_cli.relax.patches.rounds import Solved, has_grown
from dvr_cli.relax.stopping import Stopping, StopReason
from dvr_cli.relax.sweeps import Relaxation, Sweep, cut_short

LAYERS = 4  # around a corner's own vertices at most; beyond them hardly anything gains
_AROUND_OTHERS = 2  # with a level of care, around all corners but the worst: more cost much for little
_SHARE, _LEAST = 3e-4, 64  # patches that can be paid for: this part of the corners, and so many at least
_BEYOND = 1e-6  # relative quality by which a patch goes beyond the level
_ROUNDS = 8  # in which those are used up at the earliest: on many cores and ranks many are solved at once


def relax_patches(
    engine: Engine,
    stopping: Stopping,
    done: int = 0,
    on_sweep: Callable[[Sweep], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
    level: float | None = None,
    known: np.ndarray | None = None,
) -> Relaxation:
    """Relax patches from where the engine is, the worst first, until the worst corner gains no more.

    level: of care; with it until no corner below it gains any more, or once the patches that can be paid for
    are used up until the worst corner gains no more; and no patch is moved further than that.

    A round of patches counts as a sweep. stopping: its target, max_iterations and time_limit hold. done: how
    many sweeps came before. on_sweep: called after each round. interrupted: asked before each patch; when
    true the mesh reached is the result. known: (C,) the qualities of corners where it begins, if they are
    known. Every intermediate mesh is valid and no worse.
    """
    start = engine.now()
    if not engine.relaxes:
        return Relaxation(engine.points, [], StopReason.NOTHING_TO_RELAX)
    state, rounds = _State(engine, level, known), engine.rounds()
    sweeps: list[Sweep] = []

    def time_is_up() -> bool:
        return cut_short(engine, start, stopping, interrupted) is not None

    while (reason := cut_short(engine, start, stopping, interrupted) or state.done(stopping.target)) is None:
        if len(sweeps) == stopping.max_iterations:
            reason = StopReason.MAX_ITERATIONS
            break
        round_start = engine.now()
        if engine.hand_over():
            rounds = engine.rounds()
        solved = rounds.solve(state.worst, state.quality, state.layers, state.most, state.enough, time_is_up)
        state.take_over(solved)
        number, seconds = done + len(sweeps) + 1, engine.now() - round_start
        sweeps.append(Sweep(number, "patches", state.q1, solved.moved, seconds, below=state.below))
        if on_sweep is not None:
            on_sweep(sweeps[-1])
    return Relaxation(engine.points, sweeps, reason, state.quality)


class _State:
    """The state of the phase, of the corners that this process answers for.

    quality: (C,) of each, and layers: (C,) how many are to be freed around it. worst: the worst of those that
    may gain, worst first, of equals the first. most: patches of a round. enough: the badness with which a
    patch is good enough.
    """

    def __init__(self, engine: Engine, level: float | None, known: np.ndarray | None) -> None:
        self._engine = engine
        d = engine.problem.dimension
        self._level = np.inf if level is None else level
        self.enough = 0.0 if level is None else badness_of(level * (1.0 + _BEYOND), d)
        self.quality = engine.qualities() if known is None else known
        count = engine.total(len(self.quality))
        paid = int(_SHARE * count)
        self._left = count if level is None else max(_LEAST, paid)
        self.most = ROUND if level is None else max(ROUND, paid // _ROUNDS)
        self.layers = np.ones(len(self.quality), dtype=np.int64)
        self._look()

    @property
    def q1(self) -> float:
        """Q1: the worst quality of a touched corner."""
        return self._engine.lowest(self.quality)

    @property
    def below(self) -> float | None:
        """The share of the corners that are below the level of care; None without one."""
        return None if self._level == np.inf else self._engine.share(self.quality < self._level)

    def done(self, target: float | None) -> StopReason | None:
        """The reason to end, or None: Q1 is at the target, or every layer was tried around what matters.

        That is the worst corner, or with a level of care all that are below it.
        """
        if target is not None and self.q1 >= target:
            return StopReason.TARGET
        if self._level == np.inf:
            tried = self._first >= 0 and bool(self.layers[self._first] > LAYERS)
            return StopReason.CONVERGED if self._engine.total(tried) else None
        return None if self._engine.total(len(self.worst)) else StopReason.CONVERGED

    def _look(self) -> None:
        """Find the worst corners."""
        self._first = self._engine.first_of_lowest(self.quality)
        if self._level < np.inf:
            worst = np.flatnonzero(self.quality < self._level)
            among = (self.layers[worst] <= _AROUND_OTHERS) & (self._left > 0)
            worst = worst[among | (worst == self._first) & (self.layers[worst] <= LAYERS)]
        else:
            worst = np.flatnonzero(self.layers <= LAYERS)
        most = CANDIDATES * self.most
        if len(worst) > most:
            values = self.quality[worst]
            worst = worst[values <= np.partition(values, most - 1)[most - 1]]
        self.worst = worst[np.argsort(self.quality[worst], kind="stable")][:most]

    def take_over(self, solved: Solved) -> None:
        """Take over what a round has changed."""
        self._left -= solved.patches
        self.quality[solved.corners] = solved.quality
        grown = has_grown(solved.badness, self._engine.problem.dimension)
        self.layers[solved.seeds[~grown]] += 1
        # with more layers an inverted corner would be in the patch as well
        self.layers[solved.seeds[np.isinf(solved.badness[:, 0])]] = LAYERS + 1
        self.layers[solved.corners[solved.grown]] = 1
        self._look()
