"""A metric: a tensor a vertex that says which shapes are wanted where, as error estimators give it.

With G the mean tensor of a cell, fixed during a run, the norm of a corner's edges is

    s = Σ_jk M_jk e_jᵀ G e_k = Σ_jk M_jk (L e_j)·(L e_k),    G = Lᵀ L

so the ideal shape is the one that looks ideal through L. Only shape counts: G is taken with determinant 1,
and the determinant v of the edges is what it is without a metric.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.corners import Corners, corner_shapes, shape_table
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.simplex import chunks

# Where the entries of a symmetric tensor, row after row, stand among its components in VTK's order:
# XX, YY, XY in the plane, and XX, YY, ZZ, XY, YZ, XZ in space.
_SYMMETRIC = {3: (0, 2, 2, 1), 6: (0, 3, 5, 3, 1, 4, 5, 4, 2)}
_ASYMMETRY = 1e-6  # of a tensor's entries, relative to the largest, up to which it counts as symmetric
_DEFINITE = 1e-14  # smallest eigenvalue, relative to the largest, above which a tensor is positive definite


@dataclass(frozen=True)
class Metric:
    """A metric on a domain.

    corners: those of the domain, measured in it. max_aspect: the largest aspect that it asks a cell for.
    """

    corners: Corners
    max_aspect: float


def tensors_of(values: np.ndarray, n_points: int) -> np.ndarray:
    """(N, 2, 2) or (N, 3, 3) tensors, symmetric, from what a field has for each vertex.

    values: (N, c): c = 3 or 6 components in VTK's order, XX, YY, XY or XX, YY, ZZ, XY, YZ, XZ, or all
        c = 4 or 9 entries; (N, k, k), too.

    Raises InputError for anything else, and for tensors that are not symmetric.
    """
    values = np.asarray(values)
    if values.dtype.kind not in "fiu":
        raise InputError("not numbers")
    if not values.ndim or len(values) != n_points:
        raise InputError(f"{len(values) if values.ndim else 1} values for {n_points} vertices")
    rows = values.reshape(n_points, -1).astype(np.float64)
    count = rows.shape[1]
    if count == 1:
        raise InputError("scalars are sizes and say nothing about shape; a tensor a vertex is needed")
    if count in _SYMMETRIC:
        rows = rows[:, _SYMMETRIC[count]]
    elif count not in (4, 9):
        raise InputError(
            f"{count} components; a tensor has 3 (XX, YY, XY) or 4 in the plane, "
            "6 (XX, YY, ZZ, XY, YZ, XZ) or 9 in space"
        )
    size = 2 if rows.shape[1] == 4 else 3
    tensors = rows.reshape(n_points, size, size)
    with np.errstate(invalid="ignore"):
        skew = np.abs(tensors - tensors.transpose(0, 2, 1)).max(axis=(1, 2))
        wrong = np.flatnonzero(skew > _ASYMMETRY * np.abs(tensors).max(axis=(1, 2)))
    if len(wrong):
        raise InputError(f"the tensor of vertex {wrong[0]} (counted from 0) is not symmetric")
    return (tensors + tensors.transpose(0, 2, 1)) / 2.0


def metric_on(domain: Domain, tensors: np.ndarray) -> Metric:
    """The domain's corners measured in a metric; tensors: (N, k, k) symmetric, as the mesh gives points.

    Raises InputError for surfaces in space, for tensors of a plane where those of space are needed, and for
    those of the domain's vertices that are not finite or not positive definite.
    """
    if domain.is_surface:
        raise InputError(
            "a surface in space cannot be measured in a metric, as the planes of its cells turn when "
            "vertices move; planar and volume meshes can"
        )
    tensors = _in_domain(domain, tensors)
    _check(tensors, np.unique(domain.corners.vertices))
    d, base = domain.dimension, domain.corners.table
    triangle = np.triu_indices(d)
    shapes, matrices, factors, aspect, first = [], [], [], 1.0, 0
    for block in domain.cells:
        if not len(block.vertices):
            continue
        distinct, place = np.unique(corner_shapes(CELL_TYPES[block.type]), return_inverse=True)
        local = place.reshape(-1, d + 1).astype(np.int32)
        row = first + len(distinct) * np.arange(len(block.vertices), dtype=np.int32)
        shapes.append((row[:, None, None] + local).reshape(-1, d + 1))
        first += len(distinct) * len(block.vertices)
        for chunk in chunks(len(block.vertices)):
            upper, widest = _factors(tensors[block.vertices[chunk]])
            aspect = max(aspect, widest)
            factors.append(np.repeat(upper[:, triangle[0], triangle[1]], len(distinct), axis=0))
            matrices.append(np.tile(base.matrices[distinct], (len(upper), 1, 1)))
    table = shape_table(np.concatenate(matrices), np.concatenate(factors))
    return Metric(replace(domain.corners, shapes=np.concatenate(shapes), table=table), aspect)


def _in_domain(domain: Domain, tensors: np.ndarray) -> np.ndarray:
    """(N, d, d) the tensors in the domain's coordinates: of a planar mesh their part in its plane."""
    size, plane = tensors.shape[1], domain.plane
    if plane is None:
        if size < 3:
            raise InputError("tensors of the plane; a volume mesh needs those of space, 6 or 9 components")
        return tensors
    if size == 2:
        if plane.selected != (0, 1):
            raise InputError(
                "tensors of the plane x, y, in which the mesh does not lie; 6 or 9 components do"
            )
        return tensors
    axes = np.pad(plane.axes, ((0, 0), (0, 3 - plane.axes.shape[1])))
    return np.einsum("ai,nij,bj->nab", axes, tensors, axes)


def _check(tensors: np.ndarray, vertices: np.ndarray) -> None:
    """Raise InputError unless the tensors of these vertices are finite and positive definite."""
    used = tensors[vertices]
    wrong = np.flatnonzero(~np.isfinite(used).all(axis=(1, 2)))
    if len(wrong):
        raise InputError(f"the tensor of vertex {vertices[wrong[0]]} (counted from 0) is not finite")
    value = np.linalg.eigvalsh(_scaled(used, (1, 2)))
    wrong = np.flatnonzero(~(value[:, 0] > _DEFINITE * value[:, -1]))
    if len(wrong):
        raise InputError(
            f"the tensor of vertex {vertices[wrong[0]]} (counted from 0) is not positive definite"
        )


def _factors(tensors: np.ndarray) -> tuple[np.ndarray, float]:
    """(n, d, d) upper triangular L of the mean tensors of cells, det L = 1, and the largest aspect of one.

    tensors: (n, k, d, d) those of each cell's vertices.
    """
    mean = _scaled(tensors, (1, 2, 3)).mean(axis=1)
    value = np.linalg.eigvalsh(mean)
    upper = np.linalg.cholesky(mean).transpose(0, 2, 1)
    size = np.einsum("nii->ni", upper).prod(axis=1) ** (1.0 / upper.shape[1])
    return upper / size[:, None, None], float(np.sqrt((value[:, -1] / value[:, 0]).max()))


def _scaled(tensors: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    """Tensors divided by the largest entry over ``axes``, so that nothing over- or underflows."""
    largest = np.abs(tensors).max(axis=axes, keepdims=True)
    return tensors / np.where(largest > 0, largest, 1.0)


def factors_at_vertices(domain: Domain) -> np.ndarray | None:
    """(N, d(d+1)/2) for each vertex L of the first corner it is in; None where corners have no metric."""
    corners, table = domain.corners, domain.corners.table
    if not len(table.factor):
        return None
    row = np.zeros(len(domain.points), dtype=np.int64)  # of vertices in no corner any
    row[corners.vertices[::-1]] = corners.shapes[::-1, :1]
    return table.factor[row]
