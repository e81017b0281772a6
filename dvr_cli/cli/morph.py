"""``dvr morph``: a mesh whose boundary is displaced, and which is relaxed to follow."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from dvr_cli.cli.options import (
    Axis,
    Center,
    Debug,
    Directions,
    EngineName,
    FailBelow,
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
    Tol,
    Verbose,
)
from dvr_cli.cli.run import run


def morph(
    source: Annotated[Path, typer.Argument(metavar="IN", help="The mesh to deform; - for stdin.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="The file to write; - for stdout.")],
    displacement: Annotated[
        Path,
        typer.Option(
            metavar="FILE",
            help="By how much vertices move: .npy, .csv or .txt with one row for each vertex of IN. Rows of "
            "vertices that are relaxed are not looked at.",
        ),
    ],
    near: Annotated[
        int | None,
        typer.Option(min=0, metavar="K", help="Relax only vertices within K rings of displaced ones."),
    ] = None,
    directions: Directions = "random",
    center: Center = None,
    axis: Axis = None,
    max_iterations: MaxIterations = 100,
    tol: Tol = 1e-3,
    patience: Patience = 3,
    target: Target = None,
    order: Order = "coloured",
    seed: Seed = 0,
    engine: EngineName = "auto",
    threads: Threads = None,
    report: Report = None,
    plot: Plot = None,
    quality_field: QualityField = False,
    no_report: NoReport = False,
    straighten: Straighten = False,
    input_format: InputFormat = None,
    output_format: OutputFormat = None,
    fail_below: FailBelow = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Displace the boundary of a mesh and relax its interior vertices, so that it stays valid.

    Vertices on the boundary, on interfaces and of embedded cells are displaced, all others relaxed as by
    'dvr smooth'. Where one step leaves elements inverted, smaller ones are made; the options of relaxing
    hold for each. When no step down to 1/1024 keeps the mesh valid, nothing is written and the exit code
    is 3. Ctrl-C ends early with the last valid mesh.
    """
    from dvr_cli.api.morphing import morph_mesh
    from dvr_cli.api.options import SmoothOptions
    from dvr_cli.files.arrays import read_displacement
    from dvr_cli.relax.stopping import Stopping

    options = SmoothOptions(
        directions=directions,
        center=center,
        axis=axis,
        order=order,
        seed=seed,
        straighten=straighten,
        engine=engine,
        threads=threads,
        patches=False,
        polish=False,
        stopping=Stopping(max_iterations, tol, patience, target),
    )
    shift = read_displacement(displacement)
    return run(
        source,
        output,
        partial(morph_mesh, displacement=shift, options=options, near=near),
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
