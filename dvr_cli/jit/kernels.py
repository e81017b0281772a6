"""Functions that are compiled: kernels, which Python calls, and their parts."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cached_property, update_wrapper
from typing import Any, TypeVar, cast

import numpy as np
from numba import config, types
from numba.core.registry import CPUDispatcher
from numba.np.numpy_support import from_dtype, map_layout

from dvr_cli.jit.compiling import (
    KernelCompiler,
    PartCompiler,
)
from dvr_cli.jit.on_disk import KernelCache, forget_outdated

Function = TypeVar("Function", bound=Callable[..., Any])


# IEEE arithmetic as written: nothing fused or reassociated, division by zero as in NumPy. No entry point for
# C is made: nothing calls one, and to compile it takes time.
_OPTIONS: dict[str, Any] = {
    "nopython": True,
    "boundscheck": None,
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
}


def compiled(function: Function, **options: Any) -> Function:
    """``function`` compiled when first called; it may be a plain loop over arrays."""
    if vars(config)["DISABLE_JIT"]:
        return function
    made: Any = _Kernel(function, {}, options | _OPTIONS, KernelCompiler)
    with suppress(RuntimeError):  # no directory to keep the result in: compile it anew in every process
        made._cache = KernelCache(function)
        forget_outdated(made.stats.cache_path)
    return cast(Function, made)


def part(function: Function, **options: Any) -> Function:
    """``function`` as a part of kernels that call it."""
    if vars(config)["DISABLE_JIT"]:
        PLAIN.add(function)
        return function
    return cast(Function, Part(function, options | {"no_cpython_wrapper": True, **_OPTIONS}))


def inlined(function: Function) -> Function:
    """``function`` compiled into those that call it, for short ones called in loops.

    A call proper counts references to each array it is given, which costs more than a few sums do.
    """
    return part(function, forceinline=True)


PLAIN: set[Any] = set()  # the parts where nothing is compiled


class _Kernel(CPUDispatcher):
    """A function that Python calls."""

    def typeof_pyval(self, value: Any) -> Any:
        """numba's type of an argument.

        To see that an array is not a masked one numba would load those, in a thirtieth of a short run.
        """
        if type(value) is np.ndarray:
            readonly = not value.flags.writeable
            return types.Array(from_dtype(value.dtype), value.ndim, map_layout(value), readonly=readonly)
        if isinstance(value, tuple):
            return types.BaseTuple.from_types([self.typeof_pyval(each) for each in value], type(value))
        return super().typeof_pyval(value)


class Part:
    """A function that only kernels call; numba hears of it when it compiles one of these."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func, self.options = function, options

    @cached_property
    def _dispatcher(self) -> _PartDispatcher:
        return _PartDispatcher(self.py_func, {}, self.options, PartCompiler)

    @property
    def _numba_type_(self) -> Any:
        """By this name numba asks things for their type."""
        return types.Dispatcher(self._dispatcher)

    def __call__(self, *args: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is a part of kernels, which only these can call")


class _PartDispatcher(CPUDispatcher):
    """A part as numba knows it."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """For the types of the arguments, not for their values: these would make it another function each."""
        return super().get_call_template([types.unliteral(kind) for kind in args], kws)
