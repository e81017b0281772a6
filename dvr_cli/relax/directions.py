"""Direction fields: the vectors d(k, i) along which vertex i moves in sweep k (paper sections 2.5.4 and 5).

A field is asked once a sweep for the directions of the relaxed vertices. Directions have unit length; a zero
vector leaves its vertex where it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.boundary.freedom import Freedom, unit
from dvr_cli.errors import UsageError
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.simplex import solve
from dvr_cli.mesh.sums import mean
from dvr_cli.quality.metric import factors_at_vertices
from dvr_cli.relax.steepest import NARROWING, OPTIMAL, STEEPEST, Ascent
from dvr_cli.relax.uniform import unit_vectors

# (sweep k from 0, coordinates (n, d) of the relaxed vertices, their indices (n,)) -> (n, d), or how to find
# the directions of a batch when its turn comes
DirectionField = Callable[[int, np.ndarray, np.ndarray], np.ndarray | Ascent]

Entry = str | np.ndarray | tuple[str, np.ndarray]  # a name, an array, an array and its name in messages


@dataclass(frozen=True, eq=False)
class OwnField:
    """A field that needs nothing of a mesh but the vertices it is asked about: any process can be asked.

    work: a function of a module; settings: its first arguments, before those of a field.
    """

    work: Callable[..., np.ndarray]
    settings: tuple[Any, ...]

    def __call__(self, sweep: int, points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        """As any DirectionField."""
        return self.work(*self.settings, sweep, points, vertices)


@dataclass(frozen=True, eq=False)
class Turns:
    """Fields of which each sweep has one, in turn."""

    fields: Sequence[DirectionField]

    def __call__(self, sweep: int, points: np.ndarray, vertices: np.ndarray) -> np.ndarray | Ascent:
        """As any DirectionField."""
        return self.of(sweep)(sweep, points, vertices)

    def of(self, sweep: int) -> DirectionField:
        """The field of a sweep."""
        return self.fields[sweep % len(self.fields)]


@dataclass(frozen=True, eq=False)
class Setting:
    """The mesh and the options that a direction may depend on.

    center: (d,), and axis: (3,) of unit length, None in 2D: in the coordinates of the domain. index: as in
    ``restrict_field``.
    """

    domain: Domain
    seed: int
    center: np.ndarray
    axis: np.ndarray | None
    index: np.ndarray | None = None


@dataclass(frozen=True)
class Direction:
    """A kind of direction that can be asked for by its name.

    fields: the fields it stands for, one a sweep.
    """

    name: str
    fields: Callable[[Setting], Sequence[DirectionField]]


def check_name(name: str) -> None:
    """Raise UsageError unless ``name`` is one of DIRECTIONS or "field:" and something."""
    if name not in DIRECTIONS and not name.startswith("field:"):
        known = ", ".join(DIRECTIONS)
        raise UsageError(f"directions: unknown name {name!r}; known: {known}, file:PATH, field:NAME")


def restrict_field(
    field: DirectionField, freedom: Freedom, index: np.ndarray | None = None
) -> DirectionField:
    """The part of a field that each vertex is free to follow, of unit length, or zero where there is none.

    index: (N,) ascending, by which the field is asked about each vertex of ``freedom``; None for its number.
    """
    if not freedom.axis.any():
        return field

    def inside(sweep: int, points: np.ndarray, vertices: np.ndarray) -> np.ndarray | Ascent:
        directions = field(sweep, points, vertices)
        if isinstance(directions, Ascent):  # the engine keeps to the problem's freedom
            return directions
        return freedom.directions(directions, vertices if index is None else np.searchsorted(index, vertices))

    return inside


def random_field(
    dimension: int,
    seed: int,
    factor: np.ndarray | None = None,
    backend: Backend = NUMPY,
    index: np.ndarray | None = None,
) -> DirectionField:
    """Directions drawn uniformly anew for each vertex and sweep, by a generator keyed (seed, sweep, vertex).

    factor: (N, d(d+1)/2) for each vertex the L of a metric, through which they are uniform. backend: what
    computes; the result is the same. index: as in ``restrict_field``.
    """
    drawn = OwnField(_drawn, (dimension, np.uint64(seed), backend))
    if factor is None:
        return drawn

    def through(sweep: int, points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        vectors = drawn(sweep, points, vertices)
        rows = vertices if index is None else np.searchsorted(index, vertices)
        return unit(np.stack(solve(factor[rows].T, list(vectors.T)), axis=1))

    return through


def _drawn(
    dimension: int, key: np.uint64, backend: Backend, sweep: int, points: np.ndarray, vertices: np.ndarray
) -> np.ndarray:
    vectors = np.empty((len(vertices), dimension))
    backend.twin(unit_vectors)(vertices.astype(np.int64, copy=False), key, np.uint64(sweep), vectors)
    return vectors


def _random_of(setting: Setting) -> DirectionField:
    """Random directions in a domain, through its metric if it has one."""
    domain = setting.domain
    factor = factors_at_vertices(domain)
    return random_field(domain.points.shape[1], setting.seed, factor, domain.backend, setting.index)


def constant_field(vector: np.ndarray) -> DirectionField:
    """One direction (d,) for all vertices and sweeps."""
    return OwnField(_constant, (unit(np.asarray(vector, dtype=np.float64)[None, :]),))


def _constant(direction: np.ndarray, sweep: int, points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    return np.repeat(direction, len(vertices), axis=0)


def coordinate_fields(names: str, setting: Setting) -> list[DirectionField]:
    """The directions of some of the axes "xyz", those that the mesh has."""
    return [constant_field(_coordinate_axis(name, setting.domain)) for name in names]


def ascent_field(ascent: Ascent) -> DirectionField:
    """Directions that the engine finds when the turn of a vertex comes."""
    return lambda sweep, points, vertices: ascent


def radial_field(center: np.ndarray, axis: np.ndarray | None) -> DirectionField:
    """Away from ``center`` (d,) in 2D, away from the line through it along ``axis`` (3,) in 3D."""
    return OwnField(_radial, (center, axis))


def _radial(
    center: np.ndarray, axis: np.ndarray | None, sweep: int, points: np.ndarray, vertices: np.ndarray
) -> np.ndarray:
    offset = points - center
    if axis is not None:
        offset = offset - (offset @ axis)[:, None] * axis
    return unit(offset)


def circumferential_field(center: np.ndarray, axis: np.ndarray | None) -> DirectionField:
    """Around ``center`` (d,) in 2D, (-y, x)/r as in the paper's section 5.2; around ``axis`` (3,) in 3D."""
    return OwnField(_circumferential, (center, axis))


def _circumferential(
    center: np.ndarray, axis: np.ndarray | None, sweep: int, points: np.ndarray, vertices: np.ndarray
) -> np.ndarray:
    offset = points - center
    if axis is None:
        return unit(np.stack([-offset[:, 1], offset[:, 0]], axis=1))
    return unit(np.cross(axis, offset))


def array_field(vectors: np.ndarray, period: int = 1) -> DirectionField:
    """Given directions: (N, d) for every sweep, or (K, N, d), one of the K after the other.

    period: the field is asked in every period-th sweep only.
    """
    frames = vectors if vectors.ndim == 3 else vectors[None]

    def field(sweep: int, points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        return unit(frames[sweep // period % len(frames)][vertices])

    return field


_REGISTRY = (
    Direction("random", lambda to: [_random_of(to)]),
    Direction("x", partial(coordinate_fields, "x")),
    Direction("y", partial(coordinate_fields, "y")),
    Direction("z", partial(coordinate_fields, "z")),
    Direction("axis", lambda to: coordinate_fields("xyz"[: to.domain.points.shape[1]], to)),
    Direction("circumferential", lambda to: [circumferential_field(to.center, to.axis)]),
    Direction("radial", lambda to: [radial_field(to.center, to.axis)]),
    Direction("steepest", lambda to: [ascent_field(STEEPEST)]),
    Direction("narrowing", lambda to: [ascent_field(NARROWING)]),
    Direction("optimal", lambda to: [ascent_field(OPTIMAL)]),
)
DIRECTIONS = {direction.name: direction for direction in _REGISTRY}


def direction_field(
    entries: Sequence[Entry],
    domain: Domain,
    point_data: Mapping[str, np.ndarray],
    seed: int = 0,
    center: Sequence[float] | None = None,
    axis: Sequence[float] | None = None,
    index: np.ndarray | None = None,
) -> DirectionField:
    """The direction field of a list of entries, one a sweep, cycled.

    entries: names (see DIRECTIONS), "field:NAME" for a vector field in ``point_data``, or arrays (N, d) or
        (K, N, d); vectors with three components are projected into the plane of a planar mesh.
    center, axis: for "circumferential" and "radial"; default the centroid of the points and the z axis.
    index: (N,) ascending, by which the field will be asked about each vertex; None for its number.

    Raises UsageError for unknown names and arrays of wrong shape or with values that are not finite.
    """
    if not entries:
        raise UsageError("directions: none given")
    middle = _centroid(domain.points) if center is None else _in_domain(center, "center", domain)
    around = None
    if domain.points.shape[1] == 3:
        around = _axis((0.0, 0.0, 1.0) if axis is None else axis)
    setting = Setting(domain, seed, middle, around, index)
    turns: list[DirectionField | np.ndarray] = []  # vectors become fields when the number of turns is known
    for entry in entries:
        if isinstance(entry, str) and entry in DIRECTIONS:
            turns += DIRECTIONS[entry].fields(setting)
        else:
            turns.append(_flat_vectors(*_named_vectors(entry, point_data), domain))
    fields = [array_field(turn, len(turns)) if isinstance(turn, np.ndarray) else turn for turn in turns]
    return Turns(fields)


def _centroid(points: np.ndarray) -> np.ndarray:
    """(d,) the mean of ``points`` (N, d), in whatever order they are."""
    return np.array([mean(component) for component in points.T])


def _named_vectors(entry: Entry, point_data: Mapping[str, np.ndarray]) -> tuple[np.ndarray, str]:
    """Vectors given as an array or as a point field, and their name in messages."""
    if isinstance(entry, tuple):
        return entry[1], entry[0]
    if not isinstance(entry, str):
        return entry, "array"
    check_name(entry)
    name = entry.removeprefix("field:")
    if name not in point_data:
        there = ", ".join(sorted(point_data)) or "none"
        raise UsageError(f"directions {entry}: no such point field; there are: {there}")
    return np.asarray(point_data[name]), entry


def _axis(values: Sequence[float]) -> np.ndarray:
    axis = np.asarray(values, dtype=np.float64)
    if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
        raise UsageError("axis: 3 finite numbers are needed that are not all zero")
    return unit(axis[None])[0]


def _coordinate_axis(name: str, domain: Domain) -> np.ndarray:
    number = "xyz".index(name)
    space = 3 if domain.plane is None else domain.plane.axes.shape[1]
    vector = np.eye(space)[number : number + 1] if number < space else np.zeros((1, space))
    flat = domain.flatten(vector)[0]
    if np.abs(flat).max() < 1e-9:
        raise UsageError(f"directions {name}: perpendicular to the plane of the mesh; no vertex could move")
    return flat


def _in_domain(values: Sequence[float], name: str, domain: Domain) -> np.ndarray:
    point = np.array([values], dtype=np.float64)
    space = 3 if domain.plane is None else domain.plane.axes.shape[1]
    if point.shape[1] == 2 and space == 3 and domain.plane is not None:
        point = np.append(point, [[0.0]], axis=1)
    if point.shape != (1, space) or not np.isfinite(point).all():
        raise UsageError(f"{name}: {space} finite numbers are needed")
    return domain.flatten(point)[0]


def _flat_vectors(vectors: np.ndarray, name: str, domain: Domain) -> np.ndarray:
    """Given directions as (N, d) or (K, N, d) in the coordinates of the domain."""
    dimensions = [2, 3] if domain.plane is not None else [3]
    given = _check_vectors(vectors, len(domain.points), dimensions, name)
    if domain.plane is None or given.shape[-1] == domain.plane.axes.shape[1] == 2:
        return given
    if given.shape[-1] == 2:
        given = np.concatenate([given, np.zeros((*given.shape[:-1], 1))], axis=-1)
    flat = domain.flatten(given.reshape(-1, given.shape[-1])).reshape(*given.shape[:-1], 2)
    # the rest of a vector across the plane is rounding, not a direction
    across = np.abs(flat).max(axis=-1) < 1e-9 * np.abs(given).max(axis=-1)
    flat[across] = 0.0
    return flat


def _check_vectors(vectors: np.ndarray, n_points: int, dimensions: Sequence[int], name: str) -> np.ndarray:
    """``vectors`` as float64 if they have shape (N, d) or (K, N, d) with d in ``dimensions``, all finite.

    Raises UsageError that names ``name`` and the fault.
    """
    if vectors.dtype.kind not in "fiub":
        raise UsageError(f"directions {name}: not numbers")
    vectors = vectors.astype(np.float64)
    allowed = " or ".join(str(d) for d in dimensions)
    if vectors.ndim not in (2, 3) or vectors.shape[-2] != n_points or vectors.shape[-1] not in dimensions:
        raise UsageError(
            f"directions {name}: shape {vectors.shape} is neither (N, d) nor (K, N, d) "
            f"with N = {n_points} vertices and d = {allowed}"
        )
    if vectors.ndim == 3 and not len(vectors):
        raise UsageError(f"directions {name}: no sweeps in it")
    bad = np.argwhere(~np.isfinite(vectors))
    if len(bad):
        raise UsageError(f"directions {name}: not finite at vertex {bad[0][-2]} (counted from 0)")
    return vectors
