"""``dvr smooth``: read a mesh, relax it, write it and its report, and sum up."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import typer

from dvr_cli.cli.codes import DONE, GATE_FAILED, INTERRUPTED
from dvr_cli.cli.interrupt import Interrupt
from dvr_cli.cli.options import Debug, FailBelow, InputFormat, Vector, naming, number, quality_value, vector
from dvr_cli.cli.progress import Progress
from dvr_cli.cli.streams import say
from dvr_cli.errors import OutputError, UsageError

_LONG = 5.0  # seconds of relaxing after which the compiled engine is worth a word
_REPORT_SUFFIXES = (".json", ".csv")


def smooth(
    source: Annotated[Path, typer.Argument(metavar="IN", help="The mesh to improve; - for stdin.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="The file to write; - for stdout.")],
    directions: Annotated[
        str,
        typer.Option(
            "-d",
            "--directions",
            metavar="SPEC",
            help="Along what vertices move: a comma-separated list, one entry a sweep, cycled, of random, x, "
            "y, z, axis (= x,y[,z]), circumferential, radial, steepest (ascent of the worst quality around), "
            "optimal (steepest until none helps), file:PATH (.npy, .csv or .txt), field:NAME (a vector point "
            "field of IN).",
        ),
    ] = "random",
    center: Annotated[
        Vector | None,
        typer.Option(
            parser=vector(2, 3),
            metavar="X,Y[,Z]",
            help="Centre of circumferential and radial; default: the centroid of the points.",
        ),
    ] = None,
    axis: Annotated[
        Vector | None,
        typer.Option(
            parser=vector(3),
            metavar="X,Y,Z",
            help="Axis of circumferential and radial in a volume mesh; default: 0,0,1.",
        ),
    ] = None,
    max_iterations: Annotated[
        int, typer.Option("-n", "--max-iterations", min=0, metavar="N", help="Sweeps at most.")
    ] = 100,
    tol: Annotated[
        float,
        typer.Option(
            parser=number(0), metavar="EPS", help="Growth of Q1 in a sweep that counts as progress."
        ),
    ] = 1e-3,
    patience: Annotated[
        int, typer.Option(min=1, metavar="K", help="Stop after K sweeps in a row without progress.")
    ] = 3,
    target: Annotated[
        float | None, typer.Option(parser=quality_value, metavar="Q", help="Stop when Q1 reaches Q.")
    ] = None,
    time_limit: Annotated[
        float | None, typer.Option(parser=number(0), metavar="S", help="Stop after S seconds.")
    ] = None,
    order: Annotated[
        Literal["coloured", "natural", "shuffled"],
        typer.Option(help="Order of the vertices in a sweep.", metavar="coloured|natural|shuffled"),
    ] = "coloured",
    seed: Annotated[
        int, typer.Option(min=0, metavar="N", help="Seed of random directions and the shuffled order.")
    ] = 0,
    boundary: Annotated[
        Literal["fixed", "slide", "project"],
        typer.Option(
            help="Whether vertices of the boundary, of interfaces and of embedded cells stay, slide along "
            "straight lines and planes, so that every region and group keeps its shape, or move along curved "
            "ones too, projected to those of IN. Surfaces in space are always projected.",
            metavar="fixed|slide|project",
        ),
    ] = "fixed",
    feature_angle: Annotated[
        float,
        typer.Option(
            parser=number(0, 180),
            metavar="DEG",
            help="Where a projected boundary turns by more than this it is a feature: its vertices stay on "
            "the feature's curve, those of its corners in place.",
        ),
    ] = 30.0,
    max_deviation: Annotated[
        float | None,
        typer.Option(
            parser=number(0),
            metavar="D",
            help="How far a projected boundary may come from that of IN, measured from both; default: 1e-3 "
            "of the diagonal of the bounding box.",
        ),
    ] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Keep the vertices of a group in place: a physical group, region or set of IN by name or "
            "tag. Can be repeated.",
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Relax only the vertices of a group. Can be repeated."),
    ] = None,
    below: Annotated[
        float | None,
        typer.Option(
            parser=quality_value,
            metavar="Q",
            help="Relax only the vertices of elements of IN that are worse than Q.",
        ),
    ] = None,
    layers: Annotated[
        int, typer.Option(min=0, metavar="K", help="With --below: relax K rings of neighbours, too.")
    ] = 0,
    vertices: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Relax only the vertices listed in FILE (.txt, .csv or .npy), numbered from 0.",
        ),
    ] = None,
    engine: Annotated[
        Literal["auto", "numpy", "numba"],
        typer.Option(
            help="What computes; the result is the same. auto takes numba if it is installed (dvr-cli[fast]) "
            "and pays.",
            metavar="auto|numpy|numba",
        ),
    ] = "auto",
    threads: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Threads of the numba engine; default: all cores.")
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Where to write the report: .json, or .csv for the quality vector alone (vertices numbered "
            "from 0); default: OUT with its suffix replaced by .quality.json, none if OUT is -.",
        ),
    ] = None,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write no report.")] = False,
    straighten: Annotated[
        bool,
        typer.Option("--straighten", help="Take curved second-order cells as straight instead of refusing."),
    ] = False,
    patches: Annotated[
        bool,
        typer.Option(
            "--patches/--no-patches",
            help="After the sweeps move the surroundings of the worst elements jointly, worst first, as long "
            "as Q1 grows.",
        ),
    ] = False,
    polish: Annotated[
        bool,
        typer.Option("--polish", help="Afterwards raise the mean quality while Q1 stays above the floor."),
    ] = False,
    floor: Annotated[
        float,
        typer.Option(
            parser=number(0, 1), metavar="F", help="The floor of --polish, as a fraction of the Q1 reached."
        ),
    ] = 0.999,
    preset: Annotated[
        Literal["paper"] | None,
        typer.Option(
            metavar="paper",
            help="The paper's Algorithm 1: random directions, natural order, exactly N sweeps (-n).",
        ),
    ] = None,
    input_format: InputFormat = None,
    output_format: Annotated[
        str | None, typer.Option(metavar="NAME", help="Format of OUT; default: by its suffix.")
    ] = None,
    fail_below: FailBelow = None,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but errors.")] = False,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="Print a line for each sweep.")] = False,
    debug: Debug = False,
) -> int:
    """Improve a mesh by moving its vertices, each to where the worst element around it is best.

    Q1, the worst quality that this can touch, never decreases. Ctrl-C ends early with the mesh reached.
    """
    from dvr_cli.api import SmoothOptions, smooth_mesh
    from dvr_cli.files import writing
    from dvr_cli.files.reading import open_mesh
    from dvr_cli.relax.choice import has_numba
    from dvr_cli.relax.stopping import Stopping
    from dvr_cli.report.export import as_csv, as_json
    from dvr_cli.report.text import gate_failure, smooth_text

    options = SmoothOptions(
        directions=directions,
        center=center,
        axis=axis,
        order=order,
        seed=seed,
        boundary=boundary,
        feature_angle=feature_angle,
        max_deviation=max_deviation,
        fix=fix or (),
        only=only or (),
        below=below,
        layers=layers,
        vertices=vertices,
        straighten=straighten,
        patches=patches,
        polish=polish,
        floor=floor,
        preset=preset,
        engine=engine,
        threads=threads,
        stopping=Stopping(max_iterations, tol, patience, target, time_limit),
    )
    if quiet and verbose:
        raise UsageError("--quiet and --verbose exclude each other")
    if report is not None and no_report:
        raise UsageError("--report and --no-report exclude each other")
    writing.output_format_of(output, output_format)
    writing.check_writable(output)
    if report is None and not no_report and not writing.is_stream(output):
        report = output.with_suffix(".quality.json")
    if report is not None:
        _check_report(report, source, output)
        writing.check_writable(report)

    with Progress(quiet, verbose) as progress:
        progress.show(f"reading {source}")
        opened = open_mesh(source, input_format)
        destination = writing.Output(opened, output, output_format)
        progress.show("preparing")
        with Interrupt() as interrupt:
            with naming(source), naming(output, OutputError):
                points, result = smooth_mesh(
                    opened.mesh, options, destination, progress.sweep, lambda: interrupt.requested
                )
            progress.show(f"writing {output}")
            destination.write(points)
            if report is not None:
                csv = report.suffix.lower() == ".csv"
                text = as_csv(result.after) if csv else as_json(result.record(str(output), str(source)))
                writing.write_text(report, text + "\n")
    if not quiet:
        say(smooth_text(result, str(source), str(output)))
        if result.engine == "numpy" and result.seconds > _LONG and not has_numba():
            say("note: the compiled engine would be several times faster: pip install 'dvr-cli[fast]'")
        for note in destination.notes:
            say(f"note: {output}: {note}")
        if report is not None:
            say(f"report: {report}")
    if interrupt.requested:
        return INTERRUPTED
    if fail_below is not None and result.after.minimum < fail_below:
        say(f"dvr: {gate_failure(result.after, fail_below)}")
        return GATE_FAILED
    return DONE


def _check_report(path: Path, source: Path, output: Path) -> None:
    """Raise UsageError if the report cannot go to ``path``."""
    if path.suffix.lower() not in _REPORT_SUFFIXES:
        known = ", ".join(_REPORT_SUFFIXES)
        raise UsageError(f"--report {path}: unknown suffix {path.suffix!r}; known: {known}")
    if os.path.realpath(path) in (os.path.realpath(source), os.path.realpath(output)):
        raise UsageError(f"--report {path}: would overwrite a mesh")
