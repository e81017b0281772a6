"""Writing a mesh that no rank has whole: a copy of the input, into which each rank writes its coordinates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dvr_cli.distributed.job import LEAD
from dvr_cli.errors import DvrError
from dvr_cli.files.ranges import Table
from dvr_cli.files.writing import replacing


def stale_parts(comm: Any, source: Path, table: Table, first: int, values: np.ndarray) -> set[int]:
    """The flags of parts of which numbers are to be dropped, as a rank has other rows, on all ranks.

    The arguments: see ``write_copy``.
    """
    return set().union(*comm.allgather(table.stale(source, first, values)))


def write_copy(
    comm: Any, source: Path, output: Path, table: Table, first: int, values: np.ndarray, stale: set[int]
) -> DvrError | None:
    """Write a copy of ``source`` with other rows at ``output``, on all ranks together.

    table: where they lie. values: (n, columns) those of this rank, from the row ``first`` on. stale: see
    ``stale_parts``. Returns on the leading rank what went wrong: then what was at ``output`` is still there.
    """
    there = table.without(stale)
    if comm.rank != LEAD:
        copy = comm.bcast(None, LEAD)
        if copy is not None:
            comm.gather(_written(comm, copy, there, first, values), LEAD)
        return None
    told = False
    try:
        with replacing(output) as copy:
            table.copy_without(source, copy, stale)
            comm.bcast(copy, LEAD)
            told = True
            faults = comm.gather(_written(comm, copy, there, first, values), LEAD)
            if any(faults):
                raise OSError(next(filter(None, faults)))
    except DvrError as error:
        if not told:
            comm.bcast(None, LEAD)
        return error
    return None


def _written(comm: Any, path: Path, table: Table, first: int, values: np.ndarray) -> str | None:
    """Write the rows of all ranks with MPI-IO; what went wrong on this one."""
    from mpi4py import MPI

    try:
        file = MPI.File.Open(comm, str(path), MPI.MODE_WRONLY)
    except MPI.Exception as error:
        return str(error.Get_error_string())
    fault = None
    try:
        done = 0
        for part, lo, hi in table.stretches(first, first + len(values)):
            data = part.rows.patched(path, lo, values[done : done + hi - lo])
            file.Write_at(part.rows.offset(lo), data)
            done += hi - lo
    except MPI.Exception as error:
        fault = str(error.Get_error_string())
    except OSError as error:
        fault = error.strerror or str(error)
    try:
        file.Sync()
    except MPI.Exception as error:
        fault = fault or str(error.Get_error_string())
    file.Close()
    return fault
