"""Constraints: the facets, edges and vertices whose shape relaxation has to keep.

Facets are kept that lie on the boundary, between regions, or under a cell of one dimension less; in a volume
mesh also edges under a line cell. Facets in named sets count as such cells, one set as one tag. What a facet
belongs to - the regions on its sides, the lower cells on it and their tags, the sets that have all its
vertices - is its label: where labels change, a physical group, a region or a named part ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.backend import Backend
from dvr_cli.boundary.unconnected import coincident_vertices, hanging_vertices
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.facets import facets_of, numbered, outlines, vertices_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.named_facets import named_facets
from dvr_cli.mesh.ranks import distinct, distinct_and_ranks
from dvr_cli.mesh.region_choice import regions_of
from dvr_cli.mesh.second_order import linear_cells

ROUNDING = 32 * np.finfo(float).eps  # times the largest coordinate: what vertices in one plane may be off it
EXACT = 1e-9  # but not more than this times the size of a facet or an edge


@dataclass(frozen=True, eq=False)
class Constraints:
    """The facets, lines and vertices that have to keep their shape and place.

    facets: (F, w) vertices in positive order, shorter rows end in -1: edges of a planar mesh, faces of a
        volume mesh; seen from outside on the boundary, from the higher region on an interface.
    label: (F,) equal for facets that belong to the same.
    two_sided: (F,) bool, facets whose order means nothing, as one region is on both sides.
    lines: (L, 2) the edges of a volume mesh that lie under line cells, each once. line_label: (L,) as label.
    fixed: (N,) bool, vertices that stay for other reasons: vertex cells, periodic links, lower cells that are
        no facet or edge of the mesh, curved facets.
    hanging: (m,) vertices that hang on a facet they are not connected to; these and the facet's are fixed.
    coincident: (k,) vertices on the boundary that others lie on.
    rounding: how far rounding may have put a vertex off its plane or line.
    backend: what computes; the results are the same.
    """

    facets: np.ndarray
    label: np.ndarray
    two_sided: np.ndarray
    lines: np.ndarray
    line_label: np.ndarray
    fixed: np.ndarray
    hanging: np.ndarray
    coincident: np.ndarray
    rounding: float
    backend: Backend


def constraints_of(mesh: Mesh, domain: Domain, rounding: float | None = None) -> Constraints:
    """The constraints of a mesh and its domain.

    rounding: that of the mesh which this is a part of, in which no vertex hangs and none coincide; by default
    this is the whole.
    """
    d, n_points = domain.dimension, len(mesh.points)
    linear = linear_cells(mesh.cells)
    sides = facets_of(domain.cells, domain.backend)
    width = sides.sides.shape[1]
    sheets, wires = [], []
    fixed = np.zeros(n_points, dtype=bool)
    fixed[mesh.periodic.ravel()] = True
    fixed[domain.curved_vertices] = True
    for b, block in enumerate(linear):
        if not len(block.vertices):
            continue
        cell_type = CELL_TYPES[block.type]
        if cell_type.dimension == d - 1 and cell_type.nodes <= width:
            sheets.append(b)
        elif block.type == "line":
            wires.append(b)
        elif cell_type.dimension < d:
            fixed[block.vertices] = True

    # whichever order the facets are in, take the same one of two: that of the lower region, or the first
    first = np.minimum.reduceat(sides.order, sides.start[:-1])
    last = np.maximum.reduceat(sides.order, sides.start[:-1])
    shared = sides.shared_by
    region = np.stack([domain.region[sides.owner[first]], domain.region[sides.owner[last]]], axis=1)
    one = np.where(region[:, 1] < region[:, 0], last, first)
    seen = sides.sides[one]
    region.sort(axis=1)
    kept = (shared != 2) | (region[:, 0] != region[:, 1])

    lower, tags = _rows(linear, sheets, width), regions_of(mesh, sheets)[0]
    named, which = named_facets(mesh, d)
    count = (named >= 0).sum(axis=1)
    is_facet, is_edge = (count >= d) & (count <= width), count < d
    _fix(fixed, named[count > width])
    lower = np.concatenate([lower, _widened(named[is_facet], width)])
    tags = np.concatenate([tags, tags.max(initial=-1) + 1 + which[is_facet]])
    under = _matched(lower, seen, n_points)
    found = under >= 0
    _fix(fixed, lower[~found])
    kept[under[found]] = True
    order = np.flatnonzero(kept)
    order = order[np.argsort(one[order])]
    place = np.empty(len(seen), dtype=np.int64)
    place[order] = np.arange(len(order))
    in_set, of_set, alone = _in_point_sets(mesh, seen[order])
    fixed[alone] = True
    label = _labels(
        np.concatenate([place[under[found]], in_set]),
        np.concatenate([tags[found], tags.max(initial=-1) + 1 + of_set]),
        region[order],
    )

    lines, line_label, off = _lines(mesh, wires, named[is_edge], which[is_edge], sides.sides)
    _fix(fixed, off)

    hanging = coincident = np.empty(0, dtype=np.int64)
    if rounding is None:
        single = seen[shared == 1]
        hanging, held = hanging_vertices(domain.points, single)
        fixed[hanging] = True
        _fix(fixed, single[held])
        coincident = coincident_vertices(domain.points, vertices_of(single))
        rounding = ROUNDING * float(np.abs(mesh.points).max(initial=0.0))
    if domain.mids is not None:
        bent = domain.mids.bent(mesh.points, rounding, EXACT)
        fixed[bent[~domain.interior[bent].any(axis=1)]] = True
    return Constraints(
        facets=seen[order],
        label=label,
        two_sided=((shared == 2) & (region[:, 0] == region[:, 1]))[order],
        lines=lines,
        line_label=line_label,
        fixed=fixed,
        hanging=hanging,
        coincident=coincident,
        rounding=rounding,
        backend=domain.backend,
    )


def surface_constraints(mesh: Mesh, domain: Domain) -> Constraints:
    """The constraints of a surface in space: all its cells are facets, labelled by region."""
    linear = linear_cells(mesh.cells)
    fixed = np.zeros(len(mesh.points), dtype=bool)
    fixed[mesh.periodic.ravel()] = True
    fixed[domain.curved_vertices] = True
    for block in linear:
        if block.type == "vertex":
            fixed[block.vertices] = True
    wires = [b for b, block in enumerate(linear) if block.type == "line"]
    width = max(block.vertices.shape[1] for block in domain.cells)
    cells = [Cells(block.type, outlines(block)) for block in domain.cells]
    facets = _rows(cells, list(range(len(cells))), width)
    lines, line_label, off = _lines(mesh, wires, *named_facets(mesh, 2), facets)
    _fix(fixed, off)
    in_set, of_set, alone = _in_point_sets(mesh, facets)
    fixed[alone] = True
    return Constraints(
        facets=facets,
        label=_labels(in_set, of_set, domain.region[:, None]),
        two_sided=np.zeros(len(facets), dtype=bool),
        lines=lines,
        line_label=line_label,
        fixed=fixed,
        hanging=np.empty(0, dtype=np.int64),
        coincident=coincident_vertices(domain.points, vertices_of(facets)),
        rounding=ROUNDING * float(np.abs(mesh.points).max(initial=0.0)),
        backend=domain.backend,
    )


def edges_of(facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The edges (E, 2) of each of the facets ((F, w), shorter rows end in -1), and which facet's (E,)."""
    rows = np.arange(len(facets))
    length = (facets >= 0).sum(axis=1)
    edges, owner = [], []
    for k in range(facets.shape[1]):
        there = rows[k < length]
        edges.append(np.stack([facets[there, k], facets[there, (k + 1) % length[there]]], axis=1))
        owner.append(there)
    return np.concatenate(edges), np.concatenate(owner)


def _lines(
    mesh: Mesh, blocks: list[int], named: np.ndarray, which: np.ndarray, facets: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The edges (L, 2) of ``facets`` that lie under the line cells of these blocks or are ``named`` (n, w),
    in the set ``which`` (n,); their labels (L,); and those line cells and named edges that lie on none.
    """
    wire, tags, n_points = (
        _rows(linear_cells(mesh.cells), blocks, 2),
        regions_of(mesh, blocks)[0],
        len(mesh.points),
    )
    single = named[:, 1] < 0
    wire = np.concatenate([wire, named[~single, :2]])
    tags = np.concatenate([tags, tags.max(initial=-1) + 1 + which[~single]])
    on_wire = np.zeros(n_points + 1, dtype=bool)  # the last is for -1
    on_wire[wire] = True
    near = on_wire[facets].sum(axis=1) > 1 if len(wire) else np.zeros(len(facets), dtype=bool)
    edges, _ = edges_of(facets[near])
    under = _matched(wire, edges, n_points)
    found = under >= 0
    marked, place = np.unique(under[found], return_inverse=True)
    label = _labels(place, tags[found], np.zeros((len(marked), 1), dtype=np.int64))
    off = np.concatenate([wire[~found], named[single, :2]])
    return edges[marked], label, off


def _in_point_sets(mesh: Mesh, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The rows of ``facets`` (F, w) that have all vertices in a set of points, and the set (n,) of each; and
    the vertices of these facets (m,) that are in a set, but in no facet all of whose vertices are.
    """
    within, of_set = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    alone = np.zeros(len(mesh.points) + 1, dtype=bool)
    on_facet = np.zeros(len(mesh.points) + 1, dtype=bool)
    on_facet[facets] = True
    for i, members in enumerate(mesh.point_sets.values()):
        inside = np.zeros(len(mesh.points) + 1, dtype=bool)  # the last is for -1
        inside[members] = True
        inside[-1] = True
        rows = np.flatnonzero(inside[facets].all(axis=1))
        within.append(rows)
        of_set.append(np.full(len(rows), i))
        inside[facets[rows]] = False
        alone |= inside & on_facet
    return np.concatenate(within), np.concatenate(of_set), np.flatnonzero(alone[:-1])


def _widened(rows: np.ndarray, width: int) -> np.ndarray:
    """Rows (n, w) cut or filled with -1 to a width that all of them fit."""
    return np.pad(rows[:, :width], ((0, 0), (0, max(0, width - rows.shape[1]))), constant_values=-1)


def _fix(fixed: np.ndarray, rows: np.ndarray) -> None:
    fixed[rows[rows >= 0]] = True


def _rows(cells: list[Cells], blocks: list[int], width: int) -> np.ndarray:
    """(n, width) the vertices of these blocks, short rows filled up with -1."""
    rows = [
        np.pad(cells[b].vertices, ((0, 0), (0, width - cells[b].vertices.shape[1])), constant_values=-1)
        for b in blocks
    ]
    return np.concatenate([np.empty((0, width), dtype=np.int64), *rows])


def _matched(rows: np.ndarray, among: np.ndarray, n_points: int) -> np.ndarray:
    """(n,) the first row of ``among`` with the same vertices as each of ``rows``, -1 if there is none."""
    marked = np.zeros(n_points + 1, dtype=bool)
    marked[rows] = True
    marked[-1] = True
    near = np.flatnonzero(marked[among].all(axis=1))
    number = numbered(np.concatenate([rows, among[near]]))
    place = np.full(len(number), -1)
    place[number[len(rows) :][::-1]] = near[::-1]
    return place[number[: len(rows)]]


def _labels(under: np.ndarray, tags: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """(G,) a number for each of G facets or edges, equal for equal ``sides`` (G, k) and lower cells on it.

    under: (n,) the facet or edge under each lower cell; tags: (n,) the number of the lower cell's tags.
    """
    different, tag = distinct_and_ranks(tags)
    several = max(len(different), 1)
    facet, tag = np.divmod(distinct(under * several + tag), several)
    nth = np.arange(len(facet)) - np.searchsorted(facet, facet)
    on = np.full((len(sides), nth.max(initial=0) + 1), -1)
    on[facet, nth] = tag
    label = np.zeros(len(sides), dtype=np.int64)
    for column in (*sides.T, *on.T):
        values, index = np.unique(column, return_inverse=True)
        label = np.unique(label * len(values) + index, return_inverse=True)[1]
    return label
