"""Layers of a mesh that no rank has whole: the cells that keep their shape, as ``stretching`` finds them.

Whether a cell is a seed, each rank finds out for its own cells, with those around them. From there what is
kept spreads from rank to rank by the vertices that cells of two of them have.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from dvr_cli.distributed.labels import labels_of_parts, sums_of_parts
from dvr_cli.distributed.orientation import of_cells, owner_of_cells
from dvr_cli.distributed.ranks import agree
from dvr_cli.distributed.rows import sent
from dvr_cli.distributed.shares import CellRows, Local, Store
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.orientation import connected_parts
from dvr_cli.quality.sheets import Inside
from dvr_cli.quality.stretching import aspects_of, inside_sheets_of, seeds_among


class Layers(NamedTuple):
    """The cells that are kept: (c,) bool, of ``Store.cells``; the number of all, and their largest aspect."""

    kept: np.ndarray
    number: int
    max_aspect: float


def layers_among(
    comm: Any, store: Store, cells: CellRows, local: Local, domain: Domain, quality: np.ndarray
) -> Layers | None:
    """The layers of the whole, on all ranks together; None where there are none.

    cells: those of the rank and all that can be reached from them in REACH steps; local, domain: theirs, and
    quality: (C,) of its corners.
    """
    own = store.owned(cells.cells)
    seeds = seeds_among(domain, own, quality)
    sheets = _in_sheets(comm, store, cells, own, inside_sheets_of(domain, quality))
    seeds = np.concatenate([seeds, np.flatnonzero(sheets & own)])
    if not any(comm.allgather(len(seeds) > 0)):
        return None
    aspects = aspects_of(domain, quality)
    joined = aspects.spreads & own
    joined[seeds] = True
    reached = _reached(comm, store, local, domain, joined, seeds)
    kept = (joined & reached & aspects.lasting) | (sheets & own)
    if not (count := comm.allreduce(int(kept.sum()))):
        return None
    largest = max(comm.allgather(float(aspects.log_aspect[kept].max(initial=0.0))))
    of_rank = np.zeros(len(store.cells.ids), dtype=bool)
    of_rank[np.searchsorted(store.cells.ids, cells.ids[own])] = kept[own]
    return Layers(of_cells(store, of_rank, store.cells), count, float(np.exp(largest)))


def _in_sheets(comm: Any, store: Store, cells: CellRows, own: np.ndarray, found: Inside | None) -> np.ndarray:
    """(n,) bool: the cells that lie in sheets, right for the rank's own ((n,) bool).

    found: the cells inside what may be sheets.
    """
    n = len(own)
    if not any(comm.allgather(found is not None)):
        return np.zeros(n, dtype=bool)
    weight, one, other = np.zeros(n), np.empty(0, np.int64), np.empty(0, np.int64)
    beside = own.copy()
    if found is not None:
        weight[found.cells] = found.weight
        one, other = found.alike[own[found.alike].any(axis=1)].T
        beside[one] = beside[other] = True
    inside = (weight > 0.0) & beside
    which = np.flatnonzero(inside)
    place = np.cumsum(inside) - 1
    both = inside[one] & inside[other]
    ids, owner = cells.ids[which], owner_of_cells(store, cells)[which]
    part = labels_of_parts(comm, ids, owner, place[one[both]], place[other[both]])[:, 0]
    (size,) = sums_of_parts(comm, part, own[which], weight[which])
    inside[which] = size >= 1.0
    result = inside.copy()
    result[other[inside[one]]] = result[one[inside[other]]] = True
    return result


def _reached(
    comm: Any, store: Store, local: Local, domain: Domain, joined: np.ndarray, seeds: np.ndarray
) -> np.ndarray:
    """(n,) bool: the cells that hang together with a seed of any rank, through ``joined`` cells.

    joined: (n,) bool, of the rank's own cells; seeds: those of them, by number.
    """
    corners, own = domain.corners, store.owner(local.number) == comm.rank
    width = np.diff(corners.start)
    rows = corners.vertices[np.repeat(joined, width)]
    tail = np.repeat(rows[:, 0], rows.shape[1] - 1)
    part = connected_parts(len(own), tail, rows[:, 1:].ravel())
    chosen = np.zeros(len(width), dtype=bool)
    chosen[seeds] = True
    near = np.zeros(len(own), dtype=bool)
    near[corners.vertices[np.repeat(chosen, width)]] = True
    while True:
        hit = np.zeros(len(own), dtype=bool)
        hit[part[near]] = True
        new = hit[part] | near
        (told,) = sent(comm, store.owner(local.number[new & ~own]), local.number[new & ~own])
        known = store.rows_of(local, new)
        known[told - store.first] = True
        new |= store.of_others(local.number, known)[0]
        done = np.array_equal(new, near)
        near = new
        if agree(comm, done):
            return near[corners.vertices[corners.start[:-1], 0]]
