"""Volume and area: the extent of a domain, exact for facets cut into triangles."""

from __future__ import annotations

import numpy as np

from dvr_cli.boundary.triangles import triangulated
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.facets import facets_of, outlines

Extent = tuple[float | None, float]  # volume and area


def extents(domain: Domain, *states: np.ndarray) -> list[Extent]:
    """Volume and area of a domain at each of some coordinates (N, d).

    Of a volume mesh its volume and the area of its boundary; of a surface its area and the volume it
    encloses, None if it has a border; of a planar mesh its area.
    """
    sides = facets_of(domain.cells, domain.backend)
    outer = sides.sides[sides.order[sides.start[:-1][sides.shared_by == 1]]]
    if domain.dimension == 2 and not domain.is_surface:
        return [(None, _area_within(points, outer)) for points in states]
    faces = [outlines(block) for block in domain.cells] if domain.is_surface else [outer]
    triangles = np.concatenate([triangulated(face)[0] for face in faces])
    found: list[Extent] = []
    for points in states:
        middle = points.mean(axis=0)
        a, b, c = (points.take(vertex, axis=0) - middle for vertex in triangles.T)
        normal = np.cross(b - a, c - a)
        area = 0.5 * float(np.sqrt((normal * normal).sum(axis=1)).sum())
        volume = abs(float((a * normal).sum())) / 6.0
        found.append((None if domain.is_surface and len(outer) else volume, area))
    return found


def _area_within(points: np.ndarray, outer: np.ndarray) -> float:
    """The area that edges ``outer`` (n, 2) enclose in a plane."""
    centred = points - points.mean(axis=0)
    a, b = centred[outer[:, 0]], centred[outer[:, 1]]
    return 0.5 * abs(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()))
