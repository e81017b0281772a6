"""The schedule: independent batches that together are I_R, in the sequence each order promises."""

from itertools import combinations, pairwise

import numpy as np
import pytest

from dvr_cli.backend import COMPILED, NUMPY
from dvr_cli.mesh.corners import corners_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells
from dvr_cli.mesh.rings import incidence_of
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.schedule import ORDERS, _scattered, batches, colour_ready, colours
from meshes import KINDS, delaunay, random_mesh
from needs import require


def incidence_of_mesh(mesh, seed=0):
    """The incidence of the interior vertices, in random order."""
    domain = domain_of(mesh)
    relaxed = np.random.default_rng(seed).permutation(np.flatnonzero(domain.interior))
    return incidence_of(domain.corners, relaxed, len(mesh.points))


def incidence_of_graph(adjacent):
    """Triangles with a common, fixed vertex, one for each edge of the graph."""
    m = len(adjacent)
    triangles = np.column_stack([*np.nonzero(np.triu(adjacent)), np.full(np.triu(adjacent).sum(), m)])
    corners = corners_of([Cells("triangle", triangles)], 2)
    return incidence_of(corners, np.arange(m), m + 1)


def random_graph(m, density, seed=0):
    upper = np.triu(np.random.default_rng(seed).random((m, m)) < density, 1)
    return upper | upper.T


def neighbours(incidence):
    """For each vertex the others it shares a corner with."""
    found = [set() for _ in incidence.vertices]
    for corner in incidence.members.tolist():
        here = {i for i in corner if i >= 0}
        for i in here:
            found[i] |= here - {i}
    return found


def batch_of(parts, m):
    """The number of the batch of each ring; each ring is in exactly one."""
    assert sorted(np.concatenate(parts).tolist()) == list(range(m))
    number = np.empty(m, dtype=int)
    for b, part in enumerate(parts):
        number[part] = b
    return number.tolist()


def levels(adjacent, sequence):
    """One by one in the given sequence, each is put right after the last of its neighbours so far."""
    level = {}
    for i in sequence:
        level[i] = 1 + max((level[j] for j in adjacent[i] if j in level), default=-1)
    return [level[i] for i in range(len(adjacent))]


def greedy(adjacent, sequence):
    """One by one in the given sequence, each takes the first colour that no neighbour has yet."""
    colour = {}
    for i in sequence:
        taken = {colour[j] for j in adjacent[i] if j in colour}
        colour[i] = next(c for c in range(len(adjacent) + 1) if c not in taken)
    return [colour[i] for i in range(len(adjacent))]


CLIQUE = ~np.eye(130, dtype=bool)
GRAPHS = {
    "none": np.zeros((50, 50), dtype=bool),
    "path": np.eye(200, k=1, dtype=bool) | np.eye(200, k=-1, dtype=bool),
    "sparse": random_graph(400, 0.01),
    "medium": random_graph(200, 0.3),
    "dense": random_graph(300, 0.9),
    "clique of 62": CLIQUE[:62, :62],
    "clique of 63": CLIQUE[:63, :63],
    "clique of 130": CLIQUE,
}
PROBLEMS = {
    **{kind: incidence_of_mesh(random_mesh(kind, 1, n=6 if kind == "triangle" else 4)) for kind in KINDS},
    "delaunay 2D": incidence_of_mesh(delaunay(400, 2, 0)),
    "delaunay 3D": incidence_of_mesh(delaunay(200, 3, 0)),
    **{name: incidence_of_graph(graph) for name, graph in GRAPHS.items()},
}


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", PROBLEMS)
def test_vertices_of_a_batch_share_no_corner(name, order):
    incidence = PROBLEMS[name]
    parts = batches(incidence, order, 0)
    adjacent = neighbours(incidence)
    batch_of(parts, len(incidence.vertices))  # all of I_R, each once
    for part in parts:
        members = set(part.tolist())
        assert members
        assert all(adjacent[i].isdisjoint(members) for i in members)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", PROBLEMS)
def test_positions_ascend_within_a_batch(name, order):
    incidence = PROBLEMS[name]
    for part in batches(incidence, order, 0):
        assert (np.diff(part) > 0).all()


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", PROBLEMS)
def test_the_compiled_schedule_is_the_same(name, order):
    require("numba")
    incidence = PROBLEMS[name]
    plain, compiled = (batches(incidence, order, 5, backend) for backend in (NUMPY, COMPILED))
    assert [part.tolist() for part in compiled] == [part.tolist() for part in plain]


@pytest.mark.parametrize("name", PROBLEMS)
def test_colours_are_those_of_a_sequential_greedy_colouring(name):
    incidence = PROBLEMS[name]
    m = len(incidence.vertices)
    expected = greedy(neighbours(incidence), _scattered(m).tolist())
    assert batch_of(batches(incidence, "coloured", 0), m) == expected


def test_there_are_graphs_among_these_with_more_colours_than_bits():
    counts = {name: len(batches(PROBLEMS[name], "coloured", 0)) for name in PROBLEMS}
    assert counts["none"] == 1
    assert counts["path"] <= 3
    assert [counts[f"clique of {m}"] for m in (62, 63, 130)] == [62, 63, 130]
    assert counts["dense"] > 64


def test_a_mesh_in_which_all_relaxed_vertices_share_a_corner():
    """70 vertices, each two of them in a triangle with a fixed one: one after the other is all there is."""
    triangles = np.array([(i, j, 70) for i, j in combinations(range(70), 2)])
    incidence = incidence_of(corners_of([Cells("triangle", triangles)], 2), np.arange(70), 71)
    for order in ORDERS:
        assert len(batches(incidence, order, 0)) == 70
    assert np.concatenate(batches(incidence, "natural", 0)).tolist() == list(range(70))


@pytest.mark.parametrize("name", PROBLEMS)
def test_natural_order_is_that_of_the_relaxed_vertices(name):
    """Level sets: of two that share a corner the earlier in I_R comes first, and none waits without need."""
    incidence = PROBLEMS[name]
    m = len(incidence.vertices)
    adjacent = neighbours(incidence)
    number = batch_of(batches(incidence, "natural", 0), m)
    assert all(number[i] < number[j] for j in range(m) for i in adjacent[j] if i < j)
    assert number == levels(adjacent, range(m))


def test_natural_order_does_not_depend_on_the_seed():
    incidence = PROBLEMS["tetra"]
    for order in ("natural", "coloured"):
        one, other = (batches(incidence, order, seed) for seed in (0, 1))
        assert [part.tolist() for part in one] == [part.tolist() for part in other]


@pytest.mark.parametrize("name", ["triangle", "tetra", "mixed3d", "sparse", "clique of 130"])
def test_shuffled_order_is_drawn_from_the_seed(name):
    incidence = PROBLEMS[name]
    m = len(incidence.vertices)
    numbers = [batch_of(batches(incidence, "shuffled", seed), m) for seed in range(5)]
    assert numbers == [batch_of(batches(incidence, "shuffled", seed), m) for seed in range(5)]
    assert len({tuple(number) for number in numbers}) == 5
    assert batch_of(batches(incidence, "natural", 0), m) not in numbers
    adjacent = neighbours(incidence)
    for number in numbers:  # they are the level sets of an order: the one the batches themselves are in
        assert number == levels(adjacent, np.argsort(number, kind="stable").tolist())


def test_shuffled_order_of_a_clique_is_a_uniform_permutation():
    """Nothing can be done at once, so that the batches are the permutation itself."""
    incidence = incidence_of_graph(CLIQUE[:3, :3])
    seen = [tuple(batch_of(batches(incidence, "shuffled", seed), 3)) for seed in range(600)]
    counts = [seen.count(order) for order in set(seen)]
    assert len(counts) == 6
    assert 60 < min(counts) <= max(counts) < 140  # 100 expected; the bounds are 4.4 standard deviations off


def test_seeds_beyond_63_bits_are_seeds_of_their_own():
    incidence = PROBLEMS["delaunay 3D"]
    m = len(incidence.vertices)
    seeds = (0, 1, 2**63 - 1, 2**63, 2**63 + 1, 2**64 - 2, 2**64 - 1)
    assert len({tuple(batch_of(batches(incidence, "shuffled", seed), m)) for seed in seeds}) == len(seeds)


@pytest.mark.parametrize(("dimension", "n", "few"), [(2, 3000, 8), (3, 2000, 14)])
def test_colours_are_few(dimension, n, few):
    """Fewer by far than the level sets of the natural order, hence larger batches."""
    incidence = incidence_of_mesh(delaunay(n, dimension, 0))
    coloured = batches(incidence, "coloured", 0)
    assert len(coloured) <= few
    assert len(batches(incidence, "natural", 0)) > 1.5 * len(coloured)


@pytest.mark.parametrize("order", ORDERS)
def test_nothing_to_relax_needs_no_batch(order):
    mesh = delaunay(10, 2, 0)
    problem = build_problem(domain_of(mesh).corners, np.empty(0, dtype=np.int64), mesh.points, order)
    assert problem.batch_start.tolist() == [0]
    assert len(problem.rings.vertices) == 0


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("kind", KINDS)
def test_problem_stores_the_rings_in_the_order_of_the_batches(kind, order):
    mesh = random_mesh(kind, 1)
    domain = domain_of(mesh)
    relaxed = np.flatnonzero(domain.interior)
    incidence = incidence_of(domain.corners, relaxed, len(mesh.points))
    rings = incidence.rings(domain.corners, np.arange(len(relaxed)))
    problem = build_problem(domain.corners, relaxed, domain.points, order, 3)
    assert problem.dimension == domain.dimension
    assert sorted(problem.order.tolist()) == list(range(len(mesh.points)))
    assert sorted(problem.relaxed.tolist()) == relaxed.tolist()
    own = [sorted(problem.relaxed[lo:hi].tolist()) for lo, hi in pairwise(problem.batch_start)]
    if order != "coloured":  # which is free to number the vertices as it likes
        parts = batches(incidence, order, 3)
        assert own == [sorted(relaxed[part].tolist()) for part in parts]
    for lo, hi in pairwise(problem.batch_start):
        assert (np.diff(problem.rings.vertices[lo:hi]) > 0).all()  # along the curve within a batch
    for vertex, (lo, hi) in zip(problem.relaxed, pairwise(problem.rings.start), strict=True):
        i = int(np.flatnonzero(relaxed == vertex)[0])
        there = slice(rings.start[i], rings.start[i + 1])
        expected = zip(rings.others[there].tolist(), rings.shapes[there].tolist(), strict=True)
        others = problem.order[problem.rings.others[lo:hi]].tolist()
        assert sorted(zip(others, problem.rings.shapes[lo:hi].tolist(), strict=True)) == sorted(expected)


@pytest.mark.parametrize("kind", KINDS)
def test_the_order_of_the_relaxed_vertices_is_that_of_the_natural_schedule(kind):
    mesh = random_mesh(kind, 1, n=4)
    domain = domain_of(mesh)
    relaxed = np.random.default_rng(0).permutation(np.flatnonzero(domain.interior))
    problem = build_problem(domain.corners, relaxed, domain.points, "natural")
    place = {vertex: i for i, vertex in enumerate(relaxed.tolist())}
    visited = {v: i for i, v in enumerate(problem.relaxed.tolist())}
    for corner in domain.corners.vertices.tolist():
        here = [v for v in corner if v in place]
        assert sorted(here, key=place.get) == sorted(here, key=visited.get)


@pytest.mark.parametrize("backend", [NUMPY, COMPILED], ids=lambda backend: backend.suffix or "numpy")
@pytest.mark.parametrize("name", sorted(PROBLEMS.keys() - {"dense"}))  # which takes long
def test_colours_found_as_others_become_known_are_the_same(name, backend):
    """Two halves of the vertices take turns; each learns of the other's colours only between them."""
    if backend is COMPILED:
        require("numba")
    incidence = PROBLEMS[name]
    m = len(incidence.vertices)
    sequence = np.random.default_rng(1).permutation(m)
    turn = np.append(np.empty(m, dtype=np.int64), np.iinfo(np.int64).max)
    turn[sequence] = np.arange(m)
    own, colour = np.arange(m), np.full(m + 1, -1, dtype=np.int64)
    vertices = np.where(incidence.members < 0, m, incidence.members)
    halves = [sequence[sequence % 2 == half] for half in (0, 1)]
    arrays = own, incidence.start, incidence.corner, vertices, turn
    rounds = 0
    while any(map(len, halves)):
        known = colour.copy()
        for half in (0, 1):
            mine = known.copy()
            backend.twin(colour_ready)(halves[half], *arrays, mine)
            colour[halves[half]] = mine[halves[half]]
            halves[half] = halves[half][colour[halves[half]] < 0]
        rounds += 1
    expected = colours(incidence.start, incidence.corner, incidence.members, sequence)
    assert colour[:-1].tolist() == expected.tolist()
    assert rounds > 1 or name in ("none", "path")
