"""A mesh file as read: the mesh it holds, and the means to write it back with other coordinates.

Only coordinates ever change (DESIGN: "Only coordinates change"). A format that can be patched keeps the
bytes it was read from and replaces the coordinates in them; everything else is copied.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import UsageError
from dvr_cli.mesh.mesh import Mesh


class Source(ABC):
    """One mesh file, read.

    mesh: what the file holds.
    format: the name of its format as ``--input-format`` and ``--output-format`` take it.
    companions: other files the mesh consists of, bytes by suffix; they are written unchanged.
    unread: what the file holds beyond the mesh, so that other formats will not have it, one line each.
    notes: what the output cannot keep, one line each, as of the last ``stored`` or ``write``.
    """

    mesh: Mesh
    format: str
    companions: Mapping[str, bytes]
    unread: list[str]
    notes: list[str]

    def __init__(self) -> None:
        """No companions, nothing lost so far."""
        self.companions = {}
        self.unread = []
        self.notes = []

    @abstractmethod
    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the same file with ``points`` ((N, d), the shape of ``mesh.points``) for its coordinates.

        A vertex whose coordinates are bit-identical to those read keeps its very bytes.
        """

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of ``write(points, ...)`` gets: rounded where the file stores float32."""
        return points

    def widened(self) -> Source | None:
        """The same file with its coordinates in float64, None where they are already or cannot be."""
        return None

    def with_cell_field(self, name: str, values: list[np.ndarray], points: np.ndarray) -> Source:
        """The same file with a cell field more, one array a block; points: what is to be written with it.

        Raises UsageError for a format that has no place for it.
        """
        raise UsageError(
            f"{self.format} to {self.format} changes coordinates only, so there is no place for the cell "
            f"field {name!r}; write .vtu instead"
        )
