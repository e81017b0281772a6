"""Measuring meshes, and comparing meshes of one connectivity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.api.boundary import usual_moves
from dvr_cli.api.metric import MetricSource
from dvr_cli.api.shapes import shaped
from dvr_cli.errors import InputError
from dvr_cli.mesh.domain import Domain, domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.region_choice import RegionChoice
from dvr_cli.quality.measure import measure
from dvr_cli.report.records import QualityReport, ShapeUse, summarise

if TYPE_CHECKING:
    from dvr_cli.report.compare import Comparison


def mesh_quality(
    mesh: Mesh,
    worst: int = 10,
    regions: RegionChoice = (),
    metric: MetricSource | None = None,
    by_measure: str | None = None,
) -> QualityReport:
    """The quality report of a Mesh; relaxed are the vertices that ``smooth`` moves by default.

    by_measure: the name of the measure whose worst cells and histogram are wanted, too.
    """
    from dvr_cli.quality.cell_measures import CELL_MEASURES, Geometry, distribution, summaries

    domain = domain_of(mesh, regions=regions)
    if metric is not None:
        shapes = shaped(domain, "ideal", metric.tensors(mesh))
        domain = shapes.domain
    else:
        shapes = shaped(domain, "auto")
    moves = usual_moves(mesh, domain, shapes.held)
    quality = measure(domain, mesh.points, moves.relaxed, worst, by_corner=shapes.quality)
    mode = "auto" if metric is None else "metric"
    stretched = ShapeUse(mode, shapes.kept, shapes.max_aspect) if shapes.kept or metric else None
    relative = measure(shapes.domain, mesh.points, moves.relaxed) if metric is None and shapes.kept else None
    summary = summarise(mesh, domain, moves.constraints)
    geometry = Geometry(domain, mesh.points)
    by = None if by_measure is None else distribution(geometry, CELL_MEASURES[by_measure], worst)
    others, kept = summaries(geometry), shapes.kept_cells
    return QualityReport(summary, len(moves.relaxed), quality, stretched, others, by, kept, relative)


def compare_meshes(meshes: Sequence[Mesh], metric: MetricSource | None = None) -> Comparison:
    """The comparison of two or more meshes of one connectivity; InputError when their cells differ.

    Cells that are stretched coherently in the first are measured against their shape there in all.
    metric: that of the first, in which all are measured then; InputError where their cells differ.
    """
    return compare_domains(meshes, [domain_of(mesh) for mesh in meshes], metric)


def compare_domains(
    meshes: Sequence[Mesh],
    domains: Sequence[Domain],
    metric: MetricSource | None = None,
    by_measure: str | None = None,
) -> Comparison:
    """As ``compare_meshes``, of meshes and their domains; relaxed are in all the vertices of the first.

    by_measure: the name of the measure that they are judged by, all cells counting; None: quality vectors.
    """
    from dvr_cli.quality.cell_measures import CELL_MEASURES, Geometry, summary
    from dvr_cli.report.compare import Judged, compare_qualities

    same = same_connectivity(meshes)
    if metric is not None and not same:
        raise InputError("the cells differ: a metric of the first mesh says nothing about the others")
    if metric is None:
        shapes = [shaped(domain, "auto") for domain in domains]
    else:
        shapes = [shaped(domains[0], "ideal", metric.tensors(meshes[0]))] * len(meshes)
    moves = [
        usual_moves(mesh, domain, own.held) for mesh, domain, own in zip(meshes, domains, shapes, strict=True)
    ]
    relaxed = [(moves[0] if same else own).relaxed for own in moves]
    kept = shapes[0].kept_cells if same else None
    judged = None
    if by_measure is not None:
        chosen, states = CELL_MEASURES[by_measure], zip(meshes, domains, strict=True)
        judged = Judged(chosen, [chosen.of(Geometry(domain, mesh.points)) for mesh, domain in states])
    if same and (shapes[0].kept or metric):
        corners = shapes[0].corners_free_to_move()
        domains = [replace(domain, corners=corners) for domain in domains]
    reports = [
        QualityReport(
            summarise(mesh, domain, own.constraints),
            len(moving),
            measure(domain, mesh.points, moving),
            kept=kept,
            measures=[] if judged is None else [summary(judged.measure, judged.values[i])],
        )
        for i, (mesh, domain, own, moving) in enumerate(zip(meshes, domains, moves, relaxed, strict=True))
    ]
    return compare_qualities(reports, same, judged)


def same_connectivity(meshes: Sequence[Mesh]) -> bool:
    """True if meshes have equally many points and the same cells in the same order."""
    reference = meshes[0]
    return all(
        (len(reference.points), len(reference.cells)) == (len(other.points), len(other.cells))
        and all(
            x.type == y.type and np.array_equal(x.vertices, y.vertices)
            for x, y in zip(reference.cells, other.cells, strict=True)
        )
        for other in meshes[1:]
    )
