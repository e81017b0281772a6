"""The shape of a mesh by brute force: what sliding has to keep, found without the package's own facets."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from dvr_cli.mesh.mesh import Mesh

# Vertices in positive order, seen from outside.
SIDES = {
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "quad": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "tetra": [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)],
    "hexahedron": [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
    "wedge": [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
    "pyramid": [(3, 2, 1, 0), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
}
RANK = {
    "vertex": 0,
    "line": 1,
    "triangle": 2,
    "quad": 2,
    "tetra": 3,
    "hexahedron": 3,
    "wedge": 3,
    "pyramid": 3,
}
CORNERS = {"line": 2, "triangle": 3, "quad": 4, "tetra": 4}


def cells_of(mesh: Mesh):
    """(type, corner vertices, tags) of every cell."""
    for b, block in enumerate(mesh.cells):
        linear = block.type.rstrip("0123456789")
        for row, cell in enumerate(block.vertices.tolist()):
            tags = tuple(int(values[b][row]) for values in mesh.cell_data.values())
            yield linear, tuple(cell[: CORNERS.get(linear)]), tags


def dimension_of(mesh: Mesh) -> int:
    return max(RANK[kind] for kind, _, _ in cells_of(mesh))


def skins(mesh: Mesh) -> dict[tuple, list[tuple[int, ...]]]:
    """For every region, by its tags, the facets between it and anything else, seen from outside."""
    d = dimension_of(mesh)
    owners = defaultdict(list)
    for kind, cell, tags in cells_of(mesh):
        if RANK[kind] == d:
            for side in SIDES[kind]:
                facet = tuple(cell[i] for i in side)
                owners[tuple(sorted(facet))].append((tags, facet))
    skin = defaultdict(list)
    for sharing in owners.values():
        for tags, facet in sharing:
            if len(sharing) == 1 or sharing[0][0] != sharing[1][0]:
                skin[tags].append(facet)
    return skin


def area_vector(points: np.ndarray, facet: tuple[int, ...]) -> np.ndarray:
    """The normal of a facet, as long as its area (length) is large."""
    x = points[list(facet)]
    if len(facet) == 2:
        along = x[1] - x[0]
        return np.array([along[1], -along[0]])
    return sum(np.cross(x[i] - x[0], x[i + 1] - x[0]) for i in range(1, len(x) - 1)) / 2


def measures(mesh: Mesh, points: np.ndarray) -> dict[tuple, float]:
    """The volume (area) and the boundary area (length) of every region, and the size of every group."""
    d = dimension_of(mesh)
    simplices = not {"quad", "hexahedron", "wedge", "pyramid"} & {kind for kind, _, _ in cells_of(mesh)}
    points = points[:, :d]
    origin = points.min(axis=0)
    found = defaultdict(float)
    for tags, facets in skins(mesh).items():
        for facet in facets:
            vector = area_vector(points, facet)
            found["content", tags] += (points[facet[0]] - origin) @ vector / d
            found["skin", tags] += np.linalg.norm(vector)
    for kind, cell, tags in cells_of(mesh):
        x = points[list(cell)]
        if RANK[kind] == 1:
            found["group", kind, tags] += np.linalg.norm(x[1] - x[0])
        elif RANK[kind] == 2 < d:
            found["group", kind, tags] += np.linalg.norm(area_vector(points, cell))
        elif RANK[kind] == d and simplices:
            found["cells", tags] += np.linalg.det(x[1:] - x[0])
    return found


def kept_facets(mesh: Mesh) -> list[tuple[int, ...]]:
    """The facets on boundaries and interfaces, and those that lower cells are."""
    d = dimension_of(mesh)
    lower = [cell for kind, cell, _ in cells_of(mesh) if RANK[kind] == d - 1]
    return [facet for facets in skins(mesh).values() for facet in facets] + lower
