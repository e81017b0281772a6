"""Reports as tab-separated text for other programs: a label, its value with all digits, and a remark."""

from __future__ import annotations

from collections.abc import Sequence

from dvr_cli.report.advice import advice
from dvr_cli.report.compare import Comparison
from dvr_cli.report.figures import Figure, bins, counts, figures, place, remarks
from dvr_cli.report.records import QualityReport
from dvr_cli.report.text import notes


def quality_table(report: QualityReport, path: str) -> str:
    """The report of ``dvr report quality`` on the mesh at ``path``, one line a figure."""
    said = remarks(report.quality)
    rows: list[tuple[str, ...]] = [("mesh", path), ("dimension", str(report.mesh.dimension))]
    rows += [("surface", "yes")] if report.mesh.surface else []
    rows += [(name, str(count)) for name, count in counts(report)]
    rows += [
        (name, _exact(value), said.get(name, ""))
        for name, value in figures(report.quality, report.mesh.dimension)
    ]
    rows += [(f"elements {label}", str(count)) for label, count in bins(report.quality)]
    rows += [
        (f"worst {i}", repr(w.quality), place(w, 6)) for i, w in enumerate(report.quality.worst, start=1)
    ]
    rows += [("advice", advice(report)), *(("note", note) for note in notes(report.mesh))]
    return _lines(rows)


def comparison_table(comparison: Comparison, paths: Sequence[str]) -> str:
    """The report of ``dvr report compare`` on the meshes at ``paths``: labels, then a line for each."""
    dimension = comparison.before.mesh.dimension
    rows = [("mesh", "rank", *(name for name, _ in figures(comparison.before.quality, dimension)))]
    for path, rank, report in zip(paths, comparison.ranks, comparison.reports, strict=True):
        rows.append((path, str(rank), *(_exact(value) for _, value in figures(report.quality, dimension))))
    return _lines(rows)


def _exact(value: Figure) -> str:
    return "-" if value is None else repr(value)


def _lines(rows: Sequence[Sequence[str]]) -> str:
    """Rows as lines; what would break them, in file names, becomes a blank."""
    clean = (["".join(c if c.isprintable() else " " for c in cell) for cell in row] for row in rows)
    return "\n".join("\t".join(row).rstrip("\t") for row in clean)
