"""Arrays given by the user in files: direction fields, displacements and lists of vertices."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dvr_cli.errors import InputError, UsageError


def read_directions(path: Path) -> np.ndarray:
    """The direction field in a file; see ``_read`` for the kinds of file and the errors."""
    return _read(path, f"directions file:{path}")


def read_displacement(path: Path) -> np.ndarray:
    """The displacement in a file; see ``_read``."""
    return _read(path, f"displacement {path}")


def read_vertices(path: Path) -> np.ndarray:
    """(k,) the vertex numbers in a file, in lines and columns of any length; see ``_read``.

    Raises UsageError if not all of them are whole numbers.
    """
    what = f"vertices {path}"
    return whole_numbers(_read(path, what), what)


def whole_numbers(values: np.ndarray, what: str) -> np.ndarray:
    """``values`` as (k,) int64, from any shape and any type of number; UsageError where one is not whole."""
    flat = values.ravel()
    if flat.dtype.kind not in "iuf":
        raise UsageError(f"{what}: not numbers of vertices")
    wrong = flat[~(np.abs(flat) < 2**53) | (flat != np.rint(flat))]
    if len(wrong):
        raise UsageError(f"{what}: {wrong[0]} is not the number of a vertex")
    return flat.astype(np.int64)


def _read(path: Path, what: str) -> np.ndarray:
    """The array in a .npy, .csv (comma-separated) or .txt (blank-separated) file.

    what: how errors call it. Raises UsageError for other suffixes and for text that is not a table of
    numbers, InputError for a file that cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix not in (".npy", ".csv", ".txt"):
        raise UsageError(f"{what}: unknown suffix {suffix!r}; known: .npy, .csv, .txt")
    try:
        with path.open("rb") as file:
            if not file.read(1):
                raise UsageError(f"{what}: the file is empty")
            file.seek(0)
            if suffix == ".npy":
                return np.lib.format.read_array(file, allow_pickle=False)
            return np.loadtxt(file, delimiter="," if suffix == ".csv" else None, ndmin=2)
    except OSError as error:
        raise InputError(f"{what}: {(error.strerror or str(error)).lower()}") from error
    except ValueError as error:
        raise UsageError(f"{what}: {str(error).splitlines()[0]}") from error
