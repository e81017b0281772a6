"""Interior vertices, against facets counted one by one."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvr_cli.backend import COMPILED, NUMPY
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.interior import enclosed
from dvr_cli.mesh.mesh import Cells
from meshes import KINDS, random_mesh
from needs import require


def counted(blocks, region, n_points):
    """The same by counting how many cells of each region have each facet."""
    has = Counter()
    cell = 0
    used = set()
    for block in blocks:
        for vertices in block.vertices.tolist():
            used |= set(vertices)
            has.update(
                (frozenset(vertices[i] for i in f), int(region[cell])) for f in CELL_TYPES[block.type].facets
            )
            cell += 1
    single = {v for (facet, _), number in has.items() if number % 2 for v in facet}
    return [v in used and v not in single for v in range(n_points)]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("regions", [1, 2])
@pytest.mark.parametrize("backend", [NUMPY, COMPILED])
def test_every_element_type(kind, regions, backend):
    if backend is COMPILED:
        require("numba")
    mesh = random_mesh(kind, 2, n=4)
    n = sum(len(block.vertices) for block in mesh.cells)
    region = np.arange(n) * regions // n
    expected = counted(mesh.cells, region, len(mesh.points))
    assert enclosed(mesh.cells, region, len(mesh.points), backend).tolist() == expected
    assert any(expected)


@pytest.mark.parametrize("backend", [NUMPY, COMPILED])
@given(
    st.integers(0, 2**32), st.integers(1, 3), st.sampled_from([("triangle", 3), ("tetra", 4), ("quad", 4)])
)
def test_any_cells_whatever(backend, seed, regions, kind):
    if backend is COMPILED:
        require("numba")
    name, width = kind
    rng = np.random.default_rng(seed)
    cells = np.array([rng.permutation(6)[:width] for _ in range(rng.integers(1, 30))])
    region = rng.integers(0, regions, len(cells))
    blocks = [Cells(name, cells)]
    assert enclosed(blocks, region, 8, backend).tolist() == counted(blocks, region, 8)


def test_large_meshes_are_cut_and_put_together():
    mesh = random_mesh("tetra", 3, n=16)
    assert len(mesh.cells[0].vertices) > 1 << 14
    inner = ((mesh.points > 1e-9) & (mesh.points < 1 - 1e-9)).all(axis=1)
    region = np.zeros(len(mesh.cells[0].vertices), dtype=int)
    assert enclosed(mesh.cells, region, len(mesh.points)).tolist() == inner.tolist()
