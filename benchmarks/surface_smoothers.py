"""Other tools that smooth surfaces in space: each takes a surface and its number of passes.

A smoother returns its points and the CPU seconds it worked, without handing the surface over and back. Those
whose tool is not installed raise ImportError.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

SurfaceSmoother = Callable[[np.ndarray, np.ndarray, int], tuple[np.ndarray, float]]


def pymeshlab_reprojecting(
    points: np.ndarray, triangles: np.ndarray, passes: int
) -> tuple[np.ndarray, float]:
    """MeshLab's remeshing with nothing but its smoothing and its reprojection."""
    import pymeshlab

    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(points, triangles))
    others = dict.fromkeys(("splitflag", "collapseflag", "swapflag", "checksurfdist"), False)
    begin = time.process_time()
    meshes.meshing_isotropic_explicit_remeshing(iterations=passes, **others)
    taken = time.process_time() - begin
    return _same(meshes.current_mesh().vertex_matrix(), meshes.current_mesh().face_matrix(), triangles), taken


def trimesh_taubin(points: np.ndarray, triangles: np.ndarray, passes: int) -> tuple[np.ndarray, float]:
    """``trimesh.smoothing.filter_taubin``."""
    import trimesh

    surface = trimesh.Trimesh(points, triangles, process=False)
    begin = time.process_time()
    trimesh.smoothing.filter_taubin(surface, iterations=passes)
    return np.array(surface.vertices), time.process_time() - begin


def pyvista_taubin(points: np.ndarray, triangles: np.ndarray, passes: int) -> tuple[np.ndarray, float]:
    """PyVista's ``smooth_taubin``."""
    import pyvista

    surface = pyvista.PolyData.from_regular_faces(points, triangles)
    begin = time.process_time()
    result = surface.smooth_taubin(n_iter=passes, normalize_coordinates=True)
    taken = time.process_time() - begin
    return _same(np.array(result.points, dtype=np.float64), result.regular_faces, triangles), taken


def _same(points: np.ndarray, found: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The points of a result, whose triangles have to be those that went in."""
    if not np.array_equal(found, triangles):
        raise ValueError("the tool changed the connectivity")
    return points


SMOOTHERS: dict[str, SurfaceSmoother] = {
    "PyMeshLab, smoothing and reprojection": pymeshlab_reprojecting,
    "trimesh, Taubin": trimesh_taubin,
    "PyVista, Taubin": pyvista_taubin,
}
