"""Rings: for each relaxed vertex all corners that contain it (the paper's 1-ring, section 2.3).

Every entry of a ring is a corner re-expressed with the ring's own vertex as origin: the d other vertices of
the simplex, in positive order, and the row of the shape table that belongs to that choice of origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.corners import ORIGIN_FIRST, Simplices
from dvr_cli.mesh.csr import group, row_entries


@dataclass(frozen=True, eq=False)
class Rings:
    """The rings of m relaxed vertices, one after the other.

    vertices: (m,) int32, the relaxed vertices.
    start: (m + 1,) int64, the entries of ring i are start[i] .. start[i+1], in ascending corner order.
    others: (R, d) int32, the other vertices of each entry's simplex.
    shapes: (R,) int32, its row of the shape table.
    """

    vertices: np.ndarray
    start: np.ndarray
    others: np.ndarray
    shapes: np.ndarray

    @property
    def sizes(self) -> np.ndarray:
        """(m,) number of corners in each ring."""
        return np.diff(self.start)

    def part(self, chosen: np.ndarray) -> Rings:
        """The rings ``chosen`` (k,), one after the other."""
        entries, start = row_entries(self.start, chosen)
        return Rings(self.vertices[chosen], start, self.others[entries], self.shapes[entries])


@dataclass(frozen=True, eq=False)
class Incidence:
    """The corners that contain each of m vertices.

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

    def rings(self, corners: Simplices, sequence: np.ndarray, backend: Backend = NUMPY) -> Rings:
        """The rings of the vertices sequence[0], sequence[1], ... of the m, each once.

        backend: what computes; the result is the same.
        """
        entries = self.start, self.corner, self.place
        parts = (corners.vertices, corners.shapes, ORIGIN_FIRST[corners.dimension])
        return Rings(self.vertices[sequence], *backend.twin(rings)(sequence, *entries, *parts))


def incidence_of(
    corners: Simplices, vertices: np.ndarray, n_points: int, backend: Backend = NUMPY
) -> Incidence:
    """The incidence of ``vertices`` ((m,) distinct point indices).

    backend: what computes; the result is the same.
    """
    number = np.full(n_points, -1, dtype=np.int32)
    number[vertices] = np.arange(len(vertices))
    parts = backend.twin(incidence)(corners.vertices, number, len(vertices))
    return Incidence(vertices.astype(np.int32), *parts)


def incidence(
    vertices: np.ndarray, number: np.ndarray, n: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Offsets (n + 1,), corner and place in it of each entry, by vertex 0..n-1, members; see ``Incidence``.

    vertices: (C, d+1) of the corners. number: (N,) which of the n vertices each is, -1 for others.
    """
    members = number[vertices]
    position, start = group(members.ravel(), n)
    return start, *np.divmod(position, members.shape[1]), members


def rings(
    sequence: np.ndarray,
    start: np.ndarray,
    corner: np.ndarray,
    place: np.ndarray,
    vertices: np.ndarray,
    shapes: np.ndarray,
    origin_first: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Offsets, other vertices and shapes of the rings of ``sequence``, one after the other; see ``Rings``.

    start, corner, place: of an incidence; vertices, shapes: of its corners; origin_first: of their dimension.
    """
    entries, new_start = row_entries(start, sequence)
    corner, place = corner[entries], place[entries]
    others = vertices[corner[:, None], origin_first[place][:, 1:]]
    return new_start, others, shapes[corner, place]
