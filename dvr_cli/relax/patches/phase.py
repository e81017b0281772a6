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

import time
from collections.abc import Callable

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.quality.badness import badness_of, quality_growth
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.patches.neighbourhoods import ROUND, Neighbourhoods, Patches
from dvr_cli.relax.patches.solver import Patch
from dvr_cli.relax.problem import Problem
from dvr_cli.relax.stopping import Stopping, StopReason
from dvr_cli.relax.sweeps import Relaxation, Sweep, cut_short

LAYERS = 4  # around a corner's own vertices at most; beyond them hardly anything gains
_AROUND_OTHERS = 2  # with a level of care, around all corners but the worst: more cost much for little
PROGRESS = 0.01  # relative growth of a patch's smallest quality below which a layer more is tried
_SHARE, _LEAST = 3e-4, 64  # patches that can be paid for: this part of the corners, and so many at least
_BEYOND = 1e-6  # relative quality by which a patch goes beyond the level
_CANDIDATES = 30 * ROUND  # worst corners looked at for the patches of a round


def relax_patches(
    engine: Engine,
    stopping: Stopping,
    done: int = 0,
    on_sweep: Callable[[Sweep], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
    level: float | None = None,
) -> Relaxation:
    """Relax patches from where the engine is, the worst first, until the worst corner gains no more.

    level: of care; with it until no corner below it gains any more, or once the patches that can be paid for
    are used up until the worst corner gains no more; and no patch is moved further than that.

    A round of patches counts as a sweep. stopping: its target, max_iterations and time_limit hold. done: how
    many sweeps came before. on_sweep: called after each round. interrupted: asked before each patch; when
    true the mesh reached is the result. Every intermediate mesh is valid and no worse.
    """
    problem, start = engine.problem, time.perf_counter()
    if not len(problem.relaxed):
        return Relaxation(engine.points, [], StopReason.NOTHING_TO_RELAX)
    state = _State(problem, engine.coordinates, level, engine.altitude)
    neighbourhoods = Neighbourhoods(problem, engine.backend)
    rounds: list[Sweep] = []

    def time_is_up() -> bool:
        return cut_short(start, stopping, interrupted) is not None

    while (reason := cut_short(start, stopping, interrupted) or state.done(stopping.target)) is None:
        if len(rounds) == stopping.max_iterations:
            reason = StopReason.MAX_ITERATIONS
            break
        round_start = time.perf_counter()
        if engine.hand_over():
            state.points, neighbourhoods = engine.coordinates, Neighbourhoods(problem, engine.backend)
        patches = neighbourhoods.choose(state.worst(), state.layers)
        badness = engine.solve_patches(state.points, state.enter(patches), time_is_up)
        moved = state.leave(patches, np.array(badness))
        number, seconds = done + len(rounds) + 1, time.perf_counter() - round_start
        rounds.append(Sweep(number, "patches", state.q1, moved, seconds, below=state.below))
        if on_sweep is not None:
            on_sweep(rounds[-1])
    return Relaxation(engine.points, rounds, reason)


class _State:
    """The state of the phase: the engine's coordinates, changed in place, the quality of each touched
    corner, and how many layers are to be freed around it.
    """

    def __init__(self, problem: Problem, points: np.ndarray, level: float | None, altitude: float) -> None:
        self._touched, self.points = problem.touched, points
        d = problem.dimension
        self.slot = np.full(len(self.points), -1, dtype=np.int32)  # of freed vertices: number in their patch
        freedom = Freedom(np.full(len(self.points), d, dtype=np.uint8), np.zeros_like(self.points))
        if problem.freedom is not None:
            freedom.dimension[problem.rings.vertices] = problem.freedom.dimension
            freedom.axis[problem.rings.vertices] = problem.freedom.axis
        # the last fields of each ``Patch``: the shape table, and each vertex's freedom
        table = self._touched.table
        self.rules = table.norm, table.factor, freedom.dimension, freedom.axis
        self._level = np.inf if level is None else level
        self.enough = 0.0 if level is None else badness_of(level * (1.0 + _BEYOND), d)
        self._altitude = float(altitude)
        self.quality = corner_qualities(self.points, self._touched)
        self._left = len(self.quality) if level is None else max(_LEAST, int(_SHARE * len(self.quality)))
        self.layers = np.ones(len(self.quality), dtype=np.int64)  # to be freed around each corner
        free = np.zeros(len(self.points), dtype=bool)
        free[problem.rings.vertices[problem.free_rings]] = True
        self._beyond = ~free[self._touched.vertices].any(axis=1)  # the corners all of whose vertices walk
        self.layers[self._beyond] = LAYERS + 1

    @property
    def q1(self) -> float:
        """Q1: the worst quality of a touched corner."""
        return float(self.quality.min())

    @property
    def below(self) -> float | None:
        """The share of the corners that are below the level of care; None without one."""
        return None if self._level == np.inf else float((self.quality < self._level).mean())

    def done(self, target: float | None) -> StopReason | None:
        """The reason to end, or None: Q1 is at the target, or every layer was tried around what matters.

        That is the worst corner, or with a level of care all that are below it.
        """
        if target is not None and self.q1 >= target:
            return StopReason.TARGET
        if self._level == np.inf:
            worst = np.where(self._beyond, np.inf, self.quality).argmin()
            return StopReason.CONVERGED if self.layers[worst] > LAYERS else None
        return None if len(self.worst()) else StopReason.CONVERGED

    def worst(self) -> np.ndarray:
        """The worst corners that may gain, worst first; of equals the first."""
        may, among = self.layers <= LAYERS, self.quality
        if self._level < np.inf:
            first = int(np.where(self._beyond, np.inf, self.quality).argmin())
            may &= self.quality < self._level
            others = (self.layers <= _AROUND_OTHERS) & (self._left > 0)
            may &= others | (np.arange(len(may)) == first)
            among = self.quality[may]
        if len(among) > _CANDIDATES:
            may &= self.quality <= np.partition(among, _CANDIDATES - 1)[_CANDIDATES - 1]
        worst = np.flatnonzero(may)
        return worst[np.argsort(self.quality[worst], kind="stable")]

    def enter(self, patches: Patches) -> list[Patch]:
        """Get ready to solve these patches; returns them as the solver takes them."""
        parts = [patches.of(patch) for patch in range(len(patches))]
        for freed, _, _ in parts:
            self.slot[freed] = np.arange(len(freed))
        return [Patch(*part, self.slot, *self.rules, self.enough, self._altitude) for part in parts]

    def leave(self, patches: Patches, badness: np.ndarray) -> int:
        """Record the result of solving these patches; returns how many vertices moved.

        badness: (P, 2) largest of each patch before and after.
        """
        self._left -= len(patches)
        self.slot[patches.freed] = -1
        corners = patches.corners
        self.quality[corners] = corner_qualities(self.points, self._touched.part(corners))
        with np.errstate(invalid="ignore"):  # infinite before and after: no growth
            growth = quality_growth(badness[:, 0], badness[:, 1], self._touched.dimension)
        grown = growth >= PROGRESS
        self.layers[patches.seeds[~grown]] += 1
        # with more layers an inverted corner would be in the patch as well
        self.layers[patches.seeds[np.isinf(badness[:, 0])]] = LAYERS + 1
        self.layers[corners[np.repeat(grown, np.diff(patches.corner_start))]] = 1
        return int(np.diff(patches.freed_start)[badness[:, 1] < badness[:, 0]].sum())
