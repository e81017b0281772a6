"""The orientation of a mesh that no rank has whole and of which some cells may be inverted.

As ``mesh.orientation`` finds it, but that parts of the mesh which lie on several ranks are followed from rank
to rank, by the cells that two of them have.
"""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np

from dvr_cli.backend import Backend
from dvr_cli.distributed.labels import labels_of_parts, sums_of_parts
from dvr_cli.distributed.rows import asked
from dvr_cli.distributed.shares import CellRows, Local, Store
from dvr_cli.mesh.corners import corners_of
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.orientation import sides
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
    one, other = sides(stored, backend, own)
    label = labels_of_parts(comm, store.cells.ids, owner_of_cells(store, store.cells), one, other, width=2)
    as_stored, mirrored = label.T
    way = np.where(as_stored <= mirrored, 1.0, -1.0)
    mine = store.owned(store.cells.cells)
    values = way * measures, np.abs(measures)
    total, size = sums_of_parts(comm, np.minimum(as_stored, mirrored), mine, *values)
    if any(comm.allgather(bool((np.abs(total) <= _ROUNDING * size).any()))):
        return None
    return (way != np.sign(total)) & (as_stored != mirrored)


def of_cells(store: Store, values: np.ndarray, cells: CellRows) -> np.ndarray:
    """The values of some cells, from the ranks that own them; values: (c,) of ``store.cells``."""
    ids, owner = store.cells.ids, owner_of_cells(store, cells)
    return asked(store.comm, cells.ids, owner, lambda some: values[np.searchsorted(ids, some)])[0]


def owner_of_cells(store: Store, cells: CellRows) -> np.ndarray:
    """(c,) the rank that owns each of some cells."""
    return store.owner(reduce(np.minimum, cells.cells.T))
