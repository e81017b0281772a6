"""The text of ``dvr report quality``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dvr_cli.report.advice import advice
from dvr_cli.report.rows import (
    MEASURE_COLUMNS,
    histogram_rows,
    measure_rows,
    mesh_rows,
    place,
    quality_rows,
    remarks,
)
from dvr_cli.report.text.lines import VALUE, WIDTH, digits, kind, row, with_remark, wrap
from dvr_cli.report.text.notes import note_lines, shape_notes

if TYPE_CHECKING:
    from dvr_cli.quality.cell_measures import Distribution, Summary
    from dvr_cli.report.records import QualityReport

_MEASURE = 23  # columns of the name of a measure
_BAR = 50  # columns of the longest bar of a histogram


def quality_text(report: QualityReport, path: str, bar: str = "#", width: int = WIDTH) -> str:
    """The report of ``dvr report quality`` on the mesh at ``path``.

    bar: the character that the histogram is drawn with. width: columns to keep to, paths aside.
    """
    mesh, quality = report.mesh, report.quality
    lines = [*(row(name, count) for name, count in mesh_rows(report)), ""]
    lines.append("quality (mean ratio: 1 ideal, 0 degenerate, below 0 inverted)")
    remark_on = remarks(quality)
    for name, value in quality_rows(quality, mesh.dimension):
        lines += with_remark(row(name, value), remark_on.get(name, ""), width)
    lines += _measures(report.measures)
    by = report.distribution
    name = "quality" if by.measure is None else by.measure.label
    lines += ["", f"elements by {name}", *_histogram(by, bar, width)]
    if by.worst:
        lines += ["", f"worst elements by {name} (numbered from 0 through all cells of the file)"]
        for element in by.worst:
            lines += with_remark(f"  {digits(element.quality):>{VALUE}}", place(element, 6), width)
    lines += ["", f"advice: {advice(report)}", *note_lines(mesh, quality)]
    lines += [f"note: {note}" for note in shape_notes(report)]
    return "\n".join([f"{path} ({kind(mesh)})", *wrap(lines, width)])


def _measures(summaries: Sequence[Summary]) -> list[str]:
    """The block of other measures."""
    rows: list[tuple[str, tuple[str, ...]]] = [("other measures", MEASURE_COLUMNS)]
    rows += [
        (name, tuple(digits(value, name) for value in values)) for name, values in measure_rows(summaries)
    ]
    return [
        "",
        *(f"  {name:<{_MEASURE}}" + "".join(f"{v:>{VALUE}}" for v in values) for name, values in rows),
    ]


def _histogram(distribution: Distribution, bar: str, width: int) -> list[str]:
    rows = histogram_rows(distribution)
    most = max(count for _, count in rows)
    wide, labels = len(str(most)), max(len(label) for label, _ in rows)
    longest = min(_BAR, max(width - 6 - labels - wide, 5))
    # rounded up: no element goes unseen
    return [
        f"  {label:>{labels}}  {count:>{wide}}  {bar * -(-count * longest // most)}".rstrip()
        for label, count in rows
    ]
