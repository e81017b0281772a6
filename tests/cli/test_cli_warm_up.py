"""``dvr warm-up``: afterwards no run has to compile anything."""

from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest

import dvr_cli
from dvr_cli.relax.engines import choice
from needs import require

# whether kernels are for meshes in a metric, where they are not only for those in none
MEASURED = {"metric_norms": (True,)} | dict.fromkeys(
    ("relax_rings", "polish_rings", "worst_corner", "solve_patch"), (False, True)
)


def kernels():
    """All functions of the package that are compiled for Python to call them."""
    from numba.core.dispatcher import Dispatcher

    from dvr_cli.jit.kinds import ByKind

    package = Path(dvr_cli.__file__).parent
    for path in sorted(package.rglob("*_numba.py")):
        module = import_module(".".join(("dvr_cli", *path.relative_to(package).with_suffix("").parts)))
        for value in vars(module).values():
            if isinstance(value, Dispatcher):
                yield value
            if isinstance(value, ByKind):
                for measured in MEASURED.get(value.__name__, (False,)):
                    yield from (value.of(planar, measured) for planar in (False, True))
                if value.__name__ == "find_moves":
                    yield value.of(False, False, True)


def kept(kernel):
    """What numba has kept of a kernel."""
    module = kernel.py_func.__module__.rpartition(".")[2]
    return list(Path(kernel.stats.cache_path).glob(f"{module}.{kernel.__name__}-*.nbi"))


@pytest.mark.long
def test_it_compiles_every_kernel_and_says_where_they_are_kept(dvr):
    require("numba")
    done = dvr("warm-up")
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith("compiled engine: ready after ")
    assert done.out.rstrip().endswith(" and beside it")
    found = list(kernels())
    assert len(found) > 20
    # a kernel that only others called is kept without having been loaded
    assert [kernel.__name__ for kernel in found if not (kernel.signatures or kept(kernel))] == []


def test_without_the_compiler_it_says_what_is_missing(dvr, monkeypatch):
    monkeypatch.setattr(choice, "find_spec", lambda package: None)
    done = dvr("warm-up")
    assert (done.code, done.out) == (2, "")
    assert "pip install 'dvr-cli[fast]'" in done.err


def test_it_says_if_nothing_can_be_kept(dvr, monkeypatch):
    require("numba")
    without_cache = SimpleNamespace(stats=SimpleNamespace(cache_path=None))
    monkeypatch.setattr("dvr_cli.mesh.rings_numba.rings", without_cache)
    done = dvr("warm-up")
    assert (done.code, done.out) == (2, "")
    assert "NUMBA_CACHE_DIR" in done.err
