"""``dvr warm-up``: what the compiled engine is made of is compiled, before a run has to wait for it."""

from __future__ import annotations

from dvr_cli.cli.help import example
from dvr_cli.cli.progress import Progress
from dvr_cli.cli.streams import emit

WARM_UP_EXAMPLES = (example("dvr warm-up", "once, where a container's image is made"),)


def warm_up() -> int:
    """Compile all that the compiled engine needs, and keep it for later runs.

    The first run of each kind of mesh does its part of this otherwise. It takes some minutes, and seconds
    where it has been done. Only what vertices on curved boundaries need in a metric is left to the runs that
    have some.
    """
    from time import perf_counter

    from dvr_cli.api.warming import warm_up

    start = perf_counter()
    with Progress(quiet=False, verbose=False) as progress:
        folder = warm_up(lambda name: progress.show(f"compiling: {name}"))
    emit(f"compiled engine: ready after {perf_counter() - start:.1f} s, kept in {folder} and beside it")
    return 0
