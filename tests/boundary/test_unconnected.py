"""Vertices that hang on facets, or are in one place: by brute force in fractions, and in refined meshes."""

from fractions import Fraction

import numpy as np
import pytest

import dvr_cli
from dvr_cli.boundary.unconnected import coincident_vertices, hanging_vertices


def hangs(point, facet):
    """Whether a point lies in a convex facet (edge, triangle, planar quadrilateral), off its vertices."""
    p, corners = [Fraction(x) for x in point], [[Fraction(x) for x in c] for c in facet]
    if p in corners:
        return False
    if len(corners) == 4:
        return (
            hangs(point, facet[:3]) or hangs(point, facet[[0, 2, 3]]) or on_segment(p, corners[0], corners[2])
        )
    if len(corners) == 2:
        return on_segment(p, *corners)
    if any(on_segment(p, corners[k - 1], corners[k]) for k in range(3)):
        return True
    a, b, c = corners
    sides = [cross(minus(y, x), minus(p, x)) for x, y in ((a, b), (b, c), (c, a))]
    normal = cross(minus(b, a), minus(c, a))
    return dot(normal, minus(p, a)) == 0 and all(dot(side, normal) > 0 for side in sides)


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def on_segment(p, a, b):
    along, offset = minus(b, a), minus(p, a)
    t = dot(along, offset)
    return 0 < t < dot(along, along) and t * t == dot(along, along) * dot(offset, offset)


@pytest.mark.parametrize(("d", "width"), [(2, 2), (3, 3), (3, 4)])
def test_against_exact_arithmetic(d, width):
    """In any unit of length."""
    rng = np.random.default_rng(width)
    grid = np.array(np.meshgrid(*[np.arange(7)] * d)).reshape(d, -1).T.astype(float)
    for _ in range(3):
        if width == 4:  # boxes in planes across the axes, of many sizes
            low, size = rng.integers(0, 5, (12, 3)), rng.integers(1, 5, (12, 3))
            axis = rng.integers(0, 3, 12)
            rows = np.arange(12)
            steps = np.zeros((4, 12, 3), dtype=int)
            for k, (one, other) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
                steps[k, rows, (axis + 1) % 3] = one * size[rows, (axis + 1) % 3]
                steps[k, rows, (axis + 2) % 3] = other * size[rows, (axis + 2) % 3]
            places = np.minimum(low + steps, 6).swapaxes(0, 1)
            facets = np.ravel_multi_index(np.moveaxis(places[:, :, [1, 0, 2]], -1, 0), (7, 7, 7))
            facets = facets[[len(set(row)) == 4 for row in facets.tolist()]]
        else:
            facets = np.array([rng.choice(len(grid), width, replace=False) for _ in range(12)])
        used = np.unique(facets)
        pairs = [(v, f) for v in used for f, row in enumerate(facets) if hangs(grid[v], grid[row])]
        for scale in (1.0, 2.0**-40, 1024.0):
            found, held = hanging_vertices(grid * scale + scale, facets)
            assert found.tolist() == sorted({v for v, _ in pairs})
            assert held.tolist() == sorted({f for _, f in pairs})


def test_vertices_in_one_place():
    points = np.array([[0.0, 1.0], [0.5, 0.0], [-0.0, 1.0], [0.5, 1e-12], [3.0, 3.0], [3.0, 3.0]])
    assert coincident_vertices(points, np.arange(5)).tolist() == [0, 2]


def half_refined(n=4):
    """A square of quadrilaterals, those on the right cut into four: nodes hang on the line between."""

    def grid(x, y):
        points = np.array([[a, b] for b in y for a in x])
        j, i = np.divmod(np.arange((len(x) - 1) * (len(y) - 1)), len(x) - 1)
        low = i + len(x) * j
        return points, np.column_stack([low, low + 1, low + 1 + len(x), low + len(x)])

    left, coarse = grid(np.arange(n + 1), np.arange(n + 1))
    right, fine = grid(np.arange(2 * n + 1) / 2 + n, np.arange(2 * n + 1) / 2)
    points, place = np.unique(np.concatenate([left, right]), axis=0, return_inverse=True)
    cells = place.ravel()[np.concatenate([coarse, fine + len(left)])]
    return points.astype(float), cells


@pytest.mark.parametrize("boundary", ["slide", "project"])
def test_hanging_nodes_stay_and_are_counted(boundary):
    points, cells = half_refined()
    start = points.copy()
    sides = np.isin(points, [0.0, 8.0, 4.0]).any(axis=1)
    rng = np.random.default_rng(0)
    start[~sides] += rng.uniform(-0.1, 0.1, points[~sides].shape)
    moved, report = dvr_cli.smooth(start, {"quad": cells}, boundary=boundary, max_iterations=3)
    on_line = points[:, 0] == 4.0
    assert report.mesh.hanging == 4
    assert np.array_equal(moved[on_line], start[on_line])
    assert (moved != start).any()


def test_where_the_boundary_stays_nobody_looks():
    points, cells = half_refined()
    _, report = dvr_cli.smooth(points, {"quad": cells}, max_iterations=1)
    assert report.mesh.hanging is None
    assert report.mesh.coincident is None


def test_a_conforming_mesh_has_none():
    points, cells = half_refined()
    coarse = cells[(points[cells, 0] <= 4).all(axis=1)]
    _, report = dvr_cli.smooth(points, {"quad": coarse}, boundary="slide", max_iterations=1)
    assert (report.mesh.hanging, report.mesh.coincident) == (0, 0)
