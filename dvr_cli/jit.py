"""numba's compiler, set up for this package: results are cached on disk where that is possible.

Importing this module imports numba; only what has decided to compile does so.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

_Function = TypeVar("_Function", bound=Callable[..., Any])
# IEEE arithmetic as written: nothing fused or reassociated, division by zero as in NumPy
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}


def compiled(function: _Function, **options: Any) -> _Function:
    """``function`` compiled when first called; it may be a plain loop over arrays."""
    options |= _OPTIONS
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:  # no directory to keep the result in: compile it anew in every process
        return njit(**options)(function)


def inlined(function: _Function) -> _Function:
    """``function`` compiled into those that call it, for short ones called in loops.

    A call proper counts references to each array it is given, which costs more than a few sums do.
    """
    return compiled(function, forceinline=True)
