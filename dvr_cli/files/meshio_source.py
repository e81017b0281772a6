"""Formats left to meshio, with guards against what it is known to do (docs/design.md, "Files").

meshio prints, exits and raises bare ValueErrors on files it cannot read; all of it becomes InputError. What
its writer loses is found out by reading back what it wrote.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import DvrError, InputError, OutputError, UsageError
from dvr_cli.files.formats import format_named
from dvr_cli.files.losses import lost
from dvr_cli.files.source import InputFile, Source
from dvr_cli.mesh.convert import from_meshio, to_meshio
from dvr_cli.mesh.mesh import Mesh


class MeshioSource(Source):
    """A file read by meshio, and any mesh to be written by it."""

    def __init__(self, mesh: Mesh, format_name: str, unread: Sequence[str] = ()) -> None:
        """mesh: what to write; format_name: one of formats.FORMATS; unread: what its file has beyond it."""
        super().__init__()
        self.mesh = mesh
        self.format = format_name
        self.unread = list(unread)
        self._last: tuple[tuple[str, bytes], tuple[bytes, Mesh]] | None = None

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the mesh with other coordinates; raises OutputError where the format cannot hold it."""
        file.write(self._written(points)[0])

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates that are read back from what meshio writes; finds out, too, what is lost."""
        back = self._written(points)[1]
        self.notes = [*self.unread, *lost(self.mesh, back, points)]
        return back.points[: len(points), : points.shape[1]]

    def with_cell_field(self, name: str, values: list[np.ndarray], points: np.ndarray) -> MeshioSource:
        mesh = replace(self.mesh, cell_data={**self.mesh.cell_data, name: values})
        result = MeshioSource(mesh, self.format, self.unread)
        result.target = self.target
        if name not in result._written(points)[1].cell_data:
            raise UsageError(f"{self.format} cannot hold the cell field {name!r}; write .vtu instead")
        return result

    @property
    def _file_name(self) -> str:
        """The output's: meshio tells binary from text by it in some formats."""
        return self.target.name if self.target else "mesh"

    def _written(self, points: np.ndarray) -> tuple[bytes, Mesh]:
        """The bytes meshio writes, and the mesh it reads back from them; the last are kept.

        What was just tried out by ``stored`` is mostly what ``write`` is asked for next.
        """
        wanted = self._file_name, points.tobytes()
        if self._last is None or self._last[0] != wanted:
            self._last = wanted, self._write_and_read(points)
        return self._last[1]

    def _write_and_read(self, points: np.ndarray) -> tuple[bytes, Mesh]:
        import meshio

        name, options = format_named(self.format).meshio
        with tempfile.TemporaryDirectory(prefix="dvr-") as folder:
            path = Path(folder) / self._file_name
            with _guarded(OutputError, f"meshio cannot write this mesh as {self.format}"):
                meshio.write(path, to_meshio(self.mesh, points), file_format=name or self.format, **options)
            try:
                back = self._read_back(path)
            except InputError as error:
                raise OutputError(f"meshio writes this mesh as {self.format} wrongly: {error}") from error
            if _count(back) != _count(self.mesh):
                raise OutputError(f"{self.format} cannot hold this mesh: vertices or cells would be lost")
            return path.read_bytes(), back

    def _read_back(self, path: Path) -> Mesh:
        """The mesh that meshio wrote, by this package's own reader if there is one; raises InputError."""
        record = format_named(self.format)
        if not record.patched:
            return read_path(path, self.format).mesh
        return record.read(InputFile(path.read_bytes(), path)).mesh


def read(file: InputFile, format_name: str) -> MeshioSource:
    """Read a file through meshio; raises InputError (without the file's name) if it cannot."""
    if file.path is not None and file.path.is_file():
        return read_path(file.path, format_name)
    with tempfile.TemporaryDirectory(prefix="dvr-") as folder:  # meshio reads twice, a pipe can be read once
        spooled = Path(folder) / "mesh"
        spooled.write_bytes(file.data)
        return read_path(spooled, format_name)


def read_path(path: Path, format_name: str) -> MeshioSource:
    """Read the file at ``path`` through meshio; raises InputError."""
    import meshio

    with _guarded(InputError, f"not readable as {format_name}") as printed:
        mesh = from_meshio(meshio.read(path, file_format=format_name))
    return MeshioSource(mesh, format_name, _warnings(printed.getvalue()))


def _warnings(printed: str) -> list[str]:
    """The things that meshio left out when it read a file, as it printed them."""
    warnings = " ".join(printed.split()).split("Warning: ")
    return [f"meshio on reading: {warning.strip()}" for warning in warnings if warning.strip()]


@contextlib.contextmanager
def _guarded(error: type[DvrError], what: str) -> Iterator[io.StringIO]:
    """Turn everything meshio does on trouble into one ``error``, and keep what it prints to ourselves."""
    printed = io.StringIO()
    try:
        with (
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(printed),
            np.errstate(all="ignore"),
        ):
            yield printed
    except (Exception, SystemExit) as cause:
        said = str(cause) if not isinstance(cause, SystemExit) else ""
        lines = [line.strip() for line in (said or printed.getvalue()).splitlines() if line.strip()]
        reason = lines[0] if lines else type(cause).__name__
        if isinstance(cause, ImportError):
            reason = f"it needs the package {cause.name} (pip install 'dvr-cli[formats]')"
        raise error(f"{what}: {reason}") from cause


def _count(mesh: Mesh) -> tuple[int, dict[str, int]]:
    """Number of vertices, and of cells by type."""
    cells: dict[str, int] = {}
    for block in mesh.cells:
        cells[block.type] = cells.get(block.type, 0) + len(block.vertices)
    return len(mesh.points), {name: n for name, n in cells.items() if n}
