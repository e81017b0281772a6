"""Limits of a relaxed mesh: the reason why its worst element is no better, and what would help.

The reasons, in the order in which they are looked for:

valence     the number of elements around a vertex or an edge, at the worst elements, allows little more
            than the worst quality, wherever the vertices move (see ``quality.fans``)
tangled     the element is inverted, and nobody has tried to untangle it
curved      a second-order element is inverted by its curved shape, not by its vertices
selection   --fix, --only, --below or --vertices keeps a vertex that could move
boundary    another treatment of the boundary would free a vertex
shape       vertices lie on features of a curved boundary or surface, or at the bound on its deviation
fixed-cap   all vertices are held
balance     none of these: what moving a vertex would gain here is lost in another element
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dvr_cli.mesh.corners import SHAPES
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.ranks import distinct
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.measure import Element, Quality

REACHED = 0.9  # share of what a valence allows from which on it counts as what limits,
SEVERE = 0.95  # if it allows less than this
FAIR = 0.5  # worst quality from which on a mesh is as good as solvers need it
_REMESH = "only other elements help: remesh there"


@dataclass(frozen=True)
class Limit:
    """The reason why the worst element of a mesh is no better.

    kind: "valence", "tangled", "curved", "selection", "boundary", "shape", "fixed-cap" or "balance".
    element: the worst one.
    vertex: one that is the reason, None if none in particular is. text: the reason in words.
    advice: what would help, in words. keeps: what of the mesh's shape that would keep, or nothing.
    """

    kind: str
    vertex: int | None
    element: Element
    text: str
    advice: str
    keeps: str = ""


class HeldBy(NamedTuple):
    """The reasons for which vertices may be held.

    selection: for each option that selects, the vertices that could move and that it keeps, (N,) bool.
    boundary: for each option that would free vertices of the boundary a function that says of (m,) vertices
    which could move then, (m,) bool, and what keeps its shape, in words. shape: says of (m,) vertices how the
    shape of a curved boundary or surface holds them, and what would free them; None where there is none.
    """

    selection: Mapping[str, np.ndarray]
    boundary: Mapping[str, tuple[Callable[[np.ndarray], np.ndarray], str]]
    shape: Callable[[np.ndarray], tuple[str, str] | None] | None = None


def limit_of(
    domain: Domain,
    points: np.ndarray,
    relaxed: np.ndarray,
    quality: Quality,
    held_by: HeldBy,
    untangling_helps: bool = False,
    names: np.ndarray | None = None,
) -> Limit:
    """The limit of the mesh with coordinates ``points`` (as its mesh gives them) and this quality.

    relaxed: (m,) the relaxed vertices. untangling_helps: whether there are inverted elements that were not
    untangled and could be. names: (N,) what vertices are called, by default their numbers.
    """
    names = np.arange(len(points)) if names is None else names
    element = quality.worst[0]
    flat = domain.flatten(points)
    vertices, name = _worst_corner(domain, flat, element)
    moves = np.isin(vertices, relaxed)
    count = len(vertices)

    if moves.any() and element.quality > 0:
        among = distinct(np.concatenate([_vertices(domain, worst) for worst in quality.worst]))
        among = among[_ideal_all_round(domain)[among]]
        from dvr_cli.quality.fans import fans

        fan = min(fans(flat, domain.around(among).cells, among), key=lambda fan: fan.best, default=None)
        if fan is not None and fan.best < SEVERE and element.quality >= REACHED * fan.best:
            called = names[list(fan.vertices)].tolist()
            where = f"{'vertex' if len(called) == 1 else 'edge'} {'-'.join(map(str, called))}"
            text = f"{fan.n} elements meet at {where}, which allows {fan.best:.4f} at best"
            return Limit("valence", called[0], element, text, _REMESH)
    if moves.any() and element.quality <= 0 and untangling_helps:
        text = f"{element.cell_type} {element.cell} is not positive, and these directions do not make it so"
        return Limit("tangled", None, element, text, "--untangle makes positive what it can")
    if element.quality <= 0 and _corners_are_positive(domain, flat, element):
        text = f"the curved shape of {element.cell_type} {element.cell} inverts it, not its vertices"
        return Limit("curved", None, element, text, "--straighten makes it straight")
    for option, kept in held_by.selection.items():
        held = names[vertices[kept[vertices]]]
        if len(held):
            text = f"{option} keeps {len(held)} of the {count} vertices of {name}"
            return Limit("selection", int(held[0]), element, text, f"let vertex {held[0]} move, too")
    on_boundary = ~domain.interior[vertices]
    if (on_boundary & ~moves).any():
        for option, (frees, keeps) in held_by.boundary.items():
            freed = names[vertices[frees(vertices) & ~moves]]
            if len(freed):
                text = f"{name} has {on_boundary.sum()} of its {count} vertices on the boundary"
                advice = f"{option} would free {len(freed)} of them"
                return Limit("boundary", int(freed[0]), element, text, advice, keeps)
    shape = held_by.shape(vertices) if held_by.shape is not None else None
    if shape is not None:
        return Limit("shape", None, element, f"{name}: {shape[0]}", shape[1])
    if not moves.any():
        return Limit("fixed-cap", None, element, f"none of the {count} vertices of {name} can move", _REMESH)
    if element.quality <= 0:
        text = f"{name} is not positive: no place found makes all elements around so"
        return Limit("balance", None, element, text, "other directions or another seed may find one")
    text = f"what moving a vertex of {name} gains, its neighbours lose"
    advice = "a smaller --tol may gain a little; more takes other elements there"
    return Limit("balance", None, element, text, advice)


def _cell(domain: Domain, element: Element) -> int:
    """The number of an element among those of the domain."""
    return int(np.searchsorted(domain.cell_ids, element.cell))


def _vertices(domain: Domain, element: Element) -> np.ndarray:
    """The vertices of an element of the domain."""
    own = slice(*domain.corners.start[_cell(domain, element) :][:2])
    return distinct(domain.corners.vertices[own].ravel())


def _ideal_all_round(domain: Domain) -> np.ndarray:
    """(N,) bool: the vertices all of whose cells have the ideal shape as target; fans bound no other."""
    corners = domain.corners
    other = corners.shapes[:, 0] >= len(SHAPES[domain.dimension].matrices)
    other |= len(corners.table.factor) > 0
    ideal = np.ones(len(domain.points), dtype=bool)
    ideal[corners.vertices[other if corners.held is None else other | corners.held]] = False
    return ideal


def _corners_are_positive(domain: Domain, flat: np.ndarray, element: Element) -> bool:
    """True if the element taken as straight is positive."""
    own = domain.corners.part(slice(*domain.corners.start[_cell(domain, element) :][:2]))
    return bool((corner_qualities(flat, own) > 0).all())


def _worst_corner(domain: Domain, flat: np.ndarray, element: Element) -> tuple[np.ndarray, str]:
    """The vertices that the quality of an element depends on, those of its worst corner, and their owner."""
    own = domain.corners.part(slice(*domain.corners.start[_cell(domain, element) :][:2]))
    worst = corner_qualities(flat, own).argmin()
    name = f"{element.cell_type} {element.cell}"
    return own.vertices[worst], name if len(own.vertices) == 1 else f"a corner of {name}"
