"""Formats left to meshio, with guards against what it is known to do (DESIGN section 6).

meshio prints, exits and raises bare ValueErrors on files it cannot read; all of it becomes InputError. What
its writer loses is found out by reading back what it wrote.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from dvr_cli.errors import DvrError, InputError, OutputError
from dvr_cli.files.source import Source
from dvr_cli.mesh.convert import from_meshio, to_meshio
from dvr_cli.mesh.mesh import Mesh

# How to have meshio write a format, where that is not its default.
_WRITE_AS: dict[str, tuple[str, dict[str, Any]]] = {
    "gmsh": ("gmsh22", {"binary": True}),  # its 4.1 needs tags that other formats do not have
    "vtk": ("vtk42", {}),  # its default, 5.1, is one Gmsh cannot open
    "stl": ("stl", {"binary": True}),
}


class MeshioSource(Source):
    """A file read by meshio, and any mesh to be written by it."""

    def __init__(self, mesh: Mesh, format_name: str) -> None:
        """mesh: what to write; format_name: one of formats.FORMATS."""
        super().__init__()
        self.mesh = mesh
        self.format = format_name

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the mesh with other coordinates; raises OutputError where the format cannot hold it."""
        file.write(self._written(points)[0])

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates that meshio reads back from what it writes."""
        return self._written(points)[1].points[: len(points), : points.shape[1]]

    def _written(self, points: np.ndarray) -> tuple[bytes, Mesh]:
        """The bytes meshio writes, and the mesh it reads back from them."""
        import meshio

        name, options = _WRITE_AS.get(self.format, (self.format, {}))
        with tempfile.TemporaryDirectory(prefix="dvr-") as folder:
            path = Path(folder) / "mesh"
            with _guarded(OutputError, f"meshio cannot write this mesh as {self.format}"):
                meshio.write(path, to_meshio(self.mesh, points), file_format=name, **options)
            try:
                back = read(path, self.format).mesh
            except InputError as error:
                raise OutputError(
                    f"meshio writes this mesh as {self.format}, but cannot read it back"
                ) from error
            if _count(back) != _count(self.mesh):
                raise OutputError(f"{self.format} cannot hold this mesh: vertices or cells would be lost")
            self.notes = _lost(self.mesh, back, points)
            return path.read_bytes(), back


def read(path: Path, format_name: str) -> MeshioSource:
    """Read a file through meshio; raises InputError (without the file's name) if it cannot."""
    import meshio

    with _guarded(InputError, f"not readable as {format_name}"):
        return MeshioSource(from_meshio(meshio.read(path, file_format=format_name)), format_name)


@contextlib.contextmanager
def _guarded(error: type[DvrError], what: str) -> Iterator[None]:
    """Turn everything meshio does on trouble into one ``error``, and keep what it prints to ourselves."""
    printed = io.StringIO()
    try:
        with (
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(printed),
            np.errstate(all="ignore"),
        ):
            yield
    except (Exception, SystemExit) as cause:
        said = str(cause) if not isinstance(cause, SystemExit) else ""
        lines = [line.strip() for line in (said or printed.getvalue()).splitlines() if line.strip()]
        reason = lines[0] if lines else type(cause).__name__
        if isinstance(cause, ImportError):
            reason = f"it needs the package {cause.name} (pip install 'dvr-cli[formats]')"
        raise error(f"{what}: {reason}") from cause


def _lost(mesh: Mesh, back: Mesh, points: np.ndarray) -> list[str]:
    """What of ``mesh`` is not in ``back``, as one line a kind."""
    lost = []
    if not np.array_equal(back.points[:, : points.shape[1]], points):
        difference = np.abs(back.points[:, : points.shape[1]] - points).max()
        lost.append(f"coordinates are rounded, by up to {difference:.2g}")
    if _cells(mesh) != _cells(back):
        lost.append("the order of the cells is not kept")
    for kind in ("point_data", "cell_data", "field_data"):
        names = getattr(mesh, kind).keys() - getattr(back, kind).keys()
        if names:
            lost.append(f"{kind.replace('_', ' ')} not kept: {', '.join(sorted(names))}")
    if len(mesh.periodic) > len(back.periodic):
        lost.append("periodic links are not kept")
    return lost


def _count(mesh: Mesh) -> tuple[int, dict[str, int]]:
    """Number of vertices, and of cells by type."""
    cells: dict[str, int] = {}
    for block in mesh.cells:
        cells[block.type] = cells.get(block.type, 0) + len(block.vertices)
    return len(mesh.points), {name: n for name, n in cells.items() if n}


def _cells(mesh: Mesh) -> list[tuple[str, bytes]]:
    """Cells in comparable form, adjacent blocks of one type joined."""
    joined: list[tuple[str, list[np.ndarray]]] = []
    for block in mesh.cells:
        if joined and joined[-1][0] == block.type:
            joined[-1][1].append(block.vertices)
        elif len(block.vertices):
            joined.append((block.type, [block.vertices]))
    return [(name, np.concatenate(parts).astype(np.int64).tobytes()) for name, parts in joined]
