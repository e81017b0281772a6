"""The nodes of a Gmsh file: tags, coordinates, and where in the file the coordinates are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.tags import first_repeated
from dvr_cli.mesh.mesh import Entity


class NodeBlocks(NamedTuple):
    """The places of the coordinates: a row of integers for each block of equally spaced nodes.

    Positions and lengths are in tokens (ASCII) or bytes (binary), counted from where the section's body
    begins.

    first: position of the first coordinate of the block's first node.
    size: number of nodes in the block.
    stride: from one node's first coordinate to the next one's.
    tail: length of what follows the three coordinates of a node and goes if its parameters are dropped.
    parametric: whether the nodes have parameters, which go stale when a node moves.
    flag: position of the block's "parametric" flag, -1 if it has none (MSH 2).
    """

    first: np.ndarray
    size: np.ndarray
    stride: np.ndarray
    tail: np.ndarray
    parametric: np.ndarray
    flag: np.ndarray

    @classmethod
    def of(cls, rows: list[tuple[int, int, int, int, bool, int]]) -> NodeBlocks:
        """From one row for each block."""
        return cls(*np.array(rows, np.int64).reshape(-1, 6).T)

    def positions(self) -> np.ndarray:
        """(N,) positions of the first coordinate of every node, in file order."""
        before = np.cumsum(self.size) - self.size
        start = self.first - before * self.stride
        return np.repeat(start, self.size) + np.arange(self.size.sum()) * np.repeat(self.stride, self.size)


class Nodes(NamedTuple):
    """The nodes in file order: (N,) int64 tags, (N, 3) float64 coordinates, and their layout.

    entities: the positions of those inside each curve and surface of the model, in MSH 4.
    """

    tags: np.ndarray
    points: np.ndarray
    blocks: NodeBlocks
    entities: dict[Entity, np.ndarray]

    @classmethod
    def join(cls, tags: list[np.ndarray], points: list[np.ndarray], blocks: NodeBlocks) -> Nodes:
        """Join the nodes of all blocks; InputError if a tag is not positive or occurs twice."""
        joined = np.concatenate([np.empty(0, np.int64), *tags], dtype=np.int64)
        if (joined < 1).any():
            raise InputError(f"node tag {joined.min()} is not positive: section $Nodes is damaged")
        repeated = first_repeated(joined)
        if repeated is not None:
            raise InputError(f"node tag {repeated} occurs more than once")
        return cls(joined, np.concatenate([np.empty((0, 3)), *points], dtype=np.float64), blocks, {})
