"""Element cards: which cells they are. Node orders are turned into meshio's."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.nastran.cards import Deck, Fields
from dvr_cli.files.node_orders import UPRIGHT_BEFORE_UPPER
from dvr_cli.files.tags import TagIndex
from dvr_cli.mesh.mesh import Cells


class Kind(NamedTuple):
    """An element card: the number of its first field with a node, and what it is.

    shapes: cell types with the places, from there on, of their nodes in meshio's order; the fields that hold
        a node decide which of them it is. tagged: whether the field behind its id names a property.
    """

    first: int
    shapes: tuple[tuple[str, tuple[int, ...]], ...]
    tagged: bool = True


def _first(n: int) -> tuple[int, ...]:
    return tuple(range(n))


_TRIANGLE = Kind(2, (("triangle", _first(3)),))
_QUAD = Kind(2, (("quad", _first(4)),))
_TRIANGLE6 = Kind(2, (("triangle", _first(3)), ("triangle6", _first(6))))
_QUAD8 = Kind(2, (("quad", _first(4)), ("quad8", _first(8))))
_QUAD9 = Kind(2, (*_QUAD8.shapes, ("quad9", _first(9))))
_PYRAMID = Kind(2, (("pyramid", _first(5)), ("pyramid13", _first(13))))
_LINE = Kind(2, (("line", _first(2)),))

KINDS = {
    **dict.fromkeys((b"CTRIA3", b"CTRIAR", b"CTRAX3", b"CPLSTN3", b"CPLSTS3"), _TRIANGLE),
    **dict.fromkeys((b"CQUAD4", b"CQUADR", b"CSHEAR", b"CQUADX4", b"CPLSTN4", b"CPLSTS4"), _QUAD),
    **dict.fromkeys((b"CTRIA6", b"CTRIAX", b"CTRAX6", b"CPLSTN6", b"CPLSTS6"), _TRIANGLE6),
    **dict.fromkeys((b"CQUAD8", b"CQUADX8", b"CPLSTN8", b"CPLSTS8"), _QUAD8),
    **dict.fromkeys((b"CQUAD", b"CQUADX"), _QUAD9),
    b"CTRIAX6": Kind(2, (("triangle", (0, 2, 4)), ("triangle6", (0, 2, 4, 1, 3, 5)))),
    b"CTETRA": Kind(2, (("tetra", _first(4)), ("tetra10", _first(10)))),
    b"CPENTA": Kind(2, (("wedge", _first(6)), ("wedge15", UPRIGHT_BEFORE_UPPER["wedge15"]))),
    b"CHEXA": Kind(2, (("hexahedron", _first(8)), ("hexahedron20", UPRIGHT_BEFORE_UPPER["hexahedron20"]))),
    **dict.fromkeys((b"CPYRAM", b"CPYRA"), _PYRAMID),
    **dict.fromkeys((b"CBAR", b"CBEAM", b"CROD", b"CTUBE", b"CVISC", b"CBEND"), _LINE),
    b"CBEAM3": Kind(2, (("line", _first(2)), ("line3", _first(3)))),
    b"CONROD": Kind(1, _LINE.shapes, tagged=False),
    b"PLOTEL": Kind(1, _LINE.shapes, tagged=False),
}


_PROPERTY = re.compile(rb"P(?!ARAM|LOAD|LOTEL)\w+")


class Elements(NamedTuple):
    """Blocks of cells, with the number of the property of each cell, 0 for none."""

    blocks: list[Cells]
    properties: list[np.ndarray]


def read_elements(deck: Deck, grids: TagIndex) -> Elements:
    """The elements of a deck, a block for each kind of card and cell, in the order in which they begin.

    grids: finds the place of a node by its number. Raises InputError.
    """
    found = []
    defined = _properties(deck)
    for name in deck.names:
        if name in KINDS:
            found += _cells(deck, name, KINDS[name], grids, defined)
    found.sort(key=lambda block: block[0])
    blocks = [Cells(cell_type, vertices) for _, cell_type, vertices, _ in found]
    properties = [tags for *_, tags in found]
    return Elements(blocks, properties)


def _properties(deck: Deck) -> np.ndarray:
    """The numbers of the properties that the deck defines."""
    names = [name for name in deck.names if _PROPERTY.fullmatch(name)]
    return np.unique(deck.whole(deck.fields(deck.cards(*names), 0, 1)))


def _cells(
    deck: Deck, name: bytes, kind: Kind, grids: TagIndex, defined: np.ndarray
) -> list[tuple[int, str, np.ndarray, np.ndarray]]:
    """For each cell type among the cards of one name: its first card, the type, vertices and properties."""
    cards = deck.cards(name)
    last = kind.first + 1 + max(max(places) for _, places in kind.shapes)
    table = np.zeros((len(cards), last), dtype=np.int64)
    for rows, fields in by_length(deck, cards, last):
        table[rows, : fields.line.shape[1]] = deck.integers(fields)
    nodes = table[:, kind.first :]
    properties = table[:, 1] if kind.tagged else np.zeros(len(cards), dtype=np.int64)
    if kind.tagged:  # by default it has the number of the element, if there is such a property
        own = np.where(np.isin(table[:, 0], defined), table[:, 0], 0)
        properties = np.where(properties == 0, own, properties)
    given = nodes != 0
    blocks = []
    unknown = np.ones(len(cards), dtype=bool)
    for cell_type, places in kind.shapes:
        mine = given[:, places].all(axis=1) & (given.sum(axis=1) == len(places))
        unknown &= ~mine
        if mine.any():
            rows = np.flatnonzero(mine)
            named = nodes[rows][:, places]
            vertices = grids.find(named)
            if (vertices < 0).any():
                row, column = np.argwhere(vertices < 0)[0]
                line = int(deck.first[cards[rows[row]]])
                deck.refuse(line, f"{_title(name)} names node {named[row, column]}, which no GRID defines")
            blocks.append((int(cards[rows[0]]), cell_type, vertices.astype(np.int64), properties[rows]))
    if unknown.any():
        row = int(unknown.argmax())
        fewest = kind.shapes[0][1]
        why = "has only some of its mid nodes" if given[row, fewest].all() else "has too few nodes"
        deck.refuse(
            int(deck.first[cards[row]]), f"{_title(name)} {table[row, 0]} {why}, which is not supported"
        )
    return blocks


def by_length(deck: Deck, cards: np.ndarray, last: int | None) -> list[tuple[np.ndarray, Fields]]:
    """The fields of some cards, up to number ``last``: the rows with each number of lines, their fields."""
    lengths = deck.count[cards]
    result = []
    for length in np.unique(lengths).tolist():
        rows = np.flatnonzero(lengths == length)
        most = 8 * length if last is None else min(last, 8 * length)
        stripped = last is None or deck.has_commas(cards[rows])
        result.append((rows, deck.fields(cards[rows], 0, most, stripped)))
    return result


def _title(name: bytes) -> str:
    return name.decode("ascii", "replace")


def check_supported(deck: Deck) -> None:
    """Raise InputError for a deck without elements that are cells."""
    if not any(name in KINDS for name in deck.names):
        raise InputError("it has no elements, or only such that are no cells")
