"""The vertices that a deck's loads and constraints name, and that therefore have to stay where they are."""

from __future__ import annotations

import numpy as np

from dvr_cli.files.abaqus.cards import Card
from dvr_cli.files.abaqus.model import Model, Scope
from dvr_cli.files.abaqus.sets import Sets
from dvr_cli.files.held import at_corners, within

_NONE = np.empty(0, dtype=np.int64)
# Where keywords name nodes: in the first field of each line, in every field but the first ...
_FIRST = ("CLOAD", "CFLUX", "KINEMATICCOUPLING", "DISTRIBUTINGCOUPLING", "KINEMATIC", "DISTRIBUTING")
_OPTIONS = ("REFNODE", "ROTNODE", "NSET", "PINNSET", "TIENSET", "NODE")
_BY_OPTION = ("RIGIDBODY", "COUPLING", "PRE-TENSIONSECTION", "KINEMATICCOUPLING", "DISTRIBUTINGCOUPLING")


def held_vertices(model: Model, sets: Sets) -> np.ndarray:
    """The vertices that stay, ascending: those of elements without a shape here, those at which a force
    acts, those tied to others by equations, couplings and rigid bodies, and those of boundary conditions.

    Of a set with boundary conditions only the vertices within the mesh count: what lies on its boundary is
    up to the options for it. A set of all vertices says nothing about single ones, and does not count.
    For a node in the middle of an edge or face the corners of that stay.
    """
    held = np.zeros(len(model.points), dtype=bool)
    held[model.joined] = True
    used = np.zeros(len(model.points), dtype=bool)
    for block in model.blocks:
        used[block.vertices] = True
    for card, scope in zip(model.deck.cards, model.scopes, strict=True):
        for members in _named(model, sets, card, scope):
            if not _all_of(members, used, scope, model):
                held[members] = True
    inside = np.zeros(len(model.points), dtype=bool)
    for card, scope in zip(model.deck.cards, model.scopes, strict=True):
        if card.keyword == "BOUNDARY":
            for name in _column(model, card, 0):
                members = sets.nodes(name, scope)
                if len(members) == 1:
                    held[members] = True
                elif not _all_of(members, used, scope, model):
                    inside[members] = True
    if inside.any():
        held |= inside & within(model.blocks, inside)
    return np.flatnonzero(at_corners(model.blocks, held & used))


def _named(model: Model, sets: Sets, card: Card, scope: Scope) -> list[np.ndarray]:
    """The vertices that each entry of a card names."""
    names: list[str] = []
    if card.keyword in _FIRST:
        names = _column(model, card, 0)
    elif card.keyword == "MPC":
        names = [name for line in _lines(model, card) for name in line[1:]]
    elif card.keyword == "EQUATION":
        names = _terms(_lines(model, card))
    members = [sets.nodes(name, scope) for name in names]
    if card.keyword in _BY_OPTION:
        options = card.options
        members += [sets.nodes(options[key], scope) for key in _OPTIONS if key in options]
        if "ELSET" in options:
            members.append(sets.vertices_of(sets.elements(options["ELSET"], scope)))
        if "SURFACE" in options:
            members.append(sets.surface(options["SURFACE"], scope))
            members.append(sets.nodes(options["SURFACE"], scope))
    return members


def _lines(model: Model, card: Card) -> list[list[str]]:
    """The words in each data line of a card."""
    return [
        [word.strip('"') for word in fields.words(line)]
        for fields in model.fields(card)
        for line in range(len(fields.counts))
    ]


def _column(model: Model, card: Card, column: int) -> list[str]:
    return [words[column] for words in _lines(model, card) if len(words) > column]


def _terms(lines: list[list[str]]) -> list[str]:
    """The nodes in equations: a number of terms, then that many times node, direction and factor."""
    words = [word for line in lines for word in line]
    names, at = [], 0
    while at < len(words) and words[at].isdecimal():
        terms = min(int(words[at][:9]), len(words))
        names += words[at + 1 : at + 1 + 3 * terms : 3]
        at += 1 + 3 * terms
    return names


def _all_of(members: np.ndarray, used: np.ndarray, scope: Scope, model: Model) -> bool:
    """True if there is no other vertex with a cell, in the mesh or in its part."""
    others = used.copy()
    others[members] = False
    own = scope.vertices if len(scope.vertices) else np.arange(len(model.points))
    return len(members) > 1 and not others[own].any()
