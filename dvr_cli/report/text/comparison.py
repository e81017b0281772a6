"""The text of ``dvr report compare``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dvr_cli.report.rows import MEASURE_COLUMNS, measure_rows, quality_rows
from dvr_cli.report.text.lines import VALUE, WIDTH, digits, row, side_by_side, wrap

if TYPE_CHECKING:
    from dvr_cli.report.compare import Comparison

_RANKING = ("Q1", "fixed cap", "mean", "inverted", "10 % quantile")  # its columns, as far as they fit


def comparison_text(comparison: Comparison, names: Sequence[str], width: int = WIDTH) -> str:
    """The report of ``dvr report compare`` on the meshes with these names.

    width: columns to keep to, names aside.
    """
    if len(names) > 2:
        return "\n".join(_ranking(comparison, names, width))
    by = comparison.by
    judged = "the quality vectors" if by is None else f"the cells' values of {by.measure.name}, worst first,"
    if comparison.component is None:
        verdict, where = f"equal: {judged} are the same", []
    else:
        old, new = comparison.differing
        verdict = f"{comparison.better} is better: {names[comparison.better == 'after']}"
        where = [
            f"{judged} first differ at component {comparison.component} of {len(comparison.vectors[0])}: "
            f"{old!r} before, {new!r} after",
        ]
    dimension = comparison.after.mesh.dimension
    rows = side_by_side(comparison.before.quality, comparison.after.quality, dimension)
    if by is not None:
        both = [measure_rows(report.measures)[0][1] for report in (comparison.before, comparison.after)]
        unit = " (deg)" if by.measure.unit == "deg" else ""
        rows.append(f"  {by.measure.name}")
        rows += [row(f"  {name}{unit}", *pair) for name, *pair in zip(MEASURE_COLUMNS, *both, strict=True)]
    return "\n".join([verdict, *wrap([*where, *rows], width)])


def _ranking(comparison: Comparison, names: Sequence[str], width: int) -> list[str]:
    """A table of meshes, the best first; the worst value of the measure they are judged by comes first."""
    worst = [
        {f"worst {name}": each[0] for name, each in measure_rows(r.measures)} for r in comparison.reports
    ]
    room = width - 8 - max(map(len, names))
    labels = {label: max(VALUE + 5, len(label) + 2) for label in (*worst[0], *_RANKING)}
    while len(labels) > 1 and sum(labels.values()) > room:
        labels.popitem()
    lines = ["  rank" + "".join(f"{label:>{wide}}" for label, wide in labels.items()) + "  mesh"]
    for i in comparison.best_first:
        report = comparison.reports[i]
        values = dict(quality_rows(report.quality, report.mesh.dimension)) | worst[i]
        cells = "".join(f"{digits(values[label], label):>{wide}}" for label, wide in labels.items())
        lines.append(f"  {comparison.ranks[i]:>4}{cells}  {names[i]}")
    return lines
