"""Corners: the bundle of simplices that every linear element is made of (docs/design.md, "Corners").

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

from dataclasses import dataclass, field, fields
from functools import cache
from itertools import permutations

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES, CellType, relaxed_dimension
from dvr_cli.mesh.mesh import Cells


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


@dataclass(frozen=True, eq=False)
class ShapeTable:
    """The distinct target matrices of one dimension, as the engines read them.

    matrices: (S, d, d) M of each.
    norm: (S, d(d+1)/2) coefficients of s: first those of e_j·e_j, then 2 M_jk for e_j·e_k in the order
        (0,1), (0,2), (1,2).
    slope: (S, d) row sums of M: ds/dx along a unit direction u is -2 Σ_j slope_j u·e_j.
    curvature: (S,) sum of all M_jk: the coefficient of λ² in s along a unit direction.
    factor: (S, d(d+1)/2) the upper triangle, row after row, of the matrix L through which edges are seen:
        s = Σ_jk M_jk (L e_j)·(L e_k), det L = 1. No rows where all are seen as they are. See
        ``quality.metric``.
    """

    matrices: np.ndarray
    norm: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray
    factor: np.ndarray

    def part(self, rows: np.ndarray) -> ShapeTable:
        """The table of some of the rows (k,), in this order."""
        factor = self.factor[rows] if len(self.factor) else self.factor
        return ShapeTable(
            self.matrices[rows], self.norm[rows], self.slope[rows], self.curvature[rows], factor
        )

    def with_rows(self, others: list[ShapeTable]) -> ShapeTable:
        """The table with the rows of others behind its own."""
        parts = [self, *others]
        names = [each.name for each in fields(self)]
        columns = [np.concatenate([getattr(part, name) for part in parts]) for name in names]
        return ShapeTable(*columns)

    def factors(self, rows: np.ndarray) -> list[np.ndarray] | None:
        """The entries of L of these rows, an array of their shape each; None where the table has no L."""
        return list(np.moveaxis(self.factor[rows], -1, 0)) if len(self.factor) else None


def shape_table(matrices: np.ndarray, factor: np.ndarray | None = None) -> ShapeTable:
    """The table with these (S, d, d) target matrices; factor: as in ``ShapeTable``, None for no L."""
    d = matrices.shape[1]
    j, k = np.triu_indices(d, 1)
    diagonal = np.einsum("sjj->sj", matrices)
    return ShapeTable(
        matrices=matrices,
        norm=np.ascontiguousarray(np.hstack([diagonal, 2.0 * matrices[:, j, k]])),
        slope=np.ascontiguousarray(matrices.sum(axis=2)),
        curvature=np.ascontiguousarray(matrices.sum(axis=(1, 2))),
        factor=np.empty((0, d * (d + 1) // 2)) if factor is None else np.ascontiguousarray(factor),
    )


# The tables of all cell types that corners have been made of; new types add rows at the end.
SHAPES: dict[int, ShapeTable] = {d: shape_table(np.empty((0, d, d))) for d in (2, 3)}


@cache
def corner_shapes(cell_type: CellType) -> np.ndarray:
    """(c, d+1) the row of the shape table of each corner of a cell type, for each choice of origin."""
    d = cell_type.dimension
    known = list(SHAPES[d].matrices)
    rows = np.empty((len(cell_type.targets), d + 1), dtype=np.int32)
    for c, target in enumerate(cell_type.targets):
        for p, order in enumerate(ORIGIN_FIRST[d]):
            m = target_matrix(target[order])
            same = [i for i, other in enumerate(known) if np.abs(m - other).max() < 1e-12]
            if not same:
                known.append(m)
            rows[c, p] = same[0] if same else len(known) - 1
    if len(known) > len(SHAPES[d].matrices):
        SHAPES[d] = shape_table(np.array(known))
    return rows


for _known in CELL_TYPES.values():
    if _known.corners:
        corner_shapes(_known)


@dataclass(frozen=True, eq=False)
class Simplices:
    """Corners of whatever cells, each on its own.

    vertices: (C, d+1) int32 point indices, the corner's own vertex first.
    shapes: (C, d+1) int32: row of the table for each choice of origin among the vertices.
    table: the targets that the corners are measured against.
    held: (C,) bool, corners that keep their shape, which is their target, so that their quality is 1; None
        where there are none.
    """

    vertices: np.ndarray
    shapes: np.ndarray
    table: ShapeTable
    held: np.ndarray | None = field(default=None, kw_only=True)

    @property
    def dimension(self) -> int:
        """d: 2 or 3."""
        return self.vertices.shape[1] - 1

    def with_vertex_in(self, marked: np.ndarray) -> np.ndarray:
        """(C,) bool: the corners that have a vertex among those ``marked`` ((N,) bool)."""
        return np.logical_or.reduce([marked[vertex] for vertex in self.vertices.T])

    def part(self, which: np.ndarray | slice) -> Simplices:
        """Some of the corners, given by number, by mask or as a slice."""
        held = None if self.held is None else self.held[which]
        return Simplices(self.vertices[which], self.shapes[which], self.table, held=held)


@dataclass(frozen=True, eq=False)
class Corners(Simplices):
    """All corners of a set of cells of one dimension d.

    start: (n_cells + 1,) int64: the corners of cell i are start[i] .. start[i+1].
    """

    start: np.ndarray

    def by_cell(self, combine: np.ufunc, values: np.ndarray) -> np.ndarray:
        """The values (C, ...) of each cell's corners combined by np.minimum, say: (n_cells, ...)."""
        if len(values) == len(self.start) - 1:  # simplices have one corner each
            return values.copy()
        return combine.reduceat(values, self.start[:-1])

    def cell_of(self, corner: int) -> int:
        """The cell that a corner belongs to."""
        return int(np.searchsorted(self.start, corner, side="right")) - 1


def corners_of(blocks: list[Cells], dimension: int) -> Corners:
    """The corners of blocks of linear cells that all have the given dimension, in block order.

    Raises InputError for a cell type that has no corners defined or another dimension.
    """
    vertices, shapes, counts = [], [], []
    for block in blocks:
        if relaxed_dimension(block.type) != dimension:
            raise InputError(f"cells of type {block.type!r} cannot be relaxed in {dimension}D")
        cell_type = CELL_TYPES[block.type]
        local, of_cells = np.array(cell_type.corners), block.vertices
        if not cell_type.is_simplex:
            of_cells = np.take(of_cells, local, axis=1)  # in order of the rows, unlike an index
        vertices.append(np.ascontiguousarray(of_cells.reshape(-1, dimension + 1), dtype=np.int32))
        shapes.append(np.tile(corner_shapes(cell_type), (len(block.vertices), 1)))
        counts.append(np.full(len(block.vertices), len(local)))
    start = np.concatenate([[0], np.cumsum(np.concatenate([np.empty(0, np.int64), *counts]))])
    empty = np.empty((0, dimension + 1))
    return Corners(
        vertices=_joined(vertices) if vertices else empty.astype(np.int32),
        shapes=_joined(shapes) if shapes else empty.astype(np.int32),
        table=SHAPES[dimension],
        start=start.astype(np.int64),
    )


def _joined(arrays: list[np.ndarray]) -> np.ndarray:
    """The arrays one after the other; a single one is not copied."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)
