"""Coherent stretching: cells drawn out alike with their neighbours, as in boundary layers, are found.

With A = E W⁻¹ of a corner, L = -dev ln(A Aᵀ) (dev: the trace removed) says how and by how much it is
stretched, and α(L) = exp((λmax - λmin) / 2) is its aspect, λ the eigenvalues. Averages of L over cells, from
these to vertices and back, cancel for random slivers and do not for layers. Cells where three such averages
still have an aspect of SEED are deliberate, where most flat cells around them are orderly, and so are single
sheets of such cells (``sheets``); from there they spread through common vertices as long as two averages have
an aspect of GROWN.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dvr_cli.backend import NUMPY
from dvr_cli.mesh.corners import Corners, ShapeTable
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.neighbours import within_rings
from dvr_cli.mesh.orientation import connected_parts
from dvr_cli.mesh.simplex import chunks
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.targets import FORMED, Targets

if TYPE_CHECKING:
    from dvr_cli.quality.sheets import Inside

SEED = 5.0  # aspect from which stretching is deliberate, averaged three times
GROWN = 1.5  # aspect down to which it spreads, averaged twice
LIKELY = 4.75  # aspect from which a rough estimate leaves a cell among those that may be seeds
KEPT = 2.0  # aspect from which a cell is kept, its own and that averaged twice
ORDERLY = 0.8  # share of the flat cells around, averaged three times, that are orderly where a seed counts
REACH = 4  # rings around a cell that it depends on whether it is a seed: three averages, and neighbours there
_FEWEST = 8  # cells of any type that make a sheet


def coherent(domain: Domain, quality: np.ndarray | None = None) -> Targets | None:
    """The cells whose stretching is coherent, as targets; None where there are none.

    Their vertices are held, but for those of inverted and nearly degenerate cells, which are not kept.
    quality: (C,) of the domain's corners, if it is known.
    """
    if domain.is_surface:  # what is compiled here is for planar and volume meshes
        domain = replace(domain, backend=NUMPY)
    if quality is None:
        quality = corner_qualities(domain.points, domain.corners, domain.backend)
    positive, possible = _shaped(domain, quality)
    if not possible.any():
        return None
    cells = _Cells(domain)
    seeds = _seeds(domain, cells, quality, positive, possible)
    sheets = _in_sheets(domain, cells, possible)
    if not len(seeds) and not sheets.any():
        return None
    seeds = np.concatenate([seeds, np.flatnonzero(sheets)])
    aspects = aspects_of(domain, quality)
    kept = cells.grown(seeds, aspects.spreads) & aspects.lasting | sheets
    if not kept.any():
        return None
    held = held_by(domain, kept, quality)
    return Targets(kept, held, float(np.exp(aspects.log_aspect[kept].max())))


class Aspects(NamedTuple):
    """The stretching of cells: (n,) ln of their own aspect.

    spreads: (n,) bool, those through which what is kept spreads, and lasting: those that are kept if it
    reaches them.
    """

    log_aspect: np.ndarray
    spreads: np.ndarray
    lasting: np.ndarray


def aspects_of(domain: Domain, quality: np.ndarray) -> Aspects:
    """The aspects of the cells of a domain; they depend on cells within two steps.

    quality: (C,) of its corners.
    """
    cells, (positive, _) = _Cells(domain), _shaped(domain, quality)
    stretching = cells.from_corners(_stretching(domain.points, domain.corners, positive))
    averaged, own = _log_aspect(cells.averaged(cells.averaged(stretching))), _log_aspect(stretching)
    lasting = positive & (np.minimum(averaged, own) >= np.log(KEPT))
    return Aspects(own, averaged >= np.log(GROWN), lasting)


def held_by(domain: Domain, kept: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """(N,) bool: the vertices that stay for the sake of the ``kept`` cells ((n,) bool).

    quality: (C,) of the corners.
    """
    cells, (positive, _) = _Cells(domain), _shaped(domain, quality)
    return cells.with_vertices(kept) & ~cells.with_vertices(~positive)


def stretched_among(domain: Domain, among: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """(N,) bool: the vertices within two rings of which there may be seeds.

    among: (N,) bool, those that are asked about. domain: all cells of these. quality: (C,) of its corners.
    The third average in a cell is one of those at vertices so near. So where parts of a mesh find none, and
    have all its vertices among them, it has no seed.
    """
    corners = domain.corners
    parts = corners.vertices, corners.shapes, corners.start, roots(corners.table)
    positive, _ = _shaped(domain, quality)
    return domain.backend.twin(stretched_vertices)(domain.points, *parts, quality, positive, among)


def seeds_near(domain: Domain, stretched: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """The seeds of what is kept, by number, within two rings of ``stretched`` vertices ((N,) bool).

    domain: all cells that these lead to in 3 + REACH steps. quality: (C,) of its corners.
    """
    reached = within_rings([block.vertices for block in domain.cells], stretched, 2)
    corners = domain.corners
    among = corners.by_cell(np.logical_or, corners.with_vertex_in(reached))
    return seeds_among(domain, among, quality)


def has_flat(domain: Domain, quality: np.ndarray) -> bool:
    """True if there are flat cells of types that make sheets; quality: (C,) of the corners."""
    return _flat(domain, quality) is not None


def seeds_among(domain: Domain, among: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """The seeds of what is kept, by number, of the cells marked in ``among`` ((n,) bool).

    domain: these, and all that can be reached from them in REACH steps between cells with a common vertex.
    quality: (C,) of its corners. Without a seed and a sheet (see ``inside_sheets_of``) in the whole mesh
    nothing is kept.
    """
    positive, possible = _shaped(domain, quality)
    return _seeds(domain, _Cells(domain), quality, positive, possible, among)


def inside_sheets_of(domain: Domain, quality: np.ndarray) -> Inside | None:
    """The cells inside what may be sheets, for which those beside them are looked at, too.

    quality: (C,) of the corners. None if there are none; tetrahedra make no sheets.
    """
    from dvr_cli.quality.sheets import inside_sheets

    found = _flat(domain, quality)
    return None if found is None else inside_sheets(domain.cells, *found)


def _flat(domain: Domain, quality: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """(n,) bool, the flat cells of types that make sheets, and (n, k) L of these; None if there are none.

    quality: (C,) of the corners.
    """
    from dvr_cli.quality.sheets import able

    possible = able(domain.cells)
    if possible.any():
        possible &= _shaped(domain, quality)[1]
    if not possible.any():
        return None
    stretching = _Cells(domain).from_corners(_stretching(domain.points, domain.corners, possible))
    flat = possible & (_log_aspect(stretching) >= np.log(SEED))
    return (flat, stretching) if flat.any() else None


def _shaped(domain: Domain, quality: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) bool, the cells that have a shape, and those that may be flat; quality: (C,) of the corners."""
    worst = domain.corners.by_cell(np.minimum, quality)
    positive = worst > FORMED[domain.dimension]
    return positive, positive & (worst <= _best_quality(SEED, domain.dimension))


def _seeds(
    domain: Domain,
    cells: _Cells,
    quality: np.ndarray,
    positive: np.ndarray,
    possible: np.ndarray,
    among: np.ndarray | None = None,
) -> np.ndarray:
    """The cells, by number, that are stretched so much, so coherently and in such order that they are kept.

    quality: (C,) of the corners. positive: (n,) bool, the cells that have a shape; possible: those that may
    be flat. among: (n,) bool, the cells that are asked about, by default all.
    """
    corners, points = domain.corners, domain.points
    parts = corners.vertices, corners.shapes, corners.start, roots(corners.table)
    stretched = domain.backend.twin(candidates)(points, *parts, quality, positive)
    likely = np.flatnonzero(stretched if among is None else stretched & among)
    if not len(likely):
        return likely
    stretching = cells.from_corners(_stretching(points, corners, cells.around(likely) & positive))
    seeds = likely[_log_aspect(cells.thrice(stretching)[likely]) >= np.log(SEED)]
    return seeds[_in_order(domain, cells, possible, seeds)]


class _Cells:
    """The cells of a domain as neighbours of each other, through the vertices they share."""

    def __init__(self, domain: Domain) -> None:
        self._blocks, self._corners, self._n_points = domain.cells, domain.corners, len(domain.points)
        self._average = domain.backend.twin(averaged)
        self._width = np.diff(self._corners.start)

    def from_corners(self, values: np.ndarray) -> np.ndarray:
        """The mean over each cell's corners of values (C,) or (C, k)."""
        width = self._width if values.ndim == 1 else self._width[:, None]
        return self._corners.by_cell(np.add, values) / width

    def thrice(self, values: np.ndarray) -> np.ndarray:
        """Values of cells averaged three times."""
        return self.averaged(self.averaged(self.averaged(values)))

    def averaged(self, values: np.ndarray) -> np.ndarray:
        """Values of cells (n,) or (n, k), averaged to vertices and back to cells."""
        rows = values.reshape(len(values), -1)
        result = self._average(rows, self._corners.vertices, self._corners.start, self._n_points)
        return result.reshape(values.shape)

    def with_vertices(self, cells: np.ndarray) -> np.ndarray:
        """(N,) bool: the vertices of ``cells`` ((n,) bool)."""
        result = np.zeros(self._n_points, dtype=bool)
        result[self._corners.vertices[np.repeat(cells, self._width)]] = True
        return result

    def around(self, cells: np.ndarray, rings: int = 3) -> np.ndarray:
        """(n,) bool: the cells within so many rings of ``cells``, given by number.

        The third average depends on those within three.
        """
        chosen = np.zeros(len(self._width), dtype=bool)
        chosen[cells] = True
        reached = within_rings(
            [block.vertices for block in self._blocks], self.with_vertices(chosen), rings - 1
        )
        return self._corners.by_cell(np.logical_or, self._corners.with_vertex_in(reached))

    def grown(self, seeds: np.ndarray, eligible: np.ndarray) -> np.ndarray:
        """(n,) bool: the ``eligible`` cells ((n,) bool) that hang together with a seed, given by number."""
        vertices, own = self._corners.vertices, self._corners.vertices[self._corners.start[:-1], 0]
        joined = eligible.copy()
        joined[seeds] = True
        rows = vertices[np.repeat(joined, self._width)]
        tail = np.repeat(rows[:, 0], rows.shape[1] - 1)
        part = connected_parts(self._n_points, tail, rows[:, 1:].ravel())
        with_seed = np.zeros(self._n_points, dtype=bool)
        with_seed[part[own[seeds]]] = True
        return joined & with_seed[part[own]]


def _in_order(domain: Domain, cells: _Cells, possible: np.ndarray, seeds: np.ndarray) -> np.ndarray:
    """(m,) bool: of ``seeds``, given by number, those around which most flat cells are orderly.

    possible: (n,) bool, the cells that may be flat.
    """
    if not len(seeds):
        return np.zeros(0, dtype=bool)
    from dvr_cli.quality.sheets import orderly

    near = possible & cells.around(seeds, REACH)
    stretching = cells.from_corners(_stretching(domain.points, domain.corners, near))
    flat = near & (_log_aspect(stretching) >= np.log(SEED))
    size = cells.from_corners(_log_size(domain.points, domain.corners, flat))
    in_order = orderly(domain.cells, flat, size)
    share = cells.thrice(np.stack([in_order, flat], axis=1).astype(np.float64))[seeds]
    return share[:, 0] >= ORDERLY * np.maximum(share[:, 1], 1e-9)


def _in_sheets(domain: Domain, cells: _Cells, possible: np.ndarray) -> np.ndarray:
    """(n,) bool: the cells in sheets, of the ``possible`` ones ((n,) bool)."""
    none = np.zeros_like(possible)
    if np.count_nonzero(possible) < _FEWEST:
        return none
    from dvr_cli.quality.sheets import able, in_sheets, joined

    possible = possible & able(domain.cells)
    if np.count_nonzero(possible) < _FEWEST:
        return none
    possible = joined(domain.cells, possible, domain.backend)
    if not possible.any():
        return none
    stretching = cells.from_corners(_stretching(domain.points, domain.corners, possible))
    flat = none.copy()
    flat[possible] = _log_aspect(stretching[possible]) >= np.log(SEED)
    return in_sheets(domain.cells, flat, stretching) if flat.any() else none


def candidates(
    points: np.ndarray,
    vertices: np.ndarray,
    shapes: np.ndarray,
    start: np.ndarray,
    root: np.ndarray,
    quality: np.ndarray,
    positive: np.ndarray,
) -> np.ndarray:
    """(n,) bool: cells among which all seeds are; which others are there makes no difference.

    So twins may differ here. This one goes by ``quality`` (C,): no average has a larger aspect than the
    average of what each corner's quality allows. vertices, shapes, start: of Corners. root: see ``roots``.
    positive: (n,) bool, the cells that have a shape.
    """
    dimension = vertices.shape[1] - 1
    most = np.add.reduceat(largest_log_aspect(quality, dimension), start[:-1]) / np.diff(start)
    most = most[:, None]
    for _ in range(3):
        most = averaged(most, vertices, start, len(points))
    return most[:, 0] >= np.log(SEED)


def stretched_vertices(
    points: np.ndarray,
    vertices: np.ndarray,
    shapes: np.ndarray,
    start: np.ndarray,
    root: np.ndarray,
    quality: np.ndarray,
    positive: np.ndarray,
    asked: np.ndarray,
) -> np.ndarray:
    """(N,) bool: of the vertices ``asked`` ((N,) bool) all those around which the average of L has an aspect
    of SEED; which others are there makes no difference.

    So twins may differ here, too. The other arguments are those of ``candidates``.
    """
    most = np.add.reduceat(largest_log_aspect(quality, vertices.shape[1] - 1), start[:-1]) / np.diff(start)
    corner = np.repeat(np.where(positive, most, 0.0), np.diff(start))
    count = np.bincount(vertices.ravel(), minlength=len(points))
    total = np.bincount(vertices.ravel(), np.repeat(corner, vertices.shape[1]), len(points))
    return asked & (count > 0) & (total >= np.log(SEED) * (1.0 - 1e-9) * count)


def roots(table: ShapeTable) -> np.ndarray:
    """(S, d, d) W⁻¹ of each target of a table, up to size and rotation of W."""
    return np.linalg.cholesky(table.matrices)


def averaged(values: np.ndarray, vertices: np.ndarray, start: np.ndarray, n_points: int) -> np.ndarray:
    """(n, k) values of cells averaged to vertices and back; a vertex counts once for each corner it is in.

    vertices: (C, d+1) of the corners; start: (n + 1,) the corners of each cell.
    """
    width = np.diff(start)
    cell = np.repeat(np.arange(len(values)), width)
    count = np.zeros(n_points)
    total = np.zeros((n_points, values.shape[1]))
    for column in vertices.T:
        np.add.at(count, column, 1.0)
        np.add.at(total, column, values[cell])
    total /= np.maximum(count, 1.0)[:, None]
    result = np.zeros_like(values)
    for column in vertices.T:
        np.add.at(result, cell, total[column])
    return result / (width * vertices.shape[1])[:, None]


def _best_quality(aspect: float, dimension: int) -> float:
    """The quality that no corner of this aspect exceeds; see ``largest_log_aspect``."""
    return float((2.0 / (aspect + 1.0 / aspect)) ** (2.0 / dimension))


def largest_log_aspect(quality: np.ndarray, dimension: int) -> np.ndarray:
    """(C,) ln α of corners of this quality at most: α + 1/α ≤ 2 Q^(-d/2), equal for d = 2; 0 if inverted."""
    power = np.clip(quality, 1e-100, 1.0) ** (-dimension / 2.0)
    return np.where(quality > 0, np.arccosh(power), 0.0)


def _stretching(points: np.ndarray, corners: Corners, wanted: np.ndarray) -> np.ndarray:
    """(C, D (D+1) / 2) L of each corner of the ``wanted`` cells ((n,) bool), zero of others.

    A row is the diagonal of L and then its upper triangle.
    """
    space = points.shape[1]
    j, k = np.triu_indices(space, 1)
    result = np.zeros((len(corners.vertices), space + len(j)))
    inverse = roots(corners.table)
    rows = np.flatnonzero(np.repeat(wanted, np.diff(corners.start)))
    for chunk in chunks(len(rows)):
        here = rows[chunk]
        vertices = corners.vertices[here]
        edges = points[vertices[:, 1:]] - points[vertices[:, :1]]  # Eᵀ
        a = np.einsum("nji,njk->nik", edges, inverse[corners.shapes[here, 0]])
        if space == 2:
            tensor = _stretching_2d(np.einsum("nik,njk->nij", a, a))
        else:
            if corners.dimension == 3:  # faster than singular values
                size, vector = np.linalg.eigh(np.einsum("nik,njk->nij", a, a))
                log = -np.log(np.maximum(size, 1e-300))
            else:
                vector, size, _ = np.linalg.svd(a, full_matrices=False)
                log = -2.0 * np.log(np.maximum(size, 1e-150))
            log -= log.mean(axis=1, keepdims=True)
            tensor = np.einsum("nia,na,nja->nij", vector, log, vector)
        result[here, :space] = np.einsum("nii->ni", tensor)
        result[here, space:] = tensor[:, j, k]
    return result


def _log_size(points: np.ndarray, corners: Corners, wanted: np.ndarray) -> np.ndarray:
    """(C,) the logarithm of |det E| of each corner of the ``wanted`` cells ((n,) bool), zero of others."""
    result = np.zeros(len(corners.vertices))
    rows = np.flatnonzero(np.repeat(wanted, np.diff(corners.start)))
    vertices = corners.vertices[rows]
    edges = points[vertices[:, 1:]] - points[vertices[:, :1]]
    if corners.dimension == points.shape[1]:
        result[rows] = np.linalg.slogdet(edges)[1]
    else:
        result[rows] = np.linalg.slogdet(np.einsum("nji,nki->njk", edges, edges))[1] / 2.0
    return result


def _stretching_2d(square: np.ndarray) -> np.ndarray:
    """(n, 2, 2) L = -dev ln S of symmetric positive S (n, 2, 2), without eigenvectors.

    Scaled to a trace of 2, S has the eigenvalues 1 ± r, and dev S has ± r along the same axes, so that
    L = -dev S / r · ln((1 + r) / √det S).
    """
    scaled = square * (2.0 / (square[:, 0, 0] + square[:, 1, 1]))[:, None, None]
    across, along = scaled[:, 0, 1], (scaled[:, 0, 0] - scaled[:, 1, 1]) / 2.0
    radius = np.hypot(along, across)
    determinant = scaled[:, 0, 0] * scaled[:, 1, 1] - across * across
    log = np.log((1.0 + radius) / np.sqrt(np.maximum(determinant, 1e-300)))
    share = np.divide(-log, radius, out=np.zeros_like(log), where=radius > 0.0)
    return np.stack([along * share, across * share, across * share, -along * share], axis=1).reshape(-1, 2, 2)


def _log_aspect(stretching: np.ndarray) -> np.ndarray:
    """(n,) ln α of tensors given as by ``_stretching``."""
    n = len(stretching)
    if stretching.shape[1] == 3:
        return np.hypot((stretching[:, 0] - stretching[:, 1]) / 2.0, stretching[:, 2])
    j, k = np.triu_indices(3, 1)
    result = np.empty(n)
    for chunk in chunks(n):
        part = stretching[chunk]
        tensor = np.zeros((len(part), 3, 3))
        tensor[:, range(3), range(3)] = part[:, :3]
        tensor[:, j, k] = tensor[:, k, j] = part[:, 3:]
        value = np.linalg.eigvalsh(tensor)
        result[chunk] = (value[:, -1] - value[:, 0]) / 2.0
    return result
