"""Writing a mesh that no rank has whole: a copy of the input, into which each rank writes its coordinates."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from dvr_cli.distributed.job import LEAD
from dvr_cli.errors import DvrError
from dvr_cli.files.ranges import Rows
from dvr_cli.files.writing import replacing


def write_copy(
    comm: Any, source: Path, output: Path, rows: Rows, first: int, values: np.ndarray
) -> DvrError | None:
    """Write a copy of ``source`` with other rows at ``output``, on all ranks together.

    rows: where they lie. values: (n, columns) those of this rank, from the row ``first`` on. Returns on the
    leading rank what went wrong: then what was at ``output`` is still there.
    """
    if comm.rank != LEAD:
        copy = comm.bcast(None, LEAD)
        if copy is not None:
            comm.gather(_written(comm, copy, rows, first, values), LEAD)
        return None
    told = False
    try:
        with replacing(output) as copy:
            shutil.copyfile(source, copy)
            comm.bcast(copy, LEAD)
            told = True
            faults = comm.gather(_written(comm, copy, rows, first, values), LEAD)
            if any(faults):
                raise OSError(next(filter(None, faults)))
    except DvrError as error:
        if not told:
            comm.bcast(None, LEAD)
        return error
    return None


def _written(comm: Any, path: Path, rows: Rows, first: int, values: np.ndarray) -> str | None:
    """Write the rows of all ranks with MPI-IO; what went wrong on this one."""
    from mpi4py import MPI

    try:
        file = MPI.File.Open(comm, str(path), MPI.MODE_WRONLY)
    except MPI.Exception as error:
        return str(error.Get_error_string())
    fault = None
    try:
        stored = np.ascontiguousarray(values, dtype=rows.dtype)
        file.Write_at_all(rows.offset(first), stored.view(f"u{stored.itemsize}"))
    except MPI.Exception as error:
        fault = str(error.Get_error_string())
    try:
        file.Sync()
    except MPI.Exception as error:
        fault = fault or str(error.Get_error_string())
    file.Close()
    return fault
