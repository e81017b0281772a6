"""The worst quality in each ring, kept up to date where few vertices move.

What a vertex changes are the qualities of its corners, and with them the worst ones in the rings of their
vertices. All others are as they were.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.mesh.csr import row_entries
from dvr_cli.mesh.ranks import distinct
from dvr_cli.relax.engines.engine import Engine

_FEW = 20  # one of so many rings may have moved: with more it is as quick to look at all


class RingQualities:
    """The worst quality in each ring of an engine.

    values: (m,) as they were when last looked at, and qualities: (C,) of the corners.
    """

    def __init__(self, engine: Engine, qualities: np.ndarray | None = None) -> None:
        """engine: not one of a surface in space, nor one that leaves coordinates to others.

        qualities: (C,) of its corners, if they are known.
        """
        self._engine = engine
        self._look_at_all(engine.qualities() if qualities is None else qualities.copy())

    def update(self, moved: np.ndarray) -> None:
        """Look again at what changes with the vertices of the rings ``moved`` (k,)."""
        if len(moved) * _FEW > len(self.values):
            self._look_at_all(self._engine.qualities())
            return
        engine = self._engine
        incidence = engine.problem.incidence(engine.backend)
        corners = incidence.start, incidence.corner
        changed = engine.backend.twin(corners_of_rings)(moved, *corners, len(self.qualities))
        new = engine.qualities_of(changed)
        engine.backend.twin(renew)(self.values, self.qualities, changed, new, *corners, incidence.members)

    def _look_at_all(self, qualities: np.ndarray) -> None:
        self.qualities, self.values = qualities, self._engine.ring_qualities(qualities)


def corners_of_rings(rings: np.ndarray, start: np.ndarray, corner: np.ndarray, n: int) -> np.ndarray:
    """(k,) the corners, of n, that are in any of ``rings`` (r,), each once.

    start, corner: of an ``Incidence``.
    """
    return distinct(corner[row_entries(start, rings)[0]])


def renew(
    values: np.ndarray,
    qualities: np.ndarray,
    changed: np.ndarray,
    new: np.ndarray,
    start: np.ndarray,
    corner: np.ndarray,
    members: np.ndarray,
) -> None:
    """Set the ``qualities`` (C,) of corners ``changed`` (k,) to ``new`` (k,), and with them ``values`` (m,).

    start, corner, members: of an ``Incidence``.
    """
    qualities[changed] = new
    rings = members[changed]
    around = distinct(rings[rings >= 0])
    entries, first = row_entries(start, around)
    if len(around):
        values[around] = np.minimum.reduceat(qualities[corner[entries]], first[:-1])
