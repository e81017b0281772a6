"""The phases of a run, one after the other: untangle, relax, patches, polish (see ``relax.phases``).

A phase that many runs do without is imported by those that have it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.api.altitudes import altitude_bound
from dvr_cli.api.boundary import Moves, change_of
from dvr_cli.api.options import SmoothOptions
from dvr_cli.beside import beside
from dvr_cli.mesh.domain import Domain
from dvr_cli.relax.care import Care
from dvr_cli.relax.directions import DirectionField, restrict_field
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.phases import Phase, PolishPhase
from dvr_cli.relax.polish import PLAIN, Aim
from dvr_cli.relax.stopping import Stopping, StopReason
from dvr_cli.relax.sweeps import Relaxation, Sweep, Work, polish, relax
from dvr_cli.report.records import BoundaryChange

if TYPE_CHECKING:
    from dvr_cli.relax.engines.engine import State
    from dvr_cli.relax.untangle.phase import Untangling

_FLOOR = 0.999  # of Q1, where polishing has one floor for all and nobody gave another
_KEPT = 0.015  # share of the elements whose qualities are kept when, in the end, the mean alone is raised
_WORTH = 0.1  # of the level of care: a ring that gains less in a sweep has settled, and patches take over
_NEAR = 0.01  # of Q1, from there the level of care goes no lower for the sake of the mean


class Run:
    """A run: where its phases have brought the vertices, and a record of each.

    points: (N, d) coordinates reached. phases: as in SmoothReport. sweeps: of all phases.
    untangling: the result of untangling. boundary: the change of a boundary or surface on which vertices
    walked. level: of care (see ``relax.care``). All three are None without that.
    """

    def __init__(
        self,
        domain: Domain,
        moves: Moves,
        engine: Engine,
        options: SmoothOptions,
        on_sweep: Callable[[Sweep], None] | None,
        interrupted: Callable[[], bool],
        rounding: float,
        spent: float = 0.0,
    ) -> None:
        """Begin at the points of the domain; on_sweep, interrupted: see ``sweeps.relax``.

        rounding: of the result's coordinates, see ``altitude_bound``. spent: seconds that a run before took.
        """
        self._domain, self._moves, self._engine, self._options = domain, moves, engine, options
        self._rounding = rounding
        self._on_sweep, self._interrupted = on_sweep, interrupted
        self._began = engine.now() - spent
        self._start = moves.start(domain.points)
        self.points = self._start
        self.stopped_because = StopReason.NOTHING_TO_RELAX
        self.phases: list[Phase] = []
        self.sweeps: list[Sweep] = []
        self.untangling: Untangling | None = None
        self.boundary: BoundaryChange | None = None
        self._unpolished: tuple[State, int] | None = None
        self._begin: np.ndarray | None = None
        self._mean = 0.0  # at that place
        self._qualities: np.ndarray | None = None  # of the engine's corners there
        self._walks_on_surface = domain.is_surface and moves.parts is not None
        self.level: float | None = (
            options.stopping.target if options.is_free and not self._walks_on_surface else None
        )
        self._dear: float | None = None  # see ``relax.descent``

    @property
    def threads(self) -> int:
        """The number of threads that the engine uses."""
        return self._engine.threads

    @property
    def seconds(self) -> float:
        """Since the run began."""
        return self._engine.now() - self._began

    def untangle(self) -> None:
        """Make inverted elements positive."""
        from dvr_cli.relax.untangle.phase import untangle

        engine = None if self._moves.parts is None else self._engine
        how = self._domain.corners, self._moves.freedom, self._time_is_up
        self.begin_with(untangle(self.points, *how, engine=engine))

    def begin_with(self, untangling: Untangling) -> None:
        """Begin where elements have been made positive."""
        self.untangling, self.points = untangling, untangling.points

    def descend(self) -> None:
        """Lower the price of all elements, and find the level of care; see ``relax.descent``."""
        from dvr_cli.relax.descent import descend

        hooks, engine = (self._on_sweep, self._interrupted), self._engine
        if engine.has_coordinates:
            beside(engine.threads, partial(engine.problem.incidence, engine.backend))  # for phases to come
        self._load()
        descent = descend(engine, self._remaining(), *hooks, self._qualities)
        self._take_over(descent.outcome)
        ended = descent.outcome.stopped_because
        self.phases.append(PolishPhase("descent", len(descent.outcome.sweeps), ended, descent.floor))
        self.level, self._dear = descent.level, descent.dear

    def relax(self, field: DirectionField) -> None:
        """Sweep along the directions of ``field``, as far as the vertices are free to follow."""
        if self.stopped_because.cuts_short:
            return
        directions = restrict_field(field, self._moves.within)
        hooks = self._on_sweep, self._interrupted
        self._load()

        def sweep() -> Relaxation:
            done = len(self.sweeps)
            stopping, care = self._remaining(), None
            if self.level is not None and self._engine.relaxes:
                if stopping.target is None and self._options.takes_patches:
                    stopping = replace(stopping, tol=max(stopping.tol, _WORTH * self.level), patience=1)
                care = Care(self._engine, self.level, stopping, self._qualities)
            return relax(self._engine, None, directions, stopping, *hooks, care, done)

        outcome = sweep()
        jammed = self._options.stopping.target is not None and self.level is not None
        if jammed and outcome.stopped_because is StopReason.CONVERGED and not self._options.takes_patches:
            self._take_over(outcome)  # what is good enough has to make room
            self.level = None
            outcome = sweep()
        self._enter("relax", outcome)

    def start_anew(self) -> None:
        """Go back to where the phases after untangling began, and forget them."""
        assert self._begin is not None
        self.points, self._begin, self._qualities = self._begin, None, None
        self.phases, self.sweeps = [], []

    def _load(self) -> None:
        """Give the engine the coordinates with which the phases after untangling begin."""
        if self._begin is None:
            self._begin = self.points
            if self.untangling is None or not self.untangling.walked:
                self._engine.load(self.points)
            if self._options.keeps_altitude:
                self._engine.keep_altitude(altitude_bound(self._domain, self.points, self._rounding))
            if self._options.takes_polish and self._engine.batches:
                self._qualities = self._engine.qualities()
                self._mean = self._engine.mean(self._qualities)

    def relax_patches(self) -> None:
        """Move the surroundings of the worst elements jointly."""
        ended = self.stopped_because in (StopReason.CONVERGED, StopReason.MAX_ITERATIONS)
        if ended and self._engine.relaxes:
            from dvr_cli.relax.patches.phase import relax_patches

            hooks = self._on_sweep, self._interrupted
            if self.level is None and self._options.is_free and not self._walks_on_surface:
                self.level = self._level()
            stopping, done = self._remaining(), len(self.sweeps)
            outcome = relax_patches(self._engine, stopping, done, *hooks, self.level, self._qualities)
            self._enter("patches", outcome)

    def polish(self, least: float) -> None:
        """Raise the mean quality: the quality vector below the level of care does not decrease.

        Where the mean is then still below that of the start, it goes on with that level lowered towards Q1.
        With a floor in the options, and where vertices walk on a surface, Q1 stays above that part of it and
        above ``least``, and that is all.
        """
        if (self.phases and self.stopped_because.is_final) or not self._engine.batches:
            return
        self._load()
        aim, floor, level = PLAIN, least, self.level or self._level()
        if self._options.floor is not None or self._walks_on_surface or level is None:
            part = _FLOOR if self._options.floor is None else self._options.floor
            floor = max(part * self._engine.q1(), least)
        else:
            aim, floor, self.level = Aim(self._dear or level, relative=True, by_ring=True), level, level
        hooks = self._on_sweep, self._interrupted
        self._unpolished = self._engine.state(), len(self.sweeps)
        sweeps = 0
        while True:
            stopping, done, work = self._remaining(), len(self.sweeps), Work(known=self._qualities)
            outcome = polish(self._engine, floor, stopping, done, *hooks, aim=aim, work=work)
            sweeps += len(outcome.sweeps)
            if aim.by_ring and not outcome.stopped_because.cuts_short:
                self._take_over(outcome)
                outcome = self._raise_mean(floor, outcome)
                sweeps += len(outcome.sweeps)
            if not (aim.by_ring and self._costs_mean(outcome)):
                break
            q1 = self._engine.q1()
            if not floor > (1.0 + _NEAR) * q1 > 0.0:
                break
            self._take_over(outcome)
            self.level = floor = (floor + q1) / 2.0
            aim = aim._replace(level=floor)
        ended = outcome.stopped_because
        reason = ended if ended.cuts_short or not self.phases else self.stopped_because
        self._take_over(outcome)
        self.phases.append(PolishPhase("polish", sweeps, ended, floor))
        self.stopped_because = reason

    def _raise_mean(self, level: float, polished: Relaxation) -> Relaxation:
        """One more sweep of polishing, for the mean alone: what is not among the worst elements stays so.

        level: of care. polished: how polishing had ended, and ends, unless this is cut short.
        """
        qualities = polished.of_corners(self._engine)
        floor = max(level, self._engine.level(qualities, _KEPT, 0))
        remaining, hooks = self._remaining(), (self._on_sweep, self._interrupted)
        once = replace(remaining, max_iterations=min(1, remaining.max_iterations))
        aim = Aim(relative=True, by_ring=True)
        work = Work(known=qualities)
        last = polish(self._engine, floor, once, len(self.sweeps), *hooks, aim=aim, work=work)
        cut = last.stopped_because.cuts_short
        return last if cut else replace(last, stopped_because=polished.stopped_because)

    def _costs_mean(self, outcome: Relaxation) -> bool:
        """True if a phase that came to its end leaves a lower mean than there was at the beginning."""
        cut, engine = outcome.stopped_because.cuts_short, self._engine
        return not cut and engine.mean(outcome.of_corners(engine)) < self._mean

    @property
    def polished(self) -> bool:
        """True if the last phase was polishing, and moved something."""
        return self._unpolished is not None and self.phases[-1].sweeps > 0

    def undo_polish(self) -> None:
        """Go back to where polishing began."""
        assert self._unpolished is not None
        state, sweeps = self._unpolished
        self._engine.restore(state)
        self.points, self._qualities = self._engine.points, None
        del self.sweeps[sweeps:]
        self.phases[-1] = replace(self.phases[-1], sweeps=0, stopped_because=StopReason.UNDONE)

    @property
    def inverted(self) -> np.ndarray | None:
        """(C,) bool, the corners of a surface that are turned over; None in other meshes."""
        turned = self._engine.turned
        if turned is None:
            return None
        inverted = np.zeros(len(self._domain.corners.vertices), dtype=bool)
        inverted[self._engine.problem.touched_ids] = turned
        return inverted

    def keeps(self, bound: float) -> bool:
        """Measure how far the boundary has come from the input's; whether that is within the bound."""
        how = self._engine.deviation, bound, self.threads
        self.boundary = change_of(self._domain, self.points, *how)
        return self.boundary.deviation <= bound

    def undo(self, bound: float) -> None:
        """Go back to where vertices began to walk, as the boundary has come too far from the input's."""
        self._engine.load(self._start)
        self._qualities = None
        self.points, self.stopped_because = self._start, StopReason.DEVIATION
        as_given = np.array_equal(self._start, self._domain.points)  # nothing was unfolded
        deviation = (lambda: 0.0) if as_given else self._engine.deviation
        self.boundary = change_of(self._domain, self.points, deviation, bound, self.threads)

    def _enter(self, name: str, outcome: Relaxation) -> None:
        """Take over the result of a phase, and record it."""
        self._take_over(outcome)
        self.phases.append(Phase(name, len(outcome.sweeps), outcome.stopped_because))

    def _take_over(self, outcome: Relaxation) -> None:
        self.points, self.stopped_because = outcome.points, outcome.stopped_because
        self._qualities = outcome.qualities
        self.sweeps += outcome.sweeps

    def _level(self) -> float | None:
        """The level of care of the mesh as it is, None where it is too tangled for one."""
        qualities = self._engine.qualities() if self._qualities is None else self._qualities
        level = self._engine.level(qualities)
        return level if level > 0.0 else None

    def _remaining(self) -> Stopping:
        return self._options.stopping.less(self.seconds)

    def _time_is_up(self) -> bool:
        return self._interrupted() or self._remaining().time_limit == 0
