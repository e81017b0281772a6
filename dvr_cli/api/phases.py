"""The phases of a run, one after the other: untangle, relax, patches, polish (see ``relax.phases``)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dvr_cli.api.boundary import Moves, relax_with_projection
from dvr_cli.api.options import SmoothOptions
from dvr_cli.mesh.domain import Domain
from dvr_cli.relax.directions import DirectionField, restrict_field
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.patches.phase import relax_patches
from dvr_cli.relax.phases import Phase, PolishPhase
from dvr_cli.relax.stopping import Stopping, StopReason
from dvr_cli.relax.surface.projection import Projection
from dvr_cli.relax.sweeps import Relaxation, Sweep, polish, relax
from dvr_cli.relax.untangle.phase import Untangling, untangle
from dvr_cli.report.records import BoundaryChange


class Run:
    """A run: where its phases have brought the vertices, and a record of each.

    points: (N, d) coordinates reached. phases: as in SmoothReport. sweeps: of all phases.
    untangling: the result of untangling. inverted: the corners of a surface that are turned over.
    boundary: the change of a projected boundary. All three are None without that.
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
        self.inverted: np.ndarray | None = None
        self.boundary: BoundaryChange | None = None

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
        points, stopping = self.points, self._remaining()
        directions = restrict_field(field, self._moves.freedom)

        def sweep(projection: Projection | None) -> Relaxation:
            hooks = self._on_sweep, self._interrupted
            return relax(self._engine, points, directions, stopping, *hooks, projection)

        if self._moves.parts is None:
            outcome = sweep(None)
        else:
            outcome, self.inverted, self.boundary = relax_with_projection(
                sweep, self._domain, self._moves.parts, field, self._options
            )
        self._enter("relax", outcome)

    def relax_patches(self) -> None:
        """Move the surroundings of the worst elements jointly."""
        if self.stopped_because in (StopReason.CONVERGED, StopReason.MAX_ITERATIONS) and self._engine.batches:
            hooks = self._on_sweep, self._interrupted
            self._enter("patches", relax_patches(self._engine, self._remaining(), len(self.sweeps), *hooks))

    def polish(self, least: float) -> None:
        """Raise the mean quality; no quality falls below ``least`` or the options' floor."""
        if self.stopped_because.is_final or not self._engine.batches:
            return
        floor = max(self._options.floor * self._engine.q1(), least)
        hooks = self._on_sweep, self._interrupted
        outcome = polish(self._engine, floor, self._remaining(), len(self.sweeps), *hooks)
        ended = outcome.stopped_because
        reason = ended if ended.cuts_short else self.stopped_because
        self._take_over(outcome)
        self.phases.append(PolishPhase("polish", len(outcome.sweeps), ended, floor))
        self.stopped_because = reason

    def undo_polish(self, points: np.ndarray) -> None:
        """Go back to the coordinates ``points`` (N, d), which polishing began with."""
        self.points = points
        self.sweeps = [sweep for sweep in self.sweeps if sweep.phase != "polish"]
        self.phases[-1] = replace(self.phases[-1], sweeps=0, stopped_because=StopReason.UNDONE)

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
