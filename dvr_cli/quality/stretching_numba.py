"""Averages over cells compiled: the same sums in the same order as ``stretching``; a search of its own."""

from __future__ import annotations

import numpy as np

from dvr_cli.jit import compiled, inlined, part
from dvr_cli.quality.stretching import LIKELY, SEED

_LEVEL = np.log(LIKELY)
_ALLOWED = np.log(SEED) * (1.0 - 1e-9)  # a bound, to rounding
_FLAT = 1e-14  # least eigenvalue of A Aᵀ, relative to the largest, that is told from zero
_ALIKE = 1e-3  # relative difference of eigenvalues below which their logarithms differ as they do


@compiled
def averaged(values: np.ndarray, vertices: np.ndarray, start: np.ndarray, n_points: int) -> np.ndarray:
    """As ``stretching.averaged``."""
    n, width, parts = len(values), vertices.shape[1], values.shape[1]
    count = np.zeros(n_points)
    total = np.zeros((n_points, parts))
    for k in range(width):
        for cell in range(n):
            for c in range(start[cell], start[cell + 1]):
                count[vertices[c, k]] += 1.0
                for i in range(parts):
                    total[vertices[c, k], i] += values[cell, i]
    for vertex in range(n_points):
        for i in range(parts):
            total[vertex, i] /= max(count[vertex], 1.0)
    result = np.zeros((n, parts))
    for k in range(width):
        for cell in range(n):
            for c in range(start[cell], start[cell + 1]):
                for i in range(parts):
                    result[cell, i] += total[vertices[c, k], i]
    for cell in range(n):
        for i in range(parts):
            result[cell, i] /= (start[cell + 1] - start[cell]) * width
    return result


@compiled
def candidates(
    points: np.ndarray,
    vertices: np.ndarray,
    shapes: np.ndarray,
    start: np.ndarray,
    root: np.ndarray,
    quality: np.ndarray,
    positive: np.ndarray,
) -> np.ndarray:
    """As ``stretching.candidates``, of these only what averages of L to a few digits leave.

    The third average in a cell is one of those at vertices (T) within two rings of it, so that its aspect is
    not above the largest of theirs.
    """
    n, n_points, width = len(start) - 1, len(points), vertices.shape[1]
    result = _allowed_by_quality(vertices, start, quality, positive, n_points)
    if not result.any():
        return result
    wanted = np.zeros(n_points, dtype=np.bool_)
    _mark(vertices, start, result, wanted)
    for _ in range(2):
        _mark(vertices, start, _with_marked(vertices, start, wanted), wanted)
    parts = width * (width - 1) // 2
    here = np.empty(parts)
    count, total = np.zeros(n_points), np.zeros((n_points, parts))
    touching = _with_marked(vertices, start, wanted)
    for cell in range(n):
        if not touching[cell]:
            continue
        here[:] = 0.0
        if positive[cell]:
            for c in range(start[cell], start[cell + 1]):
                if width == 3:
                    _add_stretching_2d(points, vertices, c, root, shapes[c, 0], here)
                else:
                    _add_stretching_3d(points, vertices, c, root, shapes[c, 0], here)
        for i in range(parts):
            here[i] /= start[cell + 1] - start[cell]
        for c in range(start[cell], start[cell + 1]):
            for k in range(width):
                count[vertices[c, k]] += 1.0
                for i in range(parts):
                    total[vertices[c, k], i] += here[i]
    rings = np.full(n_points, 9, dtype=np.int8)  # from a vertex whose average has such an aspect
    found = False
    for vertex in range(n_points):
        for i in range(parts):
            total[vertex, i] /= max(count[vertex], 1.0)
        if wanted[vertex] and _log_aspect(total[vertex]) >= _LEVEL:
            rings[vertex] = 0
            found = True
    if not found:
        return np.zeros(n, dtype=np.bool_)
    least = np.empty(n, dtype=np.int8)
    for ring in range(4):
        _least_of_cells(rings, vertices, start, least)
        for cell in range(n):
            if least[cell] == ring:
                for c in range(start[cell], start[cell + 1]):
                    for k in range(width):
                        rings[vertices[c, k]] = min(rings[vertices[c, k]], ring + 1)
    _least_of_cells(rings, vertices, start, least)
    for away in (4, 3):
        total = _averaged_within(total, count, vertices, start, least, away)
    for cell in range(n):
        if result[cell] and least[cell] <= 2:
            _mean_of_cell(total, vertices, start, cell, here)
            result[cell] = _log_aspect(here) >= _LEVEL
        else:
            result[cell] = False
    return result


@compiled
def _allowed_by_quality(
    vertices: np.ndarray, start: np.ndarray, quality: np.ndarray, positive: np.ndarray, n_points: int
) -> np.ndarray:
    """(n,) bool: the cells that the third average of what each corner's quality allows does not exclude.

    The average of aspects, in their logarithms, is not below the aspect of an average of L. Each is at most
    the largest before it, so that most meshes end after the first.
    """
    n, width = len(start) - 1, vertices.shape[1]
    value, total, count = np.zeros(n), np.zeros(n_points), np.zeros(n_points)
    largest = 0.0
    for cell in range(n):
        if positive[cell]:
            for c in range(start[cell], start[cell + 1]):
                q = quality[c]
                x = 1.0 / (q if width == 3 else q * np.sqrt(q))  # α + 1/α ≤ 2 x
                value[cell] += np.log(x + np.sqrt(max(x * x - 1.0, 0.0)))
            value[cell] /= start[cell + 1] - start[cell]
            largest = max(largest, value[cell])
    for average in range(3):
        if largest < _ALLOWED:
            return np.zeros(n, dtype=np.bool_)
        total[:] = 0.0
        for cell in range(n):
            for c in range(start[cell], start[cell + 1]):
                for k in range(width):
                    total[vertices[c, k]] += value[cell]
                    if average == 0:
                        count[vertices[c, k]] += 1.0
        largest = 0.0
        for vertex in range(n_points):
            total[vertex] /= max(count[vertex], 1.0)
            largest = max(largest, total[vertex])
        for cell in range(n):
            value[cell] = 0.0
            for c in range(start[cell], start[cell + 1]):
                for k in range(width):
                    value[cell] += total[vertices[c, k]]
            value[cell] /= (start[cell + 1] - start[cell]) * width
    return value >= _ALLOWED


@compiled
def _mark(vertices: np.ndarray, start: np.ndarray, cells: np.ndarray, marked: np.ndarray) -> None:
    """Mark the vertices of ``cells`` ((n,) bool) in ``marked`` (N,)."""
    for cell in range(len(cells)):
        if cells[cell]:
            for c in range(start[cell], start[cell + 1]):
                for k in range(vertices.shape[1]):
                    marked[vertices[c, k]] = True


@compiled
def _with_marked(vertices: np.ndarray, start: np.ndarray, marked: np.ndarray) -> np.ndarray:
    """(n,) bool: the cells with a vertex that is marked."""
    result = np.zeros(len(start) - 1, dtype=np.bool_)
    for cell in range(len(result)):
        for c in range(start[cell], start[cell + 1]):
            for k in range(vertices.shape[1]):
                result[cell] |= marked[vertices[c, k]]
    return result


@part
def _least_of_cells(rings: np.ndarray, vertices: np.ndarray, start: np.ndarray, least: np.ndarray) -> None:
    """Fill ``least`` (n,) with the smallest of ``rings`` (N,) among the vertices of each cell."""
    for cell in range(len(least)):
        least[cell] = 9
        for c in range(start[cell], start[cell + 1]):
            for k in range(vertices.shape[1]):
                least[cell] = min(least[cell], rings[vertices[c, k]])


@part
def _averaged_within(
    total: np.ndarray,
    count: np.ndarray,
    vertices: np.ndarray,
    start: np.ndarray,
    least: np.ndarray,
    away: int,
) -> np.ndarray:
    """Values of vertices (N, k) averaged to cells and back, over cells no more than ``away`` rings away."""
    result = np.zeros_like(total)
    here = np.empty(total.shape[1])
    for cell in range(len(least)):
        if least[cell] <= away:
            _mean_of_cell(total, vertices, start, cell, here)
            for c in range(start[cell], start[cell + 1]):
                for k in range(vertices.shape[1]):
                    for i in range(len(here)):
                        result[vertices[c, k], i] += here[i]
    for vertex in range(len(result)):
        for i in range(len(here)):
            result[vertex, i] /= max(count[vertex], 1.0)
    return result


@inlined
def _mean_of_cell(
    total: np.ndarray, vertices: np.ndarray, start: np.ndarray, cell: int, here: np.ndarray
) -> None:
    """Fill ``here`` (k,) with the mean of vertices' values (N, k) over those of a cell."""
    here[:] = 0.0
    for c in range(start[cell], start[cell + 1]):
        for k in range(vertices.shape[1]):
            for i in range(len(here)):
                here[i] += total[vertices[c, k], i]
    for i in range(len(here)):
        here[i] /= (start[cell + 1] - start[cell]) * vertices.shape[1]


@inlined
def _add_stretching_2d(
    points: np.ndarray, vertices: np.ndarray, c: int, root: np.ndarray, k: int, here: np.ndarray
) -> None:
    """Add L of corner c, its diagonal and then its upper triangle; k: the row of its target."""
    o, p, q = vertices[c, 0], vertices[c, 1], vertices[c, 2]
    e0, f0 = points[p, 0] - points[o, 0], points[q, 0] - points[o, 0]
    e1, f1 = points[p, 1] - points[o, 1], points[q, 1] - points[o, 1]
    a0, a1 = e0 * root[k, 0, 0] + f0 * root[k, 1, 0], e0 * root[k, 0, 1] + f0 * root[k, 1, 1]
    b0, b1 = e1 * root[k, 0, 0] + f1 * root[k, 1, 0], e1 * root[k, 0, 1] + f1 * root[k, 1, 1]
    xx, yy, xy = a0 * a0 + a1 * a1, b0 * b0 + b1 * b1, a0 * b0 + a1 * b1
    mean, half = (xx + yy) / 2.0, (xx - yy) / 2.0
    radius = np.sqrt(half * half + xy * xy)
    if radius > 0.0:
        grows = np.log((mean + radius) / max(mean - radius, _FLAT * mean)) / (2.0 * radius)
        here[0] -= grows * half
        here[1] += grows * half
        here[2] -= grows * xy


@inlined
def _add_stretching_3d(
    points: np.ndarray, vertices: np.ndarray, c: int, root: np.ndarray, k: int, here: np.ndarray
) -> None:
    """As ``_add_stretching_2d``."""
    a0, a1, a2 = _row(points, vertices, c, 0, root, k)
    b0, b1, b2 = _row(points, vertices, c, 1, root, k)
    c0, c1, c2 = _row(points, vertices, c, 2, root, k)
    xx, yy, zz = a0 * a0 + a1 * a1 + a2 * a2, b0 * b0 + b1 * b1 + b2 * b2, c0 * c0 + c1 * c1 + c2 * c2
    xy, xz, yz = a0 * b0 + a1 * b1 + a2 * b2, a0 * c0 + a1 * c1 + a2 * c2, b0 * c0 + b1 * c1 + b2 * c2
    low, middle, high = _eigenvalues(xx, yy, zz, xy, xz, yz)
    if not high > 0.0:
        return
    low, middle = max(low, _FLAT * high), max(middle, _FLAT * high)
    # ln(A Aᵀ) by Newton's interpolation in the eigenvalues, less a multiple of the identity
    first, second = _log_slope(low, middle), _log_slope(middle, high)
    third = (second - first) / (high - low) if high - low > _ALIKE * high else -0.5 / (high * high)
    xx1, yy1, zz1 = xx - low, yy - low, zz - low
    xx2, yy2, zz2 = xx - middle, yy - middle, zz - middle
    t0 = first * xx1 + third * (xx1 * xx2 + xy * xy + xz * xz)
    t1 = first * yy1 + third * (xy * xy + yy1 * yy2 + yz * yz)
    t2 = first * zz1 + third * (xz * xz + yz * yz + zz1 * zz2)
    trace = (t0 + t1 + t2) / 3.0
    here[0] -= t0 - trace
    here[1] -= t1 - trace
    here[2] -= t2 - trace
    here[3] -= first * xy + third * (xx1 * xy + xy * yy2 + xz * yz)
    here[4] -= first * xz + third * (xx1 * xz + xy * yz + xz * zz2)
    here[5] -= first * yz + third * (xy * xz + yy1 * yz + yz * zz2)


@inlined
def _row(
    points: np.ndarray, vertices: np.ndarray, c: int, i: int, root: np.ndarray, k: int
) -> tuple[float, float, float]:
    """Row i of A = E W⁻¹ of corner c."""
    x = points[vertices[c, 0], i]
    e, f, g = points[vertices[c, 1], i] - x, points[vertices[c, 2], i] - x, points[vertices[c, 3], i] - x
    return (
        e * root[k, 0, 0] + f * root[k, 1, 0] + g * root[k, 2, 0],
        e * root[k, 0, 1] + f * root[k, 1, 1] + g * root[k, 2, 1],
        e * root[k, 0, 2] + f * root[k, 1, 2] + g * root[k, 2, 2],
    )


@inlined
def _log_slope(x: float, y: float) -> float:
    """(ln y - ln x) / (y - x) for 0 < x <= y."""
    if y - x > _ALIKE * y:
        return np.log(y / x) / (y - x)
    return 2.0 / (x + y)


@inlined
def _eigenvalues(
    xx: float, yy: float, zz: float, xy: float, xz: float, yz: float
) -> tuple[float, float, float]:
    """Those of a symmetric matrix, ascending, by the angles of the characteristic cubic."""
    mean = (xx + yy + zz) / 3.0
    p, q, r = xx - mean, yy - mean, zz - mean
    size = np.sqrt((p * p + q * q + r * r + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if size == 0.0:
        return mean, mean, mean
    det = p * (q * r - yz * yz) - xy * (xy * r - yz * xz) + xz * (xy * yz - q * xz)
    angle = np.arccos(min(max(det / (2.0 * size * size * size), -1.0), 1.0)) / 3.0
    high = mean + 2.0 * size * np.cos(angle)
    low = mean + 2.0 * size * np.cos(angle + 2.0 * np.pi / 3.0)
    return low, 3.0 * mean - high - low, high


@inlined
def _log_aspect(tensor: np.ndarray) -> float:
    """ln α of a tensor given as its diagonal and upper triangle."""
    if len(tensor) == 3:
        half = (tensor[0] - tensor[1]) / 2.0
        return np.sqrt(half * half + tensor[2] * tensor[2])
    low, _, high = _eigenvalues(tensor[0], tensor[1], tensor[2], tensor[3], tensor[4], tensor[5])
    return (high - low) / 2.0
