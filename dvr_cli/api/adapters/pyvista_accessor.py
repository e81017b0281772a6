"""The accessor ``dvr`` on PyVista's meshes, which PyVista finds by the package's entry point."""

from __future__ import annotations

from typing import Any

import pyvista

import dvr_cli
from dvr_cli.report.records import QualityReport


@pyvista.register_dataset_accessor("dvr", pyvista.DataSet)
class Accessor:
    """Improve and judge a mesh in one word.

    >>> smoothed = grid.dvr.smooth(boundary="slide")  # doctest: +SKIP
    """

    def __init__(self, mesh: pyvista.DataSet) -> None:
        """mesh: an UnstructuredGrid or PolyData; other data sets are refused when a method is called."""
        self._mesh = mesh

    def smooth(self, **options: Any) -> Any:
        """A new mesh of the same type, improved; options: as for ``dvr_cli.smooth``, which reports, too."""
        return dvr_cli.smooth(self._mesh, **options)[0]

    def quality(self, **options: Any) -> QualityReport:
        """The quality of the mesh; options: as for ``dvr_cli.quality_report``."""
        return dvr_cli.quality_report(self._mesh, **options)
