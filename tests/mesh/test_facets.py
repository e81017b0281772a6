"""Facets against brute force: Python sets, and the ideal elements as convex bodies."""

from collections import defaultdict
from itertools import combinations, pairwise

import numpy as np
import pytest

import oracle
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.facets import facets_of
from dvr_cli.mesh.mesh import Cells
from meshes import KINDS, random_mesh


def sides(cell_type):
    """The facets of an ideal element as frozensets: the planes with all vertices on one side of them."""
    ideal = np.array(oracle.IDEAL[cell_type])
    found = set()
    for chosen in combinations(range(len(ideal)), ideal.shape[1]):
        plane = ideal[list(chosen)]
        edges = plane[1:] - plane[0]
        normal = np.array([-edges[0][1], edges[0][0]]) if len(edges) == 1 else np.cross(*edges)
        height = (ideal - plane[0]) @ normal
        if normal.any() and ((height > -1e-9).all() or (height < 1e-9).all()):
            found.add(frozenset(np.flatnonzero(np.abs(height) < 1e-9).tolist()))
    return found


@pytest.mark.parametrize("cell_type", oracle.IDEAL)
def test_facets_are_the_sides_of_the_ideal_element(cell_type):
    assert len(CELL_TYPES[cell_type].facets) == len(sides(cell_type))
    assert {frozenset(facet) for facet in CELL_TYPES[cell_type].facets} == sides(cell_type)


@pytest.mark.parametrize("cell_type", oracle.IDEAL)
def test_facets_run_in_positive_order(cell_type):
    """Edges counterclockwise; faces such that every three successive vertices turn outward."""
    ideal = np.array(oracle.IDEAL[cell_type])
    centre = ideal.mean(axis=0)
    for facet in CELL_TYPES[cell_type].facets:
        for i in range(len(facet) if len(facet) > 2 else 1):
            here = np.roll(facet, -i)[: len(centre)]
            assert np.linalg.det(ideal[here] - centre) > 0


@pytest.mark.parametrize("cell_type", [name for name in oracle.IDEAL if len(oracle.IDEAL[name][0]) == 3])
def test_each_edge_runs_both_ways_through_the_facets(cell_type):
    edges = [edge for facet in CELL_TYPES[cell_type].facets for edge in pairwise([*facet, facet[0]])]
    assert len(set(edges)) == len(edges)
    assert {(b, a) for a, b in edges} == set(edges)


def brute_force(blocks):
    """{vertices of a facet: cells that have it}."""
    found, cell = defaultdict(list), 0
    for block in blocks:
        for vertices in block.vertices.tolist():
            for side in sides(block.type):
                found[frozenset(vertices[i] for i in side)].append(cell)
            cell += 1
    return found


def as_dict(facets):
    """The same from Facets; a group in which not all facets have the same vertices is an error."""
    found = {}
    for lo, hi in pairwise(facets.start.tolist()):
        (key,) = {frozenset(v for v in row if v >= 0) for row in facets.vertices[lo:hi].tolist()}
        assert key not in found
        found[key] = sorted(facets.cell[lo:hi].tolist())
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_equal_facets_are_found(kind):
    mesh = random_mesh(kind, 4)
    facets = facets_of(mesh.cells)
    expected = brute_force(mesh.cells)
    assert as_dict(facets) == expected
    assert sorted(facets.shared_by.tolist()) == sorted(len(cells) for cells in expected.values())
    assert set(facets.shared_by.tolist()) == {1, 2}


@pytest.mark.parametrize("kind", KINDS)
def test_each_facet_is_stored_as_its_cell_has_it(kind):
    mesh = random_mesh(kind, 4)
    facets = facets_of(mesh.cells)
    cells = [(block.type, vertices) for block in mesh.cells for vertices in block.vertices.tolist()]
    seen = defaultdict(set)
    for row, cell in zip(facets.vertices.tolist(), facets.cell.tolist(), strict=True):
        seen[cell].add(tuple(v for v in row if v >= 0))
    for cell, (cell_type, vertices) in enumerate(cells):
        assert seen[cell] == {tuple(vertices[i] for i in facet) for facet in CELL_TYPES[cell_type].facets}


def test_any_number_of_cells_may_share_a_facet():
    rng = np.random.default_rng(0)
    triangles = np.array([rng.choice(7, 3, replace=False) for _ in range(60)])
    facets = facets_of([Cells("triangle", triangles)])
    assert as_dict(facets) == brute_force([Cells("triangle", triangles)])
    assert facets.shared_by.max() > 3


def test_vertex_numbers_may_be_as_large_as_they_get():
    """Four vertices of 31 bits do not fit one sorting key."""
    mesh = random_mesh("hexahedron", 1)
    offset = 2**31 - 1 - len(mesh.points)
    near = facets_of(mesh.cells)
    far = facets_of([Cells("hexahedron", mesh.cells[0].vertices + offset)])
    shifted = {frozenset(v + offset for v in key): cells for key, cells in as_dict(near).items()}
    assert as_dict(far) == shifted


@pytest.mark.parametrize("blocks", [[], [Cells("tetra", np.empty((0, 4), dtype=np.int64))]])
def test_no_cells_have_no_facets(blocks):
    facets = facets_of(blocks)
    assert len(facets.vertices) == len(facets.cell) == len(facets.shared_by) == 0
