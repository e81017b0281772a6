"""Gains of solvers: meshes of generators, raw and as these optimise them, each without and with dvr.

Every mesh is solved on by the same solvers; see ``solving`` for the problems.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import dvr_cli
from common import fastest, print_table
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.quality.measure import measure
from generators import Generated, generators
from solving import figures_of

_HEADER = (
    "mesh",
    "cells",
    "worst",
    "1 %",
    "mean",
    "CG, Poisson",
    "CG, elasticity",
    "CalculiX",
    "step",
    "altitude",
    "L2 error, %",
    "H1 error, %",
    "non-orthogonality",
)


def run(quick: bool) -> None:
    """Print the table of solvers."""
    rows = (row for generated in generators(quick) for row in _rows(generated))
    print_table("What a solver gains", _HEADER, rows)


def _rows(generated: Generated) -> Iterator[list[object]]:
    """The generator's mesh raw and optimised, each without and with dvr."""
    for state, make in (("raw", generated.raw), ("optimised", generated.optimised)):
        if make is None:
            continue
        try:
            mesh = make()
        except ImportError as error:
            yield [f"{generated.name}: not installed ({error})", *[""] * (len(_HEADER) - 1)]
            return
        yield [f"{generated.name}, {state}", *_figures(mesh, generated.size)]
        for boundary in ("fixed", "slide"):
            smoothed = _smoothed(mesh, boundary)
            yield [f"— dvr, boundary {boundary}", *_figures(smoothed, generated.size)]


def _smoothed(mesh: Mesh, boundary: str) -> Mesh:
    """The mesh after dvr with default options but for what becomes of the boundary ("fixed" by default)."""
    (block,) = mesh.cells
    cells = {block.type: block.vertices}
    points, _ = dvr_cli.smooth(mesh.points, cells, boundary=boundary, engine=fastest(), threads=1)
    return Mesh(points, [Cells(block.type, block.vertices)])


def _figures(mesh: Mesh, size: float) -> Iterator[object]:
    """The columns of one mesh."""
    domain = domain_of(mesh)
    quality = measure(domain, domain.points, np.flatnonzero(domain.interior))
    figures = figures_of(mesh, size)
    yield from (len(mesh.cells[0].vertices), float(quality.minimum), float(quality.quantiles[0.01]))
    yield from (float(quality.mean), figures.poisson, figures.elasticity)
    yield "" if figures.calculix is None else figures.calculix
    yield from (figures.step, figures.altitude, 100 * figures.l2, 100 * figures.h1)
    angles = figures.orthogonality
    yield "" if angles is None else f"{angles[0]:.1f}° / {angles[1]:.1f}°"
