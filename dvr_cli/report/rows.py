"""The rows of a report, label and value, as all reports in words and tables show them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from dvr_cli.quality.measures import labelled

if TYPE_CHECKING:
    from dvr_cli.quality.cell_measures import Distribution, Summary
    from dvr_cli.quality.measure import Element, Quality
    from dvr_cli.report.records import QualityReport

Value = float | int | None
MEASURE_COLUMNS = ("worst", "1 %", "10 %", "50 %", "mean")  # quantiles are counted from the worst cell


def mesh_rows(report: QualityReport) -> list[tuple[str, int]]:
    """The rows on the mesh itself: label and number."""
    mesh = report.mesh
    regions = [("regions", mesh.regions)] if mesh.regions > 1 else []
    return [("points", mesh.points), *mesh.cells.items(), ("relaxed vertices", report.relaxed), *regions]


def quality_rows(quality: Quality, dimension: int) -> list[tuple[str, Value]]:
    """The rows of a quality block: label and value, None for what the mesh does not have."""
    return [
        ("Q1", quality.q1),
        ("fixed cap", quality.fixed_cap),
        ("worst", quality.minimum),
        *((f"{100 * q:g} % quantile", value) for q, value in quality.quantiles.items()),
        ("mean", quality.mean),
        ("inverted", quality.inverted),
        ("degenerate", quality.degenerate),
        *labelled(quality.measures, dimension),
    ]


def remarks(quality: Quality) -> dict[str, str]:
    """Remarks on the rows of a quality block, by label: their meaning, and the place of the worst."""
    result = {"Q1": "nothing can be relaxed", "fixed cap": "every element has a relaxed vertex"}
    if quality.q1_element is not None:
        result["Q1"] = place(quality.q1_element, 4)
    if quality.fixed_cap is not None:
        result["fixed cap"] = "worst without a relaxed vertex"
    if quality.worst:
        result["worst"] = place(quality.worst[0], 4)
    return result


def histogram_rows(distribution: Distribution) -> list[tuple[str, int]]:
    """The rows of the histogram: range of values and number of elements."""
    edges = distribution.edges.tolist()
    digits = ".2f" if distribution.measure is None else ".4g"
    labels = [f"{low:{digits}} - {high:{digits}}" for low, high in pairwise(edges)]
    if distribution.measure is None:
        labels[0] = f"below {edges[1]:{digits}}"
    return list(zip(labels, distribution.counts.tolist(), strict=True))


def measure_rows(summaries: Sequence[Summary]) -> list[tuple[str, list[float]]]:
    """The rows of other measures, below MEASURE_COLUMNS: label, and worst, quantiles and mean."""
    return [
        (
            f"{s.measure.name}{' (deg)' if s.measure.unit == 'deg' else ''}",
            [s.worst, *s.quantiles.values(), s.mean],
        )
        for s in summaries
    ]


def place(element: Element, digits: int) -> str:
    """An element and its place in words."""
    centroid = ", ".join(f"{x:.{digits}g}" for x in element.centroid)
    return f"{element.cell_type} {element.cell} at ({centroid})"
