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


@dataclass(frozen=True)
class Incidence:
    """Which corners contain which of m vertices.

    vertices: (m,) int32, their point indices.
    start: (m + 1,) int64, the entries of vertex i are start[i] .. start[i+1].
    corner, place: (R,) the corner of each entry, ascending within a vertex; its place there, 0..d.
    members: (C, d+1) int32, which of the m vertices those of each corner are, -1 for others.
    """

    vertices: np.ndarray
    start: np.ndarray
    corner: np.ndarray
    place: np.ndarray
    members: np.ndarray

    def rings(self, corners: Corners, sequence: np.ndarray, compiled: bool = False) -> Rings:
        """The rings of the vertices sequence[0], sequence[1], ... of the m.

        compiled: use compiled code; the result is the same.
        """
        origin_first = ORIGIN_FIRST[corners.dimension]
        if compiled:
            from dvr_cli.mesh import rings_numba as fast

            parts = fast.rings(
                sequence, self.start, self.corner, self.place, corners.vertices, corners.shapes, origin_first
            )
            return Rings(self.vertices[sequence], *parts)
        entries, start = row_entries(self.start, sequence)
        corner, place = self.corner[entries], self.place[entries]
        others = corners.vertices[corner[:, None], origin_first[place][:, 1:]]
        return Rings(self.vertices[sequence], start, others, corners.shapes[corner, place])


def incidence_of(corners: Corners, vertices: np.ndarray, n_points: int, compiled: bool = False) -> Incidence:
    """The incidence of ``vertices`` ((m,) distinct point indices).

    compiled: use compiled code; the result is the same.
    """
    number = np.full(n_points, -1, dtype=np.int32)
    number[vertices] = np.arange(len(vertices))
    members = number[corners.vertices]
    if compiled:
        from dvr_cli.mesh import rings_numba as fast

        start, corner, place = fast.incidence(members, len(vertices))
    else:
        position, start = group(members.ravel(), len(vertices))
        corner, place = np.divmod(position, members.shape[1])
    return Incidence(vertices.astype(np.int32), start, corner, place, members)
