"""What ranks agree on without any of them knowing all: places in one order, and wishes that come true."""

import numpy as np
import pytest

from dvr_cli.distributed.first_come import Wish, first_come
from dvr_cli.distributed.rows import places
from threads import on_threads


@pytest.mark.parametrize("ranks", [1, 2, 5])
@pytest.mark.parametrize("seed", range(4))
def test_places_are_those_of_all_rows_sorted(ranks, seed):
    """Many equal values in the first column, and ranks without any row."""
    rng = np.random.default_rng(seed)
    values, second = rng.integers(0, 9, 60) / 8.0, rng.permutation(60)
    owner = rng.integers(0, max(1, ranks - seed % 2), 60)
    found = on_threads(ranks, lambda comm: places(comm, *(x[owner == comm.rank] for x in (values, second))))
    order = np.lexsort((second, values))
    place = np.empty(60, dtype=int)
    place[order] = np.arange(60)
    for rank in range(ranks):
        assert found[rank].tolist() == place[owner == rank].tolist()


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("seed", range(6))
def test_wishes_come_true_as_if_asked_for_one_after_the_other(ranks, seed):
    """Few things, so that chains of wishes wait for each other, or many, so that most come true."""
    rng = np.random.default_rng(seed)
    things, wishes = 30 * 4 ** (seed % 3), 40
    wanted = [rng.choice(things, size=rng.integers(0, 6), replace=False) for _ in range(wishes)]
    place, owner, home = (
        rng.permutation(wishes),
        rng.integers(0, ranks, wishes),
        rng.integers(0, ranks, things),
    )
    gone, true = set(), set()
    for wish in np.argsort(place).tolist():
        if not gone & set(wanted[wish].tolist()):
            gone |= set(wanted[wish].tolist())
            true.add(wish)
    assert 0 < len(true) < wishes

    def of_rank(comm):
        mine = np.flatnonzero(owner == comm.rank)
        given = first_come(comm, [Wish(int(place[i]), wanted[i], home[wanted[i]]) for i in mine])
        return mine[given].tolist()

    assert {wish for mine in on_threads(ranks, of_rank) for wish in mine} == true
