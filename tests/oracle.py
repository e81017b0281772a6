"""The oracle: mean ratio, line problem and sweep written a second time, slowly and plainly.

Independent of the package by intention: it never imports it. Qualities come from determinants and inverses
of matrices (docs/design.md, "Corners"), the line problem from polynomial roots (the paper's Algorithm 2) and,
once more, from dense sampling, the sweep from plain loops over the vertices (the paper's Algorithm 1).

A *corner* is here a simplex of d+1 points, its vertex first, with a *target* simplex of the same shape.
A *ring* is a list of ``(points (d+1, d), k, target (d+1, d))``: the corners around a vertex, which is
``points[k]``. A *patch* is ``(points, cells, vertex, direction)``, a small mesh around one vertex, ``cells``
being a list of ``(cell_type, (n, nodes) array)`` in meshio's node order, positively oriented: the wedge's
triangle 0-1-2 and the pyramid's base 0-1-2-3 turn anticlockwise as seen from nodes 3-4-5 and from the apex.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

Ring = list[tuple[np.ndarray, int, np.ndarray]]
Cells = list[tuple[str, np.ndarray]]
Patch = tuple[np.ndarray, Cells, int, np.ndarray]

# ----------------------------------------------------------------------------------------------- quality

# The ideal elements. All their edges have length 1, and no other two of their vertices are at distance 1.
IDEAL = {
    "triangle": [(0, 0), (1, 0), (1 / 2, 3**0.5 / 2)],
    "quad": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "tetra": [(0, 0, 0), (1, 0, 0), (1 / 2, 3**0.5 / 2, 0), (1 / 2, 3**0.5 / 6, (2 / 3) ** 0.5)],
    "hexahedron": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
    "wedge": [(0, 0, 0), (1, 0, 0), (0.5, 0.75**0.5, 0), (0, 0, 1), (1, 0, 1), (0.5, 0.75**0.5, 1)],
    "pyramid": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (1 / 2, 1 / 2, 0.5**0.5)],
}
REGULAR_SIMPLEX = {2: np.array(IDEAL["triangle"]), 3: np.array(IDEAL["tetra"])}


def jacobian(points: np.ndarray, target: np.ndarray) -> np.ndarray:
    """A = E W⁻¹, the linear map (..., d, d) that takes the target simplex to the simplices (..., d+1, d)."""
    edges = np.swapaxes(points[..., 1:, :] - points[..., :1, :], -1, -2)
    target_edges = np.swapaxes(target[..., 1:, :] - target[..., :1, :], -1, -2)
    return edges @ np.linalg.inv(target_edges)


def mean_ratio(points: ArrayLike, target: np.ndarray | None = None) -> np.ndarray:
    """Signed mean ratio of the corners (..., d+1, d); the target is the regular simplex unless given.

    A corner whose points all coincide has quality 0.
    """
    points = np.asarray(points, dtype=float)
    d = points.shape[-1]
    a = jacobian(points, REGULAR_SIMPLEX[d] if target is None else target)
    det = np.linalg.det(a)
    norm2 = np.sum(a**2, axis=(-1, -2))
    return d * np.sign(det) * np.abs(det) ** (2 / d) / np.where(norm2 > 0, norm2, 1)


@cache
def corners(cell_type: str) -> list[tuple[list[int], np.ndarray]]:
    """Per corner of the cell type its d+1 local vertices, the corner's own first, and its target simplex.

    A vertex that is joined to d others by edges has a corner; in a simplex the first speaks for all.
    """
    ideal = np.array(IDEAL[cell_type], dtype=float)
    d = ideal.shape[1]
    result = []
    for vertex in range(len(ideal)):
        distance = np.linalg.norm(ideal - ideal[vertex], axis=1)
        local = [vertex, *np.flatnonzero(np.isclose(distance, 1)).tolist()]
        if len(local) != d + 1:  # the apex of a pyramid has four edges
            continue
        if np.linalg.det(ideal[local[1:]] - ideal[vertex]) < 0:
            local[-2:] = local[:-3:-1]
        result.append((local, ideal[local]))
    return result[:1] if len(ideal) == d + 1 else result


def element_quality(cell_type: str, points: np.ndarray) -> float:
    """Quality of one element with the points (nodes, d): the minimum over its corners."""
    points = np.asarray(points, dtype=float)
    return min(float(mean_ratio(points[local], target)) for local, target in corners(cell_type))


# ---------------------------------------------------------------------------------------- the line problem


def ring_of(points: np.ndarray, cells: Cells, vertex: int) -> Ring:
    """All corners that contain the vertex, also those in which it is the end of an edge."""
    return [
        (points[cell[local]], local.index(list(cell).index(vertex)), target)
        for cell_type, block in cells
        for cell in block
        if vertex in cell
        for local, target in corners(cell_type)
        if vertex in cell[local]
    ]


def with_vertex_at(ring: Ring, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (..., corners, d+1, d) and targets (corners, d+1, d), the vertex being at positions (..., d)."""
    points, k, targets = (np.array(part) for part in zip(*ring, strict=True))
    moved = np.broadcast_to(points, (*position.shape[:-1], *points.shape)).astype(float)
    moved[..., np.arange(len(ring)), k, :] = position[..., None, :]
    return moved, targets


def ring_qualities(ring: Ring, x: np.ndarray, direction: np.ndarray, steps: ArrayLike) -> np.ndarray:
    """Qualities (..., corners) of the ring with its vertex at x + step · direction for steps of any shape."""
    return mean_ratio(*with_vertex_at(ring, x + np.multiply.outer(steps, direction)))


def determinants(ring: Ring, x: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Per corner the coefficients (v1, v0) of det A(λ) = v0 + v1 λ with its vertex at x + λ direction."""
    points, targets = with_vertex_at(ring, x)
    result = []
    for simplex, ideal, (_, k, _) in zip(points, targets, ring, strict=True):
        # seen from another point of the corner only one edge changes, and the determinant is linear in it
        order = np.roll(np.arange(len(simplex)), -k)[[1, 0, *range(2, len(simplex))]]
        edges = simplex[order[1:]] - simplex[order[0]]
        result.append([[direction, *edges[1:]], edges, ideal[order[1:]] - ideal[order[0]]])
    along, at_x, ideal = np.linalg.det(np.array(result)).T
    return np.column_stack([along, at_x]) / ideal[:, None]


def squared_norms(ring: Ring, x: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Per corner the coefficients (s2, s1, s0) of ‖A(λ)‖² with its vertex at x + λ direction."""
    a = jacobian(*with_vertex_at(ring, x))
    still = [(np.zeros_like(points), k, target) for points, k, target in ring]
    b = jacobian(*with_vertex_at(still, direction))
    return np.stack(
        [np.sum(b * b, axis=(1, 2)), 2 * np.sum(a * b, axis=(1, 2)), np.sum(a * a, axis=(1, 2))], -1
    )


def positive_interval(ring: Ring, x: np.ndarray, direction: np.ndarray) -> tuple[float, float] | None:
    """The open interval of λ, maybe infinite, on which every corner of the ring is positive, or None."""
    low, high = -np.inf, np.inf
    for v1, v0 in determinants(ring, x, direction):
        if v1 > 0:
            low = max(low, -v0 / v1)
        elif v1 < 0:
            high = min(high, -v0 / v1)
        elif v0 <= 0:
            return None
    return (low, high) if low < high else None


def search_interval(ring: Ring, x: np.ndarray, direction: np.ndarray) -> tuple[float, float] | None:
    """The positive interval, cut where it is so long that the maximum cannot lie beyond.

    Each corner's maximum lies within a few diameters of the ring from where the corner turns positive.
    """
    interval = positive_interval(ring, x, direction)
    if interval is None:
        return None
    low, high = interval
    nearest = min(max(0.0, low), high)
    size = max(np.linalg.norm(points - x, axis=1).max() for points, _, _ in ring) / np.linalg.norm(direction)
    reach = 20 * max(size, abs(nearest))
    return max(low, nearest - reach), min(high, nearest + reach)


def multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Product of polynomials, coefficients along the last axis."""
    shape = np.broadcast_shapes(p.shape[:-1], q.shape[:-1])
    result = np.zeros((*shape, p.shape[-1] + q.shape[-1] - 1))
    for i in range(p.shape[-1]):
        result[..., i : i + q.shape[-1]] += p[..., i : i + 1] * q
    return result


def roots(polynomials: np.ndarray) -> np.ndarray:
    """Real parts of all roots of the polynomials (n, degree + 1), highest coefficient first.

    A double root may come out as a conjugate pair, therefore no root is discarded as complex.
    """
    leading = np.abs(polynomials[:, 0]) > 1e-14 * np.abs(polynomials).max(axis=1)
    monic = polynomials[leading] / polynomials[leading, :1]
    degree = polynomials.shape[1] - 1
    companion = np.tile(np.eye(degree, k=-1), (len(monic), 1, 1))
    companion[:, 0, :] = -monic[:, 1:]
    found = [np.linalg.eigvals(companion).real.ravel()]
    found += [np.roots(polynomial[1:]).real for polynomial in polynomials[~leading]]
    return np.concatenate(found)


def candidates(ring: Ring, start: np.ndarray, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the ring with its vertex at start + t step, t in [-1, 1], may be best, and how good it is there.

    Those are the t at which all corners are positive and one is stationary or two are equal.
    """
    d = len(step)
    v, s = determinants(ring, start, step), squared_norms(ring, start, step)
    # Q = d v^(2/d) / s is stationary where (2/d) v' s = v s'
    stationary = 2 / d * multiply(v[:, :1], s) - multiply(v, s[:, :2] * [2, 1])
    # two are equal where s_a^d v_b^2 = s_b^d v_a^2, which in 2D is, both v being positive, s_a v_b = s_b v_a
    a, b = np.array(list(combinations(range(len(ring)), 2)), dtype=int).reshape(-1, 2).T
    sp, vq = (s, v) if d == 2 else (multiply(s, multiply(s, s)), multiply(v, v))
    equal = multiply(sp[a], vq[b]) - multiply(sp[b], vq[a])
    t = np.concatenate([roots(stationary), roots(equal)])
    t = t[np.abs(t) <= 1]
    t = t[(v @ np.vander(t, 2).T > 0).all(axis=0)]
    return t, (d * (v @ np.vander(t, 2).T) ** (2 / d) / (s @ np.vander(t, 3).T)).min(axis=0)


def line_problem(ring: Ring, x: np.ndarray, direction: np.ndarray) -> tuple[float, float] | None:
    """The λ that makes the ring's worst corner as good as it can be, and the quality it then has.

    The paper's Algorithm 2: among all stationary points of the corners' qualities and all crossings of two
    of them, the best at which the whole ring is positive. None if no λ makes the whole ring positive.
    """
    interval = search_interval(ring, x, direction)
    if interval is None:
        return None
    # with λ = middle + half t the positive interval is [-1, 1], where polynomials are well conditioned
    middle, half = sum(interval) / 2, (interval[1] - interval[0]) / 2
    t, quality = candidates(ring, x + middle * direction, half * direction)
    if not t.size:
        return None
    best = middle + half * t[quality.argmax()]
    # once more for the corners that decide, with polynomials centred on the optimum: sharper roots
    qualities = ring_qualities(ring, x, direction, best)
    few = [corner for corner, q in zip(ring, qualities, strict=True) if q < 1.001 * qualities.min()]
    for zoom in (1e-3, 1e-6):
        t, _ = candidates(few, x + best * direction, zoom * half * direction)
        steps = np.append(best + zoom * half * t, best)
        best = steps[ring_qualities(ring, x, direction, steps).min(axis=1).argmax()]
    return float(best), float(ring_qualities(ring, x, direction, best).min())


def brute_force(ring: Ring, x: np.ndarray, direction: np.ndarray) -> tuple[float, float] | None:
    """As line_problem, by dense sampling, then by sampling ever more narrowly around the best sample."""
    interval = search_interval(ring, x, direction)
    if interval is None:
        return None
    low, high = interval
    samples = 200
    for _ in range(13):
        steps = low + (high - low) * (1 - np.cos(np.linspace(0, np.pi, samples))) / 2
        worst = ring_qualities(ring, x, direction, steps).min(axis=1)
        best = int(worst.argmax())
        low, high = steps[max(best - 1, 0)], steps[min(best + 1, samples - 1)]
        samples = 16
    return (float(steps[best]), float(worst[best])) if worst[best] > 0 else None


def gauss_seidel_sweep(
    points: np.ndarray, cells: Cells, relaxed: np.ndarray, directions: np.ndarray
) -> np.ndarray:
    """The points (N, d) after one sweep of the paper's Algorithm 1 over the vertices of ``relaxed`` in turn.

    directions: (len(relaxed), d), a row for each relaxed vertex. A vertex whose ring no λ makes positive,
    or whose direction is zero, stays.
    """
    points = np.array(points, dtype=float)
    around: dict[int, Cells] = {int(vertex): [] for vertex in relaxed}
    for cell_type, block in cells:
        for cell in block:
            for vertex in cell:
                if int(vertex) in around:
                    around[int(vertex)].append((cell_type, cell[None, :]))
    for vertex, direction in zip(relaxed, directions, strict=True):
        if not np.any(direction):
            continue
        optimum = line_problem(ring_of(points, around[int(vertex)], vertex), points[vertex], direction)
        if optimum is not None:
            points[vertex] += optimum[0] * direction
    return points


# ------------------------------------------------------------------------------------------ random rings

BASES = ("2d", "3d", "quad", "hex", "wedge", "pyramid")
SITUATIONS = ("nearly_flat", "tie", "parallel", "unbounded", "tangled_solvable", "tangled_hopeless")
KINDS = BASES + SITUATIONS

MIRRORED = {  # node order of an element's mirror image
    "triangle": [0, 2, 1],
    "quad": [0, 3, 2, 1],
    "tetra": [0, 2, 1, 3],
    "hexahedron": [0, 3, 2, 1, 4, 7, 6, 5],
    "wedge": [0, 2, 1, 3, 5, 4],
    "pyramid": [0, 3, 2, 1, 4],
}


def random_ring(rng: np.random.Generator, kind: str) -> tuple[Ring, np.ndarray, np.ndarray]:
    """A random ring of one of KINDS, as (ring, position of its vertex, direction); see random_patch."""
    points, cells, vertex, direction = random_patch(rng, kind)
    return ring_of(points, cells, vertex), points[vertex], direction


def random_patch(rng: np.random.Generator, kind: str) -> Patch:
    """A random small mesh around one vertex, at random place, scale and orientation.

    Kinds in BASES name the elements; the ring is closed, and positive at λ = 0. Kinds in SITUATIONS are
    built on a random one of these:

    nearly_flat: some corner is positive by 1e-4 to 1e-11 of what it could be.
    tie: an open ring in which every corner has a mirror image, of the same quality at λ = 0.
    parallel: moving along the direction leaves the determinant of some corner as it is.
    unbounded: an open ring, positive all the way to infinity on exactly one side.
    tangled_solvable: some corner is not positive at λ = 0, but all are at some other λ.
    tangled_hopeless: no λ makes all corners positive.
    """
    while True:
        base = kind if kind in BASES else str(rng.choice(BASES))
        placed = _place(rng, base)
        patch = _SITUATE[kind](rng, placed) if kind in SITUATIONS else placed
        if patch is not None:
            return _anywhere(rng, patch)


def _place(rng: np.random.Generator, base: str) -> Patch:
    """A patch of the base kind with its vertex somewhere in the region where the ring is positive."""
    while True:
        points, cells, vertex = _BASE[base](rng)
        for _ in range(2):
            direction = rng.normal(size=points.shape[1])
            interval = positive_interval(ring_of(points, cells, vertex), points[vertex], direction)
            if interval is None or not interval[0] < 0 < interval[1]:
                break
            points[vertex] += rng.uniform(*interval) * direction
        else:
            return points, cells, vertex, rng.normal(size=points.shape[1])


def _anywhere(rng: np.random.Generator, patch: Patch) -> Patch:
    """The patch rotated, scaled and shifted, and its direction rotated and scaled."""
    points, cells, vertex, direction = patch
    d = points.shape[1]
    rotation = np.linalg.qr(rng.normal(size=(d, d)))[0]
    rotation[0] *= np.linalg.det(rotation)
    size, length = 10 ** rng.uniform(-3, 3), 10 ** rng.uniform(-3, 3)
    return size * (points @ rotation.T + rng.normal(size=d)), cells, vertex, length * rotation @ direction


def _fan(rng: np.random.Generator) -> tuple[np.ndarray, Cells, int]:
    """Triangles around vertex 0 of a star-shaped polygon."""
    n = int(rng.integers(3, 9))
    while True:
        angles = np.sort(rng.uniform(0, 2 * np.pi, n))
        if np.diff(angles, append=angles[0] + 2 * np.pi).max() < 3:
            break
    rim = np.exp(rng.uniform(-0.7, 0.7, (n, 1))) * np.column_stack([np.cos(angles), np.sin(angles)])
    cell = np.column_stack([np.zeros(n, int), np.arange(1, n + 1), np.arange(1, n + 1) % n + 1])
    return np.vstack([np.zeros(2), rim]), [("triangle", cell)], 0


def _ball(rng: np.random.Generator) -> tuple[np.ndarray, Cells, int]:
    """Tetrahedra around vertex 0 of a star-shaped polyhedron; the vertex takes any position in them."""
    while True:
        rim = rng.normal(size=(int(rng.integers(6, 17)), 3))
        rim /= np.linalg.norm(rim, axis=1, keepdims=True)
        hull = ConvexHull(rim)
        if hull.equations[:, 3].max() < -0.1:
            break
    outward = np.linalg.det(rim[hull.simplices]) > 0
    faces = np.where(outward[:, None], hull.simplices, hull.simplices[:, ::-1]) + 1
    cell = np.column_stack([np.zeros(len(faces), int), faces])
    even = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
    cell = np.take_along_axis(cell, even[rng.integers(0, 4, len(cell))], axis=1)
    return np.vstack([np.zeros(3), rim * np.exp(rng.uniform(-0.7, 0.7, (len(rim), 1)))]), [("tetra", cell)], 0


def _grid(rng: np.random.Generator, d: int) -> tuple[np.ndarray, np.ndarray, int]:
    """The 3^d points of a distorted grid (one in three times undistorted), its 2^d cubes, its middle."""
    index = np.arange(3**d).reshape((3,) * d)
    points = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * d, indexing="ij"), axis=-1).reshape(-1, d)
    noise = rng.choice([0, 0.15, 0.35])
    ideal = np.array(IDEAL["quad" if d == 2 else "hexahedron"])
    origins = np.argwhere(np.ones((2,) * d))
    cubes = np.array([index[tuple((origin + ideal).T)] for origin in origins])
    return points + noise * rng.uniform(-1, 1, points.shape), cubes, 3**d // 2


def _quads(rng: np.random.Generator) -> tuple[np.ndarray, Cells, int]:
    """Three to six quadrilaterals around a vertex, or a distorted grid of four."""
    if rng.random() < 0.5:
        points, cell, vertex = _grid(rng, 2)
        return points, [("quad", cell)], vertex
    n = int(rng.integers(3, 7))
    angles = np.arange(2 * n) * np.pi / n + rng.uniform(-0.3, 0.3, 2 * n)
    rim = np.exp(rng.uniform(-0.3, 0.3, (2 * n, 1))) * np.column_stack([np.cos(angles), np.sin(angles)])
    first = 2 * np.arange(n) + 1
    cell = np.column_stack([np.zeros(n, int), first, first + 1, (first + 1) % (2 * n) + 1])
    return np.vstack([np.zeros(2), rim]), [("quad", cell)], 0


def _hexahedra(rng: np.random.Generator) -> tuple[np.ndarray, Cells, int]:
    """Eight hexahedra around a vertex."""
    points, cell, vertex = _grid(rng, 3)
    return points, [("hexahedron", cell)], vertex


def _wedges(rng: np.random.Generator) -> tuple[np.ndarray, Cells, int]:
    """Two layers of wedges over a fan of triangles, around the vertex in the middle."""
    flat, [(_, triangles)], _ = _fan(rng)
    n = len(flat)
    points = np.vstack([np.column_stack([flat, np.full(n, float(z))]) for z in (-1, 0, 1)])
    points[:, :] += 0.1 * rng.uniform(-1, 1, points.shape)
    layers = [np.hstack([triangles + z * n, triangles + (z + 1) * n]) for z in range(2)]
    return points, [("wedge", np.vstack(layers))], n


def _pyramids(rng: np.random.Generator) -> tuple[np.ndarray, Cells, int]:
    """Cubes cut into six pyramids each: around the common apex in one, or around the middle of eight."""
    points, cubes, vertex = _grid(rng, 3)
    faces = np.array([[0, 1, 2, 3], [7, 6, 5, 4], [0, 4, 5, 1], [2, 6, 7, 3], [0, 3, 7, 4], [1, 5, 6, 2]])
    centres = points[cubes].mean(axis=1) + rng.uniform(-0.1, 0.1, (len(cubes), 3))
    apexes = len(points) + np.arange(len(cubes))
    cell = np.column_stack([cubes[:, faces].reshape(-1, 4), np.repeat(apexes, 6)])
    return np.vstack([points, centres]), [("pyramid", cell)], vertex if rng.random() < 0.5 else int(apexes[0])


_BASE = {"2d": _fan, "3d": _ball, "quad": _quads, "hex": _hexahedra, "wedge": _wedges, "pyramid": _pyramids}


def _interval(patch: Patch) -> tuple[float, float]:
    """The positive interval of the patch's line problem; (0, 0) if there is none."""
    points, cells, vertex, direction = patch
    return positive_interval(ring_of(points, cells, vertex), points[vertex], direction) or (0, 0)


def _nearly_flat(rng: np.random.Generator, patch: Patch) -> Patch | None:
    points, cells, vertex, direction = patch
    low, high = _interval(patch)
    points[vertex] += (low + (high - low) * 10 ** rng.uniform(-11, -4)) * direction
    ring = ring_of(points, cells, vertex)
    positive = (determinants(ring, points[vertex], direction)[:, 1] > 0).all()
    return (points, cells, vertex, rng.normal(size=len(direction))) if positive else None


def _tie(rng: np.random.Generator, patch: Patch) -> Patch | None:
    points, [(cell_type, block)], vertex, direction = patch
    block = block[(block == vertex).any(axis=1)]
    few = block[rng.permutation(len(block))[: rng.integers(1, 6)]]
    points = points - points[vertex]
    image = points * np.where(np.arange(points.shape[1]) == 0, -1, 1)
    # the mirror image of the vertex is the vertex itself
    number = np.where(np.arange(len(points)) == vertex, vertex, np.arange(len(points)) + len(points))
    cells = [(cell_type, np.vstack([few, number[few][:, MIRRORED[cell_type]]]))]
    return np.vstack([points, image]), cells, vertex, direction


def _parallel(rng: np.random.Generator, patch: Patch) -> Patch | None:
    points, cells, vertex, _ = patch
    ring = ring_of(points, cells, vertex)
    corner, k, _ = ring[rng.integers(len(ring))]
    facet = np.delete(corner, k, axis=0)
    return points, cells, vertex, (facet[1:] - facet[0]).T @ rng.normal(size=len(facet) - 1)


def _unbounded(rng: np.random.Generator, patch: Patch) -> Patch | None:
    points, [(cell_type, block)], vertex, direction = patch
    block = block[(block == vertex).any(axis=1)]
    few = block[rng.permutation(len(block))[: rng.integers(1, 4)]]
    patch = points, [(cell_type, few)], vertex, direction
    return patch if np.isinf(_interval(patch)).sum() == 1 else None


def _tangled_solvable(rng: np.random.Generator, patch: Patch) -> Patch | None:
    points, cells, vertex, direction = patch
    low, high = _interval(patch)
    beyond = rng.uniform(0, 2) * (high - low)
    points[vertex] += rng.choice([low - beyond, high + beyond]) * direction
    return points, cells, vertex, direction


def _tangled_hopeless(rng: np.random.Generator, patch: Patch) -> Patch | None:
    points, _, vertex, direction = patch
    points[vertex] += 2 * rng.normal(size=len(direction))
    return patch if _interval(patch) == (0, 0) else None


_SITUATE = {
    "nearly_flat": _nearly_flat,
    "tie": _tie,
    "parallel": _parallel,
    "unbounded": _unbounded,
    "tangled_solvable": _tangled_solvable,
    "tangled_hopeless": _tangled_hopeless,
}
