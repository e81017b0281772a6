"""Regions and selections by name, quality and number, of a mesh that no rank has whole.

What a name means for a cell depends on its kind alone: its type and tags, of which all ranks know those of
the whole.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dvr_cli.api.selection import Selection, of_worse
from dvr_cli.distributed.shares import Local, Store
from dvr_cli.errors import UsageError
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.groups import group_cells
from dvr_cli.mesh.region_choice import NONE, Divider, RegionChoice, regions_of


def regions_of_kinds(comm: Any, store: Store, choice: RegionChoice) -> tuple[np.ndarray, tuple[Divider, ...]]:
    """(kinds,) the region of the cells of each kind in the whole, 0 of lower ones; and what tells them apart.

    Raises UsageError as ``regions_of``, on all ranks.
    """
    kinds = store.kinds
    mesh, order = kinds.summary()
    blocks = [b for b, one in enumerate(mesh.cells) if CELL_TYPES[one.type].dimension == kinds.dimension]
    if not isinstance(choice, np.ndarray) and not choice:
        choice = kinds.regions or (NONE,)
    found, dividers = regions_of(mesh, blocks, choice)
    region = np.zeros(len(order), dtype=np.int64)
    region[order[: len(found)]] = found
    mine = store.cells.kinds[store.owned(store.cells.cells)]
    counts = sum(comm.allgather(np.bincount(mine, minlength=len(order))))
    counted = []
    for divider in dividers:
        if divider.kind == "set":
            members = order[np.concatenate(group_cells(mesh, divider.name, kinds.regions))]
            divider = replace(divider, count=int(counts[members].sum()))
        counted.append(divider)
    return region, tuple(counted)


def masks_of(store: Store, local: Local, domain: Domain, selection: Selection) -> dict[str, np.ndarray]:
    """As ``Selection.masks``, (n,) of the vertices of a rank's mesh, right for those that it owns."""
    masks = {}
    if selection.fix:
        masks["--fix"] = ~_in_groups(store, local, "fix", selection.fix)
    if selection.only:
        masks["--only"] = _in_groups(store, local, "only", selection.only)
    if selection.below is not None:
        masks["--below"] = _around_worse(store, local, domain, selection.below, selection.layers)
    if selection.vertices is not None:
        if len(wrong := selection.vertices[(selection.vertices < 0) | (selection.vertices >= store.size)]):
            raise UsageError(f"vertices: there is no vertex {wrong[0]}")
        masks["--vertices"] = np.isin(local.index, selection.vertices)
    return masks


def _in_groups(store: Store, local: Local, option: str, names: tuple[str, ...]) -> np.ndarray:
    """(n,) bool: the vertices of the groups of these names."""
    mesh, order = store.kinds.summary()
    chosen = np.zeros(len(order), dtype=bool)
    for name in names:
        members = order[np.concatenate(group_cells(mesh, name, store.kinds.regions))]
        if not len(members):
            raise UsageError(f"{option}: nothing is in a group {name!r}")
        chosen[members] = True
    inside, start = np.zeros(len(local.index), dtype=bool), 0
    for block in local.mesh.cells:
        kinds = local.kinds[start : start + len(block.vertices)]
        inside[block.vertices[chosen[kinds]]] = True
        start += len(kinds)
    return inside


def _around_worse(store: Store, local: Local, domain: Domain, limit: float, layers: int) -> np.ndarray:
    """(n,) bool: the vertices of elements worse than ``limit``, and those within so many rings of them."""
    rows = [block.vertices for block in domain.cells]
    return store.within_rings(local, rows, of_worse(domain, limit), layers)
