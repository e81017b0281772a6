"""From coordinates to a file: same format patched, other formats through meshio, always atomically."""

from __future__ import annotations

import contextlib
import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import OutputError, UsageError
from dvr_cli.files.formats import FORMATS, format_by_suffix, format_named
from dvr_cli.files.meshio_source import MeshioSource
from dvr_cli.files.reading import STANDARD
from dvr_cli.files.source import Source


class Output:
    """Where and how the smoothed mesh is written."""

    def __init__(self, source: Source, path: Path, format_name: str | None = None) -> None:
        """path: the file to write, or "-" for stdout; format_name: by default the suffix tells.

        A pipe, a device and stdout get the format of the input unless one is named.
        Raises UsageError for an unknown format, OutputError for one that cannot be had.
        """
        name = output_format_of(path, format_name) or source.format
        if name == "tetgen" != source.format:
            raise OutputError(f"{path}: a TetGen pair can only be written from a TetGen pair")
        self._path = path
        self._writer = source if name == source.format else MeshioSource(source.mesh, name)
        if self._writer is not source:
            self.stored(source.mesh.points)  # a format that cannot hold the mesh is found out now

    @property
    def notes(self) -> list[str]:
        """What the output cannot keep of the input, known once ``stored`` or ``write`` was called."""
        return self._writer.notes

    def stored(self, points: np.ndarray) -> np.ndarray:
        """``points`` as a reader of the output will get them."""
        try:
            return self._writer.stored(points)
        except OutputError as error:
            raise OutputError(f"{self._path}: {error}") from error

    def widen(self) -> bool:
        """Have coordinates stored in float64 from now on; False if they are already or cannot be."""
        wide = self._writer.widened()
        if wide is None:
            return False
        wide.notes.append("coordinates are stored in 64 bits, as rounding them to 32 would lower the quality")
        self._writer = wide
        return True

    def write(self, points: np.ndarray) -> None:
        """Write the mesh with coordinates ``points``; raises OutputError, and then the old file is intact."""
        if self._path == STANDARD:
            self._writer.write(points, sys.stdout.buffer)
            sys.stdout.buffer.flush()
            return
        main = self._path.with_suffix(".node") if self._writer.format == "tetgen" else self._path
        for suffix, data in self._writer.companions.items():
            with _replacing(self._path.with_suffix(suffix)) as file:
                file.write(data)
        with _replacing(main) as file:
            self._writer.write(points, file)


def output_format_of(path: Path, given: str | None) -> str | None:
    """The format named or told by the suffix of ``path``; None for a stream, which takes the input's.

    Raises UsageError for an unknown name, or a file whose suffix tells nothing.
    """
    if given is not None:
        return format_named(given)
    name = format_by_suffix(path)
    if name is None and not is_stream(path):
        what = f"its suffix {path.suffix!r}" if path.suffix else "a name without suffix"
        raise UsageError(f"{path}: {what} tells no format; name one of {', '.join(FORMATS)}")
    return name


def is_stream(path: Path) -> bool:
    """Whether ``path`` is stdout, a pipe or a device rather than a file."""
    return path == STANDARD or (path.exists() and not path.is_file() and not path.is_dir())


def check_writable(path: Path) -> None:
    """Raise OutputError if a file cannot be written at ``path``: said before the work, not after it."""
    if path == STANDARD:
        if sys.stdout is None or sys.stdout.isatty():
            raise OutputError("standard output is a terminal; a mesh has to be piped or go to a file")
        return
    target = path.resolve()
    if target.is_dir():
        raise OutputError(f"{path}: is a directory")
    if not target.parent.is_dir():
        raise OutputError(f"{path}: there is no directory {target.parent}")
    if not os.access(target if is_stream(target) else target.parent, os.W_OK):
        raise OutputError(f"{path}: no permission to write in {target.parent}")


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically, in UTF-8; raises OutputError."""
    with _replacing(path) as file:
        file.write(text.encode())


@contextlib.contextmanager
def _replacing(path: Path) -> Iterator[BinaryIO]:
    """A file that takes the place of ``path`` only once it is complete; links and permissions are kept."""
    target = path.resolve()
    try:
        if is_stream(target):
            with target.open("wb") as file:
                yield file
            return
        descriptor, name = tempfile.mkstemp(prefix=f".{target.name[:100]}.", dir=target.parent)
        temporary = Path(name)
        try:
            with os.fdopen(descriptor, "wb") as file:
                os.fchmod(descriptor, _mode_for(target))
                yield file
                file.flush()
                os.fsync(descriptor)
            temporary.replace(target)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(f"{path}: {(error.strerror or str(error)).lower()}") from error


def _mode_for(target: Path) -> int:
    """The permissions of the file that is replaced, or those a new file gets."""
    if target.exists():
        return stat.S_IMODE(target.stat().st_mode)
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
