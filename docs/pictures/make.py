"""The pictures of the documentation: python docs/pictures/make.py (needs dvr-cli[dev] and Chromium)."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import meshio
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from playwright.sync_api import sync_playwright

import dvr_cli
from dvr_cli.report.plot_mesh import colour_scale

HERE = Path(__file__).parent
SAMPLES = HERE.parents[1] / "sample_meshes"
ORANGE, BLUE = "#b35900", "#00306f"


def quality(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n,) the mean ratios of triangles."""
    a, b, c = (points[corner] for corner in triangles.T)
    area = np.cross(b - a, c - a)
    return 2 * np.sqrt(3) * area / sum(((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a)))


def line() -> Figure:
    """A vertex in its ring, and the qualities along a line through it."""
    angle = np.linspace(0, 2 * np.pi, 6, endpoint=False) + np.array([0, 0.2, -0.1, 0.1, 0.15, -0.2])
    rim = np.column_stack([np.cos(angle), np.sin(angle)]) * np.array([[1, 0.9, 1.1, 0.95, 1, 1.1]]).T
    points = np.vstack([[0.42, -0.38], rim])
    triangles = np.array([[0, 1 + i, 1 + (i + 1) % 6] for i in range(6)])
    direction = np.array([-0.8, 0.6])
    steps = np.linspace(-0.35, 0.95, 500)
    curves = []
    for step in steps:
        moved = points.copy()
        moved[0] += step * direction
        curves.append(quality(moved, triangles))
    curves = np.array(curves)
    best = steps[curves.min(axis=1).argmax()]
    after = points.copy()
    after[0] += best * direction
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    ring, plot = figure.subplots(1, 2)
    ring.triplot(*points.T, triangles, color=ORANGE, lw=1, ls="--")
    ring.triplot(*after.T, triangles, color=BLUE, lw=1.5)
    ring.axline(points[0], points[0] + direction, color="0.6", lw=0.8)
    ring.plot(*points[0], "o", mfc="white", color=ORANGE)
    ring.plot(*after[0], "o", color=BLUE)
    ring.set_aspect("equal")
    ring.axis("off")
    plot.plot(steps, curves, color="0.7", lw=1)
    plot.plot(steps, curves.min(axis=1), color=BLUE, lw=2, label="the worst of them")
    plot.plot(0, curves[np.abs(steps).argmin()].min(), "o", mfc="white", color=ORANGE, label="before")
    plot.plot(best, curves.min(axis=1).max(), "o", color=BLUE, label="after")
    plot.set(xlabel="λ", ylabel="mean ratio of each triangle", ylim=(-0.2, 1))
    plot.legend(loc="lower center")
    return figure


def sweeps() -> Figure:
    """Random triangles after no, one and ten sweeps."""
    mesh = meshio.read(SAMPLES / "random_square.msh", file_format="gmsh")
    points, triangles = mesh.points[:, :2], mesh.get_cells_type("triangle")
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    for axes, number in zip(figure.subplots(1, 3), (0, 1, 10), strict=True):
        at, _ = dvr_cli.smooth(
            points, {"triangle": triangles}, directions="steepest,random", max_iterations=number, tol=0.0
        )
        values = np.abs(quality(at, triangles))
        drawn = PolyCollection(
            at[triangles], array=values, cmap=colour_scale(), clim=(0, 1), ec="white", lw=0.5
        )
        axes.add_collection(drawn)
        axes.autoscale_view()
        axes.set_aspect("equal")
        axes.axis("off")
        axes.set_title(f"{number or 'no'} sweep{'' if number == 1 else 's'}: worst {values.min():.3f}")
    figure.colorbar(drawn, ax=figure.axes, shrink=0.8, label="mean ratio")
    return figure


def viewer(path: Path) -> None:
    """A screenshot of the page of a run: the mesh is cut, and the worst element of the input is looked at."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        page = Path(folder) / "page.html"
        source = SAMPLES / "two_materials.msh"
        run = [*("-m", "dvr_cli", "smooth"), source, "better.msh", *("--boundary", "slide", "--plot"), page]
        subprocess.run([sys.executable, *map(str, run)], cwd=folder, check=True)
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": 1200, "height": 850})
        tab.goto(page.as_uri())
        tab.wait_for_selector("#view[data-ready]", timeout=120_000)
        tab.select_option("[name=axis]", "y")
        tab.locator("[name=cut]").fill("500")
        tab.locator(".frame").nth(0).click()
        tab.wait_for_timeout(1000)
        tab.screenshot(path=path)
        browser.close()


if __name__ == "__main__":
    line().savefig(HERE / "line.png", dpi=100)
    sweeps().savefig(HERE / "sweeps.png", dpi=100)
    viewer(HERE / "viewer.png")
