"""Neighbourhoods of corners: the patches that a round of relaxing takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.csr import row_entries
from dvr_cli.mesh.ranks import distinct
from dvr_cli.relax.problem import Problem

ROUND = 32  # patches at most, where nobody says how many
CANDIDATES = 30  # worst corners that are looked at for each of them


@dataclass(frozen=True, eq=False)
class Patches:
    """P patches that share no corner, all in the problem's numbering.

    seeds: (P,) the touched corner each is built around.
    freed: the vertices that move, those of patch i at freed_start[i] .. freed_start[i+1].
    corners: the touched corners with any of them, likewise. vertices, shapes: (n, d+1), (n,) of these.
    """

    seeds: np.ndarray
    freed_start: np.ndarray
    freed: np.ndarray
    corner_start: np.ndarray
    corners: np.ndarray
    vertices: np.ndarray
    shapes: np.ndarray

    def __len__(self) -> int:
        """P."""
        return len(self.seeds)

    def of(self, patch: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The freed vertices of a patch, and the vertices and shapes of its corners."""
        entries = slice(*self.corner_start[patch : patch + 2])
        freed = self.freed[slice(*self.freed_start[patch : patch + 2])]
        return freed, self.vertices[entries], self.shapes[entries]


class Neighbourhoods:
    """The relaxed vertices and touched corners around each touched corner."""

    def __init__(self, problem: Problem, backend: Backend = NUMPY) -> None:
        """problem: whose touched corners are meant. backend: what computes; the result is the same."""
        self._backend = backend
        self._touched, self._vertices = problem.touched, problem.rings.vertices
        incidence = problem.incidence(backend)
        self._relaxed = incidence.members  # (C, d+1) relaxed vertices by number, or -1
        self._start, self._incident = incidence.start, incidence.corner

    def choose(self, seeds: np.ndarray, layers: np.ndarray, most: int = ROUND) -> Patches:
        """The patches of the first ``most`` of the corners ``seeds`` that share no corner with earlier ones.

        layers: (C,) how many to free around each touched corner, beside its own vertices.
        """
        parts = self._backend.twin(choose)(seeds, layers, most, self._relaxed, self._start, self._incident)
        taken, freed_start, freed, corner_start, corners = parts
        return Patches(
            seeds=taken,
            freed_start=freed_start,
            freed=self._vertices[freed],
            corner_start=corner_start,
            corners=corners,
            vertices=self._touched.vertices[corners],
            shapes=self._touched.shapes[corners, 0],
        )


def choose(
    seeds: np.ndarray,
    layers: np.ndarray,
    most: int,
    relaxed: np.ndarray,
    start: np.ndarray,
    incident: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Seeds, offsets and freed vertices by number, offsets and corners of the patches; see ``Patches``.

    seeds, layers: as for ``Neighbourhoods.choose``; most: how many patches; relaxed: (C, d+1) relaxed
    vertices of each corner by number, or -1; start, incident: the corners of each.
    """
    claimed = np.zeros(len(relaxed), dtype=bool)
    taken: list[int] = []
    freed, corners = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for seed in seeds.tolist():
        if claimed[seed]:
            continue
        around = np.array([seed])
        for _ in range(layers[seed] + 1):
            inside = relaxed[around]
            vertices = distinct(inside[inside >= 0])
            around = distinct(incident[row_entries(start, vertices)[0]])
        if claimed[around].any():
            continue
        claimed[around] = True
        taken.append(seed)
        freed.append(vertices)
        corners.append(around)
        if len(taken) == most:
            break
    starts = [np.cumsum([len(part) for part in parts]) for parts in (freed, corners)]
    return np.array(taken), starts[0], np.concatenate(freed), starts[1], np.concatenate(corners)
