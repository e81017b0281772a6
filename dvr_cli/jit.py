"""numba's compiler, set up for this package: results are cached on disk where that is possible.

Importing this module imports numba; only what has decided to compile does so.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from numba import njit

_Function = TypeVar("_Function", bound=Callable[..., Any])
# IEEE arithmetic as written: nothing fused or reassociated, division by zero as in NumPy. No entry point for
# C is made: nothing calls one, and to compile it takes time.
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def compiled(function: _Function, **options: Any) -> _Function:
    """``function`` compiled when first called; it may be a plain loop over arrays."""
    options |= _OPTIONS
    try:
        made = njit(cache=True, **options)(function)
    except RuntimeError:  # no directory to keep the result in: compile it anew in every process
        return njit(**options)(function)
    if hasattr(made, "stats"):  # it is the function itself when numba is told to run Python
        forget_outdated(made.stats.cache_path)
    return made


def inlined(function: _Function) -> _Function:
    """``function`` compiled into those that call it, for short ones called in loops.

    A call proper counts references to each array it is given, which costs more than a few sums do. Python
    cannot call it: to compile an entry for that takes time.
    """
    return compiled(function, forceinline=True, no_cpython_wrapper=True)


@cache
def forget_outdated(directory: str) -> None:
    """Remove from a directory of results those older than the last change of any source they may come from.

    numba notices when the file of a function changes, but not those of the functions and constants it uses.
    """
    with suppress(OSError):
        for index in Path(directory).glob("*.nbi"):
            if index.stat().st_mtime < _last_change():
                index.unlink()


@cache
def _last_change() -> float:
    """The time of the last change of a source: of this one, or any in the folders with compiled modules."""
    package = Path(__file__).parent
    folders = {path.relative_to(package).parts[0] for path in package.rglob("*_numba.py")}
    sources = [path for folder in folders for path in (package / folder).rglob("*.py")]
    with suppress(OSError):  # there are none in an archive
        return max(path.stat().st_mtime for path in [Path(__file__), *sources])
    return 0.0
