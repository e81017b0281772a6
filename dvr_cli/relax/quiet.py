"""Quiet rings: those in which an update changed nothing, and around which nothing has changed since.

Along directions of ascent an update depends on its ring alone, on where its vertices stand and how far their
edges are from the input. All that changes only as one of these vertices moves. So in a quiet ring an update
would change nothing again, and sweeps pass it over: the result is the same, to the bit.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.relax.engines.engine import Engine


class Quiet:
    """The quiet rings of an engine while one kind of update goes on."""

    def __init__(self, engine: Engine) -> None:
        """At first no ring is quiet."""
        self._engine = engine
        rings = engine.problem.rings
        self._moved_at = np.zeros(len(engine.problem.order), dtype=np.int64)
        self._vain_at = np.full(len(rings.vertices), -1)
        self._now = 0
        self._last = engine.coordinates.copy()

    def awake(self, batch: int, active: np.ndarray | None) -> np.ndarray:
        """(m,) bool: the rings of a batch to visit, of those ``active`` ((m,) bool, None for all)."""
        rings, here = self._engine.problem.rings, self._here(batch)
        start = rings.start[here.start : here.stop + 1]
        latest = self._moved_at[rings.others[start[0] : start[-1]]].max(axis=1)
        awake = np.zeros(len(rings.vertices), dtype=bool)
        awake[here] = np.maximum.reduceat(latest, start[:-1] - start[0]) > self._vain_at[here]
        return awake if active is None else awake & active

    def note(self, batch: int, visited: np.ndarray | None) -> None:
        """Note what has become of a batch.

        visited: (m,) bool, the rings that were visited, or None where that was not along an ascent.
        """
        rings, here = self._engine.problem.rings, self._here(batch)
        self._now += 1
        vertices = rings.vertices[here]
        reached = self._engine.coordinates[vertices]
        moved = (reached != self._last[vertices]).any(axis=1)
        self._last[vertices] = reached
        self._moved_at[vertices[moved]] = self._now
        vain = self._vain_at[here]
        vain[moved] = -1
        if visited is not None:
            vain[visited[here] & ~moved] = self._now

    def _here(self, batch: int) -> slice:
        return slice(*self._engine.problem.batch_start[batch : batch + 2].tolist())
