"""Settings for all tests, and the turns that workers take in compiling."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# the oracle solves many tiny eigenvalue problems, in which BLAS threads only wait for one another
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")
# commands that tests start find modules compiled, as those of an installed package are
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# an example, or to draw one, may take long where others use the cores, too; CI takes the same ones every time
LOADED = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("here", **LOADED)
settings.register_profile("ci", **LOADED, derandomize=True, database=None, print_blob=True)
settings.load_profile("ci" if os.environ.get("CI") == "true" else "here")

# what takes long and calls no compiled function, or hardly any
WITHOUT_KERNELS = (
    "tests/distributed/",
    "tests/relax/surface/",
    "tests/relax/untangle/test_walking.py",
    "tests/report/",
)
# new objects after which Python looks for garbage: the compiler makes many that stay
GARBAGE = 50_000


def pytest_collection_finish() -> None:
    """What is there before the first test stays: Python does not look through thousands of tests again."""
    gc.freeze()
    gc.set_threshold(GARBAGE)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """While the first of two workers compiles, the second, which begins in the middle, has not to wait."""
    early = [item for item in items if item.nodeid.startswith(WITHOUT_KERNELS)]
    others = [item for item in items if not item.nodeid.startswith(WITHOUT_KERNELS)]
    middle = len(items) // 2
    items[:] = [*others[:middle], *early, *others[middle:]]


@pytest.fixture(scope="session", autouse=True)
def _compiling_in_turn(worker_id: str) -> None:
    """One worker compiles a function, and the others wait for it and load it from numba's cache."""
    if worker_id != "master" and find_spec("numba") is not None:
        from dvr_cli.jit.turns import compile_in_turn

        compile_in_turn()


@pytest.fixture(scope="session", autouse=True)
def _no_process_compiles() -> Iterator[None]:
    """Runs whose kernels are missing get no process that compiles them, but where that is what is tested."""
    if find_spec("numba") is None:
        yield
        return
    sorts = import_module("dvr_cli.api.warming").SORTS
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dvr_cli.relax.engines.handover._started", {sort: [] for sort in sorts})
        yield


@pytest.fixture(scope="session", autouse=True)
def _compiled_from_the_start(request: pytest.FixtureRequest) -> Iterator[None]:
    """In a run of many tests the engine called auto is the compiled one where to compile it pays.

    It does not in a metric, nor for the few tests of curved boundaries in a plane. The engine of NumPy is
    compared with it, and has its own tests.
    """
    if find_spec("numba") is None or len(request.session.items) < 500:
        yield
        return
    import_module("dvr_cli.relax.engines.numba_engine")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dvr_cli.relax.engines.choice._are_compiled", _is_paid_for)
        yield


def _is_paid_for(folders: Sequence[str], mesh: Any) -> bool:
    return not (mesh.measured or (mesh.planar and "surface" in folders))
