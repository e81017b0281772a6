"""Runs: cells of one type that come one after the other in a VTK file, as processes read ranges of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dvr_cli.files.ranges import LINEAR, Counted, Field, Part, Ranges, Rows, Table
from dvr_cli.files.vtk.cells import MAX_BLOCKS, NODE_ORDER, VTK_TYPE
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.regions import is_no_region, is_region_name

_NAME = {VTK_TYPE[name]: name for name in LINEAR}
_CHUNK = 1 << 20  # cells whose types are looked at together


@dataclass(frozen=True)
class Run:
    """The cells first .. first + count of a file, all of one type; start: how many nodes come before."""

    type: str
    first: int
    count: int
    start: int

    @property
    def nodes(self) -> int:
        """The number of nodes of each cell."""
        return CELL_TYPES[self.type].nodes

    def cells(self, nodes: Rows) -> Rows:
        """Its cells, a row each; nodes: of all cells of the file, one after the other."""
        return replace(nodes, begin=nodes.offset(self.start), columns=self.nodes, count=self.count)


def ranges_of_cells(
    path: Path,
    points: Rows,
    types: Rows,
    nodes: int,
    part_of: Callable[[Run], tuple[Rows, Counted]],
    data: Mapping[str, Rows],
    fields: Mapping[str, Rows],
) -> Ranges | None:
    """The ranges of a file with these points and types of cells; None where a process has to read it whole.

    nodes: of all cells together. part_of: where those of the cells of a run are, and what says how many each
    has. data: of the cells, and fields: of the points, one row each.
    """
    runs, tags = _runs(path, types, nodes), _tags_among(data)
    if runs is None or tags is None:
        return None
    cells = []
    for run in runs:
        rows, sizes = part_of(run)
        known = Counted(types.part(run.first, run.count), (VTK_TYPE[run.type],))
        of_run = tuple(rows.part(run.first, run.count) for rows in tags.values())
        cells.append((run.type, Table((Part(rows, (known, sizes), of_run),))))
    order = {name: NODE_ORDER[VTK_TYPE[name]] for name in LINEAR if VTK_TYPE[name] in NODE_ORDER}
    of_points = {name: Field(Table((Part(rows),))) for name, rows in fields.items()}
    return Ranges(Table((Part(points),)), tuple(cells), names=tuple(tags), order=order, fields=of_points)


def _tags_among(data: Mapping[str, Rows]) -> dict[str, Rows] | None:
    """The cell data that may tell regions apart; None where a process has to look at all values to know."""
    tags = {}
    for name, rows in data.items():
        number, named = np.dtype(rows.dtype), is_region_name(name)
        if rows.columns > 1 or (is_no_region(name) and not named) or (number.kind == "f" and not named):
            continue
        if number == np.uint64:
            return None
        tags[name] = rows
    return tags


def _runs(path: Path, types: Rows, nodes: int) -> list[Run] | None:
    """The runs of cells; None for other types, and for more runs than keep the order of the file."""
    first = int(types.read(path, 0, 1).sum())
    if first in _NAME and CELL_TYPES[_NAME[first]].nodes * types.count == nodes:
        return [Run(_NAME[first], 0, types.count, 0)]  # so it seems: whoever reads the cells finds out
    bounds, before = [0], first
    for lo in range(0, types.count, _CHUNK):
        some = types.read(path, lo, min(lo + _CHUNK, types.count))[:, 0].astype(np.int64)
        bounds += (lo + np.flatnonzero(np.diff(some, prepend=before))).tolist()
        if len(bounds) > MAX_BLOCKS or not len(some):
            return None
        before = some[-1]
    runs, start = [], 0
    for lo, hi in zip(bounds, [*bounds[1:], types.count], strict=True):
        code = int(types.read(path, lo, lo + 1).sum())
        if code not in _NAME:
            return None
        runs.append(Run(_NAME[code], lo, hi - lo, start))
        start += runs[-1].count * runs[-1].nodes
    return runs if start == nodes else None
