"""Small meshes for the tests of the command line, and ways to look at what it leaves behind."""

from __future__ import annotations

import json
import sysconfig
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshio
import numpy as np

DVR = Path(sysconfig.get_path("scripts")) / "dvr"
_MESHIO_NAMES = {".msh": "gmsh", ".vtk": "vtk"}  # meshio takes .msh for another format

# A square of four triangles around one vertex. With that in the middle each has two sides of 1/√2 and one of
# 1, so its mean ratio 4√3·area / (sum of squared sides) is 4√3·(1/4)/2 = √3/2.
CORNERS = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
FAN = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
BEST = 3**0.5 / 2


@dataclass(frozen=True)
class Outcome:
    """What a run of ``dvr`` printed, and its exit code."""

    code: int
    out: str
    err: str


def write(path: Path, points: Any, cells: Mapping[str, Any], **data: Any) -> Path:
    """Write a mesh as text; points with two coordinates get z = 0."""
    points = np.asarray(points, dtype=np.float64)
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    mesh = meshio.Mesh(points, [(name, np.asarray(array)) for name, array in cells.items()], **data)
    name = {".msh": "gmsh22", ".vtk": "vtk42"}[path.suffix]
    meshio.write(path, mesh, file_format=name, binary=False)
    return path


def fan(path: Path, x: float = 0.8, y: float = 0.9, **data: Any) -> Path:
    """Write the square of four triangles with its inner vertex at (x, y)."""
    return write(path, [*CORNERS, [x, y]], {"triangle": FAN}, **data)


def points_of(path: Path) -> np.ndarray:
    """The coordinates in a mesh file."""
    return meshio.read(path, file_format=_MESHIO_NAMES[path.suffix]).points


def read_json(text: str) -> Any:
    """JSON of the strict kind: no NaN, no Infinity."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    return json.loads(text, parse_constant=refuse)


def listing(folder: Path) -> dict[Path, bytes | None]:
    """All files and folders in a folder, with their contents."""
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def assert_one_line(outcome: Outcome, code: int, *words: str) -> None:
    """The run failed with this code, one line on stderr that holds ``words``, and nothing on stdout."""
    assert outcome.code == code, outcome.err
    assert outcome.out == ""
    assert outcome.err.count("\n") == 1, outcome.err
    assert outcome.err.startswith("dvr: error: ")
    assert outcome.err.endswith("\n")
    for word in words:
        assert word in outcome.err
