"""Rows that ranks send one another: to where they belong, or as answers to questions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

_SAMPLES = 256  # values that each rank names, between which the rows of all are cut into parts


def bounds(n: int, ranks: int) -> np.ndarray:
    """(ranks + 1,) the first of 0 .. n-1 that belongs to each rank, in ranges of one size but for one."""
    return np.array([n * rank // ranks for rank in range(ranks + 1)], dtype=np.int64)


def owner_of(numbers: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """The rank that each number belongs to; bounds: as that function gives them."""
    return np.searchsorted(bounds, numbers, side="right") - 1


def swapped(comm: Any, parts: list[Any]) -> list[Any]:
    """The part that each rank has for this one; parts: what this one has for each. Its own stays as it is.

    Where a rank has nothing for another None is quicker to send than anything else.
    """
    own = parts[comm.rank]
    arrived: list[Any] = comm.alltoall([*parts[: comm.rank], None, *parts[comm.rank + 1 :]])
    arrived[comm.rank] = own
    return arrived


def sent(comm: Any, to: np.ndarray, *columns: np.ndarray) -> list[np.ndarray]:
    """The rows of some arrays that all ranks send to this one, in the order of ranks; each array of them.

    to: (n,) the rank that each row is for. Rows for one rank keep their order.
    """
    order = np.argsort(to, kind="stable")
    cuts = np.searchsorted(to[order], np.arange(1, comm.size))
    arrived = _swapped_rows(comm, order, cuts, columns)
    return [np.concatenate(column) for column in zip(*arrived, strict=True)]


def _swapped_rows(
    comm: Any, order: np.ndarray, cuts: np.ndarray, columns: tuple[np.ndarray, ...]
) -> list[tuple[np.ndarray, ...]]:
    """The rows of some arrays that each rank has for this one.

    order: the rows of this rank, those for one after those for another, which begin at ``cuts`` (ranks - 1,).
    """
    parts = zip(*(np.split(column[order], cuts) for column in columns), strict=True)
    nothing = tuple(column[:0] for column in columns)
    return [part or nothing for part in swapped(comm, [part if len(part[0]) else None for part in parts])]


def asked(
    comm: Any, keys: np.ndarray, of: np.ndarray, answer: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """The answers of other ranks, one row for each of ``keys`` (n,); and what each rank has asked this one.

    of: (n,) the rank that is asked for each. answer: gives the rows for what this rank is asked.
    """
    order = np.argsort(of, kind="stable")
    cuts = np.searchsorted(of[order], np.arange(1, comm.size))
    questions = [question for (question,) in _swapped_rows(comm, order, cuts, (keys,))]
    each = [
        answer(question) if len(question) or rank == comm.rank else None
        for rank, question in enumerate(questions)
    ]
    answers = np.concatenate([rows for rows in swapped(comm, each) if rows is not None])
    rows = np.empty_like(answers)
    rows[order] = answers
    return rows, questions


def places(comm: Any, *columns: np.ndarray) -> np.ndarray:
    """(n,) the place of each row of this rank among the distinct ones of all ranks, in their order.

    The first column counts most. No rank gets more than about its share of them, if few are equal there.
    """
    ordered = np.sort(columns[0])
    samples = ordered[np.arange(_SAMPLES) * len(ordered) // _SAMPLES] if len(ordered) else ordered
    samples = np.sort(np.concatenate(comm.allgather(samples)))
    if not len(samples):
        return np.empty(0, dtype=np.int64)
    cuts = samples[np.arange(1, comm.size) * len(samples) // comm.size]
    to = np.searchsorted(cuts, columns[0], side="right")
    there = np.argsort(to, kind="stable")
    ends = np.searchsorted(to[there], np.arange(1, comm.size))
    arrived = _swapped_rows(comm, there, ends, columns)
    rows = [np.concatenate(column) for column in zip(*arrived, strict=True)]
    order = np.lexsort(rows[::-1])
    new = np.zeros(len(order), dtype=bool)
    new[:1] = True
    for row in rows:
        new[1:] |= row[order[1:]] != row[order[:-1]]
    place = np.empty(len(order), dtype=np.int64)
    place[order] = sum(comm.allgather(int(new.sum()))[: comm.rank]) + np.cumsum(new) - 1
    counts = np.cumsum([len(part[0]) for part in arrived])
    result = np.empty(len(there), dtype=np.int64)
    own = [part if len(part) else None for part in np.split(place, counts[:-1])]
    result[there] = np.concatenate([place[:0], *(part for part in swapped(comm, own) if part is not None)])
    return result
