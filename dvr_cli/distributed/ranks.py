"""The ranks of a job: one leads and runs the command, the others follow until it tells them the end."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import Any

from dvr_cli.distributed.job import END, FAILED, JOIN, LEAD, ending_the_job


def run_on_ranks(comm: Any, command: Callable[[], int]) -> int:
    """Run a command on the leading rank, and follow it on all others; returns its exit code on each."""
    if comm.rank != LEAD:
        return follow(comm)
    code = FAILED
    try:
        code = command()
    finally:
        comm.bcast((END, (code,)), LEAD)
    return code


def follow(comm: Any) -> int:
    """Do what the leading rank asks for; returns the exit code of the job.

    Signals are for the leading rank to heed.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    member = None
    while True:
        task, arguments = comm.bcast(None, LEAD)
        if task == END:
            return int(arguments[0])
        with ending_the_job(comm):
            if task == JOIN:
                from dvr_cli.distributed.member import joined  # loads NumPy

                member = joined(comm, *arguments)
            else:
                assert member is not None
                member.do(task, *arguments)
