"""``dvr smooth``: what the command takes and says; ``run`` does the work."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from dvr_cli.cli.options import (
    Axis,
    Center,
    Debug,
    Directions,
    EngineName,
    FailBelow,
    Fix,
    InputFormat,
    MaxIterations,
    NoReport,
    Order,
    OutputFormat,
    Patience,
    Plot,
    QualityField,
    Quiet,
    Report,
    Seed,
    Straighten,
    Target,
    Threads,
    TimeLimit,
    Tol,
    Verbose,
    number,
    quality_value,
)
from dvr_cli.cli.run import is_page, run


def smooth(
    source: Annotated[Path, typer.Argument(metavar="IN", help="The mesh to improve; - for stdin.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="The file to write; - for stdout.")],
    directions: Directions = "steepest,random",
    center: Center = None,
    axis: Axis = None,
    max_iterations: MaxIterations = 100,
    tol: Tol = 1e-3,
    patience: Patience = 3,
    target: Target = None,
    time_limit: TimeLimit = None,
    order: Order = "coloured",
    seed: Seed = 0,
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
    fix: Fix = None,
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
    engine: EngineName = "auto",
    threads: Threads = None,
    report: Report = None,
    plot: Plot = None,
    quality_field: QualityField = False,
    no_report: NoReport = False,
    straighten: Straighten = False,
    untangle: Annotated[
        bool, typer.Option("--untangle", help="Make inverted elements positive first, as dvr untangle does.")
    ] = False,
    patches: Annotated[
        bool | None,
        typer.Option(
            "--patches/--no-patches",
            help="After the sweeps move the surroundings of the worst elements jointly, worst first, as long "
            "as Q1 grows; default: with the default directions if numba is installed, as it is slow without.",
            show_default=False,
        ),
    ] = None,
    polish: Annotated[
        bool | None,
        typer.Option(
            "--polish/--no-polish",
            help="Afterwards raise the mean quality while Q1 stays above the floor; default: with the "
            "default directions, unless the quality vector would fall below that of IN.",
            show_default=False,
        ),
    ] = None,
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
    output_format: OutputFormat = None,
    fail_below: FailBelow = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Improve a mesh by moving its vertices, each to where the worst element around it is best.

    Q1, the worst quality that this can touch, never decreases. Ctrl-C ends early with the mesh reached.
    """
    from dvr_cli.api import SmoothOptions, smooth_mesh
    from dvr_cli.relax.stopping import Stopping

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
        untangle=untangle,
        patches=patches,
        polish=polish,
        floor=floor,
        preset=preset,
        engine=engine,
        threads=threads,
        stopping=Stopping(max_iterations, tol, patience, target, time_limit),
    )
    return run(
        source,
        output,
        partial(smooth_mesh, options=options, means=plot is not None or is_page(report)),
        report=report,
        no_report=no_report,
        plot=plot,
        quality_field=quality_field,
        input_format=input_format,
        output_format=output_format,
        fail_below=fail_below,
        quiet=quiet,
        verbose=verbose,
    )
