"""Arrays given by the user in files: direction fields."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dvr_cli.errors import InputError, UsageError


def read_directions(path: Path) -> np.ndarray:
    """The array in a .npy, .csv (comma-separated) or .txt (blank-separated) file.

    Raises UsageError for other suffixes and for text that is not a table of numbers, InputError for a file
    that cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix not in (".npy", ".csv", ".txt"):
        raise UsageError(f"directions file:{path}: unknown suffix {suffix!r}; known: .npy, .csv, .txt")
    try:
        with path.open("rb") as file:
            if not file.read(1):
                raise UsageError(f"directions file:{path}: the file is empty")
            file.seek(0)
            if suffix == ".npy":
                return np.lib.format.read_array(file, allow_pickle=False)
            return np.loadtxt(file, delimiter="," if suffix == ".csv" else None, ndmin=2)
    except OSError as error:
        raise InputError(f"directions file:{path}: {(error.strerror or str(error)).lower()}") from error
    except ValueError as error:
        raise UsageError(f"directions file:{path}: {str(error).splitlines()[0]}") from error
