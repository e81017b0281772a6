"""Files that hold arrays by name (HDF5, netCDF): coordinates written in place, all else as it was."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from dvr_cli.files import hdf5
from dvr_cli.files.source import Source, differing
from dvr_cli.mesh.mesh import Mesh


@dataclass(frozen=True)
class CoordinateArray:
    """An array in the file that holds coordinates, axis by axis.

    path: its name. rows: whose. axes: which. shape, dtype: as stored.
    """

    path: str
    rows: slice
    axes: tuple[int, ...]
    shape: tuple[int, ...]
    dtype: np.dtype

    def of(self, points: np.ndarray) -> np.ndarray:
        """The values of the array for the coordinates ``points`` ((N, D)): rounded where it is float32."""
        with np.errstate(over="ignore"):
            return points[self.rows, self.axes].T.astype(self.dtype).reshape(self.shape)


class ContainerSource(Source):
    """A file of named arrays, some of which hold the coordinates."""

    def __init__(self, data: bytes, mesh: Mesh, arrays: list[CoordinateArray], unread: list[str]) -> None:
        super().__init__()
        self.mesh = mesh
        self.unread = unread
        self._data = data
        self._arrays = arrays

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the file with the coordinates ``points`` ((N, D)), rounded where it stores float32."""
        if differing(self.stored(points), self.mesh.points).any():
            file.write(self.with_values(self._data, {array.path: array.of(points) for array in self._arrays}))
        else:
            file.write(self._data)

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of the output gets: rounded where the file stores float32."""
        result = points.astype(np.float64)
        for array in self._arrays:
            result[array.rows, array.axes] = array.of(points).reshape(len(array.axes), -1).T
        return result

    @staticmethod
    def with_values(data: bytes, replaced: Mapping[str, np.ndarray]) -> bytes:
        """The file with other values in some arrays, by their paths."""
        return hdf5.with_values(data, replaced)
