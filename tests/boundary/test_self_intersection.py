"""Crossing facets: against brute force in the plane and by sampling in space."""

import numpy as np
import pytest

from dvr_cli.boundary import self_intersection
from dvr_cli.boundary.self_intersection import crossing_facets


def edges_cross(p, q, r, s):
    """Whether the segments pq and rs meet inside both: the intersection of their lines by Cramer's rule."""
    matrix = np.column_stack([q - p, r - s])
    t, u = np.linalg.solve(matrix, r - p)
    return 0 < t < 1 and 0 < u < 1


def pierced(p, q, triangle):
    """Whether the segment pq meets the triangle inside both."""
    a, b, c = triangle
    t, u, v = np.linalg.solve(np.column_stack([q - p, a - b, a - c]), a - p)
    return 0 < t < 1 and u > 0 and v > 0 and u + v < 1


@pytest.mark.parametrize("pairs", [1, 7, 1 << 20])
@pytest.mark.parametrize("dimension", [2, 3])
def test_random_facets_against_brute_force(dimension, pairs, monkeypatch):
    monkeypatch.setattr(self_intersection, "_PAIRS", pairs)
    rng = np.random.default_rng(dimension)
    points = rng.random((60, dimension))
    facets = np.array([rng.choice(60, dimension, replace=False) for _ in range(25)])
    expected = np.zeros(25, dtype=bool)
    for i, a in enumerate(points[facets]):
        for j, b in enumerate(points[facets]):
            if i == j or set(facets[i]) & set(facets[j]):
                continue
            if dimension == 2:
                hit = edges_cross(*a, *b)
            else:
                sides = [(a[k], a[k - 1], b) for k in range(3)] + [(b[k], b[k - 1], a) for k in range(3)]
                hit = any(pierced(*side) for side in sides)
            expected[i] |= hit
    assert 0 < expected.sum() < 25
    assert (crossing_facets(points, facets) == expected).all()


def test_facets_that_only_touch_do_not_cross():
    points = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0]])
    assert not crossing_facets(points, np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 2]])).any()


def test_no_facets():
    assert crossing_facets(np.zeros((3, 2)), np.empty((0, 2), dtype=int)).tolist() == []
