"""The kinds of engine, and the choice among them."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from dvr_cli.backend import COMPILED, NUMPY, Backend
from dvr_cli.errors import UsageError
from dvr_cli.kept import may_be_kept
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.problem import Problem

# Loading numba and its cached kernels takes as long as this many vertex updates of the NumPy engine
# (benchmarks/engines.py); runs converge in some twenty sweeps. Once they are loaded they are faster anywhere.
_REPAYS = 100_000
_REPAYS_COMPILING = 2_000_000  # the same where the kernels have to be compiled first
_USUAL_SWEEPS = 20
_PATCHES = 2000  # sweeps of NumPy that patches cost as much as
# Kernels that all runs of a sort compile, by folder of ``relax``, some of which set the run up; there is one
# of each name for each kind of mesh, "2d" or "3d", of some another one in a metric or on a surface. Surfaces
# need those of "surface" alone.
_KERNELS = {
    ".": (
        "mesh.rings_numba.rings",
        "quality.badness_numba.worst_corner_{kind}{metric}",
        "quality.mean_ratio_numba.corner_terms_{kind}",
        "quality.stretching_numba._allowed_by_quality_{kind}",
        "relax.enough_numba.relax_rings_{kind}{metric}",
        "relax.newton_numba.polish_rings_{kind}{metric}",
    ),
    "patches": (
        "relax.patches.neighbourhoods_numba.choose",
        "relax.patches.solver_numba.solve_patch_{kind}{metric}",
    ),
    "surface": (
        "mesh.rings_numba.rings",
        "relax.surface.walk.walk_directions_{kind}{metric}{surface}",
        "relax.surface.walk.walk_rings_{kind}{metric}{surface}",
    ),
}
_REPAYS_STARTING = 600_000  # the same where another process compiles them meanwhile
_WALK = 500  # updates of NumPy that one on a curved boundary or surface costs as much as
_WALKS_MEANWHILE = 20_000  # vertices that walk at most while another process compiles: a batch has to end


class MeshKind(NamedTuple):
    """A kind of mesh, of which kernels are compiled apart.

    planar: whether it lies in a plane. measured: whether shapes are in a metric. surface: whether its cells
    are those of a surface in space.
    """

    planar: bool = False
    measured: bool = False
    surface: bool = False


IN_SPACE = MeshKind()  # a volume whose shapes are in no metric


@dataclass(frozen=True)
class EngineKind:
    """An engine that can be had.

    name: as ``--engine`` takes it. backend: what computes in it; several may share one. maker: its class, as
    module and name. package: what has to be installed beside the package's own requirements, None for
    nothing. threaded: whether it uses several threads.
    """

    name: str
    backend: Backend
    maker: tuple[str, str]
    package: str | None = None
    threaded: bool = False

    @property
    def is_installed(self) -> bool:
        """True if what it needs is there."""
        return self.package is None or find_spec(self.package) is not None

    @property
    def is_loaded(self) -> bool:
        """True if an engine of this kind has been used in this process."""
        return self.maker[0] in sys.modules

    def threads(self, asked: int | None) -> int:
        """The number of threads it uses when ``asked`` are wanted; see ``thread_count``."""
        return thread_count(asked) if self.threaded else 1

    def name_of(self, engine: Engine) -> str:
        """The name of an engine of this kind in reports, or the names of those that took turns."""
        return engine.turns or self.name

    def make(self, problem: Problem, threads: int | None) -> Engine:
        """The engine for a problem; threads: at most, None for all cores."""
        module, name = self.maker
        return getattr(import_module(module), name)(problem, self.threads(threads))


_FOLDER = "dvr_cli.relax.engines."
KINDS = {
    kind.name: kind
    for kind in (
        EngineKind("numpy", NUMPY, (_FOLDER + "numpy_engine", "NumpyEngine")),
        EngineKind(
            "numba", COMPILED, (_FOLDER + "numba_engine", "NumbaEngine"), package="numba", threaded=True
        ),
    )
}
# Set up by NumPy, swept by NumPy until another process has compiled the kernels; nobody asks for it by name.
_HANDOVER = EngineKind("", NUMPY, (_FOLDER + "handover", "HandoverEngine"), package="numba", threaded=True)


def _starts_python() -> bool:
    """True if ``sys.executable`` starts Python; a program that embeds it may name itself there."""
    return Path(sys.executable or "").name.lower().startswith("python")


def has_numba() -> bool:
    """True if the compiled engine is installed."""
    return KINDS["numba"].is_installed


def is_compiling() -> bool:
    """True while NumPy sweeps because another process still compiles the kernels."""
    if not _HANDOVER.is_loaded:
        return False
    from dvr_cli.relax.engines.handover import is_under_way

    return is_under_way()


def _are_compiled(folders: Sequence[str], mesh: MeshKind) -> bool:
    """False if it is certain that kernels in these folders of ``relax`` have to be compiled first."""
    names = {
        "kind": "2d" if mesh.planar else "3d",
        "metric": "_metric" * mesh.measured,
        "surface": "_surface" * mesh.surface,
    }
    kernels = [kernel for folder in folders for kernel in _KERNELS[folder]]
    return all(may_be_kept(kernel.format(**names)) for kernel in kernels)


def choose_engine(
    name: str,
    vertices: int,
    max_iterations: int,
    patches: bool = False,
    walking: int = 0,
    meanwhile: bool = False,
    mesh: MeshKind = IN_SPACE,
) -> EngineKind:
    """The engine called ``name``, "auto" being the fastest for the work ahead.

    vertices: how many the mesh has. patches: whether patches are to be relaxed as well. walking: how many of
    the vertices walk on curved boundaries or surfaces. meanwhile: whether a process of its own may compile
    what is missing, while NumPy begins. mesh: of which kind it is. Raises UsageError for an engine that is
    unknown or not installed.
    """
    if name not in ("auto", *KINDS):
        raise UsageError(f"engine: unknown {name!r}; known: {', '.join(('auto', *KINDS))}")
    if name == "auto":
        sweeps = min(max_iterations, _USUAL_SWEEPS)
        work = vertices * (sweeps + (_PATCHES if patches else 0)) + walking * sweeps * _WALK
        if not work:  # only the name is checked
            return KINDS["numpy"]
        usual = [".", *(["surface"] * (walking > 0)), *(["patches"] * patches)]
        folders = ["surface"] if mesh.surface else usual
        fastest, repays = KINDS["numba"], _REPAYS
        if not _are_compiled(folders, mesh):
            fastest, repays = (
                (_HANDOVER, _REPAYS_STARTING)
                if meanwhile and walking <= _WALKS_MEANWHILE and _starts_python()
                else (fastest, _REPAYS_COMPILING)
            )
        elif fastest.is_loaded:
            repays = 0
        return fastest if work > repays and has_numba() else KINDS["numpy"]
    if not KINDS[name].is_installed:
        package = KINDS[name].package
        raise UsageError(f"engine {name}: {package} is not installed (pip install 'dvr-cli[fast]')")
    return KINDS[name]


def thread_count(threads: int | None) -> int:
    """``threads``, by default as many as there are cores for this process; UsageError below 1."""
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if threads < 1:
        raise UsageError("threads: must be at least 1")
    return threads
