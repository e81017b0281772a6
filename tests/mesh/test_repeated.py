"""Cells given twice count once: against Python sets, and a mesh without the repetition."""

import numpy as np
import pytest

import dvr_cli
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.repeated import repeated_cells, shared_regions
from dvr_cli.quality.measure import cell_field, measure
from meshes import KINDS, random_mesh


def with_repetition(mesh, seed, share=0.3):
    """The mesh with some cells once or twice more, vertices in another order, in blocks of their own."""
    rng = np.random.default_rng(seed)
    more = []
    for block in mesh.cells:
        chosen = np.repeat(np.flatnonzero(rng.random(len(block.vertices)) < share), rng.integers(1, 3))
        rows = [rng.permutation(row) for row in block.vertices[chosen]]
        more.append(Cells(block.type, np.reshape(rows, (-1, block.vertices.shape[1])).astype(int)))
    return Mesh(mesh.points, [*mesh.cells, *more])


@pytest.mark.parametrize("kind", KINDS)
def test_repeated_cells_as_sets_tell(kind):
    for seed in range(5):
        mesh = with_repetition(random_mesh(kind, seed), seed)
        again, original = repeated_cells(mesh.cells, len(mesh.points))
        rows = [frozenset(row) for block in mesh.cells for row in block.vertices.tolist()]
        first = {}
        expected = [(i, first[row]) for i, row in enumerate(rows) if first.setdefault(row, i) != i]
        assert list(zip(again.tolist(), original.tolist(), strict=True)) == expected
        assert expected


@pytest.mark.parametrize("kind", KINDS)
def test_a_mesh_with_repetition_is_relaxed_and_measured_as_without(kind):
    once = random_mesh(kind, 1)
    twice = with_repetition(once, 2)
    assert np.array_equal(domain_of(once).interior, domain_of(twice).interior)
    options = {"max_iterations": 3, "engine": "numpy", "patches": False}
    moved, report = dvr_cli.smooth(once.points, [(b.type, b.vertices) for b in once.cells], **options)
    same, other = dvr_cli.smooth(twice.points, [(b.type, b.vertices) for b in twice.cells], **options)
    assert moved.tobytes() == same.tobytes()
    assert report.after.q1 == other.after.q1
    assert report.after.mean == other.after.mean
    assert other.mesh.repeated == sum(len(b.vertices) for b in twice.cells[len(once.cells) :]) > 0
    assert report.mesh.repeated == 0


def test_each_copy_has_its_quality_in_the_field():
    mesh = with_repetition(random_mesh("triangle", 0), 1)
    domain = domain_of(mesh)
    first, again = cell_field(mesh, measure(domain, mesh.points, np.flatnonzero(domain.interior)).elements)
    of = {frozenset(v): q for v, q in zip(mesh.cells[0].vertices.tolist(), first, strict=True)}
    assert [of[frozenset(v)] for v in mesh.cells[1].vertices.tolist()] == again.tolist()


def test_cells_given_again_in_another_region_are_a_region():
    region = np.array([0, 0, 1, 1, 2, 2, 0])
    #                        cell 1 again in region 2, cell 2 again in its own, cell 0 in its own
    repeated, original = np.array([4, 5, 6]), np.array([1, 1, 0])
    shared = shared_regions(region, repeated, original)[:4]
    assert (shared[:, None] == shared).tolist() == [
        [True, False, False, False],
        [False, True, False, False],
        [False, False, True, True],
        [False, False, True, True],
    ]


def test_points_in_no_cell_are_counted():
    mesh = random_mesh("tetra", 0)
    points = np.concatenate([mesh.points, np.zeros((3, 3))])
    report = dvr_cli.quality_report(points, [(b.type, b.vertices) for b in mesh.cells])
    assert report.mesh.orphans == 3
    assert dvr_cli.quality_report(mesh.points, [(b.type, b.vertices) for b in mesh.cells]).mesh.orphans == 0
