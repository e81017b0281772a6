"""Gmsh MSH files, versions 1 to 4.1, ASCII and binary: read them, and write them back losslessly.

Our own reader, because meshio's cannot read much of what Gmsh writes and forgets where it read things; the
file is kept and on writing only the coordinates in it are replaced.
"""

from __future__ import annotations

from collections import Counter
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh.data import View, read_physical_names, read_view
from dvr_cli.files.gmsh.elements import Elements
from dvr_cli.files.gmsh.mesh import make_mesh
from dvr_cli.files.gmsh.nodes import Nodes
from dvr_cli.files.gmsh.numbers import read_numbers
from dvr_cli.files.gmsh.patch import patch_nodes
from dvr_cli.files.gmsh.sections import Header, Section, Sections, find_sections, read_header
from dvr_cli.files.losses import number_not_kept, parameters_dropped
from dvr_cli.files.source import Source, differing
from dvr_cli.mesh.mesh import Mesh

# with periodic pairs of node tags, and how many elements between partitions were left out
_Parts = tuple[Nodes, list[Elements], np.ndarray, int]
_NO_PAIRS = np.empty((0, 2), np.int64)


class GmshSource(Source):
    """A Gmsh file, read; tags: (N,) those of its nodes."""

    format = "gmsh"

    def __init__(self, data: bytes, mesh: Mesh, header: Header, section: Section, nodes: Nodes) -> None:
        """section, nodes: the file's section of nodes and what is in it."""
        super().__init__()
        self.mesh = mesh
        self.tags = nodes.tags
        self._data = data
        self._header = header
        self._section = section
        self._blocks = nodes.blocks
        self._points = mesh.points.copy()  # as read, whatever becomes of the mesh

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the file with other coordinates; ``notes`` says if parametric ones had to go."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        changed = differing(points, self._points)
        self.notes = []
        if not changed.any():
            file.write(self._data)
            return
        values = points
        if self.parameters:
            values, changed = self._with_parameters(points, changed)
        section, stale = patch_nodes(self._data, self._section, self._header, self._blocks, values, changed)
        self.notes = parameters_dropped(stale)
        whole = memoryview(self._data)
        file.write(whole[: self._section.opening])
        file.write(section)
        file.write(whole[self._section.end :])

    def _with_parameters(self, points: np.ndarray, changed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 5) coordinates, and parameters where they are known, and which of these to write, bool."""
        values, written = np.zeros((len(points), 5)), np.zeros((len(points), 5), dtype=bool)
        values[:, :3], written[:, :3] = points, changed
        for node, parameters in self.parameters.items():
            values[node, 3 : 3 + len(parameters)] = parameters
            written[node, 3 : 3 + len(parameters)] = True
        return values, written


def read(data: bytes) -> GmshSource:
    """Read a Gmsh file from its bytes.

    Cells come in blocks of consecutive elements of one type (in one block a type should a file change type
    more than a thousand times), under meshio's names and in its node order. See ``mesh`` for
    physical groups. Fields are NaN where the file gives no value; of a view with several
    steps the last is taken. InputError if the file is damaged or uses what is not supported.
    """
    sections = find_sections(data)
    header = read_header(data, sections)
    once = sections.once
    version = header.version[0]
    if "Nodes" not in once or once["Nodes"].name not in _NODES[version]:
        raise InputError("the file has no $Nodes section, hence no mesh")
    with np.errstate(invalid="ignore"):  # a NaN for an integer is found out after its conversion
        names = read_physical_names(data, once["PhysicalNames"]) if "PhysicalNames" in once else []
        views = [read_view(data, section, header) for section in sections.views]
        nodes, elements, periodic, left_out = _READERS[version](data, header, once)
        mesh = make_mesh(
            nodes, elements, names, periodic, [view for view in views if view], repeated=version in "12"
        )
    source = GmshSource(data, mesh, header, once["Nodes"], nodes)
    source.unread = number_not_kept(left_out, "element between partitions") + _beyond(sections, views)
    return source


def _beyond(sections: Sections, views: list[View | None]) -> list[str]:
    """The lines about sections that are passed over, and about views and steps of them that are no fields."""
    steps = {(view.name, view.on_nodes, view.step) for view in views if view}
    last = {(name, on_nodes) for name, on_nodes, _ in steps}
    lines = number_not_kept(len(steps) - len(last), "step of a field")
    lines += number_not_kept(views.count(None), "field of neither numbers, vectors nor tensors")
    for name, count in Counter(sections.others).items():
        lines += number_not_kept(count, f"section of kind {name}")
    return lines


def _read_msh2(data: bytes, header: Header, once: dict[str, Section]) -> _Parts:
    from dvr_cli.files.gmsh import msh2

    nodes = msh2.read_nodes(data, once["Nodes"], header)
    elements = msh2.read_elements(data, once["Elements"], header) if "Elements" in once else []
    periodic = msh2.read_periodic(data, once["Periodic"]) if "Periodic" in once else _NO_PAIRS
    return nodes, elements, periodic, 0


def _read_msh1(data: bytes, header: Header, once: dict[str, Section]) -> _Parts:
    from dvr_cli.files.gmsh import msh1, msh2

    nodes = msh2.read_nodes(data, once["Nodes"], header)
    elements = msh1.read_elements(data, once["Elements"]) if "Elements" in once else []
    return nodes, elements, _NO_PAIRS, 0


def _read_msh3(data: bytes, header: Header, once: dict[str, Section]) -> _Parts:
    from dvr_cli.files.gmsh import msh2, msh3

    physical = msh3.read_entities(data, once["Entities"]) if "Entities" in once else {}
    nodes = msh3.read_nodes(data, once["Nodes"], header)
    elements = msh3.read_elements(data, once["Elements"], header, physical) if "Elements" in once else []
    periodic = msh2.read_periodic(data, once["Periodic"]) if "Periodic" in once else _NO_PAIRS
    return nodes, elements, periodic, 0


def _read_msh4(data: bytes, header: Header, once: dict[str, Section]) -> _Parts:
    from dvr_cli.files.gmsh import msh4

    older = header.version != "4.1"
    entities = msh4.Entities({}, {}, set())
    for name in ("Entities", "PartitionedEntities"):
        if name in once:
            numbers = read_numbers(data, once[name], header)
            msh4.read_entities(numbers, name == "PartitionedEntities", entities, older)
    nodes = msh4.read_nodes(read_numbers(data, once["Nodes"], header), entities.whole, older)
    elements: list[Elements] = []
    left_out, periodic = 0, _NO_PAIRS
    if "Elements" in once:
        numbers = read_numbers(data, once["Elements"], header, np.int64)
        elements, left_out = msh4.read_elements(numbers, entities, older)
    if "Periodic" in once and older and header.byte_order:
        raise InputError("periodic links in binary MSH 4.0 files are not supported")
    if "Periodic" in once and older:
        from dvr_cli.files.gmsh import msh2

        periodic = msh2.read_periodic(data, once["Periodic"])
    elif "Periodic" in once:
        periodic = msh4.read_periodic(read_numbers(data, once["Periodic"], header))
    return nodes, elements, periodic, left_out


_READERS = {"1": _read_msh1, "2": _read_msh2, "3": _read_msh3, "4": _read_msh4}
_NODES = {"1": ("NOD",), "2": ("Nodes", "ParametricNodes"), "3": ("Nodes",), "4": ("Nodes",)}
