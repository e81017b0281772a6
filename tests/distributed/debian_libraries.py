"""A job of several ranks: a block of docs/distributed.md on a mesh that its library has distributed.

mpiexec -n 3 python debian_libraries.py with_dolfinx.py|with_petsc.py

The coordinates have to be, bit for bit, those that one process makes of the whole mesh. Libraries are those
of Debian, with their own Python, NumPy and Open MPI.
"""

import re
import sys
from itertools import permutations
from pathlib import Path

import numpy as np
from mpi4py import MPI

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

import dvr_cli  # noqa: E402

COMM = MPI.COMM_WORLD


def shaken(points):
    """Points of the unit cube, those inside moved by what their own coordinates say."""
    inside = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    return points + 0.03 * inside[:, None] * np.sin(1e3 * points[:, [1, 2, 0]])


def grid(n):
    """(n + 1)³ points of the unit cube and six tetrahedra in each of its n³ small cubes."""
    index = np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)
    ways = np.cumsum([np.eye(4, 3, -1, dtype=int)[:, list(axes)] for axes in permutations(range(3))], axis=1)
    low = np.argwhere(index[:-1, :-1, :-1] >= 0)
    corners = low[:, None, None] + ways[None]
    return np.argwhere(index >= 0) / n, index[tuple(np.moveaxis(corners, -1, 0))].reshape(-1, 4)


class Dolfinx:
    """Tetrahedra of a cube."""

    def __init__(self):
        import dolfinx

        self.mesh = dolfinx.mesh.create_unit_cube(COMM, 4, 4, 4)
        self.mesh.geometry.x[:] = shaken(self.mesh.geometry.x)
        self.names = {"mesh": self.mesh}

    def part(self):
        """Coordinates of all vertices of the rank, their ids; its own cells, by ids, and theirs."""
        geometry, topology = self.mesh.geometry, self.mesh.topology
        owned = topology.index_map(3).size_local
        ids = np.array(geometry.input_global_indices)
        cells = ids[geometry.dofmap.array.reshape(-1, 4)[:owned]]
        return geometry.x.copy(), ids, cells, np.array(topology.original_cell_index[:owned])


class PETSc:
    """The same of a DMPlex."""

    def __init__(self):
        from petsc4py import PETSc

        points, cells = grid(4) if COMM.rank == 0 else (np.empty((0, 3)), np.empty((0, 4), dtype=int))
        self.dm = PETSc.DMPlex().createFromCellList(3, cells.astype(PETSc.IntType), points, comm=COMM)
        self.dm.distribute()
        local = self.dm.getCoordinatesLocal()
        local.array[:] = shaken(local.array.reshape(-1, 3)).ravel()
        self.dm.setCoordinatesLocal(local)
        self.names = {"dm": self.dm}

    def part(self):
        """See ``Dolfinx``; the other way round than in the document: from the cells' own coordinates."""
        dm, section = self.dm, self.dm.getCoordinateSection()
        first, last = dm.getDepthStratum(0)
        array = dm.getCoordinatesLocal().array
        points = np.array(
            [array[section.getOffset(v) : section.getOffset(v) + 3] for v in range(first, last)]
        )
        ids = dm.getVertexNumbering().getIndices()
        numbers = dm.getCellNumbering().getIndices()
        begin, _ = dm.getHeightStratum(0)
        ids, own = np.where(ids < 0, -1 - ids, ids), np.flatnonzero(numbers >= 0)
        rings = [dm.getTransitiveClosure(begin + cell)[0] for cell in own]
        cells = [[ids[p - first] for p in ring if first <= p < last] for ring in rings]
        return points, ids, np.array(cells).reshape(-1, 4), numbers[own]


def whole(part):
    """The whole mesh, on every rank: points and cells, each in the order of their ids."""
    points, ids, cells, numbers = (np.concatenate(rows) for rows in zip(*COMM.allgather(part), strict=True))
    kept, first = np.unique(ids, return_index=True)
    for vertex, point in zip(ids.tolist(), points, strict=True):  # what ranks share is the same on all
        assert np.array_equal(points[first[np.searchsorted(kept, vertex)]], point)
    return points[first], np.searchsorted(kept, cells)[np.argsort(numbers)]


def main(name):
    """Run the block on the library's mesh and compare."""
    library = {"with_dolfinx.py": Dolfinx, "with_petsc.py": PETSc}[name]()
    text = (ROOT / "docs/distributed.md").read_text("utf-8")
    pattern = rf'^```python title="{re.escape(name)}"\n(.*?)^```$'
    (code,) = re.findall(pattern, text, re.MULTILINE | re.DOTALL)
    # the page says what to write before dolfinx 0.8
    code = code.replace("geometry.dofmap[", "geometry.dofmap.array.reshape(-1, 4)[")
    points, cells = whole(library.part())
    exec(code, {"dvr_cli": dvr_cli, "np": np, **library.names})
    expected, _ = dvr_cli.smooth(points, {"tetra": cells})
    assert not np.array_equal(expected, points)
    assert np.array_equal(whole(library.part())[0], expected)


main(sys.argv[1])
