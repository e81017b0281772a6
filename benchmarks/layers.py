"""Boundary layers and other stretching that is meant, before and after smoothing and when the wall moves.

Only what every version of the package has is used, so that
``PYTHONPATH=CHECKOUT python benchmarks/layers.py`` gives the table of that checkout.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from itertools import combinations

import numpy as np
from scipy.spatial import Delaunay

import dvr_cli
import layered
from layered import Layered

_EDGE = {2: np.array([[1.0, 0.5], [0.0, np.sqrt(0.75)]])}  # of the regular simplex, a column each
_EDGE[3] = np.array([[1.0, 0.5, 0.5], [0.0, np.sqrt(0.75), np.sqrt(1 / 12)], [0.0, 0.0, np.sqrt(2 / 3)]])
_PRISM = np.array([[1.0, 0.5, 0.0], [0.0, np.sqrt(0.75), 0.0], [0.0, 0.0, 1.0]])
_HEX = [
    (0, 1, 3, 4),
    (1, 2, 0, 5),
    (2, 3, 1, 6),
    (3, 0, 2, 7),
    (4, 7, 5, 0),
    (5, 4, 6, 1),
    (6, 5, 7, 2),
    (7, 6, 4, 3),
]
_WEDGE = [(0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2)]
# Of each type: its corners, the edges of their target, and the cell's edges.
_CELLS: dict[str, tuple[list[tuple[int, ...]], np.ndarray, list[tuple[int, int]]]] = {
    "triangle": ([(0, 1, 2)], _EDGE[2], list(combinations(range(3), 2))),
    "quad": (
        [(i, (i + 1) % 4, (i + 3) % 4) for i in range(4)],
        np.eye(2),
        [(i, (i + 1) % 4) for i in range(4)],
    ),
    "tetra": ([(0, 1, 2, 3)], _EDGE[3], list(combinations(range(4), 2))),
    "wedge": (_WEDGE, _PRISM, [(0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5), (0, 3), (1, 4), (2, 5)]),
    "hexahedron": (_HEX, np.eye(3), [(i, (i + 1) % 4 + j) for j in (0, 4) for i in range(4)]),
}
_CELLS["hexahedron"] = (
    *_CELLS["hexahedron"][:2],
    [
        *((i, (i + 1) % 4) for i in range(4)),
        *((i + 4, (i + 1) % 4 + 4) for i in range(4)),
        *((i, i + 4) for i in range(4)),
    ],
)
_LINEAR = {"triangle6": ("triangle", 3)}  # judged by its corners
_FLAT = 2.0  # edges along a layer over its height from which it counts as one


def meshes(quick: bool) -> dict[str, Callable[[], Layered]]:
    """The meshes of the table by name."""
    planar = {
        "cylinder, quads": lambda: layered.cylinder(True),
        "cylinder, triangles": lambda: layered.cylinder(False),
        "cylinder, triangles of second order": lambda: layered.cylinder(False, order=2),
        "cylinder on a bent surface": lambda: layered.bent(layered.cylinder(False)),
        "aerofoil, quads": lambda: layered.aerofoil(True),
        "aerofoil, triangles": lambda: layered.aerofoil(False),
        "backward step, quads": lambda: layered.backward_step(True),
        "backward step, triangles": lambda: layered.backward_step(False),
        "graded grid, quads": lambda: layered.graded_grid("quad"),
        "graded grid, triangles": lambda: layered.graded_grid("triangle"),
        "graded triangles, 1 : 100": layered.graded,
    }
    solid = {
        "pipe, wedges and tetrahedra": layered.pipe,
        "box, wedges": lambda: layered.box("wedge"),
        "box with a bump, hexahedra": lambda: layered.box("hexahedron", bump=True),
        "box with a bump, tetrahedra": lambda: layered.box("tetra", bump=True),
        "plate, hexahedra": layered.plate,
    }
    return planar if quick else {**planar, **solid}


def run(quick: bool) -> None:
    """Print the tables of layers."""
    from common import print_table

    header = ["mesh", "cells", "kept", "first height after / before: median", "least", "most"]
    header += ["other layers: least", "most", "wall normals turn by", "cells not kept: worst before", "after"]
    header += ["mean before", "after", "away from layers: worst before", "after", "mean before", "after"]
    print_table(
        "Layers: default options", header, (_row(name, make()) for name, make in meshes(quick).items())
    )
    header = ["cells", "points", "number", "kept", "same bits as --shape ideal"]
    print_table("Layers: Delaunay meshes of random points in a box", header, _clouds(quick))
    header = ["mesh", "moved", "first height after / before: median", "least", "most", "inverted"]
    print_table("Layers: dvr morph, default options", header, _moved_rows())


def _row(name: str, mesh: Layered) -> list[object]:
    points, report = dvr_cli.smooth(mesh.points, mesh.cells, threads=1)
    kept = report.shape.kept if hasattr(report, "shape") else "-"
    n = sum(len(rows) for rows in mesh.cells.values())
    columns = _columns(mesh)
    first, others, turned = _changes(mesh, points, columns)
    held = getattr(report, "kept", None)
    rest = np.ones(n, dtype=bool) if held is None else ~held
    figures = (
        [f"{np.median(first):.3f}", f"{first.min():.3f}", f"{first.max():.3f}"] if len(first) else ["-"] * 3
    )
    figures += [f"{others.min():.3f}", f"{others.max():.3f}"] if len(others) else ["-"] * 2
    figures += [f"{turned.max():.2f}°" if len(turned) else "-"]
    for part in (rest, ~_of_layers(mesh, columns) & ~_beside(mesh, ~rest)):
        before, after = _qualities(mesh, mesh.points)[part], _qualities(mesh, points)[part]
        if len(before):
            figures += [f"{value:.4f}" for value in (before.min(), after.min(), before.mean(), after.mean())]
        else:
            figures += ["-"] * 4
    return [name, n, kept, *figures]


def _clouds(quick: bool) -> Iterator[list[object]]:
    """Delaunay meshes of random points in a box: cells kept, and whether a sweep gives the bits of ideal."""
    for d, kind, sizes in ((2, "triangle", (1_000, 10_000, 100_000)), (3, "tetra", (1_000, 5_000, 20_000))):
        for n in sizes[: 2 if quick else 3]:
            points = np.random.default_rng(0).random((n, d))
            cells = Delaunay(points).simplices.astype(np.int64)
            volume = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]])
            cells[volume < 0] = cells[volume < 0][:, [1, 0, *range(2, d + 1)]]
            once = {"directions": "random", "max_iterations": 1, "patches": False, "threads": 1}
            auto, report = dvr_cli.smooth(points, {kind: cells}, shape="auto", **once)
            ideal, _ = dvr_cli.smooth(points, {kind: cells}, shape="ideal", **once)
            same = auto.tobytes() == ideal.tobytes()
            yield [kind, n, len(cells), report.shape.kept, "yes" if same else "no"]


def _moved_rows() -> Iterator[list[object]]:
    def half_a_diameter(x: np.ndarray) -> np.ndarray:
        return np.tile([0.5, 0.0], (len(x), 1))

    def ten_degrees(x: np.ndarray) -> np.ndarray:
        c, s = np.cos(np.radians(10)), np.sin(np.radians(10))
        return x @ np.array([[c, s], [-s, c]]) - x

    for quads, kind in ((True, "quads"), (False, "triangles")):
        for body, make, moved, by in (
            ("cylinder", layered.cylinder, half_a_diameter, "half its diameter"),
            ("aerofoil", layered.aerofoil, ten_degrees, "turned by 10°"),
        ):
            mesh = make(quads)
            shift = np.zeros_like(mesh.points)
            shift[mesh.wall] = moved(mesh.points[mesh.wall])
            points = _morphed(mesh, shift)
            first, _, _ = _changes(mesh, points, _columns(mesh))
            inverted = int((_qualities(mesh, points) <= 0).sum())
            heights = (f"{value:.3f}" for value in (np.median(first), first.min(), first.max()))
            yield [f"{body}, {kind}", by, *heights, inverted]


def _morphed(mesh: Layered, shift: np.ndarray) -> np.ndarray:
    """The points after ``dvr morph`` by a displacement (N, 2) of the wall."""
    from dvr_cli.api.morphing import morph_mesh
    from dvr_cli.api.options import SmoothOptions
    from dvr_cli.mesh.mesh import Cells, Mesh

    given = {"shape": "input"} if "shape" in SmoothOptions.__dataclass_fields__ else {}
    of = getattr(SmoothOptions, "of", None)
    options = of({"directions": "random", **given}) if of else SmoothOptions(directions="random")
    inner = Mesh(mesh.points, [Cells(kind, rows.astype(np.int64)) for kind, rows in mesh.cells.items()])
    return np.asarray(morph_mesh(inner, shift, options)[0])


def _columns(mesh: Layered) -> list[list[int]]:
    """From each vertex of the wall the vertices above it, as far as the layers there are flat."""
    points = mesh.points
    joined: dict[int, set[int]] = defaultdict(set)
    for kind, rows in mesh.cells.items():
        name, _ = _LINEAR.get(kind, (kind, 0))
        for a, b in _CELLS[name][2]:
            for u, v in rows[:, [a, b]].tolist():
                joined[u].add(v)
                joined[v].add(u)
    steps = {v: 0 for v in np.flatnonzero(mesh.wall).tolist() if v in joined}
    front = list(steps)
    while front:
        around = [(u, steps[v] + 1) for v in front for u in joined[v] if u not in steps]
        front = [u for u, k in around if steps.setdefault(u, k) == k]
        front = list(dict.fromkeys(front))
    columns = []
    for start in (v for v, k in steps.items() if k == 0):
        column = [start]
        while True:
            v = column[-1]
            up = [u for u in joined[v] if steps[u] == steps[v] + 1]
            beside = [u for u in joined[v] if steps[u] == steps[v]]
            if not up or not beside:
                break
            lengths = np.linalg.norm(points[up] - points[v], axis=1)
            along = np.linalg.norm(points[beside] - points[v], axis=1).mean()
            if lengths.min() * _FLAT > along:
                break
            column.append(up[int(lengths.argmin())])
        if len(column) > 1:
            columns.append(column)
    return columns


def _changes(
    mesh: Layered, points: np.ndarray, columns: list[list[int]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights after / before of the first layer and of all others but the outermost, degrees of the first."""
    first, others, turned = [], [], []
    for column in columns:
        before, after = np.diff(mesh.points[column], axis=0), np.diff(points[column], axis=0)
        size, new = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
        first.append(new[0] / size[0])
        others += (new[1:-1] / size[1:-1]).tolist()
        cosine = before[0] @ after[0] / (size[0] * new[0])
        sine = np.sqrt(max(0.0, np.square(after[0] / new[0] - cosine * before[0] / size[0]).sum()))
        turned.append(np.degrees(np.arctan2(sine, cosine)))
    return np.array(first), np.array(others), np.array(turned)


def _of_layers(mesh: Layered, columns: list[list[int]]) -> np.ndarray:
    """(n,) bool: the cells of layers and those that touch them, in the order of the blocks."""
    inside = np.zeros(len(mesh.points), dtype=bool)
    inside[[v for column in columns for v in column]] = True
    touched = inside.copy()
    for rows in mesh.cells.values():
        touched[rows[inside[rows].any(axis=1)]] = True
    return np.concatenate([touched[rows].any(axis=1) for rows in mesh.cells.values()])


def _beside(mesh: Layered, cells: np.ndarray) -> np.ndarray:
    """(n,) bool: those of ``cells`` ((n,) bool) and all with a vertex of one, in the order of the blocks."""
    blocks = list(mesh.cells.values())
    touched = np.zeros(len(mesh.points), dtype=bool)
    for rows, part in zip(
        blocks, np.split(cells, np.cumsum([len(rows) for rows in blocks])[:-1]), strict=True
    ):
        touched[rows[part]] = True
    return np.concatenate([touched[rows].any(axis=1) for rows in blocks])


def _qualities(mesh: Layered, points: np.ndarray) -> np.ndarray:
    """(n,) plain mean ratio of each cell, the smallest of its corners'; of cells inside out its negative."""
    result = []
    for kind, rows in mesh.cells.items():
        name, count = _LINEAR.get(kind, (kind, rows.shape[1]))
        corners, target, _ = _CELLS[name]
        inverse, d = np.linalg.inv(target), len(target)
        of_corners = []
        for corner in corners:
            x = points[rows[:, :count][:, list(corner)]]
            a = (x[:, 1:] - x[:, :1]).transpose(0, 2, 1) @ inverse
            gram = np.einsum("nji,njk->nik", a, a)
            det = np.linalg.det(a) if a.shape[1] == d else np.sqrt(np.linalg.det(gram))
            of_corners.append(np.sign(det) * d * np.abs(det) ** (2 / d) / np.einsum("nii->n", gram))
        quality = np.array(of_corners)
        start = mesh.points[rows[:, list(corners[0])]]
        if start.shape[2] == d:
            quality *= np.sign(
                np.median(np.linalg.det(start[:, 1:] - start[:, :1]))
            )  # as cells of the file go
        result.append(quality.min(axis=0))
    return np.concatenate(result)


if __name__ == "__main__":
    run("--quick" in sys.argv)
