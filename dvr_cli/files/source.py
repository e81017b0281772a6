"""A mesh file as read: the mesh it holds, and the means to write it back with other coordinates.

Only coordinates ever change (DESIGN: "Only coordinates change"). A format that can be patched keeps the
bytes it was read from and replaces the coordinates in them; everything else is copied.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import BinaryIO

import numpy as np

from dvr_cli.mesh.mesh import Mesh


class Source(ABC):
    """One mesh file, read.

    mesh: what the file holds.
    format: the name of its format as ``--input-format`` and ``--output-format`` take it.
    """

    mesh: Mesh
    format: str

    @abstractmethod
    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the same file with ``points`` ((N, d), the shape of ``mesh.points``) for its coordinates.

        A vertex whose coordinates are bit-identical to those read keeps its very bytes.
        """

    @abstractmethod
    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of ``write(points, ...)`` gets: rounded where the file stores float32."""
