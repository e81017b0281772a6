"""A deck as a Source: the mesh in it, and the deck again with other coordinates."""

from __future__ import annotations

import io
import os
import re
from collections import Counter
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.abaqus.cards import Deck, Inclusion
from dvr_cli.files.abaqus.holding import held_vertices
from dvr_cli.files.abaqus.model import Model
from dvr_cli.files.abaqus.numbers import text_of
from dvr_cli.files.abaqus.sets import Sets
from dvr_cli.files.numbers_in_text import shown, write_texts
from dvr_cli.files.source import InputFile, Source, differing
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells, Mesh

_MOST_KINDS = 8
_INPUT_OPTION = re.compile(rb',\s*INPUT\s*=\s*("[^"]*"|[^,\n]*)', re.IGNORECASE)
# Keywords that the mesh consists of, and those that only bracket others.
_OF_THE_MESH = frozenset(
    {"NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "PART", "ENDPART", "ASSEMBLY", "ENDASSEMBLY", "INSTANCE"}
    | {"ENDINSTANCE", "HEADING", "PREPRINT", "ENDSTEP"}
)


class AbaqusSource(Source):
    """A deck, and the files it includes.

    In place, included files are patched where they are. Any other output has those whose coordinates
    change within it, in place of the *INCLUDE; so none of the files read is altered, and the output is whole.
    """

    format = "abaqus"

    def __init__(self, deck: Deck, model: Model, mesh: Mesh, path: Path | None) -> None:
        """path: of the deck's first file, None for a pipe."""
        super().__init__()
        self.mesh = mesh
        self.unread = _beyond(deck, model)
        self._deck = deck
        self._rows = model.rows
        self._path = path

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the deck with the coordinates ``points`` ((N, 2) or (N, 3))."""
        self._note(points)
        self._write(0, points, self._absorbed(points), file)

    def companions(self, points: np.ndarray) -> dict[Path, bytes]:
        """In place, the included files whose coordinates change."""
        if self._path is None or not self._in_place:
            return {}
        result = {}
        for number in sorted(self._moved(points) - {0}):
            file = io.BytesIO()
            self._write(number, points, set(), file)
            result[self._path.parent / self._deck.files[number].name] = file.getvalue()
        return result

    def stored(self, points: np.ndarray) -> np.ndarray:
        """``points`` with those coordinates rounded that take more characters than programs read."""
        self._note(points)
        result = points.copy()
        changed = differing(points, self.mesh.points)
        result[changed] = [float(text_of(value)) for value in points[changed].tolist()]
        return result

    @property
    def _in_place(self) -> bool:
        """True if the output is the deck itself."""
        if self.target is None or self._path is None or not self.target.exists():
            return False
        return os.path.samefile(self.target, self._path)

    def _moved(self, points: np.ndarray) -> set[int]:
        """The numbers of the files whose coordinates change."""
        changed = np.flatnonzero(differing(points, self.mesh.points).any(axis=1))
        return {rows.file for rows, vertex in self._rows if np.isin(vertex, changed).any()}

    def _absorbed(self, points: np.ndarray) -> set[int]:
        """The numbers of the included files that the output has within it.

        These are those whose coordinates change, those that the output could not find from where it is, and
        those that include one of these.
        """
        if self._in_place:
            return set()
        absorbed = self._moved(points) - {0}
        if self._path is not None and not self._beside:
            files = self._deck.files
            absorbed |= {i for i in range(1, len(files)) if not files[i].name.is_absolute()}
        for inclusion in reversed(self._deck.inclusions):  # the innermost come last
            if inclusion.file in absorbed and inclusion.line.file > 0:
                absorbed.add(inclusion.line.file)
        return absorbed

    @property
    def _beside(self) -> bool:
        """True if the output is in the folder of the deck."""
        if self.target is None or self._path is None:
            return False
        return os.path.realpath(self.target.parent) == os.path.realpath(self._path.parent)

    def _note(self, points: np.ndarray) -> None:
        """Say which other files change, or become part of the output."""
        files = self._deck.files
        if self._in_place:
            numbers, what = self._moved(points) - {0}, "changed, too"
        else:
            numbers, what = self._absorbed(points), "within the output now"
        names = [str(files[i].name) for i in sorted(numbers)]
        self.notes = [f"{', '.join(names)}, which the deck includes: {what}"] if names else []

    def _write(self, number: int, points: np.ndarray, absorbed: set[int], file: BinaryIO) -> None:
        """Write a file of the deck, and within it those ``absorbed`` that it includes."""
        starts, ends, texts = self._coordinates(number, points)
        inclusions = [
            inclusion
            for inclusion in self._deck.inclusions
            if inclusion.line.file == number and inclusion.file in absorbed
        ]
        data = self._deck.files[number].data
        if inclusions:
            begins = np.array([inclusion.line.begin for inclusion in inclusions])
            stops = np.array([min(inclusion.line.end, len(data)) for inclusion in inclusions])
            starts, ends = np.concatenate([starts, begins]), np.concatenate([ends, stops])
            texts += [self._content(inclusion, points, absorbed) for inclusion in inclusions]
            order = np.argsort(starts, kind="stable")
            starts, ends, texts = starts[order], ends[order], [texts[i] for i in order.tolist()]
        write_texts(file, data, starts, ends, texts)

    def _content(self, inclusion: Inclusion, points: np.ndarray, absorbed: set[int]) -> bytes:
        """The text that takes the place of the line that includes a file."""
        inner = io.BytesIO()
        self._write(inclusion.file, points, absorbed, inner)
        text = inner.getvalue().removeprefix(b"\xef\xbb\xbf")
        if text and not text.endswith((b"\n", b"\r")):
            text += b"\n"
        if inclusion.keyword == "INCLUDE":
            return text
        line = inclusion.line
        head = self._deck.files[line.file].data[line.begin : line.end]
        return _INPUT_OPTION.sub(b"", head).rstrip(b"\r\n") + b"\n" + text

    def _coordinates(self, number: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[bytes]]:
        """The places where coordinates of a file change, in its order, and the texts that go there."""
        d = points.shape[1]
        chosen = [(rows, vertex) for rows, vertex in self._rows if rows.file == number]
        chosen.sort(key=lambda part: int(part[0].starts[0, 0]))
        if not chosen:
            return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), []
        vertex = np.concatenate([vertex for _, vertex in chosen])
        absent = np.concatenate([rows.absent[:, :d] for rows, _ in chosen])
        changed = differing(points, self.mesh.points)[vertex]
        for j in reversed(range(d - 1)):  # no coordinate without those before it
            changed[:, j] |= absent[:, j] & absent[:, j + 1] & changed[:, j + 1]
        starts = np.concatenate([rows.starts[:, :d] for rows, _ in chosen])[changed]
        ends = np.concatenate([rows.ends[:, :d] for rows, _ in chosen])[changed]
        texts = [text_of(value) for value in points[vertex][changed].tolist()]
        for i in np.flatnonzero(absent[changed]).tolist():
            texts[i] = b", " + texts[i]
        return starts, ends, texts


def read(file: InputFile) -> AbaqusSource:
    """Read a deck and the files it includes.

    Each part, each instance with nodes of its own, and what is in none of these has vertices of its own, in
    the order in which the deck defines them; points have 3 coordinates unless no node has a third. Cells
    come in one block a type, those of element types of solids, planes, shells and membranes, trusses and
    links; the nodes of all others are vertex cells, as are nodes with forces, of equations, couplings, rigid
    bodies and boundary conditions (see holding). Cell data: "abaqus:section", the section that holds for
    a cell, "abaqus:elset", the set that its *ELEMENT card names, "abaqus:part" where there are several, each
    from 1 in the order of the deck, 0 for none. Sets and surfaces go by their names.

    Raises InputError for damaged decks, and for nodes in other coordinate systems, generated or copied ones.
    """
    deck = Deck(file)
    model = Model(deck)
    sets = Sets(model)
    if all(CELL_TYPES[block.type].dimension < 2 for block in model.blocks if len(block.vertices)):
        names = sorted({*model.shapeless, *(block.type for block in model.blocks)})[:_MOST_KINDS]
        there = f"only {', '.join(shown(name)[1:-1] for name in names)}" if names else "none at all"
        raise InputError(f"no element is a solid, a plane one, a shell or a membrane: there are {there}")
    blocks = list(model.blocks)
    ends = np.cumsum([len(block.vertices) for block in blocks])
    held = held_vertices(model, sets)
    none_more = [np.zeros(len(held), dtype=np.int64)] if len(held) else []
    blocks += [Cells("vertex", held[:, None])] if len(held) else []
    regions = {"abaqus:section": sets.section, "abaqus:elset": sets.of_card, "abaqus:part": _parts(model)}
    mesh = Mesh(
        model.points,
        blocks,
        cell_data={
            name: [*np.split(tags, ends[:-1]), *none_more] for name, tags in regions.items() if tags.any()
        },
        cell_sets={
            name: [*_by_block(cells, ends), *(more[:0] for more in none_more)]
            for name, cells in sets.element_sets.items()
        },
        point_sets=sets.node_sets,
        facet_sets=sets.surfaces,
    )
    return AbaqusSource(deck, model, mesh, file.path)


def _by_block(cells: np.ndarray, ends: np.ndarray) -> list[np.ndarray]:
    """Cells (ascending) by block, counted within it; ends: of the blocks, in all cells."""
    parts = np.split(cells, np.searchsorted(cells, ends[:-1]))
    return [part - begin for part, begin in zip(parts, [0, *ends[:-1].tolist()], strict=True)]


def _parts(model: Model) -> np.ndarray:
    """(n,) the part of each cell, from 1; 0 throughout where there is one part only."""
    scopes = list({id(scope): scope for scope in model.scopes if len(scope.cells)}.values())
    part = np.zeros(len(model.card), dtype=np.int64)
    for number, scope in enumerate(scopes if len(scopes) > 1 else []):
        part[scope.cells] = number + 1
    return part


def _beyond(deck: Deck, model: Model) -> list[str]:
    """The contents of the deck beyond the mesh: keywords with their numbers, and elements without a shape."""
    count = Counter(card.keyword for card in deck.cards if card.keyword not in _OF_THE_MESH)
    kinds = [f"{n} *{keyword}" for keyword, n in count.items()]
    more = [f"{sum(count.values())} cards in all"] if len(kinds) > _MOST_KINDS else []
    lines = ["node and element numbers, element types"]
    if kinds:
        lines.append(f"materials, sections, loads and steps: {', '.join([*kinds[:_MOST_KINDS], *more])}")
    lines += [f"{n} elements {name}" for name, n in model.shapeless.items()]
    return [f"not kept: {line}" for line in lines]
