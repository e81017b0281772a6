"""Connected parts of a graph that no rank has whole, followed from rank to rank by what two of them have."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from dvr_cli.distributed.rows import asked, sent
from dvr_cli.mesh.orientation import connected_parts


def labels_of_parts(
    comm: Any, ids: np.ndarray, owner: np.ndarray, one: np.ndarray, other: np.ndarray, width: int = 1
) -> np.ndarray:
    """(n, width) the smallest node of the connected part of each node in the whole, on all ranks together.

    ids: (n,) ascending, of things here, of which each has so many nodes; those in the whole are
    width * id + k. owner: (n,) the rank that owns each; it has the thing, too. one, other: (e,) the edges
    that this rank knows, nodes being width * place + k; each edge is known to a rank that owns an end of it.
    """
    part = connected_parts(width * len(ids), one, other)
    label = (width * ids.astype(np.int64)[:, None] + np.arange(width)).ravel()
    ghosts = np.flatnonzero(owner != comm.rank)

    def joined(label: np.ndarray) -> np.ndarray:
        lowest = np.full(len(label), np.iinfo(np.int64).max)
        np.minimum.at(lowest, part, label)
        return lowest[part]

    while True:
        before = label
        label = joined(label)
        there, found = sent(comm, owner[ghosts], ids[ghosts], label.reshape(-1, width)[ghosts])
        of_owned = label.reshape(-1, width).copy()
        np.minimum.at(of_owned, np.searchsorted(ids, there), found)
        label = joined(of_owned.ravel())
        of_here = label.reshape(-1, width).copy()
        answer = partial(_rows_of, ids, of_here)
        of_here[ghosts], _ = asked(comm, ids[ghosts], owner[ghosts], answer)  # no higher than what they were
        label = of_here.ravel()
        if not any(comm.allgather(bool((label != before).any()))):
            return of_here


def sums_of_parts(comm: Any, part: np.ndarray, mine: np.ndarray, *values: np.ndarray) -> list[np.ndarray]:
    """(n,) for each of ``values`` (n,) the sum of those of all ranks with the same number in ``part`` (n,).

    mine: (n,) bool, of the things that several ranks have those that count here. Sums that are not exact
    depend on the order of ranks.
    """
    keys, at = np.unique(part[mine], return_inverse=True)
    sums = [np.bincount(at, some[mine], len(keys)) for some in values]
    keys, *sums = sent(comm, keys % comm.size, keys, *sums)
    known, at = np.unique(keys, return_inverse=True)
    total = np.stack([np.bincount(at, some, len(known)) for some in sums], axis=1)
    wanted, at = np.unique(part, return_inverse=True)
    found, _ = asked(comm, wanted, wanted % comm.size, partial(_rows_of, known, total))
    return list(found[at].T)


def _rows_of(ids: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The values of the things with some ids; ids: (n,) ascending, values: (n, ...)."""
    return values[np.searchsorted(ids, wanted)]
