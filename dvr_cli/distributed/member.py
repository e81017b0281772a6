"""A member: what each rank does with its part, on an engine of its own, when the leading rank asks for it.

The leading rank is a member, too. All members do the same task at the same time, so none waits for a message
that nobody sends.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from dvr_cli.backend import COMPILED
from dvr_cli.distributed.job import LEAD
from dvr_cli.distributed.parts import Part
from dvr_cli.distributed.patches import Alone
from dvr_cli.relax.directions import OwnField
from dvr_cli.relax.engines.choice import KINDS, EngineKind
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.steepest import Ascent

# the coordinates (n, d) that the vertices of a patch end at, its largest badness before and after
Solved = tuple[np.ndarray, tuple[float, float]]
Each = list[np.ndarray] | None  # an array for each rank on the leading one, None on others


class Member:
    """One rank with its part of the problem; a task's result is for the leading rank alone."""

    def __init__(self, comm: Any, part: Part, engine: Engine) -> None:
        """comm: the communicator (mpi4py's) of all members; engine: one for the problem of ``part``."""
        self._comm, self._part, self.engine = comm, part, engine
        self._directions, self._active = np.empty((0, 0)), np.empty(0, dtype=bool)
        self._tasks: dict[str, Callable[..., Any]] = {
            "take coordinates": self._take_coordinates,
            "take directions": self._take_directions,
            "take active": self._take_active,
            "keep altitude": self.engine.keep_altitude,
            "relax": self._relax,
            "move": self._move,
            "find directions": self._find_directions,
            "find steepest": self._find_steepest,
            "polish": self._polish,
            "solve patches": self._solve_patches,
            "give coordinates": lambda: self._comm.gather(self.engine.relaxed_points, LEAD),
            "give qualities": lambda: self._comm.gather(self.engine.qualities()[self._part.first], LEAD),
            "give ring qualities": lambda: self._comm.gather(self.engine.ring_qualities(), LEAD),
            "give worst": lambda: self._comm.gather(self._worst(), LEAD),
        }

    def do(self, task: str, *arguments: Any) -> Any:
        """Do the task of this name, as all members have to; only arguments of type Each differ."""
        return self._tasks[task](*arguments)

    def _take_coordinates(self, each: Each = None) -> None:
        """Take over the coordinates (n, d) of all vertices of the part."""
        self.engine.restore((self._comm.scatter(each, LEAD), None))

    def _take_directions(self, each: Each = None) -> None:
        """Take over the directions (m, d), one row a ring."""
        self._directions = self._comm.scatter(each, LEAD)

    def _take_active(self, each: Each = None) -> None:
        """Take over which rings are active, (m,) bool."""
        self._active = self._comm.scatter(each, LEAD)

    def _relax(self, batch: int, enough: float) -> int | None:
        return self._moved(batch, self.engine.relax_batch(batch, self._directions, enough))

    def _move(self, batch: int, ascent: Ascent | None, enough: float) -> int | None:
        """Move a batch along the directions that are here, or those of an ascent."""
        directions = self._directions if ascent is None else ascent
        active = None if self._active.all() else self._active
        return self._moved(batch, self.engine.move_batch(batch, directions, active, enough))

    def _find_directions(self, field: OwnField, sweep: int) -> None:
        """Find the directions of a sweep, as they are on one rank."""
        self._directions = np.asarray(self.engine.directions(field, sweep, self._active))

    def _find_steepest(self, batch: int, band: float) -> None:
        self._directions = self.engine.steepest(batch, band, self._active)

    def _polish(self, batch: int, limit: float, aim: Aim) -> int | None:
        return self._moved(batch, self.engine.polish_batch(batch, limit, aim, self._active))

    def _solve_patches(self, each: list[list[Alone]] | None = None) -> list[list[Solved]] | None:
        """Solve the patches that the leading rank gives to each rank."""
        solved = []
        for points, patch in self._comm.scatter(each, LEAD):
            (badness,) = self.engine.solve_patches(points, [patch], lambda: False)
            solved.append((points[patch.moving], badness))
        return self._comm.gather(solved, LEAD)

    def _moved(self, batch: int, number: int) -> int | None:
        """Exchange the vertices of a batch; returns how many moved on all ranks, ``number`` on this one."""
        self.exchange(batch)
        return self._comm.reduce(number, root=LEAD)

    def exchange(self, batch: int) -> None:
        """Send the neighbours the vertices of a batch that they have as ghosts, and get theirs."""
        self._swap(
            [(shared.rank, shared.of(batch)) for shared in self._part.sent],
            [(shared.rank, shared.of(batch)) for shared in self._part.received],
        )

    def exchange_all(self) -> None:
        """Send the neighbours all vertices that they have as ghosts, and get theirs."""
        self._swap(
            [(shared.rank, shared.vertices) for shared in self._part.sent],
            [(shared.rank, shared.vertices) for shared in self._part.received],
        )

    def _swap(self, sent: list[tuple[int, np.ndarray]], received: list[tuple[int, np.ndarray]]) -> None:
        """Send ranks the coordinates of some vertices, and get those of others."""
        points = self.engine.coordinates
        received = [(rank, vertices) for rank, vertices in received if len(vertices)]
        arriving = [np.empty((len(vertices), points.shape[1])) for _, vertices in received]
        requests = [
            self._comm.Irecv(rows, source=rank) for (rank, _), rows in zip(received, arriving, strict=True)
        ]
        leaving = [(rank, np.ascontiguousarray(points[vertices])) for rank, vertices in sent if len(vertices)]
        requests += [self._comm.Isend(rows, dest=rank) for rank, rows in leaving]
        for request in requests:
            request.Wait()
        for (_, vertices), rows in zip(received, arriving, strict=True):
            points[vertices] = rows

    def _worst(self) -> tuple[float, int, float]:
        """Badness, number in the whole, and quality of the part's worst corner, see ``Engine.worst``."""
        if not len(self._part.corners):
            return -np.inf, -1, np.inf
        badness, corner, quality = self.engine.worst()
        return badness, int(self._part.corners[corner]), quality


def joined(comm: Any, engine: str, threads: int) -> Member:
    """The member that a rank becomes with the part that the leading rank sends; engine: its name."""
    return member_of(comm, comm.recv(source=LEAD), KINDS[engine], threads)


def member_of(comm: Any, part: Part, kind: EngineKind, threads: int) -> Member:
    """The member with a part; kind: of its engine."""
    take_turns(kind)
    return Member(comm, part, kind.make(part.problem, threads))


def take_turns(kind: EngineKind) -> None:
    """Have one of the ranks that share a place for compiled kernels compile them, while the others wait."""
    if kind.backend is COMPILED:
        from dvr_cli.jit.turns import compile_in_turn

        compile_in_turn()
