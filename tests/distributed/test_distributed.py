"""Meshes that are distributed already: bit for bit what one process makes of the whole, see ``pieces``."""

import pytest

from needs import require


@pytest.mark.parametrize(
    ("ranks", "which"), [(3, "few"), *(pytest.param(n, "all", marks=pytest.mark.long) for n in (2, 4))]
)
def test_pieces_come_out_as_from_the_whole(on_ranks, ranks, which):
    done = on_ranks(ranks, "pieces.py", which)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.long
def test_parts_may_be_those_of_metis(on_ranks):
    require("pymetis")
    done = on_ranks(3, "pieces.py", "metis")
    assert (done.returncode, done.stderr) == (0, "")
