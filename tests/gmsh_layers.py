"""Meshes with boundary layers, made by Gmsh."""

from __future__ import annotations

import math
from collections.abc import Callable

import gmsh
import numpy as np

from dvr_cli.mesh.mesh import Cells, Mesh
from gmsh_session import gmsh_session

_TYPES = {2: ("triangle", 3), 3: ("quad", 4), 4: ("tetra", 4), 5: ("hexahedron", 8), 6: ("wedge", 6)}


def around_cylinder(height: float = 0.003, quads: bool = True) -> Mesh:
    """A square with a hole of radius 0.5 and layers round it, the first ``height`` high."""
    return _planar(lambda: [gmsh.model.occ.addDisk(0, 0, 0, 0.5, 0.5)], height, quads)


def around_aerofoil(height: float = 0.001, quads: bool = True) -> Mesh:
    """A square with a symmetrical aerofoil in it and layers round that."""
    s = np.linspace(0, math.pi, 25)
    x = 0.5 * (1 - np.cos(s))
    y = 0.6 * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)

    def body() -> list[int]:
        occ = gmsh.model.occ
        top = [occ.addPoint(a - 0.5, b, 0) for a, b in zip(x[:-1], y[:-1], strict=True)]
        tail = occ.addPoint(0.5, 0, 0)
        bottom = [occ.addPoint(a - 0.5, -b, 0) for a, b in zip(x[1:-1], y[1:-1], strict=True)]
        curves = [occ.addSpline([*top, tail]), occ.addSpline([tail, *reversed(bottom), top[0]])]
        return [occ.addPlaneSurface([occ.addCurveLoop(curves)])]

    return _planar(body, height, quads)


def behind_step(height: float = 0.002) -> Mesh:
    """Triangles of a channel behind a step, with layers on its lower wall that meet in the step's corners."""
    with gmsh_session():
        occ = gmsh.model.occ
        channel = occ.addRectangle(-2, -0.5, 0, 6, 1.5)
        occ.cut([(2, channel)], [(2, occ.addRectangle(-2, -0.5, 0, 2, 0.5))])
        occ.synchronize()
        wall = []
        for _, tag in gmsh.model.getBoundary(gmsh.model.getEntities(2), oriented=False):
            x0, y0, _, x1, y1, _ = gmsh.model.getBoundingBox(1, tag)
            if (y0 + y1) / 2 < 0.4 and -1.9 < (x0 + x1) / 2 < 3.9:
                wall.append(tag)
        ends = [tag for _, tag in gmsh.model.getBoundary([(1, tag) for tag in wall], False, False)]
        points = {"PointsList": [tag for tag in ends if ends.count(tag) == 1]}
        return _with_layer(wall, height, points, (0.03, 0.15))


def extruded(kind: str, height: float = 1 / 300, bump: bool = False) -> Mesh:
    """A box whose floor, flat or with a bump, carries layers of "wedge", "hexahedron" or "tetra" cells."""
    with gmsh_session():
        occ = gmsh.model.occ
        floor = occ.addRectangle(0, 0, 0, 1, 1)
        occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.1)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.1)
        heights = np.cumsum(np.minimum(height * 0.1 * 1.4 ** np.arange(24), 0.1))
        n = len(heights)
        occ.extrude(
            [(2, floor)],
            *(0, 0, float(heights[-1])),
            numElements=[1] * n,
            heights=(heights / heights[-1]).tolist(),
            recombine=kind != "tetra",
        )
        occ.synchronize()
        if kind == "hexahedron":
            gmsh.option.setNumber("Mesh.RecombineAll", 1)
        gmsh.model.mesh.generate(3)
        mesh = _mesh(3)
    if bump:
        x, y, z = mesh.points.T
        mesh.points[:, 2] = z + 0.1 * np.exp(-20 * ((x - 0.5) ** 2 + (y - 0.5) ** 2))
    return mesh


def graded(ratio: float = 100.0) -> Mesh:
    """Triangles of all sizes from 1 to ``ratio``, none of them stretched on purpose."""
    with gmsh_session():
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        field = gmsh.model.mesh.field.add("MathEval")
        gmsh.model.mesh.field.setString(field, "F", f"{0.1 / ratio} + 0.2*sqrt(x*x+y*y)")
        gmsh.model.mesh.field.setAsBackgroundMesh(field)
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.1)
        gmsh.model.mesh.generate(2)
        return _mesh(2)


def _planar(body: Callable[[], list[int]], height: float, quads: bool) -> Mesh:
    with gmsh_session():
        occ = gmsh.model.occ
        square = occ.addRectangle(-2, -2, 0, 4, 4)
        tags = body()
        occ.cut([(2, square)], [(2, tag) for tag in tags])
        occ.synchronize()
        boundary = gmsh.model.getBoundary(gmsh.model.getEntities(2), oriented=False)
        wall = [
            tag for _, tag in boundary if max(abs(v) for v in gmsh.model.occ.getBoundingBox(1, tag)[:5]) < 1.5
        ]
        ends = {tag for _, tag in gmsh.model.getBoundary([(1, t) for t in wall], False, False)}
        points = {"FanPointsList": sorted(ends) if len(ends) > 1 else []}
        return _with_layer(wall, height, points, (0.05, 0.25), quads)


def _with_layer(
    wall: list[int],
    height: float,
    points: dict[str, list[int]],
    sizes: tuple[float, float],
    quads: bool = False,
) -> Mesh:
    """The planar mesh with layers on the curves ``wall``; points: lists of the layers' field."""
    field, of_field = gmsh.model.mesh.field.add("BoundaryLayer"), gmsh.model.mesh.field
    of_field.setNumbers(field, "CurvesList", wall)
    numbers = {"Size": height, "Ratio": 1.3, "Thickness": 30 * height, "Quads": int(quads)}
    for name, value in numbers.items():
        of_field.setNumber(field, name, value)
    for name, tags in points.items():
        of_field.setNumbers(field, name, tags)
    of_field.setAsBoundaryLayer(field)
    for name, size in zip(("Min", "Max"), sizes, strict=True):
        gmsh.option.setNumber(f"Mesh.MeshSize{name}", size)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 40)
    gmsh.model.mesh.generate(2)
    return _mesh(2)


def _mesh(dimension: int) -> Mesh:
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    kinds, _, nodes = gmsh.model.mesh.getElements(dimension)
    order = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    order[tags] = np.arange(len(tags))
    cells = [
        Cells(_TYPES[kind][0], order[row].reshape(-1, _TYPES[kind][1]))
        for kind, row in zip(kinds, nodes, strict=True)
    ]
    used = np.unique(np.concatenate([block.vertices.ravel() for block in cells]))
    number = np.full(len(tags), -1)
    number[used] = np.arange(len(used))
    points = coordinates.reshape(-1, 3)[used, : max(2, dimension)]
    return Mesh(points.copy(), [Cells(b.type, number[b.vertices]) for b in cells])
