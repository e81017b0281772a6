"""Setting up a mesh that no rank has whole: what each rank moves, keeps and measures of it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from dvr_cli.api.boundary import Moves
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.share_selection import masks_of, regions_of_kinds
from dvr_cli.boundary.freedom import interior_freedom
from dvr_cli.distributed.layers import Layers, among_cells, layers_among, may_have_layers, own_shapes_of
from dvr_cli.distributed.orientation import mirrored_of
from dvr_cli.distributed.ranks import agree, on_all
from dvr_cli.distributed.share_quality import View
from dvr_cli.distributed.share_targets import ShareTargets
from dvr_cli.distributed.shared_parts import Share, share_of
from dvr_cli.distributed.shares import Local, Store
from dvr_cli.distributed.sliding import sliding
from dvr_cli.errors import InputError, UsageError
from dvr_cli.mesh.corners import Corners
from dvr_cli.mesh.domain import Domain, domain_of
from dvr_cli.mesh.orientation import are_alike
from dvr_cli.mesh.region_choice import NONE, Divider, RegionChoice
from dvr_cli.quality.mean_ratio import DEGENERATE, corner_qualities
from dvr_cli.quality.stretching import REACH, held_by


class Work(NamedTuple):
    """The work of a job: how the vertices of a mesh move, and what is said of that.

    engine: the name of a kind. vector: whether the leading rank gets quality vectors. counts: how many cells
    of each type the whole has. once: whether a lower cell that is there twice would have to count once.
    tensors: (n, k, k) of a metric, of the vertices that the rank owns, None without one.
    """

    options: SmoothOptions
    engine: str
    vector: bool
    counts: dict[str, int]
    once: bool
    tensors: np.ndarray | None = None


class Mine(NamedTuple):
    """The work of a rank: its cells, their domain, how its vertices move, its share, its view of all.

    mirrored: (c,) bool, the cells stored inside out, None where their measures say so. regions: (kinds,) of
    the cells of each kind; dividers: what tells them apart. movable: (n,) bool, vertices that could move, and
    masks: for each criterion those that it lets move, right for those of the rank. layers: what is kept, and
    max_aspect: the largest aspect of that, or that the metric asks for; targets: what the corners of the
    domain are measured against for that, and plain: with ideal ones.
    """

    local: Local
    domain: Domain
    mirrored: np.ndarray | None
    regions: np.ndarray
    dividers: tuple[Divider, ...]
    movable: np.ndarray
    masks: dict[str, np.ndarray]
    moves: Moves
    share: Share
    view: View
    layers: Layers | None
    max_aspect: float
    targets: ShareTargets
    plain: Corners


def prepared(comm: Any, store: Store, work: Work, backend: Any) -> Mine | None:
    """The work of this rank; None on all ranks where the mesh has to be on one, see ``smooth_shares``."""
    is_surface = len(store.axes) > store.kinds.dimension
    if is_surface or not agree(comm, len(store.cells.ids) > 0):
        return None
    if work.once and not agree(comm, not _has_repeated(store)):
        return None
    try:
        regions, dividers = regions_of_kinds(comm, store, work.options.region_choice)
    except UsageError:  # the leading rank will say so
        return None
    local = store.local(store.cells, store.lower)
    oriented = _oriented(comm, store, local, regions, backend)
    if oriented is None:
        return None
    domain, mirrored, quality = oriented
    owned, layers = store.owned(store.cells.cells), None
    shape = "metric" if work.tensors is not None else work.options.shape
    if shape == "auto":
        layers = _layers(comm, store, local, domain, mirrored, quality)
    held = np.zeros(len(local.number), dtype=bool)
    if layers is not None:
        held = store.as_owned(local, held_by(domain, layers.kept, quality))
    if shape == "input":
        layers = own_shapes_of(comm, domain, owned, quality)
    tensors = None if work.tensors is None else store.of_others(local.number, work.tensors)[0]
    targets, plain = ShareTargets(None if layers is None else layers.kept, held, tensors), domain.corners
    try:
        domain, asked_for = on_all(comm, partial(targets.on, domain))
    except InputError:  # the leading rank will say so
        return None
    max_aspect = max(comm.allgather(asked_for)) if layers is None else layers.max_aspect
    del oriented, quality  # large, and needed no more
    moves = Moves(interior_freedom(domain.interior, domain.dimension), None)
    if work.options.boundary == "slide":
        slides = sliding(comm, store, local, domain)
        if slides is None:
            return None
        moves = Moves(slides[0], None, slides[1])
    try:
        masks = masks_of(store, local, domain, work.options.selection)
    except UsageError:
        return None
    moves = replace(moves, freedom=moves.freedom.only(local.mesh.unlinked))
    movable = moves.freedom.dimension > 0
    selected = np.logical_and.reduce([~held, *masks.values()])
    moves = replace(moves, freedom=moves.freedom.only(selected))
    share = share_of(comm, store, local, domain, moves.freedom)
    own = np.flatnonzero(share.own & share.relaxed)
    domain = replace(domain, cell_ids=local.cells)
    view = View(domain, owned, share.relaxed, own, local.index[own])
    whole = local, domain, mirrored, regions, dividers, movable, masks, moves
    return Mine(*whole, share, view, layers, max_aspect, targets, plain)


def _has_repeated(store: Store) -> bool:
    """True if a lower cell is here twice."""
    cells = store.lower.cells
    rows = np.column_stack([np.array(store.kinds.sizes)[store.lower.kinds], np.sort(cells, axis=1)])
    return len(np.unique(rows, axis=0)) < len(rows)


def _oriented(
    comm: Any, store: Store, local: Local, regions: np.ndarray, backend: Any
) -> tuple[Domain, np.ndarray | None, np.ndarray] | None:
    """The domain of a rank's mesh, its ``mirrored`` (see ``Mine``), and (C,) the quality of its corners.

    Where all cells are positive and alike once those of negative measure are turned, no other way to orient
    the whole is; else it is followed from rank to rank. None on all where a cell is there twice, or rounding
    would decide.
    """
    of_cells = per_cell(regions, local)
    domain = domain_of(local.mesh, backend=backend, regions=of_cells)
    if not agree(comm, not len(domain.repeated)):
        return None
    quality = corner_qualities(domain.points, domain.corners, backend)
    good = bool((quality > DEGENERATE).all())
    ways = set(comm.allgather(domain.mirrored / len(local.cells)))
    if len(ways) > 1 or not ways <= {0.0, 1.0}:
        good = good and are_alike(domain.cells, backend)
    if agree(comm, good):
        return domain, None, quality
    mirrored = mirrored_of(comm, store, local, domain, backend)
    if mirrored is None:
        return None
    domain = domain_of(local.mesh, backend=backend, regions=of_cells, mirrored=mirrored)
    return domain, mirrored, corner_qualities(domain.points, domain.corners, backend)


def per_cell(regions: np.ndarray, local: Local) -> RegionChoice:
    """The regions of the cells of a mesh; regions: (kinds,) of those of each kind."""
    return regions[local.kinds] if regions.any() else (NONE,)


def _layers(
    comm: Any,
    store: Store,
    local: Local,
    domain: Domain,
    mirrored: np.ndarray | None,
    quality: np.ndarray,
) -> Layers | None:
    """The cells that are kept, None if there are none; the arguments: see ``Mine`` and ``_oriented``."""
    if not may_have_layers(comm, store, local, domain, mirrored, quality):
        return None
    cells = store.cells
    if comm.size > 1:  # else it has all there is
        cells = store.within(REACH)
        among = among_cells(store, cells, mirrored, domain.backend)
        assert among is not None  # as each rank has cells
        local, domain, quality = among
    return layers_among(comm, store, cells, local, domain, quality)
