"""The quality report as data: what ``dvr report quality`` and the before and after of a run say."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from dvr_cli.beside import beside
from dvr_cli.mesh.domain import Domain, domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.mean_ratio import DEGENERATE, cell_normals, corner_qualities, mean_quality, turned_over
from dvr_cli.quality.measures import measured
from dvr_cli.quality.vector import ring_minima

QUANTILES = (0.01, 0.1, 0.5)
HISTOGRAM_BINS = 20


@dataclass(frozen=True)
class Element:
    """An element that is singled out: type, id (position in the file from 0), quality, centroid."""

    cell_type: str
    cell: int
    quality: float
    centroid: list[float]


@dataclass(frozen=True, eq=False)
class Quality:
    """The qualities of one mesh. All qualities are mean ratios in [-1, 1].

    q1: worst quality that relaxation can touch (first component of the quality vector), None without
        relaxed vertices; q1_element: the first element that has it.
    fixed_cap: worst quality among corners without a relaxed vertex, None if there are none.
    inverted: how many elements are inverted, curved second-order ones by their own Jacobian; uncertain: how
        many of these may be inverted between their nodes (see ``quality.curved``). The quality of a curved
        element that is inverted is the least at its nodes, else that of its corners.
    minimum, mean, quantiles: over all elements. measures: the other measures by name, see
        ``quality.measures``, None for those that the mesh does not have. histogram: (HISTOGRAM_BINS,) element
        counts from 0 to 1, those below 0 in the first bin.
    worst: the worst elements, worst first. vector: (m,) the quality vector, ascending (paper eq. 8), and
    vertices: (m,) the relaxed vertex each component belongs to. elements: (n,) quality of each element.
    """

    q1: float | None
    q1_element: Element | None
    fixed_cap: float | None
    minimum: float
    mean: float
    quantiles: dict[float, float]
    inverted: int
    uncertain: int
    degenerate: int
    measures: dict[str, float | None]
    histogram: np.ndarray
    worst: list[Element]
    vector: np.ndarray
    vertices: np.ndarray
    elements: np.ndarray

    @property
    def is_capped(self) -> bool:
        """True if the worst element has no relaxed vertex, so that relaxing on cannot improve it."""
        return self.q1 is None or self.minimum < self.q1


def measure(
    domain: Domain,
    points: np.ndarray,
    relaxed: np.ndarray,
    worst: int = 10,
    inverted: np.ndarray | None = None,
    by_corner: np.ndarray | None = None,
    threads: int = 1,
) -> Quality:
    """The quality of a domain with coordinates ``points`` (given as its mesh gives them).

    relaxed: (m,) indices of the relaxed vertices. worst: how many of the worst elements to list. inverted:
    (C,) bool, the corners of a surface that are turned over; by default those that are in their own cell.
    by_corner: (C,) the quality of each corner, where it is known. threads: how many to use at most.
    """
    flat = domain.flatten(points)
    others = beside(threads, partial(measured, domain, flat))
    corners = domain.corners
    if by_corner is None:
        by_corner = _by_corner(domain, flat, inverted)
    elements = corners.by_cell(np.minimum, by_corner)
    bad, unclear = _curved(domain, points, elements)
    turned = elements < -DEGENERATE
    turned[bad] = True
    moves = np.zeros(len(points), dtype=bool)
    moves[relaxed] = True
    touched = corners.with_vertex_in(moves)
    minima = ring_minima(by_corner, corners, len(points), domain.backend)[relaxed]
    order = np.lexsort((relaxed, minima))
    ascending = np.sort(elements)
    return Quality(
        q1=float(minima.min()) if len(relaxed) else None,
        q1_element=_q1_element(domain, points, by_corner, touched, elements),
        fixed_cap=_fixed_cap(domain, by_corner, touched, elements, bad),
        minimum=float(ascending[0]),
        mean=mean_quality(elements),
        quantiles=quantiles(ascending),
        inverted=int(turned.sum()),
        uncertain=int((~turned[unclear]).sum()),
        degenerate=int(((np.abs(elements) <= DEGENERATE) & ~turned).sum()),
        measures=others(),
        histogram=histogram(ascending),
        worst=_worst(domain, points, elements, ascending[:worst]),
        vector=minima[order],
        vertices=relaxed[order],
        elements=elements,
    )


def _curved(domain: Domain, points: np.ndarray, elements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The curved elements that are inverted and those that may be; lowers their qualities in ``elements``."""
    if not domain.curved:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    from dvr_cli.quality.curved import curved_quality  # most meshes have straight cells

    curved = curved_quality(domain, points)
    bad = curved.element[curved.inverted]
    elements[bad] = np.minimum(elements[bad], curved.quality[curved.inverted])
    return bad, curved.element[curved.uncertain]


def _fixed_cap(
    domain: Domain, by_corner: np.ndarray, touched: np.ndarray, elements: np.ndarray, bad: np.ndarray
) -> float | None:
    """The worst quality without a relaxed vertex; bad: the curved elements that are inverted."""
    cap = float(by_corner[~touched].min()) if not touched.all() else None
    held = bad[~domain.corners.by_cell(np.logical_or, touched)[bad]]
    return cap if not len(held) else min(float(elements[held].min()), cap if cap is not None else np.inf)


def mean_of_elements(domain: Domain, flat: np.ndarray) -> float:
    """The mean quality of the elements of a domain with coordinates ``flat`` (N, d)."""
    by_corner = _by_corner(domain, flat, None)
    return mean_quality(domain.corners.by_cell(np.minimum, by_corner))


def _by_corner(domain: Domain, flat: np.ndarray, inverted: np.ndarray | None) -> np.ndarray:
    """(C,) the quality of each corner, see ``measure``."""
    corners = domain.corners
    if domain.is_surface and inverted is None:
        inverted = turned_over(flat, corners, cell_normals(flat, corners))
    return corner_qualities(flat, corners, domain.backend, inverted)


def cell_field(mesh: Mesh, values: np.ndarray) -> list[np.ndarray]:
    """Values (n,) of the cells of a mesh's domain, one array a block; NaN for cells of lower dimension."""
    start = np.cumsum([0, *(len(block.vertices) for block in mesh.cells)])
    field = np.full(start[-1], np.nan)
    domain = domain_of(mesh, straighten=True)
    field[domain.cell_ids] = values
    field[domain.repeated[:, 0]] = field[domain.repeated[:, 1]]
    return np.split(field, start[1:-1])


def histogram(ascending: np.ndarray) -> np.ndarray:
    """(HISTOGRAM_BINS,) how many of the sorted values (n,) are in each bin, see ``Quality``."""
    edges = np.linspace(0.0, 1.0, HISTOGRAM_BINS + 1)
    return np.diff(np.searchsorted(ascending, edges[1:-1]), prepend=0, append=len(ascending))


def quantiles(ordered: np.ndarray) -> dict[float, float]:
    """Quantiles of values (n,), ordered from the worst: interpolated between the two on either side.

    np.quantile loads masked arrays, which takes a twentieth of a short report.
    """
    places, sides = quantile_places(len(ordered))
    return {q: float(np.interp(places[q], sides[q], ordered[list(sides[q])])) for q in QUANTILES}


def quantile_places(n: int) -> tuple[dict[float, float], dict[float, tuple[int, int]]]:
    """The place of each quantile of n sorted values, and the whole places on either side of that."""
    places = {q: q * (n - 1) for q in QUANTILES}
    return places, {q: (int(place), min(int(place) + 1, n - 1)) for q, place in places.items()}


def _q1_element(
    domain: Domain, points: np.ndarray, by_corner: np.ndarray, touched: np.ndarray, elements: np.ndarray
) -> Element | None:
    if not touched.any():
        return None
    corner = int(np.where(touched, by_corner, np.inf).argmin())
    cell = domain.corners.cell_of(corner)
    return element_of(domain, points, elements, cell)


def _worst(domain: Domain, points: np.ndarray, elements: np.ndarray, lowest: np.ndarray) -> list[Element]:
    """The elements with the ``lowest`` qualities (k,), equal ones by their ids."""
    candidates = np.flatnonzero(elements <= lowest.max(initial=-np.inf))
    ordered = candidates[np.argsort(elements[candidates], kind="stable")][: len(lowest)]
    return [element_of(domain, points, elements, int(cell)) for cell in ordered]


def element_of(domain: Domain, points: np.ndarray, elements: np.ndarray, cell: int) -> Element:
    """The element with number ``cell`` among those of the domain; elements: (n,) the value of each."""
    blocks = iter(domain.cells)
    block, place = next(blocks), cell
    while place >= len(block.vertices):
        place -= len(block.vertices)
        block = next(blocks)
    return Element(
        cell_type=block.type,
        cell=int(domain.cell_ids[cell]),
        quality=float(elements[cell]),
        centroid=points[block.vertices[place]].mean(axis=0).tolist(),
    )
