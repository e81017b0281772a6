"""The ranks of a job: one leads and runs the command, the others follow until it tells them the end."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import Any, TypeVar

from dvr_cli.distributed.job import CALL, END, FAILED, JOIN, LEAD, ending_the_job

Result = TypeVar("Result")


def on_lead(comm: Any, work: Callable[[], Result]) -> Result | None:
    """The result of work that the leading rank does and others follow; None on these.

    What it raises is raised on all ranks.
    """
    result, error = None, None
    if comm.rank == LEAD:
        result, error = _tried(work)
        comm.bcast((END, (FAILED,)), LEAD)
    else:
        follow(comm)
    error = comm.bcast(error, LEAD)
    if error is not None:
        raise error
    return result


def on_all(comm: Any, work: Callable[[], Result]) -> Result:
    """The result of work that each rank does; what the first rank that fails raises is raised on all."""
    result, error = _tried(work)
    first = next(filter(None, comm.allgather(error)), None)
    if first is not None:
        raise first
    assert result is not None
    return result


def _tried(work: Callable[[], Result]) -> tuple[Result | None, BaseException | None]:
    try:
        return work(), None
    except BaseException as error:  # others would wait for ever for a rank that ends alone
        return None, error


def together(comm: Any, function: Callable[..., Result], arguments: tuple[Any, ...], *own: Any) -> Result:
    """The result on the leading rank of a function that all ranks call at the same time.

    function: of a module, first gets the communicator. arguments: the same for all ranks, and own: more for
    this one. A failure ends the job.
    """
    comm.bcast((CALL, (function, *arguments)), LEAD)
    with ending_the_job(comm):
        return function(comm, *arguments, *own)
    raise AssertionError("a failure has ended the job")


def run_on_ranks(comm: Any, command: Callable[[], int]) -> int:
    """Run a command on the leading rank, and follow it on all others; returns its exit code on each."""
    if comm.rank != LEAD:
        for number in (signal.SIGINT, signal.SIGTERM):  # for the leading rank to heed
            signal.signal(number, signal.SIG_IGN)
        return follow(comm)
    code = FAILED
    try:
        code = command()
    finally:
        comm.bcast((END, (code,)), LEAD)
    return code


def follow(comm: Any) -> int:
    """Do what the leading rank asks for; returns the exit code of the job."""
    member = None
    while True:
        task, arguments = comm.bcast(None, LEAD)
        if task == END:
            return int(arguments[0])
        with ending_the_job(comm):
            if task == JOIN:
                from dvr_cli.distributed.member import joined  # loads NumPy

                member = joined(comm, *arguments)
            elif task == CALL:
                function, *rest = arguments
                function(comm, *rest)
            else:
                assert member is not None
                member.do(task, *arguments)


def agree(comm: Any, good: bool) -> bool:
    """True if it is good on all ranks."""
    return all(comm.allgather(good))
