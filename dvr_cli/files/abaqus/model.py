"""The mesh of a deck: nodes and elements by part, each part with numbers of its own."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.abaqus.cards import Card, Deck
from dvr_cli.files.abaqus.fields import Fields
from dvr_cli.files.abaqus.nodes import NodeRows, read_nodes
from dvr_cli.files.abaqus.types import NODE_ORDER, ElementType, element_type, variable_type
from dvr_cli.files.numbers_in_text import shown
from dvr_cli.files.tags import TagIndex, first_repeated
from dvr_cli.mesh.mesh import Cells
from dvr_cli.mesh.ranks import distinct

# Keywords whose nodes or elements are nowhere in the deck as such.
_CLOSED = ("PART", "INSTANCE", "ASSEMBLY")  # what ends with a keyword of its own
_REFUSED = {
    "NGEN": "generated nodes",
    "NFILL": "generated nodes",
    "NCOPY": "copied nodes",
    "NMAP": "nodes mapped from one coordinate system to another",
    "ELGEN": "generated elements",
    "ELCOPY": "copied elements",
    "IMPORT": "a mesh from the results of another analysis",
    "KEYWORD": "LS-DYNA's keyword format",
}
_SYSTEMS = {"C": "cylindrical", "S": "spherical"}


@dataclass
class Scope:
    """A scope in which numbers and names of sets are unique: a part, an instance, the assembly, or the rest.

    name: of the part or instance, as the deck writes it; "" for the rest.
    part: of an instance the part it is of, whose nodes and elements it has, too.
    index: finds the position of a node number in ``vertices``, the vertices of the mesh.
    element_index: finds the position of an element number in ``cells``, the cells of the mesh.
    """

    name: str
    part: Scope | None = None
    nodes: list[NodeRows] = field(default_factory=list)
    index: TagIndex = field(default_factory=lambda: TagIndex(np.empty(0, dtype=np.int64)))
    vertices: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    numbers: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    element_index: TagIndex = field(default_factory=lambda: TagIndex(np.empty(0, dtype=np.int64)))
    cells: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    element_numbers: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def known(self, nodes: bool) -> np.ndarray:
        """The numbers of nodes, or of elements, ascending."""
        own = np.sort(self.numbers if nodes else self.element_numbers)
        return own if self.part is None else np.union1d(own, self.part.known(nodes))

    def vertices_of(self, ids: np.ndarray) -> np.ndarray:
        """The vertices with these node numbers (any shape), -1 for a number that is not given to any."""
        found = _found(self.index, self.vertices, ids)
        return found if self.part is None else np.where(found < 0, self.part.vertices_of(ids), found)

    def cells_of(self, ids: np.ndarray) -> np.ndarray:
        """The cells with these element numbers, -1 for a number that no cell has."""
        found = _found(self.element_index, self.cells, ids)
        return found if self.part is None else np.where(found < 0, self.part.cells_of(ids), found)


def _found(index: TagIndex, items: np.ndarray, ids: np.ndarray) -> np.ndarray:
    """The ``items`` at the positions of ``ids`` (any shape) in the index, -1 for an id that is not in it."""
    if not len(items):
        return np.full(np.shape(ids), -1)
    at = index.find(np.clip(ids, 0, None))
    return np.where(at < 0, -1, items[at])


@dataclass
class Elements:
    """The elements of one *ELEMENT card, or of some of its lines.

    type: what they are as cells. nodes: (n, k) vertices, in meshio's order. ids: (n,) their numbers.
    """

    card: int
    scope: Scope
    type: ElementType
    ids: np.ndarray
    nodes: np.ndarray


class Model:
    """Nodes and cells of a deck, put together.

    scopes: of each card. points: (N, 2 or 3). rows: where in the files the coordinates stand, and the
    vertex of each row. blocks: the cells, one block a type. card: (n,) the *ELEMENT card of each cell;
    shell: (n,) bool, whether its type is a shell or membrane. joined: vertices that elements without a shape
    here join. shapeless: the types of these, with the number of their elements.
    """

    def __init__(self, deck: Deck) -> None:
        """Raises InputError for what is damaged or cannot be read rightly."""
        self.deck = deck
        self.instances: dict[str, Scope] = {}
        self._named: dict[tuple[str, str], Scope] = {}
        self.root = self._scope("", "")
        self.assembly = self._scope("assembly", "")
        self.scopes = self._scopes_of_cards()
        self.shapeless: dict[str, int] = {}
        self._joined: list[np.ndarray] = []
        self._read_nodes()
        self._read_elements()
        self._check_end()

    @property
    def joined(self) -> np.ndarray:
        return np.concatenate([np.empty(0, dtype=np.int64), *self._joined])

    def fields(self, card: Card) -> list[Fields]:
        """The data lines of a card, one object for each file or stretch they are in."""
        return [
            Fields(
                self.deck.files[piece.file].text,
                piece.begin,
                piece.end,
                partial(self.deck.place, piece.file),
            )
            for piece in card.data
        ]

    def node_ids(self, card: Card) -> list[np.ndarray]:
        """The numbers of the nodes in a *NODE card."""
        return self._ids.get(id(card), [])

    def place(self, card: Card) -> str:
        """Words for where a card stands."""
        return self.deck.place(card.line.file, card.line.begin)

    def _scope(self, kind: str, name: str) -> Scope:
        return self._named.setdefault((kind, name.upper()), Scope(name))

    def _check_end(self) -> None:
        """Raise InputError for a deck that breaks off in a part, an instance or the assembly."""
        unclosed: list[Card] = []
        for card in self.deck.cards:
            if card.keyword in _CLOSED:
                unclosed.append(card)
            elif unclosed and card.keyword == f"END{unclosed[-1].keyword}":
                unclosed.pop()
        if unclosed:
            card = unclosed[-1]
            raise InputError(f"{self.place(card)}: *{card.keyword} has no *END {card.keyword}: truncated")

    def _scopes_of_cards(self) -> list[Scope]:
        scopes, now, outer = [], self.root, self.root
        system = False
        for card in self.deck.cards:
            if card.keyword == "PART":
                now = self._scope("part", card.options.get("NAME", ""))
            elif card.keyword == "ASSEMBLY":
                now = outer = self.assembly
            elif card.keyword == "INSTANCE":
                name = card.options.get("NAME", "")
                now = self._scope("instance", name)
                now.part = self._named.get(("part", card.options.get("PART", "").upper()))
                self.instances[name.upper()] = now
            scopes.append(now)
            if card.keyword == "ENDINSTANCE":
                now = outer
            elif card.keyword in ("ENDPART", "ENDASSEMBLY"):
                now = outer = self.root
            if card.keyword in _REFUSED:
                raise InputError(
                    f"{self.place(card)}: *{card.keyword}: {_REFUSED[card.keyword]} are not supported"
                    if card.keyword not in ("IMPORT", "KEYWORD")
                    else f"{self.place(card)}: *{card.keyword}: {_REFUSED[card.keyword]} is not supported"
                )
            if card.keyword == "SYSTEM":
                system = any(len(fields.starts) for fields in self.fields(card))
            if card.keyword == "NODE":
                self._check_system(card, system)
        return scopes

    def _check_system(self, card: Card, system: bool) -> None:
        kind = card.options.get("SYSTEM", "R").upper()
        if kind != "R":
            what = f"{_SYSTEMS.get(kind, 'other')} coordinates (SYSTEM={shown(kind)[1:-1]})"
            raise InputError(f"{self.place(card)}: *NODE in {what}, which are not supported")
        if system:
            raise InputError(f"{self.place(card)}: *NODE in a local system (*SYSTEM), which is not supported")

    def _read_nodes(self) -> None:
        """All *NODE cards: a vertex for each number, in the order of the deck."""
        columns = 2
        owners: dict[int, Scope] = {}
        self._ids: dict[int, list[np.ndarray]] = {}
        for card, scope in zip(self.deck.cards, self.scopes, strict=True):
            if card.keyword != "NODE":
                continue
            for piece, fields in zip(card.data, self.fields(card), strict=True):
                if not len(fields.counts):
                    continue
                rows = read_nodes(fields, self.deck.files[piece.file].text, piece.file)
                columns = max(columns, 3 - int(rows.absent[:, 2].all()))
                scope.nodes.append(rows)
                owners[id(scope)] = scope
                self._ids.setdefault(id(card), []).append(rows.ids)
        self.rows: list[tuple[NodeRows, np.ndarray]] = []
        points = [np.empty((0, 3))]
        total = 0
        for scope in owners.values():
            ids = np.concatenate([rows.ids for rows in scope.nodes])
            xyz = np.concatenate([rows.points for rows in scope.nodes])
            vertex, first = _numbered(ids)
            moved = (xyz != xyz[first][vertex]).any(axis=1)
            if moved.any():
                where = f" of {shown(scope.name)}" if scope.name else ""
                raise InputError(f"node {ids[moved][0]}{where} is defined twice, at different places")
            scope.numbers, scope.index = ids[first], TagIndex(ids[first])
            scope.vertices = np.arange(total, total + len(first))
            points.append(xyz[first])
            begin = 0
            for rows in scope.nodes:
                self.rows.append((rows, vertex[begin : begin + len(rows.ids)] + total))
                begin += len(rows.ids)
            total += len(first)
        if not total:
            raise InputError("there is no *NODE card with nodes in it: no Abaqus mesh")
        self.points = np.ascontiguousarray(np.concatenate(points)[:, :columns])

    def _read_elements(self) -> None:
        """All *ELEMENT cards: the cells of each type in one block, in the order of the deck."""
        listed: list[Elements] = []
        for number, (card, scope) in enumerate(zip(self.deck.cards, self.scopes, strict=True)):
            if card.keyword == "ELEMENT":
                for fields in self.fields(card):
                    if len(fields.counts):
                        listed += self._elements(number, card, scope, fields)
        kinds = list(dict.fromkeys(elements.type.cell for elements in listed))
        listed.sort(key=lambda elements: kinds.index(elements.type.cell))
        total = 0
        of_scope: dict[int, list[tuple[np.ndarray, int]]] = {}
        for elements in listed:
            of_scope.setdefault(id(elements.scope), []).append((elements.ids, total))
            total += len(elements.ids)
        for scope in self._named.values():
            own = of_scope.get(id(scope))
            if own is None:
                continue
            ids = np.concatenate([numbers for numbers, _ in own])
            repeated = first_repeated(ids)
            if repeated is not None:
                where = f" of {shown(scope.name)}" if scope.name else ""
                raise InputError(f"element {repeated}{where} is defined twice")
            scope.element_numbers, scope.element_index = ids, TagIndex(ids)
            scope.cells = np.concatenate([np.arange(at, at + len(numbers)) for numbers, at in own])
        self.blocks = [
            Cells(kind, np.concatenate([e.nodes for e in listed if e.type.cell == kind])) for kind in kinds
        ]
        sizes = [len(elements.ids) for elements in listed]
        self.card = np.repeat(np.array([elements.card for elements in listed], dtype=np.int64), sizes)
        self.shell = np.repeat(np.array([elements.type.shell for elements in listed], dtype=bool), sizes)

    def _elements(self, number: int, card: Card, scope: Scope, fields: Fields) -> list[Elements]:
        name = card.options.get("TYPE", "").upper()
        if not name:
            raise InputError(f"{self.place(card)}: *ELEMENT does not say its TYPE")
        known = element_type(name)
        if known is None:
            return self._open_ended(number, card, scope, fields, name)
        fields.check()
        tokens = fields.integers()
        width = known.nodes + 1
        heads = np.zeros(len(tokens) + width, dtype=bool)
        heads[fields.first] = True
        n = len(tokens) // width
        wrong = ~heads[: n * width : width]
        if wrong.any() or len(tokens) != n * width:
            begin = max(int(np.argmax(wrong)) - 1, 0) * width if wrong.any() else n * width
            line = int(np.searchsorted(fields.first, begin, side="right")) - 1
            raise InputError(
                f"{fields.place(line)}: an element {name} has {known.nodes} nodes; here are more, or fewer"
            )
        table = tokens.reshape(n, width)
        return self._shaped(number, scope, known, table[:, 0], table[:, 1:], fields)

    def _open_ended(self, number: int, card: Card, scope: Scope, fields: Fields, name: str) -> list[Elements]:
        """Elements of a type that leaves the number of nodes open: each ends with a line without a comma."""
        try:
            fields.check()
            tokens = fields.integers()
        except InputError:
            self.shapeless[name] = self.shapeless.get(name, 0) + len(fields.counts)
            self._joined += self._by_name(card, scope, fields)
            return []
        new = np.r_[True, ~fields.goes_on[:-1]]
        begins = fields.first[new]
        sizes = np.diff(begins, append=len(tokens))
        elements = []
        for size in distinct(sizes).tolist():
            table = tokens[begins[sizes == size][:, None] + np.arange(size)]
            known = variable_type(name, size - 1)
            if known is not None:
                elements += self._shaped(number, scope, known, table[:, 0], table[:, 1:], fields)
                continue
            self.shapeless[name] = self.shapeless.get(name, 0) + len(table)
            vertices = scope.vertices_of(table[:, 1:])
            self._joined.append(vertices[vertices >= 0])
        return elements

    def _by_name(self, card: Card, scope: Scope, fields: Fields) -> list[np.ndarray]:
        """The vertices in lines that name nodes as INSTANCE.NUMBER."""
        found = []
        for line in range(len(fields.counts)):
            for word in fields.words(line)[1:]:
                instance, _, digits = word.rpartition(".")
                owner = self.instances.get(instance.strip('"').upper(), scope) if instance else scope
                if digits.isdecimal() and len(digits) < 19:
                    vertex = owner.vertices_of(np.array([int(digits)]))
                    found.append(vertex[vertex >= 0])
        return found

    def _shaped(
        self,
        number: int,
        scope: Scope,
        known: ElementType,
        ids: np.ndarray,
        nodes: np.ndarray,
        fields: Fields,
    ) -> list[Elements]:
        """Elements as cells; those that name a node twice (collapsed ones) are left out, their nodes held."""
        vertices = scope.vertices_of(nodes)
        missing = vertices < 0
        if missing.any():
            row = int(np.argmax(missing.any(axis=1)))
            raise InputError(
                f"element {ids[row]} names node {nodes[missing][0]}, which is not defined"
                + f" in {shown(scope.name)}" * bool(scope.name)
                + f" ({fields.place(0)})"
            )
        if (ids <= 0).any():
            raise InputError(f"{fields.place(0)}: element number {ids[ids <= 0][0]} is not positive")
        order = NODE_ORDER.get(known.cell)
        vertices = vertices if order is None else vertices[:, order]
        collapsed = np.zeros(len(vertices), dtype=bool)
        for i in range(vertices.shape[1]):
            for j in range(i):
                collapsed |= vertices[:, i] == vertices[:, j]
        if collapsed.any():
            what = f"collapsed {known.cell}"
            self.shapeless[what] = self.shapeless.get(what, 0) + int(collapsed.sum())
            self._joined.append(vertices[collapsed].ravel())
            ids, vertices = ids[~collapsed], vertices[~collapsed]
        return [Elements(number, scope, known, ids, vertices)]


def _numbered(ids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each of ``ids`` the rank of its first occurrence among first occurrences, and where those are."""
    if first_repeated(ids) is None:
        return np.arange(len(ids)), np.arange(len(ids))
    _, first, inverse = np.unique(ids, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(first), dtype=np.int64)
    rank[order] = np.arange(len(first))
    return rank[inverse], first[order]
