"""Figure 13: the boundary of a hexagon turned by 18 degrees, its centre held, and the mesh brought after it.

The move inverts the outermost triangles. Relaxing makes them positive again and straightens the mesh.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from common import HexagonRun as Run
from common import draw_runs, hexagon, relaxed_hexagon, save, turned

DIRECTIONS = ("axis", "circumferential,radial", "circumferential")


def experiment(small: bool = False) -> dict[str, Run]:
    """Relaxed along the axes, along circles and radii in turn, and along circles, until Q1 is 0.95.

    small: at most 60 sweeps instead of 150.
    """
    points, cells = hexagon(8)
    normals = np.pi / 6 + np.pi / 3 * np.arange(3)
    boundary = np.abs(points @ [np.cos(normals), np.sin(normals)]).max(axis=1) > np.sqrt(0.75) - 1e-9
    points = turned(points, np.where(boundary, np.radians(18), 0.0))
    return {name: relaxed_hexagon(points, cells, name, 60 if small else 150) for name in DIRECTIONS}


def draw(runs: dict[str, Run]) -> Figure:
    """The deformed mesh, the results, and how Q1 grew."""
    return draw_runs(runs)


def main() -> None:
    """Run it, print the sweeps needed, and draw the figure."""
    runs = experiment()
    for name, run in runs.items():
        print(f"{name}: Q1 {run.q1[0]:.3f} to {run.q1[-1]:.3f} in {len(run.q1) - 1} sweeps")
    save(draw(runs), "fig13_boundary_motion")


if __name__ == "__main__":
    main()
