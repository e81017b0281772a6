"""Figure 11: does the order in which vertices are relaxed matter? 100 random orders, the same directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

import dvr_cli
from common import AFTER, BEFORE, SWEEPS, draw_band, draw_vector, new_figure, quality_axes, sample, save


@dataclass
class Result:
    """Quality vectors of one mesh: before, relaxed in index order, relaxed in each random order."""

    name: str
    before: np.ndarray
    natural: np.ndarray
    shuffled: np.ndarray


def experiment(small: bool = False) -> list[Result]:
    """A triangle mesh, 25 sweeps, and a tetrahedral one, 40 sweeps, in 100 orders (small: 3)."""
    results = []
    for name, sweeps in (("random_square.msh", 25), ("random_cube.vtk", 40)):
        points, cells = sample(name)
        # drawn once: with a seed for the order, random directions would change as well
        directions = np.random.default_rng(0).normal(size=(sweeps, *points.shape))
        options = {"directions": directions, "max_iterations": sweeps, "tol": 0, **SWEEPS}
        _, natural = dvr_cli.smooth(points, cells, order="natural", **options)
        shuffled = [
            dvr_cli.smooth(points, cells, order="shuffled", seed=trial, **options)[1].after.vector
            for trial in range(3 if small else 100)
        ]
        results.append(Result(name, natural.before.vector, natural.after.vector, np.array(shuffled)))
    return results


def draw(results: list[Result]) -> Figure:
    """The range over all orders, mesh by mesh."""
    figure, axes = new_figure(1, 2)
    for axis, one in zip(axes[0], results, strict=True):
        draw_band(axis, one.shuffled, f"range of {len(one.shuffled)} random orders")
        draw_vector(axis, one.before, color=BEFORE, ls="--", label="before")
        draw_vector(axis, one.natural, color=AFTER, label="index order")
        quality_axes(axis, one.name)
        axis.set_ylim(bottom=0)
        axis.legend()
    return figure


def main() -> None:
    """Run it, print the range of Q1, and draw the figure."""
    results = experiment()
    for one in results:
        q1 = one.shuffled[:, 0]
        print(f"{one.name}: Q1 {one.before[0]:.4f}, then {one.natural[0]:.4f} in index order and ", end="")
        print(f"{q1.min():.4f} to {q1.max():.4f} in {len(q1)} random orders")
    save(draw(results), "fig11_orders")


if __name__ == "__main__":
    main()
