"""Patches for other ranks to solve: each with the coordinates and rules of its own vertices, and no more."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dvr_cli.relax.patches.solver import Patch


class Alone(NamedTuple):
    """A patch on its own.

    points: (n, d) of its vertices, and of those around it; patch: in their numbering.
    """

    points: np.ndarray
    patch: Patch


def alone(points: np.ndarray, patch: Patch) -> Alone:
    """The patch on its own; points: (N, d) those of the numbering it is in.

    Its vertices and corners keep their order, so it is solved with the same bits.
    """
    here = np.unique(np.concatenate([patch.moving, patch.vertices.ravel()]))
    rows, shapes = np.unique(patch.shapes, return_inverse=True)
    own = Patch(
        moving=np.searchsorted(here, patch.moving).astype(patch.moving.dtype),
        vertices=np.searchsorted(here, patch.vertices).astype(patch.vertices.dtype),
        shapes=shapes.astype(patch.shapes.dtype),
        slot=patch.slot[here],
        norm=patch.norm[rows],
        factor=patch.factor[rows] if len(patch.factor) else patch.factor,
        dimension=patch.dimension[here],
        axis=patch.axis[here],
        enough=patch.enough,
        bearable=patch.bearable,
        altitude=patch.altitude,
    )
    return Alone(points[here], own)


def shares(patches: Sequence[Patch], ranks: int) -> list[list[int]]:
    """For each rank the numbers of the patches it is to solve, so that all have about as many corners."""
    mine: list[list[int]] = [[] for _ in range(ranks)]
    work = np.zeros(ranks, dtype=np.int64)
    for number in sorted(range(len(patches)), key=lambda one: -len(patches[one].vertices)):
        rank = int(work.argmin())
        mine[rank].append(number)
        work[rank] += len(patches[number].vertices)
    return mine
