"""``dvr smooth``: the arguments and help of the command; ``run`` does the work."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from dvr_cli.cli.help import example
from dvr_cli.cli.options import takes_options
from dvr_cli.cli.run import is_page, run

SMOOTH_EXAMPLES = (
    example("dvr smooth in.msh out.msh", "interior vertices move; the boundary and interfaces stay"),
    example("dvr smooth in.msh out.msh --boundary slide", "flat faces and straight edges free theirs, too"),
    example("dvr smooth deck.inp deck.inp --below 0.3", "only around elements worse than 0.3, in place"),
    example("dvr smooth in.msh out.vtu --fail-below 0.1", "exit code 1 if the worst is below 0.1 in the end"),
    example("generate | dvr smooth - - | solve", "in a pipeline"),
)


@takes_options("smooth")
def smooth(
    source: Annotated[Path, typer.Argument(metavar="IN", help="The mesh to improve; - for stdin.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="The file to write; - for stdout.")],
    **given: Any,
) -> int:
    """Improve a mesh by moving its vertices, each to where the worst element around it is best.

    Q1, the worst quality that this can touch, never decreases. Ctrl-C ends early with the mesh reached.
    """
    from dvr_cli.api.options import SmoothOptions
    from dvr_cli.api.smoothing import smooth_mesh

    options = SmoothOptions.of(given)
    smoothing: Callable[..., Any] = smooth_mesh
    if given["geometry"] is not None:
        from dvr_cli.api.geometry import smooth_on_geometry

        smoothing = partial(smooth_on_geometry, given["geometry"])
    pictured = given["plot"] is not None or is_page(given["report"])
    work = partial(smoothing, options=options, means=pictured)
    if given["mpi"]:
        from dvr_cli.cli.shares import smooth_in_shares
        from dvr_cli.distributed.job import world
        from dvr_cli.distributed.lead import LeadEngine

        work = partial(work, make=partial(LeadEngine, world()))
        return run(source, output, work, given, partial(smooth_in_shares, world(), options, given))
    return run(source, output, work, given)
