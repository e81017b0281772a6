"""Sheets: single layers of flat cells, which averages over their neighbours on both sides would hide.

A flat cell lies in a sheet when half of its facets lead to flat cells that are stretched alike, and when it
hangs together with enough cells like itself. Flat tetrahedra lie so at random, too, and make no sheets.

A flat cell is *orderly* when half of its facets lead to flat cells of about its size. Those of layers are, in
rows and from row to row. Flat cells along the hull of random points are not: what is left between a straight
hull and the points next to it has all sizes, however many points there are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.facets import facets_of
from dvr_cli.mesh.mesh import Cells
from dvr_cli.mesh.orientation import connected_parts

LEAST = {"triangle": 16, "quad": 8, "hexahedron": 16, "wedge": 32, "pyramid": 16}  # cells that make a sheet
ALIKE = 0.6  # difference of two L, relative to the larger, up to which cells are stretched alike,
ALIKE_TRIANGLES = 0.15  # and of triangles, which are flat and beside each other at random more often
LOG_SIZE = 0.5  # difference of the logarithms of two sizes up to which they are about the same


def able(blocks: list[Cells]) -> np.ndarray:
    """(n,) bool: the cells of types that make sheets."""
    return _of_each(blocks, [block.type in LEAST for block in blocks]) > 0.0


def joined(blocks: list[Cells], possible: np.ndarray, backend: Backend) -> np.ndarray:
    """(n,) bool: the cells of ``blocks`` that would lie in a sheet, or be joined to one, were those that are
    ``possible`` ((n,) bool, of types that are ``able``) all flat and stretched alike.
    """
    which, blocks = _only(blocks, possible)
    return _marked(len(possible), which, _sheets(blocks, *_neighbours(blocks, backend)))


def in_sheets(blocks: list[Cells], flat: np.ndarray, stretching: np.ndarray) -> np.ndarray:
    """(n,) bool: the cells of ``blocks`` that lie in a sheet, and the flat cells joined to these.

    flat: (n,) bool, cells that may, of types that are ``able``. stretching: (n, k) L of each, the diagonal
    and then the upper triangle; only those of flat cells are looked at.
    """
    which, blocks = _only(blocks, flat)
    return _marked(len(flat), which, _sheets(blocks, *_alike(blocks, stretching[which])))


class Inside(NamedTuple):
    """The cells that lie inside sheets, if there are enough that hang together.

    cells: (m,) their numbers. weight: (m,) the part of a sheet that each is: whole sheets add up to one at
    least. alike: (j, 2) all cells, inside or not, that share a facet and are stretched alike; those inside
    hang together by these.
    """

    cells: np.ndarray
    weight: np.ndarray
    alike: np.ndarray


def inside_sheets(blocks: list[Cells], flat: np.ndarray, stretching: np.ndarray) -> Inside:
    """The cells of ``blocks`` inside what may be sheets; flat, stretching: as for ``in_sheets``."""
    which, blocks = _only(blocks, flat)
    one, other = _alike(blocks, stretching[which])
    inside = _half_of_facets(blocks, one, other)
    return Inside(which[inside], _weight(blocks)[inside], np.stack([which[one], which[other]], axis=1))


def _alike(blocks: list[Cells], rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pairs of cells that share a facet and are stretched alike; rows: (n, k) L of each cell."""
    one, other = _neighbours(blocks)
    space = 2 if rows.shape[1] == 3 else 3
    rows = rows * np.where(np.arange(rows.shape[1]) < space, 1.0, np.sqrt(2.0))  # of all entries of L
    size = np.linalg.norm(rows, axis=1)
    allowed = _of_each(blocks, [ALIKE_TRIANGLES if b.type == "triangle" else ALIKE for b in blocks])
    apart = np.linalg.norm(rows[one] - rows[other], axis=1)
    alike = apart <= np.minimum(allowed[one], allowed[other]) * np.maximum(size[one], size[other])
    return one[alike], other[alike]


def _sheets(blocks: list[Cells], one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(n,) bool: the cells of ``blocks`` in sheets and those joined to these, by pairs stretched alike."""
    inside = _half_of_facets(blocks, one, other)
    weight = _weight(blocks)
    if weight[inside].sum() < 1.0:
        return np.zeros_like(inside)
    both = inside[one] & inside[other]
    part = connected_parts(len(inside), one[both], other[both])
    enough = np.bincount(part, np.where(inside, weight, 0.0), len(inside)) >= 1.0
    inside &= enough[part]
    result = inside.copy()
    result[other[inside[one]]] = result[one[inside[other]]] = True
    return result


def _weight(blocks: list[Cells]) -> np.ndarray:
    """(n,) the part of a sheet that each cell is: whole sheets add up to one at least, exactly."""
    return _of_each(blocks, [1.0 / LEAST[block.type] for block in blocks])


def orderly(blocks: list[Cells], flat: np.ndarray, log_size: np.ndarray) -> np.ndarray:
    """(n,) bool: the ``flat`` cells ((n,) bool) of ``blocks`` that are orderly.

    log_size: (n,) the logarithm of each cell's volume or area, up to a term common to its type.
    """
    result = np.zeros(len(flat), dtype=bool)
    which, blocks = _only(blocks, flat)
    if len(which):
        one, other = _neighbours(blocks)
        size = log_size[which]
        alike = np.abs(size[one] - size[other]) <= LOG_SIZE
        result[which] = _half_of_facets(blocks, one[alike], other[alike])
    return result


def _marked(n: int, which: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """(n,) bool: the cells ``which``, given by number, that are ``chosen`` ((m,) bool)."""
    result = np.zeros(n, dtype=bool)
    result[which[chosen]] = True
    return result


def _only(blocks: list[Cells], wanted: np.ndarray) -> tuple[np.ndarray, list[Cells]]:
    """The ``wanted`` cells ((n,) bool): their numbers, and their blocks."""
    start = np.cumsum([0, *(len(block.vertices) for block in blocks)])
    parts = zip(blocks, start[:-1], start[1:], strict=True)
    chosen = [Cells(block.type, block.vertices[wanted[a:b]]) for block, a, b in parts if wanted[a:b].any()]
    return np.flatnonzero(wanted), chosen


def _neighbours(blocks: list[Cells], backend: Backend = NUMPY) -> tuple[np.ndarray, np.ndarray]:
    """The pairs of cells that share a facet, as the number of the one and that of the other.

    backend: what computes; the pairs are the same, in an order of its own.
    """
    facets = facets_of(blocks, backend)
    pair = facets.start[:-1][facets.shared_by == 2]
    return facets.cell[pair], facets.cell[pair + 1]


def _half_of_facets(blocks: list[Cells], one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(n,) bool: the cells that are in as many of these pairs as half of their facets, or more."""
    facets = _of_each(blocks, [len(CELL_TYPES[block.type].facets) for block in blocks])
    n = len(facets)
    return 2 * (np.bincount(one, minlength=n) + np.bincount(other, minlength=n)) >= facets


def _of_each(blocks: list[Cells], values: list[float]) -> np.ndarray:
    """(n,) the value of each cell's block."""
    return np.repeat(np.array(values, dtype=np.float64), [len(block.vertices) for block in blocks])
