"""The nodes that cards beside those of cells need where they are.

Springs, masses and rigid elements, loads at nodes and constraints hold the nodes they name. Of the nodes of a
single-point constraint only those within the mesh count: what lies on its boundary is up to the options for
it. Loads or constraints of all nodes say nothing about single ones, and do not count.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.files.held import at_corners, within
from dvr_cli.files.nastran.cards import Deck, Fields
from dvr_cli.files.nastran.elements import by_length
from dvr_cli.files.tags import TagIndex
from dvr_cli.mesh.mesh import Cells

_SCALAR = (slice(2, 3), slice(4, 5))
_ALL = (slice(1, None),)
# Cards that depend on where nodes are without being cells: the fields in which they may name them. Any whole
# number there that is a node's counts, so at worst a node more than needed stays.
HOLDING = {
    **{b"%s%d" % (name, i): _SCALAR for name in (b"CELAS", b"CDAMP", b"CMASS") for i in range(1, 5)},
    b"CDAMP5": (slice(2, 4),),
    **dict.fromkeys((b"CBAR", b"CBEAM"), (slice(4, 5),)),  # the node that a section is turned to
    **dict.fromkeys((b"CBUSH", b"CGAP"), (slice(2, 5),)),
    **dict.fromkeys((b"CBUSH1D", b"CBUSH2D"), (slice(2, 4),)),
    **dict.fromkeys((b"CONM1", b"CONM2"), (slice(1, 2),)),
    **dict.fromkeys((b"RBAR", b"RBAR1", b"RROD"), (slice(1, 3),)),
    **dict.fromkeys((b"RTRPLT", b"RTRPLT1"), (slice(1, 4),)),
    b"RJOINT": (slice(1, 3),),
    b"RBE2": (slice(1, 2), slice(3, None)),
    b"RBE3": (slice(2, None),),
    **dict.fromkeys((b"RBE1", b"RSPLINE", b"RSSCON"), _ALL),
    **dict.fromkeys((b"CWELD", b"CFAST", b"CSEAM", b"GENEL", b"CHBDYG", b"CHBDYP", b"CAABSF"), _ALL),
    b"MPC": (slice(1, None, 8), slice(4, None, 8)),
    **dict.fromkeys((b"CORD1R", b"CORD1C", b"CORD1S"), (slice(1, 4), slice(5, 8))),
}
# Loads at nodes, of which those named by all cards of a name are taken together.
_LOADS = {
    **dict.fromkeys((b"FORCE", b"MOMENT", b"RFORCE"), (slice(1, 2),)),
    **dict.fromkeys((b"FORCE1", b"MOMENT1"), (slice(1, 2), slice(3, 5))),
    **dict.fromkeys((b"FORCE2", b"MOMENT2"), (slice(1, 2), slice(3, 7))),
    b"SLOAD": (slice(1, 6, 2),),
    b"DAREA": (slice(1, 8, 3),),
    b"SUPORT": (slice(0, None, 2),),
    b"SUPORT1": (slice(1, None, 2),),
    **dict.fromkeys((b"ASET", b"BSET", b"CSET"), (slice(0, None, 2),)),
    **dict.fromkeys((b"ASET1", b"BSET1", b"CSET1"), (slice(1, None),)),
}
# Single-point constraints: the fields of set and degrees of freedom, and those of nodes.
_CONSTRAINTS = {
    **dict.fromkeys((b"SPC", b"SPCD"), ((0, 2, slice(1, 2)), (0, 5, slice(4, 5)))),
    b"SPC1": ((0, 1, slice(2, None)),),
}


def held_vertices(deck: Deck, ids: np.ndarray, grids: TagIndex, blocks: list[Cells]) -> np.ndarray:
    """The vertices that stay, ascending. For a node in the middle of an edge or face its corners stay.

    ids: (N,) the number of each vertex, of which ``grids`` finds the place. blocks: the cells.
    """
    held = np.zeros(len(ids), dtype=bool)
    used = np.zeros(len(ids), dtype=bool)
    for block in blocks:
        used[block.vertices] = True
    for name in deck.names:
        held[_named(deck, name, HOLDING, ids, grids)] = True
        loaded = _named(deck, name, _LOADS, ids, grids)
        if not _all_of(loaded, used):
            held[loaded] = True
    inside = np.zeros(len(ids), dtype=bool)
    for constrained in _constrained(deck, ids, grids):
        if len(constrained) == 1:
            held[constrained] = True
        elif not _all_of(constrained, used):
            inside[constrained] = True
    if inside.any():
        held |= inside & within(blocks, inside)
    return np.flatnonzero(at_corners(blocks, held))


def _named(
    deck: Deck, name: bytes, kinds: dict[bytes, tuple[slice, ...]], ids: np.ndarray, grids: TagIndex
) -> np.ndarray:
    """The vertices that cards of a name have in the fields that ``kinds`` tells for it, ascending."""
    found = [np.empty(0, dtype=np.int64)]
    for _, fields in by_length(deck, deck.cards(name), None) if name in kinds else ():
        found += [_vertices(deck, _part(fields, part), ids, grids) for part in kinds[name]]
    return np.unique(np.concatenate(found))


def _vertices(deck: Deck, fields: Fields, ids: np.ndarray, grids: TagIndex) -> np.ndarray:
    """The vertices named in the fields: one by one, or by THRU between the first and the last."""
    numbers = deck.whole(fields)
    places = grids.find(np.maximum(numbers, 0))
    found = [places[(places >= 0) & (numbers > 0)].astype(np.int64)]
    thru = deck.says(fields, b"THRU")
    for row, column in np.argwhere(thru[:, 1:-1]):
        first, last = numbers[row, [column, column + 2]]
        found.append(np.flatnonzero((ids >= first) & (ids <= last)) if first > 0 else found[0][:0])
    return np.concatenate(found)


def _constrained(deck: Deck, ids: np.ndarray, grids: TagIndex) -> list[np.ndarray]:
    """The vertices of each constraint: those of one set, and with the same degrees of freedom."""
    found: dict[tuple[int, ...], list[np.ndarray]] = {}
    for name in deck.names:
        for _, fields in by_length(deck, deck.cards(name), None) if name in _CONSTRAINTS else ():
            for of_set, freedom, nodes in _CONSTRAINTS[name]:
                keys = deck.whole(_part(fields, np.array([of_set, freedom])))
                distinct, group = np.unique(keys, axis=0, return_inverse=True)
                for number, key in enumerate(distinct.tolist()):
                    mine = Fields(*(array[group.ravel() == number] for array in _part(fields, nodes)))
                    found.setdefault(tuple(key), []).append(_vertices(deck, mine, ids, grids))
    permanent = deck.whole(deck.fields(deck.cards(b"GRID"), 6, 7)).ravel()
    for freedom in np.unique(permanent[permanent > 0]).tolist():
        found.setdefault((freedom,), []).append(np.flatnonzero(permanent == freedom))
    return [np.unique(np.concatenate(parts)) for parts in found.values()]


def _part(fields: Fields, columns: slice | np.ndarray) -> Fields:
    return Fields(*(array[:, columns] for array in fields))


def _all_of(vertices: np.ndarray, used: np.ndarray) -> bool:
    """True if there is no other vertex with a cell."""
    others = used.copy()
    others[vertices] = False
    return len(vertices) > 1 and not others.any()
