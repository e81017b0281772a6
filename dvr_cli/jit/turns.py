"""Processes that compile in turn."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager, nullcontext
from functools import cache, partial
from typing import Any

from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher


@cache
def compile_in_turn() -> None:
    """From now on wait where another process that called this compiles functions of the same source.

    numba does not lock its cache: of two processes that write to it at once, one may lose what it wrote, or
    find the other's code under its own signature. Those that waited load what was compiled. Where files
    cannot be locked nothing changes.
    """
    compiled_alone = Dispatcher.compile

    def compiled_in_turn(self: Dispatcher, signature: Any) -> Any:
        # one thread at a time, which may compile what the function calls
        with global_compiler_lock, _turn(self.py_func.__code__.co_filename):
            return compiled_alone(self, signature)

    Dispatcher.compile = compiled_in_turn  # type: ignore[assignment, method-assign]


class _Turn:
    """The right to compile functions of one source, which one process has at a time, as often as it likes."""

    def __init__(self, source: str) -> None:
        import fcntl

        self._lock = partial(fcntl.flock, os.open(source, os.O_RDONLY))  # open until the process ends
        self._take, self._give = fcntl.LOCK_EX, fcntl.LOCK_UN
        self._depth = 0

    def __enter__(self) -> None:
        self._depth += 1
        if self._depth == 1:
            self._lock(self._take)

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._lock(self._give)


@cache
def _turn(source: str) -> AbstractContextManager[None]:
    """The turn of a source; where that cannot be locked all compile at once."""
    try:
        return _Turn(source)
    except (ImportError, OSError):
        return nullcontext()
