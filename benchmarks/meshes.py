"""The benchmark meshes: made by script, the same on every run, kept in a temporary directory.

The Delaunay meshes are those of random points in the unit cube or square. Their boundary carries a regular
lattice, slightly shaken within its faces, so that it stays planar and no four points of it are cocircular;
the random points keep off it a little, and elements flat on it are left out. Gmsh makes the Delaunay meshes
too, as it is several times faster than Qhull.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
import trimesh

from dvr_cli.mesh.mesh import Cells, Mesh

CACHE = Path(tempfile.gettempdir()) / "dvr-benchmarks"
LEAST = 0.01  # quality below which the points of a tetrahedron are drawn anew
_SIMPLEX = {2: "triangle", 3: "tetra"}
_SHAKE = 0.05  # of the boundary lattice, in units of its spacing
_MARGIN = 0.25  # least distance of the random points from the boundary, in the same unit

Maker = Callable[..., Mesh]


def kept(make: Maker) -> Maker:
    """Make a mesh only once: later calls with the same arguments load it."""

    @wraps(make)
    def load(*arguments: float) -> Mesh:
        path = _file_of(make, arguments)
        if not path.exists():
            mesh = make(*arguments)
            CACHE.mkdir(exist_ok=True)
            unfinished = path.with_suffix(".part.npz")
            arrays: dict[str, Any] = {"points": mesh.points, mesh.cells[0].type: mesh.cells[0].vertices}
            np.savez(unfinished, **arrays)
            unfinished.replace(path)
        return load_mesh(path)

    return load


def load_mesh(path: Path) -> Mesh:
    """A mesh kept by ``kept``."""
    with np.load(path) as arrays:
        (name,) = set(arrays.files) - {"points"}
        return Mesh(arrays["points"], [Cells(name, arrays[name])])


def path_of(make: Maker, *arguments: float) -> Path:
    """The file of a kept mesh, made if need be."""
    make(*arguments)
    return _file_of(make, arguments)


def _file_of(make: Maker, arguments: Sequence[float]) -> Path:
    return CACHE / f"{'-'.join([make.__name__, *map(str, arguments)])}.npz"


@kept
def random_tets(n: int) -> Mesh:
    """Delaunay tetrahedra of n points in the unit cube, those inside random."""
    return _random_simplices(n, 3, LEAST)


@kept
def random_triangles(n: int) -> Mesh:
    """Delaunay triangles of n points in the unit square, those inside random."""
    return _random_simplices(n, 2, 0.0)


@kept
def raw_tets(n: int) -> Mesh:
    """``random_tets`` as drawn, slivers and all: quickly made, for sizes where only speed is asked."""
    return _random_simplices(n, 3, 0.0)


@kept
def raw_tets_along_curve(n: int) -> Mesh:
    """``raw_tets`` numbered along a space-filling curve instead of at random."""
    mesh = raw_tets(n)
    cell = np.minimum(mesh.points * 1024, 1023).astype(np.int64)
    code = np.zeros(len(cell), dtype=np.int64)
    for bit in range(10):  # Morton's curve: the bits of the three coordinates in turn
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    order = np.argsort(code, kind="stable")
    number = np.empty(len(order), dtype=np.int32)
    number[order] = np.arange(len(order))
    tets = number[mesh.cells[0].vertices]
    return Mesh(mesh.points[order], [Cells("tetra", tets[np.argsort(tets.min(axis=1), kind="stable")])])


@kept
def shaken_hexes(k: int) -> Mesh:
    """A grid of k^3 hexahedra in the unit cube, its inner vertices shaken."""
    index = np.arange((k + 1) ** 3, dtype=np.int32).reshape(k + 1, k + 1, k + 1)
    corner = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    hexes = np.stack([index[x : x + k, y : y + k, z : z + k].ravel() for x, y, z in corner], axis=1)
    points = np.stack(np.unravel_index(np.arange(index.size), index.shape), axis=1) / k
    inside = ((points > 0) & (points < 1)).all(axis=1, keepdims=True)
    shake = np.random.default_rng(0).uniform(-0.2 / k, 0.2 / k, points.shape)
    return Mesh(points + inside * shake, [Cells("hexahedron", hexes)])


@kept
def noisy_ellipsoid(subdivisions: int, folded: int) -> Mesh:
    """An icosphere scaled by 1, 1.3 and 0.7, its vertices shaken along the sphere before.

    folded: 0 for vertices that are shaken by a quarter of the edge in random directions, and come out without
    folds; 1 for normal noise of that deviation in each coordinate, which folds one triangle in a hundred.
    """
    sphere = trimesh.creation.icosphere(subdivisions)
    shake = np.random.default_rng(0).normal(size=sphere.vertices.shape)
    if not folded:
        shake /= np.linalg.norm(shake, axis=1, keepdims=True)
    points = sphere.vertices + 0.25 * sphere.edges_unique_length.mean() * shake
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return Mesh(points * (1.0, 1.3, 0.7), [Cells("triangle", np.asarray(sphere.faces))])


@kept
def scanned_torus(around: int, across: int) -> Mesh:
    """A bumpy torus as a scanner sees it: 2 x around x across triangles, no two of one shape.

    Places are shaken by up to a quarter of the spacing along the surface, and by a twentieth of it, normally
    distributed, across. Each quadrilateral of neighbours is cut along its shorter diagonal.
    """
    rng = np.random.default_rng(0)
    i, j = np.divmod(np.arange(around * across), across)
    shake = rng.uniform(-0.25, 0.25, (2, len(i)))
    u, v = 2.0 * np.pi * (i + shake[0]) / around, 2.0 * np.pi * (j + shake[1]) / across
    radius = 0.35 * (1.0 + 0.1 * np.sin(5.0 * u) * np.cos(3.0 * v) + 0.03 * np.sin(17.0 * u + 4.0 * v))
    radius += 0.05 * 2.0 * np.pi * 0.35 / across * rng.normal(size=len(i))
    reach = 1.0 + radius * np.cos(v)
    points = np.stack([reach * np.cos(u), reach * np.sin(u), radius * np.sin(v)], axis=1)
    ahead, beside = (i + 1) % around, (j + 1) % across
    a, b = i * across + j, ahead * across + j
    c, d = ahead * across + beside, i * across + beside
    shorter = ((points[a] - points[c]) ** 2).sum(axis=1) < ((points[b] - points[d]) ** 2).sum(axis=1)
    one = np.where(shorter, [a, b, c], [a, b, d]).T
    other = np.where(shorter, [a, c, d], [b, c, d]).T
    triangles = np.stack([one, other], axis=1).reshape(-1, 3).astype(np.int32)
    return Mesh(points, [Cells("triangle", triangles)])


@kept
def scanned_bunny() -> Mesh:
    """The Stanford bunny, a mended scan, as the package pymeshfix has it; without that an ImportError."""
    examples = import_module("pymeshfix.examples")
    scan = trimesh.load_mesh(examples.bunny_scan, process=False)
    return Mesh(np.array(scan.vertices, dtype=np.float64), [Cells("triangle", np.asarray(scan.faces))])


@kept
def gmsh_sphere(h: float) -> Mesh:
    """Gmsh's Delaunay mesh of the unit sphere with edge length h, not optimised."""
    with _gmsh_model(h):
        gmsh.option.setNumber("Mesh.Optimize", 0)
        gmsh.model.occ.addSphere(0, 0, 0, 1)
        return _meshed()


@kept
def gmsh_part(h: float) -> Mesh:
    """A drilled plate with a bored boss, 60 x 40 x 30, meshed and optimised by Gmsh with edge length h."""
    with _gmsh_model(h):
        _add_part()
        return _meshed()


@kept
def part_by_gmsh(h: float, algorithm: int, optimised: int) -> Mesh:
    """The part of ``gmsh_part`` by an algorithm of Gmsh's for volumes, optimised (1) or not (0)."""
    with _gmsh_model(h):
        gmsh.option.setNumber("Mesh.Algorithm3D", algorithm)
        gmsh.option.setNumber("Mesh.Optimize", optimised)
        _add_part()
        return _meshed()


def timed_part(h: float, algorithm: int, threads: int) -> tuple[Mesh, list[float]]:
    """The part as in ``part_by_gmsh``, not optimised, and the seconds for curves and surfaces, and in all."""
    with _gmsh_model(h):
        gmsh.option.setNumber("Mesh.Algorithm3D", algorithm)
        gmsh.option.setNumber("Mesh.Optimize", 0)
        gmsh.option.setNumber("General.NumThreads", threads)
        _add_part()
        gmsh.model.occ.synchronize()
        begin, taken = time.perf_counter(), []
        for dimension in (2, 3):
            gmsh.model.mesh.generate(dimension)
            taken.append(time.perf_counter() - begin)
        return _of_model(3), taken


@kept
def part_surface(h: float) -> Mesh:
    """The surface of ``gmsh_part``, (n, 3) triangles seen from outside."""
    with _gmsh_model(h):
        _add_part()
        return _meshed(2)


@kept
def gmsh_plate(h: float, smoothing: int) -> Mesh:
    """A square plate with two holes, in triangles by Gmsh, so many times smoothed by it."""
    with _gmsh_model(h):
        gmsh.option.setNumber("Mesh.Smoothing", smoothing)
        occ = gmsh.model.occ
        plate = occ.addRectangle(0, 0, 0, 1, 1)
        holes = [(2, occ.addDisk(0.3, 0.35, 0, 0.15, 0.15)), (2, occ.addDisk(0.7, 0.7, 0, 0.1, 0.1))]
        occ.cut([(2, plate)], holes)
        mesh = _meshed(2)
        return Mesh(mesh.points[:, :2], mesh.cells)


def write_msh(mesh: Mesh, path: Path) -> None:
    """Write tetrahedra as Gmsh does: binary .msh 4.1, one physical group (without one meshio cannot)."""
    with _gmsh_model(1.0):
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.model.addDiscreteEntity(3, 1)
        gmsh.model.mesh.addNodes(3, 1, np.arange(1, len(mesh.points) + 1), mesh.points.ravel())
        gmsh.model.mesh.addElementsByType(1, 4, [], (mesh.cells[0].vertices + 1).ravel())
        gmsh.model.addPhysicalGroup(3, [1], name="body")
        gmsh.write(str(path))


def _random_simplices(n: int, d: int, least: float) -> Mesh:
    rng = np.random.default_rng(0)
    k = round(n ** (1 / d))
    boundary, margin = _boundary_lattice(k, d, rng), _MARGIN / (k - 1)
    points = np.concatenate([boundary, rng.uniform(margin, 1 - margin, (n - len(boundary), d))])
    while True:
        cells = _delaunay(points)
        bad = cells[_mean_ratio(points[cells]) < least]
        again = np.unique(bad[bad >= len(boundary)])
        if not len(again):
            return Mesh(points, [Cells(_SIMPLEX[d], cells)])
        points[again] = rng.uniform(margin, 1 - margin, (len(again), d))


def _boundary_lattice(k: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """The points of a lattice with k points a side that are on the boundary of the unit cube or square."""
    lattice = np.stack(np.unravel_index(np.arange(k**d), (k,) * d), axis=1)
    lattice = lattice[((lattice == 0) | (lattice == k - 1)).any(axis=1)]
    free = (lattice > 0) & (lattice < k - 1)  # along these axes a point may move without leaving its face
    return (lattice + free * rng.uniform(-_SHAKE, _SHAKE, lattice.shape)) / (k - 1)


def _delaunay(points: np.ndarray) -> np.ndarray:
    """(n, d+1) int32 positive Delaunay simplices, without those that lie in a face of the unit cube."""
    d = points.shape[1]
    with _gmsh_model(1.0):
        flat = points.ravel()
        tags = gmsh.algorithm.tetrahedralize(flat)[0] if d == 3 else gmsh.algorithm.triangulate(flat)
    cells = np.asarray(tags).astype(np.int32).reshape(-1, d + 1) - 1
    x = points[cells]
    in_face = ((x == 0).all(axis=1) | (x == 1).all(axis=1)).any(axis=1)
    cells = cells[~in_face]
    negative = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    cells[negative, :2] = cells[negative, 1::-1]
    return cells


def _mean_ratio(corners: np.ndarray) -> np.ndarray:
    """Mean ratio of positive simplices given by coordinates (n, d+1, d), from all their edge lengths."""
    d = corners.shape[2]
    det = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    first, second = np.triu_indices(d + 1, 1)
    squares = ((corners[:, first] - corners[:, second]) ** 2).sum(axis=(1, 2))
    return {2: 2 * np.sqrt(3) * det, 3: 12 * (det / 2) ** (2 / 3)}[d] / squares


@contextmanager
def _gmsh_model(h: float) -> Iterator[None]:
    """A new Gmsh model with edge length h whose meshes are the same on every run."""
    gmsh.initialize(["gmsh"], readConfigFiles=False, interruptible=False)
    try:
        for option, value in {
            "General.Terminal": 0,
            "General.NumThreads": 1,
            "Mesh.RandomSeed": 1,
            "Mesh.MeshSizeMin": h,
            "Mesh.MeshSizeMax": h,
        }.items():
            gmsh.option.setNumber(option, value)
        yield
    finally:
        gmsh.finalize()


def _add_part() -> None:
    """The drilled plate with a bored boss, in the Gmsh model."""
    occ = gmsh.model.occ
    plate, boss = occ.addBox(0, 0, 0, 60, 40, 8), occ.addCylinder(18, 20, 0, 0, 0, 30, 12)
    body, _ = occ.fuse([(3, plate)], [(3, boss)])
    holes = [occ.addCylinder(18, 20, -1, 0, 0, 32, 7)]
    holes += [occ.addCylinder(x, y, -1, 0, 0, 10, 3) for x in (40, 52) for y in (8, 32)]
    occ.cut(body, [(3, hole) for hole in holes])


def _meshed(dimension: int = 3) -> Mesh:
    """The tetrahedra of the Gmsh model once it is meshed, or the triangles of a model of surfaces."""
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(dimension)
    return _of_model(dimension)


def _of_model(dimension: int) -> Mesh:
    """The cells of this dimension that the Gmsh model has, and the points they use."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=np.int32)
    number[tags] = np.arange(len(tags))
    _, nodes = gmsh.model.mesh.getElementsByType({2: 2, 3: 4}[dimension])
    used, cells = np.unique(number[nodes], return_inverse=True)
    block = Cells(_SIMPLEX[dimension], cells.reshape(-1, dimension + 1).astype(np.int32))
    return Mesh(coordinates.reshape(-1, 3)[used], [block])
