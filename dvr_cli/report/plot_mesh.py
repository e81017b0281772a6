"""Pictures of meshes coloured by quality, each drawn into given matplotlib axes.

A planar mesh is drawn as it is. Of a volume mesh there are two views, both by parallel projection with faces
drawn from back to front: the boundary with the worst elements picked out, and the rest when the cells
before a plane are taken away. The colour of a face is the quality of its cell, where that is not masked: kept
cells, whose quality says nothing, are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import Colormap

from dvr_cli.mesh.facets import Facets, facets_of
from dvr_cli.mesh.mesh import Cells

INVERTED = "#d55e00"  # vermilion: told from every colour of the scale, also by the colour-blind
KEPT = "#56b4e9"  # sky blue: the same
_RASTER = 3000  # faces from which on a picture is stored as pixels
_FINE = 20_000  # faces from which on their edges would only cover them
_FEW = 1000  # cells up to which one that is picked out is seen without a ring around it
_TO_VIEWER = np.array([0.52, -0.74, 0.43]) / np.linalg.norm([0.52, -0.74, 0.43])


def colour_scale() -> Colormap:
    """cividis for qualities from 0 to 1, another colour below 0, and one for what is masked."""
    return colormaps["cividis"].with_extremes(under=INVERTED, bad=KEPT)


def plot_plane(
    axes: Axes, points: np.ndarray, cells: Sequence[Cells], qualities: np.ndarray, worst: Sequence[int] = ()
) -> PolyCollection:
    """Draw a planar mesh.

    points: (N, 2). cells: blocks of triangles or quadrilaterals. qualities: (n,) of all cells in order.
    worst: numbers of cells to draw a ring around.
    """
    drawn = _draw(axes, points, _faces(cells), qualities)
    _rings(axes, _centroids(points, cells, worst))
    return drawn


def plot_surface(
    axes: Axes, points: np.ndarray, cells: Sequence[Cells], qualities: np.ndarray, worst: Sequence[int] = ()
) -> PolyCollection:
    """Draw a surface in space from both its sides.

    points: (N, 3). cells: blocks of triangles or quadrilaterals. qualities: (n,) of all cells in order.
    worst: numbers of cells to draw a ring around.
    """
    drawn = _project(axes, points, _faces(cells), qualities, hidden=True)
    _rings(axes, project(_centroids(points, cells, worst)))
    return drawn


def plot_boundary(
    axes: Axes, points: np.ndarray, cells: Sequence[Cells], qualities: np.ndarray, worst: Sequence[int] = ()
) -> PolyCollection:
    """Draw the boundary of a volume mesh, translucent, and its worst elements within.

    points: (N, 3). cells: blocks of positively oriented volume cells. qualities: (n,) of all cells in order.
    worst: numbers of cells to pick out.
    """
    facets = facets_of(list(cells))
    outside = _boundary(facets)
    drawn = _project(axes, points, facets.sides[outside], qualities[facets.owner[outside]], alpha=0.4)
    picked = np.flatnonzero(np.isin(facets.owner, worst))
    _project(axes, points, facets.sides[picked], qualities[facets.owner[picked]], edge="black", zorder=3)
    if len(qualities) > _FEW:
        _rings(axes, project(_centroids(points, cells, worst)))
    return drawn


def plot_cut(axes: Axes, points: np.ndarray, cells: Sequence[Cells], qualities: np.ndarray) -> PolyCollection:
    """Draw a volume mesh without the cells that lie before the middle of its thinnest direction.

    points: (N, 3). cells: blocks of positively oriented volume cells. qualities: (n,) of all cells in order.
    """
    used = np.unique(np.concatenate([block.vertices.ravel() for block in cells]))
    low, high = points[used].min(axis=0), points[used].max(axis=0)
    order = np.array([1, 0, 2])  # where extents tie, the cut faces the viewer most
    axis = order[np.argmin((high - low)[order].round(12))]
    sign = np.sign(_TO_VIEWER[axis])
    middle = (low + high)[axis] / 2
    kept, numbers, first = [], [], 0
    for block in cells:
        behind = (points[block.vertices, axis].mean(axis=1) - middle) * sign <= 0
        kept.append(Cells(block.type, block.vertices[behind]))
        numbers.append(first + np.flatnonzero(behind))
        first += len(behind)
    facets = facets_of(kept)
    outside = _boundary(facets)
    values = qualities[np.concatenate(numbers)][facets.owner[outside]]
    return _project(axes, points, facets.sides[outside], values)


def project(points: np.ndarray) -> np.ndarray:
    """(N, 2) places in the picture, to the right and up, of points (N, 3)."""
    right = np.cross([0.0, 0.0, 1.0], _TO_VIEWER)
    right /= np.linalg.norm(right)
    return points @ np.column_stack([right, np.cross(_TO_VIEWER, right)])


def _boundary(facets: Facets) -> np.ndarray:
    """The numbers of the facets that one cell alone has."""
    return facets.order[facets.start[:-1][facets.shared_by == 1]]


def _project(
    axes: Axes,
    points: np.ndarray,
    faces: np.ndarray,
    values: np.ndarray,
    alpha: float = 1.0,
    edge: str = "white",
    zorder: float = 1,
    hidden: bool = False,
) -> PolyCollection:
    """Draw faces (F, w) from back to front; those that look away from the viewer only if ``hidden``."""
    corners = points[_filled(faces)]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
    seen = np.flatnonzero((normals @ _TO_VIEWER > 0) | hidden)
    depth = corners[seen].mean(axis=1) @ _TO_VIEWER
    seen = seen[np.argsort(depth, kind="stable")]
    return _draw(axes, project(points), faces[seen], values[seen], alpha, edge, zorder)


def _draw(
    axes: Axes,
    flat: np.ndarray,
    faces: np.ndarray,
    values: np.ndarray,
    alpha: float = 1.0,
    edge: str = "white",
    zorder: float = 1,
) -> PolyCollection:
    """Draw faces (F, w) as polygons in the plane, coloured by ``values`` (F,)."""
    many = len(faces) > _FINE
    polygons = flat[_filled(faces)]
    drawn = PolyCollection(
        polygons,
        array=values,
        cmap=colour_scale(),
        clim=(0.0, 1.0),
        edgecolors="face" if many else edge,
        linewidths=0.1 if many else float(np.clip(12.0 / max(len(faces), 1) ** 0.5, 0.1, 0.6)),
        alpha=alpha,
        rasterized=len(faces) > _RASTER,
        zorder=zorder,
    )
    drawn.set_in_layout(False)  # within the axes, and slow to measure
    axes.add_collection(drawn, autolim=False)
    if len(faces):
        axes.update_datalim([polygons.min(axis=(0, 1)), polygons.max(axis=(0, 1))])
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.axis("off")
    return drawn


def _rings(axes: Axes, centres: np.ndarray) -> None:
    """Draw rings around places (K, 2), that elements be found where they are small."""
    if len(centres):
        x, y = centres.T
        for colour, width in (("white", 2.4), (INVERTED, 1.0)):  # seen on cells of any colour
            axes.scatter(x, y, s=90, facecolors="none", edgecolors=colour, linewidths=width, zorder=4)


def _centroids(points: np.ndarray, cells: Sequence[Cells], numbers: Sequence[int]) -> np.ndarray:
    """(K, d) centroids of the cells with these numbers, counted through the blocks."""
    first = np.cumsum([0, *(len(block.vertices) for block in cells)])
    centroids = np.empty((len(numbers), points.shape[1]))
    for row, number in enumerate(numbers):
        block = int(np.searchsorted(first, number, side="right")) - 1
        centroids[row] = points[cells[block].vertices[number - first[block]]].mean(axis=0)
    return centroids


def _faces(cells: Sequence[Cells]) -> np.ndarray:
    """(F, w) the vertices of planar cells, of triangles among quadrilaterals with -1 at the end."""
    width = max(block.vertices.shape[1] for block in cells)
    padded = [
        np.pad(b.vertices, ((0, 0), (0, width - b.vertices.shape[1])), constant_values=-1) for b in cells
    ]
    return np.concatenate(padded)


def _filled(faces: np.ndarray) -> np.ndarray:
    """Faces in which the last vertex stands where shorter ones end in -1."""
    count = (faces >= 0).sum(axis=1, keepdims=True)
    return np.take_along_axis(faces, np.minimum(np.arange(faces.shape[1]), count - 1), axis=1)
