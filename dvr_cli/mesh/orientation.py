"""Orientation: which cells are stored inside out, told apart from cells that are inverted.

Mesh files store cells in either orientation: TetGen and Stellar files often have every tetrahedron negative,
a Delaunay code may give each triangle either sign. Two neighbours are stored alike when their common facet
runs in opposite directions in them. Following this from neighbour to neighbour orients each connected part
of the mesh up to one sign, and that sign is the one that makes the measure of the part positive. A cell that
is still negative then is inverted: its vertices lie where they should not.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.facets import facets_of
from dvr_cli.mesh.mesh import Cells


def mirrored_cells(measures: np.ndarray, blocks: list[Cells], backend: Backend = NUMPY) -> np.ndarray:
    """(n,) bool: the cells whose stored order has to be mirrored to orient the mesh coherently.

    measures: (n,) signed measure of each cell as stored, in any positive scale; blocks: the cells.
    backend: what computes; the result is the same.
    """
    if (measures > 0).all():
        return np.zeros(len(measures), dtype=bool)
    if (measures < 0).all():
        return np.ones(len(measures), dtype=bool)
    return unlike_cells(measures, blocks, backend)


def unlike_cells(weights: np.ndarray, blocks: list[Cells], backend: Backend = NUMPY) -> np.ndarray:
    """(n,) bool: the cells to mirror to make each connected part alike: those of less ``weights`` (n,).

    blocks, backend: as for ``mirrored_cells``.
    """
    label = backend.twin(connected_parts)(2 * len(weights), *sides(blocks, backend))
    as_stored, mirrored = label[0::2], label[1::2]
    # The two labels of a cell name the two ways to orient its part. Adding up the measures under the smaller
    # of them gives the sign of that way; a part that cannot be oriented (both labels equal) stays as stored.
    way = np.where(as_stored <= mirrored, 1.0, -1.0)
    total = np.zeros(2 * len(weights))
    np.add.at(total, np.minimum(as_stored, mirrored), way * weights)
    good_way = np.where(total[np.minimum(as_stored, mirrored)] >= 0, 1.0, -1.0)
    return (way != good_way) & (as_stored != mirrored)


def sides(
    blocks: list[Cells], backend: Backend, seen: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The edges (e,), (e,) of a graph, in which the ways to store two neighbours alike are joined.

    Node 2c stands for "cell c as stored", node 2c+1 for its mirror image. seen: (N,) bool, facets without one
    of these vertices do not count.
    """
    one, other, alike = _neighbours(blocks, backend, seen)
    return (
        np.concatenate([2 * one, 2 * one + 1]),
        np.concatenate([2 * other + ~alike, 2 * other + alike]),
    )


def are_alike(blocks: list[Cells], backend: Backend = NUMPY) -> bool:
    """True if all cells that have a facet in common, and share it with no third one, are stored alike."""
    return bool(_neighbours(blocks, backend)[2].all())


def turned_cells(stored: list[Cells], oriented: list[Cells]) -> np.ndarray:
    """(n,) bool: the cells that ``with_mirrored`` has turned; stored: the blocks as they were."""
    pairs = zip(stored, oriented, strict=True)
    return np.concatenate([(a.vertices != b.vertices).any(axis=1) for a, b in pairs])


def with_mirrored(blocks: list[Cells], mirrored: np.ndarray) -> list[Cells]:
    """The blocks with the cells marked in ``mirrored`` ((n,) bool through all blocks) turned inside out."""
    if not mirrored.any():
        return blocks
    result, start = [], 0
    for block in blocks:
        here = mirrored[start : start + len(block.vertices)]
        start += len(block.vertices)
        mirror = np.take(block.vertices, CELL_TYPES[block.type].mirror, axis=1)
        turned = np.where(here[:, None], mirror, block.vertices)
        result.append(Cells(block.type, turned))
    return result


def connected_parts(n: int, tail: np.ndarray, head: np.ndarray) -> np.ndarray:
    """(n,) smallest node of the connected part of each node, in the graph with edges tail[i]-head[i]."""
    label = np.arange(n)
    while True:
        low = np.minimum(label[tail], label[head])
        before = label.copy()
        np.minimum.at(label, tail, low)
        np.minimum.at(label, head, low)
        np.minimum.at(label, before[tail], low)  # hook whole trees: few rounds
        np.minimum.at(label, before[head], low)
        while (label[label] != label).any():
            label = label[label]
        if (label == before).all():
            return label


def _neighbours(
    blocks: list[Cells], backend: Backend, seen: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The pairs of cells that share a facet, by number, and whether the two are stored alike ((n,) bool)."""
    facets = facets_of(blocks, backend)
    pair = facets.start[:-1][facets.shared_by == 2]
    if seen is not None:
        vertices = facets.vertices[pair]
        pair = pair[(seen[vertices] & (vertices >= 0)).any(axis=1)]
    one, other = facets.cell[pair].astype(np.int64), facets.cell[pair + 1].astype(np.int64)
    return one, other, ~_same_direction(facets.vertices[pair], facets.vertices[pair + 1])


def _same_direction(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(G,) whether facets with the same vertices ((G, w), short ones end in -1) run the same way round."""
    rows = np.arange(len(a))
    length = (a >= 0).sum(axis=1)
    where = (b == a[:, :1]).argmax(axis=1)  # position of a's first vertex in b
    following = b[rows, (where + 1) % length]
    if a.shape[1] == 2:
        return where == 0
    return following == a[:, 1]
