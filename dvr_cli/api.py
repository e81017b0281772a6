"""What ``import dvr_cli`` offers: arrays or ``meshio.Mesh`` in, arrays or ``meshio.Mesh`` out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dvr_cli.errors import UsageError
from dvr_cli.files.arrays import read_directions
from dvr_cli.mesh.convert import from_meshio, to_meshio
from dvr_cli.mesh.corners import Corners
from dvr_cli.mesh.domain import Domain, domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.relax.directions import direction_field
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.schedule import ORDERS
from dvr_cli.relax.stopping import Stopping
from dvr_cli.relax.sweeps import Sweep, relax
from dvr_cli.report.compare import Comparison, compare_qualities
from dvr_cli.report.quality import measure
from dvr_cli.report.records import QualityReport, SmoothReport, summarise

if TYPE_CHECKING:
    import meshio

Directions = str | np.ndarray | Sequence[str | np.ndarray]


@dataclass(frozen=True)
class SmoothOptions:
    """How to relax; the fields are those of ``dvr smooth --help``.

    directions: comma-separated names, an array (N, d) or (K, N, d), or a list of these, one a sweep, cycled.
    center, axis: for "circumferential" and "radial"; default the centroid of the points and the z axis.
    order: "coloured", "natural" or "shuffled". stopping: when to stop. seed: for random directions and order.
    """

    directions: Directions = "random"
    center: Sequence[float] | None = None
    axis: Sequence[float] | None = None
    order: str = "coloured"
    seed: int = 0
    stopping: Stopping = field(default_factory=Stopping)

    def __post_init__(self) -> None:
        """Check what can be checked without a mesh; raises UsageError."""
        if self.order not in ORDERS:
            raise UsageError(f"order: unknown {self.order!r}; known: {', '.join(ORDERS)}")
        if not 0 <= self.seed < 2**64:
            raise UsageError("seed: must be between 0 and 2^64 - 1")

    def entries(self) -> list[str | np.ndarray]:
        """The directions as a list; arrays named by "file:PATH" are read."""
        given = [self.directions] if isinstance(self.directions, str | np.ndarray) else self.directions
        result: list[str | np.ndarray] = []
        for item in given:
            if not isinstance(item, str):
                result.append(item)
                continue
            for name in item.split(","):
                path = name.strip().removeprefix("file:")
                result.append(path if path == name.strip() else read_directions(Path(path)))
        return result

    def record(self) -> dict[str, Any]:
        """The options as JSON-ready data."""
        given = [self.directions] if isinstance(self.directions, str | np.ndarray) else self.directions
        return {
            "directions": ",".join(d if isinstance(d, str) else f"array{d.shape}" for d in given),
            "center": None if self.center is None else [float(c) for c in self.center],
            "axis": None if self.axis is None else [float(a) for a in self.axis],
            "order": self.order,
            "seed": self.seed,
            "max_iterations": self.stopping.max_iterations,
            "tol": self.stopping.tol,
            "patience": self.stopping.patience,
            "target": self.stopping.target,
            "time_limit": self.stopping.time_limit,
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
    options = SmoothOptions(
        directions, center, axis, order, seed, Stopping(max_iterations, tol, patience, target, time_limit)
    )
    internal = as_mesh(mesh, cells)
    points, report = smooth_mesh(internal, options)
    if isinstance(mesh, np.ndarray):
        return points, report
    return to_meshio(internal, points), report


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


def smooth_mesh(
    mesh: Mesh,
    options: SmoothOptions,
    stored: Callable[[np.ndarray], np.ndarray] = lambda points: points,
    on_sweep: Callable[[Sweep], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
) -> tuple[np.ndarray, SmoothReport]:
    """Relax a Mesh; returns its new points (N, 2|3) and the report.

    stored: the coordinates as the output will hold them; the report's final qualities are theirs.
    on_sweep, interrupted: see ``sweeps.relax``.
    """
    domain = domain_of(mesh)
    relaxed = np.flatnonzero(domain.interior)
    directions = direction_field(
        options.entries(), domain, mesh.point_data, options.seed, options.center, options.axis
    )
    before = measure(domain, mesh.points, relaxed)
    begin = time.perf_counter()
    problem = build_problem(domain.corners, relaxed, len(mesh.points), options.order, options.seed)
    touched = _touched_corners(domain, relaxed)
    outcome = relax(problem, touched, domain.points, directions, options.stopping, on_sweep, interrupted)
    seconds = time.perf_counter() - begin
    points = stored(domain.lift(mesh.points, outcome.points))
    report = SmoothReport(
        mesh=summarise(mesh, domain),
        relaxed=len(relaxed),
        before=before,
        after=measure(domain, points, relaxed),
        sweeps=[asdict(sweep) for sweep in outcome.sweeps],
        stopped_because=outcome.stopped_because,
        seconds=seconds,
        engine="numpy",
        threads=1,
        options=options.record(),
    )
    return points, report


def mesh_quality(mesh: Mesh, worst: int = 10) -> QualityReport:
    """The quality report of a Mesh."""
    domain = domain_of(mesh)
    relaxed = np.flatnonzero(domain.interior)
    return QualityReport(summarise(mesh, domain), len(relaxed), measure(domain, mesh.points, relaxed, worst))


def compare_meshes(before: Mesh, after: Mesh) -> Comparison:
    """The comparison of two meshes of one connectivity; InputError when their cells differ."""
    same = len(before.points) == len(after.points) and _same_cells(before.cells, after.cells)
    return compare_qualities(mesh_quality(before), mesh_quality(after), same)


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


def _touched_corners(domain: Domain, relaxed: np.ndarray) -> Corners:
    """The corners that contain a relaxed vertex (of which ``first`` has no meaning)."""
    moves = np.zeros(len(domain.points), dtype=bool)
    moves[relaxed] = True
    corners = domain.corners
    touched = moves[corners.vertices].any(axis=1)
    return Corners(corners.vertices[touched], corners.shapes[touched], corners.first[:1])


def _same_cells(a: list[Cells], b: list[Cells]) -> bool:
    return len(a) == len(b) and all(
        x.type == y.type and np.array_equal(x.vertices, y.vertices) for x, y in zip(a, b, strict=True)
    )
