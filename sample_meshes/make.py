"""Makes the sample meshes: ``python sample_meshes/make.py [NAME ...]`` writes them beside this script.

One function a mesh; all seeds are fixed and Gmsh runs on one thread, so that the same versions of NumPy,
SciPy, Gmsh and meshio (development dependencies) give the same files. Every mesh is valid, that is every
element has positive quality in its own orientation, and much worse than relaxing its vertices can make it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path

import gmsh
import meshio
import numpy as np
from scipy.spatial import Delaunay

Cells = list[tuple[str, np.ndarray]]

# The corners of the cell types that are distorted here: a vertex and its edges' ends, right-handed.
CORNERS = {
    "triangle": [(0, 1, 2)],
    "quad": [(0, 1, 3), (1, 2, 0), (2, 3, 1), (3, 0, 2)],
    "tetra": [(0, 1, 2, 3)],
    "pyramid": [(0, 1, 3, 4), (1, 2, 0, 4), (2, 3, 1, 4), (3, 0, 2, 4)],
    "wedge": [(0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2)],
    "hexahedron": [(i, (i + 1) % 4, (i + 3) % 4, i + 4) for i in range(4)]
    + [(i + 4, (i + 3) % 4 + 4, (i + 1) % 4 + 4, i) for i in range(4)],
}

# ------------------------------------------------------------------------------------------------- tools


def positive(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """The simplices (n, d+1), those of negative measure turned round."""
    negative = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    return np.where(negative[:, None], cells[:, [1, 0, *range(2, cells.shape[1])]], cells)


def delaunay(points: np.ndarray) -> np.ndarray:
    """The simplices (n, d+1) of the Delaunay triangulation, positive; flat ones on the hull are left out."""
    cells = Delaunay(points).simplices
    volume = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]])
    return positive(points, cells[np.abs(volume) > 1e-12])


def distort(
    points: np.ndarray, cells: Cells, free: np.ndarray, rng: np.random.Generator, size: float
) -> None:
    """Move the free vertices at random by up to ``size``, in place, without spoiling an element.

    Wherever a corner gets worse than 0.06 (as 1 is an orthogonal corner with equal edges), the vertices of
    the element go half of their way back, until none is.
    """
    d = points.shape[1]
    move = np.zeros_like(points)
    move[free] = rng.uniform(-size, size, (np.count_nonzero(free), d))
    while True:
        spoilt = np.zeros(len(points), dtype=bool)
        for cell_type, block in cells:
            corner = (points + move)[block[:, np.array(CORNERS[cell_type])]]
            edges = corner[:, :, 1:] - corner[:, :, :1]
            det = np.maximum(np.linalg.det(edges), 0)
            bad = d * det ** (2 / d) < 0.06 * np.sum(edges**2, axis=(2, 3))
            spoilt[block[bad.any(axis=1)]] = True
        if not spoilt.any():
            break
        move[spoilt] /= 2
    points += move


@contextmanager
def gmsh_model() -> Iterator[None]:
    """A new Gmsh model whose meshes are the same on every run."""
    gmsh.initialize(["gmsh"], readConfigFiles=False, interruptible=False)
    try:
        for option, value in {
            "General.Terminal": 0,
            "General.NumThreads": 1,
            "Mesh.RandomSeed": 1,
            "Mesh.SaveAll": 0,
        }.items():
            gmsh.option.setNumber(option, value)
        yield
    finally:
        gmsh.finalize()


def gmsh_mesh(d: int) -> tuple[np.ndarray, np.ndarray, Cells]:
    """The Gmsh model's mesh of d-dimensional cells: point numbers by node tag, points (N, d), cells."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=int)
    number[tags] = np.arange(len(tags))
    cells = []
    for gmsh_type, _, nodes in zip(*gmsh.model.mesh.getElements(d), strict=True):
        cell_type, size = {2: ("triangle", 3), 3: ("quad", 4), 4: ("tetra", 4)}[gmsh_type]
        cells.append((cell_type, number[nodes].reshape(-1, size)))
    return number, coordinates.reshape(-1, 3)[:, :d].copy(), cells


def gmsh_inside(d: int, number: np.ndarray, n: int) -> np.ndarray:
    """Which of the n points belong to no point, curve or (in 3D) surface of the Gmsh model."""
    inside = np.zeros(n, dtype=bool)
    inside[number[gmsh.model.mesh.getNodes(d)[0]]] = True
    return inside


def set_gmsh_points(points: np.ndarray) -> None:
    """Give the nodes of the Gmsh model the points (N, 2 or 3)."""
    for tag, xyz in zip(gmsh.model.mesh.getNodes()[0], space(points), strict=True):
        gmsh.model.mesh.setNode(tag, xyz, [])


def space(points: np.ndarray) -> np.ndarray:
    """Points (N, 2) of a plane as points (N, 3) at height z = 0; points (N, 3) as they are."""
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


# ------------------------------------------------------------------------------------------------ meshes


def random_square(path: Path) -> None:
    """The Delaunay triangulation of 99 random points of the unit square (the paper's section 3.5).

    Its boundary is the convex hull of the points. Of the seeds that leave 86 points inside (0, 4, 6,
    ...) 6 is the first whose worst triangle is, as in the paper, about a hundredth (Q = 0.005) as good as
    relaxing makes it.
    """
    points = np.random.default_rng(6).random((99, 2))
    triangulation = Delaunay(points)
    hull = np.unique(triangulation.convex_hull)
    hull = hull[np.argsort(np.arctan2(*(points[hull] - 0.5).T[::-1]))]
    order = np.concatenate([hull, np.setdiff1d(np.arange(99), hull)])  # the hull first, anticlockwise
    points, cells = points[order], np.argsort(order)[triangulation.simplices]
    cells, m = positive(points, cells), len(hull)
    assert len(points) - m == 86
    with gmsh_model():
        gmsh.model.addDiscreteEntity(1, 1)
        gmsh.model.addDiscreteEntity(2, 1, [1])
        xyz, tags = space(points), np.arange(1, 100)
        gmsh.model.mesh.addNodes(1, 1, tags[:m], xyz[:m].ravel())
        gmsh.model.mesh.addNodes(2, 1, tags[m:], xyz[m:].ravel())
        edges = np.column_stack([tags[:m], np.roll(tags[:m], -1)])
        gmsh.model.mesh.addElementsByType(1, 1, [], edges.ravel())
        gmsh.model.mesh.addElementsByType(1, 2, [], (cells + 1).ravel())
        gmsh.model.addPhysicalGroup(1, [1], name="boundary")
        gmsh.model.addPhysicalGroup(2, [1], name="square")
        gmsh.write(str(path))


def random_cube(path: Path) -> None:
    """The Delaunay tetrahedra of 295 random points of the unit cube, 135 of them inside (section 3.6)."""
    rng = np.random.default_rng(3)
    points = [np.array(list(product((0.0, 1.0), repeat=3)))]
    for axis, a, b in product(range(3), (0, 1), (0, 1)):
        edge = np.empty((4, 3))
        edge[:, axis] = (np.arange(1, 5) + rng.uniform(-0.3, 0.3, 4)) / 5
        edge[:, [(axis + 1) % 3, (axis + 2) % 3]] = a, b
        points.append(edge)
    for n, (axis, a) in zip((17, 17, 17, 17, 18, 18), product(range(3), (0, 1)), strict=True):
        face = rng.uniform(0.08, 0.92, (n, 3))
        face[:, axis] = a
        points.append(face)
    points.append(rng.uniform(0.04, 0.96, (135, 3)))
    xyz = np.vstack(points)
    meshio.write(path, meshio.Mesh(xyz, [("tetra", delaunay(xyz))]), file_format="vtk42", binary=True)


def two_materials(path: Path) -> None:
    """A plate with hole and boss, a pin of another material through both, and a crack inside the plate.

    A Gmsh part of two volumes, distorted inside each.
    """
    with gmsh_model():
        occ = gmsh.model.occ
        plate = [(3, occ.addBox(0, 0, 0, 4, 2, 0.8))]
        boss = [(3, occ.addCylinder(3, 1, 0.8, 0, 0, 0.6, 0.65))]
        hole = [(3, occ.addCylinder(1, 1, 0, 0, 0, 0.8, 0.5))]
        pin = [(3, occ.addCylinder(3, 1, 0, 0, 0, 1.4, 0.35))]
        steel, _ = occ.cut(occ.fuse(plate, boss)[0], hole)
        steel, _ = occ.cut(steel, pin, removeTool=False)
        crack = [(2, occ.addRectangle(0, 0, 0, 0.4, 0.8))]
        occ.rotate(crack, 0, 0, 0, 0, 1, 0, -np.pi / 2)
        occ.translate(crack, 1.95, 0.6, 0.2)
        _, (steel, pin, crack) = occ.fragment(steel, [*pin, *crack])
        occ.synchronize()

        faces = [
            {tag for _, tag in gmsh.model.getBoundary(v, oriented=False, combined=False)}
            for v in (steel, pin)
        ]
        box = gmsh.model.getEntitiesInBoundingBox
        groups = {
            (3, "steel"): [tag for _, tag in steel],
            (3, "brass"): [tag for _, tag in pin],
            (2, "interface"): sorted(faces[0] & faces[1]),
            (2, "crack"): [tag for _, tag in crack],
            (2, "clamped"): [tag for _, tag in box(0.49, 0.49, -0.01, 1.51, 1.51, 0.81, 2)],
            (2, "loaded"): [tag for _, tag in box(2.6, 0.6, 1.39, 3.4, 1.4, 1.41, 2)],
        }
        for (dim, name), tags in groups.items():
            gmsh.model.addPhysicalGroup(dim, tags, name=name)
        for option, value in {"MeshSizeMax": 0.2, "Binary": 1}.items():
            gmsh.option.setNumber(f"Mesh.{option}", value)
        gmsh.model.mesh.generate(3)
        number, points, cells = gmsh_mesh(3)
        distort(points, cells, gmsh_inside(3, number, len(points)), np.random.default_rng(6), 0.12)
        set_gmsh_points(points)
        gmsh.write(str(path))


def plate_quads(path: Path) -> None:
    """Quadrilaterals in a plate with a hole, distorted inside."""
    with gmsh_model():
        occ = gmsh.model.occ
        occ.cut([(2, occ.addRectangle(0, 0, 0, 3, 2))], [(2, occ.addDisk(1.2, 1, 0, 0.45, 0.45))])
        occ.synchronize()
        rim = [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(0.7, 0.5, -1, 1.7, 1.5, 1, 1)]
        outer = [tag for _, tag in gmsh.model.getEntities(1) if tag not in rim]
        gmsh.model.addPhysicalGroup(1, rim, name="hole")
        gmsh.model.addPhysicalGroup(1, outer, name="outer")
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], name="plate")
        for option, value in {
            "MeshSizeMax": 0.16,
            "RecombineAll": 1,
            "RecombinationAlgorithm": 3,
            "MshFileVersion": 2.2,
        }.items():
            gmsh.option.setNumber(f"Mesh.{option}", value)
        gmsh.model.mesh.generate(2)
        number, points, cells = gmsh_mesh(2)
        distort(points, cells, gmsh_inside(2, number, len(points)), np.random.default_rng(1), 0.08)
        set_gmsh_points(points)
        gmsh.write(str(path))


def mixed_plane(path: Path) -> None:
    """Layers of quadrilaterals around a hole, triangles beyond, both distorted."""
    with gmsh_model():
        geo = gmsh.model.geo
        centre = geo.addPoint(0, 0, 0)
        corners = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
        near, far = ([geo.addPoint(r * x, r * y, 0) for x, y in corners] for r in (0.3, 0.7))
        square = [geo.addPoint(2 * x, 2 * y, 0, 0.4) for x, y in corners]
        after = [1, 2, 3, 0]
        inner = [geo.addCircleArc(near[i], centre, near[after[i]]) for i in range(4)]
        outer = [geo.addCircleArc(far[i], centre, far[after[i]]) for i in range(4)]
        sides = [geo.addLine(square[i], square[after[i]]) for i in range(4)]
        spokes = [geo.addLine(near[i], far[i]) for i in range(4)]
        for curve in inner + outer:
            geo.mesh.setTransfiniteCurve(curve, 7)
        for curve in spokes:
            geo.mesh.setTransfiniteCurve(curve, 5)
        for i in range(4):
            loop = geo.addCurveLoop([spokes[i], outer[i], -spokes[after[i]], -inner[i]])
            layer = geo.addPlaneSurface([loop])
            geo.mesh.setTransfiniteSurface(layer)
            geo.mesh.setRecombine(2, layer)
        geo.addPlaneSurface([geo.addCurveLoop(sides), geo.addCurveLoop(outer)])
        geo.synchronize()
        gmsh.model.mesh.generate(2)
        number, points, cells = gmsh_mesh(2)
        inside = gmsh_inside(2, number, len(points))
    used = np.unique(np.concatenate([block.ravel() for _, block in cells]))  # not the centre of the arcs
    cells = [(cell_type, np.searchsorted(used, block)) for cell_type, block in cells]
    points, inside = points[used], inside[used]
    distort(points, cells, inside, np.random.default_rng(2), 0.15)
    meshio.write(path, meshio.Mesh(space(points), cells), file_format="vtk42", binary=False)


def grid_cubes(*counts: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of a grid of unit cubes and the cubes (nx, ny, nz, 8) in the node order of hexahedra."""
    index = np.arange(np.prod(np.add(counts, 1))).reshape(np.add(counts, 1))
    points = np.stack(np.meshgrid(*[np.arange(n + 1.0) for n in counts], indexing="ij"), axis=-1)
    low, high = slice(None, -1), slice(1, None)
    base = [(low, low), (high, low), (high, high), (low, high)]
    return points.reshape(-1, 3), np.stack([index[(*xy, z)] for z in (low, high) for xy in base], axis=-1)


def hex_block(path: Path) -> None:
    """A twisted block of hexahedra, distorted inside."""
    points, cubes = grid_cubes(6, 5, 5)
    inside = ((points > 0) & (points < points.max(axis=0))).all(axis=1)
    cells = [("hexahedron", cubes.reshape(-1, 8))]
    distort(points, cells, inside, np.random.default_rng(4), 0.6)
    x, (y, z) = points[:, 0], points[:, 1:].T - 2.5
    cos, sin = np.cos(x / 10), np.sin(x / 10)
    points = np.column_stack([x, cos * y - sin * z, sin * y + cos * z])
    meshio.write(path, meshio.Mesh(points, cells), file_format="vtu")


def mixed_solid(path: Path) -> None:
    """A bent bar of wedges, hexahedra, pyramids and tetrahedra, from one end to the other, distorted inside.

    Cubes 0-1 along the bar are cut into wedges, 2-3 are hexahedra, 4 is a pyramid on the face towards them
    and tetrahedra on the others around a point in the middle, 5-6 are cut into six tetrahedra each.
    """
    points, cubes = grid_cubes(7, 4, 4)
    wedges = cubes[:2].reshape(-1, 8)[:, [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]]
    between = cubes[4].reshape(-1, 8)
    middles = len(points) + np.arange(len(between))
    points = np.vstack([points, points[between].mean(axis=1)])
    pyramids = np.column_stack([between[:, [0, 3, 7, 4]], middles])
    # all diagonals of faces run from the corner nearest the origin to the farthest
    triangles = [(1, 2, 6), (1, 6, 5), (0, 1, 5), (0, 5, 4), (3, 2, 6), (3, 6, 7)]
    triangles += [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]
    around = np.concatenate([between[:, triangles].reshape(-1, 3), np.repeat(middles, 10)[:, None]], axis=1)
    steps = [(1, 2), (1, 5), (3, 2), (3, 7), (4, 5), (4, 7)]
    six = cubes[5:].reshape(-1, 8)[:, [(0, a, b, 6) for a, b in steps]]
    tetrahedra = positive(points, np.vstack([around, six.reshape(-1, 4)]))
    cells = [
        ("wedge", wedges.reshape(-1, 6)),
        ("hexahedron", cubes[2:4].reshape(-1, 8)),
        ("pyramid", pyramids),
        ("tetra", tetrahedra),
    ]
    inside = ((points > 0) & (points < (7, 4, 4))).all(axis=1)
    distort(points, cells, inside, np.random.default_rng(5), 0.5)
    points[:, 2] += (points[:, 0] - 3.5) ** 2 / 20
    meshio.write(path, meshio.Mesh(points, cells), file_format="vtu")


def panel(path: Path) -> None:
    """Random triangles of a rectangle in the plane z = 0.25, in two groups, with texture coordinates."""
    rng = np.random.default_rng(7)
    along, up = np.linspace(0, 2, 13)[:-1], np.linspace(0, 1, 7)[:-1]
    boundary = [(t, 0) for t in along] + [(2, t) for t in up]
    boundary += [(2 - t, 1) for t in along] + [(0, 1 - t) for t in up]
    points = np.vstack([boundary, rng.uniform((0.05, 0.05), (1.95, 0.95), (100, 2))])
    cells = delaunay(points)
    left = points[cells].mean(axis=1)[:, 0] < 1
    lines = ["# random Delaunay triangles in the plane z = 0.25", "o panel"]
    lines += [f"v {float(x)!r} {float(y)!r} 0.25" for x, y in points]
    lines += [f"vt {float(x / 2)!r} {float(y)!r}" for x, y in points]
    for name, group in (("left", cells[left]), ("right", cells[~left])):
        lines.append(f"g {name}")
        lines += ["f " + " ".join(f"{i}/{i}" for i in triangle) for triangle in group + 1]
    path.write_text("\n".join(lines) + "\n")


def hexagon(path: Path) -> None:
    """Eight rings of equilateral triangles, turned about the centre one way and the other (as in Fig. 12)."""
    rings, degrees = 8, 13
    lattice = [
        (i, j)
        for i, j in product(range(-rings, rings + 1), repeat=2)
        if max(abs(i), abs(j), abs(i + j)) <= rings
    ]
    number = {vertex: n for n, vertex in enumerate(lattice)}
    triangles = [((i, j), (i + 1, j), (i, j + 1)) for i, j in lattice]
    triangles += [((i, j), (i, j + 1), (i - 1, j + 1)) for i, j in lattice]
    cells = np.array([[number[v] for v in t] for t in triangles if all(v in number for v in t)])
    i, j = np.array(lattice, dtype=float).T
    points = np.column_stack([i + j / 2, j * 3**0.5 / 2])
    ring = np.max(np.abs([i, j, i + j]), axis=0)
    angle = np.radians(degrees) * np.sin(2 * np.pi * ring / rings)
    cos, sin = np.cos(angle), np.sin(angle)
    points = np.column_stack(
        [cos * points[:, 0] - sin * points[:, 1], sin * points[:, 0] + cos * points[:, 1]]
    )
    mesh = meshio.Mesh(space(points), [("triangle", cells)])
    meshio.write(path, mesh, file_format="vtk42", binary=False)


def negative_ball(path: Path) -> None:
    """Delaunay tetrahedra of random points in a ball, all stored with negative orientation."""
    rng = np.random.default_rng(8)
    n = 120
    height = 1 - (2 * np.arange(n) + 1) / n  # a Fibonacci spiral on the sphere
    turn = np.pi * (1 + 5**0.5) * np.arange(n)
    radius = np.sqrt(1 - height**2)
    sphere = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
    within = rng.normal(size=(150, 3))
    within *= 0.9 * rng.random((150, 1)) ** (1 / 3) / np.linalg.norm(within, axis=1, keepdims=True)
    points = np.vstack([sphere, within])
    cells = delaunay(points)[:, [0, 2, 1, 3]]
    tags = {f"gmsh:{kind}": [np.ones(len(cells), dtype=int)] for kind in ("physical", "geometrical")}
    mesh = meshio.Mesh(points, [("tetra", cells)], cell_data=tags)
    meshio.write(path, mesh, file_format="gmsh22", binary=False)


FILES = {
    "random_square.msh": random_square,
    "random_cube.vtk": random_cube,
    "two_materials.msh": two_materials,
    "plate_quads.msh": plate_quads,
    "mixed_plane.vtk": mixed_plane,
    "hex_block.vtu": hex_block,
    "mixed_solid.vtu": mixed_solid,
    "panel.obj": panel,
    "hexagon.vtk": hexagon,
    "negative_ball.msh": negative_ball,
}


def main(names: list[str]) -> None:
    """Make the named files, or all."""
    unknown = set(names) - set(FILES)
    if unknown:
        sys.exit(f"unknown: {', '.join(sorted(unknown))}; known: {', '.join(FILES)}")
    for name in names or FILES:
        FILES[name](Path(__file__).parent / name)


if __name__ == "__main__":
    main(sys.argv[1:])
