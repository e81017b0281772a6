"""The part of the boundary: vertices that move freely, slide, or are projected to the input's shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dvr_cli.api.options import SmoothOptions
from dvr_cli.boundary.constraints import Constraints, constraints_of, surface_constraints
from dvr_cli.boundary.extent import extent
from dvr_cli.boundary.features import features_of
from dvr_cli.boundary.freedom import Freedom, interior_freedom
from dvr_cli.boundary.smooth_parts import SmoothParts, smooth_parts_of
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.options import default
from dvr_cli.relax.directions import DirectionField, random_field
from dvr_cli.relax.steepest import Ascent
from dvr_cli.relax.stopping import StopReason
from dvr_cli.relax.surface.projection import Projection
from dvr_cli.relax.sweeps import Relaxation
from dvr_cli.report.records import BoundaryChange

_USUAL_DEVIATION = 1e-3  # bound on the deviation, in diagonals of the bounding box
# The part of the bound that the distance at the points looked at may take: between them it is larger.
# Should the measured deviation exceed the bound nevertheless, the next smaller part is tried.
_SHARES = (0.7, 0.35, 0.1)


@dataclass(frozen=True)
class Moves:
    """The moves open to each vertex: within its freedom, or along a curved boundary.

    parts: the curved parts of the boundary, None where no vertex moves along them.
    constraints: what keeps its shape where the boundary moves, None where it stays.
    """

    freedom: Freedom
    parts: SmoothParts | None
    constraints: Constraints | None = None

    @property
    def relaxed(self) -> np.ndarray:
        """(m,) the vertices that may move, in index order: I_R."""
        if self.parts is None:
            return self.freedom.relaxed
        return np.sort(np.concatenate([self.freedom.relaxed, self.parts.projected]))


def moves_of(mesh: Mesh, domain: Domain, boundary: str, selected: np.ndarray, feature_angle: float) -> Moves:
    """The moves open to each vertex of a mesh with its boundary treated as ``boundary`` says.

    domain: that of the mesh, or a part of it. selected: (N,) bool, all others stay. feature_angle: degrees.
    """
    angle = np.radians(feature_angle)
    if domain.is_surface:
        nowhere = np.zeros(len(mesh.points), dtype=bool)
        constraints = surface_constraints(mesh, domain)
        smooth = features_of(domain.points, nowhere, constraints, angle)
        flat = interior_freedom(nowhere, 3)
    elif boundary == "fixed":
        return Moves(interior_freedom(domain.interior, domain.dimension).only(selected), None)
    else:
        constraints = constraints_of(mesh, domain)
        flat = features_of(domain.points, domain.interior, constraints).freedom.only(selected)
        if boundary == "slide":
            return Moves(flat, None, constraints)
        smooth = features_of(domain.points, domain.interior, constraints, angle)
    smooth = replace(smooth, freedom=smooth.freedom.only(selected))
    parts = smooth_parts_of(domain.points, constraints, smooth, flat)
    return Moves(parts.exact, parts if len(parts.projected) else None, constraints)


def usual_moves(mesh: Mesh, domain: Domain, held: np.ndarray) -> Moves:
    """The moves open to each vertex where nothing is asked for; held: (N,) bool, vertices that stay."""
    selected = mesh.unlinked & ~held
    return moves_of(mesh, domain, default("boundary"), selected, default("feature_angle"))


def relax_with_projection(
    run: Callable[[Projection], Relaxation],
    domain: Domain,
    parts: SmoothParts,
    field: DirectionField,
    options: SmoothOptions,
) -> tuple[Relaxation, np.ndarray, BoundaryChange]:
    """Relax with a projection, so that the boundary comes nowhere farther from the input than the bound.

    run: relaxes with a given projection. Returns the outcome, the corners of a surface that are turned over,
    and the change of the boundary.
    """
    points = domain.points
    field = _given_or_random(field, points, options.seed)
    bound = options.max_deviation
    if bound is None:
        used = points[domain.corners.vertices.ravel()]
        bound = _USUAL_DEVIATION * float(np.linalg.norm(np.ptp(used, axis=0)))
    for share in _SHARES:
        limit = share * bound
        projection = Projection(domain.corners, points, parts, field, limit, options.order, options.seed)
        outcome = run(projection)
        deviation = projection.deviation(outcome.points)
        if deviation <= bound or outcome.stopped_because.cuts_short:
            break
    inverted = projection.inverted
    if deviation > bound:
        outcome = Relaxation(points, outcome.sweeps, StopReason.DEVIATION)
        deviation, inverted = 0.0, Projection(domain.corners, points, parts, field, 0.0).inverted
    (volume, area), (new_volume, new_area) = extent(domain, points), extent(domain, outcome.points)
    change = BoundaryChange(
        deviation=deviation,
        max_deviation=bound,
        volume_change=None if not volume or new_volume is None else new_volume / volume - 1.0,
        area_change=new_area / area - 1.0 if area else None,
    )
    return outcome, inverted, change


def _given_or_random(field: DirectionField, points: np.ndarray, seed: int) -> DirectionField:
    """The same field, with random directions in sweeps of steepest ascent, which projection does not know."""
    random = random_field(points.shape[1], len(points), seed)

    def given(sweep: int, at: np.ndarray, vertices: np.ndarray) -> np.ndarray | Ascent:
        directions = field(sweep, at, vertices)
        return random(sweep, at, vertices) if isinstance(directions, Ascent) else directions

    return given
