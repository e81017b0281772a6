"""Connected parts that wind through many ranks, and what adds up in each."""

import numpy as np
import pytest

from dvr_cli.distributed.labels import labels_of_parts, sums_of_parts
from dvr_cli.mesh.orientation import connected_parts
from threads import on_threads


@pytest.mark.parametrize("ranks", [1, 2, 5])
@pytest.mark.parametrize("width", [1, 2])
def test_parts_and_their_sums_are_those_of_the_whole(ranks, width):
    """Chains of things, in no order, so that most of their links lead from one rank to another."""
    rng = np.random.default_rng(ranks)
    n = 80
    owner, weight = rng.integers(0, ranks, n), rng.integers(1, 9, n) / 8.0
    chains = np.split(rng.permutation(n), [1, 20, 70])
    edges = np.concatenate([np.stack([chain[:-1], chain[1:]], axis=1) for chain in chains])
    side = rng.integers(0, width, (2, len(edges)))
    one, other = width * edges.T + side
    label = connected_parts(width * n, one, other).reshape(n, width)
    total = np.bincount(label[:, 0], weight, width * n)[label[:, 0]]
    assert len(np.unique(total)) > 2

    def of_rank(comm):
        mine = (owner[edges] == comm.rank).any(axis=1)
        ids = np.union1d(np.flatnonzero(owner == comm.rank), edges[mine])
        place = np.zeros(n, dtype=np.int64)
        place[ids] = np.arange(len(ids))
        tail, head = width * place[edges[mine]].T + side[:, mine]
        found = labels_of_parts(comm, ids, owner[ids], tail, head, width)
        (sums,) = sums_of_parts(comm, found[:, 0], owner[ids] == comm.rank, weight[ids])
        assert (found == label[ids]).all()
        assert (sums == total[ids]).all()
        return len(ids)

    assert sum(on_threads(ranks, of_rank)) >= n
