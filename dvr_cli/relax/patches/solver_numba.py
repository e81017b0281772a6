"""Patches compiled: the same operations in the same order as ``solver``, corner by corner.

Each function here is the scalar twin of one there, where the mathematics is explained. Patches of one batch
share no corner, so they are solved in place, in any order and on any number of threads.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.jit.arrays import empty
from dvr_cli.jit.kernels import inlined, part
from dvr_cli.jit.kinds import MEASURED, ON_SURFACE, PLANAR, compiled_by_kind
from dvr_cli.mesh.simplex_numba import determinant_2d, determinant_3d
from dvr_cli.quality.altitudes_numba import extremes
from dvr_cli.quality.badness_numba import badness
from dvr_cli.quality.mean_ratio_numba import metric_norm, through_2d, through_3d
from dvr_cli.relax.lbfgs_numba import descent, dot
from dvr_cli.relax.line_numba import improves
from dvr_cli.relax.patches.solver import (
    DECREASE,
    FIRST_STEP,
    FLAT,
    HALVINGS,
    ITERATIONS,
    MEMORY,
    NEGLIGIBLE,
    SHORTER,
    SQUARINGS,
    Patch,
)

_REAL = np.float64


@compiled_by_kind
def solve_patch(points: np.ndarray, patch: Patch) -> tuple[float, float]:
    """As ``solver.solve_patch``."""
    d = points.shape[1]
    moving = patch.moving
    bad, n = empty(len(patch.vertices), _REAL), len(moving) * d
    start, moved = empty(n, _REAL), empty(n, _REAL)
    _take(points, moving, start)
    before = _find(points, patch, start, bad, moved)
    if before == np.inf:
        return before, before
    reached, up = empty(len(start), _REAL), empty((0, d), _REAL)
    for _ in range(SHORTER):
        for i in range(len(start)):
            reached[i] = start[i] + moved[i]
        _put(points, moving, reached)
        after = _badnesses(points, patch, up, bad)
        if not improves(before, after, d):
            break
        if patch.altitude <= 0.0 or extremes(points, patch.vertices)[0] >= patch.altitude:
            return before, after
        for i in range(len(moved)):
            moved[i] *= 0.5
    _put(points, moving, start)
    return before, before


@compiled_by_kind
def find_moves(points: np.ndarray, patch: Patch) -> np.ndarray:
    """As ``solver.find_moves``."""
    d, moving = points.shape[1], patch.moving
    bad, n = empty(len(patch.vertices), _REAL), len(moving) * d
    start, moved = empty(n, _REAL), empty(n, _REAL)
    _take(points, moving, start)
    _find(points, patch, start, bad, moved)
    _put(points, moving, start)
    return moved.reshape((len(moving), d))


@part
def _find(points: np.ndarray, patch: Patch, start: np.ndarray, bad: np.ndarray, moved: np.ndarray) -> float:
    """As ``solver._found``, the moves being put into ``moved``; start: where the vertices are."""
    d, up = points.shape[1], empty((0, points.shape[1]), _REAL)
    if ON_SURFACE:
        up = empty((len(bad), 3), _REAL)
        _look_up(points, patch, up)
    before = _badnesses(points, patch, up, bad)
    for i in range(len(moved)):
        moved[i] = 0.0
    if before == np.inf:
        return before
    size, own, seen = _size(points, patch), empty(0, np.int64), empty((0, d), _REAL)
    if MEASURED:
        own = _own_measure(patch)
        seen = _seen_axes(patch, own)
    for squarings in SQUARINGS[0 if PLANAR or ON_SURFACE else 1]:
        if _minimise(points, patch, own, seen, squarings, size, up, bad):
            break
    if _badnesses(points, patch, up, bad) > patch.bearable:
        return before
    _take(points, patch.moving, moved)
    for i in range(len(moved)):
        moved[i] -= start[i]
    _project(moved, patch)
    _project(moved, patch)
    return before


@part
def _look_up(points: np.ndarray, patch: Patch, up: np.ndarray) -> None:
    """See ``PatchEnergy.look_up``; fills ``up`` with the normals."""
    for c in range(len(patch.vertices)):
        o, p, q = patch.vertices[c, 0], patch.vertices[c, 1], patch.vertices[c, 2]
        e0, e1, e2 = points[p, 0] - points[o, 0], points[p, 1] - points[o, 1], points[p, 2] - points[o, 2]
        f0, f1, f2 = points[q, 0] - points[o, 0], points[q, 1] - points[o, 1], points[q, 2] - points[o, 2]
        a0, a1, a2 = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
        size = np.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        if size > 0.0:
            up[c, 0], up[c, 1], up[c, 2] = a0 / size, a1 / size, a2 / size
        else:
            up[c, 0], up[c, 1], up[c, 2] = 0.0, 0.0, 0.0


@part
def _minimise(
    points: np.ndarray,
    patch: Patch,
    own: np.ndarray,
    seen: np.ndarray,
    squarings: int,
    size: float,
    up: np.ndarray,
    bad: np.ndarray,
) -> bool:
    """See ``solver._minimise``; vectors (n, d) are flat, pairs stand in the rows of two arrays.

    own: (n,) the row of the shape table whose L each vertex is measured through; seen: (n, d) the axes of
    their lines and planes through that. Both are empty without a metric. up: the normals of a surface's
    triangles.
    """
    d = points.shape[1]
    moving = patch.moving
    n = len(moving) * d
    rows = MEMORY + 1  # one more for a pair that is not kept
    steps, changes = empty((rows, n), _REAL), empty((rows, n), _REAL)
    curvature, factor, power = empty(rows, _REAL), empty(rows, _REAL), empty(len(bad), _REAL)
    x, reached, direction = empty(n, _REAL), empty(n, _REAL), empty(n, _REAL)
    g, new = empty(n, _REAL), empty(n, _REAL)
    kept = 0
    _take(points, moving, x)
    if ON_SURFACE:
        _look_up(points, patch, up)
    reference = _badnesses(points, patch, up, bad)
    f, total = _norm(bad, reference, squarings, power)
    _gradient(points, patch, up, power, f, total, g)
    if MEASURED:
        _measure(g, patch, own, seen)
    way = empty(n, _REAL) if MEASURED else direction
    for _ in range(ITERATIONS):
        descent(g, steps, changes, curvature, factor, kept, d, direction)
        slope = dot(g, direction, d)
        if not slope < 0.0:
            return False
        step = 1.0
        if kept == 0:
            largest = 0.0
            for i in range(n):
                largest = max(largest, abs(direction[i]))
            step = FIRST_STEP * size / largest
        if MEASURED:
            for i in range(n):
                way[i] = direction[i]
            _unmeasure(way, patch, own)
        falls, trial, worst = False, f, np.inf
        for _ in range(HALVINGS):
            for i in range(n):
                reached[i] = x[i] + step * way[i]
            _put(points, moving, reached)
            worst = _badnesses(points, patch, up, bad)
            trial, total = _norm(bad, reference, squarings, power)
            falls = trial <= f + DECREASE * step * slope
            if falls:
                break
            step *= 0.5
        if not falls:
            _put(points, moving, x)
            return False
        if worst <= patch.enough:
            return True
        _gradient(points, patch, up, power, trial, total, new)
        if MEASURED:
            _measure(new, patch, own, seen)
        row = kept % rows
        for i in range(n):
            steps[row, i] = reached[i] - x[i]
            changes[row, i] = new[i] - g[i]
            x[i], g[i] = reached[i], new[i]
        if MEASURED:
            for i in range(len(own)):
                _see_through(patch.factor, own[i], steps[row, i * d : (i + 1) * d])
        curvature[row] = dot(steps[row], changes[row], d)
        if curvature[row] > 0.0:
            kept += 1
        gain, f = f - trial, trial
        if gain < FLAT * f:
            return False
    return False


@inlined
def _see_through(factor: np.ndarray, k: int, u: np.ndarray) -> None:
    """Put L u in the place of u, with row k of the shape table; see ``simplex.through``."""
    if PLANAR:
        u[0], u[1] = through_2d(factor, k, u[0], u[1])
    else:
        u[0], u[1], u[2] = through_3d(factor, k, u[0], u[1], u[2])


@inlined
def _see_back(factor: np.ndarray, k: int, u: np.ndarray) -> None:
    """Put Lᵀ u in the place of u; see ``simplex.back_through``."""
    if PLANAR:
        u[0], u[1] = factor[k, 0] * u[0], factor[k, 1] * u[0] + factor[k, 2] * u[1]
        return
    a, b, c = u[0], u[1], u[2]
    u[0] = factor[k, 0] * a
    u[1] = factor[k, 1] * a + factor[k, 3] * b
    u[2] = factor[k, 2] * a + factor[k, 4] * b + factor[k, 5] * c


@inlined
def _take(points: np.ndarray, moving: np.ndarray, values: np.ndarray) -> None:
    """Fill ``values`` with the coordinates of some vertices, end to end."""
    d = points.shape[1]
    for i in range(len(moving)):
        for j in range(d):
            values[i * d + j] = points[moving[i], j]


@inlined
def _put(points: np.ndarray, moving: np.ndarray, values: np.ndarray) -> None:
    """Set the coordinates of some vertices."""
    d = points.shape[1]
    for i in range(len(moving)):
        for j in range(d):
            points[moving[i], j] = values[i * d + j]


@inlined
def _project(g: np.ndarray, patch: Patch) -> None:
    """See ``PatchEnergy.inside``."""
    d = patch.axis.shape[1]
    for i in range(len(patch.moving)):
        vertex = patch.moving[i]
        if patch.dimension[vertex] < d:
            _keep_within(g[i * d : (i + 1) * d], patch.dimension[vertex] == 1, patch.axis[vertex])


@inlined
def _keep_within(u: np.ndarray, on_line: bool, axis: np.ndarray) -> None:
    """Leave of a vector the part in a line or plane; see ``freedom.project``."""
    along = 0.0
    for j in range(len(u)):
        along = along + u[j] * axis[j]
    for j in range(len(u)):
        part = along * axis[j]
        u[j] = part if on_line else u[j] - part


@part
def _own_measure(patch: Patch) -> np.ndarray:
    """See ``PatchEnergy``: (n,) rows of the shape table."""
    own = empty(len(patch.moving), np.int64)
    for i in range(len(own)):
        own[i] = -1
    for c in range(len(patch.vertices)):
        for k in range(patch.vertices.shape[1]):
            i = patch.slot[patch.vertices[c, k]]
            if i >= 0 and own[i] < 0:
                own[i] = patch.shapes[c]
    return own


@part
def _seen_axes(patch: Patch, own: np.ndarray) -> np.ndarray:
    """See ``measured.seen_axis``: (n, d)."""
    d = patch.axis.shape[1]
    seen = empty((len(own), d), _REAL)
    for i in range(len(own)):
        vertex, u = patch.moving[i], seen[i]
        for j in range(d):
            u[j] = patch.axis[vertex, j]
        if patch.dimension[vertex] == 1:
            _see_through(patch.factor, own[i], u)
        else:
            _solve_back(patch.factor, own[i], u)
        length = u[0] * u[0]
        for j in range(1, d):
            length = length + u[j] * u[j]
        length = np.sqrt(length)
        for j in range(d):
            u[j] = u[j] / length if length > 0.0 else 0.0
    return seen


@inlined
def _solve_back(factor: np.ndarray, k: int, u: np.ndarray) -> None:
    """Put L⁻ᵀ u in the place of u; see ``simplex.solve_back``."""
    u[0] = u[0] / factor[k, 0]
    if PLANAR:
        u[1] = (u[1] - factor[k, 1] * u[0]) / factor[k, 2]
    else:
        u[1] = (u[1] - factor[k, 1] * u[0]) / factor[k, 3]
        u[2] = (u[2] - factor[k, 2] * u[0] - factor[k, 4] * u[1]) / factor[k, 5]


@part
def _measure(g: np.ndarray, patch: Patch, own: np.ndarray, seen: np.ndarray) -> None:
    """Put the gradient by y in the place of that by x, see ``Measured.gradient``."""
    d = patch.axis.shape[1]
    for i in range(len(own)):
        u, dimension = g[i * d : (i + 1) * d], patch.dimension[patch.moving[i]]
        _solve_back(patch.factor, own[i], u)
        if dimension < d:
            _keep_within(u, dimension == 1, seen[i])


@part
def _unmeasure(way: np.ndarray, patch: Patch, own: np.ndarray) -> None:
    """Put the move of x in the place of that of y, see ``Measured.move``."""
    d, factor = patch.axis.shape[1], patch.factor
    for i in range(len(own)):
        k, u = own[i], way[i * d : (i + 1) * d]
        if PLANAR:
            u[1] = u[1] / factor[k, 2]
            u[0] = (u[0] - factor[k, 1] * u[1]) / factor[k, 0]
        else:
            u[2] = u[2] / factor[k, 5]
            u[1] = (u[1] - factor[k, 4] * u[2]) / factor[k, 3]
            u[0] = (u[0] - factor[k, 1] * u[1] - factor[k, 2] * u[2]) / factor[k, 0]
    _project(way, patch)


@part
def _size(points: np.ndarray, patch: Patch) -> float:
    """The mean edge length, see ``PatchEnergy``."""
    vertices, d = patch.vertices, points.shape[1]
    edge = empty(d, _REAL)
    total = 0.0
    for c in range(len(vertices)):
        for j in range(d):
            edge[j] = points[vertices[c, 1], j] - points[vertices[c, 0], j]
        if MEASURED:
            _see_through(patch.factor, patch.shapes[c], edge)
        square = 0.0
        for j in range(d):
            square = square + edge[j] * edge[j]
        total += np.sqrt(square)
    return total / len(vertices)


@part
def _badnesses(points: np.ndarray, patch: Patch, up: np.ndarray, bad: np.ndarray) -> float:
    """Fill ``bad`` with the badness of each corner, infinite where it is not positive; the largest.

    up: (C, 3) the normals from whose direction the triangles of a surface are seen.
    """
    vertices, shapes, norm = patch.vertices, patch.shapes, patch.norm
    largest = 0.0
    if MEASURED:
        for c in range(len(vertices)):
            corner = vertices[c]
            v = determinant_2d(points, corner) if PLANAR else determinant_3d(points, corner)
            s = metric_norm(points, vertices[c], norm, patch.factor, shapes[c])
            bad[c] = badness(v, s, points.shape[1])
            largest = max(largest, bad[c])
        return largest
    if ON_SURFACE:
        for c in range(len(vertices)):
            o, p, q, k = vertices[c, 0], vertices[c, 1], vertices[c, 2], shapes[c]
            e0, e1, e2 = points[p, 0] - points[o, 0], points[p, 1] - points[o, 1], points[p, 2] - points[o, 2]
            f0, f1, f2 = points[q, 0] - points[o, 0], points[q, 1] - points[o, 1], points[q, 2] - points[o, 2]
            v = up[c, 0] * (e1 * f2 - e2 * f1)
            v = v + up[c, 1] * (e2 * f0 - e0 * f2)
            v = v + up[c, 2] * (e0 * f1 - e1 * f0)
            s = norm[k, 0] * (e0 * e0 + e1 * e1 + e2 * e2)
            s = s + norm[k, 1] * (f0 * f0 + f1 * f1 + f2 * f2)
            s = s + norm[k, 2] * (e0 * f0 + e1 * f1 + e2 * f2)
            bad[c] = badness(v, s, 2)
            largest = max(largest, bad[c])
        return largest
    if PLANAR:
        for c in range(len(vertices)):
            o, p, q, k = vertices[c, 0], vertices[c, 1], vertices[c, 2], shapes[c]
            e0, e1 = points[p, 0] - points[o, 0], points[p, 1] - points[o, 1]
            f0, f1 = points[q, 0] - points[o, 0], points[q, 1] - points[o, 1]
            v = e0 * (points[q, 1] - points[p, 1]) + e1 * -(points[q, 0] - points[p, 0])
            s = norm[k, 0] * (e0 * e0 + e1 * e1)
            s = s + norm[k, 1] * (f0 * f0 + f1 * f1)
            s = s + norm[k, 2] * (e0 * f0 + e1 * f1)
            bad[c] = badness(v, s, 2)
            largest = max(largest, bad[c])
        return largest
    for c in range(len(vertices)):
        o, p, q, r, k = vertices[c, 0], vertices[c, 1], vertices[c, 2], vertices[c, 3], shapes[c]
        x0, x1, x2 = points[o, 0], points[o, 1], points[o, 2]
        p0, p1, p2 = points[p, 0], points[p, 1], points[p, 2]
        q0, q1, q2 = points[q, 0], points[q, 1], points[q, 2]
        r0, r1, r2 = points[r, 0], points[r, 1], points[r, 2]
        a0, a1, a2 = q0 - p0, q1 - p1, q2 - p2
        b0, b1, b2 = r0 - p0, r1 - p1, r2 - p2
        e0, e1, e2 = p0 - x0, p1 - x1, p2 - x2
        f0, f1, f2 = q0 - x0, q1 - x1, q2 - x2
        g0, g1, g2 = r0 - x0, r1 - x1, r2 - x2
        v = e0 * (a1 * b2 - a2 * b1) + e1 * (a2 * b0 - a0 * b2) + e2 * (a0 * b1 - a1 * b0)
        s = norm[k, 0] * (e0 * e0 + e1 * e1 + e2 * e2)
        s = s + norm[k, 1] * (f0 * f0 + f1 * f1 + f2 * f2)
        s = s + norm[k, 2] * (g0 * g0 + g1 * g1 + g2 * g2)
        s = s + norm[k, 3] * (e0 * f0 + e1 * f1 + e2 * f2)
        s = s + norm[k, 4] * (e0 * g0 + e1 * g1 + e2 * g2)
        s = s + norm[k, 5] * (f0 * g0 + f1 * g1 + f2 * g2)
        bad[c] = badness(v, s, 3)
        largest = max(largest, bad[c])
    return largest


@part
def _norm(bad: np.ndarray, reference: float, squarings: int, power: np.ndarray) -> tuple[float, float]:
    """See ``PatchEnergy.norm``; fills ``power`` with r^k and returns f and its sum."""
    for c in range(len(bad)):
        value = bad[c] / reference
        for _ in range(squarings):
            value = value * value
        power[c] = value
    total = 0.0
    for c in range(len(bad)):
        total += power[c]
    f = total
    for _ in range(squarings):
        f = np.sqrt(f)
    return f, total


@part
def _gradient(
    points: np.ndarray,
    patch: Patch,
    up: np.ndarray,
    power: np.ndarray,
    f: float,
    total: float,
    g: np.ndarray,
) -> None:
    """See ``PatchEnergy.gradient``; total: the sum of ``power``; up: as for ``_badnesses``."""
    vertices, shapes, norm, slot = patch.vertices, patch.shapes, patch.norm, patch.slot
    for i in range(len(g)):
        g[i] = 0.0
    d = points.shape[1]
    edges = 2 if PLANAR or ON_SURFACE else 3
    e = empty((edges, d), _REAL)
    along = empty((edges, d), _REAL)
    normal = empty((edges, d), _REAL)
    for c in range(len(vertices)):
        weight = power[c] / total
        if weight < NEGLIGIBLE:
            continue
        weight = weight * f
        k = shapes[c]
        for j in range(edges):
            for i in range(d):
                e[j, i] = points[vertices[c, j + 1], i] - points[vertices[c, 0], i]
        if ON_SURFACE:
            for i in range(3):
                a, b = (i + 1) % 3, (i + 2) % 3
                normal[0, i] = e[1, a] * up[c, b] - e[1, b] * up[c, a]
                normal[1, i] = up[c, a] * e[0, b] - up[c, b] * e[0, a]
        elif PLANAR:
            normal[0, 0], normal[0, 1] = e[1, 1], -e[1, 0]
            normal[1, 0], normal[1, 1] = -e[0, 1], e[0, 0]
        else:
            for j in range(3):
                a, b = (j + 1) % 3, (j + 2) % 3
                normal[j, 0] = e[a, 1] * e[b, 2] - e[a, 2] * e[b, 1]
                normal[j, 1] = e[a, 2] * e[b, 0] - e[a, 0] * e[b, 2]
                normal[j, 2] = e[a, 0] * e[b, 1] - e[a, 1] * e[b, 0]
        v = e[0, 0] * normal[0, 0]
        for i in range(1, d):
            v = v + e[0, i] * normal[0, i]
        if MEASURED:
            for j in range(d):
                _see_through(patch.factor, k, e[j])
        if PLANAR or ON_SURFACE:
            for i in range(d):
                along[0, i] = 2.0 * norm[k, 0] * e[0, i] + norm[k, 2] * e[1, i]
                along[1, i] = 2.0 * norm[k, 1] * e[1, i] + norm[k, 2] * e[0, i]
        else:
            for i in range(3):
                along[0, i] = 2.0 * norm[k, 0] * e[0, i] + norm[k, 3] * e[1, i] + norm[k, 4] * e[2, i]
                along[1, i] = 2.0 * norm[k, 1] * e[1, i] + norm[k, 3] * e[0, i] + norm[k, 5] * e[2, i]
                along[2, i] = 2.0 * norm[k, 2] * e[2, i] + norm[k, 4] * e[0, i] + norm[k, 5] * e[1, i]
        s = e[0, 0] * along[0, 0]
        for i in range(1, d):
            s = s + e[0, i] * along[0, i]
        for j in range(1, edges):
            for i in range(d):
                s = s + e[j, i] * along[j, i]
        if MEASURED:
            for j in range(d):
                _see_back(patch.factor, k, along[j])
        to_s, to_v = 2.0 * weight / s, weight / v
        if edges == 3:
            to_s, to_v = 3.0 * to_s, 2.0 * to_v
        own = slot[vertices[c, 0]]
        for j in range(edges):
            other = slot[vertices[c, j + 1]]
            for i in range(d):
                part = to_s * along[j, i] - to_v * normal[j, i]
                if other >= 0:
                    g[other * d + i] += part
                if own >= 0:
                    g[own * d + i] -= part
    _project(g, patch)
