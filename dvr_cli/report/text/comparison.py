"""The text of ``dvr report compare``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dvr_cli.report.rows import quality_rows
from dvr_cli.report.text.lines import VALUE, WIDTH, digits, side_by_side, wrap

if TYPE_CHECKING:
    from dvr_cli.report.compare import Comparison

_RANKING = ("Q1", "fixed cap", "mean", "inverted", "10 % quantile")  # its columns, as far as they fit


def comparison_text(comparison: Comparison, names: Sequence[str], width: int = WIDTH) -> str:
    """The report of ``dvr report compare`` on the meshes with these names.

    width: columns to keep to, names aside.
    """
    if len(names) > 2:
        return "\n".join(_ranking(comparison, names, width))
    if comparison.component is None:
        verdict, where = "equal: the quality vectors are the same", []
    else:
        i = comparison.component - 1
        old, new = comparison.before.quality.vector[i], comparison.after.quality.vector[i]
        verdict = f"{comparison.better} is better: {names[comparison.better == 'after']}"
        where = [
            f"the quality vectors first differ at component {i + 1} of {comparison.after.relaxed}: "
            f"{float(old)!r} before, {float(new)!r} after",
        ]
    dimension = comparison.after.mesh.dimension
    rows = side_by_side(comparison.before.quality, comparison.after.quality, dimension)
    return "\n".join([verdict, *wrap([*where, *rows], width)])


def _ranking(comparison: Comparison, names: Sequence[str], width: int) -> list[str]:
    """A table of meshes, the best first."""
    longest = max(map(len, names))
    labels = _RANKING[: max(1, (width - 8 - longest) // (VALUE + 5))]
    lines = ["  rank" + "".join(f"{label:>{VALUE + 5}}" for label in labels) + "  mesh"]
    for i in comparison.best_first:
        report = comparison.reports[i]
        values = dict(quality_rows(report.quality, report.mesh.dimension))
        cells = "".join(f"{digits(values[label]):>{VALUE + 5}}" for label in labels)
        lines.append(f"  {comparison.ranks[i]:>4}{cells}  {names[i]}")
    return lines
