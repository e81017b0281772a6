"""Meshes cut by hand for ``test_distributed``: each rank smooths its piece, and compares with one process.

mpiexec -n 3 python pieces.py few|all|metis
"""

import sys

import numpy as np
import pytest
from mpi4py import MPI

import dvr_cli
from dvr_cli.api import distributed
from dvr_cli.distributed import parts
from dvr_cli.errors import InputError, UsageError
from dvr_cli.mesh.cell_types import CELL_TYPES
from meshes import boxes_of, random_mesh, random_tensors, tangled

COMM = MPI.COMM_WORLD
ENGINE = {"engine": "numpy"}


def pieces_of(mesh, seed):
    """The piece of this rank: points, cells, ids of its vertices and cells; drawn alike on all ranks."""
    rng = np.random.default_rng(seed)
    cells, ids, start = [], [], 0
    for block in mesh.cells:
        mine = np.flatnonzero(rng.integers(COMM.size, size=len(block.vertices)) == COMM.rank)
        cells.append((block.type, block.vertices[mine]))
        ids.append(start + mine)
        start += len(block.vertices)
    shuffled = np.random.default_rng([seed, COMM.rank])
    here = np.unique(np.concatenate([rows.ravel() for _, rows in cells]))
    extra = shuffled.integers(len(mesh.points), size=3)  # some have vertices of which they have no cell
    here = shuffled.permutation(np.union1d(here, extra))
    if COMM.rank == 0:  # vertices of no cell belong to the mesh, too
        here = np.union1d(here, np.setdiff1d(np.arange(len(mesh.points)), vertices_of(mesh)))
    number = np.full(len(mesh.points), -1)
    number[here] = np.arange(len(here))
    return mesh.points[here], [(name, number[rows]) for name, rows in cells], here, np.concatenate(ids)


def vertices_of(mesh):
    return np.unique(np.concatenate([block.vertices.ravel() for block in mesh.cells]))


def arrays_of(mesh):
    return mesh.points, [(block.type, block.vertices) for block in mesh.cells]


def by_one(work):
    """What one rank makes, on all of them."""
    return COMM.bcast(work() if COMM.rank == 0 else None)


def agree(mesh, seed, **options):
    """The pieces come out bit for bit as one process has them, and with the same figures."""
    points, cells, vertices, ids = pieces_of(mesh, seed)
    whole = dict(options)
    for name, rows in ("regions", ids), ("metric", vertices):
        if name in options:
            options[name] = options[name][rows]
    moved, report = dvr_cli.smooth_distributed(COMM, points, cells, vertices, ids, **options, **ENGINE)
    expected, serial = by_one(lambda: dvr_cli.smooth(*arrays_of(mesh), **whole, **ENGINE))
    assert moved.tobytes() == expected[vertices].tobytes()
    for name in ("q1", "minimum", "mean", "quantiles", "inverted", "q1_element", "worst", "fixed_cap"):
        for state in ("before", "after"):
            assert getattr(getattr(report, state), name) == getattr(getattr(serial, state), name), name
    assert [sweep["q1"] for sweep in report.sweeps] == [sweep["q1"] for sweep in serial.sweeps]
    assert report.stopped_because == serial.stopped_because
    assert report.shape == serial.shape
    assert report.relaxed == serial.relaxed
    assert not len(report.after.vector)
    return report


def fails(kind, text, *arguments, **options):
    """All ranks raise the same error."""
    with pytest.raises(kind, match=text):
        dvr_cli.smooth_distributed(COMM, *arguments, **options)


def agree_in_shares(mesh, seed, **options):
    """The same where no rank gathers the whole."""
    usual, distributed.gathered = distributed.gathered, not_gathered
    report = agree(mesh, seed, **options)
    distributed.gathered = usual
    return report


def not_gathered(*arguments):
    raise AssertionError("a rank gathers the whole mesh")


SWEEPS = {"directions": "random,steepest", "max_iterations": 2, "tol": 0.0}


def few():
    agree(random_mesh("mixed3d", 1, noise=0.4), 2, **SWEEPS)
    agree(random_mesh("triangle", 4, noise=0.45), 5, patches=True, max_iterations=2)
    assert agree_in_shares(layered(), 7, max_iterations=1).shape.kept > 0
    agree_in_shares(random_mesh("tetra", 1, n=4, noise=0.25), 3, patches=True, max_iterations=2)
    agree_in_shares(random_mesh("mixed2d", 1, n=4, noise=0.3), 3, max_iterations=2)
    errors()


def main():
    for kind in ("triangle", "quad", "tetra", "mixed3d"):
        agree(random_mesh(kind, 1, noise=0.4), 2, **SWEEPS)
    agree(random_mesh("tetra", 1, noise=0.4), 3, boundary="slide", max_iterations=3)
    agree(random_mesh("triangle", 4, noise=0.45), 5, patches=True, max_iterations=4)
    agree(random_mesh("triangle", 1), 1, **SWEEPS, order="natural")
    mesh = random_mesh("tetra", 1, n=5, noise=0.25)
    agree_in_shares(mesh, 2, **SWEEPS)
    agree_in_shares(mesh, 3, patches=True, max_iterations=4)
    for kind in ("triangle", "quad", "hexahedron", "wedge", "pyramid", "mixed2d", "mixed3d"):
        agree_in_shares(random_mesh(kind, 1, n=4, noise=0.2), 2, **SWEEPS)
    agree_in_shares(random_mesh("mixed3d", 1, n=4, noise=0.2), 3, patches=True, max_iterations=3)
    agree_in_shares(tangled("triangle", 4, 0.9, 1), 6, untangle=True, max_iterations=2)
    agree_in_shares(layered(), 7, max_iterations=2)
    agree_in_shares(random_mesh("wedge", 1, n=4, noise=0.2), 4, shape="input", max_iterations=2)
    mesh = random_mesh("triangle", 8)
    agree(mesh, 8, **SWEEPS, regions=np.arange(len(mesh.cells[0].vertices)) % 2)
    agree_in_shares(mesh, 8, **SWEEPS, metric=random_tensors(len(mesh.points), 2, 1))
    mesh = random_mesh("mixed3d", 1, n=4, noise=0.2)
    how = {"patches": True, "max_iterations": 2, "boundary": "slide"}
    agree_in_shares(mesh, 3, metric=random_tensors(len(mesh.points), 3, 1), **how)
    mirrored = random_mesh("tetra", 3)
    mirrored.cells[0].vertices[::3] = mirrored.cells[0].vertices[::3, [1, 0, 2, 3]]
    agree_in_shares(mirrored, 9, **SWEEPS)
    with_owners(at_random)
    without_ids_of_cells()
    few = random_mesh("quad", 0, n=3)  # a rank without any cell of its own
    points, (block,) = few.points, few.cells
    mine = slice(None) if COMM.rank == 0 else slice(0)
    moved, _ = dvr_cli.smooth_distributed(
        COMM, points, {"quad": block.vertices[mine]}, np.arange(len(points)), **SWEEPS, **ENGINE
    )
    order = np.lexsort(np.sort(block.vertices, axis=1).T[::-1])
    expected, _ = dvr_cli.smooth(points, {"quad": block.vertices[order]}, **SWEEPS, **ENGINE)
    assert moved.tobytes() == expected.tobytes()
    errors()


def with_owners(owners):
    """Which rank owns a vertex makes no difference."""
    usual, parts.along_curve = parts.along_curve, owners
    agree(random_mesh("triangle", 4, noise=0.45), 5, patches=True, max_iterations=3)
    agree(random_mesh("tetra", 1, noise=0.4), 3, **SWEEPS, polish=True)
    parts.along_curve = usual


def at_random(problem, ranks):
    return np.random.default_rng(7).integers(ranks, size=len(problem.rings.vertices))


def by_metis(problem, ranks):
    """By METIS, the graph being that of vertices which share a corner."""
    vertices = problem.rings.vertices
    number = np.full(len(problem.order), -1)
    number[vertices] = np.arange(len(vertices))
    members = number[problem.touched.vertices]
    around = [set() for _ in vertices]
    for row in members.tolist():
        for one in row:
            if one >= 0:
                around[one] |= {other for other in row if other >= 0 and other != one}
    import pymetis

    _, owners = pymetis.part_graph(ranks, adjacency=[sorted(one) for one in around])
    return np.array(owners)


def without_ids_of_cells():
    """Cells come by type then, and in the order of their vertices."""
    for seed, name, noise in (1, "triangle", 0.4), (2, "mixed3d", 0.2), (3, "tetra", 0.25):
        mesh = random_mesh(name, 1, noise=noise)
        points, cells, vertices, _ = pieces_of(mesh, seed)
        moved, _ = dvr_cli.smooth_distributed(COMM, points, cells, vertices, **SWEEPS, **ENGINE)
        blocks = {block.type: block.vertices for block in mesh.cells}
        ordered = {}
        for kind in sorted(blocks, key=list(CELL_TYPES).index):
            ordered[kind] = blocks[kind][np.lexsort(np.sort(blocks[kind], axis=1).T[::-1])]
        expected, _ = dvr_cli.smooth(mesh.points, ordered, **SWEEPS, **ENGINE)
        assert moved.tobytes() == expected[vertices].tobytes()


def errors():
    """What is wrong on one rank is an error on all."""
    points, cells, vertices, ids = pieces_of(random_mesh("triangle", 1), 1)
    last = COMM.rank == COMM.size - 1
    fails(UsageError, "vertex_ids: ", points, cells, vertices[: len(vertices) - last], ids)
    fails(UsageError, "an id is there twice", points, cells, vertices * (1 - last), ids)
    ((kind, rows),) = cells
    fails(InputError, "not supported", points, [("polygon" if last else kind, rows)], vertices, ids)
    fails(InputError, "integers of shape", points, [(kind, rows * (0.5 if last else 1))], vertices, ids)
    fails(InputError, "integers of shape", points, [(kind, rows[:, : 3 - last])], vertices, ids)
    fails(InputError, "does not have", points, [(kind, rows + 999 * last)], vertices, ids)
    fails(InputError, "not finite", points * (np.nan if last else 1.0), cells, vertices, ids)
    fails(UsageError, "seed", points, cells, vertices, ids, seed=-1 if last else 0)
    fails(UsageError, "fix", points, cells, vertices, ids, fix="wall")
    fails(UsageError, "names only", points, cells, vertices, ids, directions=points)
    fails(UsageError, "regions: ", points, cells, vertices, ids, regions=ids[last:])
    fails(UsageError, "no_such", points, cells, vertices, ids, no_such=1)
    fails(UsageError, "walk", *pieces_of(ball(), 1), boundary="project", feature_angle=120.0, **ENGINE)
    none = [("triangle", np.empty((0, 3), dtype=int))]
    fails(InputError, "no cells", points, none, vertices, ids[:0])
    if COMM.size > 1:
        fails(UsageError, "seed: not the same", points, cells, vertices, ids, seed=int(last))
        some = {"regions": ids} if last else {}
        fails(UsageError, "regions: an array on some", points, cells, vertices, ids, **some)
        fails(InputError, "other coordinates", points + last, cells, vertices, ids)
        fails(InputError, "two ranks", points, cells, vertices, np.arange(len(ids)))
        fails(UsageError, "on all ranks or on none", points, cells, vertices, None if last else ids)


def layered():
    """Quadrilaterals that are flat near the floor and shaken above."""
    mesh = boxes_of("quad", 10)
    height = np.concatenate([np.arange(6) * 0.004, 0.02 + np.arange(1, 6) * 0.1])
    row = np.rint(mesh.points[:, 1] * 10).astype(int)
    mesh.points[:, 1] = height[row]
    inner = (row > 6) & (row < 10) & (np.abs(mesh.points[:, 0] - 0.5) < 0.45)
    mesh.points[inner] += np.random.default_rng(1).uniform(-0.03, 0.03, (np.count_nonzero(inner), 2))
    return mesh


def ball():
    mesh = random_mesh("tetra", 0, n=2)
    radius = np.linalg.norm(mesh.points - 0.5, axis=1, keepdims=True)
    size = np.abs(mesh.points - 0.5).max(axis=1, keepdims=True)
    mesh.points[:] = (mesh.points - 0.5) * size / np.where(radius > 0, radius, 1.0)
    return mesh


{"few": few, "all": main, "metis": lambda: with_owners(by_metis)}[sys.argv[1]]()
