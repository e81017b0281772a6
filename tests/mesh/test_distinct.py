"""Distinct values and ranks are those that sets and sorted lists give."""

import numpy as np
import pytest

from dvr_cli.mesh.ranks import distinct, ranks

CASES = ([], [7], [3, 1, 3, 2, 1], [-5, 2**62, -5, 0], [0, 255, 0], [4.5, -1.0, 4.5])


@pytest.mark.parametrize("values", CASES, ids=str)
@pytest.mark.parametrize("of", [distinct, ranks])
def test_values_are_told_apart(values, of):
    array = np.array(values)
    known = sorted(set(values))
    wanted = known if of is distinct else [known.index(value) for value in values]
    assert of(array).tolist() == wanted
    if of is distinct:
        assert of(array).dtype == array.dtype
