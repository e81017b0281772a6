"""The engine of each rank where no rank has the whole problem: all of them run the same phases side by side.

What phases decide by is the same on all ranks, as it comes from all.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from dvr_cli.distributed.job import LEAD
from dvr_cli.distributed.member import Member, member_of
from dvr_cli.distributed.share_quality import is_at_least, of_rank
from dvr_cli.distributed.shared_parts import Share
from dvr_cli.mesh.sums import mean_of_total, total
from dvr_cli.quality.level import LEAST, WORST, place_of_level
from dvr_cli.quality.mean_ratio import EXPONENT
from dvr_cli.relax.directions import DirectionField
from dvr_cli.relax.engines.choice import EngineKind
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.steepest import Ascent

if TYPE_CHECKING:
    from dvr_cli.relax.patches.rounds import Rounds


class ShareEngine(Engine):
    """Moves the vertices of a rank's share; ghosts follow those of other ranks after each batch.

    Coordinates go in and come out in the order of the rank's mesh, qualities are those of corners and rings
    that the rank answers for. All ranks have to call everything that moves vertices or says something of the
    whole together.
    """

    has_coordinates = False  # of what ghosts did one would have to ask

    def __init__(self, comm: Any, kind: EngineKind, share: Share, threads: int | None) -> None:
        """kind: of the engine on each rank. threads: of each rank, None for one."""
        super().__init__(share.part.problem)
        self._comm, self._share, self.backend = comm, share, kind.backend
        self._member: Member = member_of(comm, share.part, kind, 1 if threads is None else threads)
        self.threads = self._member.engine.threads
        self._relaxes = any(comm.allgather(super().relaxes))

    def now(self) -> float:
        """The clock of the leading rank, so that all see the same limit reached."""
        seconds: float = self._comm.bcast(super().now(), LEAD)
        return seconds

    @property
    def relaxes(self) -> bool:
        """True if there is a vertex to relax on any rank."""
        return self._relaxes

    @property
    def _place(self) -> np.ndarray:
        return self._share.place

    def q1(self) -> float:
        """Q1 of the whole, infinite if nothing is relaxed."""
        mine = (-np.inf, (0, 0), np.inf)
        if len(self.problem.touched.vertices):
            badness, corner, quality = self._member.engine.worst()
            mine = badness, self._share.turn_of(corner), quality
        found = self._comm.allgather(mine)
        worst = max(one[0] for one in found)
        same = [one for one in found if one[0] == worst]
        if worst == np.inf:
            return min(one[2] for one in same)
        return min(same, key=lambda one: one[1])[2]

    def qualities(self) -> np.ndarray:
        return self._member.engine.qualities()[self._share.part.first]

    def ring_qualities(self, qualities: np.ndarray | None = None) -> np.ndarray:
        return self._member.engine.ring_qualities()

    def focused(self, active: np.ndarray) -> tuple[Engine, np.ndarray | None]:
        return self, active

    def mean(self, qualities: np.ndarray) -> float:
        count = self._comm.allreduce(len(qualities))
        return mean_of_total(self._comm.allreduce(total(qualities, EXPONENT)), count, EXPONENT)

    def level(self, qualities: np.ndarray, share: float = WORST, least: int = LEAST) -> float:
        place = place_of_level(self._comm.allreduce(len(qualities)), share, least)
        return of_rank(self._comm, qualities, np.array([place]))[0]

    def lowest(self, values: np.ndarray) -> float:
        return min(self._comm.allgather(float(values.min(initial=np.inf))))

    def share(self, which: np.ndarray) -> float:
        return float(self._comm.allreduce(int(which.sum())) / self._comm.allreduce(len(which)))

    def total(self, number: int) -> int:
        return int(self._comm.allreduce(int(number)))

    def first_of_lowest(self, values: np.ndarray) -> int:
        place = int(values.argmin()) if len(values) else -1
        mine = (np.inf, (0, 0), self._comm.rank)
        if place >= 0:
            corner = int(np.flatnonzero(self._share.part.first)[place])
            mine = float(values[place]), self._share.turn_of(corner), self._comm.rank
        candidates = [one for one in self._comm.allgather(mine) if one[0] < np.inf]
        return place if candidates and min(candidates) == mine else -1

    def any(self, which: np.ndarray) -> bool:
        return any(self._comm.allgather(bool(which.any())))

    def is_at_least(self, values: np.ndarray, before: np.ndarray) -> bool:
        return is_at_least(self._comm, values, before)

    def directions(
        self, field: DirectionField, sweep: int, active: np.ndarray | None = None
    ) -> np.ndarray | Ascent:
        return self._member.engine.directions(field, sweep, active)

    def move_batch(
        self,
        batch: int,
        directions: np.ndarray | Ascent,
        active: np.ndarray | None = None,
        enough: float = 0.0,
    ) -> int:
        return self._followed(batch, self._member.engine.move_batch(batch, directions, active, enough))

    def rounds(self) -> Rounds:
        from dvr_cli.distributed.share_rounds import ShareRounds  # not for runs without patches

        return ShareRounds(self._comm, self, self._share, self._member)

    def keep_altitude(self, bound: float) -> None:
        """As in Engine; bound: what the rank's own cells allow, of which the least counts."""
        least = min(self._comm.allgather(bound))
        super().keep_altitude(least)
        self._member.engine.keep_altitude(least)

    # ------------------------------------------------------------------------------ of Engine

    def _moved(self, lo: int, hi: int, move: Callable[[int, int], int], limit: float, by_ring: bool) -> int:
        return move(lo, hi)  # the rank's engine keeps to the altitude

    def _relax(self, batch: int, lo: int, hi: int, directions: np.ndarray, enough: float) -> int:
        return self._followed(batch, self._member.engine.relax_batch(batch, directions, enough))

    def _polish(self, batch: int, lo: int, hi: int, limit: float, aim: Aim, active: np.ndarray) -> int:
        return self._followed(batch, self._member.engine.polish_batch(batch, limit, aim, active))

    def _steepest(self, batch: int, lo: int, hi: int, band: float, active: np.ndarray) -> None:
        self._directions = self._member.engine.steepest(batch, band, active)

    def _worst_corner(self) -> tuple[int, float]:
        badness, corner, _ = self._member.engine.worst()
        return corner, badness

    def _set(self, points: np.ndarray) -> None:
        self._member.engine.restore((points, None))

    def _get(self) -> np.ndarray:
        return self._member.engine.coordinates

    def _followed(self, batch: int, moved: int) -> int:
        """Exchange the vertices of a batch; returns how many moved on all ranks, ``moved`` on this one."""
        self._member.exchange(batch)
        return int(self._comm.allreduce(moved))
