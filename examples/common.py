"""What the examples share: meshes, Laplacian smoothing, and how their figures look."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image
from scipy.spatial import Delaunay

import dvr_cli
from dvr_cli.files.reading import open_mesh

FIGURES = Path(__file__).parent / "figures"
SAMPLES = Path(__file__).parents[1] / "sample_meshes"
BEFORE, AFTER, OTHER, BAND = "#b35900", "#00306f", "#8a8a8a", "#9db4d6"  # told apart without colour, too
SHADES = matplotlib.colormaps["cividis"]

SWEEPS = {"patches": False, "polish": False}  # the paper's relaxation, and nothing after it

Cells = dict[str, np.ndarray]


def random_mesh(n: int, d: int, seed: int) -> tuple[np.ndarray, Cells]:
    """Points (n, d) drawn at random in the unit square or cube, and their Delaunay mesh."""
    points = np.random.default_rng(seed).random((n, d))
    cells = Delaunay(points).simplices.astype(np.int64)
    negative = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    cells[negative, :2] = cells[negative, 1::-1]
    return points, {"triangle" if d == 2 else "tetra": cells}


def hexagon(rings: int) -> tuple[np.ndarray, Cells]:
    """A hexagon of radius 1 of equilateral triangles, ``rings`` rings around its centre, which is held."""
    i, j = np.mgrid[-rings : rings + 1, -rings : rings + 1]
    inside = abs(i + j) <= rings
    number = np.full(i.shape, -1)
    number[inside] = np.arange(inside.sum())
    points = np.column_stack([i[inside] + j[inside] / 2, j[inside] * np.sqrt(0.75)]) / rings
    up = np.stack([number[:-1, :-1], number[1:, :-1], number[:-1, 1:]], axis=-1).reshape(-1, 3)
    down = np.stack([number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 3)
    triangles = np.concatenate([up, down])
    cells = {"triangle": triangles[(triangles >= 0).all(axis=1)]}
    return points, cells | {"vertex": np.array([[number[rings, rings]]])}


def turned(points: np.ndarray, angles: np.ndarray | float) -> np.ndarray:
    """Points (n, 2) turned about the origin, each by its angle."""
    x, y = points.T
    return np.column_stack([np.cos(angles) * x - np.sin(angles) * y, np.sin(angles) * x + np.cos(angles) * y])


@dataclass
class HexagonRun:
    """A hexagon relaxed: points and quality vectors before and after, Q1 before and after each sweep."""

    triangles: np.ndarray
    before: np.ndarray
    after: np.ndarray
    q1: np.ndarray
    vectors: tuple[np.ndarray, np.ndarray]


def relaxed_hexagon(points: np.ndarray, cells: Cells, directions: str, sweeps: int = 150) -> HexagonRun:
    """Relax a hexagon until Q1 is 0.95, for so many sweeps at most."""
    after, report = dvr_cli.smooth(
        points,
        cells,
        directions=directions,
        center=(0, 0),
        target=0.95,
        tol=0,
        max_iterations=sweeps,
        **SWEEPS,
    )
    q1 = np.array([report.before.q1, *(sweep["q1"] for sweep in report.sweeps)])
    return HexagonRun(cells["triangle"], points, after, q1, (report.before.vector, report.after.vector))


def sample(name: str) -> tuple[np.ndarray, Cells]:
    """Points and cells of the highest dimension of one of the sample meshes; flat ones in two coordinates."""
    mesh = open_mesh(SAMPLES / name).mesh
    kind = "tetra" if any(block.type == "tetra" for block in mesh.cells) else "triangle"
    cells = np.concatenate([block.vertices for block in mesh.cells if block.type == kind])
    return mesh.points[:, : 3 if kind == "tetra" else 2], {kind: cells}


# ------------------------------------------------------------------------------------------------- figures


def new_figure(rows: int, columns: int, height: float = 3.6, **ratios: Any) -> tuple[Figure, np.ndarray]:
    """An empty figure, 11 inches wide, and its axes (rows, columns)."""
    figure = Figure(figsize=(11, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, gridspec_kw=ratios)


def triangle_quality(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The mean ratio of triangles (n, 3) of points (..., N, 2), the paper's equation (4): (..., n)."""
    a, b, c = (points[..., triangles[:, k], :] for k in range(3))
    ab, ac = b - a, c - a
    double_area = ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]
    squares = sum(((p - q) ** 2).sum(axis=-1) for p, q in ((a, b), (b, c), (c, a)))
    return 2 * np.sqrt(3) * double_area / squares


def draw_mesh(axis: Axes, points: np.ndarray, triangles: np.ndarray, title: str) -> None:
    """Triangles coloured by their mean ratio, dark blue 0 to yellow 1; inverted ones have red edges."""
    quality = triangle_quality(points, triangles)
    axis.tripcolor(*points.T, triangles, quality, vmin=0, vmax=1, cmap=SHADES, ec="face", lw=0.1)
    axis.triplot(*points.T, triangles, color="#303030", lw=0.5 if len(triangles) < 1000 else 0.2)
    if (quality < 0).any():
        axis.triplot(*points.T, triangles[quality < 0], color="#d62728", lw=1.2)
    axis.set(title=title, aspect="equal")
    axis.axis("off")


def quality_axes(axis: Axes, title: str) -> None:
    """Axes for quality vectors: component on a logarithmic scale, as in the paper."""
    axis.set(xscale="log", xlabel="component of the quality vector", ylabel="mean ratio", title=title)
    axis.set_ylim(top=1.0)
    axis.grid(alpha=0.3, which="both")


def draw_vector(axis: Axes, vector: np.ndarray, **style: Any) -> None:
    """One quality vector."""
    axis.plot(np.arange(1, len(vector) + 1), vector, **style)


def draw_band(axis: Axes, vectors: np.ndarray, label: str) -> None:
    """The range of several quality vectors (trials, components)."""
    rank = np.arange(1, vectors.shape[1] + 1)
    axis.fill_between(rank, vectors.min(axis=0), vectors.max(axis=0), color=BAND, label=label)


def draw_runs(runs: dict[str, HexagonRun]) -> Figure:
    """The mesh before, the meshes after, their quality vectors, and Q1 from sweep to sweep."""
    first, *_ = runs.values()
    meshes = [f"mesh {k}" for k in range(len(runs) + 1)]
    rows = [np.repeat(meshes, 2).tolist(), np.repeat(["vectors", "growth"], len(meshes)).tolist()]
    figure = Figure(figsize=(11, 6.6), layout="constrained")
    axes = figure.subplot_mosaic(rows)
    draw_mesh(axes["mesh 0"], first.before, first.triangles, f"before\nQ1 = {first.q1[0]:.2f}")
    draw_vector(axes["vectors"], first.vectors[0], color=BEFORE, ls="--", label="before")
    for mesh, (name, run), style in zip(meshes[1:], runs.items(), ("-", "-.", ":"), strict=False):
        title = f"{name}\nQ1 = {run.q1[-1]:.2f} after {len(run.q1) - 1} sweeps"
        draw_mesh(axes[mesh], run.after, run.triangles, title)
        draw_vector(axes["vectors"], run.vectors[1], color=AFTER, ls=style, label=name)
        axes["growth"].plot(run.q1, color=AFTER, ls=style, label=name)
    quality_axes(axes["vectors"], "quality vectors")
    axes["growth"].axhline(0.95, color=OTHER, lw=0.8)
    axes["growth"].set(xlabel="sweep", ylabel="Q1", title="Q1, stopped at 0.95")
    axes["growth"].grid(alpha=0.3)
    axes["growth"].legend()
    axes["vectors"].legend(loc="lower right")
    return figure


def save(figure: Figure, name: str) -> None:
    """Write figures/NAME.png, in few colours so that it is small."""
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=90)
    FIGURES.mkdir(exist_ok=True)
    Image.open(buffer).convert("RGB").quantize(96).save(FIGURES / f"{name}.png", optimize=True)
    print(f"figures/{name}.png")
