"""Rounds of patches where no rank has the whole problem: the patches that one process would choose.

Some of the worst corners of the whole at a time are looked at by the ranks that answer for them, or by others
where one has more than its share. Each rank asks others for what lies around its seeds, and finds which
corners each patch would have. Of patches that share a corner the first counts: what decides that are the
ranks to which the corners are at home. So no rank gets to know more than the surroundings of its seeds.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from dvr_cli.distributed.first_come import Wish, first_come
from dvr_cli.distributed.member import Member
from dvr_cli.distributed.rows import owner_of, places, sent
from dvr_cli.distributed.shared_parts import Share
from dvr_cli.distributed.vicinities import Vicinities, Vicinity
from dvr_cli.mesh.corners import Simplices
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.patches.neighbourhoods import CANDIDATES, Patches
from dvr_cli.relax.patches.rounds import Rounds, Solved, bearable, has_grown

_RANGES = 64  # into which a range of places is divided at once


class _Seeds(NamedTuple):
    """The corners that patches may be built around, as other ranks need them.

    place: (m,) among the candidates of all ranks. ids: (m,) in the whole. layers: (m,) to be freed around
    each. vertices: (m, d+1) see ``Vicinities.relaxed_of``. answerer: (m,) the rank that answers for each, and
    corner: (m,) its number there.
    """

    place: np.ndarray
    ids: np.ndarray
    layers: np.ndarray
    vertices: np.ndarray
    answerer: np.ndarray
    corner: np.ndarray


class _Chosen(NamedTuple):
    """A patch that may come to its turn.

    place: among the candidates of all ranks. answerer: the rank that answers for its seed, and corner: the
    number of that there. vicinity: around it, and patches: this one alone, in the vicinity's numbering.
    """

    place: int
    answerer: int
    corner: int
    vicinity: Vicinity
    patches: Patches

    @property
    def wish(self) -> Wish:
        """The corners that it would have."""
        corners = self.patches.corners
        return Wish(self.place, self.vicinity.ids[corners], self.vicinity.homes[corners])


class ShareRounds(Rounds):
    """The rounds of a rank's share; all ranks have to ask for them together."""

    def __init__(self, comm: Any, engine: Engine, share: Share, member: Member) -> None:
        """engine: of the share, whose altitude is kept. member: has the coordinates."""
        self._comm, self._engine, self._share, self._member = comm, engine, share, member
        self._vicinities = Vicinities(comm, share, member.engine)
        self._first = np.flatnonzero(share.part.first).astype(np.int32)
        self._answered = np.full(share.ids.start[-1], -1, dtype=np.int32)  # of corners the number among these
        self._answered[share.part.problem.touched_ids[self._first]] = np.arange(len(self._first))

    def solve(
        self,
        worst: np.ndarray,
        quality: np.ndarray,
        layers: np.ndarray,
        most: int,
        enough: float,
        time_is_up: Callable[[], bool],
    ) -> Solved:
        """As in Rounds, of the corners that the rank answers for; time is asked about between rounds only."""
        chosen = self._choose(worst, quality[worst], layers, most)
        altitude, dimension = float(self._engine.altitude), self._share.part.problem.dimension
        results: list[tuple[float, float]] = []
        for _, some in groupby(chosen, key=lambda one: id(one.vicinity)):
            same = list(some)
            vicinity = same[0].vicinity
            most_of_each = [bearable(enough, dimension, one.place == 0) for one in same]
            patches = vicinity.solvable([one.patches for one in same], enough, most_of_each, altitude)
            results += self._member.engine.solve_patches(vicinity.points, patches, lambda: False)
        badness = np.array(results).reshape(-1, 2)
        moved = sum(len(one.patches.freed) for one, (b, a) in zip(chosen, results, strict=True) if a < b)
        grown = has_grown(badness, dimension)
        self._bring(chosen)
        corners, values, of_grown = self._changed(chosen, grown)
        answerers, seeds = (np.array([one[i] for one in chosen], dtype=np.int64) for i in (1, 2))
        seeds, badness = sent(self._comm, answerers, seeds, badness)
        patches, moved = self._comm.allreduce(np.array([len(chosen), moved])).tolist()
        return Solved(
            patches=patches,
            moved=moved,
            seeds=seeds,
            badness=badness,
            corners=corners,
            quality=values,
            grown=of_grown,
        )

    def _choose(self, worst: np.ndarray, quality: np.ndarray, layers: np.ndarray, most: int) -> list[_Chosen]:
        """The patches of this rank among the first ``most`` that share no corner with earlier ones."""
        turns = self._vicinities.turns(self._first[worst])
        place = places(self._comm, quality, *turns)
        candidates = min(self._comm.allreduce(len(worst)), CANDIDATES * most)
        taken: list[_Chosen] = []
        done, some, count = 0, 2 * most, 0
        while done < candidates and count < most:
            end = min(done + some, candidates)
            new = np.flatnonzero((place >= done) & (place < end))
            taken += self._some(self._dealt(worst[new], place[new], layers), taken)
            free = first_come(self._comm, [one.wish for one in taken])
            taken = [one for one, is_free in zip(taken, free, strict=True) if is_free]
            done, some = end, 2 * some
            count = self._comm.allreduce(len(taken))
        if count > most:
            candidates = self._last_place([one.place for one in taken], candidates, most)
        return [one for one in taken if one.place < candidates]

    def _dealt(self, seeds: np.ndarray, place: np.ndarray, layers: np.ndarray) -> _Seeds:
        """The seeds that this rank looks at, its own or what others have too many of; seeds: its own."""
        corners, to = self._first[seeds], self._evenly(len(seeds))
        ids, vertices = self._vicinities.ids(corners), self._vicinities.relaxed_of(corners)
        rank = np.full(len(seeds), self._comm.rank, dtype=np.int64)
        return _Seeds(*sent(self._comm, to, place, ids, layers[seeds], vertices, rank, seeds))

    def _evenly(self, number: int) -> np.ndarray:
        """(number,) the rank for each thing of this one, so that none has more than its share of all."""
        counts = np.empty(self._comm.size, dtype=np.int64)
        self._comm.Allgather(np.array([number]), counts)
        share = -(-int(counts.sum()) // len(counts))
        before = np.maximum(counts[: self._comm.rank] - share, 0).sum()
        full = np.cumsum(np.maximum(share - counts, 0))
        to = np.full(number, self._comm.rank, dtype=np.int64)
        to[share:] = np.searchsorted(full, before + np.arange(len(to[share:])), side="right")
        return to

    def _some(self, seeds: _Seeds, taken: list[_Chosen]) -> list[_Chosen]:
        """The patches around some corners that share no corner with those which this rank has taken."""
        vicinity = self._vicinities.around(seeds.vertices, seeds.layers + 1)
        patches = vicinity.patches(seeds.ids, seeds.layers)
        gone = np.isin(vicinity.ids, _joined([one.wish.things for one in taken], np.int64))
        which = zip(seeds.place.tolist(), seeds.answerer.tolist(), seeds.corner.tolist(), strict=True)
        return [
            _Chosen(*each, vicinity, one)
            for each, one in zip(which, patches, strict=True)
            if not gone[one.corners].any()
        ]

    def _last_place(self, taken: list[int], candidates: int, most: int) -> int:
        """The place before which ``most`` patches are taken on all ranks, by ever smaller ranges."""
        low, high, places = 0, candidates, np.sort(taken)
        while high - low > 1:
            ends = np.unique(np.linspace(low, high, _RANGES + 1).astype(np.int64))
            counts = self._comm.allreduce(np.searchsorted(places, ends[1:]))
            which = int(np.argmax(counts >= most))
            low, high = ends[which : which + 2].tolist()
        return high

    def _bring(self, chosen: list[_Chosen]) -> None:
        """Give the owners of vertices their coordinates, and them to all that have these as ghosts."""
        share, points = self._share, self._member.engine.coordinates
        number = _joined([one.vicinity.number[one.patches.freed] for one in chosen], np.int64)
        reached = _joined(
            [one.vicinity.points[one.patches.freed] for one in chosen], np.float64, points.shape[1]
        )
        number, reached = sent(self._comm, owner_of(number, share.bounds), number, reached)
        points[np.searchsorted(share.number, number)] = reached
        self._member.exchange_all()

    def _changed(self, chosen: list[_Chosen], grown: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The corners of patches that this rank answers for, their qualities, whether patches have grown."""
        ids, values, to = [], [], []
        for one in chosen:
            vicinity, corners = one.vicinity, one.patches.corners
            some = Simplices(one.patches.vertices, one.patches.shapes[:, None], vicinity.table)
            ids.append(vicinity.ids[corners])
            values.append(corner_qualities(vicinity.points, some))
            to.append(vicinity.answerers[corners])
        has = np.repeat(grown, [len(one) for one in ids])
        columns = _joined(ids, np.int64), _joined(values, np.float64), has
        found, quality, has = sent(self._comm, _joined(to, np.int64), *columns)
        return self._answered[self._share.ids.corners(found)], quality, has


def _joined(parts: list[np.ndarray], dtype: type, *width: int) -> np.ndarray:
    return np.concatenate([np.empty((0, *width), dtype=dtype), *parts])
