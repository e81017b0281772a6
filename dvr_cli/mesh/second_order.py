"""Second-order cells: smoothed as linear ones, the further nodes carried along.

Node order is meshio's (VTK's). Every other node belongs to an edge, a face or the inside of its cell, named
here by the vertices in whose middle it ordinarily lies. A node on an edge keeps its place on the
edge, also where that is not the middle; other nodes keep their offset from the middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES, CellType
from dvr_cli.mesh.mesh import Cells, Mesh

# Distance from its straight place, relative to edge or face, up to which a node counts as there.
STRAIGHT = 1e-6


@dataclass(frozen=True, eq=False)
class CurvedCells:
    """Curved second-order cells of one type, as they are stored.

    vertices: (n, nodes). element: (n,) which elements of the domain they are. sign: (n,) -1.0 for those
    stored inside out, 1.0 for others.
    """

    type: str
    vertices: np.ndarray
    element: np.ndarray
    sign: np.ndarray


@dataclass(frozen=True, eq=False)
class MidNodes:
    """The nodes of second-order cells beside those of the linear cells, each once.

    nodes: (n,) their indices. around: (n, w) the vertices around each, rows filled up with the first.
    weights: (n, w) with which these give a node's straight place.
    bent_cells: (c,) ids of the cells that have a node farther than STRAIGHT from its straight place, and
        held: (h,) the corner vertices of these.
    """

    nodes: np.ndarray
    around: np.ndarray
    weights: np.ndarray
    bent_cells: np.ndarray
    held: np.ndarray

    @property
    def curved(self) -> int:
        """The number of cells that are not straight."""
        return len(self.bent_cells)

    def bent(self, points: np.ndarray, rounding: float, relative: float) -> np.ndarray:
        """(m, w) the vertices around those nodes that are farther than ``rounding``, or ``relative`` times
        the size of their edge or face, from their straight place; points: (N, D).
        """
        ends = points[self.around]
        place = (self.weights[:, :, None] * ends).sum(axis=1)
        size = np.ptp(ends, axis=1).max(axis=1)
        distance = np.linalg.norm(points[self.nodes] - place, axis=1)
        return self.around[distance > np.minimum(rounding, relative * size)]

    def carry(self, before: np.ndarray, after: np.ndarray, straighten: bool) -> None:
        """Move the nodes in ``after`` (N, D) as the vertices around them moved since ``before``.

        Nodes around which nothing moved keep their bits.

        straighten: put those that move to their straight place instead of keeping their offset from it.
        """
        shift = after[self.around] - before[self.around]
        moved = shift.any(axis=(1, 2))
        nodes, weights = self.nodes[moved], self.weights[moved, :, None]
        if straighten:
            after[nodes] = (weights * after[self.around[moved]]).sum(axis=1)
        else:
            after[nodes] = before[nodes] + (weights * shift[moved]).sum(axis=1)


def linear_cells(cells: list[Cells]) -> list[Cells]:
    """The same blocks with second-order cells cut down to linear ones."""
    result = []
    for block in cells:
        linear = _linear(block.type)
        result.append(block if linear is None else Cells(linear.name, block.vertices[:, : linear.nodes]))
    return result


def mid_nodes(mesh: Mesh) -> MidNodes | None:
    """The mid nodes of a mesh, None if it has none.

    Raises InputError when a node is a corner of one cell and a mid node of another.
    """
    start = np.cumsum([0, *(len(block.vertices) for block in mesh.cells)])
    second = [_linear(block.type) is not None and len(block.vertices) > 0 for block in mesh.cells]
    blocks = [block for block, is_second in zip(mesh.cells, second, strict=True) if is_second]
    if not blocks:
        return None
    width = max(len(around) for block in blocks for around in CELL_TYPES[block.type].mids)
    nodes, vertices, counts, curved = [], [], [], []
    held = [np.empty(0, dtype=np.int64)]
    for block, first in zip(blocks, start[:-1][second], strict=True):
        cell_type = CELL_TYPES[block.type]
        bent = np.zeros(len(block.vertices), dtype=bool)
        for node, around in zip(block.vertices.T[-len(cell_type.mids) :], cell_type.mids, strict=True):
            ends = block.vertices[:, around]
            bent |= _offset(mesh.points, node, ends) > STRAIGHT
            filled = np.repeat(ends[:, :1], width, axis=1)
            filled[:, : len(around)] = ends
            nodes.append(node)
            vertices.append(filled)
            counts.append(np.full(len(node), len(around)))
        curved.append(first + np.flatnonzero(bent))
        held.append(block.vertices[bent, : -len(cell_type.mids)].ravel())
    every_node, place = np.unique(np.concatenate(nodes), return_index=True)
    ends = np.concatenate(vertices)[place]
    count = np.concatenate(counts)[place]
    is_corner = np.zeros(len(mesh.points), dtype=bool)
    for block in linear_cells(mesh.cells):
        is_corner[block.vertices] = True
    if is_corner[every_node].any():
        node = every_node[is_corner[every_node]][0]
        raise InputError(f"vertex {node} (counted from 0) is a corner of one cell and a mid node of another")
    weights = np.where(np.arange(width) < count[:, None], 1.0 / count[:, None], 0.0)
    edge = count == 2
    t = _place_on_edge(mesh.points, every_node[edge], ends[edge, :2])
    weights[edge, 0], weights[edge, 1] = 1.0 - t, t
    return MidNodes(every_node, ends, weights, np.concatenate(curved), np.unique(np.concatenate(held)))


def curved_cells(
    mesh: Mesh, mids: MidNodes, cell_ids: np.ndarray, mirrored: np.ndarray
) -> tuple[CurvedCells, ...]:
    """The curved ones among the cells with these ids ((n,)); mirrored: (n,) bool, those stored inside out."""
    chosen = np.isin(cell_ids, mids.bent_cells)
    result, start = [], 0
    for block in mesh.cells:
        end = start + len(block.vertices)
        element = np.flatnonzero(chosen & (cell_ids >= start) & (cell_ids < end))
        if len(element):
            sign = np.where(mirrored[element], -1.0, 1.0)
            result.append(CurvedCells(block.type, block.vertices[cell_ids[element] - start], element, sign))
        start = end
    return tuple(result)


def _linear(name: str) -> CellType | None:
    """The linear type that a second-order one begins with, None for other types."""
    cell_type = CELL_TYPES.get(name)
    return None if cell_type is None else cell_type.linear


def _place_on_edge(points: np.ndarray, node: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(n,) where on the edge from ends[:, 0] (0) to ends[:, 1] (1) each node lies, or is nearest to."""
    edge = points[ends[:, 1]] - points[ends[:, 0]]
    along = ((points[node] - points[ends[:, 0]]) * edge).sum(axis=1)
    length = (edge * edge).sum(axis=1)
    return np.divide(along, length, out=np.full(len(node), 0.5), where=length > 0)


def _offset(points: np.ndarray, node: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(n,) distance of each node from its straight place, relative to the size of its edge, face or cell.

    On an edge that is the nearest one between its quarter points: beyond them the Jacobian is negative at an
    end.
    """
    around = points[ends]
    if ends.shape[1] == 2:
        t = _place_on_edge(points, node, ends)[:, None].clip(0.25, 0.75)
        place = (1.0 - t) * around[:, 0] + t * around[:, 1]
    else:
        place = around.mean(axis=1)
    size = np.linalg.norm(around - around.mean(axis=1, keepdims=True), axis=2).max(axis=1) * 2.0
    distance = np.linalg.norm(points[node] - place, axis=1)
    return np.divide(distance, size, out=np.zeros(len(node)), where=size > 0)
