"""The engine of runs that would have to wait for the compiler: NumPy's first, then the compiled one.

Processes of their own compile meanwhile, and keep the results where the compiled engine finds them. They have
low priority, and end with this process at the latest; what they have compiled until then is kept. Both
engines give the same bytes, so it does not matter when one takes over from the other. First the compiled one
moves the vertices of sweeps; patches and what else backends have twins of follow.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, partial
from threading import Thread
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from dvr_cli.backend import COMPILED, NUMPY, Backend
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.problem import Problem

if TYPE_CHECKING:
    from dvr_cli.relax.patches.solver import Patch

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
MOVES, TWINS = "moves", "twins"  # the kernels of the compiled engine itself, and those of its backend
_HALVES = MOVES, TWINS  # the order in which a run uses them
_CORES = 3  # from which the halves are compiled at the same time, as NumPy takes one
_COMPILE = "import sys; sys.path[:] = {}; from dvr_cli.api.warming import compile_for; compile_for(*{!r})"


class Compiling:
    """A process that compiles kernels for meshes of one sort; done: those halves of them that it has."""

    def __init__(self, sort: str, halves: tuple[str, ...] = _HALVES) -> None:
        """Start it; sort: see ``warming.SORTS``. It ends when the pipe to it is closed."""
        self.done: set[str] = set()
        command = [sys.executable, "-c", _COMPILE.format(sys.path, (sort, *halves))]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        self._process = subprocess.Popen(command, **pipes)  # type: ignore[call-overload]
        self._listener = Thread(target=self._listen, args=(len(halves),), daemon=True)
        self._listener.start()

    @property
    def is_running(self) -> bool:
        """True until it is done, or has failed."""
        return self._listener.is_alive()

    def _listen(self, lines: int) -> None:
        for _ in range(lines):
            self.done.add(self._process.stdout.readline().decode().strip())


_started: dict[str, list[Compiling]] = {}  # by sort of meshes


def compiling(sort: str, cores: int) -> list[Compiling]:
    """The processes that compile for meshes of a sort, started when first asked for and possible.

    cores: how many this process and they are to use.
    """
    if sort not in _started:
        _started[sort] = []
        for halves in [_HALVES] if cores < _CORES else [(half,) for half in _HALVES]:
            with suppress(OSError):  # no more processes or memory: NumPy does it all
                _started[sort].append(Compiling(sort, halves))
    return _started[sort]


def is_under_way() -> bool:
    """True while a process compiles."""
    return any(process.is_running for processes in _started.values() for process in processes)


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
        self._in_part = False  # whether compiled code has done anything
        self._compiling = compiling(sort_of(problem), threads)
        self.backend = NUMPY
        self._take(NumpyEngine(problem))

    def hand_over(self) -> bool:
        if self.backend is COMPILED or not self._is_compiled(MOVES):
            return False
        from dvr_cli.relax.engines.numba_engine import NumbaEngine

        ready = COMPILED if self._is_compiled(TWINS) else NUMPY
        if isinstance(self._engine, NumbaEngine):
            self.backend = ready
            return ready is COMPILED
        points = self._get()
        self.backend, self._in_part = ready, True
        self._take(NumbaEngine(self.problem, self._threads))
        self._set(points)
        return True

    @property
    def turns(self) -> str:
        """As in Engine; compiled code works in part until all of it is there, and has taken over."""
        if self.backend is COMPILED:
            return "numpy, then numba"
        return "numpy, then numba in part" if self._in_part else "numpy"

    def _is_compiled(self, half: str) -> bool:
        return any(half in process.done for process in self._compiling)

    def focused(self, active: np.ndarray) -> tuple[Engine, np.ndarray | None]:
        """As in Engine, from when nothing is handed over any more."""
        return super().focused(active) if self.backend is COMPILED else (self, active)

    def _over(self, problem: Problem) -> Engine:
        return self._engine._over(problem)

    def _solver(self, points: np.ndarray, backend: Backend) -> Callable[[Patch], tuple[float, float]]:
        solve = super()._solver(points, backend)
        if backend is COMPILED:
            return solve
        quicker = cache(partial(super()._solver, points, COMPILED))

        def solve_by_either(patch: Patch) -> tuple[float, float]:
            if not self._is_compiled(TWINS):
                return solve(patch)
            self._in_part = True  # it takes over within a round, too
            return quicker()(patch)

        return solve_by_either

    def _take(self, engine: Engine) -> None:
        self._engine, self.threads = engine, engine.threads
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
        def quiet(a: int, b: int) -> Any:  # what other threads report is not silenced by this one
            with np.errstate(all="ignore"):
                return work(a, b)

        return self._engine._in_parts(work if self.backend is COMPILED else quiet, lo, hi, least)

    def _each(self, work: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
        if self.backend is COMPILED:
            return self._engine._each(work, items)
        return super()._each(work, items)  # threads of NumPy would only wait for each other
