"""Reading a mesh that no rank has whole: each rank reads a range of its vertices and cells from the file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dvr_cli.distributed.numbering import Numbering
from dvr_cli.distributed.ranks import agree
from dvr_cli.distributed.rows import bounds, index_type, owner_of, sent
from dvr_cli.distributed.shares import CellRows, Kinds, Store, joined
from dvr_cli.errors import InputError
from dvr_cli.files.ranges import Ranges, Table
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import is_computable
from dvr_cli.mesh.groups import is_physical
from dvr_cli.mesh.ranks import distinct
from dvr_cli.mesh.regions import names_of_regions

_MOST = 100_000  # values of a tag, and kinds of cells, that all ranks may know
_LARGEST = 2**62  # of tags


class Read(NamedTuple):
    """The rows that a rank has read.

    points: (n, 3). numbers: (n, 1) by which cells name them, None where these count. cells: of each table of
    the ranges, those of this rank, in the order of the file. kinds: of each table the distinct tags of its
    cells, and (c,) which of them each has. field: (f, k) of the field that was asked for, and named: (f, 1)
    the numbers of the vertices of its rows, None where these are those of ``points``.
    """

    points: np.ndarray
    cells: list[np.ndarray]
    kinds: list[tuple[list[tuple[int, ...]], np.ndarray]]
    numbers: np.ndarray | None = None
    field: np.ndarray | None = None
    named: np.ndarray | None = None


def read_share(comm: Any, source: Path, ranges: Ranges, field: str | None = None) -> Read | None:
    """The rows of this rank; None where they are not what the ranges say.

    field: the name of point data to be read, too. Raises InputError for a file that cannot be read.
    """
    cells, kinds = [], []
    tables = {"points": ranges.points, "numbers": ranges.numbers}
    if field is not None:
        tables |= {"field": ranges.fields[field].rows, "named": ranges.fields[field].numbers}
    found = {}
    try:
        for name, table in tables.items():
            if table is None:
                continue
            rows = table.read(source, *own_range(comm, table))
            if rows is None:
                return None
            found[name] = rows
        if not is_computable(found["points"]):
            return None
        for name, table in ranges.cells:
            own = own_range(comm, table)
            rows = table.read(source, *own)
            if rows is None:
                return None
            cells.append(rows[:, ranges.order[name]] if name in ranges.order else rows)
            kinds.append(table.kinds(source, *own))
            if len(kinds[-1][0]) > _MOST or any(
                abs(tag) >= _LARGEST for tags in kinds[-1][0] for tag in tags
            ):
                return None
    except OSError as error:
        raise InputError(f"{source}: {(error.strerror or str(error)).lower()}") from error
    return Read(cells=cells, kinds=kinds, **found)


def with_indices(comm: Any, ranges: Ranges, read: Read | None) -> tuple[Read, np.ndarray] | None:
    """The rows of this rank by the index of vertices; and (k,) of the vertices that links tie to others.

    These ascend and are of the whole. A field has a row for each of the vertices that this rank has read.
    None on all ranks where one has read nothing, or cells name no vertices.
    """
    if not agree(comm, read is not None) or read is None:
        return None
    size = ranges.points.count
    numbering = Numbering(comm, size, ranges.base, None if read.numbers is None else read.numbers[:, 0])
    if not numbering.sound:
        return None
    good = True
    for nth, named in enumerate(read.cells):
        cells = numbering.find(named)
        good = good and _names_vertices(cells, size)
        read.cells[nth] = cells.astype(index_type(size), copy=False)
    if not agree(comm, good):
        return None
    linked = np.empty(0, dtype=np.int64)
    if len(ranges.linked):
        first, last = bounds(len(ranges.linked), comm.size)[comm.rank : comm.rank + 2]
        pairs = numbering.find(ranges.linked[first:last])
        pairs = pairs[((pairs >= 0) & (pairs < size)).all(axis=1)]
        linked = distinct(np.concatenate(comm.allgather(pairs.ravel().astype(np.int64))))
    if read.named is not None and read.field is not None:
        read = read._replace(field=_of_vertices(comm, size, numbering.find(read.named[:, 0]), read.field))
    return read._replace(numbers=None, named=None), linked


def _of_vertices(comm: Any, size: int, index: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(n, k) the last row that any rank has for each vertex of the range of this rank, NaN where none has.

    index: (f,) of the vertices of the rows (f, k), none of ``size`` vertices where they are for none.
    """
    known, ranges = (index >= 0) & (index < size), bounds(size, comm.size)
    index, rows = sent(comm, owner_of(index[known], ranges), index[known], rows[known])
    first, last = ranges[comm.rank : comm.rank + 2]
    own = np.full((last - first, rows.shape[1]), np.nan)
    own[index - first] = rows
    return own


def values_of_tags(comm: Any, source: Path, ranges: Ranges) -> list[np.ndarray | None]:
    """The distinct values of each tag among the rows of this rank, None where some are no whole numbers.

    Raises InputError as ``read_share``.
    """
    tables = [(table, *own_range(comm, table)) for _, table in ranges.cells]
    found: list[np.ndarray | None] = []
    try:
        for nth in range(len(ranges.names)):
            parts = [table.values(source, first, last, nth) for table, first, last in tables]
            whole = [part for part in parts if part is not None]
            found.append(distinct(np.concatenate(whole)) if len(whole) == len(parts) else None)
    except OSError as error:
        raise InputError(f"{source}: {(error.strerror or str(error)).lower()}") from error
    return found


def with_regions(
    comm: Any, ranges: Ranges, values: list[np.ndarray | None]
) -> tuple[Ranges, tuple[str, ...]] | None:
    """The ranges without tags that say nothing, and the names of those that tell regions apart.

    values: of each tag, those of this rank. None on all ranks where a tag that counts has too many.
    """
    known: dict[str, int] = {}
    for name, own in zip(ranges.names, values, strict=True):
        if not agree(comm, own is not None) or own is None:
            continue  # it is no tag
        if max(comm.allgather(len(own))) > _MOST:
            known[name] = _MOST + 1
        else:
            known[name] = len(distinct(np.concatenate(comm.allgather(own))))
    regions = names_of_regions(known, sum(ranges.counts.values()))
    tags = [name for name in known if name in regions or is_physical(name)]
    kept = [nth for nth, name in enumerate(ranges.names) if name in tags]
    names = tuple(ranges.names[nth] for nth in kept)
    if any(known[name] > _MOST for name in names):
        return None
    cells = tuple((name, table.with_tags(kept)) for name, table in ranges.cells)
    return replace(ranges, cells=cells, names=names), regions


def own_range(comm: Any, table: Table) -> tuple[int, int]:
    """The first row of a table that this rank reads, and the one behind the last."""
    first, last = bounds(table.count, comm.size)[comm.rank : comm.rank + 2].tolist()
    return first, last


def store_of(comm: Any, ranges: Ranges, regions: tuple[str, ...], read: Read) -> Store:
    """The store of this rank, on all ranks together, from what each has read; regions: see ``Kinds``."""
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
    all_kinds = Kinds(types, table_of_tags.reshape(shape), ranges.names, groups, regions)
    rows = joined(main, index), joined(lower, index)
    return Store(comm, ranges.points.count, all_kinds, read.points, *rows)


def _names_vertices(cells: np.ndarray, n: int) -> bool:
    """True if each of the cells (c, k) has k of n vertices, no one twice."""
    if not len(cells):
        return True
    ordered = np.sort(cells, axis=1)
    if ordered[:, 0].min() < 0 or ordered[:, -1].max() >= n:
        return False
    return bool((ordered[:, 1:] != ordered[:, :-1]).all())
