"""``dvr untangle``: the arguments and help of the command; ``run`` does the work."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from dvr_cli.cli.help import example
from dvr_cli.cli.options import takes_options
from dvr_cli.cli.run import run

UNTANGLE_EXAMPLES = (
    example("dvr untangle in.msh out.msh", "move vertices near inverted elements, and no others"),
    example("dvr untangle in.msh out.msh --fail-below 0", "exit code 1 if an element is still inverted"),
)


@takes_options("untangle")
def untangle(
    source: Annotated[Path, typer.Argument(metavar="IN", help="The mesh to untangle; - for stdin.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="The file to write; - for stdout.")],
    **given: Any,
) -> int:
    """Move vertices so that inverted elements become positive, and leave it at that.

    Only vertices near inverted elements move. Where elements stay inverted this is said, with places and, if
    known, reasons; there are never more of them than before. 'dvr smooth --untangle' goes on to improve the
    quality.
    """
    from dvr_cli.api.options import SmoothOptions
    from dvr_cli.api.smoothing import smooth_mesh

    options = SmoothOptions.of(given, untangle=True, max_iterations=0)
    return run(source, output, partial(smooth_mesh, options=options), given)
