"""Settings for all tests, and the turns that workers take in compiling."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any

import pytest
from hypothesis import settings

# the oracle solves many tiny eigenvalue problems, in which BLAS threads only wait for one another
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# an example may take long where others use the cores, too; CI takes the same examples every time
settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, database=None, print_blob=True)
settings.load_profile("ci" if os.environ.get("CI") == "true" else "here")


@pytest.fixture(scope="session", autouse=True)
def _compiling_in_turn(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Iterator[None]:
    """One worker compiles a function, and the others wait for it and load it from numba's cache.

    numba does not lock its cache: of two processes that write to it at once, one may lose what it wrote, or
    find the other's code under its own signature.
    """
    if worker_id == "master" or find_spec("numba") is None or find_spec("fcntl") is None:
        yield
        return
    import fcntl

    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.dispatcher import Dispatcher

    compiled, depth = Dispatcher.compile, 0

    def compiled_in_turn(self: Dispatcher, signature: Any) -> Any:
        nonlocal depth
        with global_compiler_lock:  # one thread at a time, which may compile what the function calls
            depth += 1
            if depth == 1:
                fcntl.flock(lock, fcntl.LOCK_EX)
            try:
                return compiled(self, signature)
            finally:
                depth -= 1
                if depth == 0:
                    fcntl.flock(lock, fcntl.LOCK_UN)

    with (
        (tmp_path_factory.getbasetemp().parent / "compiling").open("w") as lock,
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setattr(Dispatcher, "compile", compiled_in_turn)
        yield
