"""Colours of vertices that several ranks own: those that ``schedule.colours`` gives where one has all.

After Jones and Plassmann: a vertex gets its colour as soon as all its neighbours with an earlier turn have
theirs, on whatever rank they are. Which ranks there are makes no difference.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dvr_cli.backend import Backend
from dvr_cli.distributed.rows import swapped
from dvr_cli.mesh.hashing import mixed
from dvr_cli.mesh.rings import Incidence
from dvr_cli.relax.schedule import colour_ready

NEVER = np.iinfo(np.int64).max  # the turn of a vertex that is not relaxed
_ROUND = np.int64(58)  # bits below the round


def turns(positions: np.ndarray) -> np.ndarray:
    """(n,) what orders vertices as ``schedule`` does, from their positions among the relaxed ones; -1: none.

    A position is below 2**58.
    """
    rounds = (mixed(positions.astype(np.uint64)) >> np.uint64(60)).astype(np.int64)
    return np.where(positions < 0, NEVER, rounds << _ROUND | positions)


def colours(
    comm: Any,
    own: np.ndarray,
    incidence: Incidence,
    turn: np.ndarray,
    ghosts: tuple[list[np.ndarray], list[np.ndarray]],
    vertices: np.ndarray,
    backend: Backend,
) -> np.ndarray:
    """(n,) the colour of each vertex of this rank, ghosts too; -1 for those that are not relaxed.

    own: (m,) the vertices that it owns, and incidence: theirs; vertices: (C, d+1) of the corners. turn: (n,)
    of each, see ``turns``. ghosts: for each rank the vertices that are ghosts there, and those that are here,
    in one order on both.
    """
    colour = np.full(len(turn), -1, dtype=np.int64)
    left = np.argsort(turn[own])
    some = backend.twin(colour_ready)
    while True:
        some(left, own, incidence.start, incidence.corner, vertices, turn, colour)
        left = left[colour[own[left]] < 0]
        mine = {rank: colour[there] for rank, there in enumerate(ghosts[0]) if len(there)}
        for rank, theirs in swapped(comm, mine).items():
            colour[ghosts[1][rank]] = theirs
        if not any(comm.allgather(len(left))):
            return colour
