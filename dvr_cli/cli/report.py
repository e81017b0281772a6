"""``dvr report``: the quality of one mesh, and which of two is better."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dvr_cli.cli.codes import DONE, GATE_FAILED
from dvr_cli.cli.options import Debug, FailBelow, InputFormat, Json, naming
from dvr_cli.cli.streams import bar, emit, say
from dvr_cli.errors import UsageError


def quality(
    path: Annotated[Path, typer.Argument(metavar="MESH", help="The mesh to measure.")],
    json: Json = False,
    csv: Annotated[
        bool,
        typer.Option(
            "--csv",
            help="Print the quality vector as CSV: rank, vertex, quality, for each relaxed vertex the worst "
            "quality around it, ascending. Vertices are numbered from 0.",
        ),
    ] = False,
    worst: Annotated[int, typer.Option(min=0, metavar="N", help="List the N worst elements.")] = 10,
    fail_below: FailBelow = None,
    input_format: InputFormat = None,
    debug: Debug = False,
) -> int:
    """Print the quality of a mesh: Q1, quantiles, angles, a histogram, the worst elements."""
    from dvr_cli.api import mesh_quality
    from dvr_cli.files.reading import open_mesh
    from dvr_cli.report.export import as_csv, as_json
    from dvr_cli.report.text import gate_failure, quality_text

    if json and csv:
        raise UsageError("--json and --csv exclude each other")
    mesh = open_mesh(path, input_format).mesh
    with naming(path):
        report = mesh_quality(mesh, worst)
    if json:
        emit(as_json(report.record(str(path))))
    elif csv:
        emit(as_csv(report.quality))
    else:
        emit(quality_text(report, str(path), bar()))
    if fail_below is not None and report.quality.minimum < fail_below:
        say(f"dvr: {path}: {gate_failure(report.quality, fail_below)}")
        return GATE_FAILED
    return DONE


def compare(
    before: Annotated[Path, typer.Argument(metavar="BEFORE", help="The first mesh.")],
    after: Annotated[Path, typer.Argument(metavar="AFTER", help="Another mesh of the same cells.")],
    json: Json = False,
    input_format: InputFormat = None,
    debug: Debug = False,
) -> int:
    """Say which of two meshes is better, by their quality vectors; exit with code 1 if AFTER is worse.

    The vectors (for each relaxed vertex the worst quality around it, ascending) are compared at the first
    component in which they differ.
    """
    from dvr_cli.api import mesh_quality, same_connectivity
    from dvr_cli.files.reading import open_mesh
    from dvr_cli.report.compare import compare_qualities
    from dvr_cli.report.export import as_json
    from dvr_cli.report.text import comparison_text

    old, new = open_mesh(before, input_format).mesh, open_mesh(after, input_format).mesh
    with naming(before):
        old_quality = mesh_quality(old)
    with naming(after):
        new_quality = mesh_quality(new)
    with naming(f"{before}, {after}"):
        comparison = compare_qualities(old_quality, new_quality, same_connectivity(old, new))
    names = str(before), str(after)
    emit(as_json(comparison.record(*names)) if json else comparison_text(comparison, *names))
    return GATE_FAILED if comparison.better == "before" else DONE
