"""Runs begin with NumPy's engine where kernels have to be compiled, and the compiled one takes over."""

import subprocess
import time

import numpy as np
import pytest

from dvr_cli.api.morphing import morph_mesh
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.api.warming import SORTS
from dvr_cli.relax.engines import choice, handover
from dvr_cli.relax.engines.handover import MOVES, TWINS
from dvr_cli.relax.stopping import Stopping
from meshes import random_mesh
from needs import require

require("numba")


class Countdown:
    """Kernels that are compiled when they have been asked for so many times, the second half later."""

    def __init__(self, left, later=0):
        self.left, self.later = left, later

    @property
    def done(self):
        self.left -= 1
        halves = {MOVES} if self.left < 0 else set()
        return halves | {TWINS} if self.is_complete else halves

    @property
    def is_complete(self):
        return self.left + self.later < 0


def settings(**options):
    """The options of a run of few sweeps."""
    return SmoothOptions(seed=3, stopping=Stopping(4), **options)


def smoothed(mesh, monkeypatch, asked, on_sweep=None, later=0, **options):
    """Points and report of a run whose kernels are there after so many batches, and the countdown."""
    countdown, sorts = Countdown(asked, later), []
    monkeypatch.setattr(choice, "_are_compiled", lambda *_: False)
    monkeypatch.setattr(choice, "_REPAYS_STARTING", 0)
    monkeypatch.setattr(handover, "compiling", lambda sort, _: sorts.append(sort) or [countdown])
    hook = None if on_sweep is None else lambda sweep: on_sweep(sweep, countdown)
    points, report = smooth_mesh(mesh, settings(threads=2, **options), on_sweep=hook)
    assert set(sorts) <= set(SORTS)
    return points, report, countdown


@pytest.mark.parametrize("kind", ["tetra", "triangle", "hexahedron"])
def test_it_does_not_matter_when_the_compiled_engine_takes_over(kind, monkeypatch):
    mesh, many, places = random_mesh(kind, 5, n=4), 10**6, {}
    expected, alone = smooth_mesh(mesh, settings(engine="numpy"))
    assert not np.array_equal(expected, mesh.points)

    def record(sweep, countdown):
        places.setdefault(sweep.phase, many - countdown.left)

    points, report, countdown = smoothed(mesh, monkeypatch, many, record)
    assert (report.engine, alone.engine) == ("numpy", "numpy")
    np.testing.assert_array_equal(points, expected)
    assert {"descent", "relax", "patches"} <= set(places)  # each asks
    for asked in (0, 5, *places.values()):
        points, report, countdown = smoothed(mesh, monkeypatch, asked)
        assert report.engine == ("numpy, then numba" if countdown.left < 0 else "numpy")
        np.testing.assert_array_equal(points, expected)
        assert [s["q1"] for s in report.sweeps] == [s["q1"] for s in alone.sweeps]
    assert smoothed(mesh, monkeypatch, 0)[1].threads == 2
    for later in (3, places["patches"] + 3, many):  # sweeps are quick sooner than patches are
        points, report, countdown = smoothed(mesh, monkeypatch, 3, later=later)
        assert report.engine == "numpy, then numba" + " in part" * (not countdown.is_complete)
        assert (report.threads, later == many) == (2, not countdown.is_complete)
        np.testing.assert_array_equal(points, expected)
        assert [s["q1"] for s in report.sweeps] == [s["q1"] for s in alone.sweeps]


def test_patches_that_are_compiled_first_are_reported(monkeypatch):
    mesh = random_mesh("tetra", 5, n=4)
    expected, _ = smooth_mesh(mesh, settings(engine="numpy"))
    monkeypatch.setattr(Countdown, "done", {TWINS})
    points, report, _ = smoothed(mesh, monkeypatch, 0)
    assert report.engine == "numpy, then numba in part"
    np.testing.assert_array_equal(points, expected)


def test_vertices_that_walk_go_on_from_where_they_are(monkeypatch):
    mesh, options = SORTS["curved boundaries"]()
    expected, _ = smooth_mesh(mesh, settings(engine="numpy", **options))
    for later in (0, 10):
        points, report, _ = smoothed(mesh, monkeypatch, 10, later=later, **options)
        assert report.engine == "numpy, then numba"
        np.testing.assert_array_equal(points, expected)


def test_morphs_and_the_steps_of_a_relaxer_are_handed_over_too(monkeypatch):
    mesh = random_mesh("tetra", 5, n=4)
    shift = 0.05 * mesh.points[:, ::-1] ** 2
    expected, _ = morph_mesh(mesh, shift, settings(engine="numpy"))
    monkeypatch.setattr(choice, "_are_compiled", lambda *_: False)
    monkeypatch.setattr(choice, "_REPAYS_STARTING", 0)
    for asked, engine in ((3, "numpy, then numba"), (10**6, "numpy")):
        countdown = Countdown(asked)
        monkeypatch.setattr(handover, "compiling", lambda *_, countdown=countdown: [countdown])
        points, report = morph_mesh(mesh, shift, settings(threads=2))
        np.testing.assert_array_equal(points, expected)
        assert (report.engine, report.threads) == (engine, 1 if engine == "numpy" else 2)


def test_a_run_goes_on_alone_if_no_process_can_be_started(monkeypatch):
    def refused(*args, **options):
        raise OSError("no more processes")

    monkeypatch.setattr(subprocess, "Popen", refused)
    monkeypatch.setattr(handover, "_started", {})
    assert handover.compiling("tetrahedra", 2) == []
    assert not choice.is_compiling()
    monkeypatch.setattr(handover, "compiling", lambda *_: [])
    monkeypatch.setattr(choice, "_are_compiled", lambda *_: False)
    monkeypatch.setattr(choice, "_REPAYS_STARTING", 0)
    mesh = random_mesh("tetra", 5)
    assert smooth_mesh(mesh, settings())[1].engine == "numpy"


def until(holds):
    """Wait for what another process does."""
    end = time.monotonic() + 600
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("said", "halves"),
    [
        ("print('moves', flush=True); print('twins', flush=True)", {MOVES, TWINS}),
        ("print('moves', flush=True); 1 / 0", {MOVES}),
        ("print('Moves')", set()),
        ("1 / 0", set()),
    ],
)
def test_the_other_process_says_what_it_has_done_and_ends_with_its_pipe(said, halves, monkeypatch):
    monkeypatch.setattr(handover, "_COMPILE", f"import sys; {{}}; {{!r}}; {said}; sys.stdin.buffer.read()")
    monkeypatch.setattr(handover, "_started", {})
    (compiling,) = handover.compiling("tetrahedra", 2)
    assert handover.compiling("tetrahedra", 2) == [compiling]
    if halves == {MOVES, TWINS}:
        until(lambda: compiling.done == halves)
        assert compiling._process.poll() is None
    elif not halves:
        assert choice.is_compiling()
    compiling._process.stdin.close()
    compiling._process.wait(600)
    compiling._listener.join(600)
    assert compiling.done & {MOVES, TWINS} == halves
    assert not choice.is_compiling()


def test_on_three_cores_the_halves_are_compiled_at_once(monkeypatch):
    monkeypatch.setattr(handover, "_COMPILE", "{} and 0; print({!r}[1], flush=True)")
    monkeypatch.setattr(handover, "_started", {})
    compiling = handover.compiling("tetrahedra", 3)
    for process in compiling:
        process._listener.join(600)
        process._process.wait(600)
    assert [process.done for process in compiling] == [{MOVES}, {TWINS}]


@pytest.mark.long
def test_the_process_that_compiles_does_so_and_ends_when_it_is_no_longer_wanted():
    compiling = handover.Compiling("planar meshes")
    end = time.monotonic() + 300
    while compiling.is_running and time.monotonic() < end:
        time.sleep(0.1)
    assert compiling.done == {MOVES, TWINS}
    compiling._process.stdin.close()
    assert compiling._process.wait(600) == 0
