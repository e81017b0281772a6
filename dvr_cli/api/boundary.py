"""The part of the boundary: vertices that move freely, slide, or walk on the input's shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.beside import beside
from dvr_cli.boundary.constraints import Constraints, constraints_of, surface_constraints
from dvr_cli.boundary.features import features_of
from dvr_cli.boundary.freedom import Freedom, interior_freedom
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.options import default
from dvr_cli.report.records import BoundaryChange

if TYPE_CHECKING:
    from dvr_cli.boundary.smooth_parts import SmoothParts
    from dvr_cli.boundary.unfolding import Unfolding

_USUAL_DEVIATION = 1e-3  # bound on the deviation, in diagonals of the bounding box
_ANGLES = (45.0, 60.0, 90.0, 120.0)  # feature angles that are advised
_CLOSE = 0.5  # part of the bound on the deviation from which on it counts as what holds a vertex,
_MORE = 10.0  # and how many times the bound is advised then


@dataclass(frozen=True)
class Moves:
    """The moves open to each vertex: within its freedom, or along a curved boundary.

    freedom: of the vertices that do not walk. parts: the curved parts of the boundary, None where no vertex
    walks on them.
    constraints: what keeps its shape where the boundary moves, None where it stays.
    unfolding: of facets that lay folded, None if none did.
    """

    freedom: Freedom
    parts: SmoothParts | None
    constraints: Constraints | None = None
    unfolding: Unfolding | None = None

    def start(self, points: np.ndarray) -> np.ndarray:
        """(N, d) where vertices begin to move in a mesh with these points: what lay folded is unfolded."""
        return points if self.unfolding is None else self.unfolding.points

    @property
    def relaxed(self) -> np.ndarray:
        """(m,) the vertices that may move, in index order: I_R."""
        return self.within.relaxed

    @property
    def dimension(self) -> np.ndarray:
        """(N,) of what each vertex moves on: 1 a line or curve, 2 a plane or surface, 0 if it stays."""
        dimension = self.freedom.dimension.copy()
        if self.parts is not None:
            dimension[self.parts.on_curve], dimension[self.parts.on_patch] = 1, 2
        return dimension

    @property
    def within(self) -> Freedom:
        """The freedom of all vertices that may move, those that walk being free but for their carriers."""
        if self.parts is None:
            return self.freedom
        dimension = self.freedom.dimension.copy()
        dimension[self.parts.walking] = self.freedom.axis.shape[1]
        return Freedom(dimension, self.freedom.axis)


def moves_of(
    mesh: Mesh,
    domain: Domain,
    boundary: str,
    selected: np.ndarray,
    feature_angle: float,
    bound: float | None = None,
) -> Moves:
    """The moves open to each vertex of a mesh with its boundary treated as ``boundary`` says.

    domain: that of the mesh, or a part of it. selected: (N,) bool, all others stay. feature_angle: degrees.
    bound: on the deviation, within which what lies folded is unfolded first; None leaves it as it is.
    """
    angle = np.radians(feature_angle)
    points, unfolding = domain.points, None
    if domain.is_surface:
        nowhere = np.zeros(len(mesh.points), dtype=bool)
        constraints = surface_constraints(mesh, domain)
        if bound is not None:
            from dvr_cli.boundary.unfolding import unfold  # only where vertices walk

            unfolding = unfold(points, constraints, selected, angle, bound)
            points = unfolding.points
        smooth = features_of(points, nowhere, constraints, angle)
        flat = interior_freedom(nowhere, 3)
    elif boundary == "fixed":
        return Moves(interior_freedom(domain.interior, domain.dimension).only(selected), None)
    else:
        constraints = constraints_of(mesh, domain)
        flat = features_of(domain.points, domain.interior, constraints).freedom.only(selected)
        if boundary == "slide":
            return Moves(flat, None, constraints)
        if bound is not None and domain.dimension == 3:
            from dvr_cli.boundary.unfolding import unfold

            unfolding = unfold(points, constraints, selected, angle, bound, domain.corners)
            points = unfolding.points
        smooth = features_of(points, domain.interior, constraints, angle)
    from dvr_cli.boundary.smooth_parts import smooth_parts_of

    smooth = replace(smooth, freedom=smooth.freedom.only(selected))
    parts = smooth_parts_of(domain.points, constraints, smooth, flat, unfolding)
    found = unfolding if unfolding is not None and len(unfolding.folded) else None
    return Moves(parts.exact, parts if len(parts.walking) else None, constraints, found)


def usual_moves(mesh: Mesh, domain: Domain, held: np.ndarray) -> Moves:
    """The moves open to each vertex where nothing is asked for; held: (N,) bool, vertices that stay."""
    selected = mesh.unlinked & ~held
    how = default("boundary"), selected, default("feature_angle"), bound_of(domain, None)
    return moves_of(mesh, domain, *how)


def held_by_shape(
    mesh: Mesh,
    domain: Domain,
    moves: Moves,
    selected: np.ndarray,
    feature_angle: float,
    part_of_bound: Callable[[np.ndarray], float],
    bound: float,
    vertices: np.ndarray,
) -> tuple[str, str] | None:
    """The way features and the bound on the deviation hold ``vertices`` (m,), and what would free them.

    moves, selected, feature_angle: those of the run, see ``moves_of``. part_of_bound: says which part of the
    bound the deviation takes at vertices. None if neither holds them.
    """
    reasons, options = [], []
    near = domain.around(vertices)
    now = moves.dimension[vertices]

    def freed(angle: float) -> int:
        wider = moves_of(mesh, near, "project", selected, angle).dimension[vertices]
        return int((wider > now).sum())

    angles = [angle for angle in _ANGLES if angle > feature_angle]
    most = freed(angles[-1]) if angles else 0
    if most:
        angle = next(angle for angle in angles if freed(angle) == most)
        reasons.append(
            f"{most} of its vertices are on features, which turn by over {feature_angle:g} degrees"
        )
        options.append(f"--feature-angle {angle:g}")
    if part_of_bound(vertices) >= _CLOSE:
        reasons.append("it may come no farther from the input's shape")
        options.append(f"--max-deviation {_MORE * bound:.2g}")
    return (", and ".join(reasons), f"{' '.join(options)} would give it room") if reasons else None


def bound_of(domain: Domain, max_deviation: float | None) -> float:
    """The distance the boundary may come from the input's; None for the usual part of the diagonal."""
    if max_deviation is not None:
        return max_deviation
    used = np.zeros(len(domain.points), dtype=bool)
    used[domain.corners.vertices] = True
    return _USUAL_DEVIATION * float(np.linalg.norm(np.ptp(domain.points[used], axis=0)))


def change_of(
    domain: Domain, points: np.ndarray, deviation: Callable[[], float], bound: float, threads: int
) -> BoundaryChange:
    """The change of the boundary of a domain at the coordinates ``points`` (N, d).

    deviation: measures how far it is from the input's, while volume and area are found beside; bound: how
    far it may be.
    """
    from dvr_cli.boundary.extent import extents

    both = beside(threads, partial(extents, domain, domain.points, points))
    apart = deviation()
    (volume, area), (new_volume, new_area) = both()
    return BoundaryChange(
        deviation=apart,
        max_deviation=bound,
        volume_change=None if not volume or new_volume is None else new_volume / volume - 1.0,
        area_change=new_area / area - 1.0 if area else None,
    )
