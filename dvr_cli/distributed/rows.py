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
    """The part that each rank has for this one; parts: what this one has for each. Its own stays as it is."""
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
    parts = [np.split(column[order], cuts) for column in columns]
    arrived = swapped(comm, [tuple(part[rank] for part in parts) for rank in range(comm.size)])
    return [np.concatenate(column) for column in zip(*arrived, strict=True)]


def asked(
    comm: Any, keys: np.ndarray, of: np.ndarray, answer: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """The answers of other ranks, one row for each of ``keys`` (n,); and what each rank has asked this one.

    of: (n,) the rank that is asked for each. answer: gives the rows for what this rank is asked.
    """
    order = np.argsort(of, kind="stable")
    questions = swapped(comm, np.split(keys[order], np.searchsorted(of[order], np.arange(1, comm.size))))
    answers = np.concatenate(swapped(comm, [answer(question) for question in questions]))
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
    parts = [np.split(column[there], ends) for column in columns]
    arrived = swapped(comm, [tuple(part[rank] for part in parts) for rank in range(comm.size)])
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
    result[there] = np.concatenate(swapped(comm, np.split(place, counts[:-1])))
    return result
