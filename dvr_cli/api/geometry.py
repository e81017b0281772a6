"""Vertices end on the curves and surfaces of the CAD model that they belong to, by the kernel of Gmsh."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dvr_cli.api.boundary import bound_of
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import Storage, smooth_mesh
from dvr_cli.errors import InputError, UsageError
from dvr_cli.files.source import differing
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.mesh import Entity, Mesh
from dvr_cli.quality.altitudes import smallest_altitudes
from dvr_cli.quality.mean_ratio import element_qualities
from dvr_cli.report.records import SmoothReport

if TYPE_CHECKING:
    from dvr_cli.files.writing import Output

_MODELS = (".brep", ".geo", ".step", ".stp")
_NAMES = {1: "curve", 2: "surface"}


class OnModel:
    """A place for the result, whose vertices on curves and surfaces of a model end on these.

    parameters: of each of these vertices that moved, by its number, those of its place on the curve or
    surface, as of the last ``stored``: one or two. put_back: how many vertices that had moved it put back.
    """

    def __init__(
        self,
        gmsh: Any,
        mesh: Mesh,
        domain: Domain,
        keeps_altitude: bool,
        storage: Storage | None = None,
    ) -> None:
        """gmsh: the module, the model its current one. mesh: as it was, with its ``entities``.

        keeps_altitude: whether none may become lower than the smallest. storage: where the result goes then.
        """
        self._gmsh, self._domain, self._keeps_altitude, self._storage = gmsh, domain, keeps_altitude, storage
        self._before = mesh.points
        self._nodes = {entity: nodes for entity, nodes in mesh.entities.items() if has_geometry(gmsh, entity)}
        self.parameters: dict[int, np.ndarray] = {}
        self.put_back = 0

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates (N, 3), vertices of curves and surfaces on these as far as that does no harm."""
        result = points.copy()
        moved = np.asarray(differing(points, self._before).any(axis=1))
        self.parameters, self.put_back = {}, 0
        for entity, inside in self._nodes.items():
            nodes = inside[moved[inside]]
            if len(nodes):
                result[nodes], parameters = closest(self._gmsh, entity, points[nodes])
                self.parameters.update(zip(nodes.tolist(), parameters, strict=True))
        if self.parameters:
            self._put_back(result)
        return result if self._storage is None else self._storage.stored(result)

    def rounding(self, points: np.ndarray) -> float:
        """The largest change of a coordinate by where the result goes; ``stored`` minds the model's."""
        return 0.0 if self._storage is None else self._storage.rounding(points)

    def widen(self) -> bool:
        """Keep coordinates in float64 from now on; False if they are already or cannot be."""
        return self._storage is not None and self._storage.widen()

    def _put_back(self, points: np.ndarray) -> None:
        """Put vertices of elements worse than the worst of the input back in place, and of those with an
        altitude below its smallest.
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
            if not len(back):
                return
            points[back] = self._before[back]
            self.put_back += len(back)
            for number in back.tolist():
                self.parameters.pop(number, None)

    def _altitudes(self, flat: np.ndarray) -> np.ndarray:
        """(n,) the smallest altitude of each element."""
        corners = self._domain.corners
        return corners.by_cell(np.minimum, smallest_altitudes(flat, corners.vertices))


def smooth_on_geometry(
    geometry: Path, mesh: Mesh, options: SmoothOptions, storage: Output, **how: Any
) -> tuple[np.ndarray, SmoothReport]:
    """``smooth_mesh``, with vertices of curves and surfaces ending on those of the CAD model in a file.

    mesh: its ``entities`` say on which of them vertices lie. storage: the output; it gets the parameters of
    vertices that moved. how: other arguments of ``smooth_mesh``.

    Raises UsageError without Gmsh, for a file that is none of a model, and where no vertex of a curve or
    surface could move; InputError where model and mesh do not belong together.
    """
    if geometry.suffix.lower() not in _MODELS:
        known = ", ".join(_MODELS)
        raise UsageError(f"--geometry {geometry}: unknown suffix {geometry.suffix!r}; known: {known}")
    if not mesh.entities:
        raise UsageError(
            "--geometry: only Gmsh files of version 4 say on which curve or surface of a model a vertex lies"
        )
    domain = options.domain(mesh)
    if domain.mids is not None:
        raise UsageError("--geometry: the mesh is of second order; smooth it first, and raise the order then")
    if options.boundary == "fixed" and not domain.is_surface:
        raise UsageError("--geometry: no vertex of the boundary moves without --boundary slide or project")
    with _opened(geometry) as gmsh:
        _check_fit(gmsh, geometry, mesh, bound_of(domain, options.max_deviation))
        place = OnModel(gmsh, mesh, domain, options.keeps_altitude, storage)
        points, report = smooth_mesh(mesh, options, storage=place, **how)
    storage.keep_parameters(place.parameters)
    return points, replace(report, put_back=place.put_back)


def gmsh_module(needed: str) -> Any:
    """The Python module of Gmsh; UsageError that begins with ``needed`` if it cannot be had."""
    try:
        import gmsh
    except (ImportError, OSError) as error:  # OSError: a system library that it needs is missing
        raise UsageError(f"{needed}: {error}") from error
    return gmsh


def closest(gmsh: Any, entity: Entity, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points (n, 3) of a curve or surface nearest to ``points`` (n, 3), and their parameters (n, 1|2)."""
    nearest, _ = gmsh.model.getClosestPoint(*entity, points.ravel())
    # the parameters that come with the closest points of a line are 0
    parameters = gmsh.model.getParametrization(*entity, nearest)
    return nearest.reshape(-1, 3), parameters.reshape(len(points), entity[0])


def has_geometry(gmsh: Any, entity: Entity) -> bool:
    """True for curves and surfaces that are more than their mesh."""
    return entity[0] in _NAMES and not gmsh.model.getType(*entity).startswith("Discrete")


@contextmanager
def _opened(geometry: Path) -> Iterator[Any]:
    """Gmsh with the model in a file as its current one."""
    gmsh = gmsh_module("--geometry needs the Python module of Gmsh (pip install 'dvr-cli[cad]')")
    if not geometry.is_file():
        raise UsageError(f"--geometry {geometry}: no such file")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        try:
            with _onto_stderr():
                gmsh.open(str(geometry))
        except Exception as error:  # all that Gmsh raises
            raise InputError(f"{geometry}: Gmsh cannot read it: {error}") from error
        if not gmsh.model.getEntities():
            raise InputError(f"{geometry}: Gmsh finds no model in it")
        yield gmsh
    finally:
        gmsh.finalize()


@contextmanager
def _onto_stderr() -> Iterator[None]:
    """Send all that the geometry kernel prints to stderr, as stdout may be the mesh."""
    if sys.stdout is None:
        yield
        return
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        os.dup2(2, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def _check_fit(gmsh: Any, geometry: Path, mesh: Mesh, bound: float) -> None:
    """Check that vertices lie on the curves and surfaces they should be on, as near as a boundary has to."""
    for entity in sorted(mesh.entities.keys() - set(gmsh.model.getEntities())):
        raise InputError(f"{geometry}: it has no {_name(entity)}, on which vertices of the mesh lie")
    for entity, nodes in mesh.entities.items():
        if not has_geometry(gmsh, entity):
            raise InputError(f"{geometry}: its {_name(entity)} is a mesh, no geometry")
        nearest, _ = closest(gmsh, entity, mesh.points[nodes])
        away = np.linalg.norm(nearest - mesh.points[nodes], axis=1)
        far = int(np.argmax(away))
        if not away[far] <= bound:
            raise InputError(
                f"{geometry}: is it the model that the mesh was made of? Vertex {nodes[far]} is "
                f"{away[far]:.3g} away from {_name(entity)}, on which it should lie (--max-deviation is "
                f"{bound:.3g})"
            )


def _name(entity: Entity) -> str:
    dimension, tag = entity
    return f"{_NAMES[dimension]} {tag}"
