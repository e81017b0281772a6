"""Draws the README's picture: ``python sample_meshes/picture.py`` (needs matplotlib).

A sample mesh before and after ``dvr smooth``, triangles coloured by quality, and both quality vectors.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import dvr_cli
from dvr_cli.files.reading import open_mesh

HERE = Path(__file__).parent


def main() -> None:
    """Smooth the mesh and write random_square.png beside this script."""
    mesh = open_mesh(HERE / "random_square.msh").mesh
    triangles = np.concatenate([block.vertices for block in mesh.cells if block.type == "triangle"])
    points, report = dvr_cli.smooth(mesh.points, [(block.type, block.vertices) for block in mesh.cells])
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.8), width_ratios=[1, 1, 1.15], layout="constrained")
    states = (("before", mesh.points, report.before), ("after", points, report.after))
    for axis, (name, at, quality) in zip(axes, states, strict=False):
        colours = axis.tripcolor(
            at[:, 0],
            at[:, 1],
            triangles,
            quality.elements,
            vmin=0,
            vmax=1,
            cmap="cividis",
            ec="white",
            lw=0.4,
        )
        axis.set_title(f"{name}: worst quality {quality.q1:.3f}")
        axis.set_aspect("equal")
        axis.axis("off")
    figure.colorbar(colours, ax=axes[:2], location="bottom", shrink=0.5, label="mean ratio", pad=0.02)
    rank = np.arange(1, report.relaxed + 1)
    axes[2].semilogx(rank, report.before.vector, color="#b35900", ls="--", label="before")
    axes[2].semilogx(rank, report.after.vector, color="#00306f", label="after")
    axes[2].set(xlabel="component of the quality vector", ylabel="mean ratio", ylim=(0, 1))
    axes[2].grid(alpha=0.3, which="both")
    axes[2].legend()
    figure.savefig(HERE / "random_square.png", dpi=110)


if __name__ == "__main__":
    main()
