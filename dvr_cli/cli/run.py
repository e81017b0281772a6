"""The steps that all commands that move vertices share: read, compute, write mesh and report, sum up."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvr_cli.cli.codes import DONE, GATE_FAILED, INTERRUPTED
from dvr_cli.cli.files import PICTURES, check, write_picture
from dvr_cli.cli.gates import Gate, failures, gates_of
from dvr_cli.cli.interrupt import Interrupt
from dvr_cli.cli.options import naming
from dvr_cli.cli.progress import Known, Progress
from dvr_cli.cli.streams import columns, onto_stdout, say
from dvr_cli.errors import OutputError, UsageError

if TYPE_CHECKING:
    import numpy as np

    from dvr_cli.report.records import SmoothReport

_LONG = 5.0  # seconds of relaxing after which the compiled engine is worth a word
_REPORTS = (".json", ".csv", ".html")


def is_page(report: Path | None) -> bool:
    """True if a report goes into a page with pictures."""
    return report is not None and report.suffix.lower() == ".html"


def run(
    source: Path,
    output: Path,
    work: Callable[..., tuple[np.ndarray, SmoothReport]],
    given: Mapping[str, Any],
    apart: Callable[..., tuple[SmoothReport, list[str]] | None] = lambda *arguments: None,
) -> int:
    """Run a command that moves the vertices of a mesh and return its exit code; see ``dvr smooth --help``.

    work: ``smooth_mesh`` or the like; gets the mesh, and storage, on_sweep and interrupted by name. given:
    the options of the command. apart: does all of it but the report without the mesh in this process, where
    it can; gets the paths of mesh, output and report, on_sweep and interrupted, returns the report and notes.
    """
    from dvr_cli.files import writing
    from dvr_cli.relax.engines.choice import has_numba, is_compiling

    report, no_report, plot = given["report"], given["no_report"], given["plot"]
    output_format, quality_field = given["output_format"], given["quality_field"]
    gates, measure = gates_of(given), given["measure"]
    quiet, verbose = given["quiet"], given.get("verbose", False)
    if quiet and verbose:
        raise UsageError("--quiet and --verbose exclude each other")
    page = is_page(report)
    if measure is not None and not quality_field and plot is None and not page:
        raise UsageError("--measure needs --quality-field, --plot or a --report in HTML, which show it")
    if report is not None and no_report:
        raise UsageError("--report and --no-report exclude each other")
    writing.output_format_of(output, output_format)
    writing.check_writable(output)
    if report is None and not no_report and not writing.is_stream(output):
        report = output.with_suffix(".quality.json")
    if report is not None:
        check("--report", report, _REPORTS, [source, output])
    if plot is not None:
        check("--plot", plot, PICTURES, [source, output, report])

    paths, interrupt = (source, output, report), Interrupt()
    fixed = given["max_iterations"] if given.get("preset") is not None else None  # presets fix the sweeps
    known = Known(given.get("time_limit"), fixed, lambda: interrupt.requested, is_compiling)
    failed: list[str] = []
    notes: list[str] = []
    with Progress(quiet, verbose, known) as progress:
        progress.show(f"reading {source}")
        with interrupt:
            done = apart(paths, progress.sweep, lambda: interrupt.requested)
        if done is None:
            result, failed, notes = _run_here(paths, work, given, gates, progress, interrupt)
        else:
            result, notes = done
            failed = failures(gates, result.after)
            if report is not None:
                _write_report(report, result, source, output)
    if not quiet:
        from dvr_cli.report.text.summary import smooth_text

        say(smooth_text(result, str(source), str(output), columns(sys.stderr)))
        relaxing = sum(sweep["seconds"] for sweep in result.sweeps)
        if relaxing > _LONG and not has_numba():
            say("note: the compiled engine would be several times faster: pip install 'dvr-cli[fast]'")
        for note in notes:
            say(f"note: {output}: {note}")
        if report is not None:
            say(f"report: {report}")
        if plot is not None:
            say(f"picture: {plot}")
    if interrupt.requested:
        return INTERRUPTED
    for text in failed:
        say(f"dvr: {text}")
    return GATE_FAILED if failed else DONE


def _run_here(
    paths: tuple[Path, Path, Path | None],
    work: Callable[..., tuple[np.ndarray, SmoothReport]],
    given: Mapping[str, Any],
    gates: Sequence[Gate],
    progress: Progress,
    interrupt: Interrupt,
) -> tuple[SmoothReport, list[str], list[str]]:
    """Read, move, write and draw in this process: the report, the gates that failed, and notes on the output.

    paths: of mesh, output and report. work, given: see ``run``.
    """
    from dvr_cli.files import writing
    from dvr_cli.files.reading import open_mesh
    from dvr_cli.quality.measure import cell_field

    source, output, report = paths
    measure, field = given["measure"], given["quality_field"]
    opened = open_mesh(source, given["input_format"], given["mesh"])
    name = (measure or "quality") if field else None
    destination = writing.Output(opened, output, given["output_format"], name)
    progress.show("preparing")
    with interrupt:
        with naming(source), naming(output, OutputError):
            points, result = work(
                opened.mesh,
                storage=destination,
                on_sweep=progress.sweep,
                interrupted=lambda: interrupt.requested,
            )
            failed = failures(gates, result.after, opened.mesh, points)
            if field and measure is not None:
                from dvr_cli.quality.cell_measures import measure_field

                destination.fill(measure_field(opened.mesh, measure, points), points)
            elif field:
                destination.fill(cell_field(opened.mesh, result.after.elements), points)
        progress.show(f"writing {output}")
        with onto_stdout():  # what a file cannot take is an OutputError already
            destination.write(points)
        page = is_page(report)
        if report is not None and not page:
            _write_report(report, result, source, output)
        for picture in filter(None, [given["plot"], report if page else None]):
            progress.show(f"drawing {picture}")
            from dvr_cli.report.text.summary import smooth_text

            summary = smooth_text(result, str(source), str(output))
            states = {"before": (opened.mesh.points, result.before), "after": (points, result.after)}
            more = result.sweeps, result.kept, measure
            write_picture(picture, opened.mesh, states, str(output), summary, *more)
    return result, failed, destination.notes


def _write_report(path: Path, result: SmoothReport, source: Path, output: Path) -> None:
    from dvr_cli.files import writing
    from dvr_cli.report.export import as_csv, as_json

    csv = path.suffix.lower() == ".csv"
    text = as_csv(result.after) if csv else as_json(result.record(str(output), str(source)))
    writing.write_text(path, text + "\n")
