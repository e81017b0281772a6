"""Moving the vertices of a patch together, so that its worst corner gains.

The patch's smallest quality is raised by way of a smooth bound on its largest badness B, the ℓ^k norm

    f = (Σ_c r_c^k)^(1/k),   r_c = B_c / B_max,   max r ≤ f ≤ (number of corners)^(1/k) max r,

minimised by L-BFGS for one k after the other, B_max being the largest badness when k's turn begins. Since B
is 1/Q in 2D and 1/Q³ in 3D, it is the ℓ^p norm of 1/Q with p = k and 3k. k is a power of two: powers and
roots are repeated squares and square roots, so the compiled twin gets the same bits. A step that leaves the
positive elements has f = ∞ and is halved like any step that does not descend.

In a metric L-BFGS works on L x for each vertex, L being that of the first corner it is in, so that a
stretched mesh in its metric moves as one that is neither; vertices that are not free to move anywhere are
taken as they are.

In a surface a corner is a triangle in space. Its determinant is the area as seen from the direction of the
normal that the triangle has when k's turn begins: it never claims more than the true area, and is not
positive where the triangle turns over. Vertices that walk are moved by ``surface.joint``, from what is found
here.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from dvr_cli.boundary.freedom import project
from dvr_cli.mesh.simplex import (
    back_through,
    cross,
    dot,
    edges_and_determinant,
    places_of,
    through,
)
from dvr_cli.quality.altitudes import extremes
from dvr_cli.quality.badness import badness
from dvr_cli.quality.mean_ratio import weighted_norm
from dvr_cli.relax.lbfgs import Pair, descent
from dvr_cli.relax.line import improves
from dvr_cli.relax.measured import Measured

SQUARINGS = ((5, 9, 13), (4, 8, 12))  # log2 of each k, in 2D and in 3D
ITERATIONS = 100  # of L-BFGS for one k at most; about 25 are usual
MEMORY = 8  # pairs of step and change of gradient that L-BFGS keeps
HALVINGS = 12  # of a step that does not descend enough, before giving up
DECREASE = 1e-4  # part of the descent that the slope promises which a step has to make (Armijo)
FIRST_STEP = 0.02  # largest move in the first iteration for one k, in units of the mean edge length
FLAT = 1e-5  # relative descent of f in an iteration below which it is the next k's turn
SHORTER = 6  # moves tried, each half as long as the one before, where an altitude would fall too low
NEGLIGIBLE = 1e-12  # share of a corner in Σ r^k below which its gradient does not count

# For each edge of a corner the other edges, and where the coefficient of their product stands in the norm.
_PRODUCTS = {2: (((1, 2),), ((0, 2),)), 3: (((1, 3), (2, 4)), ((0, 3), (2, 5)), ((0, 4), (1, 5)))}


class Patch(NamedTuple):
    """A patch: vertices that move together, all corners with any of them, and the tables about both.

    moving: (n,) vertices. vertices: (C, d+1), and shapes: (C,), of the corners; d is 2 on a surface. slot:
    (N,) number of each moving vertex among them, negative for all that stay. norm, factor: of ``ShapeTable``.
    dimension: (N,) and axis: (N, d) of ``Freedom``. enough: the badness with which the patch is good enough,
    0.0 for none. bearable: the badness above which it is left as it was, infinite for none. altitude: that
    below which no element may come, 0.0 for none.
    """

    moving: np.ndarray
    vertices: np.ndarray
    shapes: np.ndarray
    slot: np.ndarray
    norm: np.ndarray
    factor: np.ndarray
    dimension: np.ndarray
    axis: np.ndarray
    enough: float
    bearable: float
    altitude: float


def solve_patch(points: np.ndarray, patch: Patch) -> tuple[float, float]:
    """Move the vertices of a patch if its smallest quality grows to what is bearable, within its altitude.

    Moves that would take an altitude below are halved, some times, before the patch is left as it was.
    points: (N, d) of a planar or volume mesh, changed in place. Returns the largest badness of the patch
    before and after, the same if nothing moved.
    """
    d, moving = points.shape[1], patch.moving
    energy = PatchEnergy(points, patch)
    start = points[moving]
    before, moved = _found(energy, patch)
    if before == np.inf:
        return before, before
    for _ in range(SHORTER):
        points[moving] = start + moved
        after = energy.badness().max()
        if not improves(before, after, d):
            break
        if patch.altitude <= 0.0 or extremes(points, patch.vertices)[0] >= patch.altitude:
            return before, after
        moved = 0.5 * moved
    points[moving] = start
    return before, before


def find_moves(points: np.ndarray, patch: Patch) -> np.ndarray:
    """(n, d) how far each vertex of a patch is to move for the patch's smallest quality to grow.

    points: (N, d), which are the same afterwards. Where a corner is not positive, or stays worse than is
    bearable, nothing is to move.
    """
    start = points[patch.moving]
    _, moves = _found(PatchEnergy(points, patch), patch)
    points[patch.moving] = start
    return moves


def _found(energy: PatchEnergy, patch: Patch) -> tuple[Any, np.ndarray]:
    """The largest badness of a patch, and (n, d) the moves that are found; points end anywhere."""
    start = energy.points[patch.moving]
    before = energy.badness().max()
    if before == np.inf:
        return before, np.zeros_like(start)
    for squarings in SQUARINGS[patch.vertices.shape[1] - 3]:
        if _minimise(energy, squarings, patch.enough):
            break
    if energy.badness().max() > patch.bearable:
        return before, np.zeros_like(start)
    # the rounding of many steps has added up: back into the lines and planes, with that of one
    return before, energy.inside(energy.inside(energy.points[patch.moving] - start))


class PatchEnergy:
    """The ℓ^k norm of the badness of a patch's corners, and its gradient, where ``points`` has them."""

    def __init__(self, points: np.ndarray, patch: Patch) -> None:
        """points: (N, d), which the caller moves."""
        moving = patch.moving
        self.points, self.moving = points, moving
        self.largest = np.inf  # badness when ``norm`` was last asked for
        self._vertices = patch.vertices
        self._on_line, self._axis = patch.dimension[moving] == 1, patch.axis[moving]
        self._norm = patch.norm[patch.shapes].T
        self._factor = patch.factor[patch.shapes].T if len(patch.factor) else None
        slots = patch.slot[patch.vertices]
        own = np.broadcast_to(slots[:, :1], slots[:, 1:].shape)
        slots = np.stack([slots[:, 1:], own], axis=2)  # of both ends of each edge
        self._slots = np.where(slots < 0, len(moving), slots)  # the last slot is for what does not move
        self._own = None if self._factor is None else self._measured(patch)
        self._upward: list[np.ndarray] | None = None
        self.look_up()
        first = edges_and_determinant(points, patch.vertices)[0][0]
        if self._factor is not None:
            first = through(self._factor, first)
        lengths = np.sqrt(dot(first, first))
        self.size = np.add.accumulate(lengths)[-1] / len(lengths)  # mean edge length

    def look_up(self) -> None:
        """From now on see the triangles of a surface from the direction of the normals they have here."""
        if self._vertices.shape[1] == self.points.shape[1]:
            edges, size = edges_and_determinant(self.points, self._vertices)
            with np.errstate(all="ignore"):
                self._upward = [np.where(size > 0.0, part / size, 0.0) for part in cross(*edges)]

    def _measured(self, patch: Patch) -> Measured:
        """The measure of each vertex: through L of its first corner."""
        slots = patch.slot[patch.vertices]
        corner, place = np.nonzero(slots >= 0)
        row = np.empty(len(self.moving), dtype=np.int64)
        row[slots[corner, place][::-1]] = patch.shapes[corner][::-1]  # the first corner is the last to be put
        return Measured.of(list(patch.factor[row].T), (self._on_line, list(self._axis.T)))

    def measured(self, g: np.ndarray) -> np.ndarray:
        """The gradient by y = L x for that by x, row by row."""
        return g if self._own is None else np.stack(self._own.gradient(list(g.T)), axis=1)

    def moves(self, direction: np.ndarray) -> np.ndarray:
        """The move of x that one of y = L x stands for, row by row."""
        return direction if self._own is None else np.stack(self._own.move(list(direction.T)), axis=1)

    def taken(self, move: np.ndarray) -> np.ndarray:
        """The move of y = L x for that of x, row by row."""
        return move if self._own is None else np.stack(through(self._own.own, list(move.T)), axis=1)

    def badness(self) -> np.ndarray:
        """(C,) B of each corner, infinite where it is not positive."""
        edges, v = edges_and_determinant(self.points, self._vertices)
        if self._upward is not None:
            v = dot(self._upward, cross(*edges))
        with np.errstate(all="ignore"):
            return badness(v, weighted_norm(edges, self._norm, self._factor), len(edges))

    def norm(self, reference: float, squarings: int) -> tuple[float, np.ndarray]:
        """f, with k = 2^squarings and ``reference`` for B_max, and the share of each corner in Σ r^k."""
        with np.errstate(all="ignore"):
            power = self.badness()
            self.largest = power.max()
            power = power / reference
            for _ in range(squarings):
                power = power * power
            total = f = np.add.accumulate(power)[-1]
            for _ in range(squarings):
                f = np.sqrt(f)
            return f, power / total

    def gradient(self, f: float, share: np.ndarray) -> np.ndarray:
        """(n, d) gradient of f within the freedom of each vertex, from what ``norm`` gave.

        ∇f = f Σ_c share_c ∇B_c / B_c with ∇B/B = ∇s/s - ∇v/v in 2D and 3 ∇s/s - 2 ∇v/v in 3D.
        """
        heavy = np.flatnonzero(~(share < NEGLIGIBLE))
        weight = share[heavy] * f
        norm = self._norm[:, heavy]
        own, *ends = places_of(self.points, self._vertices[heavy])
        edges = np.array([end - own for end in ends])
        d, components = edges.shape[:2]
        if self._upward is not None:
            up = [part[heavy] for part in self._upward]
            normals = np.array([cross(edges[1], up), cross(up, edges[0])])
        elif d == 2:
            e, h = edges
            normals = np.array([[h[1], -h[0]], [-e[1], e[0]]])
        else:  # e_1 × e_2, e_2 × e_0, e_0 × e_1, by component
            after, last = (edges[order].swapaxes(0, 1) for order in ([1, 2, 0], [2, 0, 1]))
            normals = np.stack(cross(list(after), list(last)), axis=1)
        v = dot(edges[0], normals[0])
        factor = None
        if self._factor is not None:
            factor = self._factor[:, heavy]
            edges = np.array([through(factor, edge) for edge in edges])
        along = np.empty_like(edges)  # ∂s/∂e_j
        for j in range(d):
            along[j] = 2.0 * norm[j] * edges[j]
            for other, place in _PRODUCTS[d][j]:
                along[j] += norm[place] * edges[other]
        twice_s = np.add.accumulate((edges * along).reshape(d * components, -1))[-1]
        if factor is not None:
            along = np.array([back_through(factor, row) for row in along])
        to_s, to_v = 2.0 * weight / twice_s, weight / v
        if d == 3:
            to_s, to_v = 3.0 * to_s, 2.0 * to_v
        slots, n = self._slots[heavy].ravel(), len(self.moving)
        part = (to_s * along - to_v * normals).transpose(1, 2, 0)
        both = np.stack([part, -part], axis=3)  # on the edge's end, and on the corner's vertex
        g = np.empty((n, components))
        for i in range(components):
            g[:, i] = np.bincount(slots, both[i].ravel(), n + 1)[:n]
        return self.inside(g)

    def inside(self, g: np.ndarray) -> np.ndarray:
        """The part of each row of ``g`` that lies in its vertex's line or plane."""
        return np.stack(project(list(g.T), self._on_line, list(self._axis.T)), axis=1)


def _minimise(energy: PatchEnergy, squarings: int, enough: float) -> bool:
    """Move the patch's vertices to a minimum of f for k = 2^squarings, or towards it.

    Returns whether that brought the largest badness down to ``enough``, at which it stops.
    """
    x = energy.points[energy.moving]
    energy.look_up()
    reference = energy.badness().max()
    f, share = energy.norm(reference, squarings)
    g = energy.measured(energy.gradient(f, share))
    pairs: list[Pair] = []
    for _ in range(ITERATIONS):
        direction = descent(g, pairs, _dot)
        slope = _dot(g, direction)
        if not slope < 0.0:
            return False
        step = 1.0 if pairs else FIRST_STEP * energy.size / np.abs(direction).max()
        way = energy.moves(direction)
        for _ in range(HALVINGS):
            reached = x + step * way
            energy.points[energy.moving] = reached
            trial, share = energy.norm(reference, squarings)
            if trial <= f + DECREASE * step * slope:
                break
            step *= 0.5
        else:
            energy.points[energy.moving] = x
            return False
        if energy.largest <= enough:
            return True
        new = energy.measured(energy.gradient(trial, share))
        taken, change = energy.taken(reached - x), new - g
        curvature = _dot(taken, change)
        if curvature > 0.0:
            pairs = [*pairs, (taken, change, curvature)][-MEMORY:]
        gain = f - trial
        x, f, g = reached, trial, new
        if gain < FLAT * f:
            return False
    return False


def _dot(a: np.ndarray, b: np.ndarray) -> float:
    """Scalar product of two (n, d) vectors: for each component in order of the rows, then over components."""
    return float(np.add.accumulate(np.add.accumulate(a * b)[-1])[-1])
