"""Averages over cells compiled: the same sums in the same order as ``stretching``; a search of its own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dvr_cli.jit.arrays import empty, full, zeros
from dvr_cli.jit.kernels import compiled, inlined, part
from dvr_cli.jit.kinds import PLANAR, compiled_by_kind
from dvr_cli.quality.stretching import LIKELY, SEED, largest_log_aspect

_LEVEL = np.log(LIKELY)
_ALLOWED = np.log(SEED) * (1.0 - 1e-9)  # a bound, to rounding
_SLIVER = 0.2  # quality below which a cell is bounded by itself: measured, this leaves fewest vertices
_FAR = 127  # rings, or more
_STEPS = 1024  # of quality, for each of which there is the largest ln α that it allows, in 2D and in 3D
_ALLOWED_2D, _ALLOWED_3D = (largest_log_aspect(np.arange(_STEPS + 1) / _STEPS, d) for d in (2, 3))
_FLAT = 1e-14  # least eigenvalue of A Aᵀ, relative to the largest, that is told from zero
_ALIKE = 1e-3  # relative difference of eigenvalues below which their logarithms differ as they do


class _Arrays(NamedTuple):
    """The arguments of ``candidates``."""

    points: np.ndarray
    vertices: np.ndarray
    shapes: np.ndarray
    start: np.ndarray
    root: np.ndarray
    quality: np.ndarray
    positive: np.ndarray


@compiled
def averaged(values: np.ndarray, vertices: np.ndarray, start: np.ndarray, n_points: int) -> np.ndarray:
    """As ``stretching.averaged``."""
    n, width, parts = len(values), vertices.shape[1], values.shape[1]
    count = zeros(n_points, np.float64)
    total = zeros((n_points, parts), np.float64)
    for k in range(width):
        for cell in range(n):
            for c in range(start[cell], start[cell + 1]):
                count[vertices[c, k]] += 1.0
                for i in range(parts):
                    total[vertices[c, k], i] += values[cell, i]
    _divide(total, count)
    result = zeros((n, parts), np.float64)
    for k in range(width):
        for cell in range(n):
            for c in range(start[cell], start[cell + 1]):
                for i in range(parts):
                    result[cell, i] += total[vertices[c, k], i]
    for cell in range(n):
        for i in range(parts):
            result[cell, i] /= (start[cell + 1] - start[cell]) * width
    return result


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
    not above the largest of theirs. Bounds that cost less tell where these are looked at.
    """
    count, by_quality = np.zeros(len(points)), np.zeros(len(points))
    allowed = _allowed_by_quality(points, vertices, start, quality, positive, count, by_quality)
    if not allowed.any():
        return allowed
    mesh = _Arrays(points, vertices, shapes, start, root, quality, positive)
    return _likely(points, mesh, count, by_quality, allowed)


@compiled_by_kind
def stretched_vertices(
    points: np.ndarray,
    vertices: np.ndarray,
    shapes: np.ndarray,
    start: np.ndarray,
    root: np.ndarray,
    quality: np.ndarray,
    positive: np.ndarray,
    asked: np.ndarray,
) -> np.ndarray:
    """As ``stretching.stretched_vertices``, of these only those that averages of L to a few digits leave."""
    n, n_points = len(start) - 1, len(points)
    count, by_quality = zeros(n_points, np.float64), zeros(n_points, np.float64)
    _sum_allowed(vertices, start, quality, positive, count, by_quality)
    rings = full(n_points, _FAR, np.int8)
    for vertex in range(n_points):
        if asked[vertex] and by_quality[vertex] >= _LEVEL * count[vertex] and count[vertex] > 0.0:
            rings[vertex] = 0
    mesh = _Arrays(points, vertices, shapes, start, root, quality, positive)
    _narrow(mesh, np.arange(n), rings, count)
    return rings == 0


@compiled_by_kind
def _likely(
    points: np.ndarray, mesh: _Arrays, count: np.ndarray, by_quality: np.ndarray, result: np.ndarray
) -> np.ndarray:
    """Those of the cells ``result`` (n,) that the averages of L leave; see ``candidates``.

    Few meshes need it, so it is a kernel of its own. count, by_quality: see ``_allowed_by_quality``.
    """
    vertices, start = mesh.vertices, mesh.start
    n, n_points = len(start) - 1, len(points)
    rings = full(n_points, _FAR, np.int8)
    for cell in range(n):
        if result[cell]:
            _put(vertices, start, cell, rings, 0)
    least = full(n, _FAR, np.int8)
    every = np.arange(n)
    for ring in range(3):
        _spread(vertices, start, every, rings, least, ring)
    near = np.flatnonzero(least < _FAR)
    for vertex in range(n_points):  # from now on rings are counted from vertices with such an average
        rings[vertex] = 0 if rings[vertex] <= 2 and by_quality[vertex] >= _LEVEL else _FAR
    found = _narrow(mesh, near, rings, count)
    if found:
        least[:] = _FAR
        for ring in range(3):
            _spread(vertices, start, near, rings, least, ring)
        found = False
        for cell in range(n):
            result[cell] = result[cell] and least[cell] <= 2
            found = found or result[cell]
    if not found:
        return zeros(n, np.bool_)
    for ring in range(3, 6):
        _spread(vertices, start, near, rings, least, ring)
    parts = 3 if PLANAR else 6
    total = zeros((n_points, parts), np.float64)
    _sum_stretching(mesh, near, rings, total)
    _divide(total, count)
    for away in (4, 3):
        total = _averaged_within(total, count, vertices, start, near, least, away)
    here = empty(parts, np.float64)
    for cell in range(n):
        if result[cell]:
            _mean_of_cell(total, vertices, start, cell, here)
            result[cell] = _log_aspect(here) >= _LEVEL
    return result


@compiled_by_kind
def _allowed_by_quality(
    points: np.ndarray,
    vertices: np.ndarray,
    start: np.ndarray,
    quality: np.ndarray,
    positive: np.ndarray,
    count: np.ndarray,
    first: np.ndarray,
) -> np.ndarray:
    """(n,) bool: the cells that the third average of what each corner's quality allows does not exclude.

    The average of aspects, in their logarithms, is not below the aspect of an average of L. Each is at most
    the largest before it, so that most meshes end after the first. ``first`` (N,) is filled with that, and
    ``count`` with the number of corners of each vertex.
    """
    n, n_points = len(start) - 1, len(points)
    width = 3 if PLANAR else 4
    result = zeros(n, np.bool_)
    _sum_allowed(vertices, start, quality, positive, count, first)
    total = first
    for average in range(3):
        largest = 0.0
        for vertex in range(n_points):
            total[vertex] /= max(count[vertex], 1.0)
            largest = max(largest, total[vertex])
        if largest < _ALLOWED:
            return result
        following = zeros(n_points, np.float64)
        for cell in range(n):
            value = 0.0
            for c in range(start[cell], start[cell + 1]):
                for k in range(width):
                    value += total[vertices[c, k]]
            value /= (start[cell + 1] - start[cell]) * width
            if average == 2:
                result[cell] = value >= _ALLOWED
                continue
            for c in range(start[cell], start[cell + 1]):
                for k in range(width):
                    following[vertices[c, k]] += value
        total = following
    return result


@part
def _sum_allowed(
    vertices: np.ndarray,
    start: np.ndarray,
    quality: np.ndarray,
    positive: np.ndarray,
    count: np.ndarray,
    total: np.ndarray,
) -> None:
    """Fill ``total`` (N,) with the sum of ln α that the qualities of a vertex's cells allow.

    count: (N,), filled with the number of corners of each vertex.
    """
    for cell in range(len(start) - 1):
        value = 0.0
        if positive[cell]:
            for c in range(start[cell], start[cell + 1]):
                value += _allowed_log_aspect(quality[c])
            value /= start[cell + 1] - start[cell]
        for c in range(start[cell], start[cell + 1]):
            for k in range(3 if PLANAR else 4):
                total[vertices[c, k]] += value
                count[vertices[c, k]] += 1.0


@part
def _narrow(mesh: _Arrays, cells: np.ndarray, rings: np.ndarray, count: np.ndarray) -> bool:
    """Make ``rings`` (N,) _FAR where it is 0 and the average of L around the vertex, to a few digits, is less
    than _LEVEL; True if it is 0 anywhere still.

    cells: all those of the vertices where it is not _FAR. count: (N,) the number of corners of each.
    """
    n_points = len(rings)
    bounds = zeros((n_points, 4 if PLANAR else 13), np.float64)
    _sum_bounds(mesh, cells, rings, bounds)
    found = False
    for vertex in range(n_points):
        if rings[vertex] == 0 and _bound(bounds[vertex], count[vertex]) < _LEVEL:
            rings[vertex] = _FAR
        found = found or rings[vertex] == 0
    if not found:
        return False
    found = False
    total = zeros((n_points, 3 if PLANAR else 6), np.float64)
    _sum_stretching(mesh, cells, rings, total)
    for vertex in range(n_points):
        if rings[vertex] == 0 and _log_aspect(total[vertex]) < _LEVEL * count[vertex]:
            rings[vertex] = _FAR
        found = found or rings[vertex] == 0
    return found


@inlined
def _allowed_log_aspect(quality: float) -> float:
    """No less than ``largest_log_aspect`` of a corner of positive quality, and little more."""
    step = int(quality * _STEPS)
    if step == 0:
        return _largest_log_aspect(quality)
    return _ALLOWED_2D[step] if PLANAR else _ALLOWED_3D[step]


@inlined
def _largest_log_aspect(quality: float) -> float:
    """As ``largest_log_aspect``, of one corner of positive quality."""
    x = 1.0 / (quality if PLANAR else quality * np.sqrt(quality))  # α + 1/α ≤ 2 x
    return np.log(x + np.sqrt(max(x * x - 1.0, 0.0)))


@part
def _sum_bounds(mesh: _Arrays, cells: np.ndarray, rings: np.ndarray, total: np.ndarray) -> None:
    """Sum over the corners of ``cells`` at each vertex that is not _FAR in ``rings`` what ``_bound`` takes.

    That is S = A Aᵀ of determinant 1, in space S⁻¹, and last ln α of slivers. Their S would outweigh those
    of all others, so that the identity stands for it.
    """
    points, vertices, shapes, start, root, quality, positive = mesh
    width, parts = 3 if PLANAR else 4, 4 if PLANAR else 13
    here = empty(parts, np.float64)
    for cell in cells:
        if not _has(vertices, start, rings, cell, _FAR - 1):
            continue
        here[:] = 0.0
        for c in range(start[cell], start[cell + 1]):
            if positive[cell] and quality[c] >= _SLIVER:
                if PLANAR:
                    _add_square_2d(points, vertices, c, root, shapes[c, 0], quality[c], here)
                else:
                    _add_squares_3d(points, vertices, c, root, shapes[c, 0], quality[c], here)
                continue
            for i in range(width - 1):
                here[i] += 1.0
                if width == 4:
                    here[i + 6] += 1.0
            if positive[cell]:
                here[parts - 1] += _largest_log_aspect(quality[c])
        share = 1.0 / (start[cell + 1] - start[cell])
        for i in range(parts):
            here[i] *= share
        for c in range(start[cell], start[cell + 1]):
            for k in range(width):
                if rings[vertices[c, k]] < _FAR:
                    for i in range(parts):
                        total[vertices[c, k], i] += here[i]


@inlined
def _bound(total: np.ndarray, count: float) -> float:
    """No less than ln α of the average of L around a vertex, from the sums of ``_sum_bounds``.

    The logarithm is concave, so that the average of ln S is at most that of the average of S, and the
    average of L at most the logarithm of that of S⁻¹. In the plane both have the same eigenvalues.
    """
    if len(total) == 4:
        half = (total[0] - total[1]) / 2.0
        high = (total[0] + total[1]) / 2.0 + np.sqrt(half * half + total[2] * total[2])
        return np.log(high / count) + total[3] / count
    norms = _squared_norm(total, 0) * _squared_norm(total, 6)
    rough = np.log(norms / (count * count * count * count)) / 4.0 + total[12] / count
    if rough < _LEVEL:
        return rough
    _, _, high = _eigenvalues(total[0], total[1], total[2], total[3], total[4], total[5])
    _, _, inverse = _eigenvalues(total[6], total[7], total[8], total[9], total[10], total[11])
    return np.log(high * inverse / (count * count)) / 2.0 + total[12] / count


@inlined
def _squared_norm(total: np.ndarray, i: int) -> float:
    """Σ_jk S_jk² of the matrix whose diagonal and upper triangle begin at i."""
    diagonal = total[i] * total[i] + total[i + 1] * total[i + 1] + total[i + 2] * total[i + 2]
    upper = total[i + 3] * total[i + 3] + total[i + 4] * total[i + 4] + total[i + 5] * total[i + 5]
    return diagonal + 2.0 * upper


@part
def _sum_stretching(mesh: _Arrays, cells: np.ndarray, rings: np.ndarray, total: np.ndarray) -> None:
    """Sum L over the corners of ``cells`` at each vertex that is not _FAR in ``rings`` (N,)."""
    points, vertices, shapes, start, root, _, positive = mesh
    width, parts = 3 if PLANAR else 4, 3 if PLANAR else 6
    here = empty(parts, np.float64)
    for cell in cells:
        if not positive[cell] or not _has(vertices, start, rings, cell, _FAR - 1):
            continue
        here[:] = 0.0
        for c in range(start[cell], start[cell + 1]):
            if PLANAR:
                _add_stretching_2d(points, vertices, c, root, shapes[c, 0], here)
            else:
                _add_stretching_3d(points, vertices, c, root, shapes[c, 0], here)
        share = 1.0 / (start[cell + 1] - start[cell])
        for c in range(start[cell], start[cell + 1]):
            for k in range(width):
                if rings[vertices[c, k]] < _FAR:
                    for i in range(parts):
                        total[vertices[c, k], i] += here[i] * share


@part
def _spread(
    vertices: np.ndarray,
    start: np.ndarray,
    cells: np.ndarray,
    rings: np.ndarray,
    least: np.ndarray,
    ring: int,
) -> None:
    """Put ``ring`` into ``least`` (n,) for those of ``cells`` that have a vertex with that in ``rings`` (N,).

    Those that have less than _FAR already keep it. Other vertices of these cells are a ring farther away.
    """
    for cell in cells:
        if least[cell] == _FAR and _has(vertices, start, rings, cell, ring):
            least[cell] = ring
            _put(vertices, start, cell, rings, ring + 1)


@inlined
def _put(vertices: np.ndarray, start: np.ndarray, cell: int, rings: np.ndarray, ring: int) -> None:
    """Lower ``rings`` (N,) of the vertices of a cell to ``ring``."""
    for c in range(start[cell], start[cell + 1]):
        for k in range(3 if PLANAR else 4):
            rings[vertices[c, k]] = min(rings[vertices[c, k]], ring)


@inlined
def _has(vertices: np.ndarray, start: np.ndarray, rings: np.ndarray, cell: int, most: int) -> bool:
    """True if a vertex of a cell has no more than ``most`` in ``rings`` (N,)."""
    for c in range(start[cell], start[cell + 1]):
        for k in range(3 if PLANAR else 4):
            if rings[vertices[c, k]] <= most:
                return True
    return False


@inlined
def _divide(total: np.ndarray, count: np.ndarray) -> None:
    """Divide sums (N, k) by their numbers (N,); of none they stay zero."""
    for vertex in range(len(total)):
        for i in range(total.shape[1]):
            total[vertex, i] /= max(count[vertex], 1.0)


@part
def _averaged_within(
    total: np.ndarray,
    count: np.ndarray,
    vertices: np.ndarray,
    start: np.ndarray,
    cells: np.ndarray,
    least: np.ndarray,
    away: int,
) -> np.ndarray:
    """Values of vertices (N, k) averaged to cells and back, over those of ``cells`` with ``least`` (n,) no
    more than ``away``.
    """
    result = zeros(total.shape, np.float64)
    here = empty(total.shape[1], np.float64)
    for cell in cells:
        if least[cell] <= away:
            _mean_of_cell(total, vertices, start, cell, here)
            for c in range(start[cell], start[cell + 1]):
                for k in range(3 if PLANAR else 4):
                    for i in range(len(here)):
                        result[vertices[c, k], i] += here[i]
    _divide(result, count)
    return result


@inlined
def _mean_of_cell(
    total: np.ndarray, vertices: np.ndarray, start: np.ndarray, cell: int, here: np.ndarray
) -> None:
    """Fill ``here`` (k,) with the mean of vertices' values (N, k) over those of a cell."""
    here[:] = 0.0
    for c in range(start[cell], start[cell + 1]):
        for k in range(3 if PLANAR else 4):
            for i in range(len(here)):
                here[i] += total[vertices[c, k], i]
    for i in range(len(here)):
        here[i] /= (start[cell + 1] - start[cell]) * (3 if PLANAR else 4)


@inlined
def _add_square_2d(
    points: np.ndarray,
    vertices: np.ndarray,
    c: int,
    root: np.ndarray,
    k: int,
    quality: float,
    here: np.ndarray,
) -> None:
    """Add S = A Aᵀ of corner c, of determinant 1; k: the row of its target."""
    xx, yy, xy = _square_2d(points, vertices, c, root, k)
    scale = 2.0 / ((xx + yy) * quality)
    here[0] += xx * scale
    here[1] += yy * scale
    here[2] += xy * scale


@inlined
def _add_squares_3d(
    points: np.ndarray,
    vertices: np.ndarray,
    c: int,
    root: np.ndarray,
    k: int,
    quality: float,
    here: np.ndarray,
) -> None:
    """As ``_add_square_2d``, and S⁻¹, which is the adjugate of S then."""
    xx, yy, zz, xy, xz, yz = _square_3d(points, vertices, c, root, k)
    scale = 3.0 / ((xx + yy + zz) * quality)
    xx, yy, zz, xy, xz, yz = xx * scale, yy * scale, zz * scale, xy * scale, xz * scale, yz * scale
    here[0] += xx
    here[1] += yy
    here[2] += zz
    here[3] += xy
    here[4] += xz
    here[5] += yz
    here[6] += yy * zz - yz * yz
    here[7] += xx * zz - xz * xz
    here[8] += xx * yy - xy * xy
    here[9] += xz * yz - xy * zz
    here[10] += xy * yz - xz * yy
    here[11] += xy * xz - xx * yz


@inlined
def _square_2d(
    points: np.ndarray, vertices: np.ndarray, c: int, root: np.ndarray, k: int
) -> tuple[float, float, float]:
    """The diagonal and the upper triangle of A Aᵀ of corner c; k: the row of its target."""
    o, p, q = vertices[c, 0], vertices[c, 1], vertices[c, 2]
    e0, f0 = points[p, 0] - points[o, 0], points[q, 0] - points[o, 0]
    e1, f1 = points[p, 1] - points[o, 1], points[q, 1] - points[o, 1]
    a0, a1 = e0 * root[k, 0, 0] + f0 * root[k, 1, 0], e0 * root[k, 0, 1] + f0 * root[k, 1, 1]
    b0, b1 = e1 * root[k, 0, 0] + f1 * root[k, 1, 0], e1 * root[k, 0, 1] + f1 * root[k, 1, 1]
    return a0 * a0 + a1 * a1, b0 * b0 + b1 * b1, a0 * b0 + a1 * b1


@inlined
def _square_3d(
    points: np.ndarray, vertices: np.ndarray, c: int, root: np.ndarray, k: int
) -> tuple[float, float, float, float, float, float]:
    """As ``_square_2d``."""
    a0, a1, a2 = _row(points, vertices, c, 0, root, k)
    b0, b1, b2 = _row(points, vertices, c, 1, root, k)
    c0, c1, c2 = _row(points, vertices, c, 2, root, k)
    xx, yy, zz = a0 * a0 + a1 * a1 + a2 * a2, b0 * b0 + b1 * b1 + b2 * b2, c0 * c0 + c1 * c1 + c2 * c2
    xy, xz, yz = a0 * b0 + a1 * b1 + a2 * b2, a0 * c0 + a1 * c1 + a2 * c2, b0 * c0 + b1 * c1 + b2 * c2
    return xx, yy, zz, xy, xz, yz


@inlined
def _add_stretching_2d(
    points: np.ndarray, vertices: np.ndarray, c: int, root: np.ndarray, k: int, here: np.ndarray
) -> None:
    """Add L of corner c, its diagonal and then its upper triangle; k: the row of its target."""
    xx, yy, xy = _square_2d(points, vertices, c, root, k)
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
    xx, yy, zz, xy, xz, yz = _square_3d(points, vertices, c, root, k)
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
    if PLANAR:
        half = (tensor[0] - tensor[1]) / 2.0
        return np.sqrt(half * half + tensor[2] * tensor[2])
    low, _, high = _eigenvalues(tensor[0], tensor[1], tensor[2], tensor[3], tensor[4], tensor[5])
    return (high - low) / 2.0
