"""What becomes of the smallest altitude and of the conduction bound, with the boundary in all ways."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import meshes
from common import fastest, print_table
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.files.reading import open_mesh
from dvr_cli.mesh.mesh import Mesh

_SAMPLES = Path(__file__).resolve().parent.parent / "sample_meshes"
_SUFFIXES = (".msh", ".vtk", ".vtu", ".obj")
_BOUNDARIES = ("fixed", "slide", "project")


def run(quick: bool) -> None:
    """Print the table, in which nothing of the smallest altitude may be below 1."""
    header = ["mesh", "boundary", "smallest altitude before", "after / before", "conduction bound / before"]
    header += ["Q1 before", "Q1"]
    print_table("Altitudes: default options, one thread", header, _rows(quick))


def _rows(quick: bool) -> Iterator[list[object]]:
    for name, mesh in _meshes(quick):
        for boundary in _BOUNDARIES:
            options = SmoothOptions(boundary=boundary, engine=fastest(), threads=1)
            _, report = smooth_mesh(mesh, options)
            before, after = report.before.measures, report.after.measures
            least, sharpest = before["min_altitude"] or 0.0, before["conduction_bound"] or 0.0
            ratio = (after["min_altitude"] or 0.0) / least
            sharper = (after["conduction_bound"] or 0.0) / sharpest
            yield [name, boundary, least, ratio, sharper, report.before.q1, report.after.q1]


def _meshes(quick: bool) -> Iterator[tuple[str, Mesh]]:
    samples = sorted(path for path in _SAMPLES.iterdir() if path.suffix in _SUFFIXES)
    for path in samples[: 3 if quick else None]:
        yield path.name, open_mesh(path).mesh
    yield "random tets 300", meshes.random_tets(300)
    if not quick:
        for n in (1000, 10_000):
            yield f"random tets {n}", meshes.random_tets(n)
        for n in (100, 10_000):
            yield f"random triangles {n}", meshes.random_triangles(n)
        yield "Gmsh sphere", meshes.gmsh_sphere(0.1)
        yield "Gmsh part", meshes.gmsh_part(1.4)
