"""A metric: cells seen through the tensor they have, against matrices written out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.corners import ORIGIN_FIRST
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.badness import badness_of, worst_corner
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.metric import metric_on, tensors_of
from meshes import KINDS, random_mesh, random_tensors


def in_metric(domain, tensors):
    return metric_on(domain, tensors).corners


@pytest.mark.parametrize("kind", KINDS)
def test_quality_is_that_of_the_definition(kind):
    """Q = d |det A|^(2/d) / ‖A‖² with A = L E W⁻¹ and L any root of the mean tensor, cell by cell."""
    domain = domain_of(random_mesh(kind, 5))
    d = domain.dimension
    tensors = random_tensors(len(domain.points), d, 1)
    corners = in_metric(domain, tensors)
    got = corner_qualities(domain.points, corners)
    cells = [row for block in domain.cells for row in block.vertices]
    types = [block.type for block in domain.cells for _ in block.vertices]
    for cell, (row, name) in enumerate(zip(cells, types, strict=True)):
        value, vector = np.linalg.eigh(tensors[row].mean(axis=0))
        root = vector * np.sqrt(value) @ vector.T
        for c, target in zip(range(*corners.start[cell : cell + 2]), CELL_TYPES[name].targets, strict=True):
            w = (np.asarray(target)[1:] - np.asarray(target)[0]).T
            edges = (domain.points[corners.vertices[c, 1:]] - domain.points[corners.vertices[c, 0]]).T
            a = root @ edges @ np.linalg.inv(w)
            det = np.linalg.det(a)
            expected = d * np.sign(det) * abs(det) ** (2 / d) / (a * a).sum()
            assert got[c] == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_every_choice_of_origin_gives_the_same_quality(kind):
    """Rings read the target with their own vertex first; all rows of a corner have to agree."""
    domain = domain_of(random_mesh(kind, 3))
    corners = in_metric(domain, random_tensors(len(domain.points), domain.dimension, 2))
    expected = corner_qualities(domain.points, corners)
    for p, order in enumerate(ORIGIN_FIRST[domain.dimension]):
        turned = replace(corners, vertices=corners.vertices[:, order], shapes=corners.shapes[:, [p]])
        assert corner_qualities(domain.points, turned) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_the_metric_of_a_map_undoes_the_map(kind):
    domain = domain_of(random_mesh(kind, 1))
    d = domain.dimension
    stretch = np.random.default_rng(4).normal(size=(d, d))
    stretch[:, 0] *= np.sign(np.linalg.det(stretch))
    back = np.linalg.inv(stretch)
    mapped = replace(domain, points=domain.points @ stretch.T)
    tensors = np.tile(back.T @ back, (len(domain.points), 1, 1))
    metric = metric_on(mapped, tensors)
    expected = corner_qualities(domain.points, domain.corners)
    assert corner_qualities(mapped.points, metric.corners) == pytest.approx(expected, abs=1e-12)
    assert metric.max_aspect == pytest.approx(np.linalg.cond(stretch))


def test_only_shape_counts():
    """A multiple of a tensor says the same, of any size; a power of two says it to the last bit."""
    domain = domain_of(random_mesh("tetra", 1))
    tensors = random_tensors(len(domain.points), 3, 1)
    one = corner_qualities(domain.points, in_metric(domain, tensors))
    for size in (2.0**200, 2.0**-200, 4.0):
        assert (corner_qualities(domain.points, in_metric(domain, size * tensors)) == one).all()
    with_ideal = corner_qualities(domain.points, domain.corners)
    round_ones = in_metric(domain, np.tile(7.0 * np.eye(3), (len(domain.points), 1, 1)))
    assert corner_qualities(domain.points, round_ones) == pytest.approx(with_ideal, rel=1e-13)


def test_the_worst_corner_is_that_in_the_metric():
    domain = domain_of(random_mesh("tetra", 2))
    corners = in_metric(domain, random_tensors(len(domain.points), 3, 5))
    quality = corner_qualities(domain.points, corners)
    worst, badness = worst_corner(domain.points, corners)
    assert worst == quality.argmin() != corner_qualities(domain.points, domain.corners).argmin()
    assert badness == pytest.approx(badness_of(quality.min(), 3))


@pytest.mark.parametrize("turned", [False, True])
def test_a_plane_in_space_has_the_part_of_the_tensor_in_it(turned):
    """A stretch within the plane, another across it that must not count."""
    flat = random_mesh("triangle", 4)
    turn = np.eye(3)
    if turned:
        turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    expected = corner_qualities(
        flat.points,
        in_metric(domain_of(flat), np.tile(np.array([[9.0, 1.0], [1.0, 1.0]]), (len(flat.points), 1, 1))),
    )
    whole = np.array([[9.0, 1.0, 3.0], [1.0, 1.0, -2.0], [3.0, -2.0, 50.0]])
    points = np.pad(flat.points, ((0, 0), (0, 1))) @ turn.T
    domain = domain_of(Mesh(points, flat.cells))
    corners = in_metric(domain, np.tile(turn @ whole @ turn.T, (len(points), 1, 1)))
    assert corner_qualities(domain.points, corners) == pytest.approx(expected, abs=1e-10)


def test_components_are_in_vtk_s_order():
    plane = tensors_of(np.array([[1.0, 2.0, 3.0]]), 1)
    assert plane.tolist() == [[[1.0, 3.0], [3.0, 2.0]]]
    space = tensors_of(np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]]), 1)
    assert space.tolist() == [[[1.0, 4.0, 6.0], [4.0, 2.0, 5.0], [6.0, 5.0, 3.0]]]
    whole = np.arange(9.0).reshape(1, 3, 3) + np.arange(9.0).reshape(1, 3, 3).transpose(0, 2, 1)
    assert (tensors_of(whole.reshape(1, 9), 1) == whole).all()
    assert (tensors_of(whole, 1) == whole).all()
    assert tensors_of(np.array([[4.0, 1.0, 1.0, 2.0]]), 1).shape == (1, 2, 2)


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        (np.ones(5), "scalars are sizes"),
        (np.ones((5, 1)), "scalars are sizes"),
        (np.ones((5, 2)), "2 components"),
        (np.ones((5, 5)), "5 components"),
        (np.ones((4, 6)), "4 values for 5 vertices"),
        (np.array(1.0), "1 values for 5 vertices"),
        (np.array(["a"] * 5), "not numbers"),
        (np.tile([1.0, 0.5, 0.0, 1.0], (5, 1)), "vertex 0 .* not symmetric"),
    ],
)
def test_what_is_no_tensor_is_refused(values, fault):
    with pytest.raises(InputError, match=fault):
        tensors_of(values, 5)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (np.nan, "vertex 3 .* not finite"),
        (np.inf, "vertex 3 .* not finite"),
        (-1.0, "vertex 3 .* not positive definite"),
        (0.0, "vertex 3 .* not positive definite"),
    ],
)
def test_what_is_no_metric_is_refused(change, fault):
    domain = domain_of(random_mesh("tetra", 1))
    tensors = np.tile(np.eye(3), (len(domain.points), 1, 1))
    tensors[3, 1, 1] = change
    with pytest.raises(InputError, match=fault):
        metric_on(domain, tensors)


def test_vertices_of_no_cell_need_no_tensor():
    mesh = random_mesh("tetra", 1)
    domain = domain_of(Mesh(np.vstack([mesh.points, [[9.0, 9.0, 9.0]]]), mesh.cells))
    tensors = np.tile(np.eye(3), (len(domain.points), 1, 1))
    tensors[-1] = np.nan
    metric_on(domain, tensors)


def test_surfaces_and_tensors_of_another_dimension_are_refused():
    sphere = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [-1, -1, -1]])
    faces = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    surface = domain_of(Mesh(sphere, [Cells("triangle", faces)]))
    with pytest.raises(InputError, match="surface"):
        metric_on(surface, np.tile(np.eye(3), (4, 1, 1)))
    volume = domain_of(random_mesh("tetra", 1))
    with pytest.raises(InputError, match="6 or 9"):
        metric_on(volume, np.tile(np.eye(2), (len(volume.points), 1, 1)))
    plane = random_mesh("triangle", 1)
    upright = np.column_stack([np.zeros(len(plane.points)), plane.points])
    with pytest.raises(InputError, match="plane x, y"):
        metric_on(domain_of(Mesh(upright, plane.cells)), np.tile(np.eye(2), (len(upright), 1, 1)))
