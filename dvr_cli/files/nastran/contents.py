"""The contents of a deck beyond its mesh, by kind and number."""

from __future__ import annotations

import re

import numpy as np

from dvr_cli.files.nastran.cards import Deck
from dvr_cli.files.nastran.elements import KINDS
from dvr_cli.files.nastran.holding import HOLDING

# One and several of a kind, and the cards that are of it; the first that fits counts.
_KINDS = (
    ("material", "materials", rb"MAT\w*|CREEP|TABLEM\d|TABLES1"),
    (
        "load",
        "loads",
        rb"FORCE\w*|MOMENT\w*|PLOAD\w*|[DRT]?LOAD\d?|GRAV|RFORCE|SPCD|TEMP\w*|ACCEL\d?",
    ),
    ("constraint", "constraints", rb"SPC\w*|MPC\w*|SUPORT\d?|[AB]SET\d?"),
    ("parameter", "parameters", rb"PARAM|MDLPRM|NLPARM|EIGR\w*|EIGB|EIGC|TSTEP\w*|FREQ\d?"),
    ("coordinate system", "coordinate systems", rb"CORD\w*"),
    ("rigid element", "rigid elements", rb"RB\w*|RBAR\d?|RROD|RTRPLT\d?|RJOINT|RSPLINE|RSSCON"),
    ("property", "properties", rb"P(?!LOTEL)\w*"),
    ("set", "sets", rb"SET\d?|GROUP"),
)
_LISTED = 8  # names of other cards


def beyond_mesh(deck: Deck, front: bytes) -> list[str]:
    """One line for what a deck has beyond nodes and cells; front: what stands before the bulk data."""
    counts = dict(zip(deck.names, np.bincount(deck.name, minlength=len(deck.names)).tolist(), strict=True))
    parts = []
    if any(line.strip() and not line.lstrip().startswith(b"$") for line in front.splitlines()[:-1]):
        parts.append("executive and case control")
    rest = {name: n for name, n in counts.items() if name not in KINDS and name not in (b"GRID", b"GRDSET")}
    for one, several, pattern in _KINDS:
        mine = [name for name in rest if re.fullmatch(pattern, name)]
        number = sum(rest.pop(name) for name in mine)
        parts += [f"{number} {one if number == 1 else several}"] if number else []
    springs = [name for name in rest if name in HOLDING]
    number = sum(rest.pop(name) for name in springs)
    parts += [f"{number} springs, masses and the like"] if number else []
    others = [f"{n} {name.decode('ascii', 'replace')}" for name, n in rest.items()]
    more = [f"{len(others) - _LISTED} other kinds of cards"] if len(others) > _LISTED else []
    parts += [*others[:_LISTED], *more]
    return [f"not kept: {', '.join(parts)}"] if parts else []
