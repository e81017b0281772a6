"""Mesh generators, each with and without its own optimiser, on one body: what ``solvers`` compares.

The volume generators fill the same surface: the drilled plate with a bored boss of ``meshes``, its triangles
made by Gmsh.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import meshes
from dvr_cli.mesh.mesh import Cells, Mesh

_HXT = 10  # Gmsh's number of that algorithm


@dataclass(frozen=True)
class Generated:
    """A generator, the length of edges it was asked for, its mesh as generated, and as it optimises it.

    optimised is None where the generator has no optimiser. Either raises ImportError where it is missing.
    """

    name: str
    size: float
    raw: Callable[[], Mesh]
    optimised: Callable[[], Mesh] | None


def generators(quick: bool) -> Iterator[Generated]:
    """All generators; quick: with coarse meshes."""
    h = 5.0 if quick else 2.4
    yield Generated(
        "Gmsh Delaunay", h, lambda: meshes.part_by_gmsh(h, 1, 0), lambda: meshes.part_by_gmsh(h, 1, 1)
    )
    yield Generated(
        "Gmsh HXT", h, lambda: meshes.part_by_gmsh(h, _HXT, 0), lambda: meshes.part_by_gmsh(h, _HXT, 1)
    )
    yield Generated("TetGen", h, lambda: _tetgen(h, False), lambda: _tetgen(h, True))
    yield Generated("Netgen", h, lambda: _netgen(h, 0), lambda: _netgen(h, 3))
    n = 500 if quick else 3_000
    yield Generated("Delaunay, random points", n ** (-1 / 3), lambda: meshes.random_tets(n), None)
    k = 0.1 if quick else 0.025
    yield Generated("Gmsh triangles", k, lambda: meshes.gmsh_plate(k, 0), lambda: meshes.gmsh_plate(k, 10))


def _tetgen(h: float, optimised: bool) -> Mesh:
    """TetGen's quality mesh, the surface kept; optimised: no dihedral angle shall exceed 130° (177° else)."""
    import tetgen

    surface = meshes.part_surface(h)
    maker = tetgen.TetGen(surface.points, surface.cells[0].vertices)
    volume = h**3 / (3 * np.sqrt(2))  # twice that of the regular tetrahedron with these edges
    maker.tetrahedralize(
        minratio=1.4,
        fixedvolume=True,
        maxvolume=volume,
        nobisect=True,
        optmaxdihedral=130.0 if optimised else 177.0,
    )
    return _positive(np.asarray(maker.node), np.asarray(maker.elem))


def _netgen(h: float, steps: int) -> Mesh:
    """Netgen's mesh, so many times optimised: 3 times is its default."""
    from netgen.meshing import FaceDescriptor, MeshingParameters
    from netgen.meshing import Mesh as NetgenMesh
    from pyngcore import SetNumThreads

    SetNumThreads(1)
    surface = meshes.part_surface(h)
    mesh = NetgenMesh(dim=3)
    mesh.AddPoints(surface.points)
    face = mesh.Add(FaceDescriptor(surfnr=1, domin=1, bc=1))
    triangles = np.ascontiguousarray(surface.cells[0].vertices, dtype=np.int32)
    mesh.AddElements(dim=2, index=face, data=triangles, base=0)
    mesh.GenerateVolumeMesh(MeshingParameters(maxh=h, optsteps3d=steps))
    return _positive(np.array(mesh.Coordinates()), np.array(mesh.Elements3D().NumPy()["nodes"])[:, :4] - 1)


def _positive(points: np.ndarray, cells: np.ndarray) -> Mesh:
    """Tetrahedra and the points they use, those whose determinant is negative turned over."""
    used, number = np.unique(cells, return_inverse=True)
    points, cells = points[used], number.reshape(cells.shape).astype(np.int32)
    negative = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    cells[negative, :2] = cells[negative, 1::-1]
    return Mesh(points, [Cells("tetra", cells)])
