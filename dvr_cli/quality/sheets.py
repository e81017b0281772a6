"""Sheets: single layers of flat cells, which averages over their neighbours on both sides would hide.

A flat cell lies in a sheet when half of its facets lead to flat cells that are stretched alike, and when it
hangs together with enough cells like itself. Flat tetrahedra lie so at random, too, and make no sheets.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.facets import facets_of
from dvr_cli.mesh.mesh import Cells
from dvr_cli.mesh.orientation import connected_parts

LEAST = {"triangle": 16, "quad": 8, "hexahedron": 16, "wedge": 32, "pyramid": 16}  # cells that make a sheet
ALIKE = 0.6  # difference of two L, relative to the larger, up to which cells are stretched alike,
ALIKE_TRIANGLES = 0.15  # and of triangles, which are flat and beside each other at random more often


def able(blocks: list[Cells]) -> np.ndarray:
    """(n,) bool: the cells of types that make sheets."""
    return _of_each(blocks, [block.type in LEAST for block in blocks]) > 0.0


def in_sheets(blocks: list[Cells], flat: np.ndarray, stretching: np.ndarray) -> np.ndarray:
    """(n,) bool: the cells of ``blocks`` that lie in a sheet, and the flat cells joined to these.

    flat: (n,) bool, cells that may, of types that are ``able``. stretching: (n, k) L of each, the diagonal
    and then the upper triangle; only those of flat cells are looked at.
    """
    result = np.zeros(len(flat), dtype=bool)
    which = np.flatnonzero(flat)
    start = np.cumsum([0, *(len(block.vertices) for block in blocks)])
    parts = zip(blocks, start[:-1], start[1:], strict=True)
    blocks = [Cells(block.type, block.vertices[flat[a:b]]) for block, a, b in parts if flat[a:b].any()]
    weight = _of_each(blocks, [1.0 / LEAST[block.type] for block in blocks])
    if weight.sum() < 1.0:
        return result
    facets = facets_of(blocks)
    pair = facets.start[:-1][facets.shared_by == 2]
    one, other = facets.cell[pair], facets.cell[pair + 1]
    rows = stretching[which]
    space = 2 if rows.shape[1] == 3 else 3
    rows = rows * np.where(np.arange(rows.shape[1]) < space, 1.0, np.sqrt(2.0))  # of all entries of L
    size = np.linalg.norm(rows, axis=1)
    allowed = _of_each(blocks, [ALIKE_TRIANGLES if b.type == "triangle" else ALIKE for b in blocks])
    apart = np.linalg.norm(rows[one] - rows[other], axis=1)
    alike = apart <= np.minimum(allowed[one], allowed[other]) * np.maximum(size[one], size[other])
    one, other = one[alike], other[alike]
    joined = np.bincount(one, minlength=len(which)) + np.bincount(other, minlength=len(which))
    inside = 2 * joined >= _of_each(blocks, [len(CELL_TYPES[b.type].facets) for b in blocks])
    both = inside[one] & inside[other]
    part = connected_parts(len(which), one[both], other[both])
    enough = np.bincount(part, np.where(inside, weight, 0.0), len(which)) >= 1.0
    inside &= enough[part]
    result[which[inside]] = True
    result[which[other[inside[one]]]] = result[which[one[inside[other]]]] = True
    return result


def _of_each(blocks: list[Cells], values: list[float]) -> np.ndarray:
    """(n,) the value of each cell's block."""
    return np.repeat(np.array(values, dtype=np.float64), [len(block.vertices) for block in blocks])
