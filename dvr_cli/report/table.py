"""Reports as tab-separated text for other programs: a label, its value with all digits, and a remark."""

from __future__ import annotations

from collections.abc import Sequence

from dvr_cli.report.advice import advice
from dvr_cli.report.compare import Comparison
from dvr_cli.report.records import QualityReport
from dvr_cli.report.rows import (
    MEASURE_COLUMNS,
    Value,
    histogram_rows,
    measure_rows,
    mesh_rows,
    place,
    quality_rows,
    remarks,
)
from dvr_cli.report.text.notes import notes, shape_notes


def quality_table(report: QualityReport, path: str) -> str:
    """The report of ``dvr report quality`` on the mesh at ``path``, one line a figure."""
    remark_on = remarks(report.quality)
    rows: list[tuple[str, ...]] = [("mesh", path), ("dimension", str(report.mesh.dimension))]
    rows += [("surface", "yes")] if report.mesh.surface else []
    rows += [(name, str(count)) for name, count in mesh_rows(report)]
    rows += [
        (name, _exact(value), remark_on.get(name, ""))
        for name, value in quality_rows(report.quality, report.mesh.dimension)
    ]
    rows += _measure_cells(report)
    by = report.distribution
    rows += [("judged by", by.measure.name)] if by.measure is not None else []
    rows += [(f"elements {label}", str(count)) for label, count in histogram_rows(by)]
    rows += [(f"worst {i}", repr(w.quality), place(w, 6)) for i, w in enumerate(by.worst, start=1)]
    said = [*notes(report.mesh, report.quality), *shape_notes(report)]
    rows += [("advice", advice(report)), *(("note", note) for note in said)]
    return _lines(rows)


def comparison_table(comparison: Comparison, paths: Sequence[str]) -> str:
    """The report of ``dvr report compare`` on the meshes at ``paths``: labels, then a line for each."""
    dimension = comparison.before.mesh.dimension
    labels = [name for name, _ in quality_rows(comparison.before.quality, dimension)]
    labels += [label for label, _ in _measure_cells(comparison.before)]
    rows = [("mesh", "rank", *labels)]
    for path, rank, report in zip(paths, comparison.ranks, comparison.reports, strict=True):
        values = [_exact(value) for _, value in quality_rows(report.quality, dimension)]
        rows.append((path, str(rank), *values, *(value for _, value in _measure_cells(report))))
    return _lines(rows)


def _measure_cells(report: QualityReport) -> list[tuple[str, str]]:
    """Labels and figures of the measures in a report."""
    return [
        (f"{name} {column}", repr(value))
        for name, values in measure_rows(report.measures)
        for column, value in zip(MEASURE_COLUMNS, values, strict=True)
    ]


def _exact(value: Value) -> str:
    return "-" if value is None else repr(value)


def _lines(rows: Sequence[Sequence[str]]) -> str:
    """Rows as lines; what would break them, in file names, becomes a blank."""
    clean = (["".join(c if c.isprintable() else " " for c in cell) for cell in row] for row in rows)
    return "\n".join("\t".join(row).rstrip("\t") for row in clean)
