"""Figures 1 and 4: one vertex moved to where the worst triangle around it is best.

In Fig. 1 it moves up or down, then sideways, among four triangles. In Fig. 4 it has two triangles, and the
optimum is the maximum of one quality curve or the crossing of both, depending on the direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

import dvr_cli
from common import AFTER, BEFORE, OTHER, SWEEPS, new_figure, save, triangle_quality
from dvr_cli.mesh.corners import corners_of
from dvr_cli.mesh.mesh import Cells
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.problem import build_problem

SQUARE = np.array([[0.35, 0.85], [0, 0], [1, 0.1], [0.9, 1], [0.1, 1.05]])
FOUR = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]])
# The paper gives no coordinates for Fig. 4, but λ and qualities to two or three digits; these fulfil all.
PAIR = np.array([[0, 0], [-0.3398, -0.1291], [0.2407, -0.7976], [0.4719, -0.8126], [0.6291, 0.1129]])
TWO = np.array([[0, 1, 2], [0, 3, 4]])


@dataclass
class Move:
    """The first vertex of ``points`` moved along ``direction`` by ``step``; qualities before and there."""

    points: np.ndarray
    triangles: np.ndarray
    direction: np.ndarray
    step: float
    before: np.ndarray
    after: np.ndarray

    def curves(self, steps: np.ndarray) -> np.ndarray:
        """(n, triangles) the qualities for each of ``steps`` (n,)."""
        moved = np.repeat(self.points[None], len(steps), axis=0)
        moved[:, 0] += steps[:, None] * self.direction
        return triangle_quality(moved, self.triangles)


def moved_first(points: np.ndarray, triangles: np.ndarray, direction: np.ndarray) -> Move:
    """Relax the first vertex once; the engine is asked directly, as here that vertex is on the boundary."""
    problem = build_problem(corners_of([Cells("triangle", triangles)], 2), np.array([0]), points)
    engine = NumpyEngine(problem)
    engine.load(points)
    engine.relax_batch(0, direction[None])
    step = float((engine.points[0] - points[0]) @ direction)
    qualities = [triangle_quality(at, triangles) for at in (points, engine.points)]
    return Move(points, triangles, direction, step, *qualities)


def experiment(small: bool = False) -> dict[str, Move]:
    """The two moves of Fig. 1, first up or down, then sideways, and those of Fig. 4; small is the same."""
    up, right = np.array([0.0, 1.0]), np.array([1.0, 0.0])
    first = moved_first(SQUARE, FOUR, up)
    halfway, _ = dvr_cli.smooth(SQUARE, {"triangle": FOUR}, directions="y", max_iterations=1, **SWEEPS)
    second = moved_first(halfway, FOUR, right)
    inclined = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6)])
    pair = {"Fig. 4a": moved_first(PAIR, TWO, up), "Fig. 4b": moved_first(PAIR, TWO, inclined)}
    return {"Fig. 1, first": first, "Fig. 1, second": second} | pair


def draw(moves: dict[str, Move]) -> Figure:
    """Each move with its quality curves below."""
    figure, axes = new_figure(2, 4, height=5.6)
    for (name, move), picture, plot in zip(moves.items(), axes[0], axes[1], strict=True):
        after = move.points.copy()
        after[0] += move.step * move.direction
        picture.triplot(*move.points.T, move.triangles, color=BEFORE, lw=1, ls="--")
        picture.triplot(*after.T, move.triangles, color=AFTER, lw=1.4)
        picture.plot(*after[0], "o", color=AFTER)
        picture.plot(*move.points[0], "o", mfc="white", color=BEFORE)
        picture.set(title=name, aspect="equal")
        picture.axis("off")
        steps = np.linspace(-0.6, 0.6, 400)
        curves = move.curves(steps)
        plot.plot(steps, curves, color=OTHER, lw=1)
        plot.plot(steps, curves.min(axis=1), color=AFTER, lw=2.2)
        plot.axvline(move.step, color=AFTER, lw=0.8, ls=":")
        plot.plot(0, move.before.min(), "o", mfc="white", color=BEFORE)
        plot.plot(move.step, move.after.min(), "o", color=AFTER)
        title = f"λ = {move.step:.3f}: {move.before.min():.2f} → {move.after.min():.2f}"
        plot.set(xlabel="λ", ylabel="mean ratio", ylim=(0, 1), title=title)
        plot.grid(alpha=0.3)
    return figure


def main() -> None:
    """Run it and draw the figure."""
    save(draw(experiment()), "fig01_04_one_vertex")


if __name__ == "__main__":
    main()
