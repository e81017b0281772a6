"""SU2 files of meshes from other formats: planar or volume cells, and markers from groups of lower ones.

A marker is a group of lines under a planar mesh, of triangles and quads under a volume mesh: physical groups,
sets and side sets by name, what is in none of them by its tag.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import OutputError
from dvr_cli.files.losses import links_not_kept, names_not_kept, not_kept, number_not_kept
from dvr_cli.files.source import Source
from dvr_cli.files.su2.source import TYPES, read
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.groups import group_cells, topological_dimension
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.regions import region_names

_NUMBERS = {name: number for number, name in TYPES.items() if CELL_TYPES[name].linear is None}


class ConvertedSource(Source):
    """A mesh of another format, to be written as SU2."""

    format = "su2"

    def __init__(self, mesh: Mesh, unread: Sequence[str]) -> None:
        """unread: what the file of the mesh holds beyond it. Raises OutputError where SU2 cannot hold it."""
        super().__init__()
        self.mesh = mesh
        self.unread = list(unread)
        text, self._lost = _text(mesh)
        self._file = read(text)

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the mesh with the coordinates ``points`` (N, D); a planar mesh without its third ones."""
        self._file.write(points[:, : self._file.mesh.points.shape[1]], file)

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates, every bit of which is kept; what is not becomes ``notes``."""
        self.notes = [*self.unread, *self._lost]
        return points


def convert(mesh: Mesh, unread: Sequence[str]) -> ConvertedSource:
    """A source that writes ``mesh`` as SU2; raises OutputError where SU2 cannot hold it."""
    return ConvertedSource(mesh, unread)


def _text(mesh: Mesh) -> tuple[bytes, list[str]]:
    """The file, and what it cannot keep, one line each."""
    dimensions = [topological_dimension(block.type) or 0 for block in mesh.cells]
    sizes = [len(block.vertices) for block in mesh.cells]
    top = max((d for d, size in zip(dimensions, sizes, strict=True) if size), default=0)
    unknown = {block.type for block in mesh.cells if topological_dimension(block.type) is None}
    if unknown or top < 2:
        what = (
            f"no cells of type {', '.join(sorted(unknown))}" if unknown else "planar and volume meshes only"
        )
        raise OutputError(f"SU2 has {what}")
    points, lost = _coordinates(mesh, top)
    inner = [b for b, d in enumerate(dimensions) if d == top]
    lower = [b for b, d in enumerate(dimensions) if d == top - 1]
    strange = {mesh.cells[b].type for b in (*inner, *lower)} - _NUMBERS.keys()
    if strange:
        raise OutputError(f"SU2 has no cells of type {', '.join(sorted(strange))}")
    rest = sum(
        len(b.vertices) for b, d in zip(mesh.cells, dimensions, strict=True) if d not in (top, top - 1)
    )
    lost += number_not_kept(rest, f"cell of dimension below {top - 1}")
    elements = [row for b in inner for row in _rows(mesh.cells[b].type, mesh.cells[b].vertices)]
    lines = [f"NDIME= {top}", f"NELEM= {len(elements)}"]
    lines += [f"{row} {i}" for i, row in enumerate(elements)]
    lines.append(f"NPOIN= {len(points)}")
    lines += [f"{' '.join(map(repr, row))} {i}" for i, row in enumerate(points.tolist())]
    markers, used, double = _markers(mesh, lower, top)
    lost += [f"{double} cells are in several groups: they stay in the first"] if double else []
    lines.append(f"NMARK= {len(markers)}")
    for name, rows in markers.items():
        lines += [f"MARKER_TAG= {name}", f"MARKER_ELEMS= {len(rows)}", *rows]
    lost += names_not_kept(mesh, {*mesh.field_data, *mesh.cell_sets, *mesh.point_sets} - used)
    lost += not_kept(mesh.cell_data.keys() - {"su2:marker"}, "cell field")
    lost += [*not_kept(mesh.point_data, "point field"), *links_not_kept(mesh)]
    return "\n".join([*lines, ""]).encode(), lost


def _coordinates(mesh: Mesh, top: int) -> tuple[np.ndarray, list[str]]:
    """The coordinates that SU2 wants, and what it cannot keep of them."""
    points = mesh.points
    if points.shape[1] == top:
        return points, []
    third = points[:, 2]
    if len(third) and (third != third[0]).any():
        raise OutputError("SU2 has planar meshes in x and y only, no surfaces in space")
    return points[:, :2], [f"the third coordinate, {third[0]:g}, is not kept"] if third[:1].any() else []


def _markers(mesh: Mesh, lower: list[int], top: int) -> tuple[dict[str, list[str]], set[str], int]:
    """The rows of each marker by name, the names of groups that became markers, and how many cells are in
    several groups."""
    free = {b: np.ones(len(mesh.cells[b].vertices), dtype=bool) for b in lower}
    markers: dict[str, list[str]] = {}
    used: set[str] = set()
    double = 0
    for name in dict.fromkeys([*mesh.field_data, *mesh.cell_sets]):
        members = group_cells(mesh, name)
        if not any(members[b].any() for b in lower):
            continue
        used.add(name)
        for b in lower:
            double += int((members[b] & ~free[b]).sum())
            _add(markers, name, mesh, b, members[b] & free[b])
            free[b] &= ~members[b]
    tags = next(iter(region_names(mesh)), None)
    for b in lower:
        values = np.asarray(mesh.cell_data[tags][b]) if tags else np.zeros(len(free[b]), dtype=np.int64)
        for value in np.unique(values[free[b]]).tolist():
            _add(markers, f"marker_{int(value)}", mesh, b, free[b] & (values == value))
    for name, facets in mesh.facet_sets.items():
        sizes = (facets >= 0).sum(axis=1)
        used.add(name)
        for size, cell_type in ((2, "line"), (3, "triangle"), (4, "quad")):
            if (cell_type == "line") == (top == 2):
                rows = _rows(cell_type, facets[sizes == size][:, :size])
                markers.setdefault(_tag(name), []).extend(rows)
    return {name: rows for name, rows in markers.items() if rows}, used, double


def _add(markers: dict[str, list[str]], name: str, mesh: Mesh, b: int, chosen: np.ndarray) -> None:
    block = mesh.cells[b]
    markers.setdefault(_tag(name), []).extend(_rows(block.type, block.vertices[chosen]))


def _rows(cell_type: str, vertices: np.ndarray) -> list[str]:
    """A line for each cell."""
    number = _NUMBERS[cell_type]
    return [f"{number} {' '.join(map(str, row))}" for row in vertices.tolist()]


def _tag(name: str) -> str:
    """A name as SU2 reads it: one word without signs that mean something."""
    return "_".join(name.replace("%", " ").replace("=", " ").split()) or "marker"
