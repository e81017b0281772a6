"""Reading a mesh that no rank has whole: each rank reads a range of its vertices and cells from the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dvr_cli.distributed.rows import bounds
from dvr_cli.distributed.shares import CellRows, Kinds, Store, joined
from dvr_cli.errors import InputError
from dvr_cli.files.ranges import Ranges, Table
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import is_computable


class Read(NamedTuple):
    """The rows that a rank has read.

    points: (n, 3). cells: of each table of the ranges, those of this rank by index, in the order of the file.
    kinds: of each table the distinct tags of its cells, and (c,) which of them each has.
    """

    points: np.ndarray
    cells: list[np.ndarray]
    kinds: list[tuple[list[tuple[int, ...]], np.ndarray]]


def read_share(comm: Any, source: Path, ranges: Ranges) -> Read | None:
    """The rows of this rank; None where they are not what the ranges say, or name no vertices.

    Raises InputError for a file that cannot be read.
    """
    cells, kinds = [], []
    index = np.int32 if ranges.points.count <= np.iinfo(np.int32).max else np.int64
    try:
        points = ranges.points.read(source, *own_range(comm, ranges.points))
        if points is None or not is_computable(points):
            return None
        for name, table in ranges.cells:
            own = own_range(comm, table)
            rows = table.read(source, *own)
            if rows is None:
                return None
            if not _names_vertices(rows, ranges.base, ranges.points.count):
                return None
            if name in ranges.order:
                rows = rows[:, ranges.order[name]]
            cells.append((rows - rows.dtype.type(ranges.base)).astype(index))
            kinds.append(table.kinds(source, *own))
    except OSError as error:
        raise InputError(f"{source}: {(error.strerror or str(error)).lower()}") from error
    return Read(points, cells, kinds)


def own_range(comm: Any, table: Table) -> tuple[int, int]:
    """The first row of a table that this rank reads, and the one behind the last."""
    first, last = bounds(table.count, comm.size)[comm.rank : comm.rank + 2].tolist()
    return first, last


def store_of(comm: Any, ranges: Ranges, read: Read) -> Store:
    """The store of this rank, on all ranks together, from what each has read."""
    names = [name for name, _ in ranges.cells]
    mine = {(name, tags) for name, (known, _) in zip(names, read.kinds, strict=True) for tags in known}
    known = sorted(set().union(*comm.allgather(mine)))
    number = {kind: i for i, kind in enumerate(known)}
    main: list[CellRows] = []
    lower: list[CellRows] = []
    before = 0
    index = read.cells[0].dtype
    for (name, table), cells, (tags, which) in zip(ranges.cells, read.cells, read.kinds, strict=True):
        kinds = np.array([number[name, some] for some in tags], np.min_scalar_type(len(known)))[which]
        ids = before + own_range(comm, table)[0] + np.arange(len(cells), dtype=np.int64)
        moves = CELL_TYPES[name].dimension == ranges.dimension
        (main if moves else lower).append(CellRows(ids, cells, kinds))
        before += table.count
    table_of_tags = np.array([tags for _, tags in known], dtype=np.int64)
    shape = len(known), len(ranges.names)
    types, groups = tuple(name for name, _ in known), tuple(ranges.groups.items())
    all_kinds = Kinds(types, table_of_tags.reshape(shape), ranges.names, groups)
    rows = joined(main, index), joined(lower, index)
    return Store(comm, ranges.points.count, all_kinds, read.points, *rows)


def _names_vertices(cells: np.ndarray, base: int, n: int) -> bool:
    """True if each of the cells (c, k) names k of n vertices, counted from ``base``, no one twice."""
    if not len(cells):
        return True
    ordered = np.sort(cells, axis=1)
    if ordered[:, 0].min() < base or ordered[:, -1].max() >= base + n:
        return False
    return bool((ordered[:, 1:] != ordered[:, :-1]).all())
