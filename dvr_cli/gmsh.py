"""The current model of Gmsh's Python interface, improved in place: ``dvr_cli.gmsh.smooth_model()``."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dvr_cli.api.geometry import OnModel, gmsh_module
from dvr_cli.api.options import SmoothOptions, check_known
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.errors import InputError, UsageError
from dvr_cli.files.gmsh.source import GmshSource, read
from dvr_cli.files.source import differing
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
    gmsh = gmsh_module("gmsh: the Python module of Gmsh is needed")
    if not gmsh.isInitialized():
        raise UsageError("gmsh: there is no model; call gmsh.initialize() first")
    chosen = SmoothOptions.of(options)
    source = _mesh_of_model(gmsh)
    domain = chosen.domain(source.mesh)
    if domain.mids is not None:
        raise InputError(
            "the model's mesh is of second order; smooth it first, and raise the order afterwards"
        )
    place = OnModel(gmsh, source.mesh, domain, chosen.keeps_altitude)
    points, report = smooth_mesh(source.mesh, chosen, storage=place)
    _put(gmsh, source, points, place.parameters)
    return replace(report, put_back=place.put_back)


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


def _put(gmsh: Any, source: GmshSource, points: np.ndarray, parameters: dict[int, np.ndarray]) -> None:
    """Give the nodes that moved their new coordinates, and those on the geometry their parameters."""
    for number in np.flatnonzero(differing(points, source.mesh.points).any(axis=1)).tolist():
        gmsh.model.mesh.setNode(source.tags[number], points[number], parameters.get(number, ()))
