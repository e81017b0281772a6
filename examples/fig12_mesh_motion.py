"""Figure 12: a hexagon's vertices carried along circles by a flow, and brought back.

The paper does not say how its mesh was distorted; ours is turned by an angle that depends on the radius and
vanishes on the boundary, as if advected by a vortex.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from common import HexagonRun as Run
from common import draw_runs, hexagon, relaxed_hexagon, save, turned


def experiment(small: bool = False) -> dict[str, Run]:
    """Relaxed along the axes in turn and along circles, until Q1 is 0.95; small: half as many rings."""
    points, cells = hexagon(4 if small else 8)
    radius = np.linalg.norm(points, axis=1) / np.sqrt(0.75)  # 1 where the boundary is closest to the centre
    points = turned(points, 0.7 * np.sin(np.pi * np.minimum(radius, 1)) ** 2)
    return {name: relaxed_hexagon(points, cells, name) for name in ("axis", "circumferential")}


def draw(runs: dict[str, Run]) -> Figure:
    """The distorted mesh, both results, and how Q1 grew."""
    return draw_runs(runs)


def main() -> None:
    """Run it, print the sweeps needed, and draw the figure."""
    runs = experiment()
    for name, run in runs.items():
        print(f"{name}: Q1 {run.q1[0]:.3f} to {run.q1[-1]:.3f} in {len(run.q1) - 1} sweeps")
    save(draw(runs), "fig12_mesh_motion")


if __name__ == "__main__":
    main()
