"""Criteria to stop sweeping (paper section 4.5), and the reasons for which phases end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

from dvr_cli.options import check_fields, default


class StopReason(StrEnum):
    """The reason for which a phase or a run ended; the values are those of ``stopped_because`` in reports."""

    CONVERGED = "converged"
    MAX_ITERATIONS = "max-iterations"
    TARGET = "target"
    TIME_LIMIT = "time-limit"
    INTERRUPTED = "interrupted"
    NOTHING_TO_RELAX = "nothing-to-relax"
    ROUNDING = "rounding"  # which would undo what there is to gain: the mesh stayed as it was
    DEVIATION = "deviation"  # the boundary came too far from the input's: the mesh stayed as it was
    UNDONE = "undone"  # a phase whose result was not kept
    UNTANGLED = "untangled"
    UNFOLDED = "unfolded"
    STUCK = "stuck"  # elements remain inverted, or facets folded
    NOTHING_TO_UNTANGLE = "nothing-to-untangle"

    @property
    def cuts_short(self) -> bool:
        """True if it ends a phase from outside, in the middle of a sweep."""
        return self in (StopReason.INTERRUPTED, StopReason.TIME_LIMIT)

    @property
    def is_final(self) -> bool:
        """True if no phase follows."""
        return self.cuts_short or self in (StopReason.NOTHING_TO_RELAX, StopReason.DEVIATION)


@dataclass(frozen=True)
class Stopping:
    """The criteria, of which the first to be met ends the relaxation.

    max_iterations: sweeps at most.
    tol, patience: converged when Q1 grew by less than tol in each of the last ``patience`` sweeps.
    target: stop once Q1 reaches it.
    time_limit: seconds.

    Raises UsageError for values out of range.
    """

    max_iterations: int = default("max_iterations")
    tol: float = default("tol")
    patience: int = default("patience")
    target: float | None = None
    time_limit: float | None = None

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_fields(self)

    def less(self, seconds: float) -> Stopping:
        """The same criteria after so many seconds of the time limit have gone."""
        return (
            self if self.time_limit is None else replace(self, time_limit=max(0.0, self.time_limit - seconds))
        )

    def reason(self, q1: Sequence[float], seconds: float) -> StopReason | None:
        """The reason to stop now, or None; q1 holds Q1 of the input and after each sweep so far."""
        if self.target is not None and q1[-1] >= self.target:
            return StopReason.TARGET
        growth = [after - before for before, after in pairwise(q1)][-self.patience :]
        if len(growth) == self.patience and max(growth) < self.tol:
            return StopReason.CONVERGED
        return self.limit(len(q1) - 1, seconds)

    def limit(self, sweeps: int, seconds: float) -> StopReason | None:
        """The reason not to go on after so many sweeps and seconds, or None."""
        if sweeps >= self.max_iterations:
            return StopReason.MAX_ITERATIONS
        if self.time_limit is not None and seconds >= self.time_limit:
            return StopReason.TIME_LIMIT
        return None
