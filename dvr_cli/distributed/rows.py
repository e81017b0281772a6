"""Rows that ranks send one another: to where they belong, or as answers to questions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

# Values that all ranks name, and one at least, between which the rows of all are cut into parts.
_SAMPLES, _FEWEST = 4096, 16


def index_type(size: int) -> type[np.int32] | type[np.int64]:
    """The integers that indices of ``size`` vertices are kept as: short ones where these do."""
    return np.int32 if size <= np.iinfo(np.int32).max else np.int64


def bounds(n: int, ranks: int) -> np.ndarray:
    """(ranks + 1,) the first of 0 .. n-1 that belongs to each rank, in ranges of one size but for one."""
    return np.array([n * rank // ranks for rank in range(ranks + 1)], dtype=np.int64)


def owner_of(numbers: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """The rank that each number belongs to; bounds: as that function gives them."""
    return np.searchsorted(bounds, numbers, side="right") - 1


def swapped(comm: Any, parts: dict[int, Any]) -> dict[int, Any]:
    """The parts that ranks have for this one, by rank, ascending; parts: what this one has for each.

    Its own stays as it is. Few of many ranks have to do with each other: others get no message.
    """
    sends = np.zeros(comm.size, dtype=np.uint8)
    sends[list(parts)] = 1
    comes = np.empty_like(sends)
    comm.Alltoall(sends, comes)
    requests = [comm.isend(part, rank) for rank, part in parts.items() if rank != comm.rank]
    arrived = {
        rank: parts[rank] if rank == comm.rank else comm.recv(source=rank)
        for rank in np.flatnonzero(comes).tolist()
    }
    for request in requests:
        request.wait()
    return arrived


def sent(comm: Any, to: np.ndarray, *columns: np.ndarray) -> list[np.ndarray]:
    """The rows of some arrays that all ranks send to this one, in the order of ranks; each array of them.

    to: (n,) the rank that each row is for. Rows for one rank keep their order.
    """
    return _joined(columns, swapped_rows(comm, to, np.argsort(to, kind="stable"), columns))


def swapped_rows(
    comm: Any, to: np.ndarray, order: np.ndarray, columns: tuple[np.ndarray, ...]
) -> dict[int, tuple[np.ndarray, ...]]:
    """The rows of some arrays that ranks have for this one, by rank, of those that have any.

    to: (n,) the rank that each row of this one is for, and order: (n,) the rows by that.
    """
    ranks, start = np.unique(to[order], return_index=True)
    rows_of = zip(ranks.tolist(), np.split(order, start[1:]), strict=False)  # none for no rank
    return swapped(comm, {rank: tuple(column[rows] for column in columns) for rank, rows in rows_of})


def _joined(columns: tuple[np.ndarray, ...], parts: dict[int, tuple[np.ndarray, ...]]) -> list[np.ndarray]:
    """The rows of some parts, one after the other; columns: arrays of that kind."""
    nothing = tuple(column[:0] for column in columns)
    return [np.concatenate(column) for column in zip(nothing, *parts.values(), strict=True)]


def asked(
    comm: Any, keys: np.ndarray, of: np.ndarray, answer: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """The answers of other ranks, one row for each of ``keys`` (n,); and what each rank has asked this one.

    of: (n,) the rank that is asked for each. answer: gives the rows for what this rank is asked.
    """
    order = np.argsort(of, kind="stable")
    questions = [keys[:0]] * comm.size
    for rank, (question,) in swapped_rows(comm, of, order, (keys,)).items():
        questions[rank] = question
    each = {
        rank: answer(question)
        for rank, question in enumerate(questions)
        if len(question) or rank == comm.rank  # its own, so that there is an answer always
    }
    answers = np.concatenate(list(swapped(comm, each).values()))
    rows = np.empty_like(answers)
    rows[order] = answers
    return rows, questions


def places(comm: Any, *columns: np.ndarray) -> np.ndarray:
    """(n,) the place of each row of this rank among the distinct ones of all ranks, in their order.

    The first column counts most. No rank gets more than about its share of them, if few are equal there.
    """
    of_ranks = cuts(comm, np.sort(columns[0]))
    if not len(of_ranks):
        return np.empty(0, dtype=np.int64)
    to = part_of(columns[0], of_ranks)
    there = np.argsort(to, kind="stable")
    arrived = swapped_rows(comm, to, there, columns)
    rows = _joined(columns, arrived)
    order = np.lexsort(rows[::-1])
    new = np.zeros(len(order), dtype=bool)
    new[:1] = True
    for row in rows:
        new[1:] |= row[order[1:]] != row[order[:-1]]
    place = np.empty(len(order), dtype=np.int64)
    place[order] = (comm.exscan(int(new.sum())) or 0) + np.cumsum(new) - 1
    ends = np.cumsum([len(part[0]) for part in arrived.values()])
    back = dict(zip(arrived, np.split(place, ends[:-1]), strict=False))
    result = np.empty(len(there), dtype=np.int64)
    result[there] = np.concatenate([place[:0], *swapped(comm, back).values()])
    return result


def part_of(values: np.ndarray, cuts: np.ndarray) -> np.ndarray:
    """The rank in whose part each value lies; cuts: as that function gives them."""
    return np.searchsorted(cuts[1:], values, side="right")


def cuts(comm: Any, ordered: np.ndarray) -> np.ndarray:
    """(ranks,) values from each of which on about as many of all ranks lie; none where there are no values.

    ordered: (n,) those of this rank, ascending. The first of the cuts is none that separates any.
    """
    number = max(_SAMPLES // comm.size, _FEWEST)  # that each rank names
    samples = np.zeros(number, dtype=ordered.dtype)
    if len(ordered):
        samples[:] = ordered[np.arange(number) * len(ordered) // number]
    known = np.empty((comm.size, number), dtype=ordered.dtype)
    some = np.empty(comm.size, dtype=np.uint8)
    comm.Allgather(samples, known)
    comm.Allgather(np.array([len(ordered) > 0], dtype=np.uint8), some)
    samples = np.sort(known[some > 0].ravel())
    return samples[np.arange(comm.size) * len(samples) // comm.size] if len(samples) else samples
