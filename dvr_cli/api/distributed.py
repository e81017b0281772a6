"""Smoothing of meshes that are distributed over the ranks of an MPI job already."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dvr_cli.api.options import SmoothOptions, check_known
from dvr_cli.api.shares import Hooks, Work, smooth_store, takes, tensors_among
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.distributed.dealing import dealt
from dvr_cli.distributed.gathering import Gathered, Piece, gathered
from dvr_cli.distributed.job import LEAD, ending_the_job
from dvr_cli.distributed.lead import LeadEngine
from dvr_cli.distributed.member import take_turns
from dvr_cli.distributed.ranks import on_all, on_lead
from dvr_cli.errors import UsageError
from dvr_cli.mesh.convert import from_arrays
from dvr_cli.quality.measure import Quality
from dvr_cli.relax.engines.choice import KINDS, MeshKind, choose_engine
from dvr_cli.report.records import SmoothReport

if TYPE_CHECKING:
    from dvr_cli.api.adapters.registry import CellArrays

# These name groups that a piece of a mesh does not have, or vertices by their numbers in the whole.
_REFUSED = ("fix", "only", "vertices")


def smooth_distributed(
    comm: Any,
    points: np.ndarray,
    cells: CellArrays,
    vertex_ids: np.ndarray,
    cell_ids: np.ndarray | None = None,
    **options: Any,
) -> tuple[np.ndarray, SmoothReport]:
    """Improve a mesh that is distributed over MPI ranks, all of which have to call this.

    comm: the communicator (mpi4py's). points: (n, 2|3), the vertices that this rank has, ghosts too. cells:
        those that it owns, by local indices, as for ``smooth``; each cell is owned by one rank.
    vertex_ids: (n,) whole numbers, equal for the same vertex on all ranks. cell_ids: (c,) likewise, in the
        order of ``cells``; on all ranks or on none.
    options: as for ``smooth``, the same on all ranks, but for arrays: ``regions`` has a number for each of
        the rank's cells, ``metric`` a tensor for each of its vertices. There are no fix, only, vertices;
        directions are names.

    Returns (points, report) on each rank: new coordinates (n, 2|3) of all vertices it has, ghosts too, and
    the report without what has a row for each vertex or cell (vector, vertices, elements, kept).

    The coordinates are those that ``smooth`` gives, bit for bit, for the mesh whose vertices and cells come
    in the order of their ids; without cell_ids cells come by type, and those of a type in the order of their
    vertices' ids in ascending order. That holds for any number of ranks and any distribution. Random
    directions are drawn for the place of a vertex in that order.

    Linear cells, with the options that docs/distributed.md names, are dealt out anew; no rank has the whole.
    Otherwise the leading rank (0) gathers the mesh, sets up and measures; the sweeps are done on all. So one
    machine's memory bounds the mesh then.

    Raises UsageError and InputError as ``smooth`` does, on all ranks; and where pieces contradict each other.
    """
    piece, given = on_all(comm, lambda: _checked(points, cells, vertex_ids, cell_ids, options))
    if (result := _in_shares(comm, piece, given)) is not None:
        return result
    whole = gathered(comm, piece)
    arrays = {name: comm.gather(getattr(given, name), LEAD) for name in _BY_ROW}
    records = comm.gather(given.record(), LEAD)

    def led() -> tuple[list[np.ndarray], SmoothReport]:
        assert whole is not None
        _check_alike(records, arrays)
        chosen = replace(given, **{name: _BY_ROW[name](whole, rows) for name, rows in arrays.items()})
        moved, report = smooth_mesh(whole.mesh, chosen, make=partial(LeadEngine, comm))
        return [moved[place] for place in whole.places], _without_rows(report)

    each, report = on_lead(comm, led) or (None, None)
    return comm.scatter(each, LEAD), comm.bcast(report, LEAD)


def _checked(
    points: np.ndarray,
    cells: CellArrays,
    vertex_ids: np.ndarray,
    cell_ids: np.ndarray | None,
    options: dict[str, Any],
) -> tuple[Piece, SmoothOptions]:
    """The piece of this rank and the options; UsageError or InputError for what can be seen to be wrong."""
    check_known(options)
    for name in _REFUSED:
        if options.get(name) is not None:
            raise UsageError(f"{name}: not for meshes that are distributed")
    given = SmoothOptions.of(options)
    if not all(isinstance(entry, str) for entry in given.entries):
        raise UsageError("directions: names only, where meshes are distributed")
    ids = None if cell_ids is None else np.asarray(cell_ids)
    piece = Piece(from_arrays(np.asarray(points), cells), np.asarray(vertex_ids), ids)
    for name, count in ("regions", piece.count), ("metric", len(piece.vertices)):
        rows = getattr(given, name)
        if isinstance(rows, np.ndarray) and len(rows) != count:
            raise UsageError(f"{name}: {count} rows are needed on this rank, not {len(rows)}")
    return piece, given


def _in_shares(comm: Any, piece: Piece, options: SmoothOptions) -> tuple[np.ndarray, SmoothReport] | None:
    """The result where no rank needs the whole; None on all ranks where one does, or anything is wrong."""
    metric = options.metric if isinstance(options.metric, np.ndarray) else None
    good = takes(options) and (options.metric is None or metric is not None)
    kind = None if metric is None else (metric.shape[1:], metric.dtype.str)
    record = options.record() | {"metric": kind}
    chosen = comm.allgather((record if good else None, piece.count))
    if chosen[0][0] is None or any(record != chosen[0][0] for record, _ in chosen):
        return None
    with ending_the_job(comm):
        share = dealt(comm, piece, metric)
    if share is None:
        return None
    of_work = share.store.size, options.stopping.max_iterations, options.takes_patches
    mesh = MeshKind(planar=share.store.kinds.dimension == 2, measured=metric is not None)
    engine = comm.bcast(on_all(comm, lambda: choose_engine(options.engine, *of_work, mesh=mesh)).name, LEAD)
    with ending_the_job(comm):
        take_turns(KINDS[engine])
        work = Work(options, engine, False, share.counts, once=False)
        if share.field is not None:
            work = work._replace(tensors=tensors_among(comm, share.store, share.field))
            if work.tensors is None:
                return None
        done = smooth_store(comm, share.store, work, Hooks())
        if done is None:
            return None
        return share.of_piece(done.vertices, done.points), _without_rows(done.report)


def _check_alike(records: list[dict[str, Any]], arrays: dict[str, list[Any]]) -> None:
    """Raise UsageError unless all ranks gave the same options, and each array on all or none of them."""
    for name, given in arrays.items():
        if len({isinstance(rows, np.ndarray) for rows in given}) > 1:
            raise UsageError(f"{name}: an array on some ranks, and none on others")
    by_row = {name for name, given in arrays.items() if isinstance(given[0], np.ndarray)}
    for name in sorted(records[0].keys() - by_row):
        if any(record[name] != records[0][name] for record in records):
            raise UsageError(f"{name}: not the same on all ranks")


def _joined(rows: list[Any], places: list[np.ndarray], n: int) -> Any:
    """The array of the whole of which each rank gave its rows; the value itself where it is no array.

    places: for each rank the place of each of its rows in the whole, which has n.
    """
    first = rows[0]
    if not isinstance(first, np.ndarray):
        return first
    whole = np.zeros((n, *first.shape[1:]), dtype=first.dtype)
    for part, place in zip(rows, places, strict=True):
        whole[place] = part
    return whole


# The options that may be arrays, and how these are put together on the leading rank.
_BY_ROW: dict[str, Callable[[Gathered, list[Any]], Any]] = {
    "regions": lambda whole, rows: _joined(rows, whole.cells, sum(map(len, whole.cells))),
    "metric": lambda whole, rows: _joined(rows, whole.places, len(whole.mesh.points)),
}


def _without_rows(report: SmoothReport) -> SmoothReport:
    """The report without what has a row for each vertex or cell."""
    plain = report.plain and (_summary(report.plain[0]), _summary(report.plain[1]))
    return replace(
        report, before=_summary(report.before), after=_summary(report.after), plain=plain, kept=None
    )


def _summary(quality: Quality) -> Quality:
    none, nowhere = np.empty(0), np.empty(0, dtype=np.int64)
    return replace(quality, vector=none, vertices=nowhere, elements=none)
