"""From a path to a mesh: which reader, and one clear line when it cannot be read."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.formats import format_named, format_of
from dvr_cli.files.source import InputFile, Source

STANDARD = Path("-")  # stands for stdin and stdout


def open_mesh(path: Path, format_name: str | None = None, mesh_name: str | None = None) -> Source:
    """Read the mesh file at ``path``, or stdin if it is "-".

    format_name: one of formats.FORMATS; by default the suffix tells, or else the first bytes do. mesh_name:
    which mesh to read of a file with several.
    Raises InputError, which names the file and the cause, and UsageError for an unknown ``format_name``.
    """
    named = None if format_name is None else format_named(format_name)
    try:
        data = _bytes_of(path)
        if not data.strip():
            raise InputError("there is no mesh in it" if data else "it is empty")
        record = named or format_of(path, data)
        if record is None:
            raise InputError("neither its suffix nor its first bytes tell a format; name one")
        if mesh_name is not None and not record.named_meshes:
            raise InputError(f"{record.name} files hold one mesh, which --mesh cannot choose")
        with np.errstate(invalid="ignore"):  # what is no number is refused by name where it matters
            return record.read(InputFile(data, None if path == STANDARD else path, mesh_name))
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
