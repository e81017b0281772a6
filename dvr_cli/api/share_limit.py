"""The limit of a mesh that no rank has whole: what holds its worst elements."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.share_setup import Mine, per_cell
from dvr_cli.api.smoothing import freer
from dvr_cli.distributed.job import LEAD
from dvr_cli.distributed.orientation import of_cells
from dvr_cli.distributed.shares import Store
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.ranks import distinct
from dvr_cli.quality.limits import HeldBy, Limit, limit_of
from dvr_cli.quality.measure import Quality


def limit_of_whole(
    comm: Any,
    store: Store,
    mine: Mine,
    points: np.ndarray,
    after: Quality,
    options: SmoothOptions,
    mends: bool,
) -> Limit | None:
    """The limit of the whole, on the leading rank: from the cells around the worst ones alone.

    mends: whether untangling helps, see ``limit_of``.
    """
    local, domain, share = mine.local, mine.domain, mine.share
    worst = np.isin(local.cells, [element.cell for element in after.worst])
    place = np.repeat(worst, np.diff(domain.corners.start))
    named = distinct(local.number[domain.corners.vertices[place].ravel()])
    named = distinct(np.concatenate(comm.allgather(named)))
    if comm.rank != LEAD:
        named = named[:0]
    cells = store.around(named)
    near = store.local(cells, store.lower_around(named))
    mirrored = None if mine.mirrored is None else of_cells(store, mine.mirrored, cells)
    d = points.shape[1]
    flags = np.stack([domain.interior, share.relaxed, mine.movable, *mine.masks.values()], axis=1)
    targets = mine.targets.around(store, local, cells, near)
    around, _ = store.of_others(near.number, store.rows_of(local, np.hstack([points, flags])))
    if comm.rank != LEAD:
        return None
    # two vertices more, of no cell, so that the mesh is as large as the whole
    corners = np.stack([store.low, store.high])
    small = replace(near.mesh, points=np.concatenate([near.mesh.points, corners]))
    interior, relaxed, movable, *masks = np.pad(around[:, d:].T > 0.0, ((0, 0), (0, 2)))
    free = np.logical_and.reduce([small.unlinked, ~np.pad(targets.held, (0, 2)), *masks])
    of_small = domain_of(small, regions=per_cell(mine.regions, near), mirrored=mirrored)
    of_small, _ = targets.on(replace(of_small, interior=interior, cell_ids=near.cells))
    not_chosen = {name: movable & ~mask for name, mask in zip(mine.masks, masks, strict=True)}
    return limit_of(
        of_small,
        np.concatenate([around[:, :d], corners]),
        np.flatnonzero(relaxed),
        after,
        HeldBy(not_chosen, freer(small, of_small, options.boundary, free, options.feature_angle)),
        mends,
        names=np.append(near.index, (-1, -1)),
    )
