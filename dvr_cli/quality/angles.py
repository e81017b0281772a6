"""Angles of elements: interior angles of planar cells, dihedral angles of volume cells."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.cell_types import CELL_TYPES, CellType, Tuples
from dvr_cli.mesh.facets import outlines
from dvr_cli.mesh.mesh import Cells
from dvr_cli.mesh.simplex import Components, chunks, cross, dot, subtract

_NEAR = 1e-9  # cosines and turns this near to the extreme one are looked at exactly


def extreme_angles(points: np.ndarray, blocks: list[Cells], backend: Backend = NUMPY) -> tuple[float, float]:
    """Smallest and largest angle in degrees over all cells of the blocks, in [0, 360) and [0, 180] resp.

    points: (N, d). The interior angles of triangles and quadrilaterals, of volume cells the dihedral angles
    between their faces; a face with four vertices counts with its mean normal. An angle next to an edge or a
    face without extent is left out; (nan, nan) when nothing is left.
    backend: what computes; the result is the same.
    """
    low, high = np.inf, -np.inf
    for block in blocks:
        cell_type = CELL_TYPES[block.type]
        candidates = outlines(block) if cell_type.dimension == 2 else block.vertices
        if cell_type.dimension == 3:
            candidates = candidates[_with_extreme_cosines(points, candidates, cell_type, backend)]
        else:
            candidates = candidates[backend.twin(with_extreme_turns)(points, candidates, _NEAR)]
        for chunk in chunks(len(candidates)):
            vertices = candidates[chunk]
            if cell_type.dimension == 2:
                angles = interior_angles(points, vertices)
            else:
                found = _extreme_dihedral_angles(points, vertices, cell_type)
                angles = np.concatenate([np.empty(0), *found])
            angles = angles[np.isfinite(angles)]
            low, high = angles.min(initial=low), angles.max(initial=high)
    return (float(low), float(high)) if high >= low else (np.nan, np.nan)


def interior_angles(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(n, k) angle at each vertex, turning from the next to the previous edge, in [0, 360) degrees; in space
    (points (N, 3)) the turn has no sense, and angles are in [0, 180].
    """
    here = points[vertices]
    onward = np.roll(here, -1, axis=1) - here
    back = np.roll(here, 1, axis=1) - here
    if points.shape[1] == 3:
        cross = np.linalg.norm(np.cross(onward, back), axis=-1)
    else:
        cross = onward[..., 0] * back[..., 1] - onward[..., 1] * back[..., 0]
    inner = (onward * back).sum(axis=-1)
    angle = np.degrees(np.arctan2(cross, inner)) % 360.0
    return np.where(onward.any(axis=-1) & back.any(axis=-1), angle, np.nan)


def with_extreme_turns(points: np.ndarray, vertices: np.ndarray, near: float) -> np.ndarray:
    """(n,) bool: cells among which are all with an interior angle as small or large as any; here all.

    points: (N, d); vertices: (n, k), around each cell; near: by how much less extreme turns count, too.
    """
    return np.ones(len(vertices), dtype=bool)


def _with_extreme_cosines(
    points: np.ndarray, vertices: np.ndarray, cell_type: CellType, backend: Backend
) -> np.ndarray:
    """(n,) bool: the few of the cells (n, k) that may have their smallest or largest dihedral angle."""
    if cell_type.is_simplex:
        return backend.twin(tetrahedra_with_extreme_cosines)(points, vertices, _NEAR)
    faces = cell_type.facets
    padded = np.array([[*face, face[-1]][:4] for face in faces])
    pairs = np.array(neighbouring_facets(faces))
    return backend.twin(with_extreme_cosines)(points, vertices, padded, pairs, _NEAR)


def with_extreme_cosines(
    points: np.ndarray, vertices: np.ndarray, faces: np.ndarray, pairs: np.ndarray, near: float
) -> np.ndarray:
    """(n,) bool: cells among which are all with a cosine between faces as large or small as any; here all.

    points: (N, 3); vertices: (n, k); faces: (F, 4) local vertices, of a triangle the last repeated; pairs:
    (E, 2) of faces with a common edge; near: by how much less extreme cosines count, too.
    """
    return np.ones(len(vertices), dtype=bool)


def tetrahedra_with_extreme_cosines(points: np.ndarray, vertices: np.ndarray, near: float) -> np.ndarray:
    """The same for tetrahedra ``vertices`` (n, 4)."""
    return np.ones(len(vertices), dtype=bool)


def neighbouring_facets(faces: Tuples) -> list[tuple[int, int]]:
    """The numbers of each two faces with a common edge."""
    pairs = ((i, j) for i in range(len(faces)) for j in range(i))
    return [(i, j) for i, j in pairs if len(set(faces[i]) & set(faces[j])) == 2]


def _extreme_dihedral_angles(
    points: np.ndarray, vertices: np.ndarray, cell_type: CellType
) -> Iterator[np.ndarray]:
    """For each edge of the cell type, the smallest and largest angles between its two faces in any cell."""
    at = [[points[:, i][vertex] for i in range(3)] for vertex in vertices.T]
    normals = [face_normal([at[v] for v in face]) for face in cell_type.facets]
    lengths = [np.sqrt(dot(normal, normal)) for normal in normals]
    for i, j in neighbouring_facets(cell_type.facets):
        size = lengths[i] * lengths[j]
        cosine = np.divide(dot(normals[i], normals[j]), size, out=np.full(len(size), np.nan), where=size > 0)
        # the angle falls with the cosine, but near 0 and 180 degrees the sine tells it better
        low, high = np.fmin.reduce(cosine), np.fmax.reduce(cosine)
        if np.isnan(low):
            continue
        extreme = np.flatnonzero((cosine <= low + _NEAR) | (cosine >= high - _NEAR))
        a, b = ([component[extreme] for component in normal] for normal in (normals[i], normals[j]))
        across = cross(a, b)
        yield 180.0 - np.degrees(np.arctan2(np.sqrt(dot(across, across)), dot(a, b)))


def face_normal(face: Sequence[Components]) -> list[np.ndarray]:
    """Twice the vector area of a face: the cross product of its diagonals, or of two of its three edges."""
    return cross(subtract(face[2], face[0]), subtract(face[-1], face[1]))
