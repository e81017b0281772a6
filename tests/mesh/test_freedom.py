"""What a vertex may do: nothing, a line, a plane, anything."""

import numpy as np

from dvr_cli.mesh.freedom import Freedom, interior_freedom

TANGENT = np.array([0.6, 0.8, 0.0])
NORMAL = np.array([0.0, 0.0, 1.0])
FREEDOM = Freedom(np.array([0, 1, 2, 3], dtype=np.uint8), np.array([[0, 0, 0], TANGENT, NORMAL, [0, 0, 0]]))


def test_directions_keep_what_the_freedom_allows():
    vectors = np.full((4, 3), [1.0, 2.0, 3.0])
    inside = FREEDOM.restrict(vectors, np.arange(4))
    assert inside[0].tolist() == [0, 0, 0]
    np.testing.assert_allclose(inside[1], 2.2 * TANGENT)
    assert inside[2].tolist() == [1, 2, 0]
    assert inside[3].tolist() == [1, 2, 3]


def test_rows_follow_the_vertices_asked_for():
    assert FREEDOM.restrict(np.ones((2, 3)), np.array([3, 0])).tolist() == [[1, 1, 1], [0, 0, 0]]


def test_selection_only_takes_freedom_away():
    chosen = FREEDOM.only(np.array([True, False, True, False]))
    assert chosen.dimension.tolist() == [0, 0, 2, 0]
    assert chosen.relaxed.tolist() == [2]


def test_interior_vertices_move_anywhere():
    freedom = interior_freedom(np.array([False, True]), 2)
    assert freedom.dimension.tolist() == [0, 2]
    assert freedom.restrict(np.array([[3.0, 4.0]]), np.array([1])).tolist() == [[3, 4]]
