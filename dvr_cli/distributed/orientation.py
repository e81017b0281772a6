"""The orientation of a mesh that no rank has whole and of which some cells may be inverted.

As ``mesh.orientation`` finds it, but that parts of the mesh which lie on several ranks are followed from rank
to rank, by the cells that two of them have.
"""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np

from dvr_cli.backend import Backend
from dvr_cli.distributed.rows import asked, sent
from dvr_cli.distributed.shares import CellRows, Local, Store
from dvr_cli.mesh.corners import corners_of
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.orientation import connected_parts, sides
from dvr_cli.mesh.simplex import determinants

_ROUNDING = 1e-9  # of the sum of all sizes: a smaller sum of signed ones may be that of rounding


def mirrored_of(comm: Any, store: Store, local: Local, domain: Domain, backend: Backend) -> np.ndarray | None:
    """(c,) bool: the cells of ``store.cells`` to be mirrored; None on all ranks where rounding would decide.

    local: these cells, domain: theirs, however oriented.
    """
    stored = local.mesh.cells[: len(domain.cells)]
    corners = corners_of(stored, domain.dimension)
    measures = corners.by_cell(np.add, backend.twin(determinants)(domain.points, corners.vertices))
    signs = comm.allgather((bool((measures > 0).all()), bool((measures < 0).all())))
    for nth in range(2):
        if all(each[nth] for each in signs):
            return np.full(len(measures), nth == 1)
    own = store.owner(local.number) == comm.rank
    label = _labels(comm, store, *sides(stored, backend, own))
    as_stored, mirrored = label.T
    way = np.where(as_stored <= mirrored, 1.0, -1.0)
    part = np.minimum(as_stored, mirrored)
    mine = store.owned(store.cells.cells)
    signed = way * measures
    keys, at = np.unique(part[mine], return_inverse=True)
    sums = [np.bincount(at, weights, len(keys)) for weights in (signed[mine], np.abs(measures[mine]))]
    keys, *sums = sent(comm, keys % comm.size, keys, *sums)
    known, at = np.unique(keys, return_inverse=True)
    total, size = (np.bincount(at, weights, len(known)) for weights in sums)
    if any(comm.allgather(bool((np.abs(total) <= _ROUNDING * size).any()))):
        return None
    wanted, at = np.unique(part, return_inverse=True)
    sign = np.sign(total)
    good, _ = asked(comm, wanted, wanted % comm.size, lambda some: sign[np.searchsorted(known, some)])
    return (way != good[at]) & (as_stored != mirrored)


def of_cells(store: Store, values: np.ndarray, cells: CellRows) -> np.ndarray:
    """The values of some cells, from the ranks that own them; values: (c,) of ``store.cells``."""
    ids, owner = store.cells.ids, _owner(store, cells)
    return asked(store.comm, cells.ids, owner, lambda some: values[np.searchsorted(ids, some)])[0]


def _owner(store: Store, cells: CellRows) -> np.ndarray:
    """(c,) the rank that owns each of some cells."""
    return store.owner(reduce(np.minimum, cells.cells.T))


def _labels(comm: Any, store: Store, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(c, 2) the smallest node of the part of each cell of the rank, as stored and mirrored.

    one, other: see ``sides``, by place among the rank's cells. The nodes of the whole are 2 id and 2 id + 1.
    """
    ids = store.cells.ids
    nodes = 2 * len(ids)
    part = connected_parts(nodes, one, other)
    label = (2 * ids[:, None] + np.arange(2)).ravel()
    owner = _owner(store, store.cells)
    ghosts = np.flatnonzero(owner != comm.rank)

    def joined(label: np.ndarray) -> np.ndarray:
        lowest = np.full(nodes, np.iinfo(np.int64).max)
        np.minimum.at(lowest, part, label)
        return lowest[part]

    while True:
        before = label
        label = joined(label)
        there, found = sent(comm, owner[ghosts], ids[ghosts], label.reshape(-1, 2)[ghosts])
        of_owned = label.reshape(-1, 2).copy()
        np.minimum.at(of_owned, np.searchsorted(ids, there), found)
        label = joined(of_owned.ravel())
        answers = of_cells(store, label.reshape(-1, 2), CellRows(*(column[ghosts] for column in store.cells)))
        label.reshape(-1, 2)[ghosts] = answers  # no higher than what they were
        if not any(comm.allgather(bool((label != before).any()))):
            return label.reshape(-1, 2)
