"""The relaxation problem: rows of many targets are stored as a sweep reads them."""

import numpy as np
import pytest

from dvr_cli.api.shapes import shaped
from dvr_cli.mesh.domain import domain_of
from dvr_cli.relax import problem
from dvr_cli.relax.problem import build_problem
from meshes import random_mesh


@pytest.mark.parametrize("kind", ["triangle", "tetra", "mixed3d"])
def test_rows_lie_in_the_order_of_a_sweep_and_say_the_same(kind, monkeypatch):
    domain = shaped(domain_of(random_mesh(kind, 2)), "input").domain
    relaxed = np.flatnonzero(domain.interior)
    monkeypatch.setattr(problem, "_FEW_ROWS", 10**9)
    plain = build_problem(domain.corners, relaxed, domain.points)
    monkeypatch.setattr(problem, "_FEW_ROWS", 0)
    ordered = build_problem(domain.corners, relaxed, domain.points)
    for one, other in ((plain.rings, ordered.rings), (plain.touched, ordered.touched)):
        before, after = plain.touched.table.matrices, ordered.touched.table.matrices
        assert after[other.shapes].tobytes() == before[one.shapes].tobytes()
    named, count = np.unique(ordered.rings.shapes, return_counts=True)
    once = ordered.rings.shapes[np.isin(ordered.rings.shapes, named[count == 1])]
    assert len(once) > 0
    assert (np.diff(once) == 1).all()
    assert len(ordered.touched.table.norm) <= len(plain.touched.table.norm)
