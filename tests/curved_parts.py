"""Parts with curved faces, solid and as surfaces, and brute-force distances to what they were."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial import Delaunay

from dvr_cli.files import gmsh as reader
from dvr_cli.mesh.mesh import Cells, Mesh
from gmsh_session import gmsh_session
from meshes import random_mesh

# how Gmsh's kernel makes each, and the size of its elements
PARTS = {
    "sphere": (lambda occ: occ.addSphere(0, 0, 0, 1), 0.45),
    "cylinder": (lambda occ: occ.addCylinder(0, 0, 0, 0, 0, 2, 1), 0.5),
    "torus": (lambda occ: occ.addTorus(0, 0, 0, 1, 0.4), 0.3),
}


@cache
def solid(name: str) -> Mesh:
    """The part called ``name`` in tetrahedra as Gmsh leaves them without optimising, and nothing else."""
    return _only(_meshed(name, 3), "tetra")


@cache
def surface(name: str) -> Mesh:
    """The surface of the part in triangles, shaken along itself so that there is something to gain."""
    mesh = _only(_meshed(name, 2), "triangle")
    rng = np.random.default_rng(4)
    points = mesh.points.copy()
    inner = np.flatnonzero(~_on_edges(name, points))
    shift = 0.04 * rng.standard_normal((len(inner), 3))
    points[inner] = _onto(name, points[inner] + shift)
    return Mesh(points, mesh.cells)


def scanned(n: int = 12, noise: float = 0.004) -> Mesh:
    """A hilly height field over random places, with noise on the heights: open, and nowhere smooth."""
    rng = np.random.default_rng(8)
    xy = rng.random((n * n, 2))
    side = np.linspace(0, 1, n)
    border = np.concatenate([[(t, 0), (1, t), (1 - t, 1), (0, 1 - t)] for t in side[:-1]])
    xy = np.concatenate([border, 0.05 + 0.9 * xy])
    z = 0.1 * np.sin(5 * xy[:, 0]) * np.cos(4 * xy[:, 1]) + noise * rng.standard_normal(len(xy))
    return Mesh(np.column_stack([xy, z]), [Cells("triangle", Delaunay(xy).simplices.astype(np.int64))])


def wavy(
    n: int, seed: int, crease: bool = False, slit: bool = False, fin: bool = False, degenerate: bool = False
) -> Mesh:
    """A wavy sheet of n by n squares cut in two, its inner vertices shaken.

    crease: folded along its middle; slit: cut there; fin: with a third sheet standing on its middle;
    degenerate: with a square whose two triangles have no area.
    """
    rng = np.random.default_rng(seed)
    side = np.linspace(0, 1, 2 * n + 1)
    x, y = (part.ravel() for part in np.meshgrid(side, side, indexing="ij"))
    inner = (x > 0) & (x < 1) & (y > 0) & (y < 1) & ~((x == 0.5) & (crease or slit or fin))
    shake = 0.3 / (2 * n) * rng.uniform(-1, 1, (2, len(x)))
    x, y = x + inner * shake[0], y + (inner | ((x == 0.5) & (y > 0) & (y < 1))) * shake[1]
    z = 0.08 * np.sin(4 * x + 1) * np.cos(3 * y) + (1.2 * np.abs(x - 0.5) if crease else 0.0)
    number = np.arange(len(x)).reshape(2 * n + 1, -1)
    a, b, c, d = (
        part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    cells = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    points = np.column_stack([x, y, z])
    middle = number[n]
    if slit:
        beyond = points[cells].mean(axis=1)[:, 0] > 0.5
        copies = np.arange(len(points))
        copies[middle[1:-1]] = len(points) + np.arange(len(middle) - 2)
        cells[beyond] = copies[cells[beyond]]
        points = np.concatenate([points, points[middle[1:-1]]])
    if fin:
        top = len(points) + np.arange(len(middle))
        points = np.concatenate([points, points[middle] + [0.0, 0.0, 0.4]])
        up = [(*middle[i : i + 2], top[i]) for i in range(2 * n)]
        up += [(middle[i + 1], top[i + 1], top[i]) for i in range(2 * n)]
        cells = np.concatenate([cells, np.array(up)])
    if degenerate:
        points[number[1, 1]] = points[number[1, 2]]
    return Mesh(points, [Cells("triangle", cells.astype(np.int64))])


def tube(twist: float, layers: int = 1, noise: float = 0.0, seed: int = 0, around: int = 24) -> Mesh:
    """A tube of tetrahedra whose outer wall is turned against the inner one, by up to ``twist`` cells.

    Its walls have radii 1 and 0.8. noise: part of that by which each outer vertex is astray.
    """
    rng = np.random.default_rng(seed)
    rows = 8
    i, j, k = (index.ravel() for index in np.indices((around, rows + 1, layers + 1)))
    z, outer = 2.0 * j / rows, (k == layers) & (j > 0) & (j < rows)
    turn = twist * np.exp(-(((z - 1) / 0.5) ** 2)) * (1 + noise * rng.standard_normal(len(z)))
    angle = 2 * np.pi / around * (i + np.where(outer, turn, 0.0))
    radius = 0.8 + 0.2 * k / layers
    boxes = np.indices((around, rows, layers)).reshape(3, -1)
    at = [
        (((boxes[0] + a) % around * (rows + 1) + boxes[1] + b) * (layers + 1) + boxes[2] + c)
        for c, b, a in np.ndindex(2, 2, 2)
    ]
    cut = np.array([(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)])
    cells = np.stack(at, axis=1)[:, cut].reshape(-1, 4)
    return Mesh(np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z]), [Cells("tetra", cells)])


def ball(seed: int, n: int = 3) -> Mesh:
    """A ball of tetrahedra, a cube blown up, with its inner vertices shaken."""
    mesh = random_mesh("tetra", seed, n=n)
    around = 2.0 * mesh.points - 1.0
    far, radius = np.abs(around).max(axis=1), np.linalg.norm(around, axis=1)
    return Mesh(
        around * np.divide(far, radius, out=np.zeros_like(far), where=radius > 0)[:, None], mesh.cells
    )


def squeezed(seed: int, n: int = 3) -> Mesh:
    """Such a ball, whose outer vertices are astray on the sphere, too, where its elements stay positive."""
    mesh, rng = ball(seed, n), np.random.default_rng(seed)
    points, tets = mesh.points.copy(), mesh.cells[0].vertices
    for vertex in rng.permutation(np.unique(skin(mesh))):
        before, around = points[vertex].copy(), points[tets[(tets == vertex).any(axis=1)]]
        place = before + 0.3 * rng.standard_normal(3)
        place /= np.linalg.norm(place)
        around[(around == before).all(axis=2)] = place
        if (np.linalg.det(around[:, 1:] - around[:, :1]) > 0).all():
            points[vertex] = place
    return Mesh(points, mesh.cells)


def skin(mesh: Mesh) -> np.ndarray:
    """The boundary triangles of a tetrahedral mesh, or all triangles of a surface."""
    cells = mesh.cells[0].vertices
    if cells.shape[1] == 3:
        return cells
    faces = cells[:, [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]


def distances(queries: np.ndarray, points: np.ndarray, simplices: np.ndarray) -> np.ndarray:
    """(n,) distance of each query to the nearest of all triangles or segments, each looked at."""
    corners = points[simplices]
    result = np.full(len(queries), np.inf)
    for a, b, *rest in corners:
        for p, q in ((a, b), (b, rest[0]), (rest[0], a)) if rest else ((a, b),):
            t = np.clip((queries - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
            result = np.minimum(result, np.linalg.norm(queries - p - t[:, None] * (q - p), axis=1))
        if rest:
            frame = np.array([b - a, rest[0] - a])
            u, v = np.linalg.solve(frame @ frame.T, frame @ (queries - a).T)
            normal = np.cross(*frame)
            height = np.abs((queries - a) @ normal) / np.linalg.norm(normal)
            inside = (u >= 0) & (v >= 0) & (u + v <= 1)
            result = np.where(inside, np.minimum(result, height), result)
    return result


def apart(before: np.ndarray, after: np.ndarray, simplices: np.ndarray) -> float:
    """The largest distance between two states of triangles or segments, found densely from both sides."""
    k = simplices.shape[1]
    steps = np.array([w for w in np.ndindex(*[5] * k) if sum(w) == 4]) / 4
    changed = simplices[(before != after).any(axis=1)[simplices].any(axis=1)]
    largest = 0.0
    for here, there in ((before, after), (after, before)):
        samples = np.einsum("sk,fkd->fsd", steps, here[changed]).reshape(-1, before.shape[1])
        largest = max(largest, distances(samples, there, simplices).max(initial=0.0))
    return largest


def _meshed(name: str, dimension: int) -> Mesh:
    build, size = PARTS[name]
    with gmsh_session(Mesh_MeshSizeMin=size, Mesh_MeshSizeMax=size, Mesh_Optimize=0) as gmsh:
        build(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(dimension)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "part.msh"
            gmsh.write(str(path))
            return reader.read(path.read_bytes()).mesh


def _only(mesh: Mesh, kind: str) -> Mesh:
    """The cells of one type, in one block, without tags: no seams of the geometry, no groups."""
    cells = np.concatenate([block.vertices for block in mesh.cells if block.type == kind])
    return Mesh(mesh.points, [Cells(kind, cells)])


def _on_edges(name: str, points: np.ndarray) -> np.ndarray:
    if name != "cylinder":
        return np.zeros(len(points), dtype=bool)
    rim = np.abs(np.linalg.norm(points[:, :2], axis=1) - 1) < 1e-9
    return rim & ((points[:, 2] < 1e-9) | (points[:, 2] > 2 - 1e-9))


def _onto(name: str, points: np.ndarray) -> np.ndarray:
    """Points near the part's smooth surface, put on it."""
    if name == "sphere":
        return points / np.linalg.norm(points, axis=1)[:, None]
    radius = np.linalg.norm(points[:, :2], axis=1)[:, None]
    if name == "cylinder":
        lids = (np.abs(points[:, 2] - 1) > 0.75) & (radius[:, 0] < 0.85)
        onto = np.column_stack([points[:, :2] / radius, np.clip(points[:, 2], 0.1, 1.9)])
        flat = np.column_stack([points[:, :2], np.where(points[:, 2] > 1, 2.0, 0.0)])
        return np.where(lids[:, None], flat, onto)
    ring = np.column_stack([points[:, :2] / radius, np.zeros(len(points))])
    way = points - ring
    return ring + 0.4 * way / np.linalg.norm(way, axis=1)[:, None]
