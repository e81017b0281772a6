"""Cells away from layers: the worst of them is no worse after a run than the worst of them was before.

The guarantee of the quality vector is for the worst cell around each vertex, so a cell away from layers may
get worse where one beside a layer is worse still. If so the run is made again with such cells weighted: the
worst of them count for as bad as the worst cell that can move. As Q1 never falls, they get no worse.
"""

from __future__ import annotations

from collections.abc import Callable
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
    weights of the run that was made, None for the first.
    """
    fell = given is not None and not at_least(after.vector, before.vector)
    near = vertices_of(domain, kept)
    least = least_qualities(domain, near, before.elements)
    q1s = before.q1 or 0.0, after.q1 or 0.0
    return weights_from(least, q1s, fell, bool((after.elements < least).any()), given)


def weights_from(
    least: np.ndarray,
    q1s: tuple[float, float],
    fell: bool,
    below: bool,
    given: np.ndarray | None,
    everywhere: Callable[[bool], bool] = bool,
) -> np.ndarray | None:
    """The weights, from what is known of a run: see ``weights_needed``.

    least: (n,) the quality that each cell must not fall below. q1s: of input and result. fell: whether the
    quality vector did, with the weights ``given``; below: whether a cell came below ``least``. everywhere:
    whether something is true of all processes that have parts of the mesh.

    At first the worst cells count for as bad as the quality half-way from the Q1 of the input to that of the
    result, which leaves Q1 more room, then as that of the input. Should the quality vector have fallen with
    weights, the run is to be made without.
    """
    old, new = q1s
    even = given is not None and everywhere(bool((given == 1.0).all()))
    if even or not (fell or below):
        return None
    if fell:
        return np.ones_like(least)
    if old <= 0.0:
        return None
    weight = np.maximum(_MARGIN * least / (old if given is not None else (old + new) / 2.0), 1.0)
    return None if given is not None and everywhere(np.array_equal(weight, given)) else weight


def vertices_of(domain: Domain, cells: np.ndarray) -> np.ndarray:
    """(N,) bool: the vertices of some of the cells of a domain ((n,) bool)."""
    result = np.zeros(len(domain.points), dtype=bool)
    result[domain.corners.vertices[np.repeat(cells, np.diff(domain.corners.start))]] = True
    return result


def least_qualities(
    domain: Domain,
    near: np.ndarray,
    before: np.ndarray,
    known: Callable[[np.ndarray], np.ndarray] = np.asarray,
    lowest: Callable[[float], float] = float,
) -> np.ndarray:
    """(n,) the quality that each cell away from layers must not fall below; of others -inf.

    Two sets of cells are away from layers: those that share no vertex with a cell that is kept, and those of
    them that share none with the others, either. No cell of a set may become worse than the worst of it was.
    near: (N,) bool, the vertices of kept cells. before: (n,) the quality of each cell in the input. known:
    gives what is known of vertices (N,) where other processes have parts of the mesh, and lowest: the least
    number of all of these.
    """
    rows = [block.vertices for block in domain.cells]
    least = np.full(len(before), -np.inf)
    for rings in range(2):
        near = known(within_rings(rows, near, rings))
        away = np.concatenate([~near[block].any(axis=1) for block in rows])
        least[away] = lowest(before[away].min(initial=np.inf))
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
