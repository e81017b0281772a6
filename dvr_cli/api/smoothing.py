"""Smoothing from a mesh to new points and a report: domain, problem, sweeps, what the output keeps."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np

from dvr_cli.api.altitudes import Rounding, lowers_altitude, rounding_of
from dvr_cli.api.away_from_layers import weighted
from dvr_cli.api.boundary import Moves, bound_of, held_by_shape, moves_of
from dvr_cli.api.options import BOUNDARIES, BOUNDARY_KEEPS, SmoothOptions
from dvr_cli.api.phases import Run
from dvr_cli.api.shapes import shaped
from dvr_cli.api.unfolding import unfold_phase
from dvr_cli.api.untangling import reference_quality, tangled_left, untangle_phase, untangles
from dvr_cli.beside import beside
from dvr_cli.errors import OutputError
from dvr_cli.mesh.domain import Domain, is_surface
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.limits import FAIR, HeldBy, limit_of
from dvr_cli.quality.measure import Quality, mean_of_elements, measure
from dvr_cli.quality.vector import at_least
from dvr_cli.relax.directions import Entry, direction_field
from dvr_cli.relax.engines.choice import EngineKind, MeshKind, choose_engine
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.problem import Problem, build_problem
from dvr_cli.relax.stopping import StopReason
from dvr_cli.relax.sweeps import Sweep
from dvr_cli.report.records import ShapeUse, SmoothReport, summarise

# the reasons for which relaxing on would gain nothing
DONE = (StopReason.CONVERGED, StopReason.NOTHING_TO_RELAX)
_PERFECT = 1.0 - 1e-9  # quality from which there is nothing that could be better
_ON_SURFACES = "narrowing"  # directions on surfaces in space where nobody gives any
# The part of the bound on the deviation up to which vertices walk. Should the deviation as measured exceed
# the bound nevertheless, the next smaller part is tried.
_SHARES = (0.97, 0.5, 0.1)


class Storage(Rounding, Protocol):
    """The place where the result will be kept; it may round coordinates."""

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates as they will be read back."""

    def widen(self) -> bool:
        """Keep coordinates in float64 from now on; False if they are already or cannot be."""


_Make = Callable[[EngineKind, Problem, int | None], Engine]


class _Attempt(NamedTuple):
    """One of the runs that may be needed.

    unfolds: whether what lies folded is unfolded first. weight: (n,) what the qualities of cells are divided
    by, as a run before has shown to be needed, None if there was none; spent: its seconds.
    """

    unfolds: bool
    weight: np.ndarray | None = None
    spent: float = 0.0


def smooth_mesh(
    mesh: Mesh,
    options: SmoothOptions,
    storage: Storage | None = None,
    on_sweep: Callable[[Sweep], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
    means: bool = False,
    make: _Make | None = None,
) -> tuple[np.ndarray, SmoothReport]:
    """Untangle, if asked for, and relax a Mesh; returns its new points (N, 2|3) and the report.

    storage: where the result goes; the points returned and the report's final qualities are those kept there.
    on_sweep, interrupted: see ``sweeps.relax``.
    means: whether the report's sweeps have the mean quality of the elements, too.
    make: the engine of a kind for a problem, with that many threads; by default that of this process, which
        waits for no compiler.

    Raises OutputError if rounding in the storage would make the mesh worse than it was, or lower its smallest
    altitude.
    """
    how = storage, on_sweep, interrupted, means, make
    if options.is_free and options.stopping.max_iterations:
        result = _smoothed(mesh, options, *how, _Attempt(unfolds=True))
        if result is not None:
            return result
    result = _smoothed(mesh, options, *how, _Attempt(unfolds=False))
    assert result is not None
    return result


def _smoothed(
    mesh: Mesh,
    options: SmoothOptions,
    storage: Storage | None,
    on_sweep: Callable[[Sweep], None] | None,
    interrupted: Callable[[], bool],
    means: bool,
    make: _Make | None,
    attempt: _Attempt,
) -> tuple[np.ndarray, SmoothReport] | None:
    """See ``smooth_mesh``; None if unfolding first does no good."""
    how = storage, on_sweep, interrupted, means, make
    vertices, sweeps = len(mesh.points), options.stopping.max_iterations
    choose = partial(choose_engine, options.engine, vertices, sweeps, options.takes_patches)
    of_mesh = MeshKind(mesh.is_planar, options.metric is not None, is_surface(mesh))
    kind = choose(meanwhile=make is None, mesh=of_mesh)
    whole = options.domain(mesh, kind.backend)
    shapes = shaped(whole, options.shape, options.tensors(mesh))
    domain = shapes.domain
    masks = options.selection.masks(mesh, domain)
    selected = np.logical_and.reduce([mesh.unlinked, ~shapes.held, *masks.values()])
    may_walk = domain.is_surface or options.boundary == "project"
    bound = bound_of(domain, options.max_deviation) if may_walk else 0.0
    how_far = bound if attempt.unfolds else None
    moves = moves_of(mesh, domain, options.boundary, selected, options.feature_angle, how_far)
    relaxed = moves.relaxed
    if moves.parts is not None:
        kind = choose(walking=len(moves.parts.walking), meanwhile=make is None, mesh=of_mesh)
    # on a surface vertices have little room: measured, lowering the price first and narrowing directions then
    # go farthest
    on_surface = domain.is_surface and options.is_free and options.takes_polish
    entries: list[Entry] = [_ON_SURFACES] if on_surface else options.entries
    field = direction_field(entries, domain, mesh.point_data, options.seed, options.center, options.axis)
    threads = kind.threads(options.threads)
    measured = partial(measure, domain, mesh.points, relaxed, by_corner=shapes.own_quality)
    known = beside(threads, measured)
    start = time.perf_counter()
    start_points = moves.start(domain.points)
    parts = options.order, options.seed, kind.backend, moves.within, moves.parts
    corners = domain.corners if attempt.weight is None else weighted(domain.corners, attempt.weight)
    across = beside(threads, partial(_across, start_points, moves, _SHARES[0] * bound))
    problem = build_problem(corners, relaxed, start_points, *parts)
    rounding = rounding_of(domain, mesh.points, relaxed, storage) if options.keeps_altitude else 0.0
    before = known()
    problem = problem.keeping_within(_SHARES[0] * bound, across())
    untangling = untangles(options, domain, before)
    mean: dict[int, float] = {}
    for share in _SHARES if moves.parts is not None else _SHARES[:1]:
        if share < _SHARES[0]:
            problem = problem.keeping_within(share * bound)
        engine = (make or EngineKind.make)(kind, problem, options.threads)
        hook = _record_means(mean, engine, domain, on_sweep) if means else on_sweep
        run = Run(domain, moves, engine, options, hook, interrupted, rounding, attempt.spent)
        reference = before
        if untangling:
            run.untangle()
            after = measure(domain, domain.lift(mesh.points, run.points), relaxed)
            reference = reference_quality(after, before)
        if options.takes_descent and engine.batches:
            run.descend()
        elif on_surface:
            run.polish(reference.q1 or 0.0)
        run.relax(field)
        if options.takes_patches:
            run.relax_patches()
        if options.takes_polish:
            run.polish(reference.q1 or 0.0)
        if moves.unfolding is not None:
            after = measure(domain, domain.lift(mesh.points, run.points), relaxed, inverted=run.inverted)
            if is_worse(after, reference):
                return None
        keeps = options.keeps_altitude and moves.unfolding is None
        result_of = partial(_result, mesh, domain, relaxed, run, reference, storage, keeps)
        points, after = result_of()
        if options.polish is None and run.polished and not at_least(after.vector, before.vector):
            run.undo_polish()
            points, after = result_of()
            if on_surface and not at_least(after.vector, before.vector):
                run.start_anew()
                run.relax(field)
                points, after = result_of()
        lower = options.polish is None and not at_least(after.vector, reference.vector)
        if moves.unfolding is not None and lower:
            return None
        if moves.parts is None or run.keeps(bound):
            break
        if share == _SHARES[-1] or run.stopped_because.cuts_short:
            run.undo(bound)
            points, after = result_of()
            break
    if shapes.kept_cells is not None and options.stopping.target is None:
        from dvr_cli.api.away_from_layers import weights_needed  # most meshes have no layers

        weight = weights_needed(domain, shapes.kept_cells, before, after, attempt.weight)
        if weight is not None and not run.stopped_because.cuts_short:
            return _smoothed(mesh, options, *how, attempt._replace(weight=weight, spent=run.seconds))
    seconds = time.perf_counter() - start + attempt.spent
    left = tangled_left(domain, moves, points, after)
    if run.untangling is not None:
        run.phases.insert(0, untangle_phase(run.untangling, left))
    if moves.unfolding is not None:
        run.phases.insert(0, unfold_phase(moves.unfolding, domain))
    limited_by = None
    ended = run.stopped_because in DONE or after.is_capped
    if ended and not has_nothing_to_gain(after, np.array_equal(points, mesh.points)):
        mends = left["elements"] > left["hopeless"] and not untangling
        shape = None
        if may_walk:
            where = mesh, replace(domain, points=start_points), moves, selected, options.feature_angle
            shape = partial(held_by_shape, *where, engine.part_of_limit, bound)
        boundary = freer(mesh, domain, options.boundary, selected, options.feature_angle)
        held_by = HeldBy(_deselected(mesh, domain, options, masks, relaxed), boundary, shape)
        limited_by = limit_of(domain, points, relaxed, after, held_by, mends)
    plain = None
    if shapes.kept or shapes.metric:
        unmoved = measure(shapes.plain, mesh.points, relaxed, by_corner=shapes.quality)
        plain = unmoved, measure(shapes.plain, points, relaxed)
    report = SmoothReport(
        shape=ShapeUse(options.shape_mode, shapes.kept, shapes.max_aspect),
        plain=plain,
        kept=shapes.kept_cells,
        mesh=summarise(mesh, domain, moves.constraints),
        relaxed=len(relaxed),
        before=before,
        after=after,
        phases=run.phases,
        sweeps=[asdict(sweep) for sweep in run.sweeps],
        stopped_because=run.stopped_because,
        limited_by=limited_by,
        left=left,
        level=run.level,
        seconds=seconds,
        engine=kind.name_of(engine),
        threads=engine.threads,
        options=options.record()
        | {"untangle": untangling}
        | ({"directions": _ON_SURFACES} if on_surface else {}),
        boundary=run.boundary,
    )
    for sweep in report.sweeps if means else []:
        sweep["elements_mean"] = mean[sweep["sweep"]]
    return points, report


def _across(points: np.ndarray, moves: Moves, limit: float) -> np.ndarray | None:
    """See ``carriers.across_of``; None where nobody walks."""
    if moves.parts is None:
        return None
    from dvr_cli.relax.surface.carriers import across_of  # only where vertices walk

    return across_of(points, moves.parts, limit)


def _result(
    mesh: Mesh,
    domain: Domain,
    relaxed: np.ndarray,
    run: Run,
    reference: Quality,
    storage: Storage | None,
    keeps_altitude: bool,
) -> tuple[np.ndarray, Quality]:
    """The coordinates that a run has reached as points that will be kept, and their quality."""
    points = domain.lift(mesh.points, run.points)
    if domain.straighten:
        from dvr_cli.quality.curved import straightened

        points = straightened(domain, points)
    if domain.is_tilted:
        reached = measure(domain, points, relaxed)
        if is_worse(reached, reference) or (keeps_altitude and lowers_altitude(reached, reference)):
            points, run.stopped_because = mesh.points.copy(), StopReason.ROUNDING
    measured = partial(measure, domain, relaxed=relaxed, inverted=run.inverted, threads=run.threads)
    before = mesh.points if keeps_altitude else None
    return _stored_result(measured, points, reference, storage, before)


def _record_means(
    mean: dict[int, float], engine: Engine, domain: Domain, on_sweep: Callable[[Sweep], None] | None
) -> Callable[[Sweep], None]:
    """Record each sweep's mean element quality, by its number, before calling ``on_sweep``."""

    def after_sweep(sweep: Sweep) -> None:
        mean[sweep.sweep] = mean_of_elements(domain, engine.points)
        if on_sweep is not None:
            on_sweep(sweep)

    return after_sweep


def _deselected(
    mesh: Mesh, domain: Domain, options: SmoothOptions, masks: dict[str, np.ndarray], relaxed: np.ndarray
) -> dict[str, np.ndarray]:
    """For each option of selection (N,) bool, the vertices that it keeps from moving.

    masks: for each of them the vertices that it lets move, (N,) bool. relaxed: those that move in the run.
    """
    movable = relaxed
    if masks:
        movable = moves_of(mesh, domain, options.boundary, mesh.unlinked, options.feature_angle).relaxed
    everywhere = np.isin(np.arange(len(mesh.points)), movable)
    return {name: everywhere & ~mask for name, mask in masks.items()}


def freer(
    mesh: Mesh, domain: Domain, boundary: str, selected: np.ndarray, feature_angle: float
) -> dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]]:
    """The treatments of the boundary that free more vertices than ``boundary``, as in ``limit_of``.

    selected: (N,) bool, the vertices that selection and shape leave to move. feature_angle: degrees.
    """
    others = () if domain.is_surface else BOUNDARIES[BOUNDARIES.index(boundary) + 1 :]

    def freed(name: str, vertices: np.ndarray) -> np.ndarray:
        moves = moves_of(mesh, domain.around(vertices), name, selected, feature_angle)
        return np.isin(vertices, moves.relaxed)

    return {f"--boundary {name}": (partial(freed, name), BOUNDARY_KEEPS[name]) for name in others}


def _stored_result(
    measured: Callable[[np.ndarray], Quality],
    points: np.ndarray,
    before: Quality,
    storage: Storage | None,
    start: np.ndarray | None,
) -> tuple[np.ndarray, Quality]:
    """The points as the storage keeps them, and their quality, which is not below that of the input.

    start: the points of the input, whose smallest altitude must not fall, but for what the storage takes from
    that of the input itself; None where it may.
    """
    if storage is None:
        return points, measured(points)

    def rounded() -> tuple[np.ndarray, Quality, tuple[str, float, float] | None]:
        kept = storage.stored(points)
        after = measured(kept)
        lost = _what_fell(after, before)
        if lost is None and start is not None and lowers_altitude(after, before):
            as_stored = measured(storage.stored(start))
            storage.stored(points)
            if lowers_altitude(after, as_stored):
                old, new = (each.measures["min_altitude"] or 0.0 for each in (as_stored, after))
                lost = "the smallest altitude", old, new
        return kept, after, lost

    kept, after, lost = rounded()
    if lost is not None and storage.widen():
        kept, after, lost = rounded()
    if lost is not None:
        name, old, new = lost
        raise OutputError(
            f"rounding the coordinates as the output stores them would lower {name} from {old:.6g} by "
            f"{old - new:.2g}; choose a format with 64-bit coordinates"
        )
    return kept, after


def _what_fell(after: Quality, before: Quality) -> tuple[str, float, float] | None:
    """The name of what is worse, if anything is, and its values before and after."""
    if not is_worse(after, before):
        return None
    old, new = before.q1 or 0.0, after.q1 or 0.0  # neither is None here
    return ("the worst quality", before.minimum, after.minimum) if old <= new else ("Q1", old, new)


def is_worse(after: Quality, before: Quality) -> bool:
    """True if a mesh of which vertices were relaxed got a lower Q1, a worse element or more inverted ones."""
    if after.q1 is None or before.q1 is None:
        return False
    lower = after.q1 < before.q1 or after.minimum < before.minimum
    return after.inverted > before.inverted or lower


def has_nothing_to_gain(after: Quality, unmoved: bool) -> bool:
    """True if no advice would help: all is fair, and what can move is perfect or ended where it began."""
    if after.minimum >= _PERFECT:
        return True
    if after.q1 is None or after.minimum < FAIR:
        return False
    return after.q1 >= _PERFECT or (unmoved and not after.is_capped)
