"""Gmsh in tests: a session of its own, quiet, and files as it reads them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import numpy as np

from needs import require


@contextmanager
def gmsh_session(**options: float) -> Iterator[ModuleType]:
    """A Gmsh with default options but for those given, as Mesh_SaveAll for Mesh.SaveAll."""
    gmsh = require("gmsh")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for name, value in {"General_Terminal": 0, **options}.items():
            gmsh.option.setNumber(name.replace("_", ".", 1), value)
        yield gmsh
    finally:
        gmsh.finalize()


@contextmanager
def opened_by_gmsh(path: Path) -> Iterator[tuple[ModuleType, np.ndarray, np.ndarray]]:
    """Gmsh with a file open; the numbers of its nodes, ascending, and where they are, (N, 3)."""
    with gmsh_session() as gmsh:
        gmsh.open(str(path))
        tags, points, _ = gmsh.model.mesh.getNodes()
        order = np.argsort(tags)
        yield gmsh, tags[order], points.reshape(-1, 3)[order]
