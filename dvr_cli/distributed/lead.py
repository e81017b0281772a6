"""The engine of the leading rank: to the phases of a run an engine like any other, it has all ranks compute.

It holds the whole problem and, when somebody asks, all coordinates and qualities. Between, they are with the
members.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dvr_cli.distributed.job import JOIN, LEAD, ending_the_job
from dvr_cli.distributed.member import member_of
from dvr_cli.distributed.parts import Partition
from dvr_cli.distributed.patches import alone, shares
from dvr_cli.errors import UsageError
from dvr_cli.relax.directions import DirectionField, OwnField, Turns
from dvr_cli.relax.engines.choice import EngineKind
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.problem import Problem
from dvr_cli.relax.steepest import Ascent

if TYPE_CHECKING:
    from dvr_cli.relax.patches.solver import Patch


class LeadEngine(Engine):
    """Cuts a problem into parts, gives each rank its own, and has them do what it is asked to do."""

    has_coordinates = False

    def __init__(self, comm: Any, kind: EngineKind, problem: Problem, threads: int | None) -> None:
        """comm: the communicator (mpi4py's), on whose other ranks ``ranks.follow`` runs.

        kind: of the engine on each rank. threads: of each rank, None for one.

        Raises UsageError where vertices walk.
        """
        if problem.carriers is not None:
            raise UsageError(
                "mpi: curved boundaries and surfaces, whose vertices walk, are relaxed by one rank only"
            )
        super().__init__(problem)
        self._comm, self.backend = comm, kind.backend
        threads = 1 if threads is None else threads
        partition = Partition(problem, comm.size)
        self._places = [partition.place(rank) for rank in range(comm.size)]
        comm.bcast((JOIN, (kind.name, threads)), LEAD)
        with ending_the_job(comm):
            for rank in range(1, comm.size):
                comm.send(partition.part(rank), dest=rank)
            self._member = member_of(comm, partition.part(LEAD), kind, threads)
        self.threads = self._member.engine.threads
        self._points = np.empty((0, problem.components))
        self._here = self._there = False  # whether coordinates here, and those of members, are current
        self._sent: dict[str, np.ndarray] = {}

    # ------------------------------------------------------------------------------ coordinates

    @property
    def coordinates(self) -> np.ndarray:
        """(N, d) as in Engine; what is written there counts from the next task of the members on."""
        points = self._get()
        self._there = False
        return points

    def _set(self, points: np.ndarray) -> None:
        self._points = np.ascontiguousarray(points)
        self._here, self._there = True, False

    def _get(self) -> np.ndarray:
        if not self._here:
            owned = [self.problem.rings.vertices[place.rings] for place in self._places]
            self._into(self._points, owned, "give coordinates")
            self._here = True
        return self._points

    # ------------------------------------------------------------------------------ what is asked for

    def q1(self) -> float:
        return self._worst()[2] if len(self.problem.touched.vertices) else np.inf

    def qualities(self) -> np.ndarray:
        values = np.empty(len(self.problem.touched.vertices))
        return self._into(values, [place.firsts for place in self._places], "give qualities")

    def focused(self, active: np.ndarray) -> tuple[Engine, np.ndarray | None]:
        return self, active

    def ring_qualities(self, qualities: np.ndarray | None = None) -> np.ndarray:
        values = np.empty(len(self.problem.rings.vertices))
        return self._into(values, [place.rings for place in self._places], "give ring qualities")

    def directions(
        self, field: DirectionField, sweep: int, active: np.ndarray | None = None
    ) -> np.ndarray | Ascent:
        """As in Engine; the ranks find them if they can, and what is returned stands for them."""
        of_sweep = field.of(sweep) if isinstance(field, Turns) else field
        if not isinstance(of_sweep, OwnField):
            return super().directions(field, sweep, active)
        self._send("active", self._all if active is None else active)
        self._found_there("find directions", of_sweep, sweep)
        return self._directions

    def move_batch(
        self,
        batch: int,
        directions: np.ndarray | Ascent,
        active: np.ndarray | None = None,
        enough: float = 0.0,
    ) -> int:
        self._send("active", self._all if active is None else active)
        ascent = directions if isinstance(directions, Ascent) else None
        if not isinstance(directions, Ascent):
            self._send("directions", directions)
        return self._moving("move", batch, ascent, enough)

    def solve_patches(
        self, points: np.ndarray, patches: Sequence[Patch], time_is_up: Callable[[], bool]
    ) -> list[tuple[float, float]]:
        """As in Engine; the ranks solve them side by side, and whether time is up is asked once before."""
        badness = [(1.0, 1.0)] * len(patches)
        if time_is_up():
            return badness
        mine = shares(patches, self._comm.size)
        each = [[alone(points, patches[number]) for number in numbers] for numbers in mine]
        for numbers, solved in zip(mine, self._ask("solve patches", each=each), strict=True):
            for number, (moved, of_patch) in zip(numbers, solved, strict=True):
                points[patches[number].moving] = moved
                badness[number] = of_patch
        return badness

    def keep_altitude(self, bound: float) -> None:
        super().keep_altitude(bound)
        self._ask("keep altitude", bound)

    # ------------------------------------------------------------------------------ of Engine

    def _moved(self, lo: int, hi: int, move: Callable[[int, int], int], limit: float, by_ring: bool) -> int:
        return move(lo, hi)  # the members keep to the altitude

    def _relax(self, batch: int, lo: int, hi: int, directions: np.ndarray, enough: float) -> int:
        self._send("directions", directions)
        return self._moving("relax", batch, enough)

    def _polish(self, batch: int, lo: int, hi: int, limit: float, aim: Aim, active: np.ndarray) -> int:
        self._send("active", active)
        return self._moving("polish", batch, limit, aim)

    def _steepest(self, batch: int, lo: int, hi: int, band: float, active: np.ndarray) -> None:
        self._send("active", active)
        self._found_there("find steepest", batch, band)

    def _worst_corner(self) -> tuple[int, float]:
        badness, corner, _ = self._worst()
        return corner, badness

    # ------------------------------------------------------------------------------ messages

    def _worst(self) -> tuple[float, int, float]:
        """Badness, number and quality of the worst corner, the first of equals; see ``Engine.worst``."""
        found = sorted(self._current("give worst"), key=lambda one: one[1])
        worst = max(found, key=lambda one: one[0])
        if worst[0] < np.inf:
            return worst
        return min((one for one in found if one[0] == np.inf), key=lambda one: one[2])

    def _found_there(self, task: str, *arguments: Any) -> None:
        """Have the members find directions, which stay there: this engine's own stand for them."""
        self._current(task, *arguments)
        self._sent["directions"] = self._directions

    def _send(self, name: str, rows: np.ndarray) -> None:
        """Give each member its rows of an array with one a ring, unless it has them from the last time."""
        if self._sent.get(name) is not rows:
            self._ask(f"take {name}", each=[rows[place.rings] for place in self._places])
            self._sent[name] = rows

    def _into(self, whole: np.ndarray, rows: list[np.ndarray], task: str) -> np.ndarray:
        """``whole`` with those rows filled that each member gives."""
        for numbers, values in zip(rows, self._current(task), strict=True):
            whole[numbers] = values
        return whole

    def _moving(self, task: str, *arguments: Any) -> int:
        """Have the members move vertices; returns how many."""
        moved = self._current(task, *arguments)
        self._here = False
        return moved

    def _current(self, task: str, *arguments: Any) -> Any:
        """Have the members do a task on current coordinates."""
        if not self._there:
            self._ask("take coordinates", each=[self._points[place.vertices] for place in self._places])
            self._there = True
        return self._ask(task, *arguments)

    def _ask(self, task: str, *arguments: Any, each: list[Any] | None = None) -> Any:
        """Have all members do a task, this one too; each: what each is sent."""
        self._comm.bcast((task, arguments), LEAD)
        own = arguments if each is None else (*arguments, each)
        with ending_the_job(self._comm):
            return self._member.do(task, *own)
