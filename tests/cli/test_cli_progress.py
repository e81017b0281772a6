"""The line of progress: what it says, and what goes first where there is no room for all."""

import pytest

from dvr_cli.cli import progress
from dvr_cli.cli.progress import Known, Progress
from dvr_cli.relax.sweeps import Sweep


@pytest.fixture
def clock(monkeypatch):
    """A clock that is set by hand."""
    now = [0.0]
    monkeypatch.setattr(progress, "perf_counter", lambda: now[0])
    return now


def swept(clock, known=None, seconds=10.0, number=4):
    """The progress after so many sweeps of ten seconds, which began in the second so many."""
    shown = Progress(quiet=False, verbose=False, known=known)
    shown.show("preparing")
    for sweep in range(1, number + 1):
        clock[0] = seconds + 10.0 * sweep
        shown.sweep(Sweep(sweep, "relax", 0.125, 7, 10.0, below=0.0031))
    return shown


def test_it_says_phase_sweep_quality_share_and_time(clock):
    assert swept(clock).pieces(80) == ["relax", "sweep 4", "Q1 0.1250", "0.31 % below care", "0:50"]
    clock[0] = 3599.6
    shown = Progress(quiet=False, verbose=False)
    shown.show("reading a.msh")
    clock[0] += 3600.0
    assert shown.pieces(80) == ["reading a.msh", "1:00:00"]


@pytest.mark.parametrize(
    ("known", "left"),
    [
        (Known(sweeps=10), "0:57 left"),  # six sweeps of ten seconds, of which three have gone
        (Known(sweeps=4), "0:00 left"),
        (Known(time_limit=100.0), "0:57 left at most"),
        (Known(time_limit=100.0, interrupted=lambda: True), None),
        (Known(), None),
    ],
)
def test_the_time_left_is_said_where_it_is_known(known, left, clock):
    shown = swept(clock, known)
    clock[0] += 3.0
    assert [piece for piece in shown.pieces(99) if "left" in piece] == ([] if left is None else [left])


def test_what_matters_least_goes_first(clock):
    shown = swept(clock, Known(time_limit=100.0, compiling=lambda: True))
    everything = shown.pieces(99)
    assert everything[-3:] == ["1:00 left at most", "compiling", "0:50"]
    lines = {"  ".join(shown.pieces(room)) for room in range(5, 99)}
    assert lines == {
        "relax",
        "relax  Q1 0.1250",
        "relax  sweep 4  Q1 0.1250",
        "relax  sweep 4  Q1 0.1250  compiling",
        "relax  sweep 4  Q1 0.1250  1:00 left at most  compiling",
        "relax  sweep 4  Q1 0.1250  0.31 % below care  1:00 left at most  compiling",
        "  ".join(everything),
    }
    for room in range(5, 99):
        assert len("  ".join(shown.pieces(room))) <= room


def test_that_it_was_interrupted_is_said_before_all_else(clock):
    shown = swept(clock, Known(interrupted=lambda: True))
    assert shown.pieces(99)[0] == "interrupted, about to end"
    assert shown.pieces(14) == ["interrupted..."]
