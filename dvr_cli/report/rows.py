"""The rows of a report, label and value, as all reports in words and tables show them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvr_cli.quality.measures import labelled

if TYPE_CHECKING:
    from dvr_cli.quality.measure import Element, Quality
    from dvr_cli.report.records import QualityReport

Value = float | int | None


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


def histogram_rows(quality: Quality) -> list[tuple[str, int]]:
    """The rows of the histogram: range of qualities and number of elements."""
    n = len(quality.histogram)
    labels = [f"below {1 / n:.2f}", *(f"{i / n:.2f} - {(i + 1) / n:.2f}" for i in range(1, n))]
    return list(zip(labels, quality.histogram.tolist(), strict=True))


def place(element: Element, digits: int) -> str:
    """An element and its place in words."""
    centroid = ", ".join(f"{x:.{digits}g}" for x in element.centroid)
    return f"{element.cell_type} {element.cell} at ({centroid})"
