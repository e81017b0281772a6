"""One line of advice on a mesh that is to be used or relaxed, from its quality report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvr_cli.quality.limits import FAIR

if TYPE_CHECKING:
    from dvr_cli.report.records import QualityReport


def advice(report: QualityReport) -> str:
    """One line on what would help the worst element."""
    quality = report.quality
    poor = quality.inverted + quality.degenerate
    if quality.minimum >= FAIR:
        return f"every element has quality {FAIR:g} or better: no need to do anything"
    if report.mesh.curved and quality.inverted:
        return f"{poor} inverted or degenerate: dvr untangle --straighten takes curved cells as straight"
    if poor and report.mesh.surface:
        return f"{poor} inverted or degenerate: surfaces cannot be untangled, remesh there"
    if quality.q1 is None:
        return "no vertex lies inside the mesh: free those on the boundary, or remesh"
    if report.kept is not None and quality.elements[~report.kept].min(initial=1.0) >= FAIR:
        return (
            f"all but the cells that dvr smooth keeps have quality {FAIR:g} or better: no need to do anything"
        )
    if quality.fixed_cap is not None and quality.fixed_cap <= quality.minimum:
        return "the worst element has no vertex inside the mesh: free those on the boundary, or remesh there"
    if poor:
        return f"{poor} inverted or degenerate: dvr smooth makes positive what it can"
    return "dvr smooth can move vertices of the worst element to make it better"
