"""The entry point ``dvr``: runs a command, and turns every failure into one line and an exit code."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence

from dvr_cli import __version__
from dvr_cli.cli.codes import DONE, INTERNAL_ERROR, INTERRUPTED
from dvr_cli.cli.streams import discard, emit, error_line, say
from dvr_cli.errors import DvrError, OutputError

_GARBAGE = 1_000_000  # objects after which Python looks for garbage: modules make many, all of which stay


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``dvr`` with these arguments (default: those of the process) and return the exit code.

    0 done; 1 quality gate failed, or a defect of dvr; 2 usage; 3 input missing, unreadable or unsupported;
    4 output could not be written; 130 interrupted.
    """
    arguments = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    if "--mpi" not in arguments:
        return _run(arguments)
    from dvr_cli.distributed.job import world
    from dvr_cli.distributed.ranks import run_on_ranks

    try:
        ranks = world()
    except DvrError as error:
        say(error_line(f"error: {error}"))
        return error.exit_code
    return run_on_ranks(ranks, lambda: _run(arguments))


def _run(arguments: list[str]) -> int:
    """The exit code of a command, after one line for whatever went wrong."""
    try:
        if arguments == ["--version"]:  # answered without loading the parser, which takes most of the time
            emit(f"dvr {__version__}")
            return DONE
        # nothing here is worth BLAS threads, and starting them is a third of the time to import numpy
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        gc.set_threshold(_GARBAGE)
        atexit.register(gc.freeze)  # else the process ends with a long look for garbage
        from dvr_cli.cli.app import run

        return run(arguments)
    except BrokenPipeError:  # whoever read our output has seen enough
        discard(sys.stdout)
        return OutputError.exit_code
    except (KeyboardInterrupt, Exception) as error:
        if "--debug" in arguments:
            import traceback

            say(traceback.format_exc().rstrip())
        code, message = _verdict(error)
        say(error_line(message))
        return code


def _verdict(error: BaseException) -> tuple[int, str]:
    """The exit code and the words for what ended a command."""
    if isinstance(error, DvrError):
        return error.exit_code, f"error: {error}"
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, "interrupted"
    cause = f"{type(error).__name__}: {error}"
    return INTERNAL_ERROR, f"internal error: {cause} (please report it; --debug shows the traceback)"
