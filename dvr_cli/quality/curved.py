"""Curved second-order cells, judged by the Jacobian of their own shape.

The determinant of the Jacobian of a cell is a polynomial. Written in Bernstein's basis, it is nowhere less
than its smallest coefficient: a bound from below. Its smallest value at the nodes is a bound from above. A
cell is inverted when the latter is not positive, and uncertain when only the former is not.

The shape functions of a pyramid are no polynomials of its coordinates u, v, w (base from -1 to 1, apex at
w = 1), but of r = u / (1 - w), s = v / (1 - w) and w, and so are their derivatives along u, v and w. Its
determinant is judged over the box of r, s, w. At the apex it depends on the direction: no node there counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, reduce
from itertools import product
from math import factorial, prod

import numpy as np

from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.second_order import CurvedCells
from dvr_cli.quality.mean_ratio import DEGENERATE, mean_ratio

Function = tuple[tuple[int, ...], ...]  # a sum of monomials, each given by its powers

_CHUNK = 2048  # cells whose Jacobians are in memory at a time
_ROUNDING = 1e-12  # of the largest coefficient; one that is smaller counts as zero

_REFERENCE = {
    "triangle": ((0, 0), (1, 0), (0, 1)),
    "quad": ((0, 0), (1, 0), (1, 1), (0, 1)),
    "tetra": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "hexahedron": (
        *((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)),
        *((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
    ),
    "wedge": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)),
}
# The simplices that the reference cell is the product of: dimension, and degree of the determinant along it.
_FACTORS = {
    "triangle6": ((2, 2),),
    "triangle7": ((2, 4),),
    "quad8": ((1, 3), (1, 3)),
    "quad9": ((1, 3), (1, 3)),
    "tetra10": ((3, 3),),
    "hexahedron20": ((1, 5), (1, 5), (1, 5)),
    "hexahedron27": ((1, 5), (1, 5), (1, 5)),
    "wedge15": ((2, 4), (1, 5)),
    "wedge18": ((2, 4), (1, 5)),
    "pyramid13": ((1, 5), (1, 5), (1, 3)),
    "pyramid14": ((1, 5), (1, 5), (1, 3)),
}


@dataclass(frozen=True, eq=False)
class CurvedQuality:
    """The judgement of curved cells by their own Jacobian.

    element: (n,) which elements of the domain they are. quality: (n,) the least mean ratio at their nodes.
    inverted, uncertain: (n,) bool.
    """

    element: np.ndarray
    quality: np.ndarray
    inverted: np.ndarray
    uncertain: np.ndarray


@dataclass(frozen=True, eq=False)
class _Jacobian:
    """The Jacobian of a type of cells with n nodes, in d dimensions.

    at_nodes: (p, d, n) the derivatives of the shape functions at p places, in coordinates in which the
    Jacobian of the ideal cell is the identity there.
    on_lattice: (k, d, n) those in the reference cell at as many points as the determinant has coefficients,
    and bernstein: (k, k) what makes these of its values there.
    """

    at_nodes: np.ndarray
    on_lattice: np.ndarray
    bernstein: np.ndarray


def curved_quality(domain: Domain, points: np.ndarray) -> CurvedQuality:
    """The judgement of the curved cells of a domain with coordinates ``points`` (as its mesh gives them)."""
    flat = domain.flatten(points)
    none = np.empty(0)
    parts = [(none.astype(np.int64), none, none.astype(bool), none.astype(bool))]
    for cells in domain.curved:
        for start in range(0, len(cells.vertices), _CHUNK):
            part = slice(start, start + _CHUNK)
            parts.append((cells.element[part], *_judged(flat, cells, part)))
    return CurvedQuality(*map(np.concatenate, zip(*parts, strict=True)))


def straightened(domain: Domain, points: np.ndarray) -> np.ndarray:
    """``points`` (N, D) with curved cells that are inverted made straight, their mid nodes in the middle.

    That bends no other cell, but straightening one of two curved edges may invert the cell between them:
    it is made straight, too.
    """
    result, done = points, np.zeros(len(domain.cell_ids), dtype=bool)
    while True:
        judged = curved_quality(domain, result)
        chosen = np.zeros(len(done), dtype=bool)
        chosen[judged.element[judged.inverted]] = True
        chosen &= ~done
        if not chosen.any():
            return result
        result, done = result.copy(), done | chosen
        for cells in domain.curved:
            vertices = cells.vertices[chosen[cells.element]]
            mids = CELL_TYPES[cells.type].mids
            for node, around in zip(vertices.T[-len(mids) :], mids, strict=True):
                result[node] = result[vertices[:, around]].mean(axis=1)


def _judged(flat: np.ndarray, cells: CurvedCells, part: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quality, inverted and uncertain ((n,) each) of some of the cells; flat: (N, d)."""
    jacobian, sign = _jacobian(cells.type), cells.sign[part]
    nodes = flat[cells.vertices[part]]
    entries = _entries(jacobian.at_nodes, nodes)
    dimension = len(entries)
    size = (entries * entries).sum(axis=(0, 1)) / dimension
    quality = mean_ratio(_determinant(entries) * sign, size, dimension).min(axis=0)
    inverted = quality <= DEGENERATE
    coefficients = jacobian.bernstein @ (_determinant(_entries(jacobian.on_lattice, nodes)) * sign)
    low = coefficients.min(axis=0) <= _ROUNDING * np.abs(coefficients).max(axis=0)
    return quality, inverted, low & ~inverted


def _entries(derivatives: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """(d, d, p, c) the entries of the Jacobians of c cells at p places.

    derivatives: (p, d, n) of the shape functions. nodes: (c, n, d) coordinates.
    """
    places, dimension, count = derivatives.shape
    columns = nodes.transpose(1, 2, 0).reshape(count, -1)
    result = derivatives.transpose(1, 0, 2).reshape(-1, count) @ columns
    return result.reshape(dimension, places, dimension, len(nodes)).transpose(0, 2, 1, 3)


def _determinant(entries: np.ndarray) -> np.ndarray:
    """(p, c) the determinants of matrices given by their entries (d, d, p, c)."""
    if len(entries) == 2:
        (a, b), (c, d) = entries
        return a * d - b * c
    (a, b, c), (d, e, f), (g, h, i) = entries
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


@cache
def _jacobian(name: str) -> _Jacobian:
    """The Jacobian of the second-order type called ``name``."""
    cell_type = CELL_TYPES[name]
    linear = cell_type.linear
    assert linear is not None  # curved cells are of second order
    parts = [_bernstein(dimension, degree) for dimension, degree in _FACTORS[name]]
    lattice = np.array([np.concatenate(rows) for rows in product(*(places for places, _ in parts))])
    bernstein = np.linalg.inv(reduce(np.kron, [values for _, values in parts]))
    if linear.name == "pyramid":
        return _Jacobian(*_pyramid(name, lattice), bernstein)
    corners = np.array(_REFERENCE[linear.name], dtype=np.float64)
    nodes = np.concatenate([corners, [corners[list(around)].mean(axis=0) for around in cell_type.mids]])
    target = linear.targets[0]
    ideal = np.linalg.inv(target[1:] - target[0])
    basis = _basis(name)
    shape = np.linalg.inv(_values(nodes, basis))
    return _Jacobian(
        at_nodes=ideal @ _derivatives(nodes, basis, shape),
        on_lattice=_derivatives(lattice, basis, shape),
        bernstein=bernstein,
    )


def _pyramid(name: str, lattice: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The derivatives of a pyramid's shape functions at its nodes but for the apex, and on the lattice.

    lattice: (k, 3) places in the unit cube, whose r and s are taken from -1 to 1.
    """
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1)], dtype=np.float64)
    nodes = np.concatenate(
        [corners, [corners[list(around)].mean(axis=0) for around in CELL_TYPES[name].mids]]
    )
    below = nodes[:, 2] < 1.0
    nodes[below, :2] /= 1.0 - nodes[below, 2:]
    powers = [
        (i, j, k)
        for i, j, k in product(range(3), repeat=3)
        if k <= 2 - max(i, j) and (name == "pyramid14" or (i, j) != (2, 2))
    ]
    shape = np.linalg.inv(np.stack([_in_pyramid(nodes, power)[0] for power in powers], axis=1))
    at_nodes, on_lattice = (
        np.stack([_in_pyramid(places, power)[1] for power in powers], axis=2) @ shape
        for places in (nodes[below], lattice * [2.0, 2.0, 1.0] - [1.0, 1.0, 0.0])
    )
    ideal = np.diag([2.0, 2.0, np.sqrt(2.0)])  # all eight edges are of length 1
    return ideal @ at_nodes, on_lattice


def _in_pyramid(places: np.ndarray, power: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """The values ((p,)) of r^i s^j (1 - w)^m w^k, m = max(i, j), and its derivatives along u, v, w ((p, 3)).

    places: (p, 3) of r, s, w. power: (i, j, k).
    """
    i, j, k = power
    m = max(i, j)
    r, s, w = places.T
    low = 1.0 - w
    across, up = r**i * s**j, w**k
    less = low ** max(m - 1, 0)  # stands beside factors that are 0 where m is
    along_u = i * r ** max(i - 1, 0) * s**j * less * up
    along_v = j * r**i * s ** max(j - 1, 0) * less * up
    along_w = across * ((i + j - m) * less * up + k * low**m * w ** max(k - 1, 0))
    return across * low**m * up, np.stack([along_u, along_v, along_w], axis=1)


def _basis(name: str) -> list[Function]:
    """The functions, one for each node of a cell, of which its shape functions are combinations."""
    family, nodes = name.rstrip("0123456789"), CELL_TYPES[name].nodes
    powers = list(product(range(3), repeat=CELL_TYPES[name].dimension))
    if family in ("triangle", "tetra"):
        whole: list[Function] = [(power,) for power in powers if sum(power) <= 2]
        return [*whole, ((2, 1), (1, 2))] if name == "triangle7" else whole
    if family == "wedge":
        most = 2 if nodes == 18 else 1  # along the axis, where the degree across it is two
        powers = [(i, j, k) for i, j, k in powers if i + j < 2 or (i + j == 2 and k <= most)]
    elif nodes in (8, 20):
        powers = [power for power in powers if power.count(2) <= 1]
    return [(power,) for power in powers]


def _values(places: np.ndarray, basis: list[Function]) -> np.ndarray:
    """(k, n) the values of n functions at k places (k, d)."""
    columns = [sum(np.prod(places ** np.array(power), axis=1) for power in function) for function in basis]
    return np.stack(columns, axis=1)


def _derivatives(places: np.ndarray, basis: list[Function], shape: np.ndarray) -> np.ndarray:
    """(k, d, n) the derivatives of the shape functions at k places (k, d).

    shape: (n, n) the shape functions as combinations of ``basis``, each a column.
    """
    parts = []
    for axis in range(places.shape[1]):
        columns = []
        for function in basis:
            column = np.zeros(len(places))
            for power in function:
                less = np.array(power)
                less[axis] = max(less[axis] - 1, 0)
                column += power[axis] * np.prod(places**less, axis=1)
            columns.append(column)
        parts.append(np.stack(columns, axis=1) @ shape)
    return np.stack(parts, axis=1)


def _bernstein(dimension: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Points spread evenly in a simplex (k, d), and the values there of Bernstein's polynomials (k, k)."""
    indices = [i for i in product(range(degree + 1), repeat=dimension) if sum(i) <= degree]
    places = np.array(indices) / degree
    whole = np.concatenate([places, 1.0 - places.sum(axis=1, keepdims=True)], axis=1)
    columns = []
    for index in indices:
        powers = (*index, degree - sum(index))
        number = factorial(degree) // prod(factorial(power) for power in powers)
        columns.append(number * np.prod(whole ** np.array(powers), axis=1))
    return places, np.stack(columns, axis=1)
