"""What ``import dvr_cli`` offers: arrays or ``meshio.Mesh`` in, arrays or ``meshio.Mesh`` out."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from dvr_cli.errors import OutputError, UsageError
from dvr_cli.files.arrays import read_directions
from dvr_cli.mesh.convert import from_meshio
from dvr_cli.mesh.domain import Domain, domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.relax.choice import checked_threads, chosen_engine, make_engine
from dvr_cli.relax.directions import Entry, check_name, direction_field
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.schedule import ORDERS
from dvr_cli.relax.stopping import Stopping
from dvr_cli.relax.sweeps import Sweep, relax
from dvr_cli.report.compare import Comparison, compare_qualities
from dvr_cli.report.quality import Quality, measure
from dvr_cli.report.records import QualityReport, SmoothReport, summarise

if TYPE_CHECKING:
    import meshio

Directions = str | np.ndarray | Sequence[str | np.ndarray]


@dataclass(frozen=True)
class SmoothOptions:
    """How to relax; the fields are those of ``dvr smooth --help``.

    directions: comma-separated names, an array (N, d) or (K, N, d), or a list of these, one a sweep, cycled.
    center, axis: for "circumferential" and "radial"; default the centroid of the points and the z axis.
    order: "coloured", "natural" or "shuffled". seed: for random directions and the shuffled order.
    straighten: take curved second-order cells as straight. stopping: when to stop.
    engine: "auto", "numpy" or "numba"; threads: by default all cores. Neither changes the result.
    """

    directions: Directions = "random"
    center: Sequence[float] | None = None
    axis: Sequence[float] | None = None
    order: str = "coloured"
    seed: int = 0
    straighten: bool = False
    engine: str = "auto"
    threads: int | None = None
    stopping: Stopping = field(default_factory=Stopping)

    def __post_init__(self) -> None:
        """Check what can be checked without a mesh; raises UsageError, InputError for an unreadable array."""
        if self.order not in ORDERS:
            raise UsageError(f"order: unknown {self.order!r}; known: {', '.join(ORDERS)}")
        if not 0 <= self.seed < 2**64:
            raise UsageError("seed: must be between 0 and 2^64 - 1")
        chosen_engine(self.engine, 0, 0)
        checked_threads(self.threads)
        for entry in self.entries:
            if isinstance(entry, str):
                check_name(entry)

    @cached_property
    def entries(self) -> list[Entry]:
        """The directions as a list; arrays named by "file:PATH" are read, once."""
        result: list[Entry] = []
        for item in self._given():
            if not isinstance(item, str):
                result.append(item)
                continue
            for name in item.split(","):
                name = name.strip()
                path = name.removeprefix("file:")
                result.append(name if path == name else (name, read_directions(Path(path))))
        return result

    def _given(self) -> Sequence[str | np.ndarray]:
        return [self.directions] if isinstance(self.directions, str | np.ndarray) else self.directions

    def record(self) -> dict[str, Any]:
        """The options as JSON-ready data."""
        return {
            "directions": ",".join(d if isinstance(d, str) else f"array{d.shape}" for d in self._given()),
            "center": None if self.center is None else [float(c) for c in self.center],
            "axis": None if self.axis is None else [float(a) for a in self.axis],
            "order": self.order,
            "seed": int(self.seed),
            "straighten": bool(self.straighten),
            "max_iterations": int(self.stopping.max_iterations),
            "tol": float(self.stopping.tol),
            "patience": int(self.stopping.patience),
            "target": None if self.stopping.target is None else float(self.stopping.target),
            "time_limit": None if self.stopping.time_limit is None else float(self.stopping.time_limit),
        }


def smooth(
    mesh: meshio.Mesh | np.ndarray,
    cells: Mapping[str, np.ndarray] | Sequence[tuple[str, np.ndarray]] | None = None,
    *,
    directions: Directions = "random",
    center: Sequence[float] | None = None,
    axis: Sequence[float] | None = None,
    max_iterations: int = 100,
    tol: float = 1e-3,
    patience: int = 3,
    target: float | None = None,
    time_limit: float | None = None,
    order: str = "coloured",
    seed: int = 0,
    straighten: bool = False,
    engine: str = "auto",
    threads: int | None = None,
) -> tuple[Any, SmoothReport]:
    """Improve a mesh by directional vertex relaxation (the paper's Algorithm 1).

    mesh: a ``meshio.Mesh``, or points (N, 2) or (N, 3) with ``cells`` as {type: (n, k) int} or pairs of these
        (types and node order as in meshio). The input is not altered.
    The options are those of ``dvr smooth``; see SmoothOptions and Stopping.

    Returns (mesh, report): a new ``meshio.Mesh`` with the same cells and data, or the new points (N, 2|3),
    and a report with the same figures as the command's. The mesh quality never decreases.
    Raises UsageError for wrong options, InputError for meshes that cannot be relaxed.

    >>> import numpy as np, dvr_cli
    >>> points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.8, 0.9]])
    >>> triangles = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    >>> moved, report = dvr_cli.smooth(points, {"triangle": triangles}, directions="axis")
    >>> moved[4].round(3).tolist()
    [0.5, 0.5]
    """
    stopping = Stopping(max_iterations, tol, patience, target, time_limit)
    options = SmoothOptions(directions, center, axis, order, seed, straighten, engine, threads, stopping)
    internal = as_mesh(mesh, cells)
    points, report = smooth_mesh(internal, options)
    if isinstance(mesh, np.ndarray):
        return points, report
    moved = copy.copy(mesh)
    moved.points = points
    return moved, report


def quality_report(
    mesh: meshio.Mesh | np.ndarray,
    cells: Mapping[str, np.ndarray] | Sequence[tuple[str, np.ndarray]] | None = None,
    *,
    worst: int = 10,
) -> QualityReport:
    """The quality of a mesh, as ``dvr report quality`` gives it.

    mesh, cells: as for ``smooth``. worst: how many of the worst elements to list.
    Raises InputError for meshes without elements whose quality is defined.
    """
    return mesh_quality(as_mesh(mesh, cells), worst)


def compare(before: meshio.Mesh, after: meshio.Mesh) -> Comparison:
    """Which of two meshes of one connectivity is better in the paper's ordering of quality vectors (eq. 2).

    Raises InputError when their cells differ.
    """
    return compare_meshes(from_meshio(before), from_meshio(after))


class Storage(Protocol):
    """Where the result will be kept: what becomes of coordinates there, and whether that can be bettered."""

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates as they will be read back."""

    def widen(self) -> bool:
        """Keep coordinates in float64 from now on; False if they are already or cannot be."""


def smooth_mesh(
    mesh: Mesh,
    options: SmoothOptions,
    storage: Storage | None = None,
    on_sweep: Callable[[Sweep], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
) -> tuple[np.ndarray, SmoothReport]:
    """Relax a Mesh; returns its new points (N, 2|3) and the report.

    storage: where the result goes; the points returned and the report's final qualities are those kept there.
    on_sweep, interrupted: see ``sweeps.relax``.

    Raises OutputError if rounding in the storage would make the mesh worse than it was.
    """
    engine_name = chosen_engine(options.engine, len(mesh.points), options.stopping.max_iterations)
    compiled = engine_name == "numba"
    domain = domain_of(mesh, options.straighten, compiled)
    relaxed = np.flatnonzero(domain.interior)
    directions = direction_field(
        options.entries, domain, mesh.point_data, options.seed, options.center, options.axis
    )
    before = measure(domain, mesh.points, relaxed)
    begin = time.perf_counter()
    problem = build_problem(domain.corners, relaxed, domain.points, options.order, options.seed, compiled)
    engine = make_engine(engine_name, problem, checked_threads(options.threads))
    outcome = relax(engine, domain.points, directions, options.stopping, on_sweep, interrupted)
    seconds = time.perf_counter() - begin
    points, stopped_because = domain.lift(mesh.points, outcome.points), outcome.stopped_because
    if domain.is_tilted and _worse(measure(domain, points, relaxed), before):
        points, stopped_because = mesh.points.copy(), "rounding"
    points, after = _kept(domain, points, relaxed, before, storage)
    report = SmoothReport(
        mesh=summarise(mesh, domain),
        relaxed=len(relaxed),
        before=before,
        after=after,
        sweeps=[asdict(sweep) for sweep in outcome.sweeps],
        stopped_because=stopped_because,
        seconds=seconds,
        engine=engine.name,
        threads=engine.threads,
        options=options.record(),
    )
    return points, report


def _kept(
    domain: Domain, points: np.ndarray, relaxed: np.ndarray, before: Quality, storage: Storage | None
) -> tuple[np.ndarray, Quality]:
    """The points as the storage keeps them, and their quality, which is not below that of the input."""
    if storage is None:
        return points, measure(domain, points, relaxed)
    kept = storage.stored(points)
    after = measure(domain, kept, relaxed)
    if _worse(after, before) and storage.widen():
        kept = storage.stored(points)
        after = measure(domain, kept, relaxed)
    if _worse(after, before):
        raise OutputError(
            f"rounding the coordinates as the output stores them would lower Q1 from {before.q1:.6g} to "
            f"{after.q1:.6g}; choose a format with 64-bit coordinates"
        )
    return kept, after


def _worse(after: Quality, before: Quality) -> bool:
    if after.q1 is None or before.q1 is None:
        return False
    return after.inverted > before.inverted or after.q1 < before.q1


def mesh_quality(mesh: Mesh, worst: int = 10) -> QualityReport:
    """The quality report of a Mesh; curved second-order cells count as straight."""
    domain = domain_of(mesh, straighten=True)
    relaxed = np.flatnonzero(domain.interior)
    return QualityReport(summarise(mesh, domain), len(relaxed), measure(domain, mesh.points, relaxed, worst))


def compare_meshes(before: Mesh, after: Mesh) -> Comparison:
    """The comparison of two meshes of one connectivity; InputError when their cells differ."""
    return compare_qualities(mesh_quality(before), mesh_quality(after), same_connectivity(before, after))


def same_connectivity(before: Mesh, after: Mesh) -> bool:
    """Whether two meshes have equally many points and the same cells in the same order."""
    return (len(before.points), len(before.cells)) == (len(after.points), len(after.cells)) and all(
        x.type == y.type and np.array_equal(x.vertices, y.vertices)
        for x, y in zip(before.cells, after.cells, strict=True)
    )


def as_mesh(
    mesh: meshio.Mesh | np.ndarray,
    cells: Mapping[str, np.ndarray] | Sequence[tuple[str, np.ndarray]] | None,
) -> Mesh:
    """A Mesh from what a caller hands over; see ``smooth``."""
    if not isinstance(mesh, np.ndarray):
        return from_meshio(mesh)
    if cells is None:
        raise UsageError("cells: needed when points are given")
    if mesh.ndim != 2 or mesh.shape[1] not in (2, 3):
        raise UsageError(f"points: shape {mesh.shape} is not (N, 2) or (N, 3)")
    pairs = cells.items() if isinstance(cells, Mapping) else cells
    return Mesh(np.array(mesh, dtype=np.float64), [Cells(name, np.asarray(array)) for name, array in pairs])
