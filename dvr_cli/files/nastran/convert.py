"""Nastran decks of meshes from other formats: GRID and element cards, and regions as property numbers.

The deck holds no properties and materials: these are for its user to add.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import OutputError
from dvr_cli.files.losses import links_not_kept, names_not_kept, not_kept, number_not_kept
from dvr_cli.files.nastran.cards import LARGE, SMALL
from dvr_cli.files.nastran.columns import field_text
from dvr_cli.files.nastran.elements import KINDS
from dvr_cli.files.nastran.source import read
from dvr_cli.files.source import InputFile, Source
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.region_choice import regions_of
from dvr_cli.mesh.regions import region_names

# The card of each cell type; a rod needs no direction, which a bar would.
_CARDS = {
    "line": b"CROD",
    "triangle": b"CTRIA3",
    "triangle6": b"CTRIA6",
    "quad": b"CQUAD4",
    "quad8": b"CQUAD8",
    "quad9": b"CQUAD",
    "tetra": b"CTETRA",
    "tetra10": b"CTETRA",
    "pyramid": b"CPYRAM",
    "pyramid13": b"CPYRAM",
    "wedge": b"CPENTA",
    "wedge15": b"CPENTA",
    "hexahedron": b"CHEXA",
    "hexahedron20": b"CHEXA",
}
_LEFT_OUT = ("vertex", "line3")
_HIGHEST = 99_999_999  # the largest number in columns of 8
_FIRST, _NEXT = 6, 8  # nodes in the first line of an element, and in each that follows


class ConvertedSource(Source):
    """A mesh of another format, to be written as a deck."""

    format = "nastran"

    def __init__(self, mesh: Mesh, unread: Sequence[str]) -> None:
        """unread: what the file of the mesh holds beyond it. Raises OutputError if a deck cannot hold it."""
        super().__init__()
        self.mesh = mesh
        self.unread = list(unread)
        text, self._lost = _text(mesh)
        self._deck = read(InputFile(text, None))

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the deck with the coordinates ``points`` (N, 2 or 3)."""
        self._deck.write(_spatial(points), file)

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates as columns of 16 hold them; what is not kept becomes ``notes``."""
        kept = self._deck.stored(_spatial(points))[:, : points.shape[1]]
        rounding = float(np.abs(kept - points).max(initial=0.0))
        rounded = [f"coordinates are rounded, by up to {rounding:.2g}"] if rounding else []
        self.notes = [*self.unread, *rounded, *self._lost]
        return kept


def convert(mesh: Mesh, unread: Sequence[str]) -> ConvertedSource:
    """A source that writes ``mesh`` as a deck; raises OutputError where a deck cannot hold it."""
    return ConvertedSource(mesh, unread)


def _spatial(points: np.ndarray) -> np.ndarray:
    """``points`` with three coordinates."""
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def _text(mesh: Mesh) -> tuple[bytes, list[str]]:
    """The deck, and what it cannot keep, one line each."""
    strange = {block.type for block in mesh.cells if len(block.vertices)} - _CARDS.keys() - {*_LEFT_OUT}
    if strange:
        raise OutputError(f"Nastran has no elements for cells of type {', '.join(sorted(strange))}")
    count = sum(len(block.vertices) for block in mesh.cells)
    if max(len(mesh.points), count) > _HIGHEST:
        raise OutputError(f"a deck numbers nodes and elements up to {_HIGHEST} only")
    lines = ["BEGIN BULK"]
    for i, point in enumerate(_spatial(mesh.points).tolist(), 1):
        x, y, z = (field_text(value, LARGE) for value in point)
        lines += [f"{'GRID*':<{SMALL}}{i:<{LARGE}}{'':<{LARGE}}{x:<{LARGE}}{y}", f"{'*':<{SMALL}}{z}"]
    properties, lost = _properties(mesh)
    number, left_out = 0, 0
    for block, tags in zip(mesh.cells, properties, strict=True):
        if block.type in _LEFT_OUT:
            left_out += len(block.vertices)
            continue
        card = _CARDS[block.type]
        places = dict(KINDS[card].shapes)[block.type]
        nodes = np.empty_like(block.vertices)
        nodes[:, places] = block.vertices + 1
        for row, tag in zip(nodes.tolist(), tags.tolist(), strict=True):
            number += 1
            fields = "".join(f"{field:<{SMALL}}" for field in (number, tag, *row[:_FIRST]))
            text = f"{card.decode():<{SMALL}}{fields}"
            for begin in range(_FIRST, len(row), _NEXT):
                lines.append(f"{text}+")
                text = f"{'+':<{SMALL}}" + "".join(
                    f"{field:<{SMALL}}" for field in row[begin : begin + _NEXT]
                )
            lines.append(text.rstrip())
    lost += number_not_kept(left_out, "cell of type vertex or line3")
    lost += [*names_not_kept(mesh), *not_kept(mesh.point_data, "point field"), *links_not_kept(mesh)]
    return "\n".join([*lines, "ENDDATA", ""]).encode(), lost


def _properties(mesh: Mesh) -> tuple[list[np.ndarray], list[str]]:
    """The number of the property of each cell, one array a block, and what of the cell data is not kept."""
    names = region_names(mesh)
    tags = [np.asarray(block) for block in mesh.cell_data[names[0]]] if names else []
    lost = []
    if names and all(((block >= 1) & (block <= _HIGHEST)).all() for block in tags):
        numbers = [block.astype(np.int64) for block in tags]
        lost += (
            [f"the cell field {names[0]} is kept as nastran:property"]
            if names[0] != "nastran:property"
            else []
        )
        rest = mesh.cell_data.keys() - {names[0]}
    else:
        joined = regions_of(mesh, list(range(len(mesh.cells))))[0] + 1
        numbers = np.split(joined, np.cumsum([len(block.vertices) for block in mesh.cells])[:-1])
        rest = {*mesh.cell_data}
        lost += [f"regions ({', '.join(names)}) are numbered anew as nastran:property"] if names else []
    return numbers, [*lost, *not_kept(rest, "cell field")]
