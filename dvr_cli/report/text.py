"""Reports for people: in as many columns as a terminal has, ASCII but for the bars a caller may ask for."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from dvr_cli.relax.phases import PolishPhase, UnfoldPhase
from dvr_cli.relax.stopping import StopReason
from dvr_cli.report.advice import advice
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

if TYPE_CHECKING:
    from dvr_cli.quality.cell_measures import Distribution, Summary
    from dvr_cli.quality.limits import Limit
    from dvr_cli.quality.measure import Quality
    from dvr_cli.report.compare import Comparison
    from dvr_cli.report.records import BoundaryChange, MeshSummary, QualityReport, ShapeUse, SmoothReport

WIDTH = 80  # columns where nobody says how many there are
_LABEL = 19  # columns of a row's label
_MEASURE = 23  # columns of the name of a measure
_VALUE = 9  # columns of a value
_LISTED = 6  # fields and sets that a note lists
_BAR = 50  # columns of the longest bar of a histogram
_RANKING = ("Q1", "fixed cap", "mean", "inverted", "10 % quantile")  # its columns, as far as they fit


def quality_text(report: QualityReport, path: str, bar: str = "#", width: int = WIDTH) -> str:
    """The report of ``dvr report quality`` on the mesh at ``path``.

    bar: the character that the histogram is drawn with. width: columns to keep to, paths aside.
    """
    mesh, quality = report.mesh, report.quality
    lines = [*(_row(name, count) for name, count in mesh_rows(report)), ""]
    lines.append("quality (mean ratio: 1 ideal, 0 degenerate, below 0 inverted)")
    remark_on = remarks(quality)
    for name, value in quality_rows(quality, mesh.dimension):
        lines += _with_remark(_row(name, value), remark_on.get(name, ""), width)
    lines += _measures(report.measures)
    by = report.distribution
    name = "quality" if by.measure is None else by.measure.label
    lines += ["", f"elements by {name}", *_histogram(by, bar, width)]
    if by.worst:
        lines += ["", f"worst elements by {name} (numbered from 0 through all cells of the file)"]
        for element in by.worst:
            lines += _with_remark(f"  {_digits(element.quality):>{_VALUE}}", place(element, 6), width)
    lines += ["", f"advice: {advice(report)}", *_note_lines(mesh, quality)]
    lines += [f"note: {note}" for note in shape_notes(report)]
    return "\n".join([f"{path} ({_kind(mesh)})", *wrap(lines, width)])


def shape_notes(report: QualityReport) -> list[str]:
    """Notes about a metric, or about cells that are stretched on purpose."""
    use = report.stretched
    if use is None:
        return []
    if use.mode == "metric" or report.relative is None:
        return [_in_metric(use)]
    plain, relative = report.quality, report.relative
    q1, cap = (
        f"{_digits(own)} (plain: {_digits(ideal)})"
        for own, ideal in ((relative.q1, plain.q1), (relative.fixed_cap, plain.fixed_cap))
    )
    relation = f"relative to their own shape Q1 is {q1}, the fixed cap {cap}"
    return [f"{_stretched(use)}, which dvr smooth keeps; {relation}"]


def smooth_text(report: SmoothReport, source: str, output: str, width: int | None = None) -> str:
    """The summary of a run that moved vertices: before and after, why it stopped, notes.

    width: columns to keep to, paths aside; None for no bound.
    """
    mesh = report.mesh
    cells = ", ".join(f"{count} {name}" for name, count in mesh.cells.items())
    lines = [
        f"{_kind(mesh)}, {cells}",
        f"relaxed {report.relaxed} of {mesh.points} points in {_count(len(report.sweeps), 'sweep')}, "
        f"{report.seconds:.3f} s",
        *_side_by_side(report.before, report.after, mesh.dimension),
        *_kept(report),
        *_unfolding(report.unfolding),
        *_untangling(report),
        *_morphing(report),
        *_ending(report),
        *_polishing(report),
        *_boundary(report.boundary),
        *([] if report.is_untouched else _limit(report.limited_by)),
        *_note_lines(mesh, report.after),
    ]
    if tangled := report.after.inverted + report.after.degenerate:
        helps = report.untangling is None and not mesh.surface and tangled > report.left["hopeless"]
        remedy = "; --untangle mends what it can" if helps else ""
        lines.append(f"note: {_count(tangled, 'inverted or degenerate element')} left{remedy}")
        lines += _tangled(report)
    untouched = wrap(_untouched(report), width) if width else _untouched(report)
    return "\n".join([*untouched, f"{source} -> {output}", *(wrap(lines, width) if width else lines)])


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
    rows = _side_by_side(comparison.before.quality, comparison.after.quality, dimension)
    return "\n".join([verdict, *wrap([*where, *rows], width)])


def _ranking(comparison: Comparison, names: Sequence[str], width: int) -> list[str]:
    """A table of meshes, the best first."""
    longest = max(map(len, names))
    labels = _RANKING[: max(1, (width - 8 - longest) // (_VALUE + 5))]
    lines = ["  rank" + "".join(f"{label:>{_VALUE + 5}}" for label in labels) + "  mesh"]
    for i in comparison.best_first:
        report = comparison.reports[i]
        values = dict(quality_rows(report.quality, report.mesh.dimension))
        cells = "".join(f"{_digits(values[label]):>{_VALUE + 5}}" for label in labels)
        lines.append(f"  {comparison.ranks[i]:>4}{cells}  {names[i]}")
    return lines


def wrap(lines: Sequence[str], width: int) -> list[str]:
    """Lines of which those longer than ``width`` are broken between words and go on further in."""
    parts = []
    for line in lines:
        indent = " " * (len(line) - len(line.lstrip()) + 4)
        parts += textwrap.wrap(
            line, max(width, 20), subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        ) or [""]
    return parts


def sweep_line(
    sweep: int, phase: str, q1: float, moved: int, seconds: float, mean: float | None = None
) -> str:
    """One line on a sweep; a phase other than relaxing is named."""
    name = "" if phase == "relax" else f"  {phase}"
    average = "" if mean is None else f"  mean {_digits(mean)}"
    return f"sweep {sweep:3d}{name}  Q1 {_digits(q1)}{average}  moved {moved}  {seconds:.2f} s"


def gate_failure(name: str, value: float, limit: float, below: bool) -> str:
    """The reason for which the gate at ``limit`` failed; below: on that side of it."""
    return f"the {name}, {_digits(value)}, is {'below' if below else 'above'} {limit:g}"


def _side_by_side(before: Quality, after: Quality, dimension: int) -> list[str]:
    rows = zip(quality_rows(before, dimension), quality_rows(after, dimension), strict=True)
    return [_row("", "before", "after"), *(_row(name, old, new) for (name, old), (_, new) in rows)]


def _kept(report: SmoothReport) -> list[str]:
    """The shapes that cells were measured against, if not the ideal ones, and the plain qualities."""
    if report.plain is None:
        return []
    before, after = report.plain
    if report.shape.mode == "metric":
        why = f"{_in_metric(report.shape)}; plain ones are not"
    else:
        why = (
            f"kept: {_stretched(report.shape)}; qualities above are relative to their own shape "
            "(--shape ideal would change them)"
        )
    return [
        _row("plain Q1", before.q1, after.q1),
        _row("plain fixed cap", before.fixed_cap, after.fixed_cap),
        _row("plain worst", before.minimum, after.minimum),
        _row("plain mean", before.mean, after.mean),
        why,
    ]


def _in_metric(use: ShapeUse) -> str:
    """That qualities are those in a metric, and how far it stretches shapes."""
    return f"qualities are those in the metric, which asks for aspects of up to {use.max_aspect:.3g} : 1"


def _stretched(use: ShapeUse) -> str:
    """The number of cells that are stretched on purpose, and by how much."""
    return f"{_count(use.kept, 'cell')} stretched as their neighbours are, by up to {use.max_aspect:.3g} : 1"


def _unfolding(phase: UnfoldPhase | None) -> list[str]:
    """The number of folded triangles that were unfolded, and the places of those that were not."""
    if phase is None:
        return []
    done = f"{phase.found - phase.left} of " if phase.left else ""
    lines = [f"unfolded {done}{_count(phase.found, 'folded triangle')}: {_count(phase.moved, 'point')} moved"]
    if phase.left:
        lines.append(
            "note: what lies folded counts as a feature; it needs a larger --max-deviation or a remesh"
        )
    for one in phase.places:
        vertices = " ".join(map(str, one["vertices"]))
        lines.append(f"  vertices {vertices} at {', '.join(_digits(x) for x in one['centroid'])}")
    return lines


def _untangling(report: SmoothReport) -> list[str]:
    """The result of untangling, if it was asked for."""
    if report.untangling is None:
        return []
    rounds = report.untangling.rounds
    if not rounds:
        return [_not_untangled(report)]
    tangled, seconds = rounds[-1]["tangled"], sum(one["seconds"] for one in rounds)
    end = {
        StopReason.UNTANGLED: "every element that can be is positive",
        StopReason.STUCK: f"gave up with {tangled} inverted or degenerate",
        StopReason.INTERRUPTED: "ended early",
    }[report.untangling.stopped_because]
    return [f"untangled in {_count(len(rounds), 'round')}, {seconds:.3f} s: {end}"]


def _not_untangled(report: SmoothReport) -> str:
    """The reason for which untangling moved no vertex."""
    before, after = report.before.inverted, report.after.inverted
    if after:
        return "nothing that moving could untangle"
    if before:
        return f"{_count(before, 'element')} inverted by a curved shape alone: made straight, no vertex moved"
    return "nothing to untangle"


def _morphing(report: SmoothReport) -> list[str]:
    """The part of a displacement that was made."""
    if report.morphing is None:
        return []
    part, substeps = report.morphing.fraction, len(report.morphing.substeps)
    return [f"{100 * part:.4g} % of the displacement made in {_count(substeps, 'substep')}"]


def _tangled(report: SmoothReport) -> list[str]:
    """The places of the worst elements that stay inverted, and the reasons as far as they are known."""
    lines = []
    if report.untangling is not None:
        worst = [element for element in report.after.worst if element.quality <= 0]
        lines = [f"  {_digits(element.quality):>{_VALUE}}  {place(element, 6)}" for element in worst]
    if count := report.left["hopeless"]:
        lines.append(f"  {count} of them with a corner whose vertices are all held: no movement helps")
    if count := report.left["crossing"]:
        lines.append(f"  {count} of them near held facets that cross each other")
    return lines


def _ending(report: SmoothReport) -> list[str]:
    """The reason for which the run ended; of untangling alone only one that ended it early."""
    alone = report.untangling is not None and not report.options["max_iterations"]
    if alone and not report.stopped_because.cuts_short:
        return []
    return [_reason(report)]


def _reason(report: SmoothReport) -> str:
    options = report.options
    selects = any(options[name] not in (None, []) for name in ("fix", "only", "below", "vertices"))
    patches = any(phase.phase == "patches" for phase in report.phases)
    if report.stopped_because is StopReason.CONVERGED and report.level is not None:
        how = ", alone or jointly" if patches else ""
        return f"converged: below {_digits(report.level)}, the level of care, nothing gains{how}"
    if report.stopped_because is StopReason.CONVERGED and patches:
        return "converged: moved jointly, the surroundings of the worst element gain no more"
    return {
        StopReason.CONVERGED: f"converged: Q1 grew by less than {options['tol']:g} in each of the last "
        f"{_count(options['patience'], 'sweep')}",
        StopReason.MAX_ITERATIONS: f"stopped: {_count(options['max_iterations'], 'sweep')} at most were "
        "asked for",
        StopReason.TARGET: f"stopped: Q1 reached the target, {options['target']}",
        StopReason.TIME_LIMIT: f"stopped: the time limit of {options['time_limit']} s was reached",
        StopReason.INTERRUPTED: "interrupted: the mesh reached by then was written",
        StopReason.ROUNDING: "left as it was: rounding the coordinates would undo what there is to gain",
        StopReason.DEVIATION: "left as it was: the boundary would come too far from the input's",
        StopReason.NOTHING_TO_RELAX: "nothing to relax: " + _why_none_moves(report, selects),
    }[report.stopped_because]


def _why_none_moves(report: SmoothReport, selects: bool) -> str:
    if selects:
        return "the selection leaves no vertex that could move"
    if report.shape.kept:
        return "the vertices inside belong to cells that are kept"
    return "no vertex lies inside the mesh"


def _limit(limit: Limit | None) -> list[str]:
    return [] if limit is None else [f"limited: {limit.text}", f"advice: {limit.advice}"]


def _untouched(report: SmoothReport) -> list[str]:
    """The worst element where no vertex of it was relaxed, what would free it, and what that keeps."""
    limit = report.limited_by
    if limit is None or not report.is_untouched:
        return []
    worst = f"{limit.element.cell_type} {limit.element.cell}, quality {_digits(limit.element.quality)}"
    keeps = f", and {limit.keeps}" if limit.keeps else ""
    return [f"not touched: the worst element ({worst}): {limit.text}; {limit.advice}{keeps}"]


def _polishing(report: SmoothReport) -> list[str]:
    phase = report.phases[-1]
    if not isinstance(phase, PolishPhase) or not phase.sweeps:
        return []
    sweeps, floor = _count(phase.sweeps, "sweep"), _digits(phase.floor)
    kept = f"Q1 kept above {floor}"
    if phase.floor == report.level:
        kept = f"the vector below {floor} not lowered"
    return [f"polished in {sweeps}: the mean raised, {kept}"]


def _kind(mesh: MeshSummary) -> str:
    return "surface" if mesh.surface else f"{mesh.dimension}D"


def _boundary(change: BoundaryChange | None) -> list[str]:
    """The change of a boundary on which vertices walked."""
    if change is None:
        return []
    changes = (("volume", change.volume_change), ("area", change.area_change))
    parts = [f"{name} {100.0 * value:+.2g} %" for name, value in changes if value is not None]
    apart = f"{change.deviation:.3g} from the input's at most (bound {change.max_deviation:.3g})"
    return [f"boundary: {'; '.join([apart, *parts])}"]


def _note_lines(mesh: MeshSummary, quality: Quality) -> list[str]:
    return [f"note: {note}" for note in notes(mesh, quality)]


def notes(mesh: MeshSummary, quality: Quality) -> list[str]:
    """Notes on a mesh with this quality."""
    notes = []
    if mesh.regions > 1:
        notes.append(f"{mesh.regions} regions, told apart by {_dividers(mesh)}; --regions chooses others")
    if mesh.mirrored:
        notes.append(f"{_count(mesh.mirrored, 'cell')} stored inside out, taken as the mirror image")
    if mesh.repeated:
        notes.append(f"{_count(mesh.repeated, 'cell')} given again with the same vertices, counted once")
    if mesh.orphans:
        notes.append(f"{mesh.orphans} of the points belong to no cell")
    if mesh.hanging:
        notes.append(
            f"{_count(mesh.hanging, 'hanging node')}: kept in place, with the facets of cells they are not "
            "connected to"
        )
    if mesh.coincident:
        notes.append(
            f"{mesh.coincident} vertices of the boundary lie on others that they are not connected to, "
            "and move by themselves"
        )
    if mesh.curved:
        how = "taken as straight" if mesh.straighten else "with vertices that stay (--straighten moves them)"
        notes.append(f"{_count(mesh.curved, 'second-order cell')} curved, {how}")
    if quality.uncertain:
        notes.append(
            f"{_count(quality.uncertain, 'curved cell')} uncertain: positive at the nodes, but not for "
            "certain between them"
        )
    return notes


def _dividers(mesh: MeshSummary) -> str:
    """The names by which regions are told apart, as far as there is room."""
    texts = [divider.text for divider in mesh.divided_by]
    more = [f"{len(texts) - _LISTED} more"] if len(texts) > _LISTED else []
    return ", ".join([*texts[:_LISTED], *more])


def _measures(summaries: Sequence[Summary]) -> list[str]:
    """The block of other measures."""
    rows: list[tuple[str, tuple[str, ...]]] = [("other measures", MEASURE_COLUMNS)]
    rows += [
        (name, tuple(_digits(value, name) for value in values)) for name, values in measure_rows(summaries)
    ]
    return [
        "",
        *(f"  {name:<{_MEASURE}}" + "".join(f"{v:>{_VALUE}}" for v in values) for name, values in rows),
    ]


def _histogram(distribution: Distribution, bar: str, width: int) -> list[str]:
    rows = histogram_rows(distribution)
    most = max(count for _, count in rows)
    digits, labels = len(str(most)), max(len(label) for label, _ in rows)
    longest = min(_BAR, max(width - 6 - labels - digits, 5))
    # rounded up: no element goes unseen
    return [
        f"  {label:>{labels}}  {count:>{digits}}  {bar * -(-count * longest // most)}".rstrip()
        for label, count in rows
    ]


def _with_remark(row: str, remark: str, width: int) -> list[str]:
    """A row with a remark, which has a line of its own where they do not fit into one."""
    fits = len(row) + 2 + len(remark) <= width
    return [f"{row}  {remark}".rstrip()] if fits else [row, f"    {remark}"]


def _row(label: str, *values: Value | str) -> str:
    cells = (value if isinstance(value, str) else _digits(value, label) for value in values)
    return f"  {label:<{_LABEL}}" + "".join(f" {cell:>{_VALUE - 1}}" for cell in cells)


def _digits(value: Value, label: str = "") -> str:
    """A quality with four decimals, or with an exponent where these would show nothing; other figures."""
    if value is None:
        return "-"
    if isinstance(value, int):
        return str(value)
    if label.endswith("(deg)"):
        return f"{value:.2f}"
    if abs(value) >= 1e6:
        return f"{value:.3e}"
    return f"{value:.4f}" if value == 0 or abs(value) >= 1e-3 else f"{value:.1e}"


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
