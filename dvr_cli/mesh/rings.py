"""Rings: for each relaxed vertex all corners that contain it (the paper's 1-ring, section 2.3).

Every entry of a ring is a corner re-expressed with the ring's own vertex as origin: the d other vertices of
the simplex, in positive order, and the row of the shape table that belongs to that choice of origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.mesh.corners import ORIGIN_FIRST, Corners
from dvr_cli.mesh.csr import group, row_entries


@dataclass(frozen=True)
class Rings:
    """The rings of m relaxed vertices, one after the other.

    vertices: (m,) int32, the relaxed vertices.
    start: (m + 1,) int64, the entries of ring i are start[i] .. start[i+1], in ascending corner order.
    others: (R, d) int32, the other vertices of each entry's simplex.
    shapes: (R,) uint8, its row of the shape table.
    """

    vertices: np.ndarray
    start: np.ndarray
    others: np.ndarray
    shapes: np.ndarray

    @property
    def sizes(self) -> np.ndarray:
        """(m,) number of corners in each ring."""
        return np.diff(self.start)

    def permuted(self, order: np.ndarray, compiled: bool = False) -> Rings:
        """The same rings with ring order[0] first, then order[1], ..."""
        if compiled:
            from dvr_cli.mesh import compiled as fast

            parts = fast.permuted_rings(self.start, self.others, self.shapes, order)
            return Rings(self.vertices[order], *parts)
        entries, start = row_entries(self.start, order)
        return Rings(self.vertices[order], start, self.others[entries], self.shapes[entries])


def rings_of(corners: Corners, relaxed: np.ndarray, n_points: int, compiled: bool = False) -> Rings:
    """The rings of the vertices ``relaxed`` ((m,) distinct point indices), in that order.

    compiled: use compiled code; the result is the same.
    """
    d = corners.dimension
    number = np.full(n_points, -1, dtype=np.int32)
    number[relaxed] = np.arange(len(relaxed))
    keys = number[corners.vertices.ravel()]
    if compiled:
        from dvr_cli.mesh import compiled as fast

        position, start = fast.group(keys, len(relaxed))
        entries = fast.ring_entries(position, corners.vertices, corners.shapes, ORIGIN_FIRST[d])
        return Rings(relaxed.astype(np.int32), start, *entries)
    position, start = group(keys, len(relaxed))
    corner, local = np.divmod(position, d + 1)
    others = corners.vertices[corner[:, None], ORIGIN_FIRST[d][local][:, 1:]]
    return Rings(relaxed.astype(np.int32), start, others, corners.shapes[corner, local])
