"""Numbers by which a file names its vertices: from them to indices, where no rank knows those of all."""

from __future__ import annotations

from typing import Any

import numpy as np

from dvr_cli.distributed.ranks import agree
from dvr_cli.distributed.rows import asked, bounds, cuts, index_type, part_of, sent
from dvr_cli.mesh.ranks import distinct_and_ranks


class Numbering:
    """The numbers of vertices, of which ranks know a range each and ask one another.

    All ranks have to call its functions together.

    sound: whether numbers are positive, and none is there twice; the same on all ranks.
    """

    def __init__(self, comm: Any, size: int, base: int, numbers: np.ndarray | None) -> None:
        """size: vertices of the whole. numbers: (n,) of those that this rank has read, ``rows.bounds``.

        On all ranks they are None where the numbers count from ``base``; often they do where they are given.
        """
        self._comm, self._base, self.sound = comm, base, True
        self._known: tuple[np.ndarray, np.ndarray] | None = None
        if numbers is None:
            return
        first, last = bounds(size, comm.size)[comm.rank : comm.rank + 2]
        index = np.arange(first, last, dtype=index_type(size))
        if agree(comm, np.array_equal(numbers, base + np.arange(first, last))):
            return
        self._cuts = cuts(comm, np.sort(numbers))
        numbers, index = sent(comm, part_of(numbers, self._cuts), numbers, index)
        order = np.argsort(numbers)
        numbers, index = numbers[order], index[order]
        self.sound = agree(comm, bool((numbers[1:] != numbers[:-1]).all() and (numbers[:1] > 0).all()))
        end = np.array([np.iinfo(numbers.dtype).max], numbers.dtype)  # beyond which there is nothing to find
        self._known = np.concatenate([numbers, end]), np.concatenate([index, np.array([-1], index.dtype)])

    def find(self, numbers: np.ndarray) -> np.ndarray:
        """The index of each number, of whatever shape; none of a vertex where no vertex has it."""
        if self._known is None:
            return numbers - numbers.dtype.type(self._base)
        wanted, place = distinct_and_ranks(numbers.ravel())
        known, _ = asked(self._comm, wanted, part_of(wanted, self._cuts), self._index)
        return known[place].reshape(numbers.shape)

    def _index(self, wanted: np.ndarray) -> np.ndarray:
        """The index of numbers of which this rank knows the range, -1 of those that are not there."""
        assert self._known is not None
        numbers, index = self._known
        # links may name larger numbers than the type of those of vertices holds
        at = np.searchsorted(numbers, wanted).clip(max=len(numbers) - 1)
        return np.where(numbers[at] == wanted, index[at], index.dtype.type(-1))
