"""Wishes for things that ranks have: of wishes that share a thing the first comes true.

As if all were asked one after the other, and each granted if nothing that it is for has gone. Any rank can
be the one where a thing is at home, as long as all agree on it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from dvr_cli.distributed.rows import sent
from dvr_cli.mesh.ranks import distinct

_NEVER = np.iinfo(np.int64).max
_RANK = 40  # bits below a rank in a number that stands for it and a place


class Wish(NamedTuple):
    """A wish.

    place: its turn, below 2**40, of which no other wish of any rank has the same. things: (k,) their numbers,
    and homes: (k,) the ranks where they are at home.
    """

    place: int
    things: np.ndarray
    homes: np.ndarray


def first_come(comm: Any, wishes: list[Wish]) -> np.ndarray:
    """(n,) bool, those of the wishes of this rank that come true, on all ranks together."""
    place = np.array([wish.place for wish in wishes], dtype=np.int64)
    order = np.argsort(place)
    homes = _Homes(comm, wishes)
    granted, open_ = np.zeros(len(place), dtype=bool), np.ones(len(place), dtype=bool)

    def among(places: np.ndarray) -> np.ndarray:
        found = np.zeros(len(place), dtype=bool)
        found[order[np.searchsorted(place[order], places)]] = True
        return found

    while comm.allreduce(int(open_.any())):
        new = open_ & ~among(homes.waiting())
        lost = among(homes.grant(place[new]))
        granted |= new
        open_ &= ~(new | lost)
        homes.drop(place[lost])
    return granted


class _Homes:
    """The wishes for the things that are at home on this rank, and where those of this rank have gone."""

    def __init__(self, comm: Any, wishes: list[Wish]) -> None:
        self._comm = comm
        none = np.empty(0, dtype=np.int64)
        place = np.array([wish.place for wish in wishes], dtype=np.int64)
        place = np.repeat(place, [len(wish.things) for wish in wishes])
        to = np.concatenate([none, *(wish.homes for wish in wishes)])
        things = np.concatenate([none, *(wish.things for wish in wishes)])
        self._asked = _pairs(to, place)
        rank = np.full(len(to), comm.rank, dtype=np.int32)
        things, place, rank = sent(comm, to, things, place, rank)
        order = np.lexsort((place, things))
        self._place, self._rank = place[order], rank[order]
        self._thing = np.cumsum(np.diff(things[order], prepend=things[order][:1]) != 0)
        self._start = np.flatnonzero(np.diff(self._thing, prepend=-1))
        self._alive = np.ones(len(order), dtype=bool)

    def waiting(self) -> np.ndarray:
        """Those wishes of this rank which cannot be granted yet, as an earlier one is for the same thing."""
        return self._told(self._alive & (self._place != self._firsts()[self._thing]))

    def grant(self, places: np.ndarray) -> np.ndarray:
        """Grant wishes of this rank; those of it that were for any of the same things on any rank."""
        granted = self._heard(places)
        gone = np.isin(self._firsts(), granted)[self._thing]
        late = self._alive & gone & ~np.isin(self._place, granted)
        self._alive &= ~gone
        return self._told(late)

    def drop(self, places: np.ndarray) -> None:
        """Drop wishes of this rank."""
        self._alive &= ~np.isin(self._place, self._heard(places))

    def _firsts(self) -> np.ndarray:
        """For each thing the first wish that is left."""
        left = np.where(self._alive, self._place, _NEVER)
        return np.minimum.reduceat(left, self._start) if len(left) else left

    def _told(self, which: np.ndarray) -> np.ndarray:
        """Tell the ranks of wishes that they are among ``which``; what is told this one, each once."""
        (places,) = sent(self._comm, *_pairs(self._rank[which], self._place[which]))
        return distinct(places)

    def _heard(self, places: np.ndarray) -> np.ndarray:
        """Tell the homes of what wishes are for; what is told this one."""
        homes, asked = self._asked
        which = np.isin(asked, places)
        (heard,) = sent(self._comm, homes[which], asked[which])
        return heard


def _pairs(ranks: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The ranks and places of (n,) each that differ, by rank; as one number, as rows are slow to sort."""
    pairs = distinct(ranks.astype(np.int64) << _RANK | places)
    return pairs >> _RANK, pairs & (1 << _RANK) - 1
