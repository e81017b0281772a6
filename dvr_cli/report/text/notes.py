"""Notes on a mesh: what was found in it, and what its qualities are measured against."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvr_cli.report.text.lines import counted, digits

if TYPE_CHECKING:
    from dvr_cli.quality.measure import Quality
    from dvr_cli.report.records import MeshSummary, QualityReport, ShapeUse

_LISTED = 6  # fields and sets that a note lists


def notes(mesh: MeshSummary, quality: Quality) -> list[str]:
    """Notes on a mesh with this quality."""
    notes = []
    if mesh.regions > 1:
        notes.append(f"{mesh.regions} regions, told apart by {_dividers(mesh)}; --regions chooses others")
    if mesh.mirrored:
        notes.append(f"{counted(mesh.mirrored, 'cell')} stored inside out, taken as the mirror image")
    if mesh.repeated:
        notes.append(f"{counted(mesh.repeated, 'cell')} given again with the same vertices, counted once")
    if mesh.orphans:
        notes.append(f"{mesh.orphans} of the points belong to no cell")
    if mesh.hanging:
        notes.append(
            f"{counted(mesh.hanging, 'hanging node')}: kept in place, with the facets of cells they are not "
            "connected to"
        )
    if mesh.coincident:
        notes.append(
            f"{mesh.coincident} vertices of the boundary lie on others that they are not connected to, "
            "and move by themselves"
        )
    if mesh.curved:
        how = "taken as straight" if mesh.straighten else "with vertices that stay (--straighten moves them)"
        notes.append(f"{counted(mesh.curved, 'second-order cell')} curved, {how}")
    if quality.uncertain:
        notes.append(
            f"{counted(quality.uncertain, 'curved cell')} uncertain: positive at the nodes, but not for "
            "certain between them"
        )
    return notes


def note_lines(mesh: MeshSummary, quality: Quality) -> list[str]:
    """The notes on a mesh with this quality as lines of a report."""
    return [f"note: {note}" for note in notes(mesh, quality)]


def _dividers(mesh: MeshSummary) -> str:
    """The names by which regions are told apart, as far as there is room."""
    texts = [divider.text for divider in mesh.divided_by]
    more = [f"{len(texts) - _LISTED} more"] if len(texts) > _LISTED else []
    return ", ".join([*texts[:_LISTED], *more])


def shape_notes(report: QualityReport) -> list[str]:
    """Notes about a metric, or about cells that are stretched on purpose."""
    use = report.stretched
    if use is None:
        return []
    if use.mode == "metric" or report.relative is None:
        return [in_metric(use)]
    plain, relative = report.quality, report.relative
    q1, cap = (
        f"{digits(own)} (plain: {digits(ideal)})"
        for own, ideal in ((relative.q1, plain.q1), (relative.fixed_cap, plain.fixed_cap))
    )
    relation = f"relative to their own shape Q1 is {q1}, the fixed cap {cap}"
    return [f"{stretched(use)}, which dvr smooth keeps; {relation}"]


def in_metric(use: ShapeUse) -> str:
    """A note that qualities are those in a metric, and how far it stretches shapes."""
    return f"qualities are those in the metric, which asks for aspects of up to {use.max_aspect:.3g} : 1"


def stretched(use: ShapeUse) -> str:
    """The number of cells that are stretched on purpose, and by how much."""
    return f"{counted(use.kept, 'cell')} stretched as their neighbours are, by up to {use.max_aspect:.3g} : 1"
