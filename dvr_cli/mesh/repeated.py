"""Repeated cells: those that have the same vertices as one before them, whatever their order."""

from __future__ import annotations

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.hashing import mixed
from dvr_cli.mesh.mesh import Cells


def repeated_cells(
    blocks: list[Cells], n_points: int, backend: Backend = NUMPY
) -> tuple[np.ndarray, np.ndarray]:
    """The cells (r,) that repeat another one, ascending, and the first cell (r,) with the vertices of each.

    Cells are numbered through the blocks, which are of linear cells of one dimension. A random number that
    depends on their vertices tells them apart (two are equal by chance with a probability of 2^-64).
    backend: what computes; the result is the same.
    """
    of_vertex = mixed(np.arange(1, n_points + 1, dtype=np.uint64))
    with np.errstate(over="ignore"):  # numbers are modulo 2^64
        sums = [backend.twin(summed)(of_vertex, block.vertices) for block in blocks]
    key = np.concatenate([np.empty(0, dtype=np.uint64), *sums])
    ascending = np.sort(key)  # many times as fast as finding out which is where
    if not (ascending[1:] == ascending[:-1]).any():
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    original = first[number]
    again = np.flatnonzero(original != np.arange(len(key)))
    return again, original[again]


def summed(of_vertex: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(n,) the sums of the numbers (N,) of the vertices of cells (n, k)."""
    return sum((of_vertex[column] for column in vertices.T[1:]), of_vertex[vertices[:, 0]])


def without(blocks: list[Cells], cells: np.ndarray) -> list[Cells]:
    """The blocks without these cells ((r,) numbers through the blocks)."""
    keep = np.ones(sum(len(block.vertices) for block in blocks), dtype=bool)
    keep[cells] = False
    parts = np.split(keep, np.cumsum([len(block.vertices) for block in blocks])[:-1])
    return [Cells(b.type, b.vertices[part]) for b, part in zip(blocks, parts, strict=True) if part.any()]


def shared_regions(region: np.ndarray, repeated: np.ndarray, original: np.ndarray) -> np.ndarray:
    """(n,) region numbers, equal where a cell and all that repeat it are in the same regions.

    region: (n,) that of each cell by itself.
    """
    pairs = np.unique(np.stack([original, region[repeated]], axis=1), axis=0)
    pairs = pairs[region[pairs[:, 0]] != pairs[:, 1]]
    number = mixed(region.astype(np.uint64) + np.uint64(1))
    np.bitwise_xor.at(number, pairs[:, 0], mixed(pairs[:, 1].astype(np.uint64) + np.uint64(1)))
    return np.unique(number, return_inverse=True)[1]
