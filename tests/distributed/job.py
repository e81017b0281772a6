"""A job of several ranks for ``test_ranks``: commands of ``dvr`` one after the other, and what goes wrong.

mpiexec -n 3 python job.py commands.json codes.json [fault]
"""

import itertools
import json
import os
import resource
import signal
import sys
import time
from pathlib import Path

from mpi4py import MPI

from dvr_cli.cli.main import main
from dvr_cli.cli.progress import Progress
from dvr_cli.distributed import layers, tangle
from dvr_cli.distributed.member import Member
from dvr_cli.distributed.share_engine import ShareEngine
from dvr_cli.files import reading

RANK = MPI.COMM_WORLD.rank


def failing(moves):
    """``moves`` of a rank, but that the last one has no memory left."""

    def moved(rank, *arguments):
        if MPI.COMM_WORLD.size - 1 == RANK:
            raise MemoryError("nothing left")
        return moves(rank, *arguments)

    return moved


def interrupted(progress, sweep):
    os.kill(os.getpid(), signal.SIGINT)


def interrupted_by_others(moves):
    """``moves`` of a rank, during which all but the first get the signal."""

    def moved(rank, *arguments):
        if RANK > 0:
            os.kill(os.getpid(), signal.SIGINT)
        return moves(rank, *arguments)

    return moved


def exchanging(member, batch):
    if MPI.COMM_WORLD.size - 1 == RANK:
        raise MemoryError("nothing left")
    return exchanges(member, batch)


def not_read(*arguments):
    raise AssertionError("a rank reads the whole mesh")


def fast():
    """A clock that is an hour ahead, and one more each time that it is asked."""
    return clock() + 3600.0 * next(hours)


def small(untangled):
    """``untangled`` of a part, which has to be far from the whole."""

    def of_part(part, store, interrupted):
        assert len(part.number) < 0.6 * store.size
        return untangled(part, store, interrupted)

    return of_part


MOVING = ((Member, "_moved"), (ShareEngine, "_followed"))  # with a lead and without one
exchanges = Member.exchange
clock, hours = time.perf_counter, itertools.count(1)
commands, codes, *fault = sys.argv[1:]
if "in shares" in fault:
    fault.remove("in shares")
    reading.open_mesh = not_read
    tangle._REACH = 1  # so that it does not suffice
    layers._FEW = 0  # so that seeds are looked for around vertices first
if "in part" in fault:
    fault.remove("in part")
    tangle._untangled = small(tangle._untangled)
    if RANK > 0:
        time.perf_counter = fast
if fault == ["a rank fails to send"]:
    Member.exchange = exchanging
if fault == ["a rank fails"]:
    for kind, name in MOVING:
        setattr(kind, name, failing(getattr(kind, name)))
if fault == ["interrupted"]:
    Progress.sweep = interrupted
    for kind, name in MOVING:
        setattr(kind, name, interrupted_by_others(getattr(kind, name)))
LIMIT = resource.getrlimit(resource.RLIMIT_FSIZE)
if fault == ["a full disk"] and RANK == 0:
    sys.dont_write_bytecode = True  # Python would keep modules cut off for all later runs
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, LIMIT[1]))
ends = [main(command) for command in json.loads(Path(commands).read_text())]
if RANK == 0:
    resource.setrlimit(resource.RLIMIT_FSIZE, LIMIT)
    Path(codes).write_text(json.dumps(ends))
assert MPI.COMM_WORLD.allgather(ends) == [ends] * MPI.COMM_WORLD.size
