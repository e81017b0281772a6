"""The current model of Gmsh's Python interface, improved in place: ``dvr_cli.gmsh.smooth_model()``."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from dvr_cli.api.options import SmoothOptions, check_known
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.errors import InputError, UsageError
from dvr_cli.files.gmsh.source import GmshSource, read
from dvr_cli.files.source import differing
from dvr_cli.mesh.domain import Domain
from dvr_cli.quality.altitudes import smallest_altitudes
from dvr_cli.quality.mean_ratio import element_qualities
from dvr_cli.report.records import SmoothReport

# Gmsh's options for the file through which the mesh comes: all of it, whatever groups there are.
_OPTIONS = {"Mesh.MshFileVersion": 4.1, "Mesh.Binary": 1, "Mesh.SaveAll": 1, "Mesh.SaveParametric": 0}


def smooth_model(**options: Any) -> SmoothReport:
    """Improve the mesh of Gmsh's current model, as ``dvr_cli.smooth`` does; entities and groups are regions.

    options: as for ``dvr_cli.smooth``. Vertices that move on the boundary (``boundary="slide"`` or
    ``"project"``) end on the curve or surface of the model that they belong to, and their parametric
    coordinates are renewed, so the order can be raised afterwards. Where going there would make an element
    worse than the worst of the input, its vertices stay where they were.

    Returns the report. Raises UsageError without Gmsh or a model with a mesh, and for wrong options.
    """
    check_known(options)
    try:
        import gmsh
    except (ImportError, OSError) as error:  # OSError: a system library that it needs is missing
        raise UsageError(f"gmsh: the Python module of Gmsh is needed: {error}") from error
    if not gmsh.isInitialized():
        raise UsageError("gmsh: there is no model; call gmsh.initialize() first")
    chosen = SmoothOptions.of(options)
    source = _mesh_of_model(gmsh)
    domain = chosen.domain(source.mesh)
    if domain.mids is not None:
        raise InputError(
            "the model's mesh is of second order; smooth it first, and raise the order afterwards"
        )
    model = _Model(gmsh, source, domain, chosen.keeps_altitude)
    points, report = smooth_mesh(source.mesh, chosen, storage=model)
    model.put(points)
    return report


def _mesh_of_model(gmsh: Any) -> GmshSource:
    """The mesh of the current model, by way of a file."""
    if not len(gmsh.model.mesh.getNodes()[0]):
        raise InputError("the current model of Gmsh has no mesh; call gmsh.model.mesh.generate() first")
    with tempfile.TemporaryDirectory() as folder, _set(gmsh, _OPTIONS):
        path = Path(folder) / "model.msh"
        gmsh.write(str(path))
        return read(path.read_bytes())


@contextmanager
def _set(gmsh: Any, options: dict[str, float]) -> Iterator[None]:
    """Give options of Gmsh other values for a while."""
    before = {name: gmsh.option.getNumber(name) for name in options}
    try:
        for name, value in options.items():
            gmsh.option.setNumber(name, value)
        yield
    finally:
        for name, value in before.items():
            gmsh.option.setNumber(name, value)


class _Model:
    """The model that keeps the result: its curves and surfaces take the vertices that belong to them."""

    def __init__(self, gmsh: Any, source: GmshSource, domain: Domain, keeps_altitude: bool) -> None:
        self._gmsh, self._domain, self._keeps_altitude = gmsh, domain, keeps_altitude
        self._tags, self._before = source.tags, source.mesh.points
        self._number = dict(zip(source.tags.tolist(), range(len(source.tags)), strict=True))
        self._parameters: dict[int, np.ndarray] = {}  # of each node on a curve or surface that moved

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates (N, 3), vertices of curves and surfaces on these as far as that does no harm."""
        result = points.copy()
        moved = np.asarray(differing(points, self._before).any(axis=1))
        on_geometry = False
        for dimension, entity in self._gmsh.model.getEntities():
            kind = self._gmsh.model.getType(dimension, entity)
            if dimension in (1, 2) and not kind.startswith("Discrete"):
                nodes = self._nodes_that_moved(dimension, entity, moved)
                if len(nodes):
                    result[nodes] = self._closest(dimension, entity, nodes, points[nodes])
                    on_geometry = True
        return self._without_harm(result, on_geometry)

    def rounding(self, points: np.ndarray) -> float:
        """0.0: Gmsh keeps coordinates as they are, but for what ``stored`` minds."""
        return 0.0

    def widen(self) -> bool:
        """False: Gmsh keeps coordinates in float64."""
        return False

    def put(self, points: np.ndarray) -> None:
        """Give the nodes that moved their new coordinates, and those on the geometry their parameters."""
        for number in np.flatnonzero(differing(points, self._before).any(axis=1)).tolist():
            parameters = self._parameters.get(number, ())
            self._gmsh.model.mesh.setNode(self._tags[number], points[number], parameters)

    def _nodes_that_moved(self, dimension: int, entity: int, moved: np.ndarray) -> np.ndarray:
        """The numbers of the nodes that lie inside a curve or surface and moved."""
        tags = self._gmsh.model.mesh.getNodes(dimension, entity, returnParametricCoord=False)[0]
        nodes = np.array([self._number[tag] for tag in tags.tolist()], dtype=np.int64)
        return nodes[moved[nodes]]

    def _closest(self, dimension: int, entity: int, nodes: np.ndarray, points: np.ndarray) -> np.ndarray:
        """The points (n, 3) of a curve or surface that are nearest to ``points``; parameters are noted."""
        nearest, _ = self._gmsh.model.getClosestPoint(dimension, entity, points.ravel())
        # the parameters that come with the closest points of a line are 0
        parameters = self._gmsh.model.getParametrization(dimension, entity, nearest)
        self._parameters.update(zip(nodes.tolist(), parameters.reshape(len(nodes), dimension), strict=True))
        return nearest.reshape(-1, 3)

    def _without_harm(self, points: np.ndarray, on_geometry: bool) -> np.ndarray:
        """``points`` with the vertices of elements worse than the worst of the input back in place, and of
        those with an altitude below its smallest.
        """
        corners = self._domain.corners
        before = self._domain.flatten(self._before)
        worst, least = element_qualities(before, corners).min(), self._altitudes(before).min()
        while True:
            flat = self._domain.flatten(points)
            bad = element_qualities(flat, corners) < worst
            if self._keeps_altitude:
                bad |= self._altitudes(flat) < least
            nodes = np.unique(corners.vertices[np.repeat(bad, np.diff(corners.start))])
            back = nodes[differing(points[nodes], self._before[nodes]).any(axis=1)]
            if not on_geometry or not len(back):
                return points
            points[back] = self._before[back]
            for number in back.tolist():
                self._parameters.pop(number, None)

    def _altitudes(self, flat: np.ndarray) -> np.ndarray:
        """(n,) the smallest altitude of each element."""
        corners = self._domain.corners
        return corners.by_cell(np.minimum, smallest_altitudes(flat, corners.vertices))
