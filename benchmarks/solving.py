"""Figures of solvers on a mesh of simplices, by SciPy, scikit-fem and, where it is installed, CalculiX.

All problems are on the body as it is, scaled to 1 along its longest side, with linear elements.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import skfem
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import cg, eigsh
from skfem.helpers import ddot, div, dot, grad, sym_grad

from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.altitudes import altitude_and_conduction
from dvr_cli.quality.face_measures import faces_of

_RESIDUAL = 1e-8  # relative, at which conjugate gradients end
_LAME = (0.5769230769230769, 0.38461538461538464)  # lambda and mu of Young's modulus 1, Poisson's ratio 0.3
_MESHES: dict[int, tuple[Any, Any]] = {
    2: (skfem.MeshTri, skfem.ElementTriP1),
    3: (skfem.MeshTet, skfem.ElementTetP1),
}


@dataclass(frozen=True)
class Figures:
    """Figures of solvers on one mesh.

    poisson, elasticity: iterations of conjugate gradients with Jacobi's preconditioner. calculix: CalculiX's
    on the same elastic problem with its own scaling, None where it cannot be had. step: the largest stable
    one of central differences for waves of speed 1, 2/√λ; altitude: the smallest; both in units of ``size``.
    l2, h1: errors against a manufactured solution, relative to the norms of that. orthogonality: the largest
    and the mean angle in degrees, None in the plane.
    """

    poisson: int
    elasticity: int
    calculix: int | None
    step: float
    altitude: float
    l2: float
    h1: float
    orthogonality: tuple[float, float] | None


def figures_of(mesh: Mesh, size: float) -> Figures:
    """All figures of a mesh; size: the length of edges it was made for."""
    length = np.ptp(mesh.points, axis=0).max()
    points, cells = (mesh.points - mesh.points.min(axis=0)) / length, mesh.cells[0].vertices
    maker, element = _MESHES[points.shape[1]]
    body = maker(np.ascontiguousarray(points.T), np.ascontiguousarray(cells.T.astype(np.int64)))
    basis = skfem.Basis(body, element(), intorder=4)
    iterations, l2, h1 = _poisson(basis)
    altitude = altitude_and_conduction(points, cells)[0]
    return Figures(
        poisson=iterations,
        elasticity=_elasticity(skfem.Basis(body, skfem.ElementVector(element()), intorder=1)),
        calculix=_calculix(points, cells) if points.shape[1] == 3 else None,
        step=float(_step(basis) * length / size),
        altitude=float(altitude * length / size),
        l2=l2,
        h1=h1,
        orthogonality=_orthogonality(mesh) if points.shape[1] == 3 else None,
    )


@skfem.BilinearForm
def _stiffness(u: Any, v: Any, _: Any) -> Any:
    return dot(grad(u), grad(v))


@skfem.BilinearForm
def _elastic(u: Any, v: Any, _: Any) -> Any:
    return _LAME[0] * div(u) * div(v) + 2 * _LAME[1] * ddot(sym_grad(u), sym_grad(v))


def _wave(x: Any) -> tuple[Any, Any]:
    """The manufactured solution sin 4x cos 5y (e^z in space), (...), and its gradient, (d, ...)."""
    up = np.exp(x[2]) if len(x) == 3 else 1.0
    u = np.sin(4 * x[0]) * np.cos(5 * x[1]) * up
    slope = [4 * np.cos(4 * x[0]) * np.cos(5 * x[1]) * up, -5 * np.sin(4 * x[0]) * np.sin(5 * x[1]) * up]
    return u, np.array([*slope, u][: len(x)])


def _poisson(basis: Any) -> tuple[int, float, float]:
    """Iterations, relative errors in L2 and in the seminorm of H1; the boundary has the exact values."""
    laplacian = 16 + 25 - (basis.mesh.dim() == 3)

    @skfem.LinearForm
    def load(v: Any, w: Any) -> Any:
        return laplacian * _wave(w.x)[0] * v

    exact = _wave(basis.mesh.p)[0]
    matrix, right = _stiffness.assemble(basis), load.assemble(basis)
    held = basis.mesh.boundary_nodes()
    free = np.setdiff1d(np.arange(len(exact)), held)
    right = right[free] - matrix[free][:, held] @ exact[held]
    solution = exact.copy()
    solution[free], iterations = _conjugate_gradients(matrix[free][:, free], right)
    found, (u, slope) = basis.interpolate(solution), _wave(basis.global_coordinates().value)

    def norm(values: Any) -> float:
        return float(np.sqrt((values**2 * basis.dx).sum()))

    return iterations, norm(found.value - u) / norm(u), norm(found.grad - slope) / norm(slope)


def _elasticity(basis: Any) -> int:
    """Iterations of the body held at its lowest x, pulled down by its weight."""

    @skfem.LinearForm
    def weight(v: Any, _: Any) -> Any:
        return -v.value[-1]

    matrix, right = _elastic.assemble(basis), weight.assemble(basis)
    held = basis.get_dofs(lambda x: x[0] < 1e-9).all()
    free = np.setdiff1d(np.arange(len(right)), held)
    return _conjugate_gradients(matrix[free][:, free], right[free])[1]


def _conjugate_gradients(matrix: csr_matrix, right: np.ndarray) -> tuple[np.ndarray, int]:
    """The solution and the number of iterations, with Jacobi's preconditioner."""
    count = 0

    def counted(_: np.ndarray) -> None:
        nonlocal count
        count += 1

    scaled = diags(1 / matrix.diagonal())
    solution, fault = cg(matrix, right, rtol=_RESIDUAL, maxiter=100_000, M=scaled, callback=counted)
    if fault:
        raise RuntimeError("conjugate gradients did not converge")
    return solution, count


def _step(basis: Any) -> float:
    """2/√λ with the largest eigenvalue λ of M⁻¹ K, M the lumped masses: all vertices free."""
    matrix = _stiffness.assemble(basis)
    cells, weights = basis.mesh.t, basis.dx.sum(axis=1) / len(basis.mesh.t)
    masses = np.bincount(cells.ravel(), np.tile(weights, len(cells)), minlength=matrix.shape[0])
    scale = diags(1 / np.sqrt(masses))
    start = np.random.default_rng(0).standard_normal(matrix.shape[0])
    (largest,) = eigsh(scale @ matrix @ scale, 1, which="LA", tol=1e-8, v0=start, return_eigenvectors=False)
    return float(2 / np.sqrt(largest))


def _orthogonality(mesh: Mesh) -> tuple[float, float]:
    """The largest and the mean non-orthogonality of inner faces as checkMesh prints them, in degrees.

    Its mean is the angle whose cosine is the mean cosine.
    """
    faces = faces_of(mesh.points, mesh.cells)
    inner = faces.neighbour >= 0
    line = faces.cell_centre[faces.neighbour[inner]] - faces.cell_centre[faces.owner[inner]]
    area = faces.area[inner]
    cosine = (line * area).sum(axis=1) / (np.linalg.norm(line, axis=1) * np.linalg.norm(area, axis=1))
    largest, mean = np.degrees(np.arccos([cosine.min(), cosine.mean()]))
    return float(largest), float(mean)


def _calculix(points: np.ndarray, cells: np.ndarray) -> int | None:
    """Iterations of CalculiX's iterative solver with diagonal scaling; None where it is not installed."""
    program = shutil.which("ccx")
    if program is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "body.inp").write_text(_deck(points, cells), encoding="ascii")
        command = [program, "-i", "body"]
        run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    found = re.search(r"# of iterations = (\d+)", run.stdout)
    if run.returncode or found is None:
        raise RuntimeError(f"CalculiX: {run.stdout[-500:]}")
    return int(found[1])


def _deck(points: np.ndarray, cells: np.ndarray) -> str:
    """The elastic problem of ``_elasticity`` as CalculiX reads it."""

    def lines(rows: np.ndarray, shown: Callable[[Any], str]) -> str:
        return "\n".join(f"{i}, {', '.join(map(shown, row))}" for i, row in enumerate(rows.tolist(), 1))

    held = "\n".join(f"{i}," for i in np.flatnonzero(points[:, 0] < 1e-9) + 1)
    return f"""*NODE
{lines(points, repr)}
*ELEMENT, TYPE=C3D4, ELSET=BODY
{lines(cells + 1, str)}
*NSET, NSET=HELD
{held}
*MATERIAL, NAME=ELASTIC
*ELASTIC
1., .3
*DENSITY
1.
*SOLID SECTION, ELSET=BODY, MATERIAL=ELASTIC
*STEP
*STATIC, SOLVER=ITERATIVE SCALING
*BOUNDARY
HELD, 1, 3
*DLOAD
BODY, GRAV, 1., 0., 0., -1.
*NODE PRINT, NSET=HELD
U
*END STEP
"""
