"""Index arithmetic on rows of unequal length, against plain Python lists."""

from itertools import chain, pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dvr_cli.mesh.csr import group, row_entries


@given(st.lists(st.integers(0, 4), min_size=1), st.data())
def test_row_entries_are_those_of_the_rows_one_after_the_other(lengths, data):
    rows = data.draw(st.lists(st.integers(0, len(lengths) - 1)))
    start = np.concatenate([[0], np.cumsum(lengths)])
    entries, begin = row_entries(start, np.array(rows, dtype=np.int64))
    expected = [list(range(start[row], start[row + 1])) for row in rows]
    assert entries.tolist() == list(chain.from_iterable(expected))
    assert [entries[lo:hi].tolist() for lo, hi in pairwise(begin)] == expected


@given(st.lists(st.integers(-2, 6)), st.integers(7, 9))
def test_group_collects_the_positions_of_each_key(keys, n):
    positions, start = group(np.array(keys, dtype=np.int32), n)
    groups = [positions[lo:hi].tolist() for lo, hi in pairwise(start)]
    assert groups == [[i for i, key in enumerate(keys) if key == value] for value in range(n)]
