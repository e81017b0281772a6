"""Cells away from layers: the worst of them is no worse after a run than the worst of them was before.

The guarantee of the quality vector is for the worst cell around each vertex, so a cell away from layers may
get worse where one beside a layer is worse still. If so the run is made again with such cells weighted: the
worst of them count for as bad as the worst cell that can move. As Q1 never falls, they get no worse.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dvr_cli.mesh.corners import Corners, shape_table
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.neighbours import within_rings
from dvr_cli.quality.measure import Quality
from dvr_cli.quality.vector import at_least

_MARGIN = 1.0 + 1e-12  # more than qualities are rounded by


def weights_needed(
    domain: Domain, kept: np.ndarray, before: Quality, after: Quality, given: np.ndarray | None
) -> np.ndarray | None:
    """(n,) the weights of the cells with which a run has to be made again, None if it need not be.

    kept: (n,) bool, the cells that are kept. before, after: the qualities of input and result. given: the
    weights of the run that was made, None for the first. At first the worst cells count for as bad as the
    quality half-way from the Q1 of the input to that of the result, which leaves Q1 more room, then as that
    of the input. Should the quality vector have fallen with weights, it is to be made without.
    """
    old, new = before.q1 or 0.0, after.q1 or 0.0
    if given is not None and not at_least(after.vector, before.vector):
        return None if (given == 1.0).all() else np.ones_like(given)
    least = _least_qualities(domain, kept, before.elements)
    if old <= 0.0 or (after.elements >= least).all() or (given is not None and (given == 1.0).all()):
        return None
    weight = np.maximum(_MARGIN * least / (old if given is not None else (old + new) / 2.0), 1.0)
    return None if given is not None and np.array_equal(weight, given) else weight


def _least_qualities(domain: Domain, kept: np.ndarray, before: np.ndarray) -> np.ndarray:
    """(n,) the quality that each cell away from layers must not fall below; of others -inf.

    Two sets of cells are away from layers: those that share no vertex with a cell that is kept, and those of
    them that share none with the others, either. No cell of a set may become worse than the worst of it was.
    before: (n,) the quality of each cell in the input.
    """
    rows = [block.vertices for block in domain.cells]
    parts = np.split(kept, np.cumsum([len(block) for block in rows])[:-1])
    near = np.zeros(len(domain.points), dtype=bool)
    for block, part in zip(rows, parts, strict=True):
        near[block[part]] = True
    least = np.full(len(before), -np.inf)
    for rings in range(2):
        reached = within_rings(rows, near, rings)
        away = np.concatenate([~reached[block].any(axis=1) for block in rows])
        least[away] = before[away].min(initial=np.inf)
    return least


def weighted(corners: Corners, weight: np.ndarray) -> Corners:
    """The corners, the qualities of each cell divided by its ``weight`` (n,), with rows for those not 1."""
    of_corners = np.repeat(weight, np.diff(corners.start))
    own = np.flatnonzero(of_corners != 1.0)
    shapes, table = corners.shapes.copy(), corners.table
    known, width = len(table.matrices), shapes.shape[1]
    heavier = table.matrices[shapes[own]] * of_corners[own, None, None, None]
    shapes[own] = known + np.arange(len(own) * width, dtype=shapes.dtype).reshape(-1, width)
    matrices = np.concatenate([table.matrices, heavier.reshape(-1, *table.matrices.shape[1:])])
    return replace(corners, shapes=shapes, table=shape_table(matrices))
