"""Directions of steepest ascent of a ring's minimum quality, found as the vertex is about to move.

The worst quality around a vertex is the minimum of several smooth functions. Where some of them are nearly
equal, it grows fastest against the shortest vector in the convex hull of the gradients of their badness: that
vector's product with each of these gradients is at least its squared length, so all of them get better at
once. Where the hull contains zero there is no such direction: but for the width of the band of corners that
count as nearly worst, the vertex is at the optimum over all of its line, plane or space, of which there is
one only, since each 1/Q is jointly convex in the position (paper Remark 4.8).

In a metric vectors are measured through L of the ring's first corner (``measured``), so that a stretched mesh
in its metric moves as one that is neither: with g' = L⁻ᵀ g for the gradients the shortest vector u' of their
hull gives L⁻¹ u'.

Arrays have shape (K, n) as in ``line``; the compiled twin does the same operations vertex by vertex.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dvr_cli.boundary.freedom import project
from dvr_cli.mesh.simplex import (
    Components,
    back_through,
    dot,
    opposite_normal,
    solve_back,
    subtract,
    through,
)
from dvr_cli.quality.badness import badness
from dvr_cli.quality.mean_ratio import weighted_norm
from dvr_cli.relax.measured import Measured

MAX_TRANSFERS = 32  # of weight between two gradients on the way to the shortest vector; about 3 are usual
SHORTEST = 0.7  # of a vector's squared length that its products with all gradients must reach
VANISHING = (
    1e-3  # length, relative to that of the worst corner's gradient, below which a vector counts as zero
)


@dataclass(frozen=True)
class Ascent:
    """The number and kind of moves along directions of steepest ascent in one sweep.

    bands: corners are nearly worst when their 1/Q is at least (1 - band) of the largest.
    searches: line searches with each band at most; a vertex leaves off where the hull contains zero.
    """

    bands: tuple[float, ...]
    searches: int


STEEPEST = Ascent(bands=(0.2,), searches=1)
# Measured on surfaces: as good as OPTIMAL, and two to three times faster.
NARROWING = Ascent(bands=(0.2, 0.005, 0.001), searches=1)
# Where the hull contains zero, no Q is better than the one reached by more than the last band: for weights α
# with Σ α ∇(1/Q) = 0 convexity makes Σ α (1/Q) least there, and it is at least (1 - band) times the largest.
OPTIMAL = Ascent(bands=(0.2, 0.03, 0.005, 0.001), searches=8)


def least_badness(largest: np.ndarray, band: float, dimension: int) -> np.ndarray:
    """The badness from which corners are nearly worst where it is ``largest`` at most."""
    keep = 1.0 - band
    return largest * (keep if dimension == 2 else keep * keep * keep)


def steepest(
    x: Components,
    ends: Sequence[Components],
    norm: Sequence[np.ndarray],
    slope: Sequence[np.ndarray],
    within: tuple[np.ndarray, Components] | None,
    band: float,
    factor: Sequence[np.ndarray] | None = None,
) -> list[np.ndarray]:
    """Unit vectors along which the minimum quality of n rings grows fastest: d components (n,).

    x, ends, norm, slope, factor: as for ``line.coefficients``. within: what the vertices are free to
    follow, see ``freedom.project``. band: see Ascent. Zero where no direction makes all nearly worst corners
    better. Corners that are not positive are the worst; the direction makes their determinants grow.
    """
    d = len(x)
    edges = [subtract(end, x) for end in ends]
    normal = opposite_normal(ends)
    v, s = dot(edges[0], normal), weighted_norm(edges, norm, factor)
    with np.errstate(all="ignore"):  # what is not finite is found at the end
        now = badness(v, s, d)
        largest = now.max(axis=0)
        active = now >= least_badness(largest, band, d)
        vectors = gradient(edges, normal, v, s, slope, factor)
        measured = None if factor is None else Measured.of([entry[0] for entry in factor], within)
        if measured is not None:
            vectors, normal = solve_back(measured.own, vectors), solve_back(measured.own, normal)
            within = measured.seen
        if (tangled := largest == np.inf).any():
            size = np.sqrt(dot(normal, normal))
            vectors = [np.where(tangled, n / size, g) for n, g in zip(normal, vectors, strict=True)]
        vectors = vectors if within is None else project(vectors, *within)
        active &= dot(vectors, vectors) < np.inf
        found = _shortest_in_hull(vectors, active, now.argmax(axis=0))
        return found if measured is None else measured.direction(found)


def gradient(
    edges: Sequence[Components],
    normal: Components,
    v: np.ndarray,
    s: np.ndarray,
    slope: Sequence[np.ndarray],
    factor: Sequence[np.ndarray] | None = None,
) -> list[np.ndarray]:
    """d/2 times the gradient of log 1/Q of each corner in the position of its vertex: d components."""
    d = len(edges)
    pull = []
    for i in range(d):
        total = slope[0] * edges[0][i]
        for j in range(1, d):
            total = total + slope[j] * edges[j][i]
        pull.append(total)
    if factor is not None:
        pull = back_through(factor, through(factor, pull))
    return [normal[i] / v - d * pull[i] / s for i in range(d)]


def _shortest_in_hull(vectors: Components, active: np.ndarray, initial: np.ndarray) -> list[np.ndarray]:
    """Minus the shortest vector in the hull of the active ones of ``vectors``, of unit length; zero if it is.

    vectors: d components (K, n); active: (K, n); initial: (n,) the one to begin with, zero if not active.
    The method of Mitchell, Demyanov and Malozemov: a convex combination of the vectors gets shorter as weight
    goes from the vector furthest along it to the one least along it, until that is far enough along itself.
    """
    n = active.shape[1]
    result = [np.zeros(n) for _ in vectors]
    which = columns = np.arange(n)
    x = [np.where(active[initial, columns], g[initial, columns], 0.0) for g in vectors]
    size = dot(x, x)
    weight = np.zeros(active.shape)
    weight[initial, columns] = 1.0
    for _ in range(MAX_TRANSFERS):
        along = dot(vectors, x)
        least = np.where(active, along, np.inf).argmin(axis=0)
        most = np.where(weight > 0.0, along, -np.inf).argmax(axis=0)
        length = dot(x, x)
        found = along[least, columns] >= SHORTEST * length
        found &= (length > VANISHING * VANISHING * size) & (length < np.inf)
        root = np.sqrt(length)
        for component, xi in zip(result, x, strict=True):
            component[which[found]] = (-xi / root)[found]
        keep = np.flatnonzero(~found & (length > VANISHING * VANISHING * size))
        if not len(keep):
            break
        least, most, x, which, size = least[keep], most[keep], [xi[keep] for xi in x], which[keep], size[keep]
        vectors, active, weight = [g[:, keep] for g in vectors], active[:, keep], weight[:, keep]
        columns = np.arange(len(keep))
        edge = [g[least, columns] - g[most, columns] for g in vectors]
        all_of_it = weight[most, columns]
        part = (along[most, keep] - along[least, keep]) / dot(edge, edge)
        part = np.where(part < all_of_it, part, all_of_it)
        x = [xi + part * e for xi, e in zip(x, edge, strict=True)]
        weight[least, columns] += part
        weight[most, columns] -= part
    return result
