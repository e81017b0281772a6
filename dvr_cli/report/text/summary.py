"""The summary of a run that moved vertices."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvr_cli.report.text.ending import ending
from dvr_cli.report.text.lines import counted, digits, kind, row, side_by_side, wrap
from dvr_cli.report.text.notes import in_metric, note_lines, stretched
from dvr_cli.report.text.phases import (
    boundary,
    morphing,
    polishing,
    put_back,
    tangled_left,
    unfolding,
    untangling,
)

if TYPE_CHECKING:
    from dvr_cli.quality.limits import Limit
    from dvr_cli.report.records import SmoothReport


def smooth_text(report: SmoothReport, source: str, output: str, width: int | None = None) -> str:
    """The summary of a run that moved vertices: before and after, why it stopped, notes.

    width: columns to keep to, paths aside; None for no bound.
    """
    mesh = report.mesh
    cells = ", ".join(f"{count} {name}" for name, count in mesh.cells.items())
    lines = [
        f"{kind(mesh)}, {cells}",
        f"relaxed {report.relaxed} of {mesh.points} points in {counted(len(report.sweeps), 'sweep')}, "
        f"{report.seconds:.3f} s",
        *side_by_side(report.before, report.after, mesh.dimension),
        *_kept(report),
        *unfolding(report.unfolding),
        *untangling(report),
        *morphing(report),
        *ending(report),
        *polishing(report),
        *boundary(report.boundary),
        *put_back(report.put_back),
        *([] if report.is_untouched else _limit(report.limited_by)),
        *note_lines(mesh, report.after),
    ]
    if tangled := report.after.inverted + report.after.degenerate:
        helps = report.untangling is None and not mesh.surface and tangled > report.left["hopeless"]
        remedy = "; --untangle mends what it can" if helps else ""
        lines.append(f"note: {counted(tangled, 'inverted or degenerate element')} left{remedy}")
        lines += tangled_left(report)
    untouched = wrap(_untouched(report), width) if width else _untouched(report)
    return "\n".join([*untouched, f"{source} -> {output}", *(wrap(lines, width) if width else lines)])


def _kept(report: SmoothReport) -> list[str]:
    """The shapes that cells were measured against, if not the ideal ones, and the plain qualities."""
    if report.plain is None:
        return []
    before, after = report.plain
    if report.shape.mode == "metric":
        why = f"{in_metric(report.shape)}; plain ones are not"
    else:
        why = (
            f"kept: {stretched(report.shape)}; qualities above are relative to their own shape "
            "(--shape ideal would change them)"
        )
    return [
        row("plain Q1", before.q1, after.q1),
        row("plain fixed cap", before.fixed_cap, after.fixed_cap),
        row("plain worst", before.minimum, after.minimum),
        row("plain mean", before.mean, after.mean),
        why,
    ]


def _limit(limit: Limit | None) -> list[str]:
    return [] if limit is None else [f"limited: {limit.text}", f"advice: {limit.advice}"]


def _untouched(report: SmoothReport) -> list[str]:
    """The worst element where no vertex of it was relaxed, what would free it, and what that keeps."""
    limit = report.limited_by
    if limit is None or not report.is_untouched:
        return []
    worst = f"{limit.element.cell_type} {limit.element.cell}, quality {digits(limit.element.quality)}"
    keeps = f", and {limit.keeps}" if limit.keeps else ""
    return [f"not touched: the worst element ({worst}): {limit.text}; {limit.advice}{keeps}"]
