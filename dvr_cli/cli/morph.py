"""``dvr morph``: what the command takes and says; ``run`` does the work."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from dvr_cli.cli.help import example
from dvr_cli.cli.options import takes_options
from dvr_cli.cli.run import run

MORPH_EXAMPLES = (
    example("dvr morph in.vtk out.vtk --displacement d.npy", "move the boundary, and the interior with it"),
)


@takes_options("morph")
def morph(
    source: Annotated[Path, typer.Argument(metavar="IN", help="The mesh to deform; - for stdin.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="The file to write; - for stdout.")],
    **given: Any,
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

    options = SmoothOptions.of(given, patches=False, polish=False)
    shift = read_displacement(given["displacement"])
    work = partial(morph_mesh, displacement=shift, options=options, near=given["near"])
    return run(source, output, work, given)
