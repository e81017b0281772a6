"""Layers of a mesh that no rank has whole: a rank's own cells tell whether there may be any."""

import numpy as np
import pytest
from test_store import store_on

from dvr_cli.backend import NUMPY
from dvr_cli.distributed import layers
from dvr_cli.mesh.domain import domain_of
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.stretching import coherent, stretched_among
from meshes import boxes_of
from threads import on_threads


def flattened(width, height):
    """A box of tetrahedra that are flat near one of its edges."""
    mesh = boxes_of("tetra", 8)
    x, y, z = mesh.points.T
    mesh.points[:, 2] = z * np.where((x < width) & (y < width), height, 1.0)
    return mesh


@pytest.mark.parametrize("few", [0, 10**9], ids=["around some", "all"])
@pytest.mark.parametrize(("width", "height", "kept"), [(0.4, 0.05, True), (0.05, 0.2, False)])
def test_ranks_find_out_whether_there_may_be_layers(width, height, kept, few, monkeypatch):
    """Some ranks have stretched vertices, others none; cells around these tell whether there is a seed."""
    mesh = flattened(width, height)
    assert (coherent(domain_of(mesh)) is not None) == kept
    monkeypatch.setattr(layers, "_FEW", few)

    def found(comm):
        store = store_on(comm, mesh)
        local = store.local(store.cells, store.lower)
        domain = domain_of(local.mesh, backend=NUMPY)
        quality = corner_qualities(domain.points, domain.corners)
        stretched = stretched_among(domain, store.owner(local.number) == comm.rank, quality)
        return stretched.any(), layers.may_have_layers(comm, store, local, domain, None, quality)

    stretched, may_have = zip(*on_threads(8, found), strict=True)
    assert 0 < sum(stretched) < 8
    assert set(may_have) == {kept or few > 0}
