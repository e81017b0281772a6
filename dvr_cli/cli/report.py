"""``dvr report``: the quality of one mesh, and which of several is best."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from dvr_cli.cli.codes import DONE, GATE_FAILED
from dvr_cli.cli.files import PICTURES, check, write_picture
from dvr_cli.cli.gates import failures, gates_of
from dvr_cli.cli.help import example
from dvr_cli.cli.options import naming, takes_options
from dvr_cli.cli.streams import bar, columns, emit, say
from dvr_cli.errors import UsageError

QUALITY_EXAMPLES = (
    example("dvr report quality in.msh", "the worst element and where it is, quantiles, a histogram"),
    example("dvr report quality in.msh --json | jq .quality.q1", "one figure of it"),
    example("dvr report quality in.msh --plot q.html", "a page to turn, cut and pick the mesh"),
)
COMPARE_EXAMPLES = (
    example("dvr report compare before.msh after.msh", "which is better; exit code 1 if the last is worse"),
    example("dvr report compare before.msh after.msh --measure min-angle", "by the cells' smallest angles"),
)


@takes_options("quality")
def quality(
    path: Annotated[Path, typer.Argument(metavar="MESH", help="The mesh to measure.")],
    **given: Any,
) -> int:
    """Print the quality of a mesh: Q1, quantiles, angles, a histogram, the worst elements.

    On a terminal it is laid out for reading; elsewhere each figure is a line of label, value and remark,
    separated by tabs.
    """
    from dvr_cli.api.measuring import mesh_quality
    from dvr_cli.api.metric import metric_source
    from dvr_cli.files.reading import open_mesh
    from dvr_cli.quality.cell_measures import measure_field
    from dvr_cli.report.export import as_csv, as_json, cells_as_csv
    from dvr_cli.report.table import quality_table
    from dvr_cli.report.text.quality import quality_text

    json, csv, plot, name = given["json"], given["csv"], given["plot"], given["measure"]
    gates = gates_of(given)
    if json and csv:
        raise UsageError("--json and --csv exclude each other")
    if plot is not None:
        check("--plot", plot, PICTURES, [path])
    mesh = open_mesh(path, given["input_format"], given["mesh"]).mesh
    metric = metric_source(given["metric"])
    with naming(path):
        chosen = given["regions"] or ()
        report = mesh_quality(mesh, given["worst"], chosen, metric, name)
        failed = failures(gates, report.quality, mesh, mesh.points)
    if plot is not None:
        text = quality_text(report, str(path), "█")
        write_picture(
            plot,
            mesh,
            {path.name: (mesh.points, report.quality)},
            str(path),
            text,
            kept=report.kept,
            measure=name,
        )
    if json:
        emit(as_json(report.record(str(path))))
    elif csv:
        field = None if name is None else measure_field(mesh, name, mesh.points)
        emit(as_csv(report.quality) if field is None else cells_as_csv(mesh, field))
    elif width := columns(sys.stdout):
        emit(quality_text(report, str(path), bar(), width))
    else:
        emit(quality_table(report, str(path)))
    for text in failed:
        say(f"dvr: {path}: {text}")
    return GATE_FAILED if failed else DONE


@takes_options("compare")
def compare(
    before: Annotated[Path, typer.Argument(metavar="BEFORE", help="The first mesh.")],
    after: Annotated[list[Path], typer.Argument(metavar="AFTER...", help="More meshes of the same cells.")],
    **given: Any,
) -> int:
    """Rank meshes by their quality vectors; exit with code 1 if the last is worse than the first.

    The vectors (for each relaxed vertex the worst quality around it, ascending) are compared at the first
    component in which they differ; with --measure the values of all cells are, worst first. Elsewhere than on
    a terminal each mesh is a line of its rank and figures, separated by tabs, in the order given.
    """
    from dvr_cli.api.measuring import compare_domains
    from dvr_cli.api.metric import metric_source
    from dvr_cli.files.reading import open_mesh
    from dvr_cli.mesh.domain import domain_of
    from dvr_cli.report.export import as_json
    from dvr_cli.report.table import comparison_table
    from dvr_cli.report.text.comparison import comparison_text

    paths, plot, name, gates = [before, *after], given["plot"], given["measure"], gates_of(given)
    if plot is not None:
        check("--plot", plot, PICTURES, paths)
    meshes = [open_mesh(path, given["input_format"], given["mesh"]).mesh for path in paths]
    domains = []
    for path, mesh in zip(paths, meshes, strict=True):
        with naming(path):
            domains.append(domain_of(mesh, regions=given["regions"] or ()))
    names = [str(path) for path in paths]
    metric = metric_source(given["metric"])
    with naming(", ".join(names)):
        comparison = compare_domains(meshes, domains, metric, name)
        failed = failures(gates, comparison.after.quality, meshes[-1], meshes[-1].points)
    if plot is not None:
        states = {
            name: (mesh.points, report.quality)
            for name, mesh, report in zip(_short(paths), meshes, comparison.reports, strict=True)
        }
        text = comparison_text(comparison, names)
        kept = comparison.reports[0].kept
        write_picture(plot, meshes[0], states, "Comparison", text, kept=kept, measure=name)
    if given["json"]:
        emit(as_json(comparison.record(names)))
    elif width := columns(sys.stdout):
        emit(comparison_text(comparison, names, width))
    else:
        emit(comparison_table(comparison, names))
    for text in failed:
        say(f"dvr: {paths[-1]}: {text}")
    return GATE_FAILED if failed or comparison.better == "before" else DONE


def _short(paths: list[Path]) -> list[str]:
    """Short names that tell the files apart, with a number where several have the same."""
    names = [name if len(name) <= 24 else f"{name[:10]}...{name[-11:]}" for name in (p.name for p in paths)]
    return [name if names.count(name) == 1 else f"{name} ({i})" for i, name in enumerate(names, start=1)]
