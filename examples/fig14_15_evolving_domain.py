"""Figures 14 and 15: a hand-shaped domain shrinks, and one background mesh conforms to it at every instant.

The boundary is a periodic cubic spline that moves by its curvature (curve shortening flow, the mean-curvature
flow of curves). At each instant the elements of a mesh of equilateral triangles with a vertex inside are
taken, their boundary vertices - all outside - go to the closest point of the spline, and vertices near them
are relaxed. Nothing is cut or meshed anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

import dvr_cli
from common import AFTER, SHADES, draw_mesh, new_figure, quality_axes, save

# angle of each finger in degrees, the middle of its root, its length, its width; the thumb comes last
FINGERS = [
    (115, (-0.235, 0.30), 0.30, 0.105),
    (98, (-0.085, 0.36), 0.42, 0.115),
    (86, (0.075, 0.37), 0.46, 0.115),
    (72, (0.225, 0.31), 0.40, 0.110),
    (28, (0.31, 0.00), 0.33, 0.130),
]
WRIST = [(0.22, -0.30), (0.0, -0.34), (-0.22, -0.30), (-0.29, 0.0)]
NODES = 600  # of the spline
TIME = 0.016  # of the whole evolution; the area falls by 2π in a unit of time
RINGS = 3  # of vertices around the boundary that are relaxed


def closed_spline(points: np.ndarray) -> CubicSpline:
    """The periodic cubic spline through ``points`` (n, 2), parametrised by the length of its chords."""
    closed = np.vstack([points, points[:1]])
    chords = np.linalg.norm(np.diff(closed, axis=0), axis=1)
    return CubicSpline(np.concatenate([[0.0], np.cumsum(chords)]), closed, bc_type="periodic")


def evenly_spaced(spline: CubicSpline, n: int) -> np.ndarray:
    """n points at equal distances along a closed spline."""
    t = np.linspace(0.0, spline.x[-1], 20 * n + 1)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(spline(t), axis=0), axis=1))])
    return spline(np.interp(np.linspace(0.0, length[-1], n + 1)[:-1], length, t))


def hand() -> np.ndarray:
    """Spline nodes (NODES, 2) of the outline of a hand, counterclockwise from the wrist."""
    outline = [*WRIST]
    for angle, root, length, width in FINGERS:
        along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
        left = np.array([-along[1], along[0]])
        # up its left side, round the tip, down its right side
        sides = [(0.2, 0.54), (0.55, 0.5), (0.86, 0.44)]
        for a, b in [*sides, (1.02, 0.0), *((a, -b) for a, b in reversed(sides))]:
            outline.append(np.array(root) + a * length * along + b * width * left)
    return evenly_spaced(closed_spline(np.array(outline)[::-1]), NODES)


def shortened(nodes: np.ndarray, duration: float, steps: int) -> np.ndarray:
    """Nodes, equally spaced along a closed curve, after moving by the curvature vector x'' for a while.

    Each step is implicit, so that it is stable, and diagonal in Fourier space; then the nodes are spread
    evenly again.
    """
    n = len(nodes)
    modes = 4 * np.sin(np.pi * np.arange(n) / n)[:, None] ** 2
    for _ in range(steps):
        spacing = np.linalg.norm(np.diff(nodes, axis=0, append=nodes[:1]), axis=1).mean()
        moved = np.fft.fft(nodes, axis=0) / (1 + duration / steps * modes / spacing**2)
        nodes = evenly_spaced(closed_spline(np.fft.ifft(moved, axis=0).real), n)
    return nodes


def closest(spline: CubicSpline, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The closest points (n, 2) on a counterclockwise spline; the distance (n,), negative inside."""
    t = np.linspace(0.0, spline.x[-1], 20 * NODES, endpoint=False)
    t = t[cKDTree(spline(t)).query(points)[1]]
    for _ in range(3):  # Newton's method for (spline(t) - point)·spline'(t) = 0
        offset, tangent, bend = spline(t) - points, spline(t, 1), spline(t, 2)
        t = t - (offset * tangent).sum(axis=1) / (tangent**2 + offset * bend).sum(axis=1)
    nearest, tangent = spline(t % spline.x[-1]), spline(t % spline.x[-1], 1)
    outward = np.column_stack([tangent[:, 1], -tangent[:, 0]]) / np.linalg.norm(
        tangent, axis=1, keepdims=True
    )
    return nearest, ((points - nearest) * outward).sum(axis=1)


def background(size: float, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of a mesh of equilateral triangles with edges ``size`` over a box."""
    columns, rows = np.ceil((high - low) / (size * np.array([1.0, np.sqrt(0.75)]))).astype(int) + 2
    i, j = np.mgrid[0:rows, 0:columns]
    points = low + size * np.column_stack([(j - (i % 2) / 2).ravel(), np.sqrt(0.75) * i.ravel()])
    corner = (i * columns + j)[:-1, :-1]
    even, odd = (
        corner[0::2].ravel(),
        corner[1::2].ravel(),
    )  # rows; the odd ones stand half an edge to the left
    right, above, across = 1, columns, columns + 1
    triangles = [
        np.stack([even, even + right, even + across], axis=1),
        np.stack([even, even + across, even + above], axis=1),
        np.stack([odd, odd + right, odd + above], axis=1),
        np.stack([odd + right, odd + across, odd + above], axis=1),
    ]
    return points, np.concatenate(triangles)


@dataclass
class Instant:
    """The mesh of one instant.

    nodes: of the boundary's spline. points, background: (N, 2) coordinates now, and in the background mesh.
    projected, moved: (N,) bool, vertices put on the boundary, vertices no longer where they were.
    vector, minimum: qualities; q1_projected: Q1 before relaxing. distance: of the boundary vertices from the
    spline, at most.
    """

    nodes: np.ndarray
    points: np.ndarray
    background: np.ndarray
    triangles: np.ndarray
    projected: np.ndarray
    moved: np.ndarray
    vector: np.ndarray
    q1_projected: float
    minimum: float
    distance: float


def conform(nodes: np.ndarray, points: np.ndarray, triangles: np.ndarray) -> Instant:
    """The background mesh (points, triangles) made to conform to the closed spline through ``nodes``."""
    spline = closed_spline(nodes)
    nearest, distance = closest(spline, points)
    chosen = triangles[(distance[triangles] < 0).any(axis=1)]
    used, numbers = np.unique(chosen, return_inverse=True)
    cells = {"triangle": numbers.reshape(-1, 3)}
    relaxer = dvr_cli.Relaxer(points[used], cells, max_iterations=60, tol=1e-3, patience=6)
    placed = np.where(relaxer.held[:, None], nearest[used], points[used])
    relaxed, report = relaxer.relax(placed, near=RINGS)
    quality = dvr_cli.quality_report(relaxed, cells).quality
    return Instant(
        nodes=nodes,
        points=relaxed,
        background=points[used],
        triangles=cells["triangle"],
        projected=relaxer.held,
        moved=(relaxed != points[used]).any(axis=1),
        vector=quality.vector,
        q1_projected=report.q1_before,
        minimum=quality.minimum,
        distance=float(np.abs(closest(spline, relaxed[relaxer.held])[1]).max()),
    )


def experiment(small: bool = False) -> list[Instant]:
    """The meshes at 80 instants (small: 8), of triangles with edges 0.018 (0.025)."""
    instants, size = (8, 0.025) if small else (80, 0.018)
    nodes = hand()
    margin = 2 * size
    points, triangles = background(size, nodes.min(axis=0) - margin, nodes.max(axis=0) + margin)
    meshes = [conform(nodes, points, triangles)]
    for _ in range(instants - 1):
        nodes = shortened(nodes, TIME / (instants - 1), 240 // instants)
        meshes.append(conform(nodes, points, triangles))
    return meshes


def draw(meshes: list[Instant]) -> Figure:
    """The evolution, all quality vectors, and the meshes of some instants."""
    figure, axes = new_figure(2, 3, height=7.6, height_ratios=[1, 1.5])
    evolution, choice, quality = axes[0]
    for k in np.linspace(0, len(meshes) - 1, 9).astype(int):
        nodes = meshes[k].nodes
        evolution.fill(*nodes.T, fill=False, ec=SHADES(k / len(meshes)), lw=1)
    evolution.set_title(f"boundary at 9 of {len(meshes)} instants")
    first = meshes[0]
    zoom = first.points[:, 1] > 0.38
    part = first.triangles[zoom[first.triangles].all(axis=1)]
    choice.triplot(*first.background.T, part, color="0.45", lw=0.6)
    choice.plot(*first.nodes[first.nodes[:, 1] > 0.38].T, ".", ms=1.2, color=AFTER)
    choice.set_title("elements with a vertex inside")
    for mesh in meshes:
        quality.semilogx(np.arange(1, len(mesh.vector) + 1), mesh.vector, color=AFTER, lw=0.5, alpha=0.5)
    quality_axes(quality, f"all {len(meshes)} meshes")
    for axis in (evolution, choice):
        axis.set_aspect("equal")
        axis.axis("off")
    for axis, k in zip(axes[1], (0, len(meshes) // 8, len(meshes) - 1), strict=True):
        mesh = meshes[k]
        draw_mesh(axis, mesh.points, mesh.triangles, f"instant {k + 1}: worst {mesh.minimum:.2f}")
    return figure


def main() -> None:
    """Run it, print the worst quality of all instants, and draw the figure."""
    meshes = experiment()
    worst = min(meshes, key=lambda mesh: mesh.minimum)
    print(f"worst quality of {len(meshes)} meshes: {worst.minimum:.3f}")
    save(draw(meshes), "fig14_15_evolving_domain")


if __name__ == "__main__":
    main()
