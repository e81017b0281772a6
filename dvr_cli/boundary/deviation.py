"""Deviation: how far a boundary that has moved is from the one it was, measured from both sides."""

from __future__ import annotations

import numpy as np

from dvr_cli.boundary.manifold import Manifold

_FIRST, _CHUNK = 16, 4096  # facets measured at a time, at first and at most
_FINE, _GRID = 20, 5  # intervals an edge is cut into, of the first facets and of others


def deviation(old: Manifold, after: np.ndarray, near: np.ndarray, bound: np.ndarray) -> float:
    """The largest distance between the facets ``old`` and the same at ``after``, sampled densely both ways.

    old: F segments or triangles. after: (N, d) coordinates. near: (F,) the old facet that each is near to.
    bound: (F,) a distance that none of its points exceeds; what cannot be farther than what was found already
    is passed over, and where the search for the nearest point ends farther away, as it may at a fold, the
    bound counts.
    """
    new, facets = old.at(after), old.simplices
    moved = (old.points != after).any(axis=1)
    changed = np.flatnonzero(moved[facets].any(axis=1) & (bound > 0.0))
    changed = changed[np.argsort(-bound[changed], kind="stable")]
    largest, lo, size = 0.0, 0, _FIRST  # the first, which have the largest bounds, often spare the others
    while lo < len(changed):
        chunk, weights = changed[lo : lo + size], _grid(facets.shape[1], _GRID if lo else _FINE)
        lo, size = lo + size, min(2 * size, _CHUNK)
        chunk = chunk[bound[chunk] > largest]
        if not len(chunk):
            break
        for target, origin, start in ((old, new, near[chunk]), (new, old, chunk)):
            samples = np.einsum("sk,fkd->fsd", weights, origin.places(chunk))
            hints = np.repeat(start, len(weights))
            distance = target.nearest(np.concatenate(samples), hints)[2].reshape(len(chunk), -1)
            largest = max(largest, float(np.minimum(distance.max(axis=1), bound[chunk]).max()))
    return largest


def _grid(k: int, n: int) -> np.ndarray:
    """(S, k) barycentric coordinates of points spread over a segment or triangle, n + 1 along an edge."""
    steps = np.arange(n + 1)
    if k == 2:
        return np.stack([steps, n - steps], axis=1) / n
    i, j = np.meshgrid(steps, steps, indexing="ij")
    inside = i + j <= n
    return np.stack([i[inside], j[inside], n - (i + j)[inside]], axis=1) / n
