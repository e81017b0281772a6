"""Kernels that the compiler keeps on disk, known without loading it."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).parent


@cache
def last_change() -> float:
    """The time of the last change of a source: of the compiler's set-up, or any in the folders of kernels."""
    folders = {path.relative_to(_PACKAGE).parts[0] for path in _PACKAGE.rglob("*_numba.py")} | {"jit"}
    sources = [path for folder in folders for path in (_PACKAGE / folder).rglob("*.py")]
    with suppress(OSError):  # there are none in an archive
        return max(path.stat().st_mtime for path in sources)
    return 0.0


def may_be_kept(kernel: str) -> bool:
    """False if it is certain that a kernel, given as folder.module.function, has to be compiled.

    numba keeps its results beside the sources where it can, or in a folder that is named to it, else in a
    place of its own, where nothing is certain.
    """
    named = os.environ.get("NUMBA_CACHE_DIR")
    *folder, module, function = kernel.split(".")
    beside = _PACKAGE.joinpath(*folder)
    if named is None and not os.access(beside, os.W_OK):
        return True
    name = f"{module}.{function}-*.py{sys.version_info.major}{sys.version_info.minor}*.nbi"
    found = beside.glob(f"__pycache__/{name}") if named is None else Path(named).glob(f"*/{name}")
    with suppress(OSError):  # another process may remove one meanwhile
        return any(path.stat().st_mtime >= last_change() for path in found)
    return False
