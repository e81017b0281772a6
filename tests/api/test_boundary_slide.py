"""``--boundary slide``: the boundary takes part, and everything that has a shape keeps it."""

from dataclasses import replace

import numpy as np
import pytest

import dvr_cli
import oracle
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.boundary.constraints import constraints_of
from dvr_cli.boundary.features import features_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.vector import at_least
from dvr_cli.relax.directions import direction_field, restrict_field
from dvr_cli.relax.stopping import Stopping
from gmsh_parts import PARTS, part
from meshes import KINDS, random_mesh
from needs import require
from shapes import area_vector, dimension_of, kept_facets, measures, skins

require("gmsh")

TILT = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
TILT *= np.linalg.det(TILT)


def slid(mesh, sweeps=3, **options):
    stopping = Stopping(max_iterations=sweeps, tol=0)
    return smooth_mesh(mesh, SmoothOptions(boundary="slide", stopping=stopping, **options))


def moved_by(mesh, move):
    return replace(mesh, points=move(mesh.points))


def check(mesh, scale=1.0):
    """Slide a few sweeps and check all that has to hold; returns the points.

    scale: by how much larger than the mesh its coordinates are; distances lose as much accuracy.
    """
    before, facets = mesh.points, kept_facets(mesh)
    sizes = measures(mesh, before)
    d, points = dimension_of(mesh), before
    relaxed = None
    for seed in range(3):
        points, report = slid(moved_by(mesh, lambda _, p=points: p), 2, seed=seed)
        # the same vertices again, although rounding took a hand in where they are now; but where lips of a
        # slit have slid along each other, vertices hang on the other's facets: both stay from then on
        assert relaxed in (None, report.relaxed) or (report.mesh.hanging and report.relaxed < relaxed)
        relaxed = report.relaxed
        assert at_least(report.after.vector, report.before.vector)
        assert report.after.minimum >= report.before.minimum > 0
    for key, size in measures(mesh, points).items():
        assert size == pytest.approx(sizes[key], rel=1e-12 * scale), key
    for facet in facets:
        was = area_vector(before[:, :d], facet)
        assert area_vector(points[:, :d], facet) @ was > 0
        off = (points - before)[list(facet), :d] @ (was / np.linalg.norm(was))
        assert np.abs(off).max() <= 1e-14 * scale
    return points


@pytest.mark.parametrize("name", PARTS)
def test_a_part_keeps_its_shape(name):
    mesh = part(name)
    points = check(mesh)
    on = np.unique([vertex for facet in kept_facets(mesh) for vertex in facet])
    assert (points[on] != mesh.points[on]).any(axis=1).sum() > len(on) / 3


@pytest.mark.parametrize("name", ["cube", "split-face", "embedded", "crack", "slit"])
def test_planes_parallel_to_the_axes_keep_their_coordinate(name):
    mesh = part(name)
    points, _ = slid(mesh)
    for facet in kept_facets(mesh):
        facet = list(facet)
        for axis in range(3):
            value = mesh.points[facet[0], axis]
            if (mesh.points[facet, axis] == value).all():
                assert (points[facet, axis] == value).all()


@pytest.mark.parametrize("name", ["L", "inclusion-and-hole", "split-face", "open-crack"])
def test_a_part_in_general_position_keeps_its_shape(name):
    mesh = moved_by(part(name), lambda x: x @ TILT.T)
    check(mesh, 10)
    assert slid(mesh, 0)[1].relaxed == slid(part(name), 0)[1].relaxed


@pytest.mark.parametrize("name", ["two-materials", "crack", "plate"])
def test_far_from_the_origin(name):
    mesh = part(name)
    check(moved_by(mesh, lambda x: x + np.array([1e6, -2e6, 0])), 3e6)


def test_far_from_the_origin_in_general_position():
    check(moved_by(part("embedded"), lambda x: x @ TILT.T + 1e4), 1e5)


@pytest.mark.parametrize("name", ["slit", "open-crack"])
def test_a_slit_does_not_close_open_or_cross(name):
    """Its faces lie on each other but share only the front; both still cover the same, once."""
    mesh = part(name)
    d = dimension_of(mesh)
    height, depth = (0.4, 0.6) if d == 2 else (0.5, 0.6)
    points, _ = slid(mesh, 10)
    check(mesh)
    faces = {-1: [], 1: []}
    for facet in next(iter(skins(mesh).values())):
        if (mesh.points[list(facet), d - 1] == height).all():
            faces[int(np.sign(area_vector(mesh.points[:, :d], facet)[d - 1]))].append(facet)
    assert len(faces[1]) == len(faces[-1]) > 0
    for sign, face in faces.items():
        vectors = np.array([area_vector(points[:, :d], facet) for facet in face])
        assert (vectors[:, : d - 1] == 0).all()
        assert (sign * vectors[:, d - 1] > 0).all()
        assert abs(vectors[:, d - 1].sum()) == pytest.approx(depth, rel=1e-12)
        used = np.unique(face)
        assert (points[used, d - 1] == height).all()
        assert (points[used, 0].min(), points[used, 0].max()) == (0, depth)
        front = used[mesh.points[used, 0] == depth]
        assert (points[front, 0] == depth).all()
    upper, lower = (np.unique(face) for face in faces.values())
    free = np.setdiff1d(upper, lower)
    assert (points[free] != mesh.points[free]).any()


@pytest.mark.parametrize("name", ["two-materials", "split-face", "slit"])
def test_second_order_cells(name):
    mesh = part(name, order=2)
    points = check(mesh)
    for block in mesh.cells:
        if block.type == "line3" or block.type.startswith("triangle6"):
            ends = points[block.vertices[:, [0, 1]]]
            np.testing.assert_allclose(
                points[block.vertices[:, -1 if block.type == "line3" else 3]], ends.mean(axis=1), atol=1e-14
            )


def test_curved_facets_stay():
    """Round holes of second order: their mid nodes are off the straight edges, which must not move then."""
    mesh = part("plate", order=2)
    bent = Mesh(mesh.points.copy(), mesh.cells, mesh.cell_data)
    edge = next(b for b in mesh.cells if b.type == "line3").vertices[1]
    bent.points[edge[2], 1] -= 0.01
    for mids, moves in ((mesh, True), (bent, False)):
        points, _ = slid(mids, straighten=True)
        assert (points[edge[:2]] != mids.points[edge[:2]]).any() == moves


@pytest.mark.parametrize("name", ["plate", "slit"])
def test_quadrilaterals(name):
    mesh = part(name, quads=True)
    assert any(block.type == "quad" for block in mesh.cells)
    check(mesh)


OTHER_KINDS = [kind for kind in KINDS if kind != "triangle"]


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        *((kind, i) for i, kind in enumerate(OTHER_KINDS)),
        *(pytest.param(kind, seed, marks=pytest.mark.long) for kind in OTHER_KINDS for seed in range(10, 14)),
    ],
)
def test_any_element_type_with_regions(kind, seed):
    """Two materials or one, in space; every other one is tilted."""
    tilted = seed % 2 == 1
    mesh = random_mesh(kind, seed, n=4, noise=0.15)
    rng = np.random.default_rng(seed)
    split = rng.integers(0, 2, 2)
    mesh.cell_data["material"] = [
        (np.arange(len(block.vertices)) * 2 // max(len(block.vertices), 1)) * split[0] for block in mesh.cells
    ]
    if tilted and mesh.points.shape[1] == 3:
        mesh = moved_by(mesh, lambda x: x @ TILT.T)
    check(mesh, 10)


@pytest.mark.parametrize("shift", [0.0, 7.0])
def test_a_planar_mesh_in_any_plane(shift):
    flat = part("plate")
    mesh = moved_by(flat, lambda x: x @ TILT.T + shift)
    points, report = slid(mesh)
    assert report.relaxed == slid(flat, 0)[1].relaxed
    back = (points - shift) @ TILT
    assert np.abs(back[:, 2]).max() < 1e-14 * (1 + shift)
    before, after = (measures(flat, x) for x in (flat.points, back))
    assert all(after[key] == pytest.approx(size, rel=1e-12 * (1 + shift)) for key, size in before.items())


@pytest.mark.parametrize("name", ["open-crack", "plate"])
@pytest.mark.parametrize("order", ["coloured", "natural"])
def test_engines_and_threads_agree(name, order):
    require("numba")
    mesh = moved_by(part(name), lambda x: x @ TILT.T if name == "open-crack" else x)
    runs = [("numpy", None), ("numba", 1), ("numba", 2)]
    first, *others = [slid(mesh, engine=engine, threads=threads, order=order)[0] for engine, threads in runs]
    assert all(np.array_equal(first, other) for other in others)


@pytest.mark.parametrize("name", ["L", "slit", "mixed3d"])
def test_open_rings_against_the_oracle(name):
    """One sweep in the paper's order, with rings that do not close around their vertex."""
    mesh = part(name) if name in PARTS else random_mesh(name, 4, noise=0.15)
    d = dimension_of(mesh)
    domain = domain_of(mesh)
    freedom = features_of(domain.points, domain.interior, constraints_of(mesh, domain)).freedom
    field = restrict_field(direction_field(["random"], domain, {}, seed=3), freedom)
    directions = field(0, domain.points[freedom.relaxed], freedom.relaxed)
    cells = [(block.type, block.vertices) for block in domain.cells]
    expected = oracle.gauss_seidel_sweep(domain.points, cells, freedom.relaxed, directions)
    points, _ = slid(mesh, 1, order="natural", seed=3, directions="random")
    assert (freedom.dimension[freedom.relaxed] < d).sum() > 20
    np.testing.assert_allclose(points[:, :d], expected, atol=1e-6)


@pytest.mark.parametrize("directions", ["axis", "radial,circumferential"])
def test_any_directions(directions):
    mesh = part("two-materials")
    points, report = slid(mesh, directions=directions)
    assert at_least(report.after.vector, report.before.vector)
    before, after = measures(mesh, mesh.points), measures(mesh, points)
    assert all(after[key] == pytest.approx(size, rel=1e-12) for key, size in before.items())


def test_periodic_vertices_stay():
    mesh = part("cube")
    left, right = (np.flatnonzero(mesh.points[:, 0] == x)[:5] for x in (0, 1))
    linked = Mesh(mesh.points, mesh.cells, mesh.cell_data, periodic=np.stack([left, right], axis=1))
    points, _ = slid(linked)
    both = np.concatenate([left, right])
    assert (points[both] == mesh.points[both]).all()
    others = np.setdiff1d(np.flatnonzero(mesh.points[:, 0] == 0), left)
    assert (points[others] != mesh.points[others]).any()


@pytest.mark.parametrize("name", ["cube", "inclusion-and-hole", "slit"])
def test_the_worst_element_gets_better_than_with_a_fixed_boundary(name):
    mesh, stopping = part(name), Stopping(max_iterations=30)
    fixed, slide = (
        smooth_mesh(mesh, SmoothOptions(boundary=boundary, stopping=stopping))[1]
        for boundary in ("fixed", "slide")
    )
    assert slide.relaxed > fixed.relaxed
    if fixed.limited_by is not None and fixed.limited_by.kind == "valence":  # no boundary allows more
        assert slide.after.minimum == pytest.approx(fixed.after.minimum, abs=stopping.tol)
    else:
        assert slide.after.minimum > fixed.after.minimum
    assert slide.record("out", "in")["options"]["boundary"] == "slide"


def test_from_python():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.8, 0.0]])
    triangles = {"triangle": np.array([[0, 4, 3], [4, 2, 3], [4, 1, 2]])}
    assert (dvr_cli.smooth(square, triangles)[0] == square).all()
    moved, _ = dvr_cli.smooth(
        square, triangles, boundary="slide", directions="axis", max_iterations=20, tol=0
    )
    assert moved[4, 1] == 0
    # the two outer triangles are worst and equally bad: right ones with the legs x, 1 and 1 - x, 1
    assert moved[4, 0] == pytest.approx(0.5, abs=1e-6)
