"""Walks on the input's facets: vertices stay on them, the ring gets better, the mesh stays near the input."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from curved_parts import scanned, wavy
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.badness import badness_of
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.vector import at_least
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.steepest import NARROWING, STEEPEST
from dvr_cli.relax.surface.overlay import renew
from walking import SURFACES, hosts, nearest, steps, uprightness, vector_of, walkers

KINDS = ("random", "steepest", "narrowing", "optimal")
USUAL = set(zip(SURFACES, KINDS, strict=True))


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        pytest.param(*pair, marks=[] if pair in USUAL else pytest.mark.long)
        for pair in product(SURFACES, KINDS)
    ],
)
def test_the_vector_never_decreases_after_any_batch(name, kind):
    mesh = SURFACES[name]()
    engine, domain = walkers(mesh, 0.05, 40.0)
    last, moved = vector_of(engine, domain), 0
    for number in steps(engine, domain, kind):
        vector = vector_of(engine, domain)
        assert at_least(vector, last)
        last, moved = vector, moved + number
    assert moved > 0


@pytest.mark.parametrize("name", SURFACES)
def test_vertices_stay_on_the_facets_and_the_mesh_within_the_limit(name):
    """By another library: nearest points of vertices, and of dense samples from both sides."""
    mesh = SURFACES[name]()
    limit = 0.02
    engine, domain = walkers(mesh, limit, 40.0)
    for kind in ("random", "steepest"):
        list(steps(engine, domain, kind))
    points = engine.points
    moved = (points != mesh.points).any(axis=1)
    assert moved.sum() > 4
    triangles = mesh.cells[0].vertices
    before, after = mesh.points[triangles], points[triangles]
    assert nearest(before, points[moved])[0].max() < 1e-14
    weights = np.array([w for w in np.ndindex(5, 5, 5) if sum(w) == 4]) / 4
    for here, there in ((before, after), (after, before)):
        samples = np.einsum("sk,fkd->fsd", weights, here).reshape(-1, 3)
        assert nearest(there, samples)[0].max() <= limit
    assert engine.deviation() <= limit


def test_renewed_places_are_with_the_triangle_that_is_nearest():
    """By another library: each place of an input vertex is in one chain, its bound is its distance."""
    engine, domain = walkers(wavy(5, 2), 0.05)
    for _ in range(3):
        list(steps(engine, domain, "steepest"))
    carriers, standing = engine.problem.carriers, engine.state()[1]
    before, walks = standing.apart.copy(), carriers.on_surface
    renew(engine.coordinates, carriers.ground, carriers.stars, standing)
    assert sorted(hosts(standing)) == sorted(walks.tolist())
    away, _ = nearest(engine.coordinates[carriers.ground.triangles], carriers.ground.places[walks])
    assert standing.apart[walks] == pytest.approx(away, abs=1e-12)
    assert (standing.apart <= before).all()
    assert standing.apart[walks].sum() < 0.9 * before[walks].sum()


def test_no_triangle_turns_over():
    """Against the normals of the input's facets nearest to its vertices."""
    mesh = wavy(6, 3)
    engine, domain = walkers(mesh, 0.1)
    for _ in range(3):
        list(steps(engine, domain, "random"))
    assert (uprightness(mesh, engine.points) > 0).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_end_of_a_walk_is_the_best_place_along_the_polyline(seed):
    """Against looking at places close together along the geodesic that the walk follows.

    On a surface that is bent about one axis only a geodesic is known: it is straight on the surface unrolled.
    """
    rng = np.random.default_rng(seed)
    engine, mesh, centre, rolled = _roof(rng)
    direction = rng.standard_normal(2)
    direction /= np.linalg.norm(direction)
    around = [cell for cell in mesh.cells[0].vertices if centre in cell]

    def least(place):
        points = mesh.points.copy()
        points[centre] = place
        a, b, c = points[around].swapaxes(0, 1)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        squares = sum(((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a)))
        return (2 * np.sqrt(3) * area / squares).min()

    row = int(np.flatnonzero(engine.problem.relaxed == centre)[0])
    directions = np.zeros((len(engine.problem.relaxed), 3))
    directions[row] = [direction[0], *(direction[1] * np.array([1.0, 0.0]))]
    batch = int(np.searchsorted(engine.problem.batch_start, row, side="right")) - 1
    engine.relax_batch(batch, directions)
    reached = engine.points[centre]
    flat = rolled.to_flat(reached) - rolled.to_flat(mesh.points[centre])
    length = np.linalg.norm(flat)
    assert length > 0.01
    along = flat / length
    best = max(
        (least(rolled.to_space(rolled.to_flat(mesh.points[centre]) + t * along)), t)
        for t in np.linspace(0, 0.6, 6001)
    )
    # each piece's determinants are linear by the normals at its beginning: no more than that is lost
    assert least(reached) >= best[0] * (1 - 2e-3)


class _Rolled:
    """The surface z = slope |x|, and the plane it is when it is unrolled."""

    def __init__(self, slope: float) -> None:
        self.stretch, self.slope = np.hypot(1.0, slope), slope

    def to_flat(self, place: np.ndarray) -> np.ndarray:
        return np.array([place[0] * self.stretch, place[1]])

    def to_space(self, flat: np.ndarray) -> np.ndarray:
        x = flat[0] / self.stretch
        return np.array([x, flat[1], self.slope * abs(x)])


def _roof(rng):
    """A fan of triangles around one vertex on one side of a blunt ridge, which walks may cross."""
    rolled = _Rolled(0.2)
    x, y = np.meshgrid([-1.0, 0.0, 1.0], [-1.0, -0.3, 0.3, 1.0], indexing="ij")
    flat = np.column_stack([x.ravel(), y.ravel()])
    flat = np.vstack(
        [flat, [[0.55, 0.62], [-0.5, 0.0], [0.5, 0.0], [0.5, -0.65], [-0.5, 0.65], [-0.5, -0.65]]]
    )
    points = np.array([[a, b, rolled.slope * abs(a)] for a, b in flat])
    halves = []
    for side in (-1, 1):
        here = np.flatnonzero(side * flat[:, 0] >= 0)
        halves.append(here[Delaunay(flat[here]).simplices])
    cells = np.concatenate(halves)
    a, b, c = flat[cells].swapaxes(0, 1)
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    cells = cells[np.abs(area) > 1e-9]
    a, b, c = flat[cells].swapaxes(0, 1)
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    cells[area < 0] = cells[area < 0][:, [0, 2, 1]]
    mesh = Mesh(points, [Cells("triangle", cells)])
    engine, _ = walkers(mesh, np.inf, 60.0)
    return engine, mesh, 12, rolled


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(["plain", "crease", "slit", "fin", "degenerate"]))
def test_nothing_breaks_whatever_the_surface(seed, kind):
    """Features, borders, slits, three sheets at an edge, facets of no area: never worse, no NaN."""
    mesh = wavy(3, seed, **({kind: True} if kind != "plain" else {}))
    engine, domain = walkers(mesh, 0.05, 35.0)
    last = vector_of(engine, domain)
    for number in (*steps(engine, domain, "random"), *steps(engine, domain, "steepest")):
        assert number >= 0
    points = engine.points
    assert np.isfinite(points).all()
    assert at_least(vector_of(engine, domain), last)
    assert engine.deviation() <= 0.05
    limit = badness_of(max(float(engine.qualities().min()), 1e-3), 2)
    floor = min(float(engine.qualities().min()), 1e-3)
    for batch in range(engine.batches):
        engine.polish_batch(batch, limit)
    assert np.isfinite(engine.points).all()
    assert engine.qualities().min() >= floor * (1 - 1e-12)


def test_scanned_noise_is_walked_on_far_from_the_origin():
    mesh = scanned(6)
    far = Mesh(mesh.points + 1e4, mesh.cells)
    engine, domain = walkers(far, 0.05)
    last = vector_of(engine, domain)
    assert sum(steps(engine, domain, "random")) > 5
    assert at_least(vector_of(engine, domain), last)


@pytest.mark.parametrize("ascent", [STEEPEST, NARROWING])
def test_only_active_rings_are_moved(ascent):
    engine, domain = walkers(wavy(2, 3), 0.05)
    active = np.zeros(len(engine.problem.rings.vertices), dtype=bool)
    active[::3] = True
    for batch in range(engine.batches):
        engine.move_batch(batch, ascent, active)
    moved = np.flatnonzero((engine.points != domain.points).any(axis=1))
    allowed = engine.problem.order[engine.problem.rings.vertices[active]]
    assert len(moved)
    assert np.isin(moved, allowed).all()


@pytest.mark.parametrize("aim", [Aim(), Aim(0.6), Aim(0.6, stretch=1.7), Aim(0.6, by_ring=True, stretch=1.7)])
def test_the_price_falls_with_each_batch_and_the_floor_holds(aim):
    engine, domain = walkers(scanned(6), 0.05)
    inverse = 1.0 / corner_qualities(engine.points, domain.corners)
    floor = 0.999 / inverse.max()
    before, began = (inverse + inverse * (aim.level * inverse) ** 16 / 17).sum(), inverse.sum()
    for batch in range(engine.batches):
        engine.polish_batch(batch, badness_of(floor, 2), aim)
        inverse = 1.0 / corner_qualities(engine.points, domain.corners)
        after = (inverse + inverse * (aim.level * inverse) ** 16 / 17).sum()
        assert after <= before
        assert inverse.min() >= 1.0
        assert 1.0 / inverse.max() >= floor
        before = after
    assert inverse.sum() < began
