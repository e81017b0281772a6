"""The metric that the option ``metric`` names: a point field of the mesh, a MEDIT solution, or an array."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dvr_cli.errors import InputError, UsageError
from dvr_cli.mesh.mesh import Mesh

_SUFFIXES = (".sol", ".solb")  # of MEDIT solutions


@dataclass(frozen=True)
class MetricSource:
    """The origin of the tensors of a metric: arrays, or a point field.

    name: how messages call it, and the point field it is. tensors: (N, k, k) where they are known before the
    mesh is, or (N, c) as they were given; None for a field.
    """

    name: str
    values: np.ndarray | None

    @property
    def is_file(self) -> bool:
        """True if it is the solution in a file."""
        return Path(self.name).suffix.lower() in _SUFFIXES

    @classmethod
    def of(cls, metric: str | Path | np.ndarray) -> MetricSource:
        """The source that a value of the option names; a file is read. Raises InputError if it cannot be."""
        if isinstance(metric, np.ndarray):
            return cls("array", metric)
        if Path(metric).suffix.lower() not in _SUFFIXES:
            return cls(str(metric), None)
        from dvr_cli.files.medit.solution import read_tensors  # most runs need no reader of MEDIT files

        try:
            return cls(str(metric), read_tensors(Path(metric)))
        except InputError as error:
            raise InputError(f"metric {metric}: {error}") from error

    def tensors(self, mesh: Mesh) -> np.ndarray:
        """(N, k, k) the tensor at each vertex of a mesh.

        Raises UsageError for a field that the mesh does not have, InputError for values that are no tensors.
        """
        values = mesh.point_data.get(self.name) if self.values is None else self.values
        if values is None:
            known = ", ".join(sorted(mesh.point_data)) or "none"
            suffixes = " or ".join(_SUFFIXES)
            raise UsageError(
                f"metric: no point field {self.name!r} (there are: {known}), nor a {suffixes} file"
            )
        try:
            from dvr_cli.quality.metric import tensors_of

            return tensors_of(values, len(mesh.points))
        except InputError as error:
            raise InputError(f"metric {self.name}: {error}") from error


def metric_source(metric: str | Path | np.ndarray | None) -> MetricSource | None:
    """The origin of the metric that a value of the option names, None for None; see ``MetricSource.of``."""
    return None if metric is None else MetricSource.of(metric)
