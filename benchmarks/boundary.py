"""What a boundary that takes part brings, and costs: fixed, slide and project on every sample mesh."""

from __future__ import annotations

from pathlib import Path

from common import fastest, print_table
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.files.reading import open_mesh
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.report.records import SmoothReport

_SAMPLES = Path(__file__).resolve().parent.parent / "sample_meshes"
_SUFFIXES = (".msh", ".vtk", ".vtu", ".obj")
_BOUNDARIES = ("fixed", "slide", "project")


def run(quick: bool) -> None:
    """Print the table of the sample meshes on whose boundary something can move."""
    rows = []
    for path in sorted(path for path in _SAMPLES.iterdir() if path.suffix in _SUFFIXES)[
        : 3 if quick else None
    ]:
        mesh = open_mesh(path).mesh
        reports = {boundary: _smoothed(mesh, boundary) for boundary in _BOUNDARIES}
        fixed = reports["fixed"]
        rows += [
            _row(path.name, boundary, report, fixed)
            for boundary, report in reports.items()
            if max(other.relaxed for other in reports.values()) > fixed.relaxed
        ]
    header = ["mesh", "boundary", "relaxed", "worst before", "worst", "mean before", "mean"]
    header += ["time per sweep against fixed", "deviation / bound", "volume or area change"]
    print_table("Boundary: worst and mean quality over all elements, default options", header, rows)


def _smoothed(mesh: Mesh, boundary: str) -> SmoothReport:
    options = SmoothOptions(boundary=boundary, engine=fastest(), threads=1)
    smooth_mesh(mesh, options)  # what it takes the first time is not its speed
    return smooth_mesh(mesh, options)[1]


def _row(name: str, boundary: str, report: SmoothReport, fixed: SmoothReport) -> list[object]:
    row: list[object] = [name, boundary, report.relaxed]
    row += [report.before.minimum, report.after.minimum, report.before.mean, report.after.mean]
    row.append(f"{_per_sweep(report) / _per_sweep(fixed):.1f}×")
    if report.boundary is None:
        return [*row, "", ""]
    change = report.boundary.volume_change or report.boundary.area_change or 0.0
    return [*row, report.boundary.deviation / report.boundary.max_deviation, f"{100 * change:+.2g} %"]


def _per_sweep(report: SmoothReport) -> float:
    taken = [sweep["seconds"] for sweep in report.sweeps if sweep["phase"] == "relax"]
    return sum(taken) / max(len(taken), 1)
