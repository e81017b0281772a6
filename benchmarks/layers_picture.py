"""The picture of docs/layers.md: the nose of an aerofoil before and after.

``python benchmarks/layers_picture.py`` makes it anew.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection

import dvr_cli
import layered

_PAGE = Path(__file__).parent.parent / "docs"
_AHEAD, _BEHIND, _BESIDE = 0.05, 0.3, 0.14  # of the nose, in chords, is what is drawn


def main() -> None:
    """Draw the cells near the nose, darker the longer and flatter they are."""
    mesh = layered.aerofoil(True)
    x, y = min(mesh.points[mesh.wall][:, :2].tolist())
    states = {
        "input": mesh.points,
        "dvr smooth": dvr_cli.smooth(mesh.points, mesh.cells)[0],
        "dvr smooth --shape ideal": dvr_cli.smooth(mesh.points, mesh.cells, shape="ideal")[0],
    }
    figure, panes = plt.subplots(1, 3, figsize=(14.4, 4.5))
    for pane, (title, points) in zip(panes, states.items(), strict=True):
        for cells in mesh.cells.values():
            corners = points[cells][:, :, :2]
            edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
            flat = np.log2(edges.max(axis=1) / edges.min(axis=1))
            drawn = PolyCollection(corners, array=flat, cmap="Blues", clim=(0, 4), ec="0.3", lw=0.5)
            pane.add_collection(drawn)
        pane.set(title=title, xticks=[], yticks=[], aspect="equal")
        pane.set(xlim=(x - _AHEAD, x + _BEHIND), ylim=(y - _BESIDE, y + _BESIDE))
    figure.tight_layout()
    figure.savefig(_PAGE / "layers.png", dpi=100)


if __name__ == "__main__":
    main()
