"""Triangles of any origin as STL: text with a solid for each named group, or binary where there are none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import OutputError
from dvr_cli.files.losses import links_not_kept, names_not_kept, not_kept, number_not_kept
from dvr_cli.files.source import Source, rounded
from dvr_cli.files.stl.binary import FACET, HEADER
from dvr_cli.files.stl.source import merged, normals_of
from dvr_cli.mesh.groups import group_cells, topological_dimension
from dvr_cli.mesh.mesh import Mesh

_BLANK_HEADER = b"written by dvr".ljust(HEADER - 4)  # never "solid", which begins a text


class ConvertedStl(Source):
    """A mesh of triangles, to be written as an STL file.

    Named groups of triangles that have none in common become solids; triangles in none are a solid without
    a name.
    """

    format = "stl"

    def __init__(self, mesh: Mesh, unread: Sequence[str]) -> None:
        """unread: what the file it was read from has beyond the mesh. Raises OutputError for a mesh with
        other cells than triangles, cells of lower dimension aside.
        """
        super().__init__()
        self.mesh = mesh
        self.unread = list(unread)
        dropped = []
        for block in mesh.cells:
            if block.type != "triangle" and len(block.vertices):
                if topological_dimension(block.type) not in (0, 1):
                    raise OutputError(f"stl holds triangles only, and this mesh has {block.type} cells")
                dropped += number_not_kept(len(block.vertices), f"{block.type} cell")
        chosen = [b for b, block in enumerate(mesh.cells) if block.type == "triangle"]
        if not chosen:
            raise OutputError("stl holds triangles only, and this mesh has none")
        self._facets = np.concatenate([mesh.cells[b].vertices for b in chosen])
        self._names, self._solid, lost = _solids(mesh, chosen)
        dropped += names_not_kept(mesh, lost)
        dropped += not_kept(mesh.cell_data, "cell field") + not_kept(mesh.point_data, "point field")
        dropped += links_not_kept(mesh)
        unused = len(mesh.points) - len(np.unique(self._facets))
        dropped += number_not_kept(unused, "point of no triangle")
        if not self._names and (rounded(mesh.points) != mesh.points).any():
            dropped.append("coordinates are rounded to 32 bits")
        self._dropped = dropped

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the mesh with the coordinates ``points`` ((N, 2) or (N, 3))."""
        corners = _in_space(self.stored(points))[self._facets]
        normals = normals_of(corners)
        if self._names:
            for number in range(-1, len(self._names)):
                here = self._solid == number
                if here.any():
                    name = self._names[number] if number >= 0 else ""
                    file.write(_text(f" {name}".rstrip(), normals[here], corners[here]))
            return
        facets = np.zeros(len(corners), dtype=FACET)
        facets["normal"], facets["corners"] = normals, corners
        file.write(_BLANK_HEADER + np.array(len(facets), "<u4").tobytes() + facets.tobytes())

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates as a reader of the output gets them; finds out, too, what is lost."""
        stored = points if self._names else rounded(points)
        self.notes = [*self.unread, *self._dropped]
        used = np.unique(self._facets)
        apart = len(used) - len(merged(_in_space(stored)[used])[0])
        if apart:
            self.notes.append(f"vertices that become one with others in the same place: {apart}")
        return stored


def convert(mesh: Mesh, unread: Sequence[str]) -> ConvertedStl:
    """A Source that writes ``mesh``; see ``ConvertedStl``."""
    return ConvertedStl(mesh, unread)


def _solids(mesh: Mesh, chosen: list[int]) -> tuple[list[str], np.ndarray, set[str]]:
    """Names of solids, the solid each triangle is in (-1 for none), and names of groups that are lost."""
    solid = np.full(sum(len(mesh.cells[b].vertices) for b in chosen), -1)
    names: list[str] = []
    lost = set(mesh.point_sets) | set(mesh.facet_sets)
    for name in dict.fromkeys([*mesh.field_data, *mesh.cell_sets]):
        members = group_cells(mesh, name)
        inside = np.concatenate([members[b] for b in chosen])
        if inside.any() and (solid[inside] < 0).all() and name.isprintable() and name.strip() == name:
            solid[inside] = len(names)
            names.append(name)
        else:
            lost.add(name)
    return names, solid, lost


def _in_space(points: np.ndarray) -> np.ndarray:
    return points if points.shape[1] == 3 else np.column_stack([points, np.zeros(len(points))])


def _text(name: str, normals: np.ndarray, corners: np.ndarray) -> bytes:
    facet = "facet normal %r %r %r\nouter loop\n" + "vertex %r %r %r\n" * 3 + "endloop\nendfacet\n"
    numbers = np.concatenate([normals[:, None], corners], axis=1).ravel().tolist()
    return f"solid{name}\n{facet * len(normals) % tuple(numbers)}endsolid{name}\n".encode()
