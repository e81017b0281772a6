"""Quiet rings are passed over, and the result is the same to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from curved_parts import wavy
from dvr_cli.api.boundary import moves_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.quiet import Quiet
from dvr_cli.relax.steepest import NARROWING


def engine_of() -> NumpyEngine:
    """A sheet whose inner vertices walk."""
    mesh = wavy(2, 3)
    domain = domain_of(mesh)
    moves = moves_of(mesh, domain, "project", np.ones(len(mesh.points), dtype=bool), 60.0)
    problem = build_problem(domain.corners, moves.relaxed, domain.points, parts=moves.parts)
    engine = NumpyEngine(problem.keeping_within(0.002))
    engine.load(domain.points)
    return engine


@pytest.mark.parametrize("polishing", [False, True])
def test_the_result_is_that_of_visiting_all(polishing):
    plain, sparing = engine_of(), engine_of()
    quiet, passed_over = Quiet(sparing), 0
    for _ in range(6):
        for batch in range(plain.batches):
            visited = quiet.awake(batch, None)
            lo, hi = plain.problem.batch_start[batch : batch + 2]
            passed_over += int((~visited[lo:hi]).sum())
            if polishing:
                moved = plain.polish_batch(batch, plain.mean_ascent(batch), np.inf)
                assert (
                    sparing.polish_batch(batch, sparing.mean_ascent(batch, active=visited), np.inf) == moved
                )
            else:
                moved = plain.move_batch(batch, NARROWING)
                assert sparing.move_batch(batch, NARROWING, visited) == moved
            quiet.note(batch, visited)
            assert np.array_equal(plain.points, sparing.points)
    assert passed_over > 0
