"""Newton's step against differences of the price, written down anew."""

import numpy as np
import pytest

import oracle
from dvr_cli.mesh.domain import domain_of
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.problem import build_problem
from meshes import KINDS, random_freedom, random_mesh

LEVEL = 0.5


def derivatives(price, x, h):
    """The gradient of a function at x and its second derivatives, by central differences."""
    d = len(x)
    steps = h * np.eye(d)
    gradient = np.array([price(x + step) - price(x - step) for step in steps]) / (2 * h)
    second = np.empty((d, d))
    for i, a in enumerate(steps):
        for j, b in enumerate(steps):
            corners = price(x + a + b) - price(x + a - b) - price(x - a + b) + price(x - a - b)
            second[i, j] = corners / (4 * h * h)
    return gradient, second


@pytest.mark.parametrize("whole", [True, False])
@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_a_vertex_goes_to_where_the_second_derivatives_see_the_lowest_price(kind, relative, whole):
    """Within its line or plane, whose coordinates are those of an orthonormal basis.

    It goes the whole way where the price falls by half of what they promise, else along it.
    """
    mesh = random_mesh(kind, 2, noise=0.3)
    domain = domain_of(mesh)
    d = domain.dimension
    freedom = None if whole else random_freedom(domain, 4)
    relaxed = np.flatnonzero(domain.interior) if freedom is None else freedom.relaxed
    engine = NumpyEngine(build_problem(domain.corners, relaxed, domain.points, freedom=freedom))
    engine.load(domain.points)
    cells = [(block.type, np.asarray(block.vertices)) for block in mesh.cells]
    lo, hi = engine.problem.batch_start[:2]
    engine.polish_batch(0, np.inf, Aim(LEVEL, relative))
    reached, whole_steps = engine.points, 0
    for vertex in engine.problem.relaxed[lo : min(hi, lo + 6)]:
        ring, x = oracle.ring_of(mesh.points, cells, vertex), domain.points[vertex]
        basis = np.eye(d)
        if freedom is not None and freedom.dimension[vertex] < d:
            axis = freedom.axis[vertex]
            turned = np.linalg.qr(np.column_stack([axis, np.eye(d)]))[0].T[:d]
            basis = turned[:1] if freedom.dimension[vertex] == 1 else turned[1:]

        def inverses(place, ring=ring, x=x, basis=basis):
            return 1 / oracle.ring_qualities(ring, x + place @ basis, basis[0], 0.0)

        start = np.zeros(len(basis))
        weights = inverses(start) ** -2.0 if relative else 1.0

        def price(place, inverses=inverses, weights=weights):
            there = inverses(place)
            return (weights * there + there * (LEVEL * there) ** 16 / 17).sum()

        gradient, second = derivatives(price, start, 1e-5)
        step = -np.linalg.solve(second, gradient)
        way, found = step @ basis, reached[vertex] - x
        np.testing.assert_allclose(found / np.linalg.norm(found), way / np.linalg.norm(way), atol=2e-3)
        if price(step) < price(start) + 0.26 * gradient @ step and (inverses(step) > 0).all():
            np.testing.assert_allclose(found, way, rtol=0, atol=4e-3 * np.linalg.norm(way))
            whole_steps += 1
    assert whole_steps
