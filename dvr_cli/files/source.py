"""A mesh file as read: the mesh it holds, and the means to write it back with other coordinates.

Only coordinates ever change (docs/design.md, "Files"). A format that can be patched keeps the
bytes it was read from and replaces the coordinates in them; everything else is copied.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError, UsageError
from dvr_cli.mesh.mesh import Mesh


@dataclass(frozen=True)
class InputFile:
    """The bytes of a mesh file, and where it is.

    path: None for a pipe. mesh: the name of the mesh to read, None for the only one in the file.
    """

    data: bytes
    path: Path | None
    mesh: str | None = None

    def beside(self, name: str | Path) -> bytes:
        """The bytes of another file the mesh consists of; name: its path, relative to this file's directory.

        Raises InputError if it cannot be read, or this file is a pipe and so has no directory.
        """
        if self.path is None:
            raise InputError(f"a mesh in several files cannot be piped: {name} belongs to it")
        path = self.path.parent / name
        try:
            return path.read_bytes()
        except FileNotFoundError as error:
            raise InputError(f"its other part {path} is missing") from error
        except OSError as error:
            raise InputError(f"{path}: {(error.strerror or str(error)).lower()}") from error


class Source(ABC):
    """One mesh file, read.

    mesh: what the file holds.
    format: the name of its format as ``--input-format`` and ``--output-format`` take it.
    target: the file ``write`` is for, None for a pipe.
    unread: what the file holds beyond the mesh, so that other formats will not have it, one line each.
    parameters: of vertices that have moved on a curve or surface of a model, by their numbers, those of their
        place on it, one or two; for formats that keep them.
    wider: what a ``widened`` source says about itself.
    notes: what the output cannot keep, one line each, as of the last ``stored`` or ``write``.
    """

    mesh: Mesh
    format: str
    target: Path | None
    unread: list[str]
    notes: list[str]
    parameters: dict[int, np.ndarray]
    wider = "coordinates are stored in 64 bits, as rounding them to 32 would lower the quality"

    def __init__(self) -> None:
        """Nothing lost so far."""
        self.target = None
        self.unread = []
        self.notes = []
        self.parameters = {}

    @abstractmethod
    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the same file with ``points`` ((N, d), the shape of ``mesh.points``) for its coordinates.

        A vertex whose coordinates are bit-identical to those read keeps its very bytes.
        """

    @property
    def main(self) -> Path | None:
        """The file that holds what ``write`` writes: the target, unless that names another of several."""
        return self.target

    def companions(self, points: np.ndarray) -> dict[Path, bytes]:
        """The other files that belong to the output at ``target``, by path: none for most formats."""
        return {}

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of ``write(points, ...)`` gets: rounded where the file stores float32."""
        return points

    def widened(self) -> Source | None:
        """The same file with room for more digits, None where it has it already or cannot get it."""
        return None

    def with_cell_field(self, name: str, values: list[np.ndarray], points: np.ndarray) -> Source:
        """The same file with a cell field more, one array a block; points: what is to be written with it.

        Raises UsageError for a format that has no place for it.
        """
        raise UsageError(
            f"{self.format} to {self.format} changes coordinates only, so there is no place for the cell "
            f"field {name!r}; write .vtu instead"
        )


def differing(points: np.ndarray, before: np.ndarray) -> np.ndarray:
    """The coordinates that differ in any bit (so -0.0 from 0.0) from those before: bool, of their shape."""
    return np.ascontiguousarray(points).view(np.int64) != np.ascontiguousarray(before).view(np.int64)


def rounded(points: np.ndarray) -> np.ndarray:
    """Coordinates as float32 holds them."""
    with np.errstate(over="ignore"):
        return points.astype(np.float32).astype(np.float64)
