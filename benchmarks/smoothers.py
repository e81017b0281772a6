"""The other tools: each takes a Case and its number of passes and smooths with the boundary fixed.

A smoother returns its points, its cells and the seconds it worked, without what it takes to hand the mesh
over and back. Those whose tool is not installed raise ImportError.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from common import seconds
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.facets import facets_of


@dataclass(frozen=True)
class Case:
    """A mesh to smooth: its name in the table and its domain, all simplices positive."""

    name: str
    domain: Domain

    @property
    def dimension(self) -> int:
        """d: 2 or 3."""
        return self.domain.dimension

    @property
    def points(self) -> np.ndarray:
        """(N, 3) coordinates, z = 0 in the plane."""
        return np.pad(self.domain.points, ((0, 0), (0, 3 - self.dimension)))

    @property
    def cells(self) -> np.ndarray:
        """(n, d+1) vertices of the simplices."""
        return self.domain.cells[0].vertices

    @cached_property
    def free(self) -> np.ndarray:
        """The vertices that may move."""
        return np.flatnonzero(self.domain.interior)

    @cached_property
    def fixed(self) -> np.ndarray:
        """The vertices that must not move."""
        return np.flatnonzero(~self.domain.interior)

    @cached_property
    def boundary(self) -> np.ndarray:
        """(b, d) facets that belong to one simplex only."""
        facets = facets_of(self.domain.cells)
        return facets.vertices[facets.start[:-1][facets.shared_by == 1], : self.dimension]


Outcome = tuple[np.ndarray, np.ndarray, float]
Smoother = Callable[[Case, int], Outcome]


def laplacian(case: Case, passes: int) -> Outcome:
    """Each free vertex to the mean of its neighbours, all at once: the baseline."""
    from scipy.sparse import csr_array

    first, second = np.triu_indices(case.dimension + 1, 1)
    ends = np.concatenate([case.cells[:, first].ravel(), case.cells[:, second].ravel()])
    others = np.concatenate([case.cells[:, second].ravel(), case.cells[:, first].ravel()])
    points, n = case.points, len(case.points)

    def work() -> None:
        linked = csr_array((np.ones(len(ends), dtype=bool), (ends, others)), shape=(n, n)).astype(float)
        rows = linked[case.free]
        count = rows.sum(axis=1)[:, None]
        for _ in range(passes):
            points[case.free] = rows @ points / count

    return points, case.cells, seconds(work)


def gmsh_relocate(case: Case, passes: int) -> Outcome:
    """Gmsh's Relocate3D or Relocate2D; the square's boundary nodes lie on its sides, which Gmsh keeps."""
    import gmsh

    d, points = case.dimension, case.points
    gmsh.initialize(["gmsh"], readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        if d == 3:
            gmsh.model.addDiscreteEntity(2, 1)
            gmsh.model.addDiscreteEntity(3, 1, [1])
            gmsh.model.mesh.addNodes(2, 1, case.fixed + 1, points[case.fixed].ravel())
            gmsh.model.mesh.addElementsByType(1, 2, [], (case.boundary + 1).ravel())
        else:
            _put_on_square(case)
        inside = points[case.free].ravel()
        parameters = gmsh.model.getParametrization(2, 1, inside) if d == 2 else []
        gmsh.model.mesh.addNodes(d, 1, case.free + 1, inside, parameters)
        simplex = {2: 2, 3: 4}[d]
        gmsh.model.mesh.addElementsByType(1, simplex, [], (case.cells + 1).ravel())
        given = gmsh.model.mesh.getNodes()[0].astype(np.int64) - 1
        taken = seconds(lambda: gmsh.model.mesh.optimize(f"Relocate{d}D", True, passes))
        tags, coordinates, _ = gmsh.model.mesh.getNodes()  # in the same order, but with new tags
        points[given] = coordinates.reshape(-1, 3)
        number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
        number[tags] = given
        cells = number[gmsh.model.mesh.getElementsByType(simplex)[1]].reshape(-1, d + 1)
    finally:
        gmsh.finalize()
    return points, cells, taken


def _put_on_square(case: Case) -> None:
    """Make the unit square in Gmsh (it relocates on surfaces with parameters only), boundary nodes on it."""
    import gmsh

    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    left = case.fixed
    for dimension in (0, 1):  # corners first, which are on two sides
        for _, tag in gmsh.model.getEntities(dimension):
            low, high = np.array(gmsh.model.getBoundingBox(dimension, tag)).reshape(2, 3)
            here = ((case.points[left] >= low - 1e-6) & (case.points[left] <= high + 1e-6)).all(axis=1)
            nodes, left = left[here], left[~here]
            x = case.points[nodes].ravel()
            parameters = gmsh.model.getParametrization(1, tag, x) if dimension else []
            gmsh.model.mesh.addNodes(dimension, tag, nodes + 1, x, parameters)


def netgen(case: Case, passes: int) -> Outcome:
    """Netgen's volume optimisation with steps "m" (move nodes) only."""
    from netgen.meshing import FaceDescriptor, Mesh, MeshingParameters
    from pyngcore import SetNumThreads

    SetNumThreads(1)
    mesh = Mesh(dim=3)
    mesh.AddPoints(case.points)
    face = mesh.Add(FaceDescriptor(surfnr=1, domin=1, bc=1))
    mirrored = np.ascontiguousarray(case.cells[:, [0, 2, 1, 3]], dtype=np.int32)  # as Netgen orients them
    mesh.AddElements(dim=3, index=1, data=mirrored, base=0)
    mesh.AddElements(dim=2, index=face, data=np.ascontiguousarray(case.boundary, dtype=np.int32), base=0)
    parameters = MeshingParameters(optimize3d="m" * passes, optsteps3d=1)
    taken = seconds(lambda: mesh.OptimizeVolumeMesh(parameters))
    cells = np.array(mesh.Elements3D().NumPy()["nodes"])[:, [0, 2, 1, 3]].astype(np.int64) - 1
    return np.array(mesh.Coordinates()), cells, taken


def vtk_laplacian(case: Case, passes: int) -> Outcome:
    """vtkSmoothPolyDataFilter, PyVista's ``smooth``."""
    from vtkmodules.vtkFiltersCore import vtkSmoothPolyDataFilter

    smoother = vtkSmoothPolyDataFilter()
    smoother.SetOutputPointsPrecision(1)  # double
    return _with_vtk(case, smoother, passes)


def vtk_windowed_sinc(case: Case, passes: int) -> Outcome:
    """vtkWindowedSincPolyDataFilter, PyVista's ``smooth_taubin``."""
    from vtkmodules.vtkFiltersCore import vtkWindowedSincPolyDataFilter

    smoother = vtkWindowedSincPolyDataFilter()
    smoother.NormalizeCoordinatesOn()
    smoother.NonManifoldSmoothingOff()
    return _with_vtk(case, smoother, passes)


def _with_vtk(case: Case, smoother: Any, passes: int) -> Outcome:
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    points, cells, surface = vtkPoints(), vtkCellArray(), vtkPolyData()
    points.SetData(numpy_to_vtk(case.points, deep=True))
    start = np.arange(0, case.cells.size + 1, 3, dtype=np.int64)
    flat = case.cells.astype(np.int64).ravel()
    cells.SetData(numpy_to_vtkIdTypeArray(start, deep=True), numpy_to_vtkIdTypeArray(flat, deep=True))
    surface.SetPoints(points)
    surface.SetPolys(cells)
    smoother.SetInputData(surface)
    smoother.SetNumberOfIterations(passes)
    smoother.BoundarySmoothingOff()
    smoother.FeatureEdgeSmoothingOff()
    taken = seconds(smoother.Update)
    result = smoother.GetOutput()
    connectivity = vtk_to_numpy(result.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return vtk_to_numpy(result.GetPoints().GetData()).astype(np.float64), connectivity, taken
