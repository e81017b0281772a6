"""Newton's step: the way to the lowest price of a ring as its second derivatives see it.

With g the gradient of the price in the position of the ring's vertex, and H its second derivatives, that is
-H⁻¹ g, within the vertex's line or plane. Be x = 1/Q = s u of a corner, u = v^(-2/d) and q = 2/d (as in
``polish``), the gradient of s -2 p, that of log v -a, and the second derivatives of s 2 m G. Then

    ∇x = u (q s a - 2 p),    ∇²x = u (2 m G - 2 q (p aᵀ + a pᵀ) + q (q + 1) s a aᵀ),

and the derivatives of its price are (w + r) ∇x and (w + r) ∇²x + 16 r / x ∇x ∇xᵀ, with r = (L x)^16. G is the
unit matrix, or LᵀL of a metric. The price is convex, so H has no negative eigenvalues. To the lowest price of
the ring it is nearly straight along this direction, where steepest descent would go to and fro.

The whole step is taken where the price falls by half of what the derivatives promise, or more, and the floor
is kept. Else the vertex goes to the lowest price on that line (``polish.lowest_price``).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dvr_cli.mesh.simplex import Components, back_through, dot, opposite_normal, subtract, through
from dvr_cli.quality.mean_ratio import weighted_norm
from dvr_cli.relax.polish import SQUARINGS, Aim, inverse_power, rise, sum_of_columns

# the entries of H that are computed
_PAIRS = {2: ((0, 0), (0, 1), (1, 1)), 3: ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))}
FALL = 0.25  # times the slope along the step: the least by which the price falls with the whole of it


class RingCorners(NamedTuple):
    """The corners of n rings, (K, n) each: their edges and facets' normals by component, v and s."""

    edges: list[list[np.ndarray]]
    normal: list[np.ndarray]
    v: np.ndarray
    s: np.ndarray


def corners_at(x: Components, ends: Sequence[Components], shapes: Shapes) -> RingCorners:
    """The corners of rings with their vertices at x; the arguments are as for ``line.coefficients``."""
    edges, normal = [subtract(end, x) for end in ends], opposite_normal(ends)
    return RingCorners(edges, normal, dot(edges[0], normal), weighted_norm(edges, shapes.norm, shapes.factor))


class Shapes(NamedTuple):
    """The rows of the shape table that belong to the corners, each as ``line.coefficients`` takes it."""

    norm: Sequence[np.ndarray]
    slope: Sequence[np.ndarray]
    curvature: np.ndarray
    factor: Sequence[np.ndarray] | None


def newton(
    corners: RingCorners,
    shapes: Shapes,
    within: tuple[np.ndarray, Components] | None,
    real: np.ndarray,
    weights: np.ndarray,
    aim: Aim,
) -> tuple[list[np.ndarray], np.ndarray]:
    """Newton's steps of n rings, d components (n,), and the slopes of their prices along them, (n,).

    within: lines and planes, see ``steepest``. real, aim: see ``polish``; weights: (K, n), of the corners.
    Without meaning where a corner is not positive.
    """
    d = len(corners.normal)
    with np.errstate(all="ignore"):  # what is not finite the slope shows
        terms = _terms(corners, shapes, weights, aim)
        sums = [0.0 + sum_of_columns(term, real) for term in terms]  # no negative zeros
        way = _solved(sums[:d], sums[d:], within)
        return way, dot(way, sums[:d])


def _terms(corners: RingCorners, shapes: Shapes, weights: np.ndarray, aim: Aim) -> list[np.ndarray]:
    """The parts of the corners in g and H, (K, n) each: d components and the d (d + 1) / 2 of ``_PAIRS``."""
    edges, normal, v, s = corners
    d, factor = len(edges), shapes.factor
    q = 2.0 / d
    pull = [_along(shapes.slope, [edge[i] for edge in edges]) for i in range(d)]
    if factor is not None:
        pull = back_through(factor, through(factor, pull))
    u = 1.0 / v if d == 2 else inverse_power(v)
    inverse = s * u
    steep = rise(inverse, aim)
    part = (weights + steep) * u
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
    """-H⁻¹ g within lines and planes: d components (n,)."""
    trace = h[0] + h[2] if len(g) == 2 else h[0] + h[3] + h[5]
    h = [entry / trace for entry in h]
    adjugate = _adjugate(h)
    if len(g) == 2:
        whole = (h[0] * h[2] - h[1] * h[1]) * trace
    else:
        whole = (h[0] * adjugate[0] + h[1] * adjugate[1] + h[2] * adjugate[2]) * trace
    way = [-w / whole for w in _times(adjugate, g)]
    if within is None:
        return way
    on_line, axis = within
    along = -dot(g, axis) / (dot(_times(h, axis), axis) * trace)
    across = _times(adjugate, axis)
    share = dot(way, axis) / dot(across, axis)
    inside = [w - share * z for w, z in zip(way, across, strict=True)]
    for _ in range(2):  # what is left across a plane is rounding
        left = dot(inside, axis)
        inside = [w - left * t for w, t in zip(inside, axis, strict=True)]
    in_plane = dot(axis, axis) > 0.0
    return [
        np.where(on_line, along * t, np.where(in_plane, i, w))
        for t, i, w in zip(axis, inside, way, strict=True)
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
