"""Directional vertex relaxation: finite-element meshes with better worst elements, and never a worse mesh.

    import dvr_cli
    smoothed, report = dvr_cli.smooth(meshio.read("part.vtk"))

Names are loaded when first used, so that importing the package costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from dvr_cli import gmsh
    from dvr_cli.api.distributed import smooth_distributed
    from dvr_cli.api.public import compare, quality_report, smooth, untangle
    from dvr_cli.api.relaxer import Relaxer

__all__ = ["Relaxer", "compare", "gmsh", "quality_report", "smooth", "smooth_distributed", "untangle"]

_OWN_MODULES = {"Relaxer": "dvr_cli.api.relaxer", "smooth_distributed": "dvr_cli.api.distributed"}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name == "gmsh":
        return import_module("dvr_cli.gmsh")
    return getattr(import_module(_OWN_MODULES.get(name, "dvr_cli.api.public")), name)
