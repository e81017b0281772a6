"""Moving boundaries: a mesh relaxed again and again while its boundary moves (paper sections 5.2 to 5.4).

What depends on the connectivity alone - domain, rings, schedule, engine - is set up once. Each step then
costs its sweeps and little else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from dvr_cli.api.adapters.registry import CellArrays, as_mesh
from dvr_cli.api.altitudes import altitude_bound, lowers_altitude, rounding_of
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.shapes import shaped
from dvr_cli.api.smoothing import is_worse
from dvr_cli.boundary.freedom import interior_freedom
from dvr_cli.errors import InputError, UsageError
from dvr_cli.mesh.corners import Corners
from dvr_cli.mesh.domain import Domain, check_coordinates
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.neighbours import within_rings
from dvr_cli.options import check_names, default
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.measure import measure
from dvr_cli.relax.directions import direction_field, restrict_field
from dvr_cli.relax.engines.choice import MeshKind, choose_engine
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.harmonic import edges_of, spread
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.stopping import StopReason
from dvr_cli.relax.sweeps import Sweep, relax

_INTACT = 0.5  # quality relative to its shape above which a cell of a layer is left as displacing put it

# The options of smoothing that a step of a Relaxer has, too.
_OPTIONS = (
    *("directions", "center", "axis", "max_iterations", "tol", "patience", "target", "time_limit"),
    *("order", "keep_height", "seed", "regions", "shape", "straighten", "engine", "threads"),
)


@dataclass(frozen=True)
class RelaxReport:
    """The record of one step.

    q1_before: Q1 with the boundary moved, before any relaxing; q1_after: in the end. None if nothing relaxed.
    relaxed: how many vertices could move. sweeps, stopped_because: as in the report of ``smooth``.
    """

    q1_before: float | None
    q1_after: float | None
    relaxed: int
    sweeps: list[Sweep]
    stopped_because: StopReason


class Relaxer:
    """Relaxes one mesh at many instants: for time stepping with a boundary that moves.

    points: (N, 2|3) copy of the coordinates reached. held: (N,) bool, the vertices whose places are given:
    those on the boundary, on interfaces and of embedded cells.

    >>> import numpy as np, dvr_cli
    >>> points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
    >>> triangles = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    >>> relaxer = dvr_cli.Relaxer(points, {"triangle": triangles}, directions="axis")
    >>> to_the_right = np.zeros((5, 2))
    >>> to_the_right[[1, 2], 0] = 0.25
    >>> for _ in range(4):
    ...     points, report = relaxer.relax(displacement=to_the_right)
    >>> points.round(3).tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0], [1.0, 0.5]]
    """

    def __init__(
        self,
        mesh: Any,
        cells: CellArrays = None,
        **options: Any,
    ) -> None:
        """Set up a mesh given as to ``dvr_cli.smooth``, with the same errors.

        options: those of ``smooth`` about directions, stopping, order, engine, regions, ``shape`` and
        ``straighten``. The shape is for displacements: by default each cell is measured against its own in
        this mesh, so that layers keep their heights. Points given without a displacement are relaxed to the
        ideal shapes.

        A step is a phase of sweeps alone, along random directions by default: patches and polishing, which
        take longer than a step should, belong to ``smooth``.

        The first mesh settles which cells are stored inside out, the plane of a planar mesh, and the coloured
        order. ``relax(points)`` gives what ``smooth(points, ...)`` gives without these: to the last bit for
        the first points, for others if the order is natural or shuffled. With the directions steepest and
        optimal it may then differ, as their choice among near equals depends on a numbering that the first
        mesh settles.
        """
        check_names(options, _OPTIONS)
        given = {name: default(name, "morph") for name in ("directions", "shape")} | options
        self._prepare(as_mesh(mesh, cells), SmoothOptions.of(given, patches=False, polish=False))

    @classmethod
    def of(cls, mesh: Mesh, options: SmoothOptions) -> Relaxer:
        """The relaxer of a Mesh."""
        relaxer = cls.__new__(cls)
        relaxer._prepare(mesh, options)
        return relaxer

    def _prepare(self, mesh: Mesh, options: SmoothOptions) -> None:
        mesh = replace(mesh, points=mesh.points.copy())  # a copy: the caller may change its own
        work = len(mesh.points), options.stopping.max_iterations
        of_mesh = MeshKind(mesh.is_planar, options.metric is not None)
        self._kind = choose_engine(options.engine, *work, meanwhile=True, mesh=of_mesh)
        self._options = options
        self._point_data = mesh.point_data
        self.domain = options.domain(mesh, self._kind.backend)
        if len(self.domain.curved_vertices):
            raise InputError(
                "curved second-order cells cannot be followed; --straighten takes them as straight"
            )
        if self.domain.is_surface:
            raise InputError("a surface in space cannot be followed; planar and volume meshes can")
        self.points = mesh.points.copy()
        shapes = shaped(self.domain, options.shape)
        self._shaped = shapes.corners_free_to_move()  # layers go along with what is displaced
        self._layers = (shaped(self.domain, "auto") if options.shape == "input" else shapes).held
        self.held = ~self.domain.interior
        self._carried = np.zeros(len(mesh.points), dtype=bool)
        if self.domain.mids is not None:
            self._carried[self.domain.mids.nodes] = True
        self._used = np.zeros(len(mesh.points), dtype=bool)
        self._used[self.domain.corners.vertices] = True
        self._engine: Engine | None = None
        self._engine_moves = np.empty(0, dtype=bool)  # which vertices it relaxes
        self._engine_corners = self.domain.corners  # and with which targets

    @property
    def at_work(self) -> tuple[str, int]:
        """The name of the engine that relaxes, and the number of its threads."""
        if self._engine is None:
            return self._kind.name, self._kind.threads(self._options.threads)
        return self._kind.name_of(self._engine), self._engine.threads

    def relax(
        self,
        points: np.ndarray | None = None,
        *,
        displacement: np.ndarray | None = None,
        near: int | None = None,
    ) -> tuple[np.ndarray, RelaxReport]:
        """Relax the mesh at its next instant; returns its new points (N, 2|3) and a report.

        points: where all vertices are now, of the shape of the first points; default: where the last step
            put them.
        displacement: (N, 2|3), by how much the held vertices move from there first; two components are x and
            y of a planar mesh in space. Rows of other vertices are not looked at, those of nodes of
            second-order cells neither: these follow their corners.
        near: relax only vertices within that many rings of those that have moved since the last step.
            Rings and schedule are set up again when these are others than before.

        The quality never falls below that of the mesh with its boundary moved. Where moving it inverted
        elements, vertices move to where all elements around them are positive, as ``smooth`` moves them;
        ``report.q1_after`` tells whether all could.

        Raises UsageError for arrays of wrong shape, InputError for coordinates that are not finite and for
        points that leave the plane of a planar mesh.
        """
        points = self.points if points is None else self._as_points(points, "points")
        start = points
        if displacement is not None:
            points = self.displace(start, start + self.shift(displacement))
        selected = None if near is None else self.near((points != self.points).any(axis=1), near)
        if displacement is not None:
            points = self.spread(start, points, selected)
        moved, report = self.step(points, selected, keeps=displacement is not None)
        self.points = moved.copy()
        return moved, report

    def shift(self, displacement: np.ndarray) -> np.ndarray:
        """A displacement as (N, D), zero for the vertices whose rows are not looked at; see ``relax``."""
        displacement = np.asarray(displacement)
        flat, space = (len(self.points), 2), self.points.shape[1]
        if displacement.shape == flat and space == 3 and self.domain.plane is not None:
            displacement = np.pad(displacement, ((0, 0), (0, 1)))
        displacement = self._as_points(displacement, "displacement")
        shift = np.where((self.held & ~self._carried)[:, None], displacement, 0.0)
        bad = np.flatnonzero(~np.isfinite(shift).all(axis=1))
        if len(bad):
            raise InputError(f"the displacement of vertex {bad[0]} (counted from 0) is not finite")
        return shift

    def displace(self, points: np.ndarray, places: np.ndarray) -> np.ndarray:
        """``points`` with the held vertices put to ``places`` (N, D); further nodes follow their corners."""
        moved = np.where((self.held & ~self._carried)[:, None], places, points)
        if self.domain.mids is not None:
            self.domain.mids.carry(points, moved, self._options.straighten)
        return moved

    def spread(self, before: np.ndarray, after: np.ndarray, selected: np.ndarray | None = None) -> np.ndarray:
        """``after`` (N, D), where the held vertices have moved since ``before``, with the others moved along
        harmonically, unless that makes the worst element worse.

        selected: (N,) bool, the vertices that may move, by default all. See ``harmonic.spread``.
        """
        if self._options.shape == "ideal":
            return after
        domain = self.domain
        given = self.held if selected is None else self.held | ~selected
        flat, moved = domain.flatten(before), domain.flatten(after)
        along = np.where(given[:, None], moved, flat + spread(flat, self._edges, moved - flat, given))
        worst = [corner_qualities(x, self._shaped, domain.backend).min() for x in (moved, along)]
        return domain.lift(after, along) if worst[1] > worst[0] else after

    @cached_property
    def _edges(self) -> np.ndarray:
        """(E, 2) the edges of the cells, along which displacements are spread."""
        return edges_of(self.domain.cells, len(self.points))

    def near(self, moved: np.ndarray, rings: int) -> np.ndarray:
        """(N,) bool: the vertices within that many rings of those marked in ``moved``."""
        if rings < 0:
            raise UsageError("near: must not be negative")
        return within_rings([block.vertices for block in self.domain.cells], moved, rings)

    def step(
        self,
        points: np.ndarray,
        selected: np.ndarray | None = None,
        on_sweep: Callable[[Sweep], None] | None = None,
        interrupted: Callable[[], bool] = lambda: False,
        keeps: bool = True,
    ) -> tuple[np.ndarray, RelaxReport]:
        """Relax from ``points`` (N, D) the vertices marked in ``selected`` ((N,) bool), by default all.

        on_sweep, interrupted: see ``sweeps.relax``. keeps: whether the targets are those of the option shape
        rather than the ideal ones.
        """
        check_coordinates(points)
        if self.domain.plane is not None and not self.domain.plane.holds(points[self._used]):
            raise InputError(
                "the points have left the plane of the mesh; planar meshes are relaxed in theirs"
            )
        options = self._options
        domain = replace(
            self.domain,
            points=np.ascontiguousarray(self.domain.flatten(points), dtype=np.float64),
            corners=self._shaped if keeps else self.domain.corners,
        )
        interior = domain.interior if selected is None else domain.interior & selected
        if keeps and self._hold(domain):
            interior = interior & ~self._layers
        freedom = interior_freedom(interior, domain.dimension)
        entries, data = options.entries, self._point_data
        field = direction_field(entries, domain, data, options.seed, options.center, options.axis)
        engine = self._engine_for(interior, domain.corners)
        if not interior.any():
            return points.copy(), RelaxReport(None, None, 0, [], StopReason.NOTHING_TO_RELAX)
        engine.load(domain.points)
        bound = 0.0
        if options.keeps_altitude:
            rounding = rounding_of(domain, points, freedom.relaxed, None)
            bound = altitude_bound(domain, domain.points, rounding)
        engine.keep_altitude(bound)
        q1_before = engine.q1()
        outcome = relax(
            engine, domain.points, restrict_field(field, freedom), options.stopping, on_sweep, interrupted
        )
        q1_after, stopped_because = engine.q1(), outcome.stopped_because
        moved = domain.lift(points, outcome.points)
        if domain.is_tilted:
            relaxed = freedom.relaxed
            before, after = (measure(domain, each, relaxed) for each in (points, moved))
            if is_worse(after, before) or (options.keeps_altitude and lowers_altitude(after, before)):
                moved, q1_after, stopped_because = points.copy(), q1_before, StopReason.ROUNDING
        return moved, RelaxReport(q1_before, q1_after, int(interior.sum()), outcome.sweeps, stopped_because)

    def _hold(self, domain: Domain) -> bool:
        """True if the cells of layers are still so near their shapes that their vertices need no relaxing."""
        inside = self._layers[domain.corners.vertices].any(axis=1)
        quality = corner_qualities(domain.points, domain.corners.part(inside), domain.backend)
        return bool(inside.any() and quality.min() > _INTACT)

    def _engine_for(self, moves: np.ndarray, corners: Corners) -> Engine:
        """The engine that relaxes the vertices marked in ``moves`` ((N,) bool): the last one if it does."""
        same = self._engine_corners is corners and np.array_equal(self._engine_moves, moves)
        if self._engine is None or not same:
            domain, options = self.domain, self._options
            problem = build_problem(
                corners,
                np.flatnonzero(moves),
                domain.points,
                options.order,
                options.seed,
                domain.backend,
            )
            self._engine = self._kind.make(problem, options.threads)
            self._engine_moves, self._engine_corners = moves, corners
        return self._engine

    def _as_points(self, values: np.ndarray, name: str) -> np.ndarray:
        """``values`` as (N, D) float64; UsageError that calls them ``name`` for another shape."""
        array = np.asarray(values)
        if array.dtype.kind not in "fiub" or array.shape != self.points.shape:
            raise UsageError(f"{name}: numbers of shape {self.points.shape} are needed, not {array.shape}")
        return array.astype(np.float64)
