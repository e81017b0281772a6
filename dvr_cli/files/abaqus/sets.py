"""Sets, surfaces and sections of a deck: what its names stand for in the mesh."""

from __future__ import annotations

import re

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.abaqus.cards import Card
from dvr_cli.files.abaqus.fields import Fields
from dvr_cli.files.abaqus.model import Model, Scope
from dvr_cli.files.abaqus.types import FACES
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.ranks import distinct

_FACE = re.compile(r"([SPE])(\d)")
_NONE = np.empty(0, dtype=np.int64)


class Sets:
    """The sets of a model, read.

    node_sets, element_sets: by name, vertices and cells, ascending. A name that several parts use has the
    part's in front of it, and a dot.
    surfaces: by name, (n, w) corners of faces of volume elements or edges of planar ones, rows ending in -1.
    of_card, section: (n,) a number for each cell, 0 for none: of the set that its *ELEMENT card names, and of
    the *... SECTION card for a set it is in.
    """

    def __init__(self, model: Model) -> None:
        """Raises InputError for what is damaged."""
        self._model = model
        self._nodes: dict[tuple[int, str], np.ndarray] = {}
        self._elements: dict[tuple[int, str], np.ndarray] = {}
        self._facets: dict[tuple[int, str], np.ndarray] = {}
        self._names: dict[tuple[int, str], str] = {}
        self._scopes: dict[int, Scope] = {}
        self._of_faces: set[tuple[int, str]] = set()
        self.of_card = np.zeros(len(model.card), dtype=np.int64)
        self.section = np.zeros(len(model.card), dtype=np.int64)
        cards = list(zip(model.deck.cards, model.scopes, strict=True))
        for number, (card, scope) in enumerate(cards):
            self._take_set(number, card, scope)
        for number, (card, scope) in enumerate(cards):
            if card.keyword == "SURFACE":
                self._take_surface(card, scope)
            elif card.keyword.endswith("SECTION") and "ELSET" in card.options:
                self.section[self.elements(card.options["ELSET"], scope)] = number + 1
        self.of_card, self.section = _ranks(self.of_card), _ranks(self.section)
        listed = {key: cells for key, cells in self._elements.items() if key not in self._of_faces}
        self.node_sets = self._by_name(self._nodes)
        self.element_sets = self._by_name(listed)
        self.surfaces = self._by_name(self._facets)

    def nodes(self, name: str, scope: Scope) -> np.ndarray:
        """The vertices that a number or a name stands for where ``scope`` holds; none for an unknown one."""
        return self._members(name, scope, self._nodes)

    def elements(self, name: str, scope: Scope) -> np.ndarray:
        """The cells that a number or a name stands for where ``scope`` holds; none for an unknown one."""
        return self._members(name, scope, self._elements)

    def surface(self, name: str, scope: Scope) -> np.ndarray:
        """The corners of a surface of faces; none for an unknown one."""
        corners = distinct(self._members(name, scope, self._facets).ravel())
        return corners[corners >= 0]

    def vertices_of(self, cells: np.ndarray) -> np.ndarray:
        """The vertices of some cells, ascending."""
        parts, first = [_NONE], 0
        for block in self._model.blocks:
            inside = (cells >= first) & (cells < first + len(block.vertices))
            parts.append(block.vertices[cells[inside] - first].ravel())
            first += len(block.vertices)
        return distinct(np.concatenate(parts))

    def _take_set(self, number: int, card: Card, scope: Scope) -> None:
        if card.keyword == "NODE" and card.options.get("NSET"):
            ids = self._model.node_ids(card)
            self._add(self._nodes, card.options["NSET"], scope, [scope.vertices_of(part) for part in ids])
        elif card.keyword == "ELEMENT" and card.options.get("ELSET"):
            cells = np.flatnonzero(self._model.card == number)
            self._add(self._elements, card.options["ELSET"], scope, [cells])
            known = list(self._elements)
            self.of_card[cells] = 1 + known.index((id(scope), card.options["ELSET"].upper()))
        elif card.keyword == "NSET" and card.options.get("NSET"):
            inner = self._within(card, scope)
            parts = self._listed(card, inner, self._nodes)
            if "ELSET" in card.options:
                parts.append(self.vertices_of(self.elements(card.options["ELSET"], inner)))
            self._add(self._nodes, card.options["NSET"], scope, parts)
        elif card.keyword == "ELSET" and card.options.get("ELSET"):
            parts = self._listed(card, self._within(card, scope), self._elements)
            self._add(self._elements, card.options["ELSET"], scope, parts)

    def _within(self, card: Card, scope: Scope) -> Scope:
        """The scope in which the numbers in a card hold: the instance it names, else the one it stands in."""
        return self._model.instances.get(card.options.get("INSTANCE", "").upper(), scope)

    def _add(
        self, sets: dict[tuple[int, str], np.ndarray], name: str, scope: Scope, parts: list[np.ndarray]
    ) -> None:
        """Give a set more members; numbers that the deck gives to nothing do not count."""
        key = (id(scope), name.upper())
        members = np.concatenate([sets.get(key, _NONE), *parts])
        sets[key] = distinct(members[members >= 0])
        self._names.setdefault(key, name)
        self._scopes[id(scope)] = scope

    def _listed(self, card: Card, scope: Scope, sets: dict[tuple[int, str], np.ndarray]) -> list[np.ndarray]:
        """The contents of a set's data lines: numbers, names, or first, last and step of rows of numbers."""
        parts = []
        for fields in self._model.fields(card):
            if not len(fields.counts):
                continue
            try:
                ids = fields.integers()
            except InputError:
                lines = range(len(fields.counts))
                words = [word for line in lines for word in fields.words(line)]
                parts += [self._members(word.strip('"'), scope, sets) for word in words]
                continue
            if "GENERATE" in card.options:
                ids = _generated(fields, ids, scope.known(sets is self._nodes))
            parts.append(scope.vertices_of(ids) if sets is self._nodes else scope.cells_of(ids))
        return parts

    def _members(self, name: str, scope: Scope, sets: dict[tuple[int, str], np.ndarray]) -> np.ndarray:
        head, dot, tail = name.rpartition(".")
        instance = self._model.instances.get(head.strip('"').upper()) if dot else None
        if instance is not None:
            scope, name = instance, tail.strip('"')
        if name.isdecimal() and len(name) < 19 and sets is not self._facets:
            ids = np.array([int(name)])
            found = scope.vertices_of(ids) if sets is self._nodes else scope.cells_of(ids)
            return found[found >= 0]
        for place in (scope, scope.part, self._model.assembly, self._model.root):
            if place is not None and (id(place), name.upper()) in sets:
                return sets[id(place), name.upper()]
        return _NONE

    def _take_surface(self, card: Card, scope: Scope) -> None:
        """A surface of nodes is a set of nodes; one of faces, what it names as element or set, and face."""
        name, kind = card.options.get("NAME", ""), card.options.get("TYPE", "ELEMENT").upper()
        if not name or kind not in ("NODE", "ELEMENT"):
            return
        inner = self._within(card, scope)
        facets = []
        for fields in self._model.fields(card):
            for line in range(len(fields.counts)):
                words = [word.strip('"') for word in fields.words(line)]
                if not words:
                    continue
                if kind == "NODE":
                    self._add(self._nodes, name, scope, [self.nodes(words[0], inner)])
                elif len(words) > 1:
                    facets.append(self._faces(self.elements(words[0], inner), words[1].upper()))
                    self._hide(words[0], inner)
        facets = [rows for rows in facets if len(rows)]
        if facets:
            width = max(rows.shape[1] for rows in facets)
            rows = [np.pad(r, ((0, 0), (0, width - r.shape[1])), constant_values=-1) for r in facets]
            self._facets[id(scope), name.upper()] = np.concatenate(rows)
            self._names.setdefault((id(scope), name.upper()), name)
            self._scopes[id(scope)] = scope

    def _hide(self, name: str, scope: Scope) -> None:
        """Sets that Abaqus/CAE makes of elements with a face in a surface are no groups of cells."""
        for place in (scope, scope.part, self._model.assembly):
            if place is not None and name.startswith("_") and (id(place), name.upper()) in self._elements:
                self._of_faces.add((id(place), name.upper()))

    def _faces(self, cells: np.ndarray, label: str) -> np.ndarray:
        """The faces of a label (S1, S2 ... or E1, E2 ...) of some cells, (n, w); none of one without."""
        match = _FACE.fullmatch(label)
        rows, first = [], 0
        for block in self._model.blocks:
            inside = cells[(cells >= first) & (cells < first + len(block.vertices))]
            if match is not None and match[1] != "E":  # S1 and S2 of a shell are its sides
                inside = inside[~self._model.shell[inside]]
            known = CELL_TYPES[block.type]
            faces = FACES.get((known.linear or known).name, ())
            if match is not None and 0 < int(match[2]) <= len(faces):
                corners = faces[int(match[2]) - 1]
                rows.append(block.vertices[inside - first][:, corners])
            first += len(block.vertices)
        width = max((r.shape[1] for r in rows), default=2)
        padded = [np.pad(r, ((0, 0), (0, width - r.shape[1])), constant_values=-1) for r in rows]
        return np.concatenate(padded) if padded else np.empty((0, 2), dtype=np.int64)

    def _by_name(self, sets: dict[tuple[int, str], np.ndarray]) -> dict[str, np.ndarray]:
        often = [name for _, name in sets]
        named = {}
        for (scope, key), members in sets.items():
            name, owner = self._names[scope, key], self._scopes[scope].name
            named[f"{owner}.{name}" if owner and often.count(key) > 1 else name] = members
        return named


def _generated(fields: Fields, tokens: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """The entries of ``numbers`` (ascending) that are in rows given by first, last and step."""
    chosen = [_NONE]
    for first, count in zip(fields.first.tolist(), fields.counts.tolist(), strict=True):
        begin, end, step = [*tokens[first : first + count].tolist(), 0, 0][:3]
        end, step = (end if count > 1 else begin), max(step, 1)
        row = numbers[np.searchsorted(numbers, begin) : np.searchsorted(numbers, end, side="right")]
        chosen.append(row[(row - begin) % step == 0])
    return np.concatenate(chosen)


def _ranks(values: np.ndarray) -> np.ndarray:
    """Numbers from 1 in the order of ``values``, 0 for 0."""
    known = distinct(values[values > 0])
    return np.where(values > 0, np.searchsorted(known, values) + 1, 0)
