"""What a vertex may do: nothing, a line, a plane, anything."""

import numpy as np
import pytest

from dvr_cli.boundary.freedom import Freedom, interior_freedom, unit

TANGENT = np.array([0.6, 0.8, 0.0])
NORMAL = np.array([0.0, 0.0, 1.0])
FREEDOM = Freedom(np.array([0, 1, 2, 3], dtype=np.uint8), np.array([[0, 0, 0], TANGENT, NORMAL, [0, 0, 0]]))


def test_directions_keep_what_the_freedom_allows():
    vectors = np.full((4, 3), [1.0, 2.0, 3.0]) / np.sqrt(14.0)
    inside = FREEDOM.directions(vectors, np.arange(4))
    assert inside[0].tolist() == [0, 0, 0]
    np.testing.assert_allclose(inside[1], TANGENT)
    np.testing.assert_allclose(inside[2], np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0))
    assert inside[2, 2] == 0
    np.testing.assert_allclose(inside[3], vectors[3])


def test_rows_follow_the_vertices_asked_for():
    vectors = np.eye(3)[[1, 1]]
    assert FREEDOM.directions(vectors, np.array([3, 0])).tolist() == [[0, 1, 0], [0, 0, 0]]


def test_directions_across_a_plane_or_line_are_none():
    rng = np.random.default_rng(0)
    axes = unit(rng.standard_normal((200, 3)))
    free = Freedom(np.repeat([1, 2], 100).astype(np.uint8), axes)
    across = np.vstack([unit(np.cross(axes[:100], rng.standard_normal(3))), axes[100:]])
    assert (free.directions(across, np.arange(200)) == 0).all()


@pytest.mark.parametrize("slope", [1e-7, 1e-3, 1.0])
def test_directions_nearly_across_a_plane_are_in_it_all_the_same(slope):
    rng = np.random.default_rng(0)
    axes = unit(rng.standard_normal((200, 3)))
    free = Freedom(np.full(200, 2, dtype=np.uint8), axes)
    inside = free.directions(unit(axes + slope * rng.standard_normal((200, 3))), np.arange(200))
    np.testing.assert_allclose((inside * inside).sum(axis=1), 1.0, rtol=1e-14)
    assert np.abs((inside * axes).sum(axis=1)).max() < 1e-15


def test_selection_only_takes_freedom_away():
    chosen = FREEDOM.only(np.array([True, False, True, False]))
    assert chosen.dimension.tolist() == [0, 0, 2, 0]
    assert chosen.relaxed.tolist() == [2]


def test_interior_vertices_move_anywhere():
    freedom = interior_freedom(np.array([False, True]), 2)
    assert freedom.dimension.tolist() == [0, 2]
    assert freedom.directions(np.array([[0.0, 1.0]]), np.array([1])).tolist() == [[0, 1]]
