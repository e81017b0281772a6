"""The phases of a run, one after the other: untangle, relax, patches, polish (see ``relax.phases``)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dvr_cli.api.boundary import Moves, change_of
from dvr_cli.api.options import SmoothOptions
from dvr_cli.mesh.domain import Domain
from dvr_cli.relax.directions import DirectionField, restrict_field
from dvr_cli.relax.engines.engine import Engine, State
from dvr_cli.relax.patches.phase import relax_patches
from dvr_cli.relax.phases import Phase, PolishPhase
from dvr_cli.relax.stopping import Stopping, StopReason
from dvr_cli.relax.sweeps import Relaxation, Sweep, polish, relax
from dvr_cli.relax.untangle.phase import Untangling, untangle
from dvr_cli.report.records import BoundaryChange


class Run:
    """A run: where its phases have brought the vertices, and a record of each.

    points: (N, d) coordinates reached. phases: as in SmoothReport. sweeps: of all phases.
    untangling: the result of untangling. boundary: the change of a boundary or surface on which vertices
    walked. Both are None without that.
    """

    def __init__(
        self,
        domain: Domain,
        moves: Moves,
        engine: Engine,
        options: SmoothOptions,
        on_sweep: Callable[[Sweep], None] | None,
        interrupted: Callable[[], bool],
    ) -> None:
        """Begin at the points of the domain; on_sweep, interrupted: see ``sweeps.relax``."""
        self._domain, self._moves, self._engine, self._options = domain, moves, engine, options
        self._on_sweep, self._interrupted = on_sweep, interrupted
        self._start = time.perf_counter()
        self.points = domain.points
        self.stopped_because = StopReason.NOTHING_TO_RELAX
        self.phases: list[Phase] = []
        self.sweeps: list[Sweep] = []
        self.untangling: Untangling | None = None
        self.boundary: BoundaryChange | None = None
        self._unpolished: tuple[State, int] | None = None
        self._begin: np.ndarray | None = None

    @property
    def seconds(self) -> float:
        """Since the run began."""
        return time.perf_counter() - self._start

    def untangle(self) -> None:
        """Make inverted elements positive."""
        corners, freedom = self._domain.corners, self._moves.freedom
        self.untangling = untangle(self.points, corners, freedom, self._time_is_up)
        self.points = self.untangling.points

    def relax(self, field: DirectionField) -> None:
        """Sweep along the directions of ``field``, as far as the vertices are free to follow."""
        directions = restrict_field(field, self._moves.within)
        hooks = self._on_sweep, self._interrupted
        self._load()
        done = len(self.sweeps)
        self._enter("relax", relax(self._engine, None, directions, self._remaining(), *hooks, done))

    def start_anew(self) -> None:
        """Go back to where the phases after untangling began, and forget them."""
        assert self._begin is not None
        self.points, self._begin = self._begin, None
        self.phases, self.sweeps = [], []

    def _load(self) -> None:
        """Give the engine the coordinates with which the phases after untangling begin."""
        if self._begin is None:
            self._begin = self.points
            self._engine.load(self.points)

    def relax_patches(self) -> None:
        """Move the surroundings of the worst elements jointly."""
        problem = self._engine.problem
        ended = self.stopped_because in (StopReason.CONVERGED, StopReason.MAX_ITERATIONS)
        if ended and len(problem.free_rings):
            hooks = self._on_sweep, self._interrupted
            self._enter("patches", relax_patches(self._engine, self._remaining(), len(self.sweeps), *hooks))

    def polish(self, least: float) -> None:
        """Raise the mean quality; no quality falls below ``least`` or the options' floor."""
        if (self.phases and self.stopped_because.is_final) or not self._engine.batches:
            return
        self._load()
        floor = max(self._options.floor * self._engine.q1(), least)
        hooks = self._on_sweep, self._interrupted
        self._unpolished = self._engine.state(), len(self.sweeps)
        outcome = polish(self._engine, floor, self._remaining(), len(self.sweeps), *hooks)
        ended = outcome.stopped_because
        reason = ended if ended.cuts_short or not self.phases else self.stopped_because
        self._take_over(outcome)
        self.phases.append(PolishPhase("polish", len(outcome.sweeps), ended, floor))
        self.stopped_because = reason

    @property
    def polished(self) -> bool:
        """True if the last phase was polishing, and moved something."""
        return self._unpolished is not None and self.phases[-1].sweeps > 0

    def undo_polish(self) -> None:
        """Go back to where polishing began."""
        assert self._unpolished is not None
        state, sweeps = self._unpolished
        self._engine.restore(state)
        self.points = self._engine.points
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
        deviation = self._engine.deviation()
        self.boundary = change_of(self._domain, self.points, deviation, bound)
        return deviation <= bound

    def undo(self, bound: float) -> None:
        """Go back to the input, as the boundary has come too far from it."""
        self._engine.load(self._domain.points)
        self.points, self.stopped_because = self._domain.points, StopReason.DEVIATION
        self.boundary = change_of(self._domain, self.points, 0.0, bound)

    def _enter(self, name: str, outcome: Relaxation) -> None:
        """Take over the result of a phase, and record it."""
        self._take_over(outcome)
        self.phases.append(Phase(name, len(outcome.sweeps), outcome.stopped_because))

    def _take_over(self, outcome: Relaxation) -> None:
        self.points, self.stopped_because = outcome.points, outcome.stopped_because
        self.sweeps += outcome.sweeps

    def _remaining(self) -> Stopping:
        return self._options.stopping.less(self.seconds)

    def _time_is_up(self) -> bool:
        return self._interrupted() or self._remaining().time_limit == 0
