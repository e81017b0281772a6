"""Measures of cells that solvers' users know, as VTK's Verdict defines them.

Each function takes the vertices of n cells of one linear type, k vectors by components (arrays (n,)), and the
type. Vectors have two components in a planar mesh, whose cells have a sign, and three elsewhere. Where an
edge, a face or a volume has no extent the result is not finite.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from dvr_cli.mesh.cell_types import CELL_TYPES, CellType
from dvr_cli.mesh.corners import ORIGIN_FIRST
from dvr_cli.mesh.simplex import Components, cross, dot, subtract
from dvr_cli.quality.angles import face_normal, neighbouring_facets

Vertices = Sequence[Components]

# the tetrahedra that two cuts along the diagonals of a pyramid's base make
_PYRAMID_PARTS = ((0, 1, 2, 4), (0, 2, 3, 4), (0, 1, 3, 4), (1, 2, 3, 4))
# the faces between which the axes of a hexahedron run
_HEXAHEDRON_SIDES = (((1, 2, 5, 6), (0, 3, 4, 7)), ((2, 3, 6, 7), (0, 1, 4, 5)), ((4, 5, 6, 7), (0, 1, 2, 3)))


def scaled_jacobian(x: Vertices, cell_type: CellType) -> np.ndarray:
    """The smallest det E / Π|e| of the corners, over that of the target; in [-1, 1], 1 for the ideal shape.

    Hexahedra have a ninth corner, the axes through the middles of opposite faces; pyramids are judged by the
    four tetrahedra that two cuts along the diagonals of the base make.
    """
    if cell_type.name == "pyramid":
        parts = [_of_corners([x[i] for i in part], CELL_TYPES["tetra"]) for part in _PYRAMID_PARTS]
        value = np.sqrt(2.0) * np.maximum(reduce(np.minimum, parts), 0.0)
        return np.where(value < 1.0, value, 2.0 - value)
    least = _of_corners(x, cell_type)
    if cell_type.name == "hexahedron":
        least = np.minimum(least, _normalised_determinant([_between(x, *side) for side in _HEXAHEDRON_SIDES]))
    return least


def _of_corners(x: Vertices, cell_type: CellType) -> np.ndarray:
    up = _normal(x) if len(x[0]) > cell_type.dimension else None
    values = []
    for corner, target in zip(cell_type.corners, cell_type.targets, strict=True):
        orders = ORIGIN_FIRST[cell_type.dimension] if cell_type.is_simplex else [range(len(corner))]
        for order in orders:
            ideal = _normalised_determinant(_edges([target[i] for i in order]))
            values.append(_normalised_determinant(_edges([x[corner[i]] for i in order]), up) / ideal)
    if cell_type.is_simplex:  # one determinant, over the largest product of edges
        return np.copysign(reduce(np.minimum, map(np.abs, values)), values[0])
    return reduce(np.minimum, values)


def _edges(x: Vertices) -> list[list[np.ndarray]]:
    """The edges from the first vertex."""
    return [subtract(end, x[0]) for end in x[1:]]


def _between(x: Vertices, ahead: Sequence[int], behind: Sequence[int]) -> list[np.ndarray]:
    """The sum of some vertices less that of others, which points from one side to the opposite one."""
    return subtract(_sum([x[i] for i in ahead]), _sum([x[i] for i in behind]))


def _sum(vectors: Vertices) -> list[np.ndarray]:
    return [reduce(np.add, parts) for parts in zip(*vectors, strict=True)]


def _length(vector: Components) -> np.ndarray:
    return np.sqrt(dot(vector, vector))


def _normalised_determinant(edges: Vertices, up: Components | None = None) -> np.ndarray:
    """det E / Π|e|; of two edges in space as it looks from the side of ``up``."""
    lengths = reduce(np.multiply, map(_length, edges))
    if len(edges) == 3:
        determinant = dot(edges[0], cross(edges[1], edges[2]))
    elif up is None:
        determinant = edges[0][0] * edges[1][1] - edges[0][1] * edges[1][0]
    else:
        determinant = dot(cross(*edges), up)
    return np.asarray(determinant / lengths)


def _normal(x: Vertices) -> list[np.ndarray]:
    """The unit normal of triangles, and of quadrilaterals in their middle, in space."""
    if len(x) == 3:
        normal = cross(*_edges(x))
    else:
        normal = cross(_between(x, (1, 2), (0, 3)), _between(x, (2, 3), (0, 1)))
    length = _length(normal)
    return [component / length for component in normal]


def aspect_ratio(x: Vertices, cell_type: CellType) -> np.ndarray:
    """1 for the ideal shape, and more for others.

    Triangles: longest edge over the inradius, over 2 √3; tetrahedra: the same over 2 √6. Quadrilaterals:
    longest edge times perimeter over 4 areas. Others, for which Verdict has none: longest over shortest edge.
    """
    edges = cell_type.facets if cell_type.dimension == 2 else cell_type.edges
    lengths = [_length(subtract(x[b], x[a])) for a, b in edges]
    longest = reduce(np.maximum, lengths)
    if cell_type.dimension == 2:
        scale = 4.0 * np.sqrt(3.0) if len(x) == 3 else 4.0
        return np.asarray(longest * reduce(np.add, lengths) / (scale * _area(x)))
    if cell_type.is_simplex:
        a, b, c = _edges(x)
        volume = np.abs(dot(a, cross(b, c))) / 6.0
        surface = reduce(np.add, [_area([x[i] for i in facet]) for facet in cell_type.facets])
        return np.asarray(longest * surface / (6.0 * np.sqrt(6.0) * volume))
    return np.asarray(longest / reduce(np.minimum, lengths))


def _in_space(vector: Components) -> Components:
    """The same vector with a third component, which is 0 in a planar mesh."""
    return vector if len(vector) == 3 else [*vector, np.zeros_like(vector[0])]


def _area(x: Vertices) -> np.ndarray:
    """The area of triangles; of quadrilaterals that of their projection along the normal in the middle."""
    return 0.5 * _length(face_normal([_in_space(vertex) for vertex in x]))


def skewness(x: Vertices, cell_type: CellType) -> np.ndarray:
    """Equiangle skew, from 0 for the ideal shape to 1: how far angles are from the ideal one θ, relatively.

    The larger of (largest - θ) / (180° - θ) and (θ - smallest) / θ. For volume cells of the angles of their
    faces, for tetrahedra of their dihedral angles, too. A reflex angle makes it larger than 1.
    """
    if cell_type.dimension == 2:
        return _face_skew(x)
    skews = [_face_skew([x[i] for i in facet]) for facet in cell_type.facets]
    if cell_type.is_simplex:
        skews.append(_skew(_dihedral_angles(x, cell_type), np.degrees(np.arccos(1.0 / 3.0))))
    return reduce(np.maximum, skews)


def _face_skew(x: Vertices) -> np.ndarray:
    return _skew(_interior_angles(x), 180.0 * (len(x) - 2) / len(x))


def _skew(angles: Sequence[np.ndarray], ideal: float) -> np.ndarray:
    above = (reduce(np.maximum, angles) - ideal) / (180.0 - ideal)
    below = (ideal - reduce(np.minimum, angles)) / ideal
    return np.maximum(above, below)


def smallest_angle(x: Vertices, cell_type: CellType) -> np.ndarray:
    """The smallest angle of planar cells, the smallest dihedral angle of volume cells, in degrees."""
    return reduce(np.minimum, _angles(x, cell_type))


def largest_angle(x: Vertices, cell_type: CellType) -> np.ndarray:
    """The largest angle of planar cells, the largest dihedral angle of volume cells, in degrees."""
    return reduce(np.maximum, _angles(x, cell_type))


def _angles(x: Vertices, cell_type: CellType) -> list[np.ndarray]:
    return _dihedral_angles(x, cell_type) if cell_type.dimension == 3 else _interior_angles(x)


def _interior_angles(x: Vertices) -> list[np.ndarray]:
    """The angle between the two sides at each vertex of triangles and quadrilaterals, in degrees.

    A quadrilateral that is not convex has its largest angle, and no other, beyond 180 degrees.
    """
    x = [_in_space(vertex) for vertex in x]
    n = len(x)
    sides = [(subtract(x[(i + 1) % n], x[i]), subtract(x[i - 1], x[i])) for i in range(n)]
    angles = [_angle_between(*pair) for pair in sides]
    if n == 4:
        up = _normal(x)
        turned = reduce(np.logical_or, [dot(cross(*pair), up) < 0.0 for pair in sides])
        angles.append(np.where(turned, 360.0 - reduce(np.maximum, angles), angles[0]))
    return angles


def _dihedral_angles(x: Vertices, cell_type: CellType) -> list[np.ndarray]:
    """The angle between the two faces at each edge, in degrees; quadrilaterals have their mean normal."""
    faces = cell_type.facets
    normals = [face_normal([x[v] for v in face]) for face in faces]
    return [180.0 - _angle_between(normals[i], normals[j]) for i, j in neighbouring_facets(faces)]


def _angle_between(a: Components, b: Components) -> np.ndarray:
    """The angle between vectors in space in degrees, NaN where one has no length."""
    angle = np.degrees(np.arctan2(_length(cross(a, b)), dot(a, b)))
    return np.where((dot(a, a) > 0.0) & (dot(b, b) > 0.0), angle, np.nan)
