"""Comparing meshes of one connectivity by the paper's ordering of quality vectors (eq. 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dvr_cli import __version__
from dvr_cli.errors import InputError
from dvr_cli.quality.vector import first_difference
from dvr_cli.report.records import QualityReport

if TYPE_CHECKING:
    from dvr_cli.quality.cell_measures import CellMeasure


@dataclass(frozen=True, eq=False)
class Judged:
    """Meshes judged by a measure; values: (n,) of the cells of each mesh."""

    measure: CellMeasure
    values: Sequence[np.ndarray]

    @property
    def sign(self) -> float:
        """The sign that makes larger values better."""
        return 1.0 if self.measure.high_is_good else -1.0

    @property
    def vectors(self) -> list[np.ndarray]:
        """Vectors (n,) that are ordered as quality vectors are: ascending, and larger is better."""
        return [np.sort(self.sign * values) for values in self.values]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two or more meshes of one connectivity compared.

    reports: those of the meshes, in the order in which they were given. by: the measure that they are judged
    by; None for their quality vectors.
    """

    reports: Sequence[QualityReport]
    by: Judged | None = None

    @cached_property
    def vectors(self) -> list[np.ndarray]:
        """The vectors of the meshes by which they are ordered, ascending; larger is better."""
        return [report.quality.vector for report in self.reports] if self.by is None else self.by.vectors

    @property
    def before(self) -> QualityReport:
        """The report of the first mesh."""
        return self.reports[0]

    @property
    def after(self) -> QualityReport:
        """The report of the last mesh."""
        return self.reports[-1]

    @property
    def component(self) -> int | None:
        """1-based number of the first component in which the first and last mesh differ, None if equal."""
        where = first_difference(self.vectors[0], self.vectors[-1])
        return None if where is None else where + 1

    @property
    def differing(self) -> tuple[float, float]:
        """The values of the first and the last mesh in that component."""
        assert self.component is not None
        old, new = (float(vector[self.component - 1]) for vector in (self.vectors[0], self.vectors[-1]))
        sign = 1.0 if self.by is None else self.by.sign
        return sign * old, sign * new

    @property
    def better(self) -> str:
        """The better one of the first and the last mesh in the ordering: "before", "after" or "equal"."""
        order = _order(self.vectors[0], self.vectors[-1])
        return ("equal", "after", "before")[order]

    @cached_property
    def ranks(self) -> list[int]:
        """The place of each mesh in the ordering, from 1 for the best; equal ones share theirs."""
        return [1 + sum(_order(vector, other) > 0 for other in self.vectors) for vector in self.vectors]

    @property
    def best_first(self) -> list[int]:
        """The numbers of the meshes, from 0, the best first; equal ones in the order given."""
        return sorted(range(len(self.reports)), key=self.ranks.__getitem__)

    def record(self, paths: Sequence[str | None] | None = None) -> dict[str, Any]:
        """The comparison as JSON-ready data, schema dvr.compare/1.

        paths: where the meshes are. "better" and "first_difference" compare the first with the last.
        """
        named = zip(self.reports, self.ranks, paths or [None] * len(self.reports), strict=True)
        return {
            "schema": "dvr.compare/1",
            "dvr_version": __version__,
            "judged_by": None if self.by is None else self.by.measure.name,
            "better": self.better,
            "first_difference": self.component,
            "meshes": [{"rank": rank, **report.record(path)} for report, rank, path in named],
        }


def compare_qualities(
    reports: Sequence[QualityReport], same_connectivity: bool, by: Judged | None = None
) -> Comparison:
    """Compare two or more reports; InputError when the meshes have different cells or relaxed vertices."""
    if not same_connectivity or len({report.relaxed for report in reports}) > 1:
        raise InputError("the meshes have different cells; only meshes of one connectivity can be compared")
    return Comparison(reports, by)


def _order(a: np.ndarray, b: np.ndarray) -> int:
    """1 if b is better than a in the paper's ordering, -1 if a is, 0 if they are equal."""
    where = first_difference(a, b)
    return 0 if where is None else 1 if b[where] > a[where] else -1
