"""Comparing meshes of one connectivity by the paper's ordering of quality vectors (eq. 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from dvr_cli import __version__
from dvr_cli.errors import InputError
from dvr_cli.quality.vector import first_difference
from dvr_cli.report.records import QualityReport


@dataclass(frozen=True)
class Comparison:
    """Two meshes of one connectivity compared.

    component: 1-based number of the first component in which the quality vectors differ, None if equal.
    """

    before: QualityReport
    after: QualityReport
    component: int | None

    @property
    def better(self) -> str:
        """Which mesh is better in the ordering: "before", "after" or "equal"."""
        if self.component is None:
            return "equal"
        i = self.component - 1
        return "after" if self.after.quality.vector[i] > self.before.quality.vector[i] else "before"

    def record(self, before_path: str | None = None, after_path: str | None = None) -> dict[str, Any]:
        """The comparison as JSON-ready data, schema dvr.compare/1."""
        return {
            "schema": "dvr.compare/1",
            "dvr_version": __version__,
            "better": self.better,
            "first_difference": self.component,
            "before": self.before.record(before_path),
            "after": self.after.record(after_path),
        }


def compare_qualities(before: QualityReport, after: QualityReport, same_connectivity: bool) -> Comparison:
    """Compare two reports; InputError when the meshes have different cells or relaxed vertices."""
    if not same_connectivity or before.relaxed != after.relaxed:
        raise InputError("the meshes have different cells; only meshes of one connectivity can be compared")
    where = first_difference(before.quality.vector, after.quality.vector)
    return Comparison(before, after, None if where is None else where + 1)
