"""When to stop: each criterion, which of them comes first, and values that are refused."""

import math

import pytest

from dvr_cli.errors import UsageError
from dvr_cli.relax.stopping import Stopping

GROWING = [0.1, 0.2, 0.3, 0.4]


def test_goes_on_while_nothing_is_met():
    assert Stopping().reason([0.1], 0.0) is None
    assert Stopping().reason(GROWING, 1e9) is None
    assert Stopping(target=0.5, time_limit=10).reason(GROWING, 9.9) is None


@pytest.mark.parametrize(("sweeps", "reason"), [(2, None), (3, "max-iterations"), (4, "max-iterations")])
def test_max_iterations_counts_the_sweeps_done(sweeps, reason):
    assert Stopping(max_iterations=3).reason([0.1 * k for k in range(sweeps + 1)], 0) == reason


def test_no_iterations_at_all():
    assert Stopping(max_iterations=0).reason([0.1], 0) == "max-iterations"


@pytest.mark.parametrize(
    ("history", "reason"),
    [
        ([0.5, 0.5, 0.5], None),  # two sweeps only
        ([0.5, 0.5, 0.5, 0.5], "converged"),
        ([0.1, 0.5, 0.5, 0.5], None),
        ([0.1, 0.5, 0.5, 0.5, 0.5], "converged"),
        ([0.5, 0.5, 0.5, 0.502], None),
        ([0.5, 0.5009, 0.5018, 0.5027], "converged"),  # each by less than tol, together by more
        ([0.5, 0.5, 0.501, 0.501], None),  # tol itself is not less than tol
        ([-0.5, -0.5, -0.5, -0.5], "converged"),
    ],
)
def test_converged_when_q1_grew_by_less_than_tol_in_each_of_the_last_sweeps(history, reason):
    assert Stopping(tol=1e-3 - 1e-12, patience=3).reason(history, 0) == reason


@pytest.mark.parametrize("patience", [1, 2, 5])
def test_patience_is_how_many_sweeps_must_agree(patience):
    stopping = Stopping(patience=patience)
    assert stopping.reason([0.1, *[0.5] * patience], 0) is None
    assert stopping.reason([0.1, *[0.5] * (patience + 1)], 0) == "converged"


def test_without_tolerance_nothing_counts_as_converged():
    assert Stopping(tol=0).reason([0.5] * 20, 0) is None


def test_target_is_met_when_reached():
    assert Stopping(target=0.4).reason(GROWING, 0) == "target"
    assert Stopping(target=math.nextafter(0.4, 1)).reason(GROWING, 0) is None
    assert Stopping(target=0.05).reason([0.1], 0) == "target"  # before the first sweep


def test_time_limit():
    assert Stopping(time_limit=2).reason(GROWING, 2) == "time-limit"
    assert Stopping(time_limit=2).reason(GROWING, 1.99) is None
    assert Stopping(time_limit=0).reason([0.1], 0) == "time-limit"


def test_what_the_mesh_reached_is_named_before_what_ran_out():
    everything = {"target": 0.5, "max_iterations": 3, "time_limit": 1}
    assert Stopping(**everything).reason([0.5] * 4, 5) == "target"
    assert Stopping(**everything | {"target": 0.6}).reason([0.5] * 4, 5) == "converged"
    assert Stopping(**everything).reason(GROWING, 5) == "max-iterations"


@pytest.mark.parametrize(
    ("option", "value"),
    [
        *(("max_iterations", -1), ("patience", 0), ("patience", -3)),
        *(
            (name, value)
            for name in ("tol", "time_limit")
            for value in (-1e-9, -math.inf, math.inf, math.nan)
        ),
        *(("target", value) for value in (1.001, -1.001, math.inf, math.nan)),
    ],
)
def test_values_out_of_range_are_refused_by_name(option, value):
    with pytest.raises(UsageError, match=f"^{option.replace('_', '-')}: "):
        Stopping(**{option: value})
