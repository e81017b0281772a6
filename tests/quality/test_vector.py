"""The quality vector and the ordering of such vectors, against their definitions in the paper."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvr_cli.mesh.domain import domain_of
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.vector import at_least, first_difference, ring_minima
from meshes import KINDS, random_mesh

# few different values, so that vectors often agree in their first components
VECTORS = st.lists(st.sampled_from([-0.5, 0.0, 0.1, 0.1 + 1e-16, 0.25, 1.0]), max_size=5).map(sorted)
PAIRS = st.tuples(VECTORS, VECTORS).map(lambda pair: [v[: min(map(len, pair))] for v in pair])


@pytest.mark.parametrize("kind", KINDS)
def test_minimum_of_each_ring(kind):
    mesh = random_mesh(kind, 2)
    corners = domain_of(mesh).corners
    quality = corner_qualities(mesh.points, corners)
    minima = ring_minima(quality, corners, len(mesh.points) + 1)
    rings = [
        [q for q, c in zip(quality, corners.vertices.tolist(), strict=True) if v in c]
        for v in range(len(minima))
    ]
    assert minima.tolist() == [min(ring, default=np.inf) for ring in rings]
    assert minima[-1] == np.inf  # a vertex without corners


@given(PAIRS)
def test_order_is_decided_by_the_first_component_that_differs(pair):
    """Equation 2: u > w when u_i > w_i in the first component i in which they differ."""
    u, w = pair
    differing = [i for i in range(len(u)) if u[i] != w[i]]
    assert first_difference(np.array(u), np.array(w)) == (differing[0] if differing else None)
    assert at_least(np.array(u), np.array(w)) == (not differing or u[differing[0]] > w[differing[0]])


@given(PAIRS)
def test_order_is_total(pair):
    u, w = map(np.array, pair)
    assert at_least(u, w) or at_least(w, u)
    assert (at_least(u, w) and at_least(w, u)) == np.array_equal(u, w)


def test_smallest_components_count_first():
    assert at_least(np.array([0.2, 0.3, 0.3]), np.array([0.1, 0.9, 1.0]))
    assert not at_least(np.array([0.1, 0.9, 1.0]), np.array([0.2, 0.3, 0.3]))
    assert first_difference(np.array([0.1, 0.2, 0.3]), np.array([0.1, 0.2, 0.4])) == 2


def test_the_worst_element_appears_once_for_each_relaxed_vertex_of_it():
    """The paper's Fig. 5: the quality vector is not a list of the qualities of the elements."""
    repeated = set()
    for seed in range(10):
        mesh = random_mesh("triangle", seed, n=6)
        domain = domain_of(mesh)
        quality = corner_qualities(mesh.points, domain.corners)
        vector = np.sort(ring_minima(quality, domain.corners, len(mesh.points))[domain.interior])
        relaxed = domain.interior[domain.corners.vertices].sum(axis=1)
        worst = np.where(relaxed > 0, quality, np.inf).argmin()
        assert vector[0] == quality[worst]
        assert (vector == vector[0]).sum() == relaxed[worst]
        repeated.add(int(relaxed[worst]))
    assert max(repeated) > 1
