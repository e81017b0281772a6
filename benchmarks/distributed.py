"""Several ranks: what they compute and exchange, what that costs, and a model of many.

Run as a section, or as a job of MPI: ``mpiexec -n N python benchmarks/distributed.py WHAT MESH``.
Idle ranks spin, so only CPU seconds of a rank's own work count, never seconds.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np

import meshes
from common import fastest, print_table
from dvr_cli.distributed.member import Member
from dvr_cli.distributed.parts import Partition, along_curve
from dvr_cli.distributed.rows import _FEWEST, _SAMPLES, sent
from dvr_cli.files.formats import format_named
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.relax.directions import random_field
from dvr_cli.relax.engines.choice import KINDS
from dvr_cli.relax.problem import Problem, build_problem

_SWEEPS = 8
_RANKS = (1, 2, 4, 8, 16, 32, 64)
_BYTES = 24  # of a vertex
# Assumed of a network: seconds until a message is there, with what mpi4py takes, and bytes a second.
_LATENCY, _BANDWIDTH = 10e-6, 5e9
_TETRAHEDRA = 10**9
_ROUND_SHARE = 3e-4 / 8  # patches of a round, as a part of the corners
# What a round takes, and of that what does not come to all ranks alike.
_OF_ROUND = ("all",), ("answering", "solving")
_RANDOM, _DEFAULT = ("-d", "random"), ("--patches",)  # runs, of two sweeps and rounds of each phase
_WITH_LEAD = (*_RANDOM, "--fail-above", "max-angle=180")  # what keeps a rank from having a share alone


def run(quick: bool) -> None:
    """Print the tables of cost on few ranks, of counts on up to 64, and of the model."""
    sizes = [2_000] if quick else [10_000, 100_000]
    rows, one = [], {}
    for n in sizes:
        for ranks in (1, 2):
            each = _job(ranks, "sweeps", n)
            rows.append([n, ranks, *_efficiency(n, each, one.setdefault(n, each))])
    header = ["vertices", "ranks", "µs of CPU an update", "efficiency of kernels, slowest rank"]
    header += ["exchange of 2 / sweep", "cutting, in sweeps"]
    print_table(f"Several ranks: {fastest()} engine, CPU time", header, rows)

    header = ["vertices", "ranks", "tetrahedra of a rank's own", "bytes a tetrahedron", "of the lead"]
    memory = [[n, ranks, *_memory(ranks, n)] for n in sizes[-1:] for ranks in (2, 4)]
    print_table("Memory of a rank above that for a tiny mesh, not the lead's; and the lead's", header, memory)

    header = ["vertices", "run", "ranks", "tetrahedra of a rank's own", "peak MB of a rank"]
    header += ["bytes a tetrahedron"]
    runs = {"random": _RANDOM, "default": _DEFAULT}
    rows = [
        [n, name, ranks, *_in_shares(ranks, n, *more)]
        for n in sizes
        for ranks in (2, 4)
        for name, more in runs.items()
    ]
    print_table("No rank has the mesh: the worst rank; bytes above a tiny mesh's", header, rows)
    steps = {n: _setup(n) for n in sizes}
    header = [
        "vertices",
        "ms a sweep",
        *(name for name in steps[sizes[0]] if name != "sweep"),
        "all but loading",
    ]
    rows = []
    for n, parts in steps.items():
        sweep = parts.pop("sweep")
        rows.append([n, sweep * 1e3, *parts.values(), sum(parts.values()) - parts["loading"]])
    print_table("No rank has the mesh: set-up of the slower of 2 ranks, in sweeps of it", header, rows)

    mesh = meshes.raw_tets(2_000 if quick else 1_000_000)
    problem = _problem(mesh)
    counts = [counts_of(problem, ranks) for ranks in _RANKS]
    header = ["ranks", "tetrahedra a rank", "ghosts / owned", "neighbours", "messages a sweep", "kB a sweep"]
    header += ["imbalance of work"]
    title = f"Counts of {len(mesh.points)} vertices, {len(problem.batch_start) - 1} colours: the worst rank"
    print_table(title, header, [[c.ranks, c.tetrahedra, *c.shown] for c in counts])

    update = one[sizes[-1]][0]["kernels"] / one[sizes[-1]][0]["updates"]
    print_table(
        f"Model: {_TETRAHEDRA:.0e} tetrahedra, {update * 1e6:.2f} µs an update, {_LATENCY * 1e6:.0f} µs a "
        f"message, {_BANDWIDTH / 1e9:.0f} GB/s",
        ["ranks", "tetrahedra a rank", "ghosts / owned", "efficiency of sweeps"],
        [model(ranks, counts[-1], update) for ranks in (64, 1_000, 10_000)],
    )

    alone, several = (_rounds(ranks, sizes[-1]) for ranks in (1, 8))
    header = ["ranks", "rounds", "patches of the busiest / mean", "collective calls a round"]
    header += ["exchanges a round", "messages a patch", "bytes a patch", "ms of CPU a patch, solved alone"]
    rows = [[ranks, *_of_rounds(each)] for ranks, each in ((1, alone), (8, several))]
    print_table(f"Rounds of patches of {sizes[-1]} vertices, counted", header, rows)
    header = ["ranks", "patches a rank and round", "busiest / mean", "its seconds", "seconds of calls"]
    header += ["efficiency of a round"]
    print_table(
        f"Model: a round of patches of {_TETRAHEDRA:.0e} tetrahedra",
        header,
        [patches_model(ranks, alone, several) for ranks in (64, 1_000, 10_000)],
    )


# ---------------------------------------------------------------------------------- counts and model


@dataclass(frozen=True)
class Counts:
    """The counts of one partition: those of the rank with most, but for ``owned`` and ``tetrahedra``.

    owned: relaxed vertices, tetrahedra: of a rank on average. ghosts: relaxed vertices of others. messages,
    vertices: that a rank sends in a sweep. work: corners in the rings of a rank, over the mean.
    """

    ranks: int
    batches: int
    owned: float
    tetrahedra: int
    ghosts: int
    neighbours: int
    messages: int
    vertices: int
    work: float

    @property
    def shown(self) -> list[object]:
        """The columns of the table."""
        kilobytes = self.vertices * _BYTES / 1e3
        return [self.ghosts / self.owned, self.neighbours, self.messages, kilobytes, self.work]


def counts_of(problem: Problem, ranks: int) -> Counts:
    """The counts of the partition along the curve, without making its parts."""
    vertices, corners = problem.rings.vertices, problem.touched.vertices
    owners = along_curve(problem, ranks)
    owner = np.full(len(problem.order), -1)
    owner[vertices] = owners
    batch = np.zeros(len(owner), dtype=np.int64)
    batch[vertices] = np.repeat(np.arange(len(problem.batch_start) - 1), np.diff(problem.batch_start))
    pairs = [np.empty((0, 2), dtype=np.int64)]  # a rank and a vertex that is a ghost there
    near = corners[(owner[corners] != owner[corners[:, :1]]).any(axis=1)]
    for one in near.T:
        for other in near.T:
            ghost = (owner[one] >= 0) & (owner[other] >= 0) & (owner[one] != owner[other])
            pairs.append(np.unique(np.stack([owner[one], other], axis=1)[ghost], axis=0))
    there, ghosts = np.unique(np.concatenate(pairs), axis=0).T
    sender = owner[ghosts]
    messages = np.unique(np.stack([sender, there, batch[ghosts]], axis=1), axis=0)
    neighbours = np.unique(messages[:, :2], axis=0)
    work = np.bincount(owners, problem.rings.sizes, ranks)

    def most(ranks_of: np.ndarray) -> int:
        return int(np.bincount(ranks_of, minlength=ranks).max(initial=0))

    return Counts(
        ranks=ranks,
        batches=len(problem.batch_start) - 1,
        owned=len(owners) / ranks,
        tetrahedra=len(corners) // ranks,
        ghosts=most(there),
        neighbours=most(neighbours[:, 0]),
        messages=most(messages[:, 0]),
        vertices=most(sender),
        work=float(work.max() / work.mean()),
    )


def model(ranks: int, counted: Counts, update: float) -> list[object]:
    """Ranks, tetrahedra a rank, ghosts over owned and efficiency of sweeps, from counts of a smaller mesh.

    Ghosts and bytes grow with the surface of a rank's part, the power 2/3 of its size; messages do not grow.
    update: seconds. One reduction a sweep goes through log2(ranks) messages. What the lead does is left out.
    """
    owned = _TETRAHEDRA / ranks * counted.owned / counted.tetrahedra
    surface = (owned / counted.owned) ** (2 / 3)
    kernels = owned * update
    sent = counted.messages * _LATENCY + counted.vertices * surface * _BYTES / _BANDWIDTH
    reductions = np.ceil(np.log2(ranks)) * _LATENCY
    efficiency = kernels / (kernels * counted.work + sent + reductions)
    return [ranks, round(_TETRAHEDRA / ranks), counted.ghosts * surface / owned, float(efficiency)]


def patches_model(ranks: int, alone: list[dict[str, float]], several: list[dict[str, float]]) -> list[object]:
    """Ranks, patches a rank, and what a round takes, from rounds on one rank and on several.

    Ranks look at equally many seeds, but which patches are taken of those, and what lies where others ask
    for it, comes at random: of that the busiest has what is to be expected of the largest of so many Poisson
    variables. A call goes through two messages in log2(ranks) steps, and makes arrays with a row for each
    rank, which is measured. Messages of a patch are as many as counted, however many ranks there are.
    """
    mean = _ROUND_SHARE * _TETRAHEDRA / ranks
    busiest = _largest_poisson(mean, ranks)
    own, uneven = ((sum(alone[0][name] for name in names)) / alone[0]["patches"] for names in _OF_ROUND)
    even = (own - uneven) * float(np.ceil(2.0 * mean)) / 2.0
    number = (several[0]["to all"] + several[0]["small"]) / several[0]["rounds"]
    exchanges = several[0]["to all"] / several[0]["rounds"]
    rows = _fastest(lambda: sent(_Nobody(ranks), np.empty(0, np.int64), np.empty(0)), 100)
    calls = number * 2 * np.ceil(np.log2(ranks)) * _LATENCY + exchanges * rows
    named = max(_SAMPLES // ranks, _FEWEST) * ranks
    calls += _fastest(lambda: np.sort(np.random.default_rng(0).random(named)), 3) + 8 * named / _BANDWIDTH
    count = sum(rank.get("patches", 0) for rank in several)
    messages, size = (sum(rank[name] for rank in several) / count for name in ("messages", "bytes"))
    calls += busiest * (messages * _LATENCY + size / _BANDWIDTH)
    seconds = even + busiest * uneven
    return [ranks, mean, busiest / mean, seconds, float(calls), float(mean * own / (seconds + calls))]


class _Nobody:
    """A communicator of many ranks, none of which has anything to send."""

    def __init__(self, size: int) -> None:
        self.rank, self.size = 0, size

    def Alltoall(self, sends: np.ndarray, comes: np.ndarray) -> None:
        """Nothing comes."""
        comes[:] = 0


def _largest_poisson(mean: float, n: int) -> int:
    """The least k that n Poisson variables all stay within as often as not."""
    k, term, below = 0, np.exp(-mean), 0.0
    if mean > 500.0:  # there exp(-mean) is no number; a normal variable is close enough
        return round(mean + np.sqrt(2.0 * np.log(n) * mean))
    while (below := below + term) < 0.5 ** (1.0 / n):
        k += 1
        term *= mean / k
    return k


def _fastest(work: Callable[[], object], times: int = 1000) -> float:
    """CPU seconds of the quickest of some calls."""
    seconds = []
    for _ in range(times):
        begin = time.process_time_ns()
        work()
        seconds.append(time.process_time_ns() - begin)
    return min(seconds) / 1e9


# ---------------------------------------------------------------------------------- jobs


def _rounds(ranks: int, n: int) -> list[dict[str, float]]:
    """What each rank says of its rounds of patches."""
    return _said(ranks, [Path(__file__).with_name("distributed_patches.py"), fastest(), _as_vtk(n)])


def _of_rounds(each: list[dict[str, float]]) -> list[object]:
    """Rounds, busiest over mean, calls and exchanges a round, messages and bytes a patch, ms solved."""
    patches = [rank.get("patches", 0.0) for rank in each]
    rounds, total = each[0]["rounds"], sum(patches)
    return [
        round(rounds),
        max(patches) * len(patches) / total,
        round(each[0]["small"] / rounds),
        round(each[0]["to all"] / rounds),
        *(sum(rank.get(name, 0.0) for rank in each) / total for name in ("messages", "bytes")),
        sum(rank.get("solving", 0.0) for rank in each) / total * 1e3,
    ]


def _job(ranks: int, what: str, n: int) -> list[dict[str, float]]:
    """What each rank of a job says."""
    return _said(ranks, [__file__, what, meshes.path_of(meshes.random_tets, n)])


def _command(ranks: int, n: int, *more: str) -> list[dict[str, float]]:
    """What each rank of the command on a file says; more: options."""
    script = Path(__file__).with_name("distributed_rank.py")
    return _said(ranks, [script, fastest(), _as_vtk(n), *more])


def _setup(n: int) -> dict[str, float]:
    """The seconds of a sweep and what steps of the set-up take in sweeps, of the rank that takes most."""
    script = Path(__file__).with_name("distributed_setup.py")
    for _ in range(2):  # the first may compile
        each = _said(2, [script, fastest(), _as_vtk(n)])
    return max(each, key=lambda rank: sum(rank.values()) - rank["loading"] - rank["sweep"])


def _said(ranks: int, script: list[object]) -> list[dict[str, float]]:
    beside = Path(sys.executable).with_name("mpiexec")
    command = [beside if beside.exists() else "mpiexec", "-n", ranks, sys.executable, *script]
    words = [str(word) for word in command]
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True)
    said: list[dict[str, float]] = json.loads(done.stdout.splitlines()[-1])
    return said


def _efficiency(n: int, each: list[dict[str, float]], one: list[dict[str, float]]) -> list[object]:
    """µs an update, efficiency of kernels, share of exchange, and cutting in sweeps; one: of one rank."""
    slowest = max(rank["kernels"] for rank in each)
    updates = sum(rank["updates"] for rank in each)
    return [
        sum(rank["kernels"] for rank in each) / updates * 1e6,
        one[0]["kernels"] / len(each) / slowest,
        _job(1, "exchange", n)[0]["a rank"] / slowest,
        max(rank["cutting"] for rank in each) / one[0]["kernels"],
    ]


def _memory(ranks: int, n: int) -> list[object]:
    """Tetrahedra a rank, bytes a tetrahedron of the largest rank that follows, and of the lead."""
    here, tiny = (_command(ranks, size, *_WITH_LEAD) for size in (n, 300))
    own = _tetrahedra(n) / ranks
    more = [a["peak"] - b["peak"] for a, b in zip(here, tiny, strict=True)]
    return [round(own), max(more[1:]) / own, more[0] / own]


def _in_shares(ranks: int, n: int, *more: str) -> list[object]:
    """Tetrahedra a rank, peak memory of the worst rank in MB, and bytes a tetrahedron above a tiny mesh's."""
    here, tiny = (_command(ranks, size, *more) for size in (n, 300))
    own = _tetrahedra(n) / ranks
    above = [a["peak"] - b["peak"] for a, b in zip(here, tiny, strict=True)]
    return [round(own), max(rank["peak"] for rank in here) / 1e6, max(above) / own]


def _tetrahedra(n: int) -> int:
    ranges = format_named("vtk").ranges_of(_as_vtk(n))
    assert ranges is not None
    return ranges.count


def _as_vtk(n: int) -> Path:
    """The path of the binary VTK file of a mesh of n points, which this makes."""
    path = meshes.path_of(meshes.random_tets, n)
    vtk = path.with_suffix(".vtk")
    if not vtk.exists():
        mesh = meshes.load_mesh(path)
        meshio.Mesh(mesh.points, [("tetra", mesh.cells[0].vertices)]).write(vtk)
    return vtk


def _problem(mesh: Mesh) -> Problem:
    backend = KINDS[fastest()].backend
    domain = domain_of(mesh, backend=backend)
    return build_problem(domain.corners, np.flatnonzero(domain.interior), domain.points, backend=backend)


def _sweeps(comm, path: Path) -> dict[str, float]:
    """CPU seconds of cutting, and of kernels in the quickest of some sweeps."""
    mesh = meshes.load_mesh(path)
    problem = _problem(mesh)
    cutting = time.process_time()
    partition = Partition(problem, comm.size)
    parts = [partition.part(rank) for rank in range(comm.size)]
    cutting, part = time.process_time() - cutting, parts[comm.rank]
    engine = KINDS[fastest()].make(part.problem, 1)
    member = Member(comm, part, engine)
    field, vertices = random_field(problem.dimension, seed=0), part.problem.relaxed
    kernels = np.zeros(_SWEEPS)
    engine.restore((mesh.points[part.problem.order], None))
    engine.relax_batch(0, np.zeros((len(vertices), problem.dimension)))  # all is compiled
    for sweep in range(_SWEEPS):
        directions = field(sweep, engine.relaxed_points, vertices)
        for batch in range(engine.batches):
            begin = time.process_time()
            engine.relax_batch(batch, directions)
            kernels[sweep] += time.process_time() - begin
            member.exchange(batch)
    return {
        "kernels": kernels.min(),
        "cutting": cutting,
        "updates": float(len(vertices)),
    }


def _exchange(comm, path: Path) -> dict[str, float]:
    """CPU seconds of the exchange of a sweep between two ranks, for each: one process is both.

    So nobody waits, and no waiting counts.
    """
    mesh = meshes.load_mesh(path)
    problem = _problem(mesh)
    partition = Partition(problem, 2)
    parts = [partition.part(rank) for rank in range(2)]
    points = [np.ascontiguousarray(mesh.points[part.problem.order]) for part in parts]
    seconds = []
    for _ in range(_SWEEPS):
        begin = time.process_time()
        for batch in range(len(problem.batch_start) - 1):
            requests, arriving = [], []
            for part, own in zip(parts, points, strict=True):
                (received,) = part.received
                arriving.append(np.empty((len(received.of(batch)), own.shape[1])))
                requests.append(comm.Irecv(arriving[-1], source=0, tag=received.rank))
            for rank, (part, own) in enumerate(zip(parts, points, strict=True)):
                requests.append(comm.Isend(own[part.sent[0].of(batch)], dest=0, tag=rank))
            for request in requests:
                request.Wait()
            for part, own, rows in zip(parts, points, arriving, strict=True):
                own[part.received[0].of(batch)] = rows
        seconds.append((time.process_time() - begin) / 2)
    return {"a rank": min(seconds)}


def _as_rank(what: str, path: Path) -> None:
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    work: dict[str, Callable[..., dict[str, float]]] = {
        "sweeps": _sweeps,
        "exchange": _exchange,
    }
    said = comm.gather(work[what](comm, path))
    if said is not None:
        print(json.dumps(said), flush=True)


if __name__ == "__main__":
    _as_rank(sys.argv[1], Path(sys.argv[2]))
