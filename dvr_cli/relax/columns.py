"""The rings of independent vertices laid out in columns, in chunks that stay in cache.

See docs/design.md, "The three layouts of coordinates".
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dvr_cli.relax.problem import Problem

_CHUNK_CORNERS = 32768  # corners worked on at a time: small enough for the cache, large enough for NumPy


@dataclass(frozen=True, eq=False)
class RingChunk:
    """Independent vertices with rings of similar size, short rings padded with their last corner.

    rings: (n,) their numbers among the problem's rings.
    vertices: (n,); ends: (d, K, n) other vertices of each corner; shapes: (K, n) or (1, 1) if all are equal.
    real: (K, n) bool, which corners are not padding.
    """

    rings: np.ndarray
    vertices: np.ndarray
    ends: np.ndarray
    shapes: np.ndarray
    real: np.ndarray

    def of(self, keep: np.ndarray) -> RingChunk:
        """Some of the rings, by their places in the chunk."""
        shapes = self.shapes if self.shapes.size == 1 else self.shapes[:, keep]
        return RingChunk(
            self.rings[keep], self.vertices[keep], self.ends[:, :, keep], shapes, self.real[:, keep]
        )


def ring_chunks(problem: Problem, lo: int, hi: int) -> Iterator[RingChunk]:
    """Cut the rings lo..hi of one batch, sorted by size, into chunks."""
    rings = problem.rings
    batch = lo + np.argsort(rings.sizes[lo:hi], kind="stable")
    sizes = rings.sizes[batch]
    while len(batch):
        # as many rings as keep K·n within bounds, K being the size of the last and largest
        area = sizes * np.arange(1, len(sizes) + 1)
        n = max(1, int(np.searchsorted(area, _CHUNK_CORNERS, side="right")))
        part = batch[:n]
        entry = rings.start[part] + np.minimum(np.arange(sizes[n - 1])[:, None], sizes[:n] - 1)
        shapes = rings.shapes[entry]
        yield RingChunk(
            rings=part,
            vertices=rings.vertices[part].astype(np.intp),
            ends=np.ascontiguousarray(rings.others[entry].transpose(2, 0, 1), dtype=np.intp),
            shapes=shapes if shapes.min() != shapes.max() else shapes[:1, :1],
            real=np.arange(sizes[n - 1])[:, None] < sizes[:n],
        )
        batch, sizes = batch[n:], sizes[n:]
