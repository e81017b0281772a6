"""The scale of colours of a picture: which measure of the elements it shows, and the values at its ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dvr_cli.quality.cell_measures import CellMeasure

_BEYOND = 0.01  # share of the elements that may lie beyond the bad end


@dataclass(frozen=True)
class Scale:
    """The measure that colours show, and its values at the good and the bad end of the scale.

    label: the measure in words. unit: written after a value, "" for pure numbers. signed: whether values
    below zero belong to inverted elements, which have a colour of their own.
    """

    label: str
    unit: str
    good: float
    bad: float
    signed: bool

    def share(self, value: float) -> float:
        """The place of a value on the scale: 1 at the good end, 0 at the bad one."""
        return (value - self.bad) / (self.good - self.bad)

    def is_beyond(self, values: np.ndarray) -> bool:
        """True if any value (n,) is worse than the bad end."""
        return self.share(self.extreme(values)) < 0

    def shares(self, values: np.ndarray) -> np.ndarray:
        """(n,) the places of values (n,): 1 at the good end, 0 at the bad one; below 0 only where signed."""
        shares = (values - self.bad) / (self.good - self.bad)
        return np.clip(shares, None if self.signed else 0.0, 1.0)

    def worst(self, values: np.ndarray, number: int) -> list[int]:
        """The numbers of the worst elements, worst first, equal ones by number."""
        toward_bad = values if self.good > self.bad else -values
        return np.argsort(toward_bad, kind="stable")[:number].tolist()

    def extreme(self, values: np.ndarray) -> float:
        """The worst value."""
        return float(values.min() if self.good > self.bad else values.max())


MEAN_RATIO = Scale("mean ratio", "", good=1.0, bad=0.0, signed=True)


def scale_of(measure: CellMeasure, states: Sequence[np.ndarray]) -> Scale:
    """The scale for a measure whose values in some states of a mesh are ``states``, each (n,).

    It goes from the best value to the one that the worst hundredth is beyond, so that a few elements of
    enormous aspect do not take all the colours. That of the scaled Jacobian always goes from 1 to 0.
    """
    unit = "°" if measure.unit == "deg" else ""
    if measure.signed:
        return Scale(measure.label, unit, good=1.0, bad=0.0, signed=True)
    share = _BEYOND if measure.high_is_good else 1.0 - _BEYOND
    ends = [np.quantile(values, (share, float(measure.high_is_good))) for values in states]
    bads, goods = zip(*ends, strict=True)
    bad, good = (min(bads), max(goods)) if measure.high_is_good else (max(bads), min(goods))
    if bad == good:  # all elements alike: the best colour for them
        bad = good - 1.0 if measure.high_is_good else good + 1.0
    return Scale(measure.label, unit, good=float(good), bad=float(bad), signed=False)
