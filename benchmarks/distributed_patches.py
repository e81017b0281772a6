"""A rank that counts what a round of patches takes where no rank has the mesh.

mpiexec -n N python benchmarks/distributed_patches.py ENGINE FILE
"""

from __future__ import annotations

import json
import pickle
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

from dvr_cli.cli.main import main
from dvr_cli.distributed import share_rounds
from dvr_cli.distributed.share_rounds import ShareRounds
from dvr_cli.distributed.vicinities import Vicinities

_ROUNDS = 4
found: Counter[str] = Counter()


class Counting(MPI.Intracomm):
    """A communicator that counts what goes through it."""

    def isend(self, part: Any, rank: int) -> Any:
        """Send a rank something."""
        found["messages"] += 1
        found["bytes"] += len(pickle.dumps(part))
        return super().isend(part, rank)


def called(name: str, of: str) -> None:
    """Have calls of a communicator counted under a name."""
    function = getattr(MPI.Intracomm, of)

    def counted(*arguments: Any) -> Any:
        found[name] += 1
        return function(*arguments)

    setattr(Counting, of, counted)


for each in "Allgather", "allgather", "allreduce", "exscan":
    called("small", each)
called("to all", "Alltoall")


def timed(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """``function``, of which the CPU seconds are added up under a name."""

    def call(*arguments: Any) -> Any:
        begin = time.process_time()
        result = function(*arguments)
        found[name] += time.process_time() - begin
        return result

    return call


def counting(make: Callable[..., None]) -> Callable[..., None]:
    """The initialiser of rounds, which then count."""

    def init(rounds: Any, comm: Any, engine: Any, share: Any, member: Any) -> None:
        make(rounds, comm, engine, share, member)
        rounds._comm = rounds._vicinities._comm = Counting(comm)

    return init


def solved(solve: Callable[..., Any]) -> Callable[..., Any]:
    """``Engine.solve_patches``, whose patches and CPU seconds are counted."""

    def call(engine: Any, points: Any, patches: Any, *more: Any) -> Any:
        found["patches"] += len(patches)
        return timed(solve, "solving")(engine, points, patches, *more)

    return call


def counted_round(solve: Callable[..., Any]) -> Callable[..., Any]:
    """``ShareRounds.solve``, whose rounds are counted."""

    def call(*arguments: Any) -> Any:
        found["rounds"] += 1
        return timed(solve, "all")(*arguments)

    return call


ENGINE, PATH = sys.argv[1:]
with tempfile.TemporaryDirectory() as folder:
    words = ["smooth", PATH, str(Path(folder) / "out.vtk"), "--quiet", "--no-report", "--engine", ENGINE]
    words += ["--mpi", "--patches", "--no-polish", "-n", str(_ROUNDS)]
    assert main(words) == 0  # all is compiled
    ShareRounds.__init__ = counting(ShareRounds.__init__)  # type: ignore[method-assign]
    ShareRounds.solve = counted_round(ShareRounds.solve)  # type: ignore[method-assign]
    Vicinities._with = timed(Vicinities._with, "answering")  # type: ignore[method-assign]
    kind = share_rounds.Engine
    kind.solve_patches = solved(kind.solve_patches)  # type: ignore[method-assign]
    assert main(words) == 0
    MPI.COMM_WORLD.Barrier()
said = MPI.COMM_WORLD.gather(dict(found))
if said is not None:
    print(json.dumps(said), flush=True)
