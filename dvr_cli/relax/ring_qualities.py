"""The worst quality in each ring, kept up to date where few vertices move.

What a vertex changes are the qualities of its corners, and with them the worst ones in the rings of their
vertices. All others are as they were.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.mesh.csr import row_entries
from dvr_cli.mesh.ranks import distinct
from dvr_cli.mesh.rings import incidence_of
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.vector import ring_minima
from dvr_cli.relax.engines.engine import Engine

_FEW = 50  # one of so many rings may have moved: with more it is as quick to look at all


class RingQualities:
    """The worst quality in each ring of an engine.

    values: (m,) as they were when last looked at.
    """

    def __init__(self, engine: Engine) -> None:
        """engine: not one of a surface in space, nor one that leaves coordinates to others."""
        self._engine, problem = engine, engine.problem
        incidence = incidence_of(problem.touched, problem.rings.vertices, len(problem.order), engine.backend)
        self._rings, self._start, self._corners = incidence.members, incidence.start, incidence.corner
        self._look_at_all()

    def update(self, moved: np.ndarray) -> None:
        """Look again at what changes with the vertices of the rings ``moved`` (k,)."""
        if len(moved) * _FEW > len(self.values):
            self._look_at_all()
            return
        problem = self._engine.problem
        changed = distinct(self._corners[row_entries(self._start, moved)[0]])
        self._qualities[changed] = corner_qualities(self._engine.coordinates, problem.touched.part(changed))
        members = self._rings[changed]
        around = distinct(members[members >= 0])
        entries, first = row_entries(self._start, around)
        if len(around):
            values = self._qualities[self._corners[entries]]
            self.values[around] = np.minimum.reduceat(values, first[:-1])

    def _look_at_all(self) -> None:
        problem = self._engine.problem
        self._qualities = self._engine.qualities()
        touched, backend = problem.touched, self._engine.backend
        minima = ring_minima(self._qualities, touched, len(problem.order), backend)
        self.values = minima[problem.rings.vertices]
