"""Figure 10: time of a sweep against the number of relaxed vertices, for tetrahedral meshes: a line.

Times are those of the fastest of 12 sweeps on one thread, the compiled engine being taken if it is installed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

import dvr_cli
from common import AFTER, BEFORE, SWEEPS, new_figure, random_mesh, save
from dvr_cli.relax.engines.choice import has_numba


@dataclass
class Timing:
    """Vertices relaxed, tetrahedra around one of them on average, seconds a sweep takes, and the engine."""

    relaxed: int
    ring: float
    seconds: float
    engine: str


def experiment(small: bool = False) -> list[Timing]:
    """Delaunay meshes of up to 40 000 random points (small: 800)."""
    sizes = (200, 400, 800) if small else (1000, 2500, 5000, 10000, 20000, 40000)
    engine = "numba" if has_numba() and not small else "numpy"
    timings = []
    for n in sizes:
        points, cells = random_mesh(n, 3, 0)
        options = {"engine": engine, "threads": 1, "tol": 0, "max_iterations": 12, **SWEEPS}
        _, report = dvr_cli.smooth(points, cells, directions="random", **options)
        relaxer = dvr_cli.Relaxer(points, cells)
        ring = np.bincount(cells["tetra"].ravel(), minlength=n)[~relaxer.held].mean()
        seconds = min(sweep["seconds"] for sweep in report.sweeps)
        timings.append(Timing(report.relaxed, float(ring), seconds, engine))
    return timings


def draw(timings: list[Timing]) -> Figure:
    """Time against vertices, and the line through the origin that fits best."""
    figure, axes = new_figure(1, 2)
    relaxed = np.array([one.relaxed for one in timings])
    seconds = np.array([one.seconds for one in timings])
    each = float((relaxed * seconds).sum() / (relaxed**2).sum())
    axis, other = axes[0]
    axis.plot(relaxed, 1e3 * seconds, "o", color=AFTER, label=f"measured, {timings[0].engine}, one thread")
    ends = np.array([0, relaxed.max()])
    axis.plot(ends, 1e3 * each * ends, color=BEFORE, ls="--", label=f"{1e6 * each:.2f} µs a vertex")
    axis.set(xlabel="relaxed vertices", ylabel="milliseconds a sweep")
    other.semilogx(relaxed, 1e6 * seconds / relaxed, "o-", color=AFTER)
    other.set(xlabel="relaxed vertices", ylabel="microseconds a vertex")
    other.set_ylim(bottom=0)
    axis.legend()
    for one in axes[0]:
        one.grid(alpha=0.3)
    return figure


def main() -> None:
    """Run it, print the times, and draw the figure."""
    timings = experiment()
    for one in timings:
        each = 1e6 * one.seconds / one.relaxed
        print(
            f"{one.relaxed:6} vertices, {one.ring:.1f} tetrahedra around each: {each:.2f} µs ({one.engine})"
        )
    save(draw(timings), "fig10_time")


if __name__ == "__main__":
    main()
