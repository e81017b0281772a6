"""The boundary of a mesh of which each rank has a share: as where one process has it whole."""

import numpy as np
import pytest

from dvr_cli.boundary.constraints import constraints_of
from dvr_cli.boundary.features import features_of
from dvr_cli.distributed.rows import bounds
from dvr_cli.distributed.shares import CellRows, Kinds, Store, joined
from dvr_cli.distributed.sliding import sliding
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from meshes import boxes_of, random_mesh
from threads import on_threads


def store_of(comm, mesh):
    """The store of a rank that has read its range of the vertices, and of each block one cell in so many."""
    types = tuple(dict.fromkeys(block.type for block in mesh.cells))
    top = max(CELL_TYPES[name].dimension for name in types)
    main, lower, start = [], [], 0
    for block in mesh.cells:
        mine = np.arange(comm.rank, len(block.vertices), comm.size)
        kinds = np.full(len(mine), types.index(block.type), dtype=np.uint8)
        rows = CellRows(start + mine, block.vertices[mine], kinds)
        (main if CELL_TYPES[block.type].dimension == top else lower).append(rows)
        start += len(block.vertices)
    kinds = Kinds(types, np.zeros((len(types), 0), dtype=np.int64), ())
    first, last = bounds(len(mesh.points), comm.size)[comm.rank : comm.rank + 2]
    index = np.dtype(np.int64)
    rows = joined(main, index), joined(lower, index)
    return Store(comm, len(mesh.points), kinds, mesh.points[first:last], *rows)


def found_by_ranks(mesh, ranks):
    """(N,) and (N, d) of the freedom that the owners of vertices find, None where things touch."""
    dimension, axis = np.zeros(len(mesh.points), np.uint8), np.zeros_like(mesh.points)

    def work(comm):
        store = store_of(comm, mesh)
        local = store.local(store.cells, store.lower)
        result = sliding(comm, store, local, domain_of(local.mesh))
        if result is None:
            return False
        own = store.owner(local.number) == comm.rank
        dimension[local.index[own]], axis[local.index[own]] = (
            result[0].dimension[own],
            result[0].axis[own],
        )
        return True

    (known,) = set(on_threads(ranks, work))
    return (dimension, axis) if known else None


def agree(mesh, ranks):
    """The ranks see what one process sees, or that things touch; returns whether these do."""
    domain = domain_of(mesh)
    constraints = constraints_of(mesh, domain)
    touch = len(constraints.hanging) + len(constraints.coincident) > 0
    found = found_by_ranks(mesh, ranks)
    assert (found is None) == touch
    if found is not None:
        expected = features_of(domain.points, domain.interior, constraints).freedom
        np.testing.assert_array_equal(found[0], expected.dimension)
        assert found[1].tobytes() == expected.axis.tobytes()
        slides = expected.dimension[~domain.interior]
        assert (slides > 0).any()
        assert (slides == 0).any()
    return touch


@pytest.mark.parametrize("ranks", [1, 3])
@pytest.mark.parametrize("kind", ["quad", "triangle", "tetra", "mixed3d"])
def test_vertices_slide_as_in_the_whole(kind, ranks):
    """On straight sides, in slanting planes, along line cells on them, and not where a lower cell ends."""
    mesh = boxes_of(kind, 5) if kind in ("quad", "triangle") else random_mesh(kind, 1, n=4, noise=0.2)
    d = mesh.points.shape[1]
    slanting = mesh.points @ np.array([[1.0, 0.2, 0.1], [-0.3, 1.0, 0.4], [0.1, 0.3, 1.0]])[:d, :d]
    floor = np.flatnonzero(mesh.points[:, -1] == 0.0)
    lines = np.array(
        [[a, b] for a in floor for b in floor if np.linalg.norm(mesh.points[a] - mesh.points[b]) < 0.26]
    )
    lines = Cells("line", lines[lines[:, 0] < lines[:, 1]][:3])
    for points in mesh.points, slanting:
        assert not agree(Mesh(points, mesh.cells), ranks)
        assert not agree(Mesh(points, [lines, *mesh.cells]), ranks)


@pytest.mark.parametrize("ranks", [1, 3, 4])
@pytest.mark.parametrize(("kind", "fine"), [("quad", 8), ("quad", 4), ("hexahedron", 6), ("tetra", 3)])
def test_what_touches_and_is_not_connected_is_seen(kind, fine, ranks):
    """Two boxes beside each other, of one size of cells or two; connected where vertices are in one place."""
    one, other = boxes_of(kind, 4 if kind == "quad" else 3), boxes_of(kind, fine)
    other.points[:, 0] += 1.0
    points = np.concatenate([one.points, other.points])
    cells = np.concatenate([one.cells[0].vertices, len(one.points) + other.cells[0].vertices])
    assert agree(Mesh(points, [Cells(kind, cells)]), ranks)
    points, place = np.unique(points.round(9), axis=0, return_inverse=True)
    hangs = agree(Mesh(points, [Cells(kind, place.ravel()[cells])]), ranks)
    assert hangs == (fine in (8, 6))
