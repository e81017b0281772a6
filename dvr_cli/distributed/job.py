"""A job of MPI: its ranks, which of them leads, and how one that fails ends it."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from dvr_cli.errors import UsageError

LEAD = 0  # the rank that reads, decides and writes
JOIN, CALL, END = "join", "call", "end"  # what a rank is asked to do beside the tasks of a member
_STARTED = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE")  # where MPIs say how many processes they have started
_PASSED_ON = (
    0.5  # seconds in which mpiexec passes on what a rank has said: from the end of a job on it may not
)
FAILED, _INTERRUPTED = 1, 130  # exit codes of a job that ends in the middle of a task


def world() -> Any:
    """The communicator of all ranks of the job.

    Raises UsageError without mpi4py or an MPI that it finds, and where mpiexec is that of another MPI.
    """
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:
        cause = "is not installed" if isinstance(error, ImportError) else "finds no MPI library"
        raise UsageError(
            f"mpi: mpi4py {cause} (pip install 'dvr-cli[mpi]', or 'dvr-cli[mpi-local]' for an MPI as well)"
        ) from None
    started = max(int(os.environ.get(name, 1)) for name in _STARTED)
    if started > MPI.COMM_WORLD.size:
        raise UsageError(
            f"mpi: mpiexec started {started} processes of another MPI than mpi4py's, which sees one"
        )
    return MPI.COMM_WORLD


@contextmanager
def ending_the_job(comm: Any) -> Iterator[None]:
    """Within this context a failure ends the whole job, as others wait for what this rank would send."""
    try:
        yield
    except KeyboardInterrupt:
        _end(comm, "dvr: interrupted", _INTERRUPTED)
    except BaseException as error:
        cause = f"{type(error).__name__}: {error}".replace("\n", " ")
        _end(comm, f"dvr: internal error on rank {comm.rank}: {cause} (please report it)", FAILED)


def _end(comm: Any, words: str, code: int) -> None:
    """End the job with this exit code, after a rank's last words."""
    print(words, file=sys.stderr, flush=True)
    time.sleep(_PASSED_ON)
    comm.Abort(code)
