"""The boundary of a mesh that no rank has whole, where its vertices slide: each rank looks at its own.

The facets around a vertex are those of the cells that its rank has. What touches without being connected lies
anywhere, though: vertices and facets meet on the ranks that boxes of space are dealt to.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from dvr_cli.boundary.constraints import ROUNDING, Constraints, constraints_of
from dvr_cli.boundary.features import features_of
from dvr_cli.boundary.freedom import Freedom, interior_freedom
from dvr_cli.boundary.unconnected import boxes, coincident_vertices, hanging_vertices, levels_of
from dvr_cli.distributed.rows import sent
from dvr_cli.distributed.shares import Local, Store
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.facets import facets_of, vertices_of


def sliding(comm: Any, store: Store, local: Local, domain: Domain) -> tuple[Freedom, Constraints] | None:
    """The freedom of the vertices of a rank's mesh, right for those that it owns, and what keeps its shape.

    None on all ranks where vertices of the boundary touch what they are not connected to.
    """
    own = store.owner(local.number) == comm.rank
    near = domain.around(np.flatnonzero(own & ~domain.interior))
    facets = facets_of(near.cells, near.backend)
    single = facets.sides[np.minimum.reduceat(facets.order, facets.start[:-1])[facets.shared_by == 1]]
    single = single[(own[single] & (single >= 0)).any(axis=1)]
    if _touch(comm, domain.points, single, own):
        return None
    largest = float(np.abs(np.stack([store.low, store.high])).max())
    constraints = constraints_of(local.mesh, near, ROUNDING * largest)
    found = features_of(domain.points, domain.interior, constraints).freedom
    # where the cells that were looked at end there are facets, too, whose vertices of the rank are all inside
    free = interior_freedom(domain.interior, domain.dimension)
    inside = domain.interior[:, None]
    freedom = Freedom(
        np.where(domain.interior, free.dimension, found.dimension), np.where(inside, free.axis, found.axis)
    )
    return freedom, constraints


def _touch(comm: Any, points: np.ndarray, facets: np.ndarray, own: np.ndarray) -> bool:
    """True on all ranks if a vertex of the boundary hangs on a facet of it or is where another is.

    facets: (F, w) those of the boundary with a vertex of this rank, shorter rows end in -1. own: (n,) bool.
    """
    vertices = vertices_of(facets)
    places = points[vertices[own[vertices]]]
    (met,) = sent(comm, _dealt(comm, boxes(places)), places)
    found = len(coincident_vertices(met, np.arange(len(met)))) > 0
    corners = points[np.where(facets < 0, facets[:, :1], facets)]
    level = levels_of(corners)
    for one in sorted(set().union(*comm.allgather(set(level.tolist())))):
        width = np.ldexp(1.0, one)
        (met,) = sent(comm, _dealt(comm, boxes(np.floor(places / width))), places)
        some = np.flatnonzero(level == one)
        first = np.floor(corners[some].min(axis=1) / width)
        steps = [first + step for step in product((0.0, 1.0), repeat=points.shape[1])]
        to = np.concatenate([_dealt(comm, boxes(step)) for step in steps])
        pairs = np.unique(np.stack([to, np.tile(some, len(steps))], axis=1), axis=0)
        (around,) = sent(comm, pairs[:, 0], corners[pairs[:, 1]])
        number = len(met) + np.arange(around.shape[0] * around.shape[1]).reshape(around.shape[:2])
        together = np.concatenate([met, around.reshape(-1, points.shape[1])])
        found |= len(hanging_vertices(together, number, np.arange(len(met)))[0]) > 0
    return any(comm.allgather(found))


def _dealt(comm: Any, numbers: np.ndarray) -> np.ndarray:
    """The rank that each of some numbers of boxes is dealt to."""
    return (numbers % np.uint64(comm.size)).astype(np.int64)
