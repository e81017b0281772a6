"""Twins: what is compiled stands in NumPy, too, under the same name and with the same arguments."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from dvr_cli.backend import COMPILED, NUMPY
from dvr_cli.boundary import gaps
from dvr_cli.mesh import csr, facets, interior, orientation, repeated, rings, simplex
from dvr_cli.quality import altitudes, angles, mean_ratio, vector
from dvr_cli.relax import altitudes as altitude_rule
from dvr_cli.relax import problem, ring_qualities, schedule
from dvr_cli.relax.patches import neighbourhoods, solver
from needs import require

TWINS = (
    *(csr.group, facets.facet_order, interior.cancel_facets, interior.cancel_facets_of_simplices),
    *(gaps.least_gaps, orientation.connected_parts),
    *(repeated.summed, rings.incidence, rings.rings, simplex.determinants),
    *(altitudes.extremes, angles.with_extreme_cosines, angles.with_extreme_turns),
    angles.tetrahedra_with_extreme_cosines,
    altitude_rule.hold_altitudes,
    *(mean_ratio.corner_terms, mean_ratio.metric_norms, vector.lower),
    *(problem.touched_corners, neighbourhoods.choose, solver.solve_patch, solver.find_moves),
    *(ring_qualities.corners_of_rings, ring_qualities.renew),
    *(schedule.colours, schedule.colour_ready, schedule.levels),
)


@pytest.mark.parametrize("function", TWINS, ids=lambda function: function.__name__)
def test_twins_have_the_same_name_and_arguments(function):
    require("numba")
    twin = COMPILED.twin(function)
    assert NUMPY.twin(function) is function
    assert twin.__module__ == function.__module__ + "_numba"
    plain = getattr(twin, "py_func", twin)
    assert list(inspect.signature(plain).parameters) == list(inspect.signature(function).parameters)


def test_determinants_of_twins_agree_to_the_bit():
    require("numba")
    generator = np.random.default_rng(3)
    points = generator.random((50, 3))
    vertices = np.argsort(generator.random((200, 50)), axis=1)[:, :4].astype(np.int32)
    plain = simplex.determinants(points, vertices)
    assert COMPILED.twin(simplex.determinants)(points, vertices).tobytes() == plain.tobytes()


def test_triangles_in_space_get_the_same_bits_of_twins():
    require("numba")
    generator = np.random.default_rng(4)
    points = generator.random((50, 3))
    corners = np.argsort(generator.random((200, 50)), axis=1)[:, :3].astype(np.int32)
    norm, shapes = np.array([[1.0, 2.0, -0.5]]), np.zeros((200, 3), dtype=np.int32)
    found = []
    for backend in (NUMPY, COMPILED):
        v, s = np.empty(200), np.empty(200)
        backend.twin(mean_ratio.corner_terms)(points, corners, shapes, norm, v, s)
        least = backend.twin(altitudes.extremes)(points, corners)
        found.append((v.tobytes(), s.tobytes(), least))
    assert found[0] == found[1]


@pytest.mark.parametrize("edges", [0, 30, 200])
def test_connected_parts_are_named_alike_by_twins(edges):
    require("numba")
    tail, head = np.random.default_rng(edges).integers(0, 200, (2, edges))
    found = COMPILED.twin(orientation.connected_parts)(200, tail, head)
    assert found.tolist() == orientation.connected_parts(200, tail, head).tolist()


def test_gaps_of_twins_agree_to_the_bit():
    require("numba")
    generator = np.random.default_rng(5)
    corners, points = generator.random((60, 3, 3)), generator.random((200, 3))
    corners[:3, 2] = corners[:3, 1]  # seen edge on
    of, part = generator.integers(0, 3, 60), generator.integers(0, 4, 200)  # the last part has no triangles
    frame = gaps.frames(np.eye(3)[[0, 1, 2, 2]])
    plain, compiled = (gaps.gaps(points, part, corners, of, frame, backend) for backend in (NUMPY, COMPILED))
    assert compiled.tobytes() == plain.tobytes()
    assert np.isfinite(plain).any()
    assert np.isinf(plain[part == 3]).all()


@pytest.mark.parametrize("width", [2, 3, 4])
def test_facets_get_the_same_numbers_of_twins(width):
    require("numba")
    generator = np.random.default_rng(width)
    rows = np.argsort(generator.random((400, 9)), axis=1)[:, :width].astype(np.int32)
    rows[generator.random(400) < 0.3, 2:] = -1  # shorter ones
    assert facets.numbered(rows, COMPILED).tolist() == facets.numbered(rows).tolist()
