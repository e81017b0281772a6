"""Newton's direction: the way to the lowest price of a ring as its second derivatives see it.

With g the gradient of the price in the position of the ring's vertex, and H its second derivatives, that is
-H⁻¹ g, within the vertex's line or plane. Be x = 1/Q = s u of a corner, u = v^(-2/d) and q = 2/d (as in
``polish``), the gradient of s -2 p, that of log v -a, and the second derivatives of s 2 m G. Then

    ∇x = u (q s a - 2 p),    ∇²x = u (2 m G - 2 q (p aᵀ + a pᵀ) + q (q + 1) s a aᵀ),

and the derivatives of its price are (w + r) ∇x and (w + r) ∇²x + 16 r / x ∇x ∇xᵀ, with r = (L x)^16. G is the
unit matrix, or LᵀL of a metric. The price is convex, so H has no negative eigenvalues. To the lowest price of
the ring it is nearly straight along this direction, where steepest descent would go to and fro.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dvr_cli.mesh.simplex import Components, back_through, dot, opposite_normal, subtract, through
from dvr_cli.quality.badness import badness
from dvr_cli.quality.mean_ratio import weighted_norm
from dvr_cli.relax.polish import SQUARINGS, Aim, inverse_power, rise, sum_of_columns, weight

# the entries of H that are computed
_PAIRS = {2: ((0, 0), (0, 1), (1, 1)), 3: ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))}


class Shapes(NamedTuple):
    """The rows of the shape table that belong to the corners, each as ``line.coefficients`` takes it."""

    norm: Sequence[np.ndarray]
    slope: Sequence[np.ndarray]
    curvature: np.ndarray
    factor: Sequence[np.ndarray] | None


def newton(
    x: Components,
    ends: Sequence[Components],
    shapes: Shapes,
    within: tuple[np.ndarray, Components] | None,
    real: np.ndarray,
    aim: Aim,
) -> list[np.ndarray]:
    """Newton's directions of n rings, as unit vectors.

    The arguments are as for ``line.coefficients`` and ``steepest``; real, aim: see ``polish``. Zero where
    the price does not fall along them, and where a corner is not positive.
    """
    d = len(x)
    edges = [subtract(end, x) for end in ends]
    normal = opposite_normal(ends)
    v, s = dot(edges[0], normal), weighted_norm(edges, shapes.norm, shapes.factor)
    with np.errstate(all="ignore"):  # what is not finite is found at the end
        positive = badness(v, s, d).max(axis=0) < np.inf
        terms = _terms(edges, normal, v, s, shapes, aim)
        sums = [0.0 + sum_of_columns(term, real) for term in terms]  # no negative zeros
        way = _solved(sums[:d], sums[d:], within)
        length, falls = dot(way, way), dot(way, sums[:d]) < 0.0
        root = np.sqrt(length)
        usable = positive & falls & (length > 0.0) & (length < np.inf)
        return [np.where(usable, w / root, 0.0) for w in way]


def _terms(
    edges: Sequence[Components],
    normal: Components,
    v: np.ndarray,
    s: np.ndarray,
    shapes: Shapes,
    aim: Aim,
) -> list[np.ndarray]:
    """The parts of the corners in g and H, (K, n) each: d components and the d (d + 1) / 2 of ``_PAIRS``."""
    d, factor = len(edges), shapes.factor
    q = 2.0 / d
    pull = [_along(shapes.slope, [edge[i] for edge in edges]) for i in range(d)]
    if factor is not None:
        pull = back_through(factor, through(factor, pull))
    u = 1.0 / v if d == 2 else inverse_power(v)
    inverse = s * u
    steep = rise(inverse, aim)
    part = (weight(inverse, aim) + steep) * u
    more = 2.0**SQUARINGS * steep / inverse * u * u
    over = 1.0 / v
    away = [n * over for n in normal]
    fall = [q * s * a - 2.0 * p for a, p in zip(away, pull, strict=True)]
    bend = q * (q + 1.0) * s
    terms = [part * f for f in fall]
    for (i, j), square in zip(_PAIRS[d], _squares(d, factor), strict=True):
        second = 2.0 * shapes.curvature * square - 2.0 * q * (pull[i] * away[j] + away[i] * pull[j])
        second = second + bend * (away[i] * away[j])
        terms.append(part * second + more * (fall[i] * fall[j]))
    return terms


def _along(slope: Sequence[np.ndarray], components: Sequence[np.ndarray]) -> np.ndarray:
    total = slope[0] * components[0]
    for j in range(1, len(components)):
        total = total + slope[j] * components[j]
    return total


def _squares(d: int, factor: Sequence[np.ndarray] | None) -> list[np.ndarray]:
    """The entries of G."""
    if factor is None:
        return [np.array(float(i == j)) for i, j in _PAIRS[d]]
    if d == 2:
        a, b, c = factor
        return [a * a, a * b, b * b + c * c]
    a, b, c, e, f, g = factor
    return [a * a, a * b, a * c, b * b + e * e, b * c + e * f, c * c + f * f + g * g]


def _solved(
    g: Components, h: Sequence[np.ndarray], within: tuple[np.ndarray, Components] | None
) -> list[np.ndarray]:
    """-H⁻¹ g times a positive number, within lines and planes: d components (n,)."""
    trace = h[0] + h[2] if len(g) == 2 else h[0] + h[3] + h[5]
    h = [entry / trace for entry in h]
    adjugate = _adjugate(h)
    way = [-w for w in _times(adjugate, g)]
    if within is None:
        return way
    on_line, axis = within
    across = _times(adjugate, axis)
    share = dot(way, axis) / dot(across, axis)
    along = -dot(g, axis)
    return [
        np.where(on_line, along * t, np.where(dot(axis, axis) > 0.0, w - share * z, w))
        for t, w, z in zip(axis, way, across, strict=True)
    ]


def _adjugate(h: Sequence[np.ndarray]) -> list[np.ndarray]:
    """det(H) H⁻¹."""
    if len(h) == 3:
        return [h[2], -h[1], h[0]]
    a, b, c, e, f, i = h
    return [e * i - f * f, c * f - b * i, b * f - c * e, a * i - c * c, b * c - a * f, a * e - b * b]


def _times(h: Sequence[np.ndarray], vector: Components) -> list[np.ndarray]:
    """The product of a symmetric matrix, by ``_PAIRS``, and a vector."""
    if len(h) == 3:
        return [h[0] * vector[0] + h[1] * vector[1], h[1] * vector[0] + h[2] * vector[1]]
    return [
        h[0] * vector[0] + h[1] * vector[1] + h[2] * vector[2],
        h[1] * vector[0] + h[3] * vector[1] + h[4] * vector[2],
        h[2] * vector[0] + h[4] * vector[1] + h[5] * vector[2],
    ]
