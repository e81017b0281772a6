"""Backends: where the functions that stand twice are taken from, NumPy or compiled.

What an engine computes stands in a module X in NumPy, and compiled in X_numba beside it, under the same name,
with the same arguments and bit for bit the same result (docs/design.md, "Twins"). Code that is the same for
both asks a backend for its twin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])


@dataclass(frozen=True)
class Backend:
    """One way to compute.

    suffix: that of the names of its modules, none for NumPy.
    """

    suffix: str

    def twin(self, function: _Function) -> _Function:
        """The function of this backend that does what ``function``, given in NumPy, does."""
        if not self.suffix:
            return function
        return getattr(import_module(function.__module__ + self.suffix), function.__name__)


NUMPY = Backend("")
COMPILED = Backend("_numba")
