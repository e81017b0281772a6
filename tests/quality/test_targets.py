"""Target shapes, own and ideal, against matrices written out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.targets import Targets, with_targets
from meshes import KINDS, random_mesh


def shaped(domain, kept, held=None):
    held = np.zeros(len(domain.points), dtype=bool) if held is None else held
    return with_targets(domain.points, domain.corners, Targets(kept, held, 1.0))


@pytest.mark.parametrize("kind", KINDS)
def test_the_own_shape_has_quality_one_in_any_size_and_direction(kind):
    domain = domain_of(random_mesh(kind, 1))
    corners = shaped(domain, np.ones(len(domain.corners.start) - 1, dtype=bool))
    assert corner_qualities(domain.points, corners) == pytest.approx(1.0, abs=1e-12)
    d = domain.dimension
    turn, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(d, d)))
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    assert corner_qualities(7.0 * domain.points @ turn.T + 3.0, corners) == pytest.approx(1.0, abs=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_every_choice_of_origin_gives_the_same_quality(kind):
    """Rings read the target with their own vertex first; all rows of a corner have to agree."""
    domain = domain_of(random_mesh(kind, 3))
    rng = np.random.default_rng(0)
    corners = shaped(domain, rng.random(len(domain.corners.start) - 1) < 0.5)
    moved = domain.points + 0.01 * rng.normal(size=domain.points.shape)
    expected = corner_qualities(moved, corners)
    from dvr_cli.mesh.corners import ORIGIN_FIRST

    for p, order in enumerate(ORIGIN_FIRST[domain.dimension]):
        turned = replace(corners, vertices=corners.vertices[:, order], shapes=corners.shapes[:, [p]])
        assert corner_qualities(moved, turned) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("kept", [False, True])
def test_targets_are_those_of_the_definition(kind, kept):
    """Q of A = E W⁻¹ written out, corner by corner, W the edges of the ideal shape or those in the input."""
    from dvr_cli.mesh.cell_types import CELL_TYPES

    mesh = random_mesh(kind, 5)
    domain = domain_of(mesh)
    d = domain.dimension
    corners = shaped(domain, np.full(len(domain.corners.start) - 1, kept))
    moved = domain.points + 0.02 * np.random.default_rng(1).normal(size=domain.points.shape)
    got = corner_qualities(moved, corners)
    ideal = [t for block in domain.cells for _ in block.vertices for t in CELL_TYPES[block.type].targets]
    for c, target in enumerate(ideal):
        w = (np.asarray(target)[1:] - np.asarray(target)[0]).T
        edges, after = (
            (points[corners.vertices[c, 1:]] - points[corners.vertices[c, 0]]).T
            for points in (domain.points, moved)
        )
        a = after @ np.linalg.inv(edges if kept else w)
        det = np.linalg.det(a)
        expected = d * np.sign(det) * abs(det) ** (2 / d) / (a * a).sum()
        assert got[c] == pytest.approx(expected, rel=1e-8, abs=1e-10)


def test_corners_that_never_move_get_no_rows_and_count_as_perfect():
    domain = domain_of(random_mesh("tetra", 2))
    n = len(domain.corners.start) - 1
    still = np.ones(len(domain.points), dtype=bool)
    still[0] = False
    corners = shaped(domain, np.ones(n, dtype=bool), still)
    touched = (corners.vertices == 0).any(axis=1)
    assert len(corners.table.matrices) == len(domain.corners.table.matrices) + 4 * touched.sum()
    assert (corner_qualities(domain.points, corners)[~touched] == 1.0).all()
    assert corners.held is not None
    assert (corners.held == ~touched).all()


@pytest.mark.parametrize("scale", [1e-50, 1e-9, 1e45])
def test_tiny_and_huge_cells_have_targets_too(scale):
    domain = domain_of(random_mesh("tetra", 1))
    domain = replace(domain, points=domain.points * scale)
    corners = shaped(domain, np.ones(len(domain.corners.start) - 1, dtype=bool))
    plain = domain_of(random_mesh("tetra", 1))
    same = shaped(plain, np.ones(len(plain.corners.start) - 1, dtype=bool))
    assert np.isfinite(corners.table.norm).all()
    assert corners.table.norm == pytest.approx(same.table.norm, rel=1e-6)


def test_flat_cells_are_no_targets():
    """Nearly flat cells in numbers, beside each other: their shape has no inverse worth the name."""
    from dvr_cli.api.shapes import shaped as shaped_by

    mesh = random_mesh("tetra", 1)
    for flatness in (0.0, 1e-18, 1e-9, 1e-5):
        flat = Mesh(mesh.points * [1.0, 1.0, flatness], mesh.cells)
        for shape in ("auto", "input"):
            corners = shaped_by(domain_of(flat), shape).domain.corners
            assert np.isfinite(corners.table.norm).all()
