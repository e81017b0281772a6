"""Measures beside the mean ratio that solvers' users judge meshes by: one record each, and their summary."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES, CellType
from dvr_cli.mesh.domain import Domain, domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.simplex import chunks
from dvr_cli.quality.face_measures import Faces, face_skewness, faces_of, non_orthogonality
from dvr_cli.quality.measure import HISTOGRAM_BINS, Element, Quality, cell_field, element_of, quantiles
from dvr_cli.quality.verdict import (
    Vertices,
    aspect_ratio,
    largest_angle,
    scaled_jacobian,
    skewness,
    smallest_angle,
)

_UNBOUNDED = 1e30  # Verdict's value for a ratio that has no bound


class Geometry:
    """The cells of a domain, and where they are: what measures are taken of.

    domain: of the cells. given: (N, 2|3) coordinates as its mesh gives them, points: as the domain has them.
    blocks: the linear cells. dimension: 2 or 3.
    """

    def __init__(self, domain: Domain, points: np.ndarray) -> None:
        """points: coordinates as the mesh of the domain gives them."""
        self.domain, self.given = domain, points
        self.points, self.blocks = domain.flatten(points), domain.cells
        self.dimension = domain.dimension

    @cached_property
    def faces(self) -> Faces:
        """The faces of volume cells."""
        return faces_of(self.points, self.blocks, self.domain.backend)


@dataclass(frozen=True)
class CellMeasure:
    """One measure of cells.

    name: on the command line. label: in words. unit: "deg", or "1" for pure numbers.
    high_is_good: whether larger values are better. worst: the value of a cell without extent.
    values: the measure (n,) of each cell.
    dimensions: of the cells that have it. signed: whether values below zero mean inverted cells.
    """

    name: str
    label: str
    unit: str
    high_is_good: bool
    worst: float
    values: Callable[[Geometry], np.ndarray]
    dimensions: tuple[int, ...] = (2, 3)
    signed: bool = False

    def of(self, geometry: Geometry) -> np.ndarray:
        """(n,) the measure of each cell; InputError for cells of another dimension."""
        if geometry.dimension not in self.dimensions:
            raise InputError(f"{self.label} is a measure of volume cells, and the mesh has none")
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            values = self.values(geometry)
        return np.where(np.isfinite(values), values, self.worst)

    def worst_first(self, values: np.ndarray) -> np.ndarray:
        """The numbers of the cells, the worst first, equal ones by number."""
        return np.argsort(values if self.high_is_good else -values, kind="stable")


@dataclass(frozen=True)
class Summary:
    """One measure over a mesh: the worst value, the mean, and quantiles counted from the worst cell."""

    measure: CellMeasure
    worst: float
    mean: float
    quantiles: dict[float, float]


def summary(measure: CellMeasure, values: np.ndarray) -> Summary:
    """The summary of the values (n,) of a measure."""
    ascending = np.sort(values)
    return Summary(
        measure,
        worst=float(values.min() if measure.high_is_good else values.max()),
        mean=float(values.mean()),
        quantiles=quantiles(ascending if measure.high_is_good else ascending[::-1]),
    )


@dataclass(frozen=True, eq=False)
class Distribution:
    """The cells of a mesh by the value of one measure.

    measure: None for the mean ratio. edges: (B + 1,) of the bins of the histogram, counts: (B,) cells in
    each; values beyond the last edge are in the last bin. worst: the worst cells, worst first, with values.
    """

    measure: CellMeasure | None
    edges: np.ndarray
    counts: np.ndarray
    worst: list[Element]


def distribution(geometry: Geometry, measure: CellMeasure, worst: int) -> Distribution:
    """The distribution of a measure over the cells of a domain; worst: how many to list."""
    values = measure.of(geometry)
    bounded = values[np.abs(values) < _UNBOUNDED]
    low, high = (bounded.min(), bounded.max()) if len(bounded) else (0.0, 1.0)
    edges = np.linspace(low, high if high > low else low + 1.0, HISTOGRAM_BINS + 1)
    counts, _ = np.histogram(np.clip(values, edges[0], edges[-1]), edges)
    cells = measure.worst_first(values)[:worst]
    listed = [element_of(geometry.domain, geometry.given, values, int(cell)) for cell in cells]
    return Distribution(measure, edges, counts, listed)


def by_quality(quality: Quality) -> Distribution:
    """The distribution of the mean ratio; inverted cells are in the first bin."""
    edges = np.linspace(0.0, 1.0, HISTOGRAM_BINS + 1)
    return Distribution(None, edges, quality.histogram, quality.worst)


def summaries(geometry: Geometry) -> list[Summary]:
    """The summaries of all measures that the cells have."""
    having = [measure for measure in CELL_MEASURES.values() if geometry.dimension in measure.dimensions]
    return [summary(measure, measure.of(geometry)) for measure in having]


def measure_field(mesh: Mesh, name: str, points: np.ndarray) -> list[np.ndarray]:
    """A measure of the cells of a mesh with coordinates ``points``, one array a block; see ``cell_field``."""
    return cell_field(mesh, CELL_MEASURES[name].of(Geometry(domain_of(mesh, straighten=True), points)))


def _by_type(function: Callable[[Vertices, CellType], np.ndarray]) -> Callable[[Geometry], np.ndarray]:
    """The values of a function of ``verdict`` over blocks of cells."""

    def values(geometry: Geometry) -> np.ndarray:
        axes = geometry.points.T
        parts = [
            function([[axis[v] for axis in axes] for v in block.vertices[chunk].T], CELL_TYPES[block.type])
            for block in geometry.blocks
            for chunk in chunks(len(block.vertices))
        ]
        return np.concatenate([np.empty(0), *parts])

    return values


CELL_MEASURES = {
    measure.name: measure
    for measure in (
        CellMeasure(
            "scaled-jacobian", "scaled Jacobian", "1", True, 0.0, _by_type(scaled_jacobian), signed=True
        ),
        CellMeasure("aspect-ratio", "aspect ratio", "1", False, _UNBOUNDED, _by_type(aspect_ratio)),
        CellMeasure("skewness", "equiangle skewness", "1", False, 1.0, _by_type(skewness)),
        CellMeasure("min-angle", "smallest angle", "deg", True, 0.0, _by_type(smallest_angle)),
        CellMeasure("max-angle", "largest angle", "deg", False, 180.0, _by_type(largest_angle)),
        CellMeasure(
            "non-orthogonality",
            "non-orthogonality",
            "deg",
            False,
            180.0,
            lambda geometry: non_orthogonality(geometry.faces),
            (3,),
        ),
        CellMeasure(
            "face-skewness",
            "face skewness",
            "1",
            False,
            _UNBOUNDED,
            lambda geometry: face_skewness(geometry.faces),
            (3,),
        ),
    )
}
