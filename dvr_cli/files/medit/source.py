"""MEDIT files, read and written back with other coordinates in the bytes they were read from."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from dvr_cli.files.medit.binary import BINARY, BinaryFile
from dvr_cli.files.medit.convert import HOLDING, ConvertedMedit, named_binary
from dvr_cli.files.medit.keywords import ELEMENTS
from dvr_cli.files.medit.mesh import make_mesh
from dvr_cli.files.medit.text import TextFile
from dvr_cli.files.source import Source, differing, rounded

_IN_MESH = frozenset({*ELEMENTS, "MeshVersionFormatted", "Dimension", "Vertices"})


class MeditSource(Source):
    """A .mesh or .meshb file."""

    format = "medit"

    def __init__(self, data: bytes) -> None:
        """Raises InputError for what is damaged or not supported."""
        super().__init__()
        self._data = data
        self._file = BinaryFile(data) if data[:4] in BINARY else TextFile(data)
        self.mesh = make_mesh(self._file)
        self._converted: ConvertedMedit | None = None
        self._points = self.mesh.points.copy()  # as read, whatever becomes of the mesh
        self.unread = self._beyond(_IN_MESH)

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the file with the coordinates ``points`` ((N, d)), rounded if it stores float32."""
        if self._other is not None:
            self._other.write(points, file)
            return
        points = self.stored(points)
        changed = differing(points, self._points)
        if changed.any():
            self._file.write(points, changed, file)
        else:
            file.write(self._data)

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of the output gets: rounded where the file stores float32."""
        if self._other is not None:
            stored = self._other.stored(points)
            self.notes = self._other.notes
            return stored
        if not self._file.single:
            return points
        return rounded(points)

    def widened(self) -> MeditSource | None:
        """The same file in version 2, with float64; None if it has them, or sections that are not known."""
        wide = self._file.as_double() if self._other is None else None
        return None if wide is None else MeditSource(wide)

    @property
    def _other(self) -> ConvertedMedit | None:
        """The source that writes where the target's suffix asks for the other kind, binary or text."""
        if self.target is None or self.target.suffix.lower() not in (".mesh", ".meshb"):
            return None
        if named_binary(self.target) == isinstance(self._file, BinaryFile):
            return None
        if self._converted is None:
            self._converted = ConvertedMedit(self.mesh, self._beyond(_IN_MESH | HOLDING))
        self._converted.target = self.target
        return self._converted

    def _beyond(self, kept: frozenset[str]) -> list[str]:
        """A line that names the sections which are not ``kept``, if there are any."""
        beyond = [(name, self._file.count(name)) for name in self._file.sections if name not in kept]
        listed = [name if count is None else f"{name} ({count})" for name, count in beyond]
        return [f"sections not kept: {', '.join(listed)}"] if beyond else []


def read(data: bytes) -> MeditSource:
    """Read a MEDIT file, text or binary, from its bytes; see ``mesh`` for what becomes of its sections.

    Raises InputError if it is damaged, or uses what is not supported.
    """
    return MeditSource(data)
