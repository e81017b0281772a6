"""Fans: how good the worst of n elements around a vertex or an edge can be at all.

The angles of the elements at that vertex or edge add up to what the shape of the domain leaves: inside to
2π, or to 4π as solid angles. As the best quality that an element can have given its angle grows up to the
angle of the ideal shape and falls beyond, the worst of n elements is at most what one with the nth part has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import cos, pi, sin, sqrt

import numpy as np

from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells
from dvr_cli.mesh.ranks import distinct
from dvr_cli.quality.angles import interior_angles


@dataclass(frozen=True)
class Fan:
    """n elements around a vertex (1,) or an edge (2,), and the best quality that the worst can have."""

    vertices: tuple[int, ...]
    n: int
    best: float


def fans(points: np.ndarray, blocks: list[Cells], vertices: np.ndarray) -> Iterator[Fan]:
    """The fans around each of ``vertices`` ((m,)) and, of tetrahedra, around the edges between these.

    points: (N, d); blocks: all cells that have one of the vertices, of positive quality. Fans of elements of
    different types, or of types not in BEST_AT_VERTEX, are left out.
    """
    for i, v in enumerate(vertices.tolist()):
        parts = [(b.type, b.vertices[(b.vertices == v).any(axis=1)]) for b in blocks]
        types = {name for name, cells in parts if len(cells)}
        if len(types) != 1 or not types <= BEST_AT_VERTEX.keys():
            continue
        (name,) = types
        best = BEST_AT_VERTEX[name]
        cells = np.concatenate([cells for other, cells in parts if other == name])
        if CELL_TYPES[name].dimension == 3:
            yield Fan((v,), len(cells), best(_solid_angles(points, cells, v).mean()))
            for w in distinct(cells[np.isin(cells, vertices[i + 1 :])]).tolist():
                at_edge = cells[(cells == w).any(axis=1)]
                share = _dihedral_angles(points, at_edge, v, w).mean()
                yield Fan((v, w), len(at_edge), best_tetra_at_edge(share))
        else:
            share = np.radians(interior_angles(points, cells)[cells == v]).mean()
            yield Fan((v,), len(cells), best(share))


def best_triangle(angle: float) -> float:
    """The largest mean ratio of a triangle with this angle (0 to π) between two equal sides."""
    return sqrt(3.0) * sin(angle) / (2.0 - cos(angle))


def best_quad(angle: float) -> float:
    """The largest mean ratio of a quadrilateral with this angle (0 to π): that of a rhombus's corner."""
    return sin(angle)


def best_tetra_at_edge(angle: float) -> float:
    """The largest mean ratio of a tetrahedron with this dihedral angle (0 to π) at an edge.

    With V six times the volume and S the sum of the squared edges, Q = 6 · 2^(1/3) V^(2/3) / S. The other two
    vertices are best across the middle of the edge e, equally far (r) from it: V = e r² sin α and
    S = 2 e² + 4 r² (1 + sin²(α/2)), which for given V is least where the first term is a third of it.
    """
    return float((sqrt(2.0) * sin(angle) / (1.0 + sin(angle / 2.0) ** 2)) ** (2.0 / 3.0))


def best_tetra_at_vertex(angle: float) -> float:
    """The largest mean ratio of a tetrahedron with this solid angle (0 to 2π) at a vertex.

    It has three equal edges there, equally far apart; c, the cosine between two of them, follows from the
    three dihedral angles there, whose sum is the solid angle plus π.
    """
    dihedral = cos((angle + pi) / 3.0)
    c = dihedral / (1.0 - dihedral)
    v = (1.0 - c) * sqrt(1.0 + 2.0 * c)
    return float(6.0 * 2.0 ** (1.0 / 3.0) * v ** (2.0 / 3.0) / (9.0 - 6.0 * c))


# By cell type, the largest mean ratio given the angle at a vertex, in a volume cell the solid angle.
BEST_AT_VERTEX: dict[str, Callable[[float], float]] = {
    "triangle": best_triangle,
    "quad": best_quad,
    "tetra": best_tetra_at_vertex,
}


def _solid_angles(points: np.ndarray, cells: np.ndarray, v: int) -> np.ndarray:
    """(n,) solid angle of each tetrahedron at its vertex v (Van Oosterom & Strackee 1983)."""
    edges = points[cells[cells != v].reshape(-1, 3)] - points[v]
    a, b, c = np.moveaxis(edges / np.linalg.norm(edges, axis=2, keepdims=True), 1, 0)
    volume = np.abs((a * np.cross(b, c)).sum(axis=1))
    return 2.0 * np.arctan2(volume, 1.0 + (a * b + b * c + c * a).sum(axis=1))


def _dihedral_angles(points: np.ndarray, cells: np.ndarray, v: int, w: int) -> np.ndarray:
    """(n,) angle of each tetrahedron at its edge from v to w."""
    others = points[cells[(cells != v) & (cells != w)].reshape(-1, 2)] - points[v]
    edge = points[w] - points[v]
    along, one, other = edge / np.sqrt(edge @ edge), others[:, 0], others[:, 1]
    across = np.abs(np.cross(one, other) @ along)
    return np.arctan2(across, (one * other).sum(axis=1) - (one @ along) * (other @ along))
