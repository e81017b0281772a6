"""``dvr smooth --mpi`` where no rank has to have the whole mesh."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dvr_cli.api.options import SmoothOptions
    from dvr_cli.api.shares import Written
    from dvr_cli.relax.sweeps import Sweep

# Options that need what a rank with all cells or vertices has.
_NEED_ALL = (
    "quality_field",
    "geometry",
    "plot",
    "fail_above",
    "mesh",
    "input_format",
    "output_format",
)


def smooth_in_shares(
    comm: Any,
    options: SmoothOptions,
    given: Mapping[str, Any],
    paths: tuple[Path, Path, Path | None],
    on_sweep: Callable[[Sweep], None],
    interrupted: Callable[[], bool],
) -> Written | None:
    """The report of a run in which each rank reads and writes a part, and notes; None where that cannot be.

    given: the options of the command. paths: of the mesh, its output and its report. on_sweep, interrupted:
    see ``sweeps.relax``.
    """
    from dvr_cli.api.shares import Hooks, Task, smooth_shares, takes
    from dvr_cli.cli.gates import gates_of
    from dvr_cli.distributed.ranks import together
    from dvr_cli.errors import DvrError
    from dvr_cli.files import writing
    from dvr_cli.files.formats import formats_by_suffix
    from dvr_cli.relax.engines.choice import MeshKind, choose_engine

    source, output, report = paths
    formats = formats_by_suffix(source)
    same = len(formats) == 1 and formats == formats_by_suffix(output)
    page = report is not None and report.suffix.lower() == ".html"
    measured = any(gate.measure is not None for gate in gates_of(given))
    if page or measured or not same or any(given[name] for name in _NEED_ALL) or not takes(options):
        return None
    if writing.is_stream(output) or not source.is_file():
        return None
    ranges = formats[0].ranges_of(source)
    if ranges is None or ranges.dimension < 2 or ranges.count < comm.size:
        return None
    measured = options.metric is not None
    if measured and str(options.metric) not in ranges.fields:
        return None
    sweeps = options.stopping.max_iterations
    mesh = MeshKind(planar=ranges.dimension == 2, measured=measured)
    kind = choose_engine(options.engine, ranges.points.count, sweeps, options.takes_patches, mesh=mesh)
    task = Task(source, ranges, output, options, kind.name, report is not None)
    result = together(comm, smooth_shares, (task,), Hooks(on_sweep, interrupted))
    if isinstance(result, DvrError):
        raise result
    return result
