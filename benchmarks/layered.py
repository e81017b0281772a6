"""Meshes with boundary layers and other stretching that is meant, made by Gmsh, with what is their wall.

None of them was used to choose the thresholds of the search for layers but those round cylinder and aerofoil.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import gmsh
import numpy as np

_TYPES = {
    2: ("triangle", 3),
    3: ("quad", 4),
    4: ("tetra", 4),
    5: ("hexahedron", 8),
    6: ("wedge", 6),
    9: ("triangle6", 6),
    16: ("quad8", 8),
}


@dataclass(frozen=True)
class Layered:
    """A mesh, and the vertices of the wall that carries its layers.

    points: (N, 2) or (N, 3); cells: {type: (n, k)}; wall: (N,) bool.
    """

    points: np.ndarray
    cells: dict[str, np.ndarray]
    wall: np.ndarray


def cylinder(quads: bool, height: float = 0.003, order: int = 1) -> Layered:
    """A square with a hole of radius 0.5 and layers round it, the first ``height`` high."""

    def outline() -> list[int]:
        occ = gmsh.model.occ
        occ.cut([(2, occ.addRectangle(-2, -2, 0, 4, 4))], [(2, occ.addDisk(0, 0, 0, 0.5, 0.5))])
        return _curves(lambda x, y: max(abs(x), abs(y)) < 1)

    return _with_layers(
        outline, height, quads, 0.25, lambda p: np.hypot(p[:, 0], p[:, 1]) < 0.5 + 1e-6, order
    )


def aerofoil(quads: bool, height: float = 0.001) -> Layered:
    """A square with a symmetrical aerofoil in it, and layers round that."""
    s = np.linspace(0, math.pi, 25)
    x = 0.5 * (1 - np.cos(s))
    y = 0.6 * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)

    def outline() -> list[int]:
        occ = gmsh.model.occ
        square = occ.addRectangle(-2, -2, 0, 4, 4)
        top = [occ.addPoint(a - 0.5, b, 0) for a, b in zip(x[:-1], y[:-1], strict=True)]
        tail = occ.addPoint(0.5, 0, 0)
        bottom = [occ.addPoint(a - 0.5, -b, 0) for a, b in zip(x[1:-1], y[1:-1], strict=True)]
        curves = [occ.addSpline([*top, tail]), occ.addSpline([tail, *reversed(bottom), top[0]])]
        occ.cut([(2, square)], [(2, occ.addPlaneSurface([occ.addCurveLoop(curves)]))])
        return _curves(lambda x, y: max(abs(x), abs(y)) < 1)

    return _with_layers(outline, height, quads, 0.25, None)


def backward_step(quads: bool, height: float = 0.002) -> Layered:
    """A channel behind a step, with layers on its lower wall, corners included."""

    def outline() -> list[int]:
        occ = gmsh.model.occ
        occ.cut([(2, occ.addRectangle(-2, -0.5, 0, 6, 1.5))], [(2, occ.addRectangle(-2, -0.5, 0, 2, 0.5))])
        return _curves(lambda x, y: y < 0.4 and -1.9 < x < 3.9)

    def wall(p: np.ndarray) -> np.ndarray:
        x, y = p.T
        return (y < -0.5 + 1e-9) | ((x < 1e-9) & (y < 1e-9))

    return _with_layers(outline, height, quads, 0.15, wall)


def pipe(height: float = 0.002, layers: int = 12) -> Layered:
    """Tetrahedra of a cylinder, and wedges in layers between it and the wall of a pipe."""
    with _session():
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 0.4)
        gmsh.model.occ.synchronize()
        _sizes(0.2, 0.2)
        gmsh.model.mesh.generate(3)
        core = _taken(3, lambda p: np.hypot(p[:, 0], p[:, 1]) > 0.4 - 1e-6)
    tets, side = core.cells["tetra"], core.wall
    faces = np.concatenate([tets[:, list(face)] for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    faces = faces[first[count == 1]]
    faces = faces[side[faces].all(axis=1)]
    ring, local = np.unique(faces, return_inverse=True)
    local = local.reshape(-1, 3)
    above = height * 1.3 ** np.arange(layers)[::-1]  # the smallest at the wall
    radius = 0.4 + np.cumsum(above)
    points, wedges, below, n = [core.points], [], faces, len(core.points)
    for r in radius:
        x, y, z = core.points[ring].T
        length = np.hypot(x, y)
        points.append(np.column_stack([x * r / length, y * r / length, z]))
        here = n + local
        wedges.append(np.hstack([below, here]))
        below, n = here, n + len(ring)
    wall = np.zeros(n, dtype=bool)
    wall[below] = True
    return Layered(np.concatenate(points), {"tetra": tets, "wedge": np.concatenate(wedges)}, wall)


def box(kind: str, bump: bool = False, height: float = 1 / 300, growth: float = 1.4) -> Layered:
    """A box with layers of "wedge", "hexahedron" or "tetra" cells on its floor, flat or with a bump.

    height: of the first, in edges of 0.1.
    """
    with _session():
        occ = gmsh.model.occ
        floor = occ.addRectangle(0, 0, 0, 1, 1)
        _sizes(0.1, 0.1)
        heights = np.cumsum(np.minimum(height * 0.1 * growth ** np.arange(24), 0.1))
        steps = (heights / heights[-1]).tolist()
        recombine = kind != "tetra"
        occ.extrude([(2, floor)], 0, 0, float(heights[-1]), [1] * len(steps), steps, recombine)
        occ.synchronize()
        if kind == "hexahedron":
            gmsh.option.setNumber("Mesh.RecombineAll", 1)
        gmsh.model.mesh.generate(3)
        mesh = _taken(3, lambda p: p[:, 2] < 1e-9)
    if bump:
        x, y, _ = mesh.points.T
        mesh.points[:, 2] += 0.1 * np.exp(-20 * ((x - 0.5) ** 2 + (y - 0.5) ** 2))
    return mesh


def plate(layers: int = 6, thickness: float = 0.02) -> Layered:
    """A thin plate of hexahedra, each 15 times as long as it is high."""
    with _session():
        occ = gmsh.model.occ
        floor = occ.addRectangle(0, 0, 0, 1, 1)
        _sizes(0.05, 0.05)
        occ.extrude([(2, floor)], 0, 0, thickness, [layers], [1.0], True)
        occ.synchronize()
        gmsh.option.setNumber("Mesh.RecombineAll", 1)
        gmsh.model.mesh.generate(3)
        return _taken(3, lambda p: p[:, 2] < 1e-9)


def graded_grid(kind: str, ratio: float = 1.2, n: int = 30) -> Layered:
    """A structured grid of the unit square whose rows grow by ``ratio`` from the lower side up."""
    with _session():
        geo = gmsh.model.geo
        corner = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
        side = [geo.addLine(corner[i], corner[(i + 1) % 4]) for i in range(4)]
        square = geo.addPlaneSurface([geo.addCurveLoop(side)])
        for i, grows in enumerate((1.0, ratio, 1.0, -ratio)):
            geo.mesh.setTransfiniteCurve(side[i], n, "Progression", grows)
        geo.mesh.setTransfiniteSurface(square)
        if kind == "quad":
            geo.mesh.setRecombine(2, square)
        geo.synchronize()
        gmsh.model.mesh.generate(2)
        return _taken(2, lambda p: p[:, 1] < 1e-9)


def graded(ratio: float = 100.0) -> Layered:
    """Triangles of all sizes from 1 to ``ratio``, none of them stretched: no wall, nothing to keep."""
    with _session():
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        field = gmsh.model.mesh.field.add("MathEval")
        gmsh.model.mesh.field.setString(field, "F", f"{0.1 / ratio} + 0.2*sqrt(x*x+y*y)")
        gmsh.model.mesh.field.setAsBackgroundMesh(field)
        _sizes(0.0, 0.1)
        gmsh.model.mesh.generate(2)
        return _taken(2, lambda p: np.zeros(len(p), dtype=bool))


def bent(mesh: Layered) -> Layered:
    """A planar mesh laid on a curved surface in space."""
    x, y = mesh.points.T
    return replace(mesh, points=np.column_stack([x, y, 0.3 * np.sin(x) * np.cos(y)]))


def _with_layers(
    outline: Callable[[], list[int]],
    height: float,
    quads: bool,
    size: float,
    wall: Callable[[np.ndarray], np.ndarray] | None,
    order: int = 1,
) -> Layered:
    """A planar mesh with Gmsh's boundary layers on the curves that ``outline`` makes and returns.

    wall: tells its vertices by their coordinates; by default those of the curves.
    """
    with _session():
        curves = outline()
        field = gmsh.model.mesh.field.add("BoundaryLayer")
        ends = [tag for _, tag in gmsh.model.getBoundary([(1, curve) for curve in curves], False, False)]
        gmsh.model.mesh.field.setNumbers(field, "CurvesList", curves)
        for name, value in {
            "Size": height,
            "Ratio": 1.3,
            "Thickness": 30 * height,
            "Quads": int(quads),
        }.items():
            gmsh.model.mesh.field.setNumber(field, name, value)
        once = sorted({tag for tag in ends if ends.count(tag) == 1})
        gmsh.model.mesh.field.setNumbers(field, "PointsList", once)
        if not once and len(set(ends)) > 1:
            gmsh.model.mesh.field.setNumbers(field, "FanPointsList", sorted(set(ends)))
        gmsh.model.mesh.field.setAsBoundaryLayer(field)
        _sizes(size / 5, size)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 40)
        gmsh.model.mesh.generate(2)
        if order > 1:
            gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
            gmsh.model.mesh.setOrder(order)
        if wall is None:
            on = np.concatenate([gmsh.model.mesh.getNodes(1, c, includeBoundary=True)[1] for c in curves])
            known = {tuple(row[:2]) for row in on.reshape(-1, 3).tolist()}
            return _taken(2, lambda p: np.array([tuple(row[:2]) in known for row in p.tolist()]))
        return _taken(2, wall)


def _curves(chosen: Callable[[float, float], bool]) -> list[int]:
    """The boundary curves of the model whose middle is ``chosen``."""
    gmsh.model.occ.synchronize()
    result = []
    for _, tag in gmsh.model.getBoundary(gmsh.model.getEntities(2), oriented=False):
        x0, y0, _, x1, y1, _ = gmsh.model.getBoundingBox(1, tag)
        if chosen((x0 + x1) / 2, (y0 + y1) / 2):
            result.append(tag)
    return result


def _sizes(least: float, most: float) -> None:
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMin", least)
    gmsh.option.setNumber("Mesh.MeshSizeMax", most)


def _taken(dimension: int, wall: Callable[[np.ndarray], np.ndarray]) -> Layered:
    """The cells of the current model and the points they use."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    kinds, _, nodes = gmsh.model.mesh.getElements(dimension)
    order = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    order[tags] = np.arange(len(tags))
    cells = {
        _TYPES[kind][0]: order[row].reshape(-1, _TYPES[kind][1])
        for kind, row in zip(kinds, nodes, strict=True)
    }
    used = np.unique(np.concatenate([rows.ravel() for rows in cells.values()]))
    number = np.full(len(tags), -1)
    number[used] = np.arange(len(used))
    points = coordinates.reshape(-1, 3)[used, :dimension].copy()
    return Layered(points, {kind: number[rows] for kind, rows in cells.items()}, wall(points))


@contextmanager
def _session() -> Iterator[None]:
    """A new Gmsh model whose meshes are the same on every run."""
    gmsh.initialize(["gmsh"], readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.option.setNumber("Mesh.RandomSeed", 1)
        yield
    finally:
        gmsh.finalize()
