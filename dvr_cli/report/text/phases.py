"""The result of each phase of a run, in a line or two."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvr_cli.relax.phases import PolishPhase, UnfoldPhase
from dvr_cli.relax.stopping import StopReason
from dvr_cli.report.rows import place
from dvr_cli.report.text.lines import VALUE, counted, digits

if TYPE_CHECKING:
    from dvr_cli.report.records import BoundaryChange, SmoothReport


def unfolding(phase: UnfoldPhase | None) -> list[str]:
    """The number of folded triangles that were unfolded, and the places of those that were not."""
    if phase is None:
        return []
    done = f"{phase.found - phase.left} of " if phase.left else ""
    lines = [
        f"unfolded {done}{counted(phase.found, 'folded triangle')}: {counted(phase.moved, 'point')} moved"
    ]
    if phase.left:
        lines.append(
            "note: what lies folded counts as a feature; it needs a larger --max-deviation or a remesh"
        )
    for one in phase.places:
        vertices = " ".join(map(str, one["vertices"]))
        lines.append(f"  vertices {vertices} at {', '.join(digits(x) for x in one['centroid'])}")
    return lines


def untangling(report: SmoothReport) -> list[str]:
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
    return [f"untangled in {counted(len(rounds), 'round')}, {seconds:.3f} s: {end}"]


def _not_untangled(report: SmoothReport) -> str:
    """The reason for which untangling moved no vertex."""
    before, after = report.before.inverted, report.after.inverted
    if after:
        return "nothing that moving could untangle"
    if before:
        return (
            f"{counted(before, 'element')} inverted by a curved shape alone: made straight, no vertex moved"
        )
    return "nothing to untangle"


def tangled_left(report: SmoothReport) -> list[str]:
    """The places of the worst elements that stay inverted, and the reasons as far as they are known."""
    lines = []
    if report.untangling is not None:
        worst = [element for element in report.after.worst if element.quality <= 0]
        lines = [f"  {digits(element.quality):>{VALUE}}  {place(element, 6)}" for element in worst]
    if count := report.left["hopeless"]:
        lines.append(f"  {count} of them with a corner whose vertices are all held: no movement helps")
    if count := report.left["crossing"]:
        lines.append(f"  {count} of them near held facets that cross each other")
    return lines


def morphing(report: SmoothReport) -> list[str]:
    """The part of a displacement that was made."""
    if report.morphing is None:
        return []
    part, substeps = report.morphing.fraction, len(report.morphing.substeps)
    return [f"{100 * part:.4g} % of the displacement made in {counted(substeps, 'substep')}"]


def polishing(report: SmoothReport) -> list[str]:
    """The result of polishing, if it was the last phase and moved anything."""
    phase = report.phases[-1]
    if not isinstance(phase, PolishPhase) or not phase.sweeps:
        return []
    sweeps, floor = counted(phase.sweeps, "sweep"), digits(phase.floor)
    kept = f"Q1 kept above {floor}"
    if phase.floor == report.level:
        kept = f"the vector below {floor} not lowered"
    return [f"polished in {sweeps}: the mean raised, {kept}"]


def boundary(change: BoundaryChange | None) -> list[str]:
    """The change of a boundary on which vertices walked."""
    if change is None:
        return []
    changes = (("volume", change.volume_change), ("area", change.area_change))
    parts = [f"{name} {100.0 * value:+.2g} %" for name, value in changes if value is not None]
    apart = f"{change.deviation:.3g} from the input's at most (bound {change.max_deviation:.3g})"
    return [f"boundary: {'; '.join([apart, *parts])}"]


def put_back(number: int | None) -> list[str]:
    """The vertices that went back to where the input has them, for the sake of elements on a CAD model."""
    if not number:
        return []
    return [f"geometry: {counted(number, 'point')} put back in place: an element would be too bad there"]
