"""Small meshes of every element type for the tests, distorted at random."""

import numpy as np
from scipy.spatial import Delaunay

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.mesh.mesh import Cells, Mesh

KINDS = ("triangle", "quad", "tetra", "hexahedron", "wedge", "pyramid", "mixed2d", "mixed3d")

# An upper triangular map: L of its metric is its inverse, up to size.
STRETCH = np.array([[5.0, 1.5, -0.5], [0.0, 1.0, 0.25], [0.0, 0.0, 0.25]])

# A hexahedron cut into others, as local vertices; 8 is its centre.
WEDGES = ((0, 3, 7, 1, 2, 6), (0, 7, 4, 1, 6, 5))
PYRAMIDS = (
    (0, 1, 2, 3, 8),
    (7, 6, 5, 4, 8),
    (0, 4, 5, 1, 8),
    (2, 6, 7, 3, 8),
    (0, 3, 7, 4, 8),
    (1, 5, 6, 2, 8),
)
TETRAHEDRA = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))


def random_mesh(kind: str, seed: int, n: int = 3, noise: float = 0.3) -> Mesh:
    """A mesh of about n^d boxes in the unit square or cube, inner vertices shifted by up to noise/n.

    Simplices of kind "triangle" are the Delaunay mesh of random points instead.
    """
    rng = np.random.default_rng(seed)
    if kind == "triangle":
        return delaunay(10 * n, 2, seed)
    d = 2 if kind in ("quad", "mixed2d") else 3
    points, boxes = grid(n, d)
    inner = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    points[inner] += noise / n * rng.uniform(-1, 1, (inner.sum(), d))
    if kind == "mixed2d":
        cut = boxes[: len(boxes) // 2]
        triangles = np.concatenate([np.take(cut, three, axis=1) for three in ([0, 1, 2], [0, 2, 3])])
        return Mesh(points, [Cells("triangle", triangles), Cells("quad", boxes[len(boxes) // 2 :])])
    if kind in ("quad", "hexahedron"):
        return Mesh(points, [Cells(kind, boxes)])
    centres = len(points) + np.arange(len(boxes))
    nine = np.column_stack([boxes, centres])
    with_centres = np.vstack([points, points[boxes].mean(axis=1)])
    if kind == "mixed3d":  # the lowest layer hexahedra, the highest wedges, between them pyramids
        layer = np.arange(len(boxes)) % n
        wedges = _cut(boxes[layer == n - 1], WEDGES)
        blocks = [
            Cells("hexahedron", boxes[layer == 0]),
            Cells("pyramid", _cut(nine[(layer > 0) & (layer < n - 1)], PYRAMIDS)),
            Cells("wedge", wedges),
        ]
        return Mesh(with_centres, blocks)
    if kind == "pyramid":
        return Mesh(with_centres, [Cells(kind, _cut(nine, PYRAMIDS))])
    return Mesh(points, [Cells(kind, _cut(boxes, {"wedge": WEDGES, "tetra": TETRAHEDRA}[kind]))])


def delaunay(n: int, dimension: int, seed: int, height: float = 1.0) -> Mesh:
    """The Delaunay mesh of n random points in a unit square or cube of this height, positively oriented."""
    rng = np.random.default_rng(seed)
    points = rng.random((n, dimension))
    points[:, -1] *= height
    simplices = Delaunay(points).simplices.astype(np.int64)
    volume = np.linalg.det(points[simplices[:, 1:]] - points[simplices[:, :1]])
    simplices[volume < 0] = simplices[volume < 0][:, [1, 0, *range(2, dimension + 1)]]
    return Mesh(points, [Cells("triangle" if dimension == 2 else "tetra", simplices)])


def random_freedom(domain, seed: int) -> Freedom:
    """Interior vertices that move in random lines, random planes or anywhere, in turns of no order."""
    rng = np.random.default_rng(seed)
    d = domain.dimension
    dimension = np.where(domain.interior, rng.integers(1, d + 1, len(domain.points)), 0).astype(np.uint8)
    axis = rng.normal(size=(len(dimension), d))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    axis[(dimension == 0) | (dimension == d)] = 0.0
    return Freedom(dimension, axis)


def random_tensors(n: int, dimension: int, seed: int) -> np.ndarray:
    """(n, d, d) positive definite tensors that have nothing to do with each other."""
    root = np.random.default_rng(seed).normal(size=(n, dimension, dimension))
    return root @ root.transpose(0, 2, 1) + 0.1 * np.eye(dimension)


def stretched(mesh: Mesh) -> tuple[Mesh, np.ndarray, np.ndarray]:
    """The mesh in a stretched and sheared space, the map, and the metric that undoes it."""
    d = mesh.points.shape[1]
    by = STRETCH[:d, :d]
    back = np.linalg.inv(by)
    return Mesh(mesh.points @ by.T, mesh.cells), by, np.tile(back.T @ back, (len(mesh.points), 1, 1))


def outside(freedom: Freedom, shift: np.ndarray) -> np.ndarray:
    """(N, d) the part of the vertices' shifts (N, d) that leaves their lines and planes."""
    along = (shift * freedom.axis).sum(axis=1, keepdims=True) * freedom.axis
    left = np.where((freedom.dimension == 1)[:, None], shift - along, along)
    return np.where((freedom.dimension == 0)[:, None], shift, left)


def hexagon(rings: int) -> Mesh:
    """A hexagon of radius 1 with ``rings`` rings of equilateral triangles around its centre (paper 5.2)."""
    q, r = np.meshgrid(np.arange(-rings, rings + 1), np.arange(-rings, rings + 1), indexing="ij")
    inside = np.abs(q + r) <= rings
    number = np.full(q.shape, -1)
    number[inside] = np.arange(inside.sum())
    points = np.column_stack([q[inside] + r[inside] / 2, r[inside] * np.sqrt(3) / 2]) / rings
    up = np.stack([number[:-1, :-1], number[1:, :-1], number[:-1, 1:]], axis=-1).reshape(-1, 3)
    down = np.stack([number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 3)
    triangles = np.concatenate([up, down])
    return Mesh(points, [Cells("triangle", triangles[(triangles >= 0).all(axis=1)])])


def boxes_of(kind: str, n: int) -> Mesh:
    """The unit square or cube as n^d equal boxes, for simplices each cut into two or six."""
    points, boxes = grid(n, 2 if kind in ("triangle", "quad") else 3)
    pieces = {"triangle": ((0, 1, 2), (0, 2, 3)), "tetra": TETRAHEDRA}
    return Mesh(points, [Cells(kind, _cut(boxes, pieces[kind]) if kind in pieces else boxes)])


def tangled(kind: str, n: int, lengths: float, seed: int) -> Mesh:
    """``boxes_of`` with every inner vertex displaced at random by so many lengths of a box's edge."""
    mesh = boxes_of(kind, n)
    inner = ((mesh.points > 1e-9) & (mesh.points < 1 - 1e-9)).all(axis=1)
    way = np.random.default_rng(seed).standard_normal((inner.sum(), mesh.points.shape[1]))
    mesh.points[inner] += lengths / n * way / np.linalg.norm(way, axis=1, keepdims=True)
    return mesh


def bump(kind: str, n: int, width: float = 0.12, height: float = 0.5) -> Mesh:
    """``boxes_of`` with the floor pushed up under a Gaussian bump, inner vertices left where they were."""
    mesh = boxes_of(kind, n)
    floor = mesh.points[:, -1] < 1e-9
    square = ((mesh.points[floor, :-1] - 0.5) ** 2).sum(axis=1)
    mesh.points[floor, -1] = height * np.exp(-square / (2 * width**2))
    return mesh


def turned_hexagon(rings: int, degrees: float) -> Mesh:
    """``hexagon`` with its boundary turned about the centre, all else in place (paper 5.3)."""
    mesh = hexagon(rings)
    normals = np.pi / 6 + np.pi / 3 * np.arange(3)
    away = np.abs(mesh.points @ np.array([np.cos(normals), np.sin(normals)])).max(axis=1)
    boundary = away > np.sqrt(0.75) - 1e-9
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    mesh.points[boundary] = mesh.points[boundary] @ np.array([[cos, sin], [-sin, cos]])
    return mesh


def grid(n: int, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """The points of n^d equal boxes in the unit square or cube, and the boxes as quads or hexahedra."""
    index = np.arange((n + 1) ** dimension).reshape((n + 1,) * dimension)
    points = np.stack(np.meshgrid(*[np.linspace(0, 1, n + 1)] * dimension, indexing="ij"), axis=-1)
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    local = square if dimension == 2 else [(*xy, z) for z in (0, 1) for xy in square]
    boxes = [index[tuple(slice(o, o + n) for o in offset)].ravel() for offset in local]
    return points.reshape(-1, dimension), np.stack(boxes, axis=1)


def _cut(boxes: np.ndarray, pieces: tuple[tuple[int, ...], ...]) -> np.ndarray:
    return np.take(boxes, np.array(pieces), axis=1).reshape(-1, len(pieces[0]))
