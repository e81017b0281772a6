"""A rank that says what CPU time setting up takes where no rank has the mesh, in sweeps of its own.

mpiexec -n N python benchmarks/distributed_setup.py ENGINE FILE

Set-up is all that comes before the first sweep but for measuring the mesh. Before each call that waits for
others all ranks meet, and what that takes does not count. Steps are medians of runs in one process; what
more the first of these takes is the compiled engine that is loaded.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

ENGINE, PATH = sys.argv[1:]

from dvr_cli.api import share_setup, shares  # noqa: E402
from dvr_cli.api.phases import Run  # noqa: E402
from dvr_cli.cli.main import main  # noqa: E402
from dvr_cli.distributed import job, shared_parts  # noqa: E402
from dvr_cli.distributed.member import Member  # noqa: E402
from dvr_cli.distributed.shares import Store  # noqa: E402
from dvr_cli.mesh.rings import Incidence  # noqa: E402

_SWEEPS, _RUNS = 8, 5
_WAITING = (
    "Allgather",
    "Alltoall",
    "allgather",
    "allreduce",
    "bcast",
    "exscan",
    "gather",
    "reduce",
    "scatter",
)
_STEPS = (  # the name of each, and where it is; what one takes in another counts for itself alone
    ("the rest", shares, "take_turns"),
    ("reading", shares, "values_of_tags"),
    ("reading", shares, "read_share"),
    ("dealing out, global numbers", shares, "store_of"),
    ("looking for layers", share_setup, "_layers"),
    ("mesh of the rank", Store, "local"),
    ("mesh of the rank", share_setup, "_oriented"),
    ("ghosts, exchange lists", share_setup, "share_of"),
    ("rings", shared_parts, "incidence_of"),
    ("rings", Incidence, "rings"),
    ("colours", shared_parts, "colours"),
    ("the rest", shares, "prepared"),
    ("engine", shares, "ShareEngine"),
    ("sweeps", Run, "relax"),
    ("measuring", shares, "quality_of"),
)
found: Counter[str] = Counter()
under_way: list[str] = []
waited = 0.0


def clock() -> float:
    """CPU seconds of this process but for what it waited."""
    return time.process_time() - waited


def waiting(wait: Callable[..., Any], *arguments: Any) -> None:
    """Wait, which does not count."""
    global waited
    begin = time.process_time()
    wait(*arguments)
    waited += time.process_time() - begin


class Meeting(MPI.Intracomm):
    """A communicator whose ranks meet before each call that waits for all."""

    def recv(self, source: int) -> Any:
        """What a rank sends, from when it is there on."""
        waiting(self.Probe, source)
        return super().recv(source=source)


def counted(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """``function``, whose CPU seconds but for those of steps in it are added up under a name."""

    def call(*arguments: Any, **more: Any) -> Any:
        begin = clock()
        inside = sum(found.values())
        try:
            return function(*arguments, **more)
        finally:
            found[name] += clock() - begin - (sum(found.values()) - inside)

    return call


def met(function: Callable[..., Any]) -> Callable[..., Any]:
    """``function``, before which ranks meet."""

    def call(*arguments: Any, **more: Any) -> Any:
        waiting(MPI.COMM_WORLD.Barrier)
        return function(*arguments, **more)

    return call


for name in _WAITING:
    setattr(Meeting, name, met(getattr(MPI.Intracomm, name)))
for name, place, function in _STEPS:
    setattr(place, function, counted(name, getattr(place, function)))
Member.exchange = met(Member.exchange)  # type: ignore[method-assign]
world = job.world
job.world = lambda: Meeting(world())
each = []
with tempfile.TemporaryDirectory() as folder:
    words = ["smooth", PATH, str(Path(folder) / "out.vtk"), "--quiet", "--no-report", "--engine", ENGINE]
    words += ["--mpi", "-d", "random", "--tol", "0", "-n", str(_SWEEPS)]
    for _ in range(1 + _RUNS):
        found.clear()
        assert main(words) == 0
        each.append(dict(found))
    MPI.COMM_WORLD.Barrier()
first, *others = each
steps = [name for name in dict.fromkeys(name for name, *_ in _STEPS) if name not in ("measuring", "sweeps")]
sweep = float(np.median([run["sweeps"] for run in others])) / _SWEEPS
mine = {name: float(np.median([run[name] / run["sweeps"] for run in others])) * _SWEEPS for name in steps}
mine["loading"] = sum(first[name] for name in steps) / sweep - sum(mine.values())
said = MPI.COMM_WORLD.gather({"sweep": sweep, **mine})
if said is not None:
    print(json.dumps(said), flush=True)
