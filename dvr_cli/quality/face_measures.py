"""Measures of the faces of volume cells, as OpenFOAM's checkMesh has them: non-orthogonality and skewness.

A finite-volume solver takes differences along the line between the centres of two cells. The first measure is
the angle between that line and the normal of their face, the second how far from the face's centre the line
meets it. A cell is as bad as the worst of its faces.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.facets import facets_of
from dvr_cli.mesh.mesh import Cells

_TINY = 1e-150  # keeps quotients of nothing by nothing finite


@dataclass(frozen=True, eq=False)
class Faces:
    """The faces of volume cells, each once, with its centre and vector area; cells with their centres.

    points: (N, 3). vertices: (F, w), shorter rows ending in -1. owner, neighbour: (F,) the cells on either
    side, neighbour -1 on the boundary. centre, area: (F, 3), the area pointing out of the owner. cell_centre:
    (n, 3).
    """

    points: np.ndarray
    vertices: np.ndarray
    owner: np.ndarray
    neighbour: np.ndarray
    centre: np.ndarray
    area: np.ndarray
    cell_centre: np.ndarray


def faces_of(points: np.ndarray, blocks: list[Cells], backend: Backend = NUMPY) -> Faces:
    """The faces of blocks of linear volume cells with coordinates ``points`` (N, 3)."""
    facets = facets_of(blocks, backend)
    first, second = facets.start[:-1], np.minimum(facets.start[:-1] + 1, facets.start[1:] - 1)
    vertices, owner = facets.vertices[first], facets.cell[first]
    neighbour = np.where(facets.shared_by == 2, facets.cell[second], -1)
    centre, area = _centre_and_area(points, vertices)
    n = sum(len(block.vertices) for block in blocks)
    centres = _cell_centres(n, owner, neighbour, centre, area)
    return Faces(points, vertices, owner, neighbour, centre, area, centres)


def _centre_and_area(points: np.ndarray, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centres and vector areas of faces, from the triangles that their sides make with the mean vertex."""
    counts = (vertices >= 0).sum(axis=1, keepdims=True)
    middle = np.where(vertices[..., None] >= 0, points[vertices], 0.0).sum(axis=1) / counts
    area, weight, moment = np.zeros_like(middle), np.zeros(len(middle)), np.zeros_like(middle)
    for a, b in _sides(points, vertices):
        triangle = np.cross(b - a, middle - a)
        size = np.linalg.norm(triangle, axis=1)
        area, weight = area + 0.5 * triangle, weight + size
        moment += size[:, None] * (a + b + middle) / 3.0
    centre = np.where(weight[:, None] > 0, moment / np.maximum(weight, _TINY)[:, None], middle)
    return centre, area


def _sides(points: np.ndarray, vertices: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """The two ends of each side of the faces; beyond the last side both ends are the same vertex."""
    for k in range(vertices.shape[1]):
        here = np.where(vertices[:, k] >= 0, vertices[:, k], vertices[:, 0])
        following = vertices[:, (k + 1) % vertices.shape[1]]
        yield points[here], points[np.where(following >= 0, following, vertices[:, 0])]


def _cell_centres(
    n: int, owner: np.ndarray, neighbour: np.ndarray, centre: np.ndarray, area: np.ndarray
) -> np.ndarray:
    """(n, 3) centres of cells, from the pyramids that their faces make with the mean face centre."""
    inner = neighbour >= 0
    cell = np.concatenate([owner, neighbour[inner]])
    at, out = np.concatenate([centre, centre[inner]]), np.concatenate([area, -area[inner]])
    estimate = _sums(n, cell, at) / np.bincount(cell, minlength=n)[:, None]
    volume = (out * (at - estimate[cell])).sum(axis=1)
    moment = _sums(n, cell, volume[:, None] * (0.75 * at + 0.25 * estimate[cell]))
    total = np.bincount(cell, volume, n)
    flat = np.abs(total) < _TINY
    return np.where(flat[:, None], estimate, moment / np.where(flat, 1.0, total)[:, None])


def _sums(n: int, cell: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(n, 3) the sum of ``values`` (m, 3) over the entries of each cell."""
    return np.stack([np.bincount(cell, column, n) for column in values.T], axis=1)


def non_orthogonality(faces: Faces) -> np.ndarray:
    """(n,) the largest angle in degrees, over the inner faces of each cell, between their normal and the line
    from centre to centre; 0 for a cell without neighbours."""
    inner = faces.neighbour >= 0
    owner, neighbour = faces.owner[inner], faces.neighbour[inner]
    line, area = faces.cell_centre[neighbour] - faces.cell_centre[owner], faces.area[inner]
    across = np.linalg.norm(np.cross(line, area), axis=1)
    angle = np.degrees(np.arctan2(across, (line * area).sum(axis=1)))
    return _worst(len(faces.cell_centre), [owner, neighbour], [angle, angle])


def face_skewness(faces: Faces) -> np.ndarray:
    """(n,) the largest distance, over the faces of each cell, from the face's centre to where the line from
    centre to centre meets its plane.

    It is taken relatively: to .2 of that line, or to how far the face reaches in that direction where that is
    more. On the boundary the line is the normal from the cell's centre, of which .4 counts.
    """
    inner = faces.neighbour >= 0
    line = np.empty_like(faces.area)
    to_face = faces.centre - faces.cell_centre[faces.owner]
    line[inner] = faces.cell_centre[faces.neighbour[inner]] - faces.cell_centre[faces.owner[inner]]
    normal = faces.area / np.maximum(np.linalg.norm(faces.area, axis=1), _TINY)[:, None]
    line[~inner] = (normal * (normal * to_face).sum(axis=1, keepdims=True))[~inner]
    along = (faces.area * to_face).sum(axis=1) / ((faces.area * line).sum(axis=1) + _TINY)
    offset = to_face - along[:, None] * line
    distance = np.linalg.norm(offset, axis=1)
    direction = offset / np.maximum(distance, _TINY)[:, None]
    reach = np.where(inner, 0.2, 0.4) * np.linalg.norm(line, axis=1) + _TINY
    for corner, _ in _sides(faces.points, faces.vertices):
        reach = np.maximum(reach, np.abs((direction * (corner - faces.centre)).sum(axis=1)))
    skew = distance / reach
    return _worst(len(faces.cell_centre), [faces.owner, faces.neighbour[inner]], [skew, skew[inner]])


def _worst(n: int, cells: list[np.ndarray], values: list[np.ndarray]) -> np.ndarray:
    """(n,) the largest of each cell's values, 0 where it has none."""
    result = np.zeros(n)
    for cell, value in zip(cells, values, strict=True):
        np.maximum.at(result, cell, value)
    return result
