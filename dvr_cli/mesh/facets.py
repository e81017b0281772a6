"""Facets: the sides that cells share with their neighbours, or that lie on the boundary.

A facet is an edge of a triangle or quadrilateral, a face of a volume element. Two cells are neighbours when
they have a facet with the same vertices; a facet of one cell only lies on the boundary.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.cell_types import CELL_TYPES, CellType
from dvr_cli.mesh.mesh import Cells


def padded_facets(cell_type: CellType) -> np.ndarray:
    """(F, w) the facets of a cell type, w the largest; shorter ones end in -1."""
    width = max(map(len, cell_type.facets))
    return np.array([[*facet, -1][:width] for facet in cell_type.facets])


def outlines(block: Cells) -> np.ndarray:
    """(n, k) the vertices of planar cells, one after the other round each, counterclockwise."""
    outline = CELL_TYPES[block.type].outline
    return block.vertices if outline == tuple(range(len(outline))) else block.vertices[:, outline]


@dataclass(frozen=True, eq=False)
class Facets:
    """All facets of a mesh, once for each cell that has them.

    sides: (F, w) point indices in positive order, w the largest facet; shorter ones end in -1.
    owner: (F,) the cell each belongs to.
    order: (F,) puts facets with the same vertices next to each other: in this order they are
    start: (G + 1,) start[g] .. start[g+1].
    """

    sides: np.ndarray
    owner: np.ndarray
    order: np.ndarray
    start: np.ndarray

    @cached_property
    def vertices(self) -> np.ndarray:
        """(F, w) the sides in order."""
        return self.sides[self.order]

    @cached_property
    def cell(self) -> np.ndarray:
        """(F,) the owners in order."""
        return self.owner[self.order]

    @property
    def shared_by(self) -> np.ndarray:
        """(G,) how many cells have each facet: 1 on the boundary, 2 inside."""
        return np.diff(self.start)


def facets_of(blocks: list[Cells], backend: Backend = NUMPY) -> Facets:
    """The facets of blocks of linear cells of one dimension; cells are numbered through the blocks.

    backend: what computes; the result is the same but for the order of equal facets.
    """
    local = [CELL_TYPES[block.type].facets for block in blocks]
    width = max((len(facet) for facets in local for facet in facets), default=2)
    total = sum(len(block.vertices) * len(facets) for block, facets in zip(blocks, local, strict=True))
    vertices = np.full((total, width), -1, dtype=np.int32)
    cell = np.empty(total, dtype=np.int32)
    start = row = 0
    for block, facets in zip(blocks, local, strict=True):
        n = len(block.vertices)
        for facet in facets:
            for k, vertex in enumerate(facet):
                vertices[row : row + n, k] = block.vertices[:, vertex]
            cell[row : row + n] = np.arange(start, start + n)
            row += n
        start += n
    order, new = backend.twin(facet_order)(vertices, int(vertices.max(initial=-1)) + 1)
    return Facets(vertices, cell, order, np.append(np.flatnonzero(new), len(cell)))


def vertices_of(facets: np.ndarray) -> np.ndarray:
    """(n,) the vertices of facets ((F, w), shorter rows end in -1), ascending."""
    used = np.zeros(int(facets.max(initial=0)) + 2, dtype=bool)
    used[facets] = True  # the last is for -1
    return np.flatnonzero(used[:-1])


def numbered(rows: np.ndarray, backend: Backend = NUMPY) -> np.ndarray:
    """(n,) a number from 0 for each of ``rows`` ((n, w) point indices, -1 for none), equal for equal sets.

    backend: what computes; the result is the same.
    """
    order, new = backend.twin(facet_order)(rows, int(rows.max(initial=-1)) + 1)
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    return number


def facet_order(vertices: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """An order that puts facets with the same vertices together, and where in it a new one begins.

    vertices: (F, w) from -1 to n - 1.
    """
    rows = np.sort(vertices, axis=1)
    n += 1  # values, -1 included
    keys = []
    room = 0
    for column in rows.T:  # pack as many columns into each 63-bit key as fit
        if room < n:
            keys.append(np.zeros(len(rows), dtype=np.int64))
            room = 2**63 - 1
        keys[-1] = keys[-1] * n + (column.astype(np.int64) + 1)
        room //= n
    order = np.argsort(keys[0]) if len(keys) == 1 else np.lexsort(keys)
    new = np.ones(len(rows), dtype=bool)
    if len(rows) > 1:
        new[1:] = np.any([key[order][1:] != key[order][:-1] for key in keys], axis=0)
    return order, new
