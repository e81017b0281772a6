"""``dvr untangle``: make inverted elements positive, and leave it at that."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from dvr_cli.cli.options import (
    Debug,
    FailBelow,
    Fix,
    InputFormat,
    NoReport,
    OutputFormat,
    Plot,
    QualityField,
    Quiet,
    Report,
    Straighten,
    TimeLimit,
)
from dvr_cli.cli.run import run


def untangle(
    source: Annotated[Path, typer.Argument(metavar="IN", help="The mesh to untangle; - for stdin.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="The file to write; - for stdout.")],
    time_limit: TimeLimit = None,
    boundary: Annotated[
        Literal["fixed", "slide"],
        typer.Option(
            help="Whether vertices of the boundary, of interfaces and of embedded cells stay or slide along "
            "straight lines and planes.",
            metavar="fixed|slide",
        ),
    ] = "fixed",
    fix: Fix = None,
    report: Report = None,
    plot: Plot = None,
    quality_field: QualityField = False,
    no_report: NoReport = False,
    straighten: Straighten = False,
    input_format: InputFormat = None,
    output_format: OutputFormat = None,
    fail_below: FailBelow = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Move interior vertices so that inverted elements become positive, and leave it at that.

    Only vertices near inverted elements move. Where elements stay inverted this is said, with places and, if
    known, reasons; there are never more of them than before. 'dvr smooth --untangle' goes on to improve the
    quality.
    """
    from dvr_cli.api import SmoothOptions, smooth_mesh
    from dvr_cli.relax.stopping import Stopping

    options = SmoothOptions(
        boundary=boundary,
        fix=fix or (),
        straighten=straighten,
        untangle=True,
        stopping=Stopping(max_iterations=0, time_limit=time_limit),
    )
    return run(
        source,
        output,
        partial(smooth_mesh, options=options),
        report=report,
        no_report=no_report,
        plot=plot,
        quality_field=quality_field,
        input_format=input_format,
        output_format=output_format,
        fail_below=fail_below,
        quiet=quiet,
    )
