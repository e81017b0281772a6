"""Harmonic displacements, against a dense solution and for what is linear."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from dvr_cli.mesh.domain import domain_of
from dvr_cli.relax.harmonic import edges_of, spread
from meshes import random_mesh


@pytest.mark.parametrize("kind", ["triangle", "tetra"])
def test_edges_are_all_pairs_of_a_simplex_once(kind):
    mesh = random_mesh(kind, 2)
    expected = {
        tuple(sorted(pair)) for cell in mesh.cells[0].vertices.tolist() for pair in combinations(cell, 2)
    }
    found = edges_of(mesh.cells, len(mesh.points)).tolist()
    assert [tuple(edge) for edge in found] == sorted(expected)


@pytest.mark.parametrize("kind", ["triangle", "quad", "hexahedron", "mixed3d"])
def test_the_spread_is_the_solution_of_the_laplacian(kind):
    mesh = random_mesh(kind, 1)
    domain = domain_of(mesh)
    n = len(mesh.points)
    edges = edges_of(domain.cells, n)
    matrix = np.zeros((n, n))
    for a, b in edges.tolist():
        weight = 1.0 / ((domain.points[a] - domain.points[b]) ** 2).sum()
        matrix[[a, b], [a, b]] += weight
        matrix[[a, b], [b, a]] -= weight
    given = ~domain.interior
    shift = np.random.default_rng(0).normal(size=domain.points.shape)
    expected = shift.copy()
    free = domain.interior
    expected[free] = np.linalg.solve(matrix[np.ix_(free, free)], -matrix[np.ix_(free, given)] @ shift[given])
    assert spread(domain.points, edges, shift, given) == pytest.approx(expected, abs=1e-6)


def test_a_translation_is_passed_on_whole():
    domain = domain_of(random_mesh("triangle", 3))
    shift = np.tile([0.5, -2.0], (len(domain.points), 1))
    edges = edges_of(domain.cells, len(domain.points))
    assert spread(domain.points, edges, shift, ~domain.interior) == pytest.approx(shift, abs=1e-6)
