"""Care: which rings are worked on, those below the level of care that have not settled.

The *level of care* is the quality below which every element is to be helped, by sweeps and patches. It is
found from the mesh: the quality that few elements are below. A ring has *settled* when its worst quality has
not grown for some sweeps in a row in which its vertex could move; it is unsettled again by a neighbour that
changes it.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.ring_qualities import RingQualities
from dvr_cli.relax.stopping import Stopping, StopReason


class Care:
    """The rings of an engine that are cared for in a sweep.

    level: of care. active: (m,) bool, the rings below it that have not settled.
    """

    def __init__(
        self, engine: Engine, level: float, stopping: Stopping, qualities: np.ndarray | None = None
    ) -> None:
        """stopping: says which growth counts, and how many sweeps without it are borne.

        qualities: (C,) of the engine's corners, if they are known.
        """
        self._engine, self.level, self._stopping = engine, level, stopping
        self._idle = np.zeros(len(engine.problem.rings.vertices), dtype=np.int64)
        local = engine.has_coordinates and not engine.problem.is_surface
        self._kept = RingQualities(engine, qualities) if local else None
        self._worst = engine.ring_qualities(qualities) if self._kept is None else self._kept.values.copy()
        self.active = self._worst < level
        self._places = self._of_active()

    @property
    def q1(self) -> float:
        """Q1: the worst quality in any ring."""
        return self._engine.lowest(self._worst)

    @property
    def qualities(self) -> np.ndarray | None:
        """(C,) those of the engine's corners, if they are known."""
        return None if self._kept is None else self._kept.qualities

    @property
    def below(self) -> float:
        """The share of the rings that are below the level."""
        return self._engine.share(self._worst < self.level)

    def update(self) -> None:
        """Look at the rings again after a sweep over those that are active."""
        before = self._worst
        if self._kept is None:
            self._worst = self._engine.ring_qualities()
        else:
            moved = (self._of_active() != self._places).any(axis=1)
            self._kept.update(np.flatnonzero(self.active)[moved])
            self._worst = self._kept.values.copy()
        grew = self._worst - before > self._stopping.tol
        self._idle = np.where(grew, 0, self._idle + self.active)
        self.active = (self._worst < self.level) & (self._idle < self._stopping.patience)
        self._places = self._of_active()

    def _of_active(self) -> np.ndarray:
        """(k, d) where the vertices of the active rings are; nothing where only others know."""
        engine = self._engine
        if self._kept is None:
            return np.empty((0, engine.problem.components))
        return engine.coordinates[engine.problem.rings.vertices[self.active]]

    def reason(self, sweeps: int, seconds: float) -> StopReason | None:
        """The reason to stop now, or None, after so many sweeps and seconds."""
        if not self._engine.any(self.active):
            met = self._stopping.target is not None and self.q1 >= self._stopping.target
            return StopReason.TARGET if met else StopReason.CONVERGED
        return self._stopping.limit(sweeps, seconds)
