"""Gaps: how far two sheets of triangles are from each other, seen along one direction.

Where a sheet is cut into parts, and each part looked at along a normal of its own, the distance of a point
from the other sheet is at most the gap: that to the triangle straight above or below it. Unlike the search
for the nearest point, which walks from facet to facet, this holds where facets lie folded, too.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.boundary.freedom import unit
from dvr_cli.mesh.csr import group, row_entries

_GRID = 4  # intervals an edge is cut into
SLACK = 1e-9  # barycentric coordinate below 0 up to which a point counts as over a triangle
_CHUNK = 1 << 20  # pairs of a point and a triangle looked at at a time


def frames(normals: np.ndarray) -> np.ndarray:
    """(n, 3, 3) for each unit normal (n, 3) two unit vectors across it, in right-handed order, and itself."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    one = unit(np.cross(normals, axis))
    return np.stack([one, np.cross(normals, one), normals], axis=2)


def samples(corners: np.ndarray) -> np.ndarray:
    """(n, s, 3) points spread evenly over triangles with these corners (n, 3, 3)."""
    i, j = np.meshgrid(np.arange(_GRID + 1), np.arange(_GRID + 1), indexing="ij")
    inside = i + j <= _GRID
    weights = np.stack([i[inside], j[inside], _GRID - (i + j)[inside]], axis=1) / _GRID
    return np.einsum("sk,nki->nsi", weights, corners)


def gaps(
    points: np.ndarray,
    part: np.ndarray,
    corners: np.ndarray,
    of: np.ndarray,
    frame: np.ndarray,
    backend: Backend = NUMPY,
) -> np.ndarray:
    """(n,) the gap between each of ``points`` (n, 3) and the triangles of its part, infinite where none is.

    part: (n,) of each point. corners: (T, 3, 3) of the triangles, and of: (T,) the part of each.
    frame: (P, 3, 3) of each part, see ``frames``. backend: what computes; the result is the same.
    """
    seen = corners @ frame[of]
    a, b, c = seen.swapaxes(0, 1)
    own = (points[:, None] @ frame[part])[:, 0]
    triangle, start = group(of, len(frame))
    return backend.twin(least_gaps)(own, part, a, b - a, c - a, triangle, start)


def least_gaps(
    own: np.ndarray,
    part: np.ndarray,
    a: np.ndarray,
    e: np.ndarray,
    f: np.ndarray,
    triangle: np.ndarray,
    start: np.ndarray,
) -> np.ndarray:
    """See ``gaps``, with all as seen in the frames of the parts.

    own: (n, 3) the points. a, e, f: (T, 3) a corner of each triangle, and the edges from there. triangle,
    start: the triangles of each part, see ``group``.
    """
    det = e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
    size = np.where(det == 0.0, np.inf, det)  # a triangle seen edge on is above and below nothing
    result = np.full(len(own), np.inf)
    count = np.diff(start)[part]
    step = max(1, _CHUNK // max(1, int(count.max(initial=1))))
    for lo in range(0, len(own), step):
        here = slice(lo, lo + step)
        entries, row_start = row_entries(start, part[here])
        t = triangle[entries]
        point = np.repeat(np.arange(lo, min(lo + step, len(own))), np.diff(row_start))
        x, y, height = (own[point] - a[t]).T
        u = (x * f[t, 1] - y * f[t, 0]) / size[t]
        w = (e[t, 0] * y - e[t, 1] * x) / size[t]
        gap = np.abs(height - (u * e[t, 2] + w * f[t, 2]))
        over = (u >= -SLACK) & (w >= -SLACK) & (u + w <= 1.0 + SLACK) & (det[t] != 0.0)
        np.minimum.at(result, point[over], gap[over])
    return result
