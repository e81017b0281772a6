"""Reports as plain data for JSON: versioned by ``schema``, free of NaN, units stated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from dvr_cli import __version__
from dvr_cli.boundary.constraints import Constraints
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.region_choice import Divider
from dvr_cli.quality.limits import Limit
from dvr_cli.quality.measure import Quality
from dvr_cli.quality.measures import units
from dvr_cli.relax.phases import TANGLED, MorphPhase, Phase, UnfoldPhase, UntanglePhase
from dvr_cli.relax.stopping import StopReason

if TYPE_CHECKING:
    from dvr_cli.quality.cell_measures import Distribution, Summary


def _units() -> dict[str, str]:
    """The unit of each kind of number in a report."""
    return {
        "quality": "mean ratio, from -1 to 1",
        **units(),
        "seconds": "second",
        "deviation": "that of the coordinates",
    }


@dataclass(frozen=True)
class MeshSummary:
    """The summary of a mesh in a report.

    cells: number of cells by type, of all dimensions. dimension: 2 or 3. mirrored: cells stored inside out.
    regions: how many regions there are, and divided_by: what tells them apart.
    repeated: cells that have the vertices of another and count once with it. orphans: vertices in no cell.
    hanging: vertices inside a facet they are not connected to; coincident: those in the place of
        another. Both are looked for only where the boundary moves, else None.
    curved: second-order cells that are not straight, straighten: whether they
    are taken as such; else their vertices stay. surface:
        whether it is a surface in space.
    """

    points: int
    cells: dict[str, int]
    dimension: int
    mirrored: int
    regions: int
    divided_by: tuple[Divider, ...]
    repeated: int
    orphans: int
    hanging: int | None
    coincident: int | None
    curved: int
    straighten: bool
    surface: bool


@dataclass(frozen=True)
class BoundaryChange:
    """The change of a boundary, or a surface, on which vertices walked.

    deviation: the largest distance between the old and the new one, measured from both, and max_deviation:
    the bound it keeps, in the unit of the coordinates. volume_change, area_change: of the domain and of its
    boundary, of a surface, or of a planar domain, relative to the input; None where there is no such thing.
    """

    deviation: float
    max_deviation: float
    volume_change: float | None
    area_change: float | None


@dataclass(frozen=True)
class ShapeUse:
    """The shapes that cells were measured against.

    mode: "auto", "ideal", "input" or "metric". kept: how many cells against their own shape in the input, so
    that the qualities in the report are relative to that. max_aspect: the largest aspect among those kept, or
    that the metric asks for.
    """

    mode: str
    kept: int
    max_aspect: float


@dataclass(frozen=True, eq=False)
class QualityReport:
    """The report of ``dvr report quality``.

    stretched: the cells that ``--shape auto`` would keep, or the metric; None if there is neither. measures:
    those beside the mean ratio. by: the cells by the measure that was asked for, None for the mean ratio.
    kept: (n,) bool, which of the domain's cells would be kept, None if there are none.
    relative: where there are some, the qualities relative to their shapes, as ``dvr smooth`` gives them.
    """

    mesh: MeshSummary
    relaxed: int
    quality: Quality
    stretched: ShapeUse | None = None
    measures: list[Summary] = field(default_factory=list)
    by: Distribution | None = None
    kept: np.ndarray | None = None
    relative: Quality | None = None

    @property
    def distribution(self) -> Distribution:
        """The cells by the measure that was asked for, or by the mean ratio."""
        from dvr_cli.quality.cell_measures import by_quality

        return self.by or by_quality(self.quality)

    def record(self, path: str | None = None) -> dict[str, Any]:
        """The report as JSON-ready data, schema dvr.quality/1."""
        return {
            "schema": "dvr.quality/1",
            "dvr_version": __version__,
            "mesh": {"path": path, **asdict(self.mesh)},
            "relaxed": self.relaxed,
            "units": _units(),
            "quality": _quality_record(self.quality),
            "stretched": None if self.stretched is None else asdict(self.stretched),
            "relative": None if self.relative is None else _quality_record(self.relative),
            "measures": {summary.measure.name: _summary_record(summary) for summary in self.measures},
            "by_measure": None if self.by is None else _distribution_record(self.by),
            "quality_vector": self.quality.vector.tolist(),
        }


@dataclass(frozen=True, eq=False)
class SmoothReport:
    """The report of a command that moves vertices: qualities before and after, sweeps, how it was run.

    phases: "relax", with "unfold" and "untangle" before it, "patches" and "polish" after it: for each what it
        guarantees, how many sweeps it took, why it stopped; for polishing the floor, below which no quality
        fell that was not below it before; for untangling its rounds (free vertices, elements inverted or
        degenerate after each, seconds) and those that remain in the result (elements), of them those with a
        corner whose vertices are all held (hopeless) or else near held facets that cross (crossing); for
        unfolding how many triangles lay folded (found) and still do (left, places), and vertices that moved.
        Of ``dvr morph`` only "morph": what part of the displacement was made (fraction), and its substeps:
        the fraction after each, Q1 before and after relaxing (q1_before, q1), how many sweeps that took.
    sweeps: for each its number from 1 (sweep), its phase, Q1 after it (q1), vertices moved, seconds taken,
        when polishing the mean quality of the corners with a relaxed vertex (mean, else null), and if a
        picture was asked for the mean quality of all elements (elements_mean).
    stopped_because: why it ended.
    limited_by: what holds the worst element where relaxing on would not, None if that is not known.
    left: the elements that are inverted or degenerate in the end, by reason: as for untangling.
    level: of care: the quality below which every element was cared for, None where only Q1 was.
    boundary: what became of a boundary or surface on which vertices walked, else None.
    put_back: with a CAD model how many vertices that had moved went back to where the input has them, as an
        element would have become too bad on the model; None without one.
    seconds: time of the relaxation, reading and writing aside. engine: what computed; "numpy, then numba"
        where kernels had to be compiled meanwhile, with "in part" where not all of them were ready in time.
    shape: what cells were measured against. plain: where some were kept, or in a metric, the qualities
        before and after with ideal targets for all. kept: (n,) bool, the cells of the domain that are kept as
        they are, None where there are none.
    """

    mesh: MeshSummary
    relaxed: int
    before: Quality
    after: Quality
    phases: Sequence[Phase]
    sweeps: list[dict[str, Any]]
    stopped_because: StopReason
    limited_by: Limit | None
    seconds: float
    engine: str
    threads: int
    options: dict[str, Any]
    left: Mapping[str, int] = field(default_factory=lambda: dict.fromkeys(TANGLED, 0))
    level: float | None = None
    boundary: BoundaryChange | None = None
    put_back: int | None = None
    shape: ShapeUse = ShapeUse("ideal", 0, 1.0)
    plain: tuple[Quality, Quality] | None = None
    kept: np.ndarray | None = None

    @property
    def untangling(self) -> UntanglePhase | None:
        """The phase of untangling, None if it was not asked for."""
        return next((phase for phase in self.phases if isinstance(phase, UntanglePhase)), None)

    @property
    def unfolding(self) -> UnfoldPhase | None:
        """The phase of unfolding, None if nothing lay folded."""
        return next((phase for phase in self.phases if isinstance(phase, UnfoldPhase)), None)

    @property
    def is_untouched(self) -> bool:
        """True if the worst element has no relaxed vertex, and it is known what would free it."""
        return self.after.is_capped and self.limited_by is not None

    @property
    def morphing(self) -> MorphPhase | None:
        """The phase of morphing, None if it was not asked for."""
        return next((phase for phase in self.phases if isinstance(phase, MorphPhase)), None)

    def record(self, path: str | None = None, source: str | None = None) -> dict[str, Any]:
        """The report as JSON-ready data, schema dvr.smooth/1; ``quality`` is that of the result.

        path: where the result is; source: where the input was.
        """
        after = _quality_record(self.after)
        return {
            "schema": "dvr.smooth/1",
            "dvr_version": __version__,
            "input": source,
            "mesh": {"path": path, **asdict(self.mesh)},
            "relaxed": self.relaxed,
            "units": _units(),
            "quality": after,
            "before": _quality_record(self.before),
            "after": after,
            "phases": [phase.record() for phase in self.phases],
            "sweeps": self.sweeps,
            "stopped_because": self.stopped_because,
            "limited_by": None if self.limited_by is None else asdict(self.limited_by),
            "left": dict(self.left),
            "level": self.level,
            "boundary": None if self.boundary is None else asdict(self.boundary),
            "put_back": self.put_back,
            "shape": asdict(self.shape),
            "plain": None
            if self.plain is None
            else {name: _quality_record(q) for name, q in zip(("before", "after"), self.plain, strict=True)},
            "seconds": self.seconds,
            "engine": self.engine,
            "threads": self.threads,
            "seed": self.options["seed"],
            "options": self.options,
            "quality_vector": self.after.vector.tolist(),
            "quality_vector_before": self.before.vector.tolist(),
        }


def summarise(mesh: Mesh, domain: Domain, constraints: Constraints | None = None) -> MeshSummary:
    """The summary of a mesh and its domain; constraints: those of a boundary that moves."""
    cells: dict[str, int] = {}
    for block in mesh.cells:
        cells[block.type] = cells.get(block.type, 0) + len(block.vertices)
    return MeshSummary(
        points=len(mesh.points),
        cells=cells,
        dimension=domain.dimension,
        mirrored=domain.mirrored,
        regions=int(domain.region.max(initial=0)) + 1,
        divided_by=domain.divided_by,
        repeated=len(domain.repeated),
        orphans=_orphans(mesh),
        hanging=None if constraints is None else len(constraints.hanging),
        coincident=None if constraints is None else len(constraints.coincident),
        curved=domain.mids.curved if domain.mids is not None else 0,
        straighten=domain.straighten,
        surface=domain.is_surface,
    )


def _orphans(mesh: Mesh) -> int:
    """The number of vertices that are in no cell of any dimension."""
    used = np.zeros(len(mesh.points), dtype=bool)
    for block in mesh.cells:
        used[block.vertices] = True
    return int(len(used) - used.sum())


def _summary_record(summary: Summary) -> dict[str, Any]:
    return {
        "unit": summary.measure.unit,
        "worst": summary.worst,
        "mean": summary.mean,
        "quantiles_from_worst": {f"{q:g}": value for q, value in summary.quantiles.items()},
    }


def _distribution_record(by: Distribution) -> dict[str, Any]:
    return {
        "measure": by.measure and by.measure.name,
        "edges": by.edges.tolist(),
        "histogram": by.counts.tolist(),
        "worst": [
            {"cell_type": w.cell_type, "cell": w.cell, "value": w.quality, "centroid": w.centroid}
            for w in by.worst
        ],
    }


def _quality_record(quality: Quality) -> dict[str, Any]:
    return {
        "q1": quality.q1,
        "q1_element": None if quality.q1_element is None else asdict(quality.q1_element),
        "fixed_cap": quality.fixed_cap,
        "min": quality.minimum,
        "mean": quality.mean,
        "quantiles": {f"{q:g}": value for q, value in quality.quantiles.items()},
        "inverted": quality.inverted,
        "uncertain": quality.uncertain,
        "degenerate": quality.degenerate,
        **quality.measures,
        "histogram": quality.histogram.tolist(),
        "worst": [asdict(element) for element in quality.worst],
    }
