"""The reasons for which elements stay inverted after untangling, as far as the held vertices tell."""

from __future__ import annotations

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.boundary.self_intersection import crossing_facets
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.neighbours import within_rings
from dvr_cli.quality.mean_ratio import DEGENERATE, element_qualities
from dvr_cli.relax.phases import TANGLED
from dvr_cli.relax.untangle.phase import inverted_by_held

NEAR = 2  # rings of vertices around a crossing within which it is to blame


def tangled_elements(points: np.ndarray, domain: Domain, freedom: Freedom) -> dict[str, int]:
    """The numbers of inverted and degenerate elements with coordinates ``points`` (N, d), by reason.

    elements: all of them; hopeless: of these, with a corner whose vertices are all held; crossing: of the
    rest, near held facets that cross each other.
    """
    corners = domain.corners
    tangled = ~(element_qualities(points, corners) > DEGENERATE)
    if not tangled.any():
        return dict.fromkeys(TANGLED, 0)
    known = inverted_by_held(points, corners, freedom)
    rest = tangled & ~known
    crossing = np.zeros(len(points), dtype=bool)
    if rest.any():
        facets = held_facets(domain, freedom)
        crossing[facets[crossing_facets(points, facets)]] = True
    near = within_rings([corners.vertices], crossing, NEAR)[corners.vertices].any(axis=1)
    blamed = rest & corners.by_cell(np.logical_or, near)
    numbers = tangled.sum(), (tangled & known).sum(), blamed.sum()
    return {reason: int(number) for reason, number in zip(TANGLED, numbers, strict=True)}


def held_facets(domain: Domain, freedom: Freedom) -> np.ndarray:
    """(F, d) the facets all of whose vertices are held, once each, those with four cut in two."""
    d, parts = domain.dimension, []
    for block in domain.cells:
        for facet in CELL_TYPES[block.type].facets:
            for k in range(len(facet) - d + 1):
                parts.append(block.vertices[:, [facet[0], *facet[k + 1 : k + d]]])
    facets = np.concatenate(parts)
    facets = facets[(freedom.dimension == 0)[facets].all(axis=1)]
    return np.unique(np.sort(facets, axis=1), axis=0)
