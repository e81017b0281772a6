"""The schedule: batches of vertices that may be updated together (docs/design.md, "Batches").

Two relaxed vertices depend on each other when they share a corner. A batch holds independent vertices only;
updating it at once gives what updating its vertices one after the other would.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.csr import group, row_entries
from dvr_cli.mesh.hashing import mixed
from dvr_cli.mesh.ranks import distinct
from dvr_cli.mesh.rings import Incidence
from dvr_cli.options import OPTIONS

ORDERS = OPTIONS["order"].values.names

_COLOURS_AT_ONCE = 62  # colours looked at together, as the bits of a positive int64


def batches(
    incidence: Incidence,
    order: str,
    seed: int,
    backend: Backend = NUMPY,
    natural: np.ndarray | None = None,
) -> list[np.ndarray]:
    """The batches of one sweep: arrays of positions among the relaxed vertices, together each
    position once.

    order: "natural" reproduces the one-by-one sequence of the paper's Algorithm 1; "shuffled" the same for a
    random order drawn from ``seed`` (paper section 5.1, Fig. 11); "coloured" takes greedy colours instead,
    which are far fewer and larger. Positions ascend within a batch.
    backend: what computes; the result is the same.
    natural: (m,) the positions in the order of I_R; by default 0, 1, ...
    """
    m = len(incidence.start) - 1
    natural = np.arange(m) if natural is None else natural
    if order == "natural":
        sequence = natural
    elif order == "shuffled":
        generator = np.random.Generator(np.random.Philox(key=np.array([seed, 0], dtype=np.uint64)))
        sequence = natural[generator.permutation(m)]
    else:
        sequence = _scattered(m)
    visit = backend.twin(colours if order == "coloured" else levels)
    label = visit(incidence.start, incidence.corner, incidence.members, sequence)
    positions, start = group(label, int(label.max(initial=-1)) + 1)
    return np.split(positions, start[1:-1]) if m else []


def _scattered(m: int) -> np.ndarray:
    """0..m-1 in a fixed order of short dependency chains: in 16 rounds, each in ascending order.

    To which round a number belongs is without pattern; ascending, as neighbours in memory are then visited
    soon after each other.
    """
    return np.argsort((mixed(np.arange(m, dtype=np.uint64)) >> np.uint64(60)).astype(np.uint8), kind="stable")


def levels(start: np.ndarray, corner: np.ndarray, members: np.ndarray, sequence: np.ndarray) -> np.ndarray:
    """(m,) the level of each vertex: one more than the highest of its neighbours earlier in ``sequence``.

    start, corner, members: of an Incidence. Vertices of one level depend on lower ones only.
    """
    level = np.full(len(sequence), -1)
    for number, ready in enumerate(_level_sets(start, members[corner], sequence)):
        level[ready] = number
    return level


def _level_sets(start: np.ndarray, neighbours: np.ndarray, sequence: np.ndarray) -> Iterator[np.ndarray]:
    """The vertices of each level; neighbours: rows of (R, d+1), -1 for vertices that are not relaxed."""
    m = len(sequence)
    rank = np.empty(m, dtype=np.int64)
    rank[sequence] = np.arange(m)
    own = np.repeat(np.arange(m), np.diff(start))
    padded_rank = np.append(rank, m)  # the number -1 looks up the last entry: later than all
    before = padded_rank[neighbours] < rank[own][:, None]
    waiting = np.bincount(np.repeat(own, before.sum(axis=1)), minlength=m)
    ready = np.flatnonzero(waiting == 0)
    while len(ready):
        yield ready
        entries, _ = row_entries(start, ready)
        after = neighbours[entries][~before[entries]]
        after = after[after >= 0]
        np.subtract.at(waiting, after, 1)
        ready = distinct(after[waiting[after] == 0])


def colours(start: np.ndarray, corner: np.ndarray, members: np.ndarray, sequence: np.ndarray) -> np.ndarray:
    """(m,) greedy colours: the first that no neighbour earlier in ``sequence`` has; see ``levels``."""
    m = len(start) - 1
    neighbours = members[corner]  # with repetitions and the vertex itself: no harm below
    colour = np.full(m + 1, -1)  # the last entry stands for neighbours that are not relaxed
    for ready in _level_sets(start, neighbours, sequence):
        entries, ready_start = row_entries(start, ready)
        taken = colour[neighbours[entries]]
        row = np.repeat(np.arange(len(ready)), np.diff(ready_start))
        pending, base = np.arange(len(ready)), 0
        while len(pending):
            shift = taken - base
            here = (shift >= 0) & (shift < _COLOURS_AT_ONCE)
            bits = np.bitwise_or.reduce(np.where(here, 1 << np.where(here, shift, 0), 0), axis=1)
            used = np.zeros(len(ready), dtype=np.int64)
            np.bitwise_or.at(used, row, bits)
            free = ~used & (used + 1)  # the lowest bit that is not set
            found = pending[free[pending] < 1 << _COLOURS_AT_ONCE]
            colour[ready[found]] = base + np.frexp(free[found])[1] - 1
            pending = pending[colour[ready[pending]] < 0]
            base += _COLOURS_AT_ONCE
    return colour[:-1]


def colour_ready(
    sequence: np.ndarray,
    own: np.ndarray,
    start: np.ndarray,
    corner: np.ndarray,
    vertices: np.ndarray,
    turn: np.ndarray,
    colour: np.ndarray,
) -> None:
    """Colour those vertices that do not wait for one without a colour, as ``colours`` would.

    sequence: (k,) the positions that have no colour yet among the m vertices ``own``, by their turn. start,
    corner: of an Incidence of these m; vertices: (C, d+1) of its corners. turn: (n,) of each vertex, the
    largest number for those that are not relaxed. colour: (n,) of each, -1 for none; changed.
    """
    while len(sequence):
        entries, first = row_entries(start, sequence)
        row = np.repeat(np.arange(len(sequence)), np.diff(first))
        others = vertices[corner[entries]]
        taken = np.where(turn[others] < turn[own[sequence]][row][:, None], colour[others], colour.max() + 1)
        waits = np.zeros(len(sequence), dtype=bool)
        waits[row[(taken < 0).any(axis=1)]] = True
        used = np.zeros((len(sequence), colour.max() + 3), dtype=bool)
        used[np.repeat(row, taken.shape[1]), np.maximum(taken, -1).ravel()] = True
        used[:, -2:] = False  # where those stand that do not count, or are waited for
        if waits.all():
            return
        colour[own[sequence[~waits]]] = used[~waits].argmin(axis=1)
        sequence = sequence[waits]
