"""Standard output and error: stdout carries only a mesh or a report, stderr everything else."""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
from collections.abc import Iterator
from typing import TextIO

from dvr_cli.errors import OutputError


def say(message: str, end: str = "\n") -> None:
    """Print on stderr. That nobody can hear it is no reason to fail."""
    if sys.stderr is None:
        return
    try:
        print(message, end=end, file=sys.stderr, flush=True)
    except OSError:
        discard(sys.stderr)


def emit(text: str) -> None:
    """Print a report on stdout; characters its encoding lacks are escaped.

    Raises OutputError if it cannot be written, BrokenPipeError if its reader has gone.
    """
    if sys.stdout is None:
        raise OutputError("standard output is closed")
    encoding = sys.stdout.encoding or "ascii"
    with onto_stdout():
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)


@contextlib.contextmanager
def onto_stdout() -> Iterator[None]:
    """Raise OutputError where stdout cannot be written, BrokenPipeError if its reader has gone."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        discard(sys.stdout)
        raise OutputError(f"standard output: {(error.strerror or str(error)).lower()}") from error


def discard(stream: TextIO) -> None:
    """Send the rest of a stream that cannot be written to nowhere: the interpreter would fail on it."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def error_line(message: str) -> str:
    """``message`` as one printable line, whatever file names are in it."""
    return "dvr: " + "".join(c if c.isprintable() else repr(c)[1:-1] for c in message)


def columns(stream: TextIO | None) -> int | None:
    """The number of columns of the terminal that a stream is connected to; None if it is none."""
    return shutil.get_terminal_size().columns if stream is not None and stream.isatty() else None


def bar() -> str:
    """The character for histograms on stdout: a block where its encoding has it, else ASCII."""
    return "█" if (sys.stdout.encoding or "").lower().replace("-", "") == "utf8" else "#"
