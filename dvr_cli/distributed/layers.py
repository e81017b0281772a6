"""Layers of a mesh that no rank has whole: the cells that keep their shape, as ``stretching`` finds them.

Whether a cell is a seed, each rank finds out for its own cells, with those around them. From there what is
kept spreads from rank to rank by the vertices that cells of two of them have.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from dvr_cli.backend import Backend
from dvr_cli.distributed.labels import labels_of_parts, sums_of_parts
from dvr_cli.distributed.orientation import of_cells, owner_of_cells
from dvr_cli.distributed.ranks import agree
from dvr_cli.distributed.rows import sent
from dvr_cli.distributed.shares import CellRows, Local, Store
from dvr_cli.mesh.domain import Domain, domain_of
from dvr_cli.mesh.orientation import connected_parts
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.sheets import Inside
from dvr_cli.quality.stretching import (
    REACH,
    aspects_of,
    has_flat,
    inside_sheets_of,
    seeds_among,
    seeds_near,
    stretched_among,
)
from dvr_cli.quality.targets import FORMED

_FEW = 2000  # of so many vertices one may be stretched: more and it is no longer quicker to look there alone


class Layers(NamedTuple):
    """The cells that are kept: (c,) bool, of ``Store.cells``; the number of all, and their largest aspect.

    It is 1 where each cell has its own shape as target for no other reason than that it was asked for.
    """

    kept: np.ndarray
    number: int
    max_aspect: float


def may_have_layers(
    comm: Any, store: Store, local: Local, domain: Domain, mirrored: np.ndarray | None, quality: np.ndarray
) -> bool:
    """False, on all ranks, only where nothing is kept: seen without the cells of others, but for few of them.

    local, domain: of the rank's cells, of which ``mirrored`` ((c,) bool) are stored inside out, None where
    their measures say so. quality: (C,) of the corners.
    """
    own = store.owner(local.number) == comm.rank
    stretched = local.number[stretched_among(domain, own, quality)]
    found = comm.allgather((len(stretched), has_flat(domain, quality)))
    number = sum(each for each, _ in found)
    if any(flat for _, flat in found) or number * _FEW > store.size:
        return True
    if number == 0:
        return False
    near = store.near(stretched, 3 + REACH)
    among, seeds = among_cells(store, near, mirrored, domain.backend), 0
    if among is not None:
        seeds = len(seeds_near(among.domain, np.isin(among.local.number, stretched), among.quality))
    return not agree(comm, seeds == 0)


class Among(NamedTuple):
    """Some cells as a mesh, without lower ones, its domain, and (C,) the quality of its corners."""

    local: Local
    domain: Domain
    quality: np.ndarray


def among_cells(store: Store, cells: CellRows, mirrored: np.ndarray | None, backend: Backend) -> Among | None:
    """Some cells as a mesh, on all ranks together; None on those where there are none.

    mirrored: (c,) bool, of ``Store.cells``, as above.
    """
    local = store.local(cells, CellRows(*(column[:0] for column in store.lower)))
    turned = None if mirrored is None else of_cells(store, mirrored, cells)
    if not len(cells.ids):
        return None
    domain = domain_of(local.mesh, backend=backend, mirrored=turned)
    return Among(local, domain, corner_qualities(domain.points, domain.corners, backend))


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


def own_shapes_of(comm: Any, domain: Domain, own: np.ndarray, quality: np.ndarray) -> Layers | None:
    """All positive cells, on all ranks together; None where there are none.

    domain: of the cells of ``Store.cells``, own: (c,) bool, those of the rank; quality: (C,) of the corners.
    """
    positive = domain.corners.by_cell(np.minimum, quality) > FORMED[domain.dimension]
    count = comm.allreduce(int((positive & own).sum()))
    return Layers(positive, count, 1.0) if count else None


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
