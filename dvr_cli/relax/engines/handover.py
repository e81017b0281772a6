"""The engine of runs that would have to wait for the compiler: NumPy's first, then the compiled one.

A process of its own compiles meanwhile, and keeps the results where the compiled engine finds them. It has
low priority, and ends with this process at the latest; what it has compiled until then is kept. Both engines
give the same bytes, so it does not matter when one takes over from the other.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from threading import Thread
from typing import Any, TypeVar

import numpy as np

from dvr_cli.backend import COMPILED
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.problem import Problem

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
READY = b"ready"  # the line by which the other process says that all is compiled
_COMPILE = "import sys; sys.path[:] = {}; from dvr_cli.api.warming import compile_for; compile_for({!r})"


class Compiling:
    """A process that compiles the kernels for meshes of one sort; is_done: whether it has."""

    def __init__(self, sort: str) -> None:
        """Start it; sort: see ``warming.SORTS``. It ends when the pipe to it is closed."""
        self.is_done = False
        command = [sys.executable, "-c", _COMPILE.format(sys.path, sort)]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        self._process = subprocess.Popen(command, **pipes)  # type: ignore[call-overload]
        self._listener = Thread(target=self._listen, daemon=True)
        self._listener.start()

    @property
    def is_running(self) -> bool:
        """True until it is done, or has failed."""
        return self._listener.is_alive()

    def _listen(self) -> None:
        self.is_done = self._process.stdout.readline().strip() == READY


_started: dict[str, Compiling | None] = {}  # by sort of meshes


def compiling(sort: str) -> Compiling | None:
    """The process that compiles for meshes of a sort, started when first asked for; None if it cannot be."""
    if sort not in _started:
        try:
            _started[sort] = Compiling(sort)
        except OSError:  # no more processes or memory: NumPy does it all
            _started[sort] = None
    return _started[sort]


def is_under_way() -> bool:
    """True while a process compiles."""
    return any(process is not None and process.is_running for process in _started.values())


def sort_of(problem: Problem) -> str:
    """The sort of meshes that a problem's kernels are compiled by, one of ``warming.SORTS``."""
    place = " in a plane" if problem.components == 2 else ""
    if problem.is_surface:
        return "surfaces"
    if problem.carriers is not None:
        return "curved boundaries" + place
    if len(problem.touched.table.factor):
        return "metrics" + place
    if place:
        return "planar meshes"
    return "cells of other types" if problem.touched.shapes.any() else "tetrahedra"


class HandoverEngine(Engine):
    """Does all by one of the other two engines: by the compiled one from when its kernels are ready."""

    def __init__(self, problem: Problem, threads: int) -> None:
        """threads: of the compiled engine, at most."""
        super().__init__(problem)
        self._threads = threads
        self._compiling = compiling(sort_of(problem))
        self._take(NumpyEngine(problem))

    def hand_over(self) -> bool:
        if self.backend is COMPILED or self._compiling is None or not self._compiling.is_done:
            return False
        from dvr_cli.relax.engines.numba_engine import NumbaEngine

        points = self._get()
        self._take(NumbaEngine(self.problem, self._threads))
        self._set(points)
        return True

    def focused(self, active: np.ndarray) -> tuple[Engine, np.ndarray | None]:
        """As in Engine, from when nothing is handed over any more."""
        return super().focused(active) if self.backend is COMPILED else (self, active)

    def _over(self, problem: Problem) -> Engine:
        return self._engine._over(problem)

    def _take(self, engine: Engine) -> None:
        self._engine, self.backend, self.threads = engine, engine.backend, engine.threads
        engine._directions = self._directions

    def qualities(self) -> np.ndarray:
        return super().qualities() if self.problem.is_surface else self._engine.qualities()

    def _set(self, points: np.ndarray) -> None:
        self._engine._set(points)

    def _get(self) -> np.ndarray:
        return self._engine._get()

    def _relax(self, batch: int, lo: int, hi: int, directions: np.ndarray, enough: float) -> int:
        return self._engine._relax(batch, lo, hi, directions, enough)

    def _steepest(self, batch: int, lo: int, hi: int, band: float, active: np.ndarray) -> None:
        self._engine._steepest(batch, lo, hi, band, active)

    def _polish(self, batch: int, lo: int, hi: int, limit: float, aim: Aim, active: np.ndarray) -> int:
        return self._engine._polish(batch, lo, hi, limit, aim, active)

    def _worst_corner(self) -> tuple[int, float]:
        return self._engine._worst_corner()

    def _in_parts(self, work: Callable[[int, int], Any], lo: int, hi: int, least: int = 1) -> list[Any]:
        return self._engine._in_parts(work, lo, hi, least)

    def _each(self, work: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
        return self._engine._each(work, items)
