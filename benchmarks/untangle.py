"""Tangled meshes: inverted elements before and after, seconds, and Q1 after untangling and relaxation."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np

import dvr_cli
import meshes
from common import print_table
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.mean_ratio import element_qualities

_SIZES = {"triangle": 12, "quad": 12, "tetra": 6, "hexahedron": 6}
_BUMPS = (("triangle", 20), ("triangle", 40), ("quad", 40), ("tetra", 10), ("tetra", 14), ("hexahedron", 14))
_COLUMNS = ["elements", "inverted before", "after", "s to untangle", "Q1 untangled", "Q1 relaxed"]


def run(quick: bool) -> None:
    """Print the tables of tangled meshes."""
    makers = _makers_of_the_tests()
    rows: list[list[object]] = []
    for rings in (8, 12, 20):
        for degrees in (18, 40):
            mesh = makers.turned_hexagon(rings, degrees)
            for directions in ("axis", "circumferential"):
                rows.append([rings, degrees, directions, *_figures(mesh, directions)])
    print_table("Untangling hexagons", ["rings", "boundary turned by", "directions", *_COLUMNS], rows)
    rows = [[f"{kind}, {n} a side", *_figures(makers.bump(kind, n))] for kind, n in _BUMPS]
    print_table("Untangling bumps", ["mesh", *_COLUMNS], rows)
    rows = []
    for kind, n in _SIZES.items():
        for lengths in (1, 2):
            trials = [_trial(makers.tangled(kind, n, lengths, seed)) for seed in range(5 if quick else 50)]
            before, after, seconds, q1 = zip(*trials, strict=True)
            valid = f"{after.count(0)} of {len(after)}"
            spread = f"{min(before)} to {max(before)}"
            rows.append([kind, lengths, spread, valid, float(np.mean(seconds)), min(q1)])
    header = ["elements", "edge lengths", "inverted before", "valid after", "s a trial", "worst Q1 untangled"]
    print_table("Untangling random tangles", header, rows)
    mesh = _tangled(meshes.random_tets(10_000 if quick else 100_000), 0.05)
    row = [len(mesh.points), *_figures(mesh, "random")]
    print_table("Untangling Delaunay tetrahedra", ["vertices", *_COLUMNS], [row])


def _makers_of_the_tests() -> ModuleType:
    """``tests/meshes.py``, which has the name of a module here."""
    path = Path(__file__).parents[1] / "tests" / "meshes.py"
    spec = spec_from_file_location("meshes_of_the_tests", path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _trial(mesh: Mesh) -> tuple[int, int, float, float]:
    """Inverted before and after untangling, the seconds it took, and Q1."""
    _, report = dvr_cli.untangle(mesh.points, {mesh.cells[0].type: mesh.cells[0].vertices})
    assert report.untangling is not None
    assert report.after.q1 is not None
    seconds = sum(one["seconds"] for one in report.untangling.rounds)
    return report.before.inverted, report.after.inverted, seconds, report.after.q1


def _figures(mesh: Mesh, directions: str = "random") -> list[object]:
    """The columns of the tables for one mesh."""
    before, after, seconds, q1 = _trial(mesh)
    cells = {mesh.cells[0].type: mesh.cells[0].vertices}
    _, report = dvr_cli.smooth(mesh.points, cells, untangle=True, directions=directions)
    return [len(mesh.cells[0].vertices), before, after, seconds, q1, report.after.q1]


def _tangled(mesh: Mesh, share: float) -> Mesh:
    """As many inner vertices displaced by the mean length of their edges as invert this share of elements."""
    domain, simplices = domain_of(mesh), mesh.cells[0].vertices
    total, count = np.zeros(len(mesh.points)), np.zeros(len(mesh.points))
    for own in simplices.T:
        for other in simplices.T:
            np.add.at(total, own, np.linalg.norm(mesh.points[own] - mesh.points[other], axis=1))
            np.add.at(count, own, own != other)
    rng = np.random.default_rng(0)
    chosen = rng.permutation(np.flatnonzero(domain.interior))
    way = rng.standard_normal(mesh.points.shape)
    way *= (total / np.maximum(count, 1) / np.linalg.norm(way, axis=1))[:, None]

    def displaced(number: int) -> np.ndarray:
        points = mesh.points.copy()
        points[chosen[:number]] += way[chosen[:number]]
        return points

    low, high = 0, len(chosen)
    while high - low > 1:
        middle = (low + high) // 2
        inverted = (element_qualities(displaced(middle), domain.corners) < 0).mean()
        low, high = (middle, high) if inverted < share else (low, middle)
    return Mesh(displaced(high), mesh.cells)
