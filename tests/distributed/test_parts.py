"""Parts of a problem: together they are the whole, and each has all that its vertices need."""

import numpy as np
import pytest

from dvr_cli.api.shapes import shaped
from dvr_cli.distributed.parts import Partition
from dvr_cli.distributed.patches import alone, shares
from dvr_cli.mesh.domain import domain_of
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.relax.patches.neighbourhoods import Neighbourhoods
from dvr_cli.relax.patches.solver import Patch, solve_patch
from dvr_cli.relax.problem import build_problem
from meshes import random_freedom, random_mesh, random_tensors


def problem_of(kind, order="coloured"):
    domain = domain_of(random_mesh(kind, 2))
    freedom = random_freedom(domain, 1)
    return build_problem(domain.corners, freedom.relaxed, domain.points, order, freedom=freedom), domain


def entries(problem, ring):
    return slice(*problem.rings.start[ring : ring + 2])


def norms(problem):
    """The row of the shape table of each entry of a ring."""
    return problem.touched.table.norm[problem.rings.shapes]


def batch_of(problem, ring):
    return np.searchsorted(problem.batch_start, ring, side="right")


def owners_of(problem, ranks, scattered):
    """None, or owners without any order."""
    if not scattered:
        return None
    return np.random.default_rng(ranks).integers(ranks, size=len(problem.rings.vertices))


@pytest.mark.parametrize("scattered", [False, True])
@pytest.mark.parametrize("ranks", [1, 2, 3, 5, 40])
@pytest.mark.parametrize("kind", ["triangle", "tetra", "mixed3d"])
def test_each_ring_and_each_touched_corner_is_in_one_part(kind, ranks, scattered):
    problem, domain = problem_of(kind)
    points = domain.points[problem.order]
    partition = Partition(problem, ranks, owners_of(problem, ranks, scattered))
    rings = np.concatenate([partition.place(rank).rings for rank in range(ranks)])
    assert sorted(rings) == list(range(len(problem.rings.vertices)))
    firsts = np.concatenate([partition.place(rank).firsts for rank in range(ranks)])
    assert sorted(firsts) == list(range(len(problem.touched.vertices)))
    for rank in range(ranks):
        place, part = partition.place(rank), partition.part(rank)
        local, here = part.problem, place.vertices
        assert (np.diff(here) > 0).all()
        assert local.order.tolist() == problem.order[here].tolist()
        np.testing.assert_array_equal(here[local.rings.vertices], problem.rings.vertices[place.rings])
        for mine, theirs in enumerate(place.rings):
            one, other = entries(local, mine), entries(problem, theirs)
            assert here[local.rings.others[one]].tolist() == problem.rings.others[other].tolist()
            assert norms(local)[one].tolist() == norms(problem)[other].tolist()
            assert batch_of(local, mine) == batch_of(problem, theirs)
        assert local.freedom.axis.tolist() == problem.freedom.axis[place.rings].tolist()
        qualities = corner_qualities(points, problem.touched)[part.corners]
        assert corner_qualities(points[here], local.touched).tobytes() == qualities.tobytes()
        assert part.corners[part.first].tolist() == place.firsts.tolist()


@pytest.mark.parametrize("scattered", [False, True])
@pytest.mark.parametrize("ranks", [2, 3, 40])
def test_what_one_sends_in_a_batch_is_what_another_lacks(ranks, scattered):
    problem, _ = problem_of("tetra")
    partition = Partition(problem, ranks, owners_of(problem, ranks, scattered))
    parts = [partition.part(rank) for rank in range(ranks)]
    for rank, part in enumerate(parts):
        here, rings = partition.place(rank).vertices, part.problem.rings
        relaxed = np.isin(here, problem.rings.vertices)
        ghosts = set(np.flatnonzero(relaxed).tolist()) - set(rings.vertices.tolist())
        received = [int(vertex) for shared in part.received for vertex in shared.vertices]
        assert sorted(received) == sorted(ghosts)
        for shared in part.received:
            (answer,) = [one for one in parts[shared.rank].sent if one.rank == rank]
            there = partition.place(shared.rank).vertices
            for batch in range(len(problem.batch_start) - 1):
                lo, hi = problem.batch_start[batch : batch + 2]
                asked = here[shared.of(batch)]
                assert asked.tolist() == there[answer.of(batch)].tolist()
                assert np.isin(asked, problem.rings.vertices[lo:hi]).all()


def test_parts_have_as_many_vertices_but_for_one():
    problem, _ = problem_of("tetra")
    partition = Partition(problem, 3)
    sizes = [len(partition.place(rank).rings) for rank in range(3)]
    assert sum(sizes) == len(problem.rings.vertices)
    assert max(sizes) - min(sizes) <= 1


@pytest.mark.parametrize("metric", [False, True])
@pytest.mark.parametrize("kind", ["triangle", "tetra"])
def test_a_patch_alone_is_solved_with_the_same_bits(kind, metric):
    """In two dimensions and three, with lines and planes, and in a metric."""
    domain = domain_of(random_mesh(kind, 2, noise=0.4))
    if metric:
        tensors = random_tensors(len(domain.points), domain.dimension, 1)
        domain = shaped(domain, "auto", tensors).domain
    freedom = random_freedom(domain, 1)
    problem = build_problem(domain.corners, freedom.relaxed, domain.points, freedom=freedom)
    points = domain.points[problem.order]
    worst = np.argsort(corner_qualities(points, problem.touched), kind="stable")
    patches = Neighbourhoods(problem).choose(worst, np.ones(len(worst), dtype=np.int64))
    dimension, axis = np.full(len(points), domain.dimension, np.uint8), np.zeros_like(points)
    dimension[problem.rings.vertices] = problem.freedom.dimension
    axis[problem.rings.vertices] = problem.freedom.axis
    table, moved = problem.touched.table, 0
    for number in range(len(patches)):
        freed, vertices, shapes = patches.of(number)
        slot = np.full(len(points), -1, dtype=np.int32)
        slot[freed] = np.arange(len(freed))
        rules = table.norm, table.factor, dimension, axis
        own = Patch(freed, vertices, shapes, slot, *rules, enough=0.0, bearable=np.inf, altitude=0.0)
        apart, patch = alone(points, own)
        assert len(apart) <= len(points)
        badness = solve_patch(apart, patch)
        assert badness == solve_patch(points, own)
        assert apart[patch.moving].tobytes() == points[freed].tobytes()
        moved += badness[1] < badness[0]
    assert moved


def test_shares_are_of_like_size():
    sizes = np.random.default_rng(1).integers(20, 400, size=32)
    empty = Patch._make([None] * len(Patch._fields))
    patches = [empty._replace(vertices=np.empty((size, 4))) for size in sizes]
    mine = shares(patches, 5)
    assert sorted(number for numbers in mine for number in numbers) == list(range(32))
    work = [sizes[numbers].sum() for numbers in mine]
    assert max(work) - min(work) <= sizes.max()
    assert shares(patches[:2], 5)[2:] == [[], [], []]
