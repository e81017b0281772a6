"""Reports as text: at most 80 columns (paths aside), ASCII but for the bars a caller may ask for."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvr_cli.report.compare import Comparison
    from dvr_cli.report.limits import Limit
    from dvr_cli.report.quality import Element, Quality
    from dvr_cli.report.records import BoundaryChange, MeshSummary, QualityReport, SmoothReport

_LABEL = 19  # columns of a row's label
_VALUE = 9  # columns of a value
_BAR = 50  # columns of the longest bar of a histogram


def quality_text(report: QualityReport, path: str, bar: str = "#") -> str:
    """The report of ``dvr report quality`` on the mesh at ``path``.

    bar: the character that the histogram is drawn with.
    """
    mesh, quality = report.mesh, report.quality
    counts = [("points", mesh.points), *mesh.cells.items(), ("relaxed vertices", report.relaxed)]
    counts += [("regions", mesh.regions)] if mesh.regions > 1 else []
    lines = [f"{path} ({_kind(mesh)})", *(_row(name, str(count)) for name, count in counts), ""]
    lines.append("quality (mean ratio: 1 ideal, 0 degenerate, below 0 inverted)")
    remarks = _remarks(quality)
    lines += [
        (_row(name, value) + "  " + remarks.get(name, "")).rstrip()
        for name, value in _figures(quality, mesh.dimension)
    ]
    lines += ["", "elements by quality", *_histogram(quality, bar)]
    if quality.worst:
        lines += ["", "worst elements (numbered from 0 through all cells of the file)"]
        lines += [f"  {_number(w.quality):>{_VALUE}}  {_place(w, 6)}" for w in quality.worst]
    return "\n".join(lines + _notes(mesh))


def smooth_text(report: SmoothReport, source: str, output: str) -> str:
    """The summary of a run of ``dvr smooth``: before and after, why it stopped, and what to know besides."""
    mesh = report.mesh
    cells = ", ".join(f"{count} {name}" for name, count in mesh.cells.items())
    lines = [
        f"{source} -> {output}",
        f"{_kind(mesh)}, {cells}",
        f"relaxed {report.relaxed} of {mesh.points} points in {_count(len(report.sweeps), 'sweep')}, "
        f"{report.seconds:.3f} s",
        *_side_by_side(report.before, report.after, mesh.dimension),
        *_untangled(report),
        *([] if report.untangling and not report.options["max_iterations"] else [_why_stopped(report)]),
        *_polished(report),
        *_boundary(report.boundary),
        *_limit(report.limited_by),
        *_notes(mesh),
    ]
    if left := report.after.inverted + report.after.degenerate:
        lines.append(f"note: {_count(left, 'inverted or degenerate element')} left")
        lines += _left(report)
    return "\n".join(lines)


def comparison_text(comparison: Comparison, before: str, after: str) -> str:
    """The report of ``dvr report compare`` on the meshes at the paths ``before`` and ``after``."""
    if comparison.component is None:
        verdict = "equal: the quality vectors are the same"
    else:
        i = comparison.component - 1
        old, new = comparison.before.quality.vector[i], comparison.after.quality.vector[i]
        name = after if comparison.better == "after" else before
        verdict = (
            f"{comparison.better} is better: {name}\n"
            f"the quality vectors first differ at component {i + 1} of {comparison.after.relaxed}: "
            f"{float(old)!r} before, {float(new)!r} after"
        )
    dimension = comparison.after.mesh.dimension
    return "\n".join(
        [verdict, *_side_by_side(comparison.before.quality, comparison.after.quality, dimension)]
    )


def sweep_line(
    sweep: int, phase: str, q1: float, moved: int, seconds: float, mean: float | None = None
) -> str:
    """What one sweep did, in one line; a phase other than relaxing is named."""
    name = "" if phase == "relax" else f"  {phase}"
    average = "" if mean is None else f"  mean {_number(mean)}"
    return f"sweep {sweep:3d}{name}  Q1 {_number(q1)}{average}  moved {moved}  {seconds:.2f} s"


def gate_failure(quality: Quality, limit: float) -> str:
    """Why the quality gate at ``limit`` failed."""
    return f"the worst quality, {_number(quality.minimum)}, is below {limit:g}"


def _figures(quality: Quality, dimension: int) -> list[tuple[str, str]]:
    """The rows of a quality block: label and value."""
    angle = "angle" if dimension == 2 else "dihedral"
    return [
        ("Q1", _number(quality.q1)),
        ("fixed cap", _number(quality.fixed_cap)),
        ("worst", _number(quality.minimum)),
        *((f"{100 * q:g} % quantile", _number(value)) for q, value in quality.quantiles.items()),
        ("mean", _number(quality.mean)),
        ("inverted", str(quality.inverted)),
        ("degenerate", str(quality.degenerate)),
        (f"min {angle} (deg)", _degrees(quality.min_angle)),
        (f"max {angle} (deg)", _degrees(quality.max_angle)),
    ]


def _remarks(quality: Quality) -> dict[str, str]:
    """What the rows of a quality block mean, and where the worst is, by label."""
    remarks = {"Q1": "nothing can be relaxed", "fixed cap": "every element has a relaxed vertex"}
    if quality.q1_element is not None:
        remarks["Q1"] = _place(quality.q1_element, 4)
    if quality.fixed_cap is not None:
        remarks["fixed cap"] = "worst without a relaxed vertex"
    if quality.worst:
        remarks["worst"] = _place(quality.worst[0], 4)
    return remarks


def _side_by_side(before: Quality, after: Quality, dimension: int) -> list[str]:
    rows = zip(_figures(before, dimension), _figures(after, dimension), strict=True)
    return [_row("", "before", "after"), *(_row(name, old, new) for (name, old), (_, new) in rows)]


def _untangled(report: SmoothReport) -> list[str]:
    """What untangling did, if it was asked for."""
    if report.untangling is None:
        return []
    rounds = report.untangling["rounds"]
    if not rounds:
        return ["nothing to untangle" if not report.after.inverted else "nothing that moving could untangle"]
    tangled, seconds = rounds[-1]["tangled"], sum(one["seconds"] for one in rounds)
    end = {
        "untangled": "every element that can be is positive",
        "stuck": f"gave up with {tangled} inverted or degenerate",
        "interrupted": "ended early",
    }[report.untangling["stopped_because"]]
    return [f"untangled in {_count(len(rounds), 'round')}, {seconds:.3f} s: {end}"]


def _left(report: SmoothReport) -> list[str]:
    """Where the worst of the elements left inverted are, and why as far as that is known."""
    if report.untangling is None:
        return []
    worst = [element for element in report.after.worst if element.quality <= 0]
    lines = [f"  {_number(element.quality):>{_VALUE}}  {_place(element, 6)}" for element in worst]
    if count := report.untangling["left"]["hopeless"]:
        lines.append(f"  {count} of them with a corner whose vertices are all held: no movement helps")
    if count := report.untangling["left"]["crossing"]:
        lines.append(f"  {count} of them near held facets that cross each other")
    return lines


def _why_stopped(report: SmoothReport) -> str:
    options = report.options
    selects = any(options[name] not in (None, []) for name in ("fix", "only", "below", "vertices"))
    patches = any(phase["phase"] == "patches" for phase in report.phases)
    if report.stopped_because == "converged" and patches:
        return "converged: moved jointly, the surroundings of the worst element gain no more"
    return {
        "converged": f"converged: Q1 grew by less than {options['tol']:g} in each of the last "
        f"{_count(options['patience'], 'sweep')}",
        "max-iterations": f"stopped: {_count(options['max_iterations'], 'sweep')} at most were asked for",
        "target": f"stopped: Q1 reached the target, {options['target']}",
        "time-limit": f"stopped: the time limit of {options['time_limit']} s was reached",
        "interrupted": "interrupted: the mesh reached by then was written",
        "rounding": "left as it was: rounding the coordinates would undo what there is to gain",
        "deviation": "left as it was: the boundary would come too far from the input's",
        "nothing-to-relax": "nothing to relax: "
        + ("the selection leaves no vertex that could move" if selects else "no vertex lies inside the mesh"),
    }[report.stopped_because]


def _limit(limit: Limit | None) -> list[str]:
    return [] if limit is None else [f"limited: {limit.text}", f"advice: {limit.advice}"]


def _polished(report: SmoothReport) -> list[str]:
    phase = report.phases[-1]
    if phase["phase"] != "polish" or not phase["sweeps"]:
        return []
    sweeps, floor = _count(phase["sweeps"], "sweep"), _number(phase["floor"])
    return [f"polished in {sweeps}: the mean raised, Q1 kept above {floor}"]


def _kind(mesh: MeshSummary) -> str:
    return "surface" if mesh.surface else f"{mesh.dimension}D"


def _boundary(change: BoundaryChange | None) -> list[str]:
    """What became of a projected boundary."""
    if change is None:
        return []
    changes = (("volume", change.volume_change), ("area", change.area_change))
    parts = [f"{name} {100.0 * value:+.2g} %" for name, value in changes if value is not None]
    apart = f"{change.deviation:.3g} from the input's at most (bound {change.max_deviation:.3g})"
    return [f"boundary: {'; '.join([apart, *parts])}"]


def _notes(mesh: MeshSummary) -> list[str]:
    """What to know of a mesh besides its figures."""
    notes = []
    if mesh.mirrored:
        notes.append(f"note: {_count(mesh.mirrored, 'cell')} stored inside out, taken as the mirror image")
    if mesh.curved:
        notes.append(f"note: {_count(mesh.curved, 'second-order cell')} curved, taken as straight")
    return notes


def _histogram(quality: Quality, bar: str) -> list[str]:
    counts = quality.histogram.tolist()
    n, most, width = len(counts), max(counts), max(len(str(count)) for count in counts)
    lines = []
    for i, count in enumerate(counts):
        label = f"below {1 / n:.2f}" if i == 0 else f"{i / n:.2f} - {(i + 1) / n:.2f}"
        length = -(-count * _BAR // most)  # rounded up: no element goes unseen
        lines.append(f"  {label:>11}  {count:>{width}}  {bar * length}".rstrip())
    return lines


def _place(element: Element, digits: int) -> str:
    centroid = ", ".join(f"{x:.{digits}g}" for x in element.centroid)
    return f"{element.cell_type} {element.cell} at ({centroid})"


def _row(label: str, *values: str) -> str:
    return f"  {label:<{_LABEL}}" + "".join(f"{value:>{_VALUE}}" for value in values)


def _number(quality: float | None) -> str:
    """A quality with four decimals, or with an exponent where these would show nothing."""
    if quality is None:
        return "-"
    return f"{quality:.4f}" if quality == 0 or abs(quality) >= 1e-3 else f"{quality:.1e}"


def _degrees(angle: float | None) -> str:
    return "-" if angle is None else f"{angle:.2f}"


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
