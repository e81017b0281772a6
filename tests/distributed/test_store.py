"""The share of each rank of a mesh: what it has, and what it gets of others."""

import numpy as np

from dvr_cli.distributed.rows import bounds
from dvr_cli.distributed.shares import CellRows, Kinds, Store
from meshes import random_mesh
from threads import on_threads


def store_on(comm, mesh):
    """The store of a rank, which has read its range of vertices and cells."""
    (block,) = mesh.cells
    lo, hi = bounds(len(mesh.points), comm.size)[comm.rank : comm.rank + 2]
    first, last = bounds(len(block.vertices), comm.size)[comm.rank : comm.rank + 2]
    rows = block.vertices[first:last].astype(np.int64)
    cells = CellRows(np.arange(first, last), rows, np.zeros(len(rows), dtype=np.uint8))
    none = CellRows(*(column[:0] for column in cells))
    kinds = Kinds((block.type,), np.zeros((1, 0), dtype=np.int64), ())
    return Store(comm, len(mesh.points), kinds, mesh.points[lo:hi], cells, none)


def test_all_cells_within_some_steps_of_a_ranks_own_are_found():
    mesh = random_mesh("triangle", 3, n=9)
    rows = mesh.cells[0].vertices

    def found(comm):
        store = store_on(comm, mesh)
        own = store.cells.ids[store.owned(store.cells.cells)]
        return own, [store.within(steps).ids for steps in (1, 2, 4)]

    each = on_threads(4, found)
    assert sorted(np.concatenate([own for own, _ in each])) == list(range(len(rows)))
    for own, within in each:
        near = own
        for step in range(1, 5):
            near = np.flatnonzero(np.isin(rows, rows[near]).any(axis=1))
            if step in (1, 2, 4):
                some = within[(1, 2, 4).index(step)]
                assert not len(np.setdiff1d(near, some))
                assert step > 1 or len(some) < len(rows)
