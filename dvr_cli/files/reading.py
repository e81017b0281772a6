"""From a path to a mesh: which reader, and one clear line when it cannot be read."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from dvr_cli.errors import InputError
from dvr_cli.files.formats import format_by_suffix, format_named, sniff
from dvr_cli.files.source import Source

STANDARD = Path("-")  # stands for stdin and stdout


def open_mesh(path: Path, format_name: str | None = None) -> Source:
    """Read the mesh file at ``path``, or stdin if it is "-".

    format_name: one of formats.FORMATS; by default the suffix tells, or else the first bytes do.
    Raises InputError, which names the file and the cause, and UsageError for an unknown ``format_name``.
    """
    name = None if format_name is None else format_named(format_name)
    try:
        data = _bytes_of(path)
        if not data.strip():
            raise InputError("there is no mesh in it" if data else "it is empty")
        name = name or format_by_suffix(path) or sniff(data)
        if name is None:
            raise InputError("neither its suffix nor its first bytes tell a format; name one")
        return _read(path, data, name)
    except InputError as error:
        raise InputError(f"{'standard input' if path == STANDARD else path}: {error}") from error


def _bytes_of(path: Path) -> bytes:
    try:
        if path != STANDARD:
            return path.read_bytes()
        if sys.stdin is None or sys.stdin.isatty():
            raise InputError("a mesh has to be piped in")
        return sys.stdin.buffer.read()
    except FileNotFoundError as error:
        raise InputError("no such file") from error
    except OSError as error:
        raise InputError((error.strerror or str(error)).lower()) from error


def _read(path: Path, data: bytes, name: str) -> Source:
    if name == "gmsh":
        from dvr_cli.files import gmsh

        return gmsh.read(data)
    if name == "vtk":
        from dvr_cli.files import vtk

        return vtk.read(data)
    if name == "obj":
        from dvr_cli.files import obj

        return obj.read(data)
    if name == "tetgen":
        return _read_pair(path)
    from dvr_cli.files import meshio_source

    if path != STANDARD and path.is_file():
        return meshio_source.read(path, name)
    with tempfile.TemporaryDirectory(prefix="dvr-") as folder:  # meshio reads twice, a pipe can be read once
        spooled = Path(folder) / "mesh"
        spooled.write_bytes(data)
        return meshio_source.read(spooled, name)


def _read_pair(path: Path) -> Source:
    """A TetGen mesh is two files, NAME.node and NAME.ele; either may be named."""
    from dvr_cli.files import tetgen

    if path == STANDARD:
        raise InputError("a TetGen mesh is two files and cannot be piped")
    try:
        return tetgen.read(path.with_suffix(".node").read_bytes(), path.with_suffix(".ele").read_bytes())
    except FileNotFoundError as error:
        raise InputError(f"its other half {error.filename} is missing") from error
    except OSError as error:
        raise InputError(f"{error.filename}: {(error.strerror or str(error)).lower()}") from error
