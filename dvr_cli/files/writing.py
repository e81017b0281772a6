"""From coordinates to a file: same format patched, other formats through meshio, always atomically."""

from __future__ import annotations

import contextlib
import io
import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import OutputError, UsageError
from dvr_cli.files.formats import FORMATS, Format, format_named, formats_by_suffix
from dvr_cli.files.reading import STANDARD
from dvr_cli.files.source import Source

_DEVICES = (Path("/dev"), Path("/dev/fd"))  # where streams have names, whatever they lead to


class Output:
    """The output of a run: the place and the format in which the mesh is written."""

    def __init__(
        self, source: Source, path: Path, format_name: str | None = None, field: str | None = None
    ) -> None:
        """path: the file to write, or "-" for stdout; format_name: by default the suffix tells.
        field: the name of a cell field that the output is to have beyond those of the input, see ``fill``.

        A pipe, a device and stdout get the format of the input unless one is named.
        Raises UsageError for an unknown format or one that cannot hold the field, OutputError for one that
        cannot be had.
        """
        record = output_format_of(path, format_name, source.format) or format_named(source.format)
        self._path = path
        with _naming_output(path):
            same = record.name == source.format
            if same and not record.patched:
                raise OutputError(
                    f"{record.name} files are read by meshio, which may lose what it does not know: they are "
                    "not written back; write .vtu or another format"
                )
            self._writer = source if same else record.convert(source.mesh, source.unread)
        self._writer.target = None if is_stream(path) else path
        self._field = field
        if field is not None:
            self.fill([np.zeros(len(block.vertices)) for block in source.mesh.cells], source.mesh.points)
        self.stored(source.mesh.points)  # what cannot be written is found out now

    @property
    def notes(self) -> list[str]:
        """The things that the output cannot keep, known once ``stored`` or ``write`` was called."""
        return self._writer.notes

    def fill(self, values: list[np.ndarray], points: np.ndarray) -> None:
        """Set the field: its value in each cell, one array a block. points: what is to be written with it."""
        with _naming_output(self._path):
            self._writer = self._writer.with_cell_field(self._field or "", values, points)

    def stored(self, points: np.ndarray) -> np.ndarray:
        """``points`` as a reader of the output will get them."""
        with _naming_output(self._path):
            return self._writer.stored(points)

    def keep_parameters(self, parameters: dict[int, np.ndarray]) -> None:
        """Have these parameters written, where the output has a place for them; see ``Source``."""
        self._writer.parameters = parameters

    def rounding(self, points: np.ndarray) -> float:
        """The largest change of a coordinate with which the output keeps ``points`` (N, D)."""
        return float(np.abs(self.stored(points) - points).max(initial=0.0))

    def widen(self) -> bool:
        """Have coordinates stored with more digits from now on; False if they are already or cannot be."""
        wide = self._writer.widened()
        if wide is None:
            return False
        wide.notes.append(wide.wider)
        wide.target = self._writer.target
        self._writer = wide
        return True

    def write(self, points: np.ndarray) -> None:
        """Write the mesh with coordinates ``points``; raises OutputError, and then the old file is intact."""
        if self._path == STANDARD:
            stream = _whole(sys.stdout.buffer)
            self._writer.write(points, stream)
            stream.flush()
            return
        with contextlib.ExitStack() as files:  # none takes its place unless all could be written
            for path, data in self._writer.companions(points).items():
                companion = files.enter_context(_replacing(path))
                companion.write(data)
                companion.flush()
            self._writer.write(points, files.enter_context(_replacing(self._writer.main or self._path)))


def output_format_of(path: Path, given: str | None, of_input: str | None = None) -> Format | None:
    """The format named or told by the suffix of ``path``; None for a stream, which takes the input's.

    of_input: the input's format, which is taken where several share the suffix.

    Raises UsageError for an unknown name, or a file whose suffix tells nothing.
    """
    if given is not None:
        return format_named(given)
    known = formats_by_suffix(path)
    if not known and not is_stream(path):
        what = f"its suffix {path.suffix!r}" if path.suffix else "a name without suffix"
        raise UsageError(f"{path}: {what} tells no format; name one of {', '.join(FORMATS)}")
    return next((record for record in known if record.name == of_input), known[0] if known else None)


def is_stream(path: Path) -> bool:
    """True if ``path`` is stdout, a pipe or a device rather than a file."""
    if path == STANDARD or path.parent in _DEVICES:
        return True
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


def check_writable(path: Path) -> None:
    """Raise OutputError if a file cannot be written at ``path``: said before the work, not after it."""
    if path == STANDARD:
        if sys.stdout is None or sys.stdout.isatty():
            raise OutputError("standard output is a terminal; a mesh has to be piped or go to a file")
        return
    with _naming(path), contextlib.suppress(FileNotFoundError, NotADirectoryError):
        path.stat()  # fails for a name too long, links in a circle
    if is_stream(path):
        if not os.access(path, os.W_OK):
            raise OutputError(f"{path}: no permission to write to it")
        return
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise OutputError(f"{path}: is a directory")
    if not target.parent.is_dir():
        raise OutputError(f"{path}: there is no directory {target.parent}")
    if not os.access(target.parent, os.W_OK):
        raise OutputError(f"{path}: no permission to write in {target.parent}")


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically, in UTF-8; raises OutputError."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file atomically; raises OutputError."""
    with _replacing(path) as file:
        file.write(data)


@contextlib.contextmanager
def _replacing(path: Path) -> Iterator[BinaryIO]:
    """A file that takes the place of ``path`` only once it is complete; links and permissions are kept."""
    if is_stream(path):
        with _naming(path), path.open("wb") as file:
            yield file
        return
    with replacing(path) as temporary, temporary.open("wb") as file:
        yield file


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """The path of an empty file that takes the place of that at ``path``, unless there is an error.

    Links and permissions are kept. OSErrors are raised as OutputErrors that name ``path``.
    """
    with _naming(path):
        target = Path(os.path.realpath(path))
        descriptor, name = tempfile.mkstemp(prefix=f".{target.name[:40]}.", dir=target.parent)
        temporary = Path(name)
        try:
            try:
                os.fchmod(descriptor, _mode_for(target))
                yield temporary
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
            temporary.replace(target)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


@contextlib.contextmanager
def _naming_output(path: Path) -> Iterator[None]:
    """Put the output's name before what cannot be written, or asked for, in its format."""
    try:
        yield
    except (UsageError, OutputError) as error:
        raise type(error)(f"{path}: {error}") from error


@contextlib.contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Name the file in what the system reports, as OutputError; but for a reader that has gone."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(f"{path}: {(error.strerror or str(error)).lower()}") from error


def _whole(stream: BinaryIO) -> BinaryIO:
    """A stream that writes all it is given; unbuffered stdout (PYTHONUNBUFFERED) may stop half way."""
    return io.BufferedWriter(stream) if isinstance(stream, io.RawIOBase) else stream


def _mode_for(target: Path) -> int:
    """The permissions of the file that is replaced, or those a new file gets."""
    if target.exists():
        return stat.S_IMODE(target.stat().st_mode)
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
