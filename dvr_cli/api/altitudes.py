"""The altitude that no move of a run takes an element below, so that no smallest altitude falls."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from dvr_cli.errors import OutputError
from dvr_cli.mesh.domain import Domain
from dvr_cli.quality.altitudes import altitude_and_conduction
from dvr_cli.quality.measure import Quality

_MARGIN = 1e-9  # relative: more than the order of additions changes
_LOST = 6.0  # altitude that rounding may take, in units of what it changes a coordinate by
_ELSEWHERE = 1e-3  # part of the mesh's extent by which vertices move to see how they are rounded
_GOLDEN = 0.6180339887498949  # multiples of it have fractional parts that are spread evenly


class Rounding(Protocol):
    """A place for results that may round coordinates."""

    def rounding(self, points: np.ndarray) -> float:
        """The largest change of a coordinate with which ``points`` are kept."""


def altitude_bound(domain: Domain, flat: np.ndarray, rounding: float) -> float:
    """The altitude that moves from ``flat`` (N, d) keep to: the smallest, and what rounding may take; or 0.0.

    It is 0.0, for no bound, where an element is inverted or degenerate. rounding: by which coordinates of the
    result will be changed, see ``rounding_of``.
    """
    least, _ = altitude_and_conduction(flat, domain.corners.vertices, domain.backend)
    return least * (1.0 + _MARGIN) + _LOST * rounding if 0.0 < least < np.inf else 0.0


def rounding_of(domain: Domain, points: np.ndarray, relaxed: np.ndarray, storage: Rounding | None) -> float:
    """By how much coordinates of vertices that move will be rounded, on the way to a mesh like ``points``.

    relaxed: (m,) those vertices. storage: where the mesh will be kept. Measured with the vertices elsewhere.
    """
    flat = domain.flatten(points)
    spread = (np.arange(1, flat[relaxed].size + 1) * _GOLDEN % 1.0).reshape(-1, flat.shape[1])
    elsewhere = flat.copy()
    elsewhere[relaxed] += _ELSEWHERE * np.ptp(flat, axis=0).max(initial=0.0) * spread
    lifted = domain.lift(points, elsewhere)
    lost = float(np.abs(domain.flatten(lifted) - elsewhere).max(initial=0.0)) if domain.is_tilted else 0.0
    if storage is None:
        return lost
    try:
        return lost + storage.rounding(lifted)
    except OutputError:  # the mesh as it will be may be one that can be written
        return lost


def lowers_altitude(after: Quality, before: Quality) -> bool:
    """True if the smallest altitude of a mesh without inverted or degenerate elements fell."""
    old, new = (quality.measures["min_altitude"] or 0.0 for quality in (before, after))
    return old > 0.0 and new < old
