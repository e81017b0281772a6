"""The promises of all phases of a volume whose boundary vertices walk, by oracles of their own."""

from __future__ import annotations

import numpy as np
import pytest

import oracle
from curved_parts import ball, skin, squeezed
from dvr_cli.api.boundary import moves_of
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.phases import Run
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.relax.engines.choice import KINDS
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.patches.phase import relax_patches
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.steepest import STEEPEST
from dvr_cli.relax.stopping import Stopping
from meshes import random_mesh
from needs import require
from walking import nearest, sides, within

ENGINES = ["numpy", pytest.param("numba", marks=pytest.mark.long)]
LIMIT = 0.03


def vector(points, tets, relaxed):
    """The quality vector over the relaxed vertices: the worst mean ratio around each, ascending."""
    worst = np.full(len(points), np.inf)
    for column in tets.T:
        np.minimum.at(worst, column, oracle.mean_ratio(points[tets]))
    return np.sort(worst[relaxed])


def has_not_fallen(after, before, level=np.inf):
    """Whether the first component that differs, and of which one is below the level, has grown."""
    differ = np.flatnonzero((after != before) & (np.minimum(after, before) < level))
    return not len(differ) or after[differ[0]] > before[differ[0]]


def lowest_altitude(points, tets):
    """Thrice the volume over the largest face, of the flattest tetrahedron."""
    corners = points[tets]
    faces = corners[:, [(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)]]
    area = np.linalg.norm(np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0]), axis=2)
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1])
    return (volume / area.max(axis=1)).min()


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("share", [0.1, pytest.param(0.5, marks=pytest.mark.long)])
def test_polishing_never_lowers_the_vector_below_the_level(engine, share):
    """After no batch, be it of vertices that walk."""
    require(engine)
    mesh = ball(1, 2)
    domain, tets = domain_of(mesh), mesh.cells[0].vertices
    moves = moves_of(mesh, domain, "project", np.ones(len(mesh.points), dtype=bool), 60.0)
    how = {"freedom": moves.within, "parts": moves.parts}
    problem = build_problem(domain.corners, moves.relaxed, domain.points, **how).keeping_within(LIMIT)
    made = KINDS[engine].make(problem, 2)
    made.load(domain.points)
    before = vector(made.points, tets, moves.relaxed)
    level = float(np.quantile(before, share))
    for _ in range(2):
        for batch in range(made.batches):
            made.polish_batch(batch, 1 / level**3, Aim(level, relative=True, by_ring=True))
            after = vector(made.points, tets, moves.relaxed)
            assert has_not_fallen(after, before, level)
            before = after
    walked = (made.points != mesh.points).any(axis=1)[moves.parts.walking]
    assert walked.sum() > 3


@pytest.mark.long
@pytest.mark.parametrize("engine", ["numpy", "numba"])
@pytest.mark.parametrize("seed", [1, 2])
def test_each_phase_of_a_run_keeps_what_it_promises(seed, engine, monkeypatch):
    """The vector does not fall in descent, sweeps and patches, nor below the level of care in polishing."""
    require(engine)
    mesh = ball(seed, 2)
    tets, facets, states = mesh.cells[0].vertices, skin(mesh), []

    def noted(name):
        phase = getattr(Run, name)

        def run_phase(run, *args):
            phase(run, *args)
            states.append((name, run.points, run.level, run._moves.relaxed))

        return run_phase

    for name in ("descend", "relax", "relax_patches", "polish"):
        monkeypatch.setattr(Run, name, noted(name))
    options = SmoothOptions(
        boundary="project", max_deviation=LIMIT, feature_angle=60.0, engine=engine, patches=True
    )
    result, report = smooth_mesh(mesh, options)
    assert [name for name, *_ in states] == ["descend", "relax", "relax_patches", "polish"]
    relaxed = states[0][3]
    before = vector(mesh.points, tets, relaxed)
    for name, points, level, _ in states:
        after = vector(points, tets, relaxed)
        assert has_not_fallen(after, before, level if name == "polish" else np.inf)
        assert lowest_altitude(points, tets) >= lowest_altitude(mesh.points, tets)
        assert within(mesh.points[facets], points[facets]) <= LIMIT
        before = after
    walked = np.intersect1d(np.unique(facets), np.flatnonzero((result != mesh.points).any(axis=1)))
    assert len(walked) > 10
    assert nearest(mesh.points[facets], result[walked])[0].max() < 1e-12
    a, b, c = result[facets].swapaxes(0, 1)
    below = nearest(mesh.points[facets], (a + b + c) / 3)[1]
    p, q, r = mesh.points[facets[below]].swapaxes(0, 1)
    assert ((np.cross(b - a, c - a) * np.cross(q - p, r - p)).sum(axis=1) > 0).all()
    assert report.level == states[-1][2] > 0
    assert report.after.mean > report.before.mean + 0.01


def swept(
    mesh: Mesh, limit: float, how: str, engine: str = "numpy", threads: int = 1
) -> tuple[Engine, np.ndarray]:
    """An engine after two sweeps or three rounds of patches on coarse facets, and who walks on surfaces."""
    domain = domain_of(mesh)
    moves = moves_of(mesh, domain, "project", np.ones(len(mesh.points), dtype=bool), 60.0)
    free = {"freedom": moves.within, "parts": moves.parts}
    problem = build_problem(domain.corners, moves.relaxed, domain.points, **free).keeping_within(limit)
    made = KINDS[engine].make(problem, threads)
    made.load(domain.points)
    if how == "patches":
        relax_patches(made, Stopping(3))
    else:
        for batch in 2 * list(range(made.batches)):
            made.move_batch(batch, STEEPEST)
    return made, moves.parts.on_patch


@pytest.mark.parametrize(
    ("how", "seed", "limit"),
    [
        ("patches", 17, 0.3),
        pytest.param("patches", 23, 0.3, marks=pytest.mark.long),
        ("sweeps", 11, 0.1),
        pytest.param("sweeps", 28, 0.1, marks=pytest.mark.long),
    ],
)
def test_no_facet_of_a_boundary_turns_over(how, seed, limit):
    """Against those of the input at its vertices; without the rule one of these balls has such a facet."""
    mesh = squeezed(seed)
    engine, walking = swept(mesh, limit, how)
    moved = (engine.points != mesh.points).any(axis=1)[walking]
    assert moved.sum() > 10
    assert (sides(mesh, engine.points, walking) > 0).all()


@pytest.mark.long
@pytest.mark.parametrize("how", ["patches", "sweeps"])
def test_engines_and_threads_agree_to_the_bit_where_facets_would_turn_over(how):
    require("numba")
    plain, _ = swept(squeezed(17), 0.3, how)
    for threads in (1, 3):
        engine, _ = swept(squeezed(17), 0.3, how, "numba", threads)
        assert engine.points.tobytes() == plain.points.tobytes()


def test_a_sheet_whose_triangles_are_in_any_order_has_them_alike():
    """Each inner edge runs once this way and once that, so sides of facets can be compared along a walk."""
    mesh = random_mesh("tetra", 2, n=4, noise=0.0)
    x, _, z = mesh.points.T
    faces = mesh.cells[0].vertices[:, [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]].reshape(-1, 3)
    sheet = np.unique(np.sort(faces[(z[faces] == 0.5).all(axis=1)], axis=1), axis=0)  # in an order of numbers
    points = mesh.points + np.outer(0.1 * np.sin(4 * x) * np.sin(np.pi * z), [0.0, 0.0, 1.0])
    both = Mesh(points, [*mesh.cells, Cells("triangle", sheet)])
    moves = moves_of(both, domain_of(both), "project", np.ones(len(points), dtype=bool), 60.0)
    triangles = moves.parts.triangles[np.isin(moves.parts.triangles, sheet).all(axis=1)]
    assert len(triangles) == len(sheet) > 10
    edges = np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    assert len(np.unique(edges, axis=0)) == len(edges)
    stored = np.concatenate([sheet[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    assert len(np.unique(stored, axis=0)) < len(stored)
