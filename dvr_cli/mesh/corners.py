"""Corners: the bundle of simplices that every linear element is made of (DESIGN section 2, "Corners").

A corner is a vertex with its d edges inside one element, together with the target shape those edges should
have. Triangles and tetrahedra have one corner (all of theirs give the same value), quadrilaterals 4,
hexahedra 8, wedges 6 and pyramids 4. With E the matrix of the corner's edges, W that of its target's and
A = E W⁻¹, the mean ratio of the corner is

    Q = d · sgn(det A) · |det A|^(2/d) / ‖A‖²_F = sgn(v) · |v|^(2/d) / s        (paper eq. 4 for simplices)

where v = det E and s = Σ_jk M_jk e_j·e_k with the symmetric matrix M of the target. The affine map A of a
simplex onto its target is the same whichever of their vertices is the origin, so each target is tabulated
once for every choice of origin; a ring then treats all element types alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.mesh.mesh import Cells

# Node numbering is meshio's, that of VTK and Gmsh for linear cells:
#
#   quad          hexahedron           wedge             pyramid
#   3---2         bottom 0 1 2 3       bottom 0 1 2      base 0 1 2 3
#   |   |         top    4 5 6 7       top    3 4 5      apex 4
#   0---1
#
# Each corner lists its own vertex first, then the far ends of its edges, so that a positively oriented
# element has positive determinants only.
CORNERS: dict[str, tuple[tuple[int, ...], ...]] = {
    "triangle": ((0, 1, 2),),
    "quad": ((0, 1, 3), (1, 2, 0), (2, 3, 1), (3, 0, 2)),
    "tetra": ((0, 1, 2, 3),),
    "hexahedron": (
        (0, 1, 3, 4),
        (1, 2, 0, 5),
        (2, 3, 1, 6),
        (3, 0, 2, 7),
        (4, 7, 5, 0),
        (5, 4, 6, 1),
        (6, 5, 7, 2),
        (7, 6, 4, 3),
    ),
    "wedge": ((0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2)),
    "pyramid": ((0, 1, 3, 4), (1, 2, 0, 4), (2, 3, 1, 4), (3, 0, 2, 4)),
}

_H = np.sqrt(3.0) / 2.0
_REGULAR_TRIANGLE = np.array([[0, 0], [1, 0], [0.5, _H]])
_SQUARE_CORNER = np.array([[0, 0], [1, 0], [0, 1.0]])
_REGULAR_TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0.5, _H, 0], [0.5, _H / 3, np.sqrt(2 / 3)]])
_CUBE_CORNER = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
_WEDGE_LOWER = np.array([[0, 0, 0], [1, 0, 0], [0.5, _H, 0], [0, 0, 1.0]])
_WEDGE_UPPER = _WEDGE_LOWER[[0, 2, 1, 3]] * [1, 1, -1]  # seen from the top the triangle turns the other way
_PYRAMID_BASE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.5, np.sqrt(0.5)]])

# Target simplex of each corner, vertices in the order of CORNERS.
_TARGETS: dict[str, tuple[np.ndarray, ...]] = {
    "triangle": (_REGULAR_TRIANGLE,),
    "quad": (_SQUARE_CORNER,) * 4,
    "tetra": (_REGULAR_TETRAHEDRON,),
    "hexahedron": (_CUBE_CORNER,) * 8,
    "wedge": (_WEDGE_LOWER,) * 3 + (_WEDGE_UPPER,) * 3,
    "pyramid": (_PYRAMID_BASE,) * 4,
}

# Node order of the mirror image: what turns an element stored inside out into a positive one.
MIRROR: dict[str, tuple[int, ...]] = {
    "triangle": (0, 2, 1),
    "quad": (0, 3, 2, 1),
    "tetra": (0, 2, 1, 3),
    "hexahedron": (4, 5, 6, 7, 0, 1, 2, 3),
    "wedge": (3, 4, 5, 0, 1, 2),
    "pyramid": (0, 3, 2, 1, 4),
}

DIMENSION: dict[str, int] = {name: targets[0].shape[1] for name, targets in _TARGETS.items()}


def target_matrix(target: np.ndarray) -> np.ndarray:
    """The (d, d) matrix M with ‖A‖² / (d · det W^(-2/d)) = Σ_jk M_jk e_j·e_k, so that Q = v^(2/d) / s.

    target: (d+1, d) vertices of a positively oriented simplex, the origin of the edges first.
    """
    edges = (target[1:] - target[0]).T
    d = edges.shape[0]
    inverse = np.linalg.inv(edges)
    return inverse @ inverse.T * np.linalg.det(edges) ** (2.0 / d) / d


def _even_permutation(first: int, n: int) -> tuple[int, ...]:
    """The lexicographically first even permutation of range(n) that starts with ``first``."""
    for candidate in permutations(range(n)):
        inversions = sum(candidate[i] > candidate[j] for i in range(n) for j in range(i + 1, n))
        if candidate[0] == first and inversions % 2 == 0:
            return candidate
    raise AssertionError("every n >= 3 has such a permutation")


# For d = 2, 3: row p is the even permutation of a corner's vertices that puts vertex p first.
ORIGIN_FIRST = {d: np.array([_even_permutation(p, d + 1) for p in range(d + 1)]) for d in (2, 3)}


@dataclass(frozen=True)
class ShapeTable:
    """The distinct target matrices of one dimension, as the engines read them.

    norm: (S, d(d+1)/2) coefficients of s: first those of e_j·e_j, then 2 M_jk for e_j·e_k in the order
        (0,1), (0,2), (1,2).
    slope: (S, d) row sums of M: ds/dx along a unit direction u is -2 Σ_j slope_j u·e_j.
    curvature: (S,) sum of all M_jk: the coefficient of λ² in s along a unit direction.
    """

    norm: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray


def _build_tables() -> tuple[dict[int, ShapeTable], dict[str, np.ndarray]]:
    """The shape table of each dimension, and per cell type the (corners, d+1) shapes by origin."""
    matrices: dict[int, list[np.ndarray]] = {2: [], 3: []}
    shapes: dict[str, np.ndarray] = {}
    for name, targets in _TARGETS.items():
        d = DIMENSION[name]
        known = matrices[d]
        rows = np.empty((len(targets), d + 1), dtype=np.uint8)
        for c, target in enumerate(targets):
            for p, order in enumerate(ORIGIN_FIRST[d]):
                m = target_matrix(target[order])
                same = [i for i, other in enumerate(known) if np.abs(m - other).max() < 1e-12]
                if not same:
                    known.append(m)
                rows[c, p] = same[0] if same else len(known) - 1
        shapes[name] = rows
    tables = {}
    for d, known in matrices.items():
        m = np.array(known)
        j, k = np.triu_indices(d, 1)
        diagonal = np.einsum("sjj->sj", m)
        tables[d] = ShapeTable(
            norm=np.ascontiguousarray(np.hstack([diagonal, 2.0 * m[:, j, k]])),
            slope=np.ascontiguousarray(m.sum(axis=2)),
            curvature=np.ascontiguousarray(m.sum(axis=(1, 2))),
        )
    return tables, shapes


SHAPES, CORNER_SHAPES = _build_tables()


@dataclass(frozen=True)
class Corners:
    """All corners of a set of cells of one dimension d.

    vertices: (C, d+1) int32 point indices, the corner's own vertex first.
    shapes: (C, d+1) uint8: row of the shape table for each choice of origin among the vertices.
    first: (n_cells + 1,) int64: the corners of cell i are first[i] .. first[i+1].
    """

    vertices: np.ndarray
    shapes: np.ndarray
    first: np.ndarray

    @property
    def dimension(self) -> int:
        """d: 2 or 3."""
        return self.vertices.shape[1] - 1


def corners_of(blocks: list[Cells], dimension: int) -> Corners:
    """The corners of blocks of linear cells that all have the given dimension, in block order.

    Raises InputError for a cell type that has no corners defined or another dimension.
    """
    vertices, shapes, counts = [], [], []
    for block in blocks:
        if DIMENSION.get(block.type) != dimension:
            raise InputError(f"cells of type {block.type!r} cannot be relaxed in {dimension}D")
        local = np.array(CORNERS[block.type])
        vertices.append(block.vertices[:, local].reshape(-1, dimension + 1).astype(np.int32, copy=False))
        shapes.append(np.tile(CORNER_SHAPES[block.type], (len(block.vertices), 1)))
        counts.append(np.full(len(block.vertices), len(local)))
    first = np.concatenate([[0], np.cumsum(np.concatenate([np.empty(0, np.int64), *counts]))])
    empty = np.empty((0, dimension + 1))
    return Corners(
        vertices=np.concatenate(vertices) if vertices else empty.astype(np.int32),
        shapes=np.concatenate(shapes) if shapes else empty.astype(np.uint8),
        first=first.astype(np.int64),
    )
