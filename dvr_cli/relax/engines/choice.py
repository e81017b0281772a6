"""Which engine to take."""

from __future__ import annotations

import os
from importlib.util import find_spec

from dvr_cli.errors import UsageError
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.problem import Problem

ENGINES = ("auto", "numpy", "numba")

# Loading numba and its cached kernels takes as long as this many vertex updates of the NumPy engine
# (benchmarks/engines.py); runs converge in some twenty sweeps.
_REPAYS = 100_000
_USUAL_SWEEPS = 20
_PATCHES = 650  # sweeps of NumPy that patches cost as much as


def has_numba() -> bool:
    """Whether the compiled engine is installed."""
    return find_spec("numba") is not None


def chosen_engine(name: str, vertices: int, max_iterations: int, patches: bool = False) -> str:
    """The engine called ``name``, "auto" being the faster of "numpy" and "numba" for the work ahead.

    vertices: how many the mesh has. patches: whether patches are to be relaxed as well. Raises UsageError for
    an engine that is unknown or not installed.
    """
    if name not in ENGINES:
        raise UsageError(f"engine: unknown {name!r}; known: {', '.join(ENGINES)}")
    if name == "numba" and not has_numba():
        raise UsageError("engine numba: numba is not installed (pip install 'dvr-cli[fast]')")
    if name != "auto":
        return name
    work = vertices * (min(max_iterations, _USUAL_SWEEPS) + (_PATCHES if patches else 0))
    return "numba" if work > _REPAYS and has_numba() else "numpy"


def checked_threads(threads: int | None) -> int:
    """``threads``, by default as many as there are cores for this process; UsageError below 1."""
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if threads < 1:
        raise UsageError("threads: must be at least 1")
    return threads


def make_engine(name: str, problem: Problem, threads: int) -> Engine:
    """The engine ``name`` ("numpy" or "numba") for a problem; the NumPy engine uses one thread."""
    if name == "numba":
        from dvr_cli.relax.engines.numba_engine import NumbaEngine

        return NumbaEngine(problem, threads)
    from dvr_cli.relax.engines.numpy_engine import NumpyEngine

    return NumpyEngine(problem)
