"""Figures 8 and 9: triangle meshes after 25 sweeps and tetrahedral meshes after 40, random directions.

The paper's meshes come from repositories that are not at hand; these are the sample meshes and some that
Gmsh makes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import gmsh
import numpy as np
from matplotlib.figure import Figure

import dvr_cli
from common import AFTER, BEFORE, Cells, draw_vector, new_figure, quality_axes, random_mesh, sample, save


@dataclass
class Improvement:
    """What became of one mesh: numbers of elements and relaxed vertices, quality vectors before and after."""

    name: str
    elements: int
    relaxed: int
    before: np.ndarray
    after: np.ndarray


def meshed(size: float, solid: Callable[[], object]) -> tuple[np.ndarray, Cells]:
    """Gmsh's tetrahedra, as its Delaunay algorithm leaves them, of what ``solid`` adds to the model."""
    gmsh.initialize(["gmsh"], readConfigFiles=False, interruptible=False)
    try:
        for option, value in {
            "General.Terminal": 0,
            "General.NumThreads": 1,
            "Mesh.Optimize": 0,
            "Mesh.MeshSizeMin": size,
            "Mesh.MeshSizeMax": size,
        }.items():
            gmsh.option.setNumber(option, value)
        solid()
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(3)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
        number[tags] = np.arange(len(tags))
        _, nodes = gmsh.model.mesh.getElementsByType(4)
        return coordinates.reshape(-1, 3), {"tetra": number[nodes].reshape(-1, 4)}
    finally:
        gmsh.finalize()


def drilled_block() -> None:
    """A block with two crossing holes."""
    occ = gmsh.model.occ
    holes = [
        (3, occ.addCylinder(0.5, -1, 0.5, 0, 3, 0, 0.2)),
        (3, occ.addCylinder(-1, 0.5, 0.4, 4, 0, 0, 0.15)),
    ]
    occ.cut([(3, occ.addBox(0, 0, 0, 1.6, 1, 0.9))], holes)


def experiment(small: bool = False) -> list[Improvement]:
    """Each mesh relaxed; small: the smaller ones only."""
    meshes = {
        "random square": sample("random_square.msh"),
        "random panel": sample("panel.obj"),
        "random cube": sample("random_cube.vtk"),
        "random ball": sample("negative_ball.msh"),
        "Gmsh: ball": meshed(0.3, lambda: gmsh.model.occ.addSphere(0, 0, 0, 1)),
    }
    if not small:
        meshes |= {
            "random triangles": random_mesh(1500, 2, 0),
            "Gmsh: torus": meshed(0.25, lambda: gmsh.model.occ.addTorus(0, 0, 0, 2, 0.8)),
            "Gmsh: block": meshed(0.09, drilled_block),
        }
    results = []
    for name, (points, cells) in meshes.items():
        (block,) = cells.values()
        sweeps = 25 if block.shape[1] == 3 else 40
        _, report = dvr_cli.smooth(points, cells, preset="paper", max_iterations=sweeps)
        vectors = report.before.vector, report.after.vector
        results.append(Improvement(name, len(block), report.relaxed, *vectors))
    return results


def draw(results: list[Improvement]) -> Figure:
    """Quality vectors before and after, mesh by mesh."""
    figure, axes = new_figure(2, (len(results) + 1) // 2, height=5.8)
    for axis, one in zip(axes.flat, results, strict=False):
        draw_vector(axis, one.before, color=BEFORE, ls="--", label="before")
        draw_vector(axis, one.after, color=AFTER, label="after")
        title = f"{one.name}: Q1 {one.before[0]:.2g} → {one.after[0]:.2f}"
        quality_axes(axis, f"{title}\n{one.elements} elements, {one.relaxed} relaxed")
        axis.title.set_fontsize(10)
        axis.set_ylim(bottom=0)
    for axis in axes.flat[len(results) :]:
        axis.axis("off")
    axes.flat[0].legend()
    return figure


def main() -> None:
    """Run it, print a table, and draw the figure."""
    results = experiment()
    for one in results:
        print(f"{one.name:22} {one.elements:6} {one.relaxed:6} {one.before[0]:8.4f} {one.after[0]:8.4f}")
    save(draw(results), "fig08_09_collection")


if __name__ == "__main__":
    main()
