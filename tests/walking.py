"""Engines whose vertices walk on surfaces, and what other libraries say of where they came."""

from __future__ import annotations

import numpy as np
import trimesh

from curved_parts import skin, wavy
from dvr_cli.api.boundary import moves_of
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.vector import ring_minima
from dvr_cli.relax.directions import random_field
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.steepest import NARROWING, OPTIMAL, STEEPEST

WEIGHTS = np.array([w for w in np.ndindex(5, 5, 5) if sum(w) == 4]) / 4


def walkers(mesh: Mesh, limit: float, angle: float = 60.0) -> tuple[Engine, object]:
    """An engine at the input of a surface, and the domain."""
    domain = domain_of(mesh)
    moves = moves_of(mesh, domain, "project", np.ones(len(mesh.points), dtype=bool), angle)
    problem = build_problem(domain.corners, moves.relaxed, domain.points, parts=moves.parts)
    engine = NumpyEngine(problem.keeping_within(limit))
    engine.load(domain.points)
    return engine, domain


def vector_of(engine: Engine, domain) -> np.ndarray:
    """The quality vector over all relaxed vertices, computed without the engine."""
    qualities = corner_qualities(engine.points, domain.corners)
    return np.sort(ring_minima(qualities, domain.corners, len(engine.points))[engine.problem.relaxed])


def nearest(triangles: np.ndarray, queries: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distance of each query to the nearest of all triangles, and that triangle, by trimesh."""
    distance, which = [], []
    for some in np.array_split(queries, 1 + len(queries) * len(triangles) // 100_000):
        each = np.repeat(some, len(triangles), axis=0)
        feet = trimesh.triangles.closest_point(np.tile(triangles, (len(some), 1, 1)), each)
        away = np.linalg.norm(feet - each, axis=1).reshape(len(some), -1)
        which.append(away.argmin(axis=1))
        distance.append(away.min(axis=1))
    return np.concatenate(distance), np.concatenate(which)


def within(before: np.ndarray, after: np.ndarray) -> float:
    """The largest distance of two states of triangles (n, 3, 3), at dense samples of both, by trimesh."""
    largest = 0.0
    for here, there in ((before, after), (after, before)):
        samples = np.einsum("sk,fkd->fsd", WEIGHTS, here).reshape(-1, 3)
        largest = max(largest, nearest(there, samples)[0].max())
    return largest


def uprightness(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """(n,) positive where a triangle, moved to ``points``, is upright on the facet below its middle."""
    triangles = mesh.cells[0].vertices
    p, q, r = mesh.points[triangles].swapaxes(0, 1)
    normals = np.cross(q - p, r - p)
    a, b, c = points[triangles].swapaxes(0, 1)
    below = nearest(mesh.points[triangles], (a + b + c) / 3)[1]
    return (np.cross(b - a, c - a) * normals[below]).sum(axis=1)


def sides(mesh: Mesh, points: np.ndarray, walking: np.ndarray) -> np.ndarray:
    """(n,) the least cosine of each boundary triangle of a volume, moved to ``points``, and the input there.

    That is at each of its vertices that are among ``walking``; where several triangles of the input meet
    there, the one that is most like it counts.
    """
    facets = skin(mesh)
    before, after = mesh.points[facets], points[facets]
    normals = [np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]) for at in (before, after)]
    was, now = (n / np.linalg.norm(n, axis=1)[:, None] for n in normals)
    cosine = np.ones(len(facets))
    for vertex in walking:
        place = np.tile(points[vertex], (len(facets), 1))
        away = np.linalg.norm(trimesh.triangles.closest_point(before, place) - place, axis=1)
        here, around = away < 1e-11, (facets == vertex).any(axis=1)
        cosine[around] = np.minimum(cosine[around], (now[around] @ was[here].T).max(axis=1))
    return cosine


def hosts(standing) -> dict[int, int]:
    """The triangle that answers for each place of the input; AssertionError where several do."""
    found: dict[int, int] = {}
    for triangle, place in enumerate(standing.first.tolist()):
        while place >= 0:
            assert place not in found
            found[place] = triangle
            place = standing.following[place]
    return found


def steps(engine: Engine, domain, kind: str):
    """Do a sweep, batch by batch."""
    field = random_field(3, 1)
    ascent = {"steepest": STEEPEST, "narrowing": NARROWING, "optimal": OPTIMAL}.get(kind)
    directions = ascent or field(0, engine.relaxed_points, engine.problem.relaxed)
    for batch in range(engine.batches):
        yield engine.move_batch(batch, directions)


SURFACES = {
    "wavy": lambda: wavy(4, 0),
    "with a crease": lambda: wavy(4, 0, crease=True),
    "with a slit": lambda: wavy(4, 0, slit=True),
    "three sheets": lambda: wavy(3, 0, fin=True),
}
