"""Volume and area: the extent of a domain, exact for facets cut into triangles."""

from __future__ import annotations

import numpy as np

from dvr_cli.boundary.triangles import triangulated
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.facets import facets_of, outlines


def extent(domain: Domain, points: np.ndarray) -> tuple[float | None, float]:
    """Volume and area of a domain at the coordinates ``points`` (N, d).

    Of a volume mesh its volume and the area of its boundary; of a surface its area and the volume it
    encloses, None if it has a border; of a planar mesh its area.
    """
    sides = facets_of(domain.cells, domain.backend)
    outer = sides.sides[sides.order[sides.start[:-1][sides.shared_by == 1]]]
    centred = points - points.mean(axis=0)
    if points.shape[1] == 2:
        a, b = centred[outer[:, 0]], centred[outer[:, 1]]
        return None, 0.5 * abs(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()))
    faces = [outlines(block) for block in domain.cells] if domain.is_surface else [outer]
    triangles = np.concatenate([triangulated(face)[0] for face in faces])
    a, b, c = (centred[vertex] for vertex in triangles.T)
    normal = np.cross(b - a, c - a)
    area = 0.5 * float(np.sqrt((normal * normal).sum(axis=1)).sum())
    volume = abs(float((a * normal).sum())) / 6.0
    return None if domain.is_surface and len(outer) else volume, area
