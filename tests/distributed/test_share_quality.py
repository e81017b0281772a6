"""What ranks say of all their values together, on one rank and against NumPy."""

from types import SimpleNamespace

import numpy as np
import pytest

from dvr_cli.distributed.share_quality import is_at_least, of_rank
from dvr_cli.quality.vector import at_least

ALONE = SimpleNamespace(allreduce=lambda value: value, allgather=lambda value: [value])


@pytest.mark.parametrize("seed", range(20))
def test_vectors_are_compared_as_where_they_are_sorted(seed):
    """Few values, so that vectors differ anywhere, or nowhere; zeros of both signs are one number."""
    rng = np.random.default_rng(seed)
    values = np.array([-1.0, -0.0, 0.0, 1e-300, 0.3, np.nextafter(0.3, 1.0), 1.0])
    a, b = rng.choice(values, (2, rng.integers(1, 5)))
    longer = np.concatenate([np.full(50, 0.1), a]), np.concatenate([b, np.full(50, 0.1)])
    for one, other in (a, b), (b, a), (a, rng.permutation(a)), longer:
        assert is_at_least(ALONE, one, other) == at_least(np.sort(one), np.sort(other))


def test_values_at_places_are_those_of_the_sorted_ones():
    values = np.sort(np.random.default_rng(1).normal(size=101))
    places = np.array([0, 50, 99, 100])
    assert of_rank(ALONE, values, places) == values[places].tolist()
