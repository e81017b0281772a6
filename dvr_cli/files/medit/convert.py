"""Meshes of any origin as MEDIT files; text, or binary where the file is named .meshb."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import OutputError
from dvr_cli.files.losses import lost
from dvr_cli.files.medit.keywords import DIMENSION, DISPUTED, ELEMENTS, END, NAMES, VERTICES
from dvr_cli.files.medit.mesh import make_mesh
from dvr_cli.files.source import Source
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.regions import region_names

# The keyword of each type of cell.
_KEYWORDS = {cell_type: name for name, (cell_type, _) in reversed(ELEMENTS.items()) if name not in DISPUTED}
# The sections beside elements that are written, of the point sets and cell sets of these names.
HOLDING = frozenset({"Corners", "RequiredVertices", "Ridges", *(f"Required{name}" for name in ELEMENTS)})
_CODES = {name: code for code, name in NAMES.items()}
_Sections = dict[str, np.ndarray]  # rows of whole numbers by keyword, (n, k)


class ConvertedMedit(Source):
    """Any mesh, to be written as a MEDIT file."""

    format = "medit"

    def __init__(self, mesh: Mesh, unread: Sequence[str]) -> None:
        """unread: what the file it was read from has beyond the mesh. Raises OutputError for cells that the
        format does not have.
        """
        super().__init__()
        self.mesh = mesh
        self.unread = list(unread)
        self._sections = _sections_of(mesh)
        self._references = _whole(mesh.point_data.get("medit:ref"), len(mesh.points))

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the mesh with the coordinates ``points`` ((N, d))."""
        write = _write_binary if named_binary(self.target) else _write_text
        write(file, points, self._references, self._sections)

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates as they are; finds out, too, what is lost."""
        back = make_mesh(_Converted(points, self._references, self._sections))
        self.notes = [*self.unread, *lost(self.mesh, back, points)]
        return points


class _Converted:
    """A file not yet written, with what ``make_mesh`` asks a file for."""

    def __init__(self, points: np.ndarray, references: np.ndarray, sections: _Sections) -> None:
        self._points, self._references, self._sections = points, references, sections
        self.sections = list(sections)

    def integers(self, name: str, columns: int) -> np.ndarray:
        return self._sections[name].reshape(-1, columns)

    def vertices(self) -> tuple[np.ndarray, np.ndarray]:
        return self._points, self._references


def convert(mesh: Mesh, unread: Sequence[str]) -> ConvertedMedit:
    """A Source that writes ``mesh``; see ``ConvertedMedit``."""
    return ConvertedMedit(mesh, unread)


def named_binary(path: Path | None) -> bool:
    """True if a file of this name is binary: programs go by the suffix."""
    return path is not None and path.suffix.lower() == ".meshb"


def _sections_of(mesh: Mesh) -> _Sections:
    """Elements, and the sections that say which of them may not move, all counted from 1."""
    regions = [name for name in ("medit:ref", *region_names(mesh)) if name in mesh.cell_data]
    rows: dict[str, list[np.ndarray]] = {}
    place = []  # the keyword of each block, and how many cells of it are in front
    lone = np.zeros(len(mesh.points), dtype=bool)
    for b, block in enumerate(mesh.cells):
        if block.type == "vertex":
            lone[block.vertices] = True
            place.append(("", 0))
            continue
        if block.type not in _KEYWORDS:
            raise OutputError(f"medit cannot hold {block.type} cells")
        tags = _whole(mesh.cell_data[regions[0]][b] if regions else None, len(block.vertices))
        parts = rows.setdefault(_KEYWORDS[block.type], [])
        place.append((_KEYWORDS[block.type], sum(map(len, parts))))
        parts.append(np.column_stack([block.vertices + 1, tags]))
    sections = {name: np.concatenate(parts) for name, parts in rows.items()}
    for name, parts in mesh.cell_sets.items():
        members = [
            chosen + place[b][1]
            for b, chosen in enumerate(parts)
            if len(chosen) and _names(name, place[b][0])
        ]
        if members and name in NAMES.values():
            chosen = np.concatenate(members)
            sections[name] = chosen[:, None] + 1
            if name != "Ridges":
                of = sections[name.removeprefix("Required")]
                lone[of[chosen, :-1] - 1] = False
    corners = np.asarray(mesh.point_sets.get("Corners", []), dtype=np.int64)
    lone[corners] = False
    lone[np.asarray(mesh.point_sets.get("RequiredVertices", []), dtype=np.int64)] = True
    for name, vertices in (("Corners", corners), ("RequiredVertices", np.flatnonzero(lone))):
        if len(vertices):
            sections[name] = vertices[:, None] + 1
    return sections


def _names(name: str, keyword: str) -> bool:
    """True if a set of this name is a section about elements of this keyword."""
    return name == f"Required{keyword}" or (name == "Ridges" and keyword == "Edges")


def _whole(values: np.ndarray | None, n: int) -> np.ndarray:
    """(n,) references: these values if there are such and they are integers, else 0."""
    values = np.zeros(n) if values is None else np.asarray(values)
    if values.shape != (n,) or (values != np.rint(values)).any() or not (np.abs(values) < 2**31).all():
        values = np.zeros(n)
    return values.astype(np.int64)


def _write_text(file: BinaryIO, points: np.ndarray, references: np.ndarray, sections: _Sections) -> None:
    dimension = points.shape[1]
    file.write(f"MeshVersionFormatted 2\nDimension {dimension}\nVertices\n{len(points)}\n".encode())
    columns = [*points.T.tolist(), references.tolist()]
    flat = [number for row in zip(*columns, strict=True) for number in row]
    file.write(((("%r " * dimension + "%d\n") * len(points)) % tuple(flat)).encode())
    for name, rows in sections.items():
        row = " ".join(["%d"] * rows.shape[1]) + "\n"
        file.write(f"{name}\n{len(rows)}\n".encode())
        file.write(((row * len(rows)) % tuple(rows.ravel().tolist())).encode())
    file.write(b"End\n")


def _write_binary(file: BinaryIO, points: np.ndarray, references: np.ndarray, sections: _Sections) -> None:
    size = points.nbytes + 4 * len(points) + sum(4 * rows.size for rows in sections.values())
    version, position = (2, "<i4") if size < 2**31 - 2**16 else (3, "<i8")
    place = np.dtype([("place", "<f8", (points.shape[1],)), ("reference", "<i4")])
    vertices = np.empty(len(points), dtype=place)
    vertices["place"], vertices["reference"] = points, references
    at = file.write(np.array([1, version], "<i4").tobytes())
    bodies = [
        (DIMENSION, np.array([points.shape[1]], "<i4").tobytes()),
        (VERTICES, np.array([len(points)], "<i4").tobytes() + vertices.tobytes()),
    ]
    for name, rows in sections.items():
        bodies.append((_CODES[name], np.array([len(rows)], "<i4").tobytes() + rows.astype("<i4").tobytes()))
    for code, body in bodies:
        at += 4 + np.dtype(position).itemsize + len(body)
        file.write(np.array([code], "<i4").tobytes() + np.array([at], position).tobytes() + body)
    file.write(np.array([END], "<i4").tobytes() + np.array([0], position).tobytes())
