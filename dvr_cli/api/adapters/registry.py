"""Meshes of other libraries: which classes are known, one record each, and how an object finds its record.

An object is known by the name of its class, so no library is imported before an object of it comes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from dvr_cli.errors import UsageError
from dvr_cli.mesh.convert import from_arrays
from dvr_cli.mesh.mesh import Mesh

CellArrays = np.ndarray | Mapping[str, np.ndarray] | Sequence[tuple[str, np.ndarray]] | None


@dataclass(frozen=True)
class Adapter:
    """One class of meshes of another library.

    library, type_name: the package that has the class, and the name of the class.
    module: ours, with ``read(mesh) -> Mesh`` and ``moved(mesh, points) -> object of the same class``; the
        points of both are (N, 2|3) in one order.
    """

    library: str
    type_name: str
    module: str

    def read(self, mesh: Any) -> Mesh:
        """The Mesh of an object of this class, which is not altered; InputError if it cannot be relaxed."""
        converted: Mesh = import_module(self.module).read(mesh)
        return converted

    def moved(self, mesh: Any, points: np.ndarray) -> Any:
        """A new object like ``mesh`` with the coordinates ``points``."""
        return import_module(self.module).moved(mesh, points)


ADAPTERS = [
    Adapter("meshio", "Mesh", "dvr_cli.api.adapters.meshio"),
    Adapter("pyvista", "UnstructuredGrid", "dvr_cli.api.adapters.pyvista"),
    Adapter("pyvista", "PolyData", "dvr_cli.api.adapters.pyvista"),
    Adapter("trimesh", "Trimesh", "dvr_cli.api.adapters.trimesh"),
    Adapter("skfem", "Mesh", "dvr_cli.api.adapters.skfem"),
]


def adapter_of(mesh: Any) -> Adapter:
    """The adapter of an object's class, or of the nearest it derives from; UsageError if none is known."""
    known = {(adapter.library, adapter.type_name): adapter for adapter in ADAPTERS}
    for kind in type(mesh).__mro__:
        adapter = known.get((kind.__module__.split(".")[0], kind.__name__))
        if adapter is not None:
            return adapter
    own = type(mesh)
    name = own.__name__ if own.__module__ == "builtins" else f"{own.__module__.split('.')[0]}.{own.__name__}"
    *names, last = (f"{adapter.library}.{adapter.type_name}" for adapter in ADAPTERS)
    raise UsageError(f"mesh: {', '.join(names)}, {last} or a NumPy array of points is needed, not a {name}")


def as_mesh(mesh: Any, cells: CellArrays) -> Mesh:
    """The Mesh of an object of a known class, or of points (N, 2|3) with cells, see ``from_arrays``.

    Raises UsageError for anything else.
    """
    if isinstance(mesh, np.ndarray):
        return from_arrays(mesh, cells)
    adapter = adapter_of(mesh)
    if cells is not None:
        raise UsageError("cells: a mesh has its own; they go with an array of points only")
    return adapter.read(mesh)


def with_points(mesh: Any, points: np.ndarray) -> Any:
    """The coordinates alone if ``as_mesh`` was given an array, else an object of the same class with them."""
    return points if isinstance(mesh, np.ndarray) else adapter_of(mesh).moved(mesh, points)
