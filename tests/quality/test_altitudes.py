"""Altitudes and the conduction bound against linear algebra, and against matrices of scikit-fem."""

from __future__ import annotations

import numpy as np
import pytest

import dvr_cli
import oracle
from dvr_cli.backend import COMPILED
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.altitudes import altitude_and_conduction, extremes
from meshes import KINDS, delaunay, random_mesh
from needs import require


def inverse_altitudes(simplex: np.ndarray) -> np.ndarray:
    """(d+1,) 1/h of a simplex (d+1, d): how long the gradients of its barycentric coordinates are."""
    gradients = np.linalg.inv(np.column_stack([simplex, np.ones(len(simplex))]))[:-1]
    return np.linalg.norm(gradients, axis=0)


@pytest.mark.parametrize("kind", KINDS)
def test_altitudes_are_one_over_the_gradients_of_shape_functions(kind):
    mesh = random_mesh(kind, 3)
    sums, smallest = [], []
    for block in mesh.cells:
        for local, _ in oracle.corners(block.type):
            for cell in block.vertices:
                inverse = inverse_altitudes(mesh.points[cell[local]])
                sums.append((inverse**2).sum())
                smallest.append(1.0 / inverse.max())
    measures = dvr_cli.quality_report(mesh.points, {b.type: b.vertices for b in mesh.cells}).quality.measures
    assert measures["min_altitude"] == pytest.approx(min(smallest), rel=1e-10)
    d = mesh.points.shape[1]
    assert measures["conduction_bound"] == pytest.approx((d + 1) * max(sums), rel=1e-10)


def test_known_shapes():
    triangle = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])  # its altitudes are 3, 4 and 12/5
    found = altitude_and_conduction(triangle, np.array([[0, 1, 2]]))
    assert found == pytest.approx((2.4, 3 * (1 / 9 + 1 / 16 + 25 / 144)))
    in_space = np.column_stack([triangle, triangle @ [0.6, 0.8]]) / np.sqrt(2)
    flat = altitude_and_conduction(in_space, np.array([[0, 1, 2]]))
    sides = [in_space[i] - in_space[j] for i, j in ((1, 0), (2, 0), (2, 1))]
    lengths = np.linalg.norm(sides, axis=1)
    area = np.linalg.norm(np.cross(sides[0], sides[1]))
    assert flat == pytest.approx((area / lengths.max(), 3 * (lengths**2).sum() / area**2))
    corner = np.vstack([np.zeros(3), np.eye(3)])  # its altitudes are 1, 1, 1 and 1/√3
    assert altitude_and_conduction(corner, np.array([[0, 1, 2, 3]])) == pytest.approx((3**-0.5, 4 * 6.0))


def test_inverted_and_flat_elements():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [2.0, 0.0]])
    assert altitude_and_conduction(points, np.array([[0, 2, 1]]))[0] == pytest.approx(-(0.5**0.5))
    flat = np.array([[0, 1, 2], [0, 1, 3]])
    assert altitude_and_conduction(points, flat) == (0.0, np.inf)
    measures = dvr_cli.quality_report(points, {"triangle": flat}).quality.measures
    assert (measures["min_altitude"], measures["conduction_bound"]) == (0.0, None)


def largest_eigenvalue(skfem, points: np.ndarray, cells: np.ndarray) -> float:
    """Of the stiffness matrix of conduction against the lumped mass matrix, as scikit-fem assembles them."""
    from scipy.linalg import eigh

    triangles = cells.shape[1] == 3
    mesh = (skfem.MeshTri if triangles else skfem.MeshTet)(points.T.copy(), cells.T.copy())
    basis = skfem.Basis(mesh, skfem.ElementTriP1() if triangles else skfem.ElementTetP1())
    stiffness = skfem.BilinearForm(lambda u, v, _: sum(u.grad * v.grad)).assemble(basis).toarray()
    mass = skfem.BilinearForm(lambda u, v, _: u * v).assemble(basis).toarray().sum(axis=1)
    return eigh(stiffness, np.diag(mass), eigvals_only=True)[-1]


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_conduction_bound_is_one_on_the_eigenvalues_of_assembled_matrices(dimension):
    """And no idle one: an element's matrix has d positive eigenvalues, whose sum it is."""
    skfem = require("skfem")
    mesh = delaunay(40, dimension, 5)
    cells = mesh.cells[0].vertices
    bound = altitude_and_conduction(mesh.points, cells)[1]
    assert largest_eigenvalue(skfem, mesh.points, cells) <= bound
    alone = [largest_eigenvalue(skfem, mesh.points[cell], np.arange(dimension + 1)[None]) for cell in cells]
    assert max(alone) <= bound * (1 + 1e-9) <= dimension * max(alone) * (1 + 2e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_twin_has_the_same_bits(dimension):
    require("numba")
    points = np.random.default_rng(dimension).random((60, dimension))
    vertices = np.argsort(np.random.default_rng(1).random((300, 60)), axis=1)[:, : dimension + 1]
    vertices = vertices.astype(np.int32)
    assert COMPILED.twin(extremes)(points, vertices) == extremes(points, vertices)
    flat = Mesh(np.zeros_like(points), [Cells("triangle" if dimension == 2 else "tetra", vertices[:3])])
    assert COMPILED.twin(extremes)(flat.points, vertices) == extremes(flat.points, vertices) == (0.0, np.inf)


def test_planar_meshes_in_space_are_measured_in_their_plane():
    mesh = random_mesh("quad", 2)
    turned = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0][:, :2]
    points = mesh.points @ turned.T
    domain = domain_of(Mesh(points, mesh.cells))
    found = altitude_and_conduction(domain.flatten(points), domain.corners.vertices)
    assert found == pytest.approx(altitude_and_conduction(mesh.points, domain_of(mesh).corners.vertices))
