"""The reason for which a run ended, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvr_cli.relax.stopping import StopReason
from dvr_cli.report.text.lines import counted, digits

if TYPE_CHECKING:
    from dvr_cli.report.records import SmoothReport


def ending(report: SmoothReport) -> list[str]:
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
        return f"converged: little is gained below {digits(report.level)}, the level of care{how}"
    if report.stopped_because is StopReason.CONVERGED and patches:
        return "converged: moved jointly, the surroundings of the worst element gain no more"
    return {
        StopReason.CONVERGED: f"converged: Q1 grew by less than {options['tol']:g} in each of the last "
        f"{counted(options['patience'], 'sweep')}",
        StopReason.MAX_ITERATIONS: f"stopped: {counted(options['max_iterations'], 'sweep')} at most were "
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
