"""dvr against other tools on the same meshes, connectivity and boundary fixed, all measured by dvr."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

import dvr_cli
import meshes
from common import fastest, print_table, warm_up
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.measure import measure
from smoothers import (
    Case,
    Smoother,
    gmsh_relocate,
    laplacian,
    netgen,
    vtk_laplacian,
    vtk_windowed_sinc,
)

_PASSES = (5, 20)
_SWEEPS = (20, 100)
_SMOOTHERS: dict[str, tuple[Smoother, tuple[int, ...]]] = {  # and the dimensions it is for
    "Laplacian": (laplacian, (2, 3)),
    "Gmsh Relocate": (gmsh_relocate, (2, 3)),
    "Netgen m": (netgen, (3,)),
    "VTK Laplacian": (vtk_laplacian, (2,)),
    "VTK windowed sinc": (vtk_windowed_sinc, (2,)),
}
_MOVED = 1e-12  # of the size of the mesh: further than by rounding


def run(quick: bool) -> None:
    """Print the table of tools."""
    for name, mesh in _meshes(quick):
        case = Case(name, domain_of(mesh))
        rows = [["input", "", *_quality(case, case.points), ""], *_own_rows(case)]
        rows += [row for tool in _SMOOTHERS for row in _rows(case, tool)]
        header = ["tool", "passes", "Q1", "mean", "1 % quantile", "inverted", "seconds"]
        print_table(f"Tools: {name}, {len(case.free)} free vertices, one thread", header, rows)


def _meshes(quick: bool) -> Iterator[tuple[str, Mesh]]:
    for n in [1_000] if quick else [1_000, 10_000, 100_000]:
        yield f"Delaunay tetrahedra of {n:,} random points", meshes.random_tets(n)
    yield "Gmsh sphere, not optimised", meshes.gmsh_sphere(0.15 if quick else 0.0322)
    yield "Gmsh part, optimised by Gmsh", meshes.gmsh_part(2.0 if quick else 0.595)
    for n in [100, 1_000] if quick else [100, 10_000, 100_000]:
        yield f"Delaunay triangles of {n:,} random points", meshes.random_triangles(n)


def _quality(case: Case, points: np.ndarray) -> list[object]:
    """Q1, over elements with a free vertex; mean, 1 % quantile and number of inverted, over all."""
    quality = measure(case.domain, points[:, : case.dimension], case.free)
    return [quality.q1, quality.mean, quality.quantiles[0.01], quality.inverted]


def _own_rows(case: Case) -> Iterator[list[object]]:
    """The sweeps of dvr and its default; the seconds are those of the whole call, set-up and reports too."""
    domain = case.domain
    warm_up(Mesh(domain.points, domain.cells), (fastest(), 1))
    runs: dict[tuple[str, int | str], dict[str, Any]] = {
        (f"dvr -d random, {fastest()}", n): {"directions": "random", "max_iterations": n, "tol": 0.0}
        for n in _SWEEPS
    }
    runs[(f"dvr, default options, {fastest()}", "")] = {}
    for row, options in runs.items():
        begin = time.perf_counter()
        cells = {domain.cells[0].type: case.cells}
        points, _ = dvr_cli.smooth(domain.points, cells, engine=fastest(), threads=1, **options)
        taken = time.perf_counter() - begin
        yield [*row, *_quality(case, points), taken]


def _rows(case: Case, tool: str) -> Iterator[list[object]]:
    smooth, dimensions = _SMOOTHERS[tool]
    if case.dimension not in dimensions:
        return
    for passes in _PASSES:
        try:
            points, cells, taken = smooth(case, passes)
        except ImportError as error:
            yield [f"{tool}: not installed ({error})", *[""] * 6]
            return
        fault = _fault(case, points, cells)
        if fault:
            yield [f"{tool}: left out, {fault}", passes, *[""] * 5]
        else:
            points[case.fixed] = case.points[case.fixed]  # undoes rounding
            yield [tool, passes, *_quality(case, points), taken]


def _fault(case: Case, points: np.ndarray, cells: np.ndarray) -> str:
    """Why a result is not comparable: it changed more than the free vertices; empty if it did not."""
    if points.shape != case.points.shape or not np.isfinite(points).all():
        return "points lost or not finite"
    if cells.shape != case.cells.shape or (_sorted(cells) != _sorted(case.cells)).any():
        return "connectivity changed"
    moved = np.abs(points - case.points)[case.fixed].max() / np.ptp(case.points)
    return f"boundary vertices moved by {moved:.1e} of the size" if moved > _MOVED else ""


def _sorted(cells: np.ndarray) -> np.ndarray:
    """Cells as rows of ascending vertices in ascending order."""
    rows = np.sort(cells, axis=1)
    return rows[np.lexsort(rows.T)]
